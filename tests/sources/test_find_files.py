"""Pairing the layers of a catalogue with files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from semsig_gis.core.errors import SourceError
from semsig_gis.sources import FILE_SUFFIXES, find_files
from semsig_gis.sources.catalog import load_catalog
from semsig_gis.sources.layers import LayerSpec
from semsig_gis.sources.vector import DRIVERS

if TYPE_CHECKING:
    from pathlib import Path

TREES = LayerSpec(name="trees", class_name="alignment_tree", files=("*trees*.zip", "*trees*"))
LIGHTS = LayerSpec(name="lights", class_name="street_light", files=("lights.*", "city.gpkg"))
BENCHES = LayerSpec(name="benches", class_name="bench", files=("city.gpkg",))
SPECS = (TREES, LIGHTS, BENCHES)


def touch(folder: Path, *names: str) -> list[Path]:
    folder.mkdir(exist_ok=True)
    paths = [folder / name for name in names]
    for path in paths:
        path.touch()
    return paths


def test_folder(tmp_path: Path) -> None:
    zipped, _, lights, *_ = touch(
        tmp_path, "Trees_2014.ZIP", "trees.geojson", "lights.shp", "lights.dbf", "lights.prj",
        "readme.txt",
    )  # fmt: skip
    pairs, missing = find_files(SPECS, [tmp_path])
    assert pairs == ((TREES, zipped), (LIGHTS, lights))
    assert missing == (BENCHES,)


def test_one_file_may_hold_several_layers(tmp_path: Path) -> None:
    (city,) = touch(tmp_path, "city.gpkg")
    pairs, missing = find_files(SPECS, [str(city)])
    assert pairs == ((LIGHTS, city), (BENCHES, city))
    assert missing == (TREES,)


def test_a_file_given_by_itself_goes_first(tmp_path: Path) -> None:
    touch(tmp_path / "folder", "trees.zip")
    (mine,) = touch(tmp_path, "my_trees.geojson")
    assert find_files(SPECS, [tmp_path / "folder", mine])[0] == ((TREES, mine),)
    assert find_files(SPECS, [mine, mine])[0] == ((TREES, mine),)


def test_two_files_for_one_layer(tmp_path: Path) -> None:
    first, second = touch(tmp_path, "trees_a.zip", "trees_b.zip")
    message = r"layer 'trees' is matched by .*trees_a\.zip and .*trees_b\.zip; give one"
    for paths in ([tmp_path], [first, second]):
        with pytest.raises(SourceError, match=message):
            find_files(SPECS, paths)


def test_paths_that_lead_nowhere(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"none\.zip does not exist"):
        find_files(SPECS, [tmp_path / "none.zip"])
    (other,) = touch(tmp_path, "cars.zip")
    message = r"cars\.zip is not the file of any layer; .*trees \(\*trees\*\.zip, \*trees\*\), lig"
    with pytest.raises(SourceError, match=message):
        find_files(SPECS, [other])
    with pytest.raises(SourceError, match="holds no file of any layer"):
        find_files(SPECS, [tmp_path])


def test_every_layer_of_montpellier_has_its_file(geodata: Path) -> None:
    layers = load_catalog("montpellier").layers
    pairs, missing = find_files(layers, [geodata / "montpellier"])
    assert [spec for spec, _ in pairs] == list(layers)
    assert missing == ()


def test_suffixes_are_those_that_can_be_read() -> None:
    assert {*DRIVERS, ".zip"} < FILE_SUFFIXES
