"""The maps of a location, and of a ranking by distance, in a real browser."""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import folium
import geopandas as gpd
import numpy as np
import pytest
import shapely
from map_pages import IMAGES, LEGEND
from noisy_cells import parts_of
from pyproj import Transformer
from selenium.webdriver.common.by import By
from worlds import random_town

from semsig_gis.core import ANSWERS, CANDIDATE_RAMP, VERDICTS, Signature, percent
from semsig_gis.database import ObjectStore
from semsig_gis.localization import Method, build_index, cell_noise, localize, locate, named_noise
from semsig_gis.observation import Photo, View
from semsig_gis.output import OUTLINES, SECTOR, localization_map, location_map

if TYPE_CHECKING:
    from map_pages import MapPage

    from semsig_gis.localization import Location

WORLD = random_town()
CITY = WORLD.database
STORE = ObjectStore.of(WORLD.street_objects)
POINTED = "#7733ff"
LONGEST = int(CITY.lengths.argmax())
CELL = CITY.signature(LONGEST)
CODES, BEARINGS = parts_of(CELL)


def answer_with_errors() -> Location:
    """Return the answer to a query from the cell with most objects, with an error of each kind."""
    codes = CODES.copy()
    codes[1] = next(code for code in CITY.present_codes if code != codes[1])
    gap = (BEARINGS[-1] + 360.0 + BEARINGS[0]) / 2.0 % 360.0
    query = Signature(
        np.append(np.delete(codes, 3), codes[0]), np.append(np.delete(BEARINGS, 3), gap)
    )
    index = build_index(CITY, cell_noise(named_noise("medium"), 10.0))
    return locate(index, query, explained=2, top=5, store=STORE, refined=True, north_sigma=math.inf)


def test_location_map_has_layers_legend_and_signs(page: MapPage) -> None:
    location = answer_with_errors()
    assert location.answer.given
    page.open(location_map(location))
    assert page.browser.title == "Where it was seen"
    assert len(page.all(IMAGES)) == 1
    assert page.all(".semsig-number") == []  # the candidates are hidden at first
    legend = page.text(LEGEND)
    assert "The answer, ellipse: 90 %" in legend
    assert "within 50 m with a chance of over 99 %." in legend
    assert "90 % in" in legend
    assert "matched: said, and there" in legend
    assert page.circles(ANSWERS["given"].colour) == 1
    canvas = "canvas.semsig-objects"
    for verdict, count in location.explanations[0].counts.items():
        if verdict != "missed":  # its frame has the colour of the paper
            assert (page.drawn(VERDICTS[verdict], canvas) > 0) == (count > 0)
    ellipse = """
    const rings = lines(({options}) => options.color === arguments[0]);
    const [ring] = rings[0].getLatLngs();
    return [rings.length, map.distance(ring[0], ring[36]), ring.length];
    """
    rings, across, corners = page.ask(ellipse, ANSWERS["given"].colour)
    assert (rings, corners) == (1, 73)
    assert across == pytest.approx(2.0 * location.estimate.ellipse()[0], abs=0.4)
    for layer, boards in (
        ("Objects from rank 1", 0),
        ("Objects from rank 2", 1),
        ("Objects seen from a cell", 1),
        ("Regions of 50, 90 and 99 %", 1),
    ):
        page.switch(layer)
        assert (len(page.all(canvas)), len(page.all(IMAGES))) == (boards, 1)
    page.switch("Candidates")
    numbers = [str(element.get_property("textContent")) for element in page.all(".semsig-number")]
    assert sorted(numbers) == ["1", "2", "3", "4", "5"]
    page.switch("Best place")
    assert page.circles(ANSWERS["given"].colour) == 0


