"""Drafts of catalogues for all files of a folder."""

from __future__ import annotations

import json
import tomllib
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pytest
from sentences import refused

from semsig_gis.core import SourceError
from semsig_gis.objects import draft_catalog, load

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

OSM = (
    '<osm version="0.6"><node id="1" lat="43.6" lon="3.8"><tag k="amenity" v="bench"/></node></osm>'
)


def table(ids: Iterable[object], *, lon: float = 3.88, header: str = "id;lon;lat") -> str:
    return "\n".join([header, *(f"{i};{lon + row / 1e4:.5f};43.61" for row, i in enumerate(ids))])


def folder(path: Path, **files: str | bytes) -> Path:
    """Make a folder of files; their names are given with `__` for a dot."""
    path.mkdir()
    for name, content in files.items():
        file = path / name.replace("__", ".")
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def draft(town: Path, crs: str | None = None) -> tuple[str, dict[str, Any]]:
    """Draft a folder, load it as a whole, and return the text and the content of the draft."""
    text = draft_catalog(town, crs=crs)
    catalog = town / "draft.toml"
    catalog.write_text(text, encoding="utf-8")
    layers = load(town, catalog=catalog, collapse=False, merge=False, crs=crs).report.layers
    content = tomllib.loads(text)
    # A layer in several files is there several times.
    names = dict.fromkeys(layer.name for layer in layers)
    assert [*names] == [layer["name"] for layer in content["layers"]]
    assert all(layer.counts.kept == layer.counts.read for layer in layers)
    catalog.unlink()
    return text, content


def test_every_file_is_a_layer_or_has_a_line(tmp_path: Path) -> None:
    portal = json.dumps([{"id": i, "lng": 3.88, "lat": 43.6 + i / 1e4} for i in (1, 2)])
    town = folder(
        tmp_path / "my town",
        trees__csv=table("abc"),
        toilets__json=portal,
        map__osm=OSM,
        broken__gpkg=b"x",
        nowhere__csv="id;lon;lat\n1;;\n",
        sizes__csv="a;b\n1;2\n",
        photo__JPG=b"x",
        readme__pdf=b"x",
    )
    (town / "more").mkdir()
    places = gpd.GeoSeries.from_xy([765300, 765400], [6280000, 6280000], crs=2154)
    gpd.GeoDataFrame({"ref": ["a", "b"]}, geometry=places).to_file(town / "bancs.shp")
    elements = {"element": "node", "id": [1, 2], "highway": "bus_stop", "geometry": places}
    gpd.GeoDataFrame(elements).to_crs(4326).to_file(town / "osmnx.geojson")
    text, content = draft(town)
    classes = {layer["files"][0]: layer["class"] for layer in content["layers"]}
    assert classes == {
        "bancs.shp": "bench",
        "toilets.json": "automatic_wc",
        "trees.csv": "alignment_tree",
    }
    comments = [line for line in text.splitlines() if line.startswith("#")]
    for file, words in {
        "map.osm": "no catalogue is needed (openstreetmap): `semsig load",
        "osmnx.geojson": "no catalogue is needed (openstreetmap): `semsig load",
        "broken.gpkg": "left out",
        "nowhere.csv": "no layer with positions",
        "sizes.csv": "looks like a position",
        "photo.JPG": "pictures",
        "readme.pdf": "left out",
        "bancs.dbf": "accompany",
        "more/": "`semsig draft",
    }.items():
        (line,) = (line for line in comments if file in line)
        assert words in line


def test_classes_agree_and_do_not_clash(tmp_path: Path) -> None:
    town = folder(
        tmp_path / "town",
        lampadaires__csv=table("ab"),
        street_lights_2020__csv=table("cd", lon=3.881),
        stuff__csv=table("ab", lon=3.882),
        stuff__tsv=table("ab", lon=3.883).replace(";", "\t"),
        stuff_2019__csv=table("xy", lon=3.884, header="number;lon;lat"),
        furniture__csv=table("ab", lon=3.885),
        things__csv=table("ab", lon=3.886),
        木__csv=table("ab", lon=3.887),
        林__csv=table("ab", lon=3.888),
    )
    text, content = draft(town)
    classes = {layer["files"][0]: layer["class"] for layer in content["layers"]}
    assert classes["lampadaires.csv"] == classes["street_lights_2020.csv"] == "street_light"
    assert classes["stuff.csv"] == classes["stuff.tsv"] == classes["stuff_2019.csv"] == "stuff"
    assert classes["furniture.csv"] != "furniture"  # a family
    own = [item["name"] for item in content["classes"]]
    assert sorted({*classes.values()} - {"street_light"}) == sorted(own)
    assert len(own) == 5
    for key in ("code", "symbol"):
        assert len({item[key] for item in content["classes"]}) == 5
    assert "is it the same data as stuff.csv?" in text


