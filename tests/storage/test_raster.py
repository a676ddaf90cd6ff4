from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS, Transformer
from rasterio.transform import Affine
from sentences import refused

from semsig_gis.core import CrsError, GridSpec, InputError, SourceError
from semsig_gis.storage import raster_at_cells

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

LAMBERT = CRS("EPSG:2154")
GRID = GridSpec(step=10.0, origin=(3.0, -4.0))
CORNER = (650_003.0, 6_860_006.0)  # lower left corner of cell FIRST
FIRST = (65_000, 686_001)


def write(
    path: Path,
    values: Any,  # noqa: ANN401 - any array-like
    *,
    pixel: float = 10.0,
    corner: tuple[float, float] = CORNER,
    crs: CRS | None = LAMBERT,
    **options: Any,  # noqa: ANN401 - options of rasterio
) -> Path:
    """Write bands at a lower left corner; their first row is the southern one."""
    bands = np.asarray(values)
    bands = bands[None] if bands.ndim == 2 else bands
    height = bands.shape[1]
    place = Affine(pixel, 0, corner[0], 0, -pixel, corner[1] + height * pixel)
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        count=len(bands),
        height=height,
        width=bands.shape[2],
        dtype=bands.dtype,
        crs=None if crs is None else crs.to_wkt(),
        transform=place,
        **options,
    ) as file:
        file.write(bands[:, ::-1])
    return path


def read(path: Path, cells: Sequence[tuple[int, int]], **options: Any) -> NDArray[np.float64]:  # noqa: ANN401
    """Read the raster at cells counted from the first one."""
    columns, rows = (np.array(cells) + FIRST).T
    return raster_at_cells(path, grid=GRID, columns=columns, rows=rows, crs=LAMBERT, **options)


@settings(max_examples=20)
@given(seed=st.integers(0, 99), pixel=st.sampled_from([5.0, 10.0, 20.0]), shift=st.integers(-3, 3))
def test_value_of_a_cell_is_the_mean_of_its_pixels(
    tmp_path_factory: pytest.TempPathFactory, seed: int, pixel: float, shift: int
) -> None:
    values = np.random.default_rng(seed).uniform(0, 9, (6, 8))
    corner = CORNER[0] + shift * 10, CORNER[1]
    path = write(tmp_path_factory.mktemp("raster") / "x.tif", values, pixel=pixel, corner=corner)
    cells = [(x, y) for x in range(-4, 20) for y in range(-1, 14)]
    size = round(20 / pixel)  # of a cell in half pixels
    halves = np.kron(values, np.ones((2, 2)))
    for (x, y), value in zip(cells, read(path, cells), strict=True):
        column, row = (x - shift) * size, y * size
        if 0 <= column < halves.shape[1] and 0 <= row < halves.shape[0]:
            assert value == pytest.approx(halves[row : row + size, column : column + size].mean())
        elif not (-size <= column <= halves.shape[1] and -size <= row <= halves.shape[0]):
            assert np.isnan(value)  # neither inside nor next to the edge


def test_raster_in_another_crs_and_cells_in_any_order(tmp_path: Path) -> None:
    to_degrees = Transformer.from_crs(LAMBERT, 4326, always_xy=True)
    lon, lat = to_degrees.transform(*CORNER)
    values = np.arange(400.0).reshape(20, 20)
    path = write(
        tmp_path / "degrees.tif", values, pixel=0.001, corner=(lon, lat), crs=CRS("EPSG:4326")
    )
    cells = [(30, 12), (2, 100), (80, 3), (30, 12)]
    values_at_cells = read(path, cells)
    centres = GRID.viewpoints(*(np.array(cells) + FIRST).T)
    for centre, value in zip(centres, values_at_cells, strict=True):
        corners = np.add(centre, [[-5, -5], [-5, 5], [5, -5], [5, 5]])
        lons, lats = np.array(to_degrees.transform(*corners.T))
        nearby = values[((lats - lat) / 0.001).astype(int), ((lons - lon) / 0.001).astype(int)]
        assert nearby.min() <= value <= nearby.max()


def test_cells_without_data_are_nan(tmp_path: Path) -> None:
    marked = write(tmp_path / "marked.tif", np.array([[1, 255, 0]], np.uint8), nodata=255)
    gaps = write(tmp_path / "gaps.tif", np.array([[1.0, np.nan, 0.0]]))
    for path in (marked, gaps):
        np.testing.assert_allclose(read(path, [(0, 0), (1, 0), (2, 0)]), [1, np.nan, 0])
    half = write(tmp_path / "half.tif", np.array([[3.0, -9.0]]), pixel=5.0, nodata=-9.0)
    assert read(half, [(0, 0)]).tolist() == [3.0]


def test_band_is_chosen_or_must_be_given(tmp_path: Path) -> None:
    three = write(tmp_path / "three.tif", np.arange(3, dtype=np.uint16).reshape(3, 1, 1))
    assert read(three, [(0, 0)], band=3).tolist() == [2]
    opaque = np.array([[[7, 8]], [[255, 0]]], np.uint8)
    path = write(tmp_path / "opaque.tif", opaque, photometric="MINISBLACK", alpha="YES")
    assert read(path, [(0, 0)]).tolist() == [7]
    for band, words in ((None, "none was named"), (4, "band 4 was asked for"), (0, "band 0 was")):
        with refused(InputError, words):
            read(three, [(0, 0)], band=band)


def test_file_that_is_no_raster_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "text.tif"
    text.write_text("no raster")
    cut = write(tmp_path / "cut.tif", np.random.default_rng(1).uniform(size=(300, 300)))
    cut.write_bytes(cut.read_bytes()[:5000])
    for path in (text, cut, tmp_path / "absent.tif", tmp_path):
        with refused(SourceError, "cannot be read as a raster"):
            read(path, [(0, 0), (200, 200)])


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_raster_without_crs_or_on_another_planet_is_refused(tmp_path: Path) -> None:
    moon = CRS("+proj=longlat +R=1737400 +no_defs")
    for crs, words in (
        (None, "does not say its coordinate reference system"),
        (moon, "cannot be turned into that of the cells"),
    ):
        path = write(tmp_path / "place.tif", np.ones((2, 2)), crs=crs)
        with refused(CrsError, words):
            read(path, [(0, 0)])