def test_first_view_shows_what_was_said_next_to_what_is_there(page: MapPage) -> None:
    location = answer_with_errors()
    street = shapely.Point(location.xy).buffer(1.0).boundary
    streets = gpd.GeoDataFrame({"name": ["High Street"]}, geometry=[street], crs=CITY.crs)
    location = replace(location, city=replace(STORE, streets=streets))
    page.open(location_map(location))
    assert page.all(".semsig-legend[open], .leaflet-control-layers-expanded") == []
    text = page.panel().replace("\u00a0", " ")
    lat, lon = location.latlon
    chance, place = percent(location.answer.mass), f"{lat:.6f}, {lon:.6f}"
    for words in ("Found", "On High Street", chance, place):
        assert words in text
    links = {link.text: link for link in page.all(".semsig-links a")}
    assert {title: link.get_attribute("href") for title, link in links.items()} == location.links
    assert {link.get_attribute("rel") for link in links.values()} == {"noopener noreferrer"}
    title_of = {item.name: item.title for item in CITY.taxonomy.classes}
    rows: list[Any] = location.explanations[0].to_dict()["rows"]
    rows = [row for row in rows if row["verdict"] != "outside"]
    texts = page.texts(".semsig-said tbody tr")
    shown = Counter(tuple(filter(None, re.split(r"[\t\n]+", text))) for text in texts)
    expected: Counter[tuple[str, ...]] = Counter()
    for row in rows:
        query_part, map_part = ["not said"], ["not there"]
        if row["query_class"]:
            query_part = [title_of[row["query_class"]], f"{row['query_bearing']:.0f}°"]
        if row["object_class"]:
            map_part = [title_of[row["object_class"]]]
            map_part.append(f"{row['object_bearing']:.0f}°, {row['distance']:.0f} m")
        more = ["of another class"] if row["verdict"] == "misnamed" else []
        expected[*query_part, *map_part, *more] += 1
    assert shown == expected
    assert {row["verdict"] for row in rows} >= {"matched", "misnamed", "false"}
    # All signs are in view, next to the panel.
    place = "return map.latLngToContainerPoint(arguments[0])"
    width = page.one(".semsig-panel").rect["x"]
    for x, y in (
        location.explanations[0]
        .table.to_crs(4326)
        .geometry.dropna()
        .apply(lambda point: (point.y, point.x))
    ):
        shown_at = page.ask(place, [x, y])
        assert 0 < shown_at["x"] < width
        assert 0 < shown_at["y"] < page.one(".folium-map").rect["height"]


def test_objects_and_rows_of_an_answer_point_at_each_other(page: MapPage) -> None:
    location = answer_with_errors()
    page.open(location_map(location))
    row = page.one(".semsig-said tbody tr")
    before = page.drawn(POINTED, "canvas.semsig-objects")
    page.ask("arguments[0].dispatchEvent(new MouseEvent('mouseover'))", row)
    page.until(lambda: page.drawn(POINTED, "canvas.semsig-objects") > before)
    page.ask("semsig.hide(map)")
    matched = next(row for row in location.explanations[0].rows if row["verdict"] == "matched")
    to_degrees = Transformer.from_crs(CITY.crs, 4326)
    page.click_at(to_degrees.transform(*matched["place"]))
    title = CITY.taxonomy.by_name(matched["object_class"]).title
    assert title in page.text(".semsig-said tr.lit")
    page.ask("semsig.hide(map)")
    page.point_at("circles(arguments[0])[0]", ANSWERS["given"].colour)
    assert page.panel().startswith("Found")
    page.one(".semsig-answer summary").click()
    numbers = page.text(".semsig-answer details")
    assert f"{location.estimate.heading_sigma:.1f}°" in numbers
    page.ask("circles('#ffffff').find((circle) => circle.getTooltip())?.fire('click')")
    page.switch("Candidates")
    page.ask("circles('#ffffff').find((circle) => circle.getTooltip()).fire('click')")
    assert page.panel().startswith("Rank 5")


def test_wheels_show_sectors_and_distances_of_a_view(page: MapPage) -> None:
    metres = CITY.distances[CITY.offsets[LONGEST] : CITY.offsets[LONGEST + 1]]
    photo = Photo.looking(heading=float(BEARINGS[0]), fov=120)
    view = View.of(CELL, ranges=np.append(metres[:-1], np.nan), photos=(photo,))
    outside = ~photo.sees(BEARINGS)
    assert 0 < outside.sum() < len(view)
    page.open(localization_map(localize(CITY, view, top=1, method=Method()), CITY))
    assert "; looked at " in page.text(LEGEND)
    page.ask("shown((layer) => layer instanceof L.CircleMarker)[0].fire('click')")
    assert page.panel()
    query, cell = page.all(".semsig-wheels figure")
    assert query.text.endswith("Query, to 30 m")
    for wheel in (query, cell):
        assert len(wheel.find_elements(By.CSS_SELECTOR, "path.looked")) == 1
        objects = wheel.find_elements(By.CSS_SELECTOR, ".object")
        pale = ["outside" in str(element.get_attribute("class")) for element in objects]
        assert pale == outside.tolist()
        description = str(wheel.find_element(By.TAG_NAME, "svg").get_attribute("aria-label"))
        assert description.count("(outside)") == outside.sum()
        # To scale: distances are proportional to the metres.
        out = np.hypot(*np.transpose(page.ask("return signPlaces(arguments[0])", wheel)))
        scale = out[:-1] / metres[:-1]
        assert scale == pytest.approx(np.full(len(scale), scale[0]), rel=0.05)
        rings = wheel.find_elements(By.CSS_SELECTOR, "circle.scale")
        radii = [float(str(ring.get_attribute("r"))) for ring in rings]
        assert radii == pytest.approx([15 * scale[0], 30 * scale[0]], rel=0.05)
        # What has no distance stands on the rim.
        (rim,) = wheel.find_elements(By.CSS_SELECTOR, "circle.ring")
        on_rim = float(out[-1]) == pytest.approx(float(str(rim.get_attribute("r"))))
        assert on_rim == (wheel is query)


