"""GeoJSON and KML of an answer contain the regions, the candidates and the place."""

from __future__ import annotations

import dataclasses
import json
from html import escape
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import geopandas as gpd
import numpy as np
import pandas as pd
import pyogrio
import pytest
from small_city import small_city, small_localization, small_location

from semsig_gis.output import export_answer

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.localization import Localization, Location

CITY, _ = small_city()
LOCATION = small_location().doubted(0.25, 0.004)
KML = "{http://www.opengis.net/kml/2.2}"


def layers_of(file: Path) -> dict[str, gpd.GeoDataFrame]:
    """Return the tables of an answer by the kind of their rows."""
    if file.suffix == ".geojson":
        return dict(iter(gpd.read_file(file).groupby("layer")))
    kinds = {
        "Regions to search": "region",
        "Candidates": "candidate",
        "Place": "place",
        "Ellipse of the place": "ellipse",
        "Objects of the query": "ray",
    }
    names = pyogrio.list_layers(file)[:, 0]
    return {kinds[name]: gpd.read_file(file, layer=name) for name in names}


@pytest.mark.parametrize("suffix", [".geojson", ".kml"])
@pytest.mark.parametrize("answer", [LOCATION, small_localization()])
def test_file_contains_all_layers_of_an_answer(
    answer: Location | Localization, suffix: str, tmp_path: Path
) -> None:
    file = tmp_path / f"a{suffix}"
    regions = export_answer(answer, CITY, file).table
    tables = layers_of(file)
    places = ["place", "ellipse", "ray"] if answer is LOCATION else []
    assert {*tables} == {"region", "candidate", *places}
    for kind, expected in {"region": regions, "candidate": answer.to_geodataframe()}.items():
        table = tables[kind]
        numbers = expected.iloc[:, 0]
        assert table["Name"].tolist() == [f"{kind} {number}" for number in numbers]
        shapes = table.to_crs(CITY.crs).geometry.reset_index(drop=True)
        assert shapes.hausdorff_distance(expected.geometry.reset_index(drop=True)).max() < 0.02
        for column in expected.select_dtypes("number"):
            assert np.allclose(pd.to_numeric(table[column]), expected[column])
    if places:
        (row,) = tables["place"].to_crs(CITY.crs).itertuples()
        estimate = LOCATION.estimate
        assert np.hypot(row.geometry.x - estimate.x, row.geometry.y - estimate.y) < 0.02
        assert row.answer == ("given" if LOCATION.answer.given else "withheld")
        assert float(row.sigma) == pytest.approx(estimate.sigma)
        assert bool(row.refined) is estimate.refined
        assert [float(row.elsewhere), float(row.fit)] == [0.25, 0.004]
        longer, shorter, bearing = estimate.ellipse()
        axes = [float(row.longer_m), float(row.shorter_m), float(row.bearing)]
        assert axes == pytest.approx([longer, shorter, bearing])
        (ellipse,) = tables["ellipse"].to_crs(CITY.crs).geometry
        assert ellipse.area == pytest.approx(np.pi * longer * shorter, rel=0.02)
        (explanation,) = LOCATION.explanations
        rays = tables["ray"].to_crs(CITY.crs)
        assert rays["verdict"].tolist() == [fact["verdict"] for fact in explanation.rows]
        ends = [line.coords[-1] for line in rays.geometry]
        assert np.allclose(ends, explanation.ends(CITY.reach), atol=0.02)
        assert {line.coords[0] for line in rays.geometry} == {rays.geometry.iloc[0].coords[0]}


def test_files_have_the_licences_and_load_no_other_files(tmp_path: Path) -> None:
    harmful = "<b>Town</b> & \x07co ]]> (CC0)"
    answer = dataclasses.replace(LOCATION, licenses=(harmful,))
    for name in ("a.kml", "a.geojson"):
        export_answer(answer, CITY, tmp_path / name)
    document = ET.parse(tmp_path / "a.kml").getroot().find(f"{KML}Document")  # noqa: S314 - ours
    assert document is not None
    assert document.findtext(f"{KML}description") == harmful.replace("\x07", "")
    assert [*document.iter(f"{KML}href")] == []
    styles = {f"#{style.get('id')}" for style in document.iter(f"{KML}Style")}
    assert {element.text for element in document.iter(f"{KML}styleUrl")} <= styles
    collection = json.loads((tmp_path / "a.geojson").read_text())
    assert collection["semsig"]["licenses"] == [harmful]
    assert collection["semsig"]["searched"]["cells"] > 0
    first = collection["features"][0]["properties"]
    # Integers stay integers, although they are missing in other rows.
    assert (first["Name"], repr(first["rank"])) == ("region 1", "1")


def test_places_of_kml_have_links_to_follow(tmp_path: Path) -> None:
    location = small_location()
    export_answer(location, small_city()[0], tmp_path / "a.kml")
    document = ET.parse(tmp_path / "a.kml").getroot()  # noqa: S314 - ours
    texts = {
        mark.findtext(f"{KML}name"): mark.findtext(f"{KML}description") or ""
        for mark in document.iter(f"{KML}Placemark")
    }
    for title, link in location.links.items():
        assert f'<a href="{escape(link)}">{title}</a>' in texts["place"]
    assert "Chance: " in texts["place"]
    assert "<a " in texts["candidate 1"]
    assert "<a " not in texts["region 1"]
