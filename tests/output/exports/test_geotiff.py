"""GeoTIFFs: every pixel has the number of its cell, and the file is cloud-optimised."""

from __future__ import annotations

import dataclasses
import json
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import rasterio
from machine import PATIENCE_S
from rio_cogeo.cogeo import cog_validate
from sentences import refused
from small_city import chances_of, small_city, small_evaluation, small_location

from semsig_gis.core import ERROR_BREAKS, FAILURES, GridSpec, InputError
from semsig_gis.evaluation import error_field
from semsig_gis.output import (
    AMBIGUITY,
    CHANCES,
    ERRORS,
    FAILED,
    IDENTIFIABILITY,
    by_pixel,
    cell_errors,
    export_answer,
    export_database,
    export_geotiff,
)
from semsig_gis.storage import raster

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase


SCALES = {
    "ambiguity": AMBIGUITY,
    "identifiability": IDENTIFIABILITY,
    "error": ERRORS,
    "field": FAILED,
    "posterior": CHANCES,
}


def assert_holds(file: Path, database: SignatureDatabase, values: np.ndarray) -> None:
    """Check the value at every cell, and the file as ``rio cogeo validate --strict`` does."""
    assert cog_validate(file, strict=True) == (True, [], [])
    with rasterio.open(file) as read:
        assert read.crs == rasterio.CRS.from_wkt(database.crs.to_wkt())
        assert (read.count, read.dtypes[0]) == (1, "float32")
        assert np.isnan(read.nodata)
        pixels = np.array([value[0] for value in read.sample(database.xy)])
        assert np.array_equal(pixels, values.astype(np.float32), equal_nan=True)
        assert np.isfinite(read.read(1)).sum() == np.isfinite(values).sum()