def test_explanation_shows_sectors_of_photos(page: MapPage) -> None:
    photos = tuple(Photo.looking(heading=heading, fov=70) for heading in (10, 200))
    first, second = (photo.sees(BEARINGS) for photo in photos)
    view = View.of(CELL, photo=second.astype(int), photos=photos).select(first | second)
    index = build_index(CITY, named_noise("light"))
    page.open(location_map(locate(index, view, explained=1)))
    outlines = """
    const sectors = lines(({options}) => options.color === arguments[0])[0].getLatLngs();
    return sectors.map(([first, second]) => map.distance(first, second));
    """
    reach = page.ask(outlines, SECTOR["color"])
    assert reach == pytest.approx([30.0, 30.0], abs=0.2)


def test_withheld_answer_shows_all_candidates(page: MapPage) -> None:
    query = Signature(CODES[:1], None)
    index = build_index(CITY, named_noise("strong"))
    location = locate(index, query, top=7, surely_here=True)
    assert not location.answer.given
    page.open(location_map(location))
    legend = page.text(LEGEND)
    assert f"Cannot tell. {location.region_text}." in legend
    assert "Best place: " in legend
    assert "The view may" not in legend
    assert "matched" not in legend
    assert page.circles(ANSWERS["withheld"].colour) == 1
    names = page.texts(".leaflet-control-layers-overlays label:has(:checked)")
    assert [name for name in names if "Chance" in name] == ["Chance within 50 m"]
    inside = "circles('#ffffff').every((circle) => map.getBounds().contains(circle.getLatLng()))"
    assert page.ask(f"return {inside}")


def test_localization_map_describes_candidates(page: MapPage) -> None:
    page.open(localization_map(localize(CITY, CELL, top=50, method=Method()), CITY))
    assert page.browser.title == "Candidate places"
    texts = "return shown((layer) => layer instanceof L.CircleMarker).map(content)"
    descriptions = page.ask(texts)
    assert len(descriptions) == 50
    best = descriptions[-1]  # drawn last, on top
    assert best.startswith("Rank 1")
    assert str(CITY.cell_ids[LONGEST]) in best
    assert CITY.types(LONGEST) in best
    # The query and what the cell sees, side by side.
    page.ask("circles(arguments[0])[0].fire('click')", CANDIDATE_RAMP[0])
    captions = [element.get_property("innerText") for element in page.all("figcaption")]
    assert captions == ["Query", "Cell sees, to 30 m"]
    page.ask("semsig.hide(map)")
    assert "Seen: " in page.text(LEGEND)
    page.switch("Candidates")
    assert page.ask(texts) == []


def test_signs_are_drawn_on_a_map_with_svg(page: MapPage) -> None:
    page.open(location_map(answer_with_errors(), map_=folium.Map(tiles=None)))
    outline = OUTLINES[ANSWERS["given"].shape]
    assert len(page.all(f'.leaflet-marker-pane path[d="{outline}"]')) == 1


def test_query_without_types_is_drawn_as_dots(page: MapPage) -> None:
    bearings_only = Signature(None, BEARINGS)
    page.open(localization_map(localize(CITY, bearings_only, top=1, method=Method()), CITY))
    page.panel_of(CANDIDATE_RAMP[0])
    query, cell = page.all(".semsig-wheels figure")
    assert len(query.find_elements(By.CSS_SELECTOR, ".object .north")) == len(CELL)
    assert query.find_elements(By.CSS_SELECTOR, ".picture") == []
    assert len(cell.find_elements(By.CSS_SELECTOR, ".object.matched .picture")) == len(CELL)