def test_more_unknown_files_than_codes_are_left_out(tmp_path: Path) -> None:
    names = [f"{first}{second}x" for first in "abcdef" for second in "abcdef"]
    town = folder(tmp_path / "town", **{f"{name}__csv": table("a") for name in names})
    text, content = draft(town)
    assert len(content["classes"]) == 32
    assert sum("no code for another" in line for line in text.splitlines()) == 4


def test_layers_without_rows_are_drafted_with_others(tmp_path: Path) -> None:
    town = folder(tmp_path / "town")
    places = gpd.GeoSeries.from_xy([765300], [6280000], crs=2154)
    frame = gpd.GeoDataFrame({"ref": ["a"]}, geometry=places)
    for layer, rows in {"bancs": frame, "arbres": frame[:0]}.items():
        rows.to_file(town / "all.gpkg", layer=layer)
    _, content = draft(town)
    assert [layer["layer"] for layer in content["layers"]] == ["bancs", "arbres"]


def test_file_far_from_the_others_is_left_out(tmp_path: Path) -> None:
    exchanged = "id;lat;lon\n" + "\n".join(f"{row};3.88;43.61" for row in range(3))
    files = {f"{name}__csv": table(range(9)) for name in ("arbres", "bancs", "horodateurs")}
    town = folder(tmp_path / "town", **files, lampadaires__csv=exchanged)
    text, content = draft(town)
    assert len(content["layers"]) == 3
    (line,) = (line for line in text.splitlines() if "lampadaires.csv" in line)
    assert "left out" in line
    assert "far from" in line


def test_parts_of_a_layer_are_joined_if_their_ids_differ(tmp_path: Path) -> None:
    town = folder(
        tmp_path / "town",
        bancs_nord__csv=table("abc"),
        bancs_sud__csv=table("xyz", lon=3.89),
        trees_2020__csv=table("abc"),
        trees_2021__csv=table("abcd"),
    )
    text, content = draft(town)
    assert [layer["files"] for layer in content["layers"]] == [
        ["bancs_*.csv"],
        ["trees_2020.csv"],
        ["trees_2021.csv"],
    ]
    assert "is it another edition of trees_2020.csv" in text


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({}, ["has no file that a catalogue can be drafted for", "empty"]),
        ({"photo__png": "x"}, ["photo.png: left out: pictures"]),
        ({"map__osm": OSM}, ["map.osm: no catalogue is needed", "semsig load"]),
        ({"a__csv": table("a"), "b__csv": table("b", lon=-70.5)}, ["far apart"]),
    ],
)
def test_folder_that_cannot_be_drafted_is_refused(
    tmp_path: Path, files: dict[str, str], words: list[str]
) -> None:
    town = folder(tmp_path / "town", **files)
    with refused(SourceError, "town", *words):
        draft_catalog(town)


def test_crs_of_files_that_state_none_is_for_all(tmp_path: Path) -> None:
    metric = "id;X;Y\n1;765300;6280000\n2;765400;6280000\n"
    town = folder(tmp_path / "town", bancs__csv=metric, arbres__csv=metric)
    with refused(SourceError, "--crs"):
        draft_catalog(town)
    _, content = draft(town, crs="EPSG:2154")
    assert {layer["crs"] for layer in content["layers"]} == {"EPSG:2154"}


def test_built_in_catalogue_for_a_file_is_named(tmp_path: Path) -> None:
    town = folder(tmp_path / "town", BAUMKATOGD__csv=table("ab", header="OBJECTID;lon;lat"))
    assert "`semsig load" in draft_catalog(town)
    assert "--catalog vienna`" in draft_catalog(town / "BAUMKATOGD.csv")


def test_published_files_are_drafted_as_a_whole(geodata: Path) -> None:
    text = draft_catalog(geodata / "montpellier", crs="EPSG:2154")
    content = tomllib.loads(text)
    assert len(content["layers"]) == 20
    assert "README_ArbresAlign.txt" in text
