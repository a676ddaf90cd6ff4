"""Files as people have them: each is drafted and loaded, and every object lies where it should."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from sentences import refused

from semsig_gis.core import SemsigError
from semsig_gis.objects import draft_catalog, load
from semsig_gis.sources import parse_area, transform_points

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

CASES = Path(__file__).parents[1] / "cases"
# Files that belong to another file, and the positions of the objects.
SIDE_FILES = {".cpg", ".dat", ".dbf", ".id", ".map", ".prj", ".shx", "expected.json"}
# Cases that are OpenStreetMap data, which needs no catalogue.
OPENSTREETMAP = ("F", "M09")
# The CRS that a user has to state.
STATED_CRS = {"C08_dxf": "EPSG:2154", "E20_parquet_crs_null": "EPSG:2154"}
# Cases that are refused, with words that the sentence contains.
REFUSED = {
    "B38_js_var": ["JavaScript"],
    "C14_pgdump": ["ogr2ogr"],
    "P10_csv_xyz_nohead": ["header"],
}
TOLERANCE_M = 0.01
# Cases with positions in steps of 3 cm, as the format stores them.
COARSE = {"C06_tab": 0.02}


def inputs() -> Iterator[tuple[str, str]]:
    """Yield the name of each case with positions, and of each file in it."""
    for expected in sorted(CASES.glob("*/expected.json")):
        for file in sorted(expected.parent.iterdir()):
            if not {file.suffix.lower(), file.name} & SIDE_FILES:
                yield expected.parent.name, file.name


@pytest.mark.parametrize(("case", "name"), list(inputs()))
def test_every_object_is_in_its_place(case: str, name: str, tmp_path: Path) -> None:
    folder = tmp_path / case
    shutil.copytree(CASES / case, folder)
    expected = json.loads((folder / "expected.json").read_text())
    (folder / "expected.json").unlink()
    file = folder / name
    if name == "UNPACK_FIRST.zip":
        zipfile.ZipFile(file).extractall(folder)
        file.unlink()
        (file,) = folder.iterdir()
    crs = STATED_CRS.get(case)
    if case in REFUSED:
        with refused(SemsigError, *REFUSED[case]):
            draft_catalog(file)
        return
    options: dict[str, Any] = {"crs": crs}
    if not case.startswith(OPENSTREETMAP):
        options["catalog"] = folder / "draft.toml"
        options["catalog"].write_text(draft_catalog(file, crs=crs), encoding="utf-8")
    objects = load(file, collapse=False, merge=False, **options).objects
    right = transform_points(np.array(expected["xy"]), expected["crs"], objects.crs)
    assert len(objects) == len(right)
    error = max(distances(right, objects.xy).max(), distances(objects.xy, right).max())
    assert error < COARSE.get(case, TOLERANCE_M)


def distances(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each point to the nearest of other points."""
    between = first[:, None] - second[None, :]
    return np.asarray(np.hypot(*between.transpose(2, 0, 1)).min(axis=1))


def test_last_word_of_a_name_is_the_class() -> None:
    file = CASES / "R_dc_cabinets" / "traffic_signal_cabinets.geojson"
    assert 'class = "street_cabinet"' in draft_catalog(file)


@pytest.mark.parametrize("name", ["area.csv", "area.poly"])
def test_areas_without_a_crs_are_degrees(name: str) -> None:
    area = parse_area(str(CASES / "K_area" / name))
    assert area.bounds == pytest.approx((4.834, 45.763, 4.837, 45.765))