@pytest.mark.parametrize("grid", [GridSpec(), GridSpec(7.5, (3.0, -1e6))])
def test_pixels_have_the_values_of_cells(
    grid: GridSpec, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(raster, "TILE", 16)
    database = dataclasses.replace(small_city()[0], grid=grid)
    values = np.where(database.lengths > 3, database.lengths, np.nan)
    file = tmp_path / "a.tif"
    export_geotiff(database, values, file, name="objects seen", unit="objects")
    assert_holds(file, database, values)
    with rasterio.open(file) as read:
        assert read.descriptions == ("objects seen",)
        assert read.units == ("objects",)
        assert read.tags()["licenses"] == "\n".join(database.licenses)
        assert read.overviews(1)
    assert list(tmp_path.iterdir()) == [file]


def test_rasters_of_a_city_and_an_answer(tmp_path: Path) -> None:
    database, _ = small_city()
    chances, evaluation, location = chances_of(database), small_evaluation(), small_location()
    export_database(database, tmp_path / "a.tif", identifiability=chances)
    file = tmp_path / "i.tiff"
    export_database(database, file, layers=["identifiability"], identifiability=chances)
    export_database(database, tmp_path / "e.tif", layers=["error"], evaluation=evaluation)
    export_answer(location, database, tmp_path / "p.tif")
    for name, values in {
        "a.tif": database.type_group_sizes,
        "i.tiff": chances.found,
        "e.tif": cell_errors(evaluation, database),
        "p.tif": location.posterior.chances,
    }.items():
        assert_holds(tmp_path / name, database, values)
    with rasterio.open(tmp_path / "p.tif") as read:
        tags = {name: json.loads(read.tags()[name]) for name in ("query", "north", "prior")}
    assert tags.items() <= location.to_dict().items()


@pytest.mark.parametrize("radius", [None, 40.0])
def test_raster_of_the_error_field(radius: float | None, tmp_path: Path) -> None:
    database, evaluation, file = small_city()[0], small_evaluation(), tmp_path / "field.tif"
    export_database(database, file, layers="field", evaluation=evaluation, smooth=radius)
    field = error_field(evaluation, database, radius=radius)
    assert cog_validate(file, strict=True) == (True, [], [])
    with rasterio.open(file) as read:
        assert read.descriptions == ("failed", "error", "queries")
        assert read.units == (None, "m", "queries")
        assert json.loads(read.tags()["radius_m"]) == field.radius
        places = [(query.x, query.y) for query in evaluation.queries.geometry]
        samples = np.array(list(read.sample(places)))
        assert read.res == (field.grid.step, field.grid.step)
        whole = read.read(1)
    columns, rows = field.grid.cells_at(np.array(places))
    for band, values in enumerate((field.failed, field.errors, field.speaking)):
        assert np.array_equal(samples[:, band], values[rows, columns].astype(np.float32))
    assert np.isfinite(whole).sum() == np.isfinite(field.failed).sum()


def test_qgis_draws_rasters_as_the_maps_do(
    qgis_python: str, qgis_environment: dict[str, str], tmp_path: Path
) -> None:
    database, evaluation = small_city()[0], small_evaluation("medium")
    export_database(database, tmp_path / "ambiguity.tif")
    file = tmp_path / "identifiability.tif"
    export_database(database, file, layers="identifiability", identifiability=chances_of(database))
    export_database(database, tmp_path / "error.tif", layers="error", evaluation=evaluation)
    field = tmp_path / "field.tif"
    export_database(database, field, layers="field", evaluation=evaluation, smooth=60.0)
    export_answer(small_location(), database, tmp_path / "posterior.tif")
    program = Path(__file__).parents[2] / "qgis_programs.py"
    result = subprocess.run(
        [qgis_python, program, "pixels", *(tmp_path / f"{name}.tif" for name in SCALES)],
        check=True, capture_output=True, timeout=PATIENCE_S, env=qgis_environment,
    )  # fmt: skip
    drawings = map(json.loads, result.stdout.splitlines())
    for (name, scale), drawing in zip(SCALES.items(), drawings, strict=True):
        classes = [(low, label, colour) for low, _, label, colour in scale.ranges]
        below = [(0.0, scale.below, "")] if scale.below else []
        lows, labels, colours = map(np.array, zip(*below, *classes, strict=True))
        assert drawing["labels"] == labels.tolist()
        with rasterio.open(tmp_path / f"{name}.tif") as read:
            values = read.read(1).astype(np.float64)
        levels = np.searchsorted(lows, values, side="right") - 1
        # A value at the border of two classes has the colour of either.
        sure = np.isfinite(values) & ~np.isin(values, lows[1:].astype(np.float32))
        sure |= np.isfinite(values) & (name == "ambiguity")  # its classes have no common border
        pixels = np.array(drawing["pixels"])
        shown = np.where(pixels == None, "", pixels)  # noqa: E711 - element by element
        assert (shown[sure] == colours[levels[sure]]).all()
        assert (pixels[np.isnan(values)] == None).all()  # noqa: E711 - element by element
        assert len({*levels[sure].tolist()}) > 2


def test_style_file_is_replaced_with_the_raster(tmp_path: Path) -> None:
    database, file = small_city()[0], tmp_path / "a.tif"
    export_database(database, file, layers="field", evaluation=small_evaluation())
    failed = file.with_suffix(".qml").read_text()
    export_database(database, file)
    assert file.with_suffix(".qml").read_text() == by_pixel(AMBIGUITY) != failed
    # Mean errors have the colours of shares that failed, the larger the darker.
    assert ERRORS.colours == tuple(FAILURES.values())
    assert ERRORS.breaks[1:] == (*ERROR_BREAKS, np.inf)


def test_large_raster_is_cloud_optimised(tmp_path: Path) -> None:
    database, _ = small_city()
    columns = database.columns + np.where(np.arange(len(database)) < len(database) // 2, 0, 1500)
    wide = dataclasses.replace(database, columns=columns.astype(np.int32))
    export_geotiff(wide, wide.lengths, tmp_path / "a.tif", name="a")
    assert_holds(tmp_path / "a.tif", wide, wide.lengths)


def test_error_of_a_cell_is_the_mean_of_its_queries() -> None:
    database, evaluation = small_city()[0], small_evaluation()
    expected = np.full(len(database), np.nan)
    for row, cell in enumerate(database.cell_ids.tolist()):
        errors = evaluation.queries.loc[evaluation.queries["cell_id"] == cell, "error_m"]
        finite = errors[np.isfinite(errors)]
        if len(finite):
            expected[row] = finite.mean()
    assert np.isfinite(expected).sum() > 20
    assert np.allclose(cell_errors(evaluation, database), expected, equal_nan=True)
    elsewhere = evaluation.queries.copy()
    elsewhere.loc[:, ["cell", "cell_id"]] = -1, -7
    none = cell_errors(dataclasses.replace(evaluation, queries=elsewhere), database)
    assert np.isnan(none).all()


def test_wrong_number_of_values_and_too_wide_raster_are_refused(tmp_path: Path) -> None:
    database, _ = small_city()
    with refused(InputError, "2 numbers", f"{len(database)} cells"):
        export_geotiff(database, [1.0, 2.0], tmp_path / "a.tif", name="a")
    columns = database.columns.copy()
    columns[-1] += 10**9
    far = dataclasses.replace(database, columns=columns)
    with refused(InputError, "too wide"):
        export_geotiff(far, far.lengths, tmp_path / "a.tif", name="a")
    assert not list(tmp_path.iterdir())
