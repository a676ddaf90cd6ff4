"""Draw simulated queries."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from noisy_cells import parts_of
from sentences import refused
from worlds import CORNER, TAXONOMY, World, random_town

from semsig_gis.core import InputError, Taxonomy
from semsig_gis.database import ObjectStore, ViewpointSpec, build_database
from semsig_gis.evaluation import QuerySpec, draw_queries, parse_chain
from semsig_gis.objects import assemble, choose_layers, read_files
from semsig_gis.sources import load_catalog

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import SeenFrom, SimulatedQuery

TOWN = random_town()
DATABASE = TOWN.database
STORE = ObjectStore.of(TOWN.street_objects)
PLAIN = QuerySpec(number=40, distortions=())
ANYWHERE = replace(PLAIN, seen_from="anywhere")


def rows(query: SimulatedQuery) -> list[tuple[int, float]]:
    return list(zip(query.asked.codes.tolist(), query.asked.bearings.tolist(), strict=True))


def brute_force(x: float, y: float) -> list[tuple[int, float]]:
    """Return class codes and bearings of the objects visible from a place, by a plain loop."""
    visible = []
    for other_x, other_y, code in TOWN.objects:
        if math.hypot(other_x - x, other_y - y) <= TOWN.radius:
            bearing = math.degrees(math.atan2(other_x - x, other_y - y)) % 360.0
            visible.append((code, bearing))
    return sorted(visible, key=lambda item: item[1])


def test_queries_from_cells_equal_their_signatures() -> None:
    queries = draw_queries(DATABASE, PLAIN)
    assert len({query.cell for query in queries}) == 40
    for number, query in enumerate(queries):
        codes, bearings = parts_of(DATABASE.signature(query.cell))
        assert rows(query) == list(zip(codes.tolist(), bearings.tolist(), strict=True))
        assert query.length == len(codes)
        assert query.xy == tuple(DATABASE.xy[query.cell])
        assert (query.seed, query.number, query.asked.heading) == (0, number, 0.0)
        part = slice(DATABASE.offsets[query.cell], DATABASE.offsets[query.cell + 1])
        assert query.asked.distances == pytest.approx(DATABASE.distances[part])


def test_queries_from_anywhere_see_the_visible_objects() -> None:
    queries = draw_queries(DATABASE, ANYWHERE, store=STORE)
    offsets = []
    for query in queries:
        away = np.array(query.xy) - DATABASE.xy[query.cell]
        assert (np.abs(away) <= 5.0).all()
        offsets.append(away)
        expected = brute_force(*query.xy)
        assert np.ravel(rows(query)) == pytest.approx(np.ravel(expected))
        assert query.length == len(expected)
    # Places are uniform in a cell.
    assert np.abs(np.mean(offsets, axis=0)).max() < 6 * 10 / math.sqrt(12 * len(offsets))
    assert np.std(offsets) == pytest.approx(10 / math.sqrt(12), rel=0.25)


@pytest.mark.parametrize("seen_from", ["cells", "anywhere"])
def test_queries_do_not_depend_on_their_number_seeds_and_parts(seen_from: SeenFrom) -> None:
    strong = parse_chain("strong, view:180")
    spec = QuerySpec(number=5, seeds=(7, 2), seen_from=seen_from, distortions=strong)

    def draw(spec: QuerySpec, part: slice = slice(None)) -> list[tuple[object, ...]]:
        queries = draw_queries(DATABASE, spec, store=STORE, part=part)
        return [(item.seed, item.number, item.xy, item.pick, rows(item)) for item in queries]

    whole = draw(spec)
    assert [item[:2] for item in whole] == list(itertools.product((7, 2), range(5)))
    assert len({item[2] for item in whole}) == 10
    assert draw(replace(spec, number=3)) == whole[:3] + whole[5:8]
    assert draw(replace(spec, seeds=(2,))) == whole[5:]
    for start, stop in ((0, 10), (0, 3), (3, 7), (5, 10), (9, 20), (10, 12)):
        assert draw(spec, slice(start, stop)) == whole[start:stop]
    plain = draw(replace(spec, distortions=()))  # distortions do not move the places
    assert [item[:4] for item in plain] == [item[:4] for item in whole]


BUILT_UP = replace(DATABASE, occlusion=0.5)  # as if it had been built with buildings


def store_with(*houses: shapely.Polygon) -> ObjectStore:
    footprints = gpd.GeoDataFrame(geometry=list(houses), crs="EPSG:2154")
    return ObjectStore.of(TOWN.street_objects, footprints=footprints)


def test_places_are_outside_buildings() -> None:
    x, y = CORNER
    house = shapely.box(x + 20, y + 20, x + 146, y + 150)  # it ends within cells
    queries = draw_queries(BUILT_UP, replace(ANYWHERE, number=150), store=store_with(house))
    places = [shapely.Point(query.xy) for query in queries]
    assert not any(house.intersects(place) for place in places)
    assert any(house.distance(place) < 5.0 for place in places)
    # Buildings hide the objects behind them.
    hidden = [len(brute_force(*query.xy)) - len(query.asked) for query in queries]
    assert min(hidden) == 0
    assert sum(hidden) > 0


def test_more_queries_than_places_outside_are_refused() -> None:
    x, y = CORNER
    house = shapely.box(x - 100, y - 100, x + 300, y + 195)
    with refused(InputError, "200 queries", "outside the buildings", "smaller number"):
        draw_queries(BUILT_UP, replace(ANYWHERE, number=200), store=store_with(house))


def row_of(city: SignatureDatabase, query: SimulatedQuery) -> int:
    """Return the row of the cell with the viewpoint of a query, or -1."""
    (matches,) = np.nonzero((city.xy == query.xy).all(axis=1))
    return int(matches[0]) if len(matches) else -1


def test_queries_are_seen_in_another_city() -> None:
    # Half of the objects are moved far away.
    objects = ((x + 500.0 * (row % 2), y, code) for row, (x, y, code) in enumerate(TOWN.objects))
    city = World(tuple(objects)).database
    queries = draw_queries(DATABASE, replace(PLAIN, number=len(city)), city=city)
    assert 0 < sum(query.cell >= 0 for query in queries) < len(queries)
    for query in queries:
        codes, _ = parts_of(city.signature(row_of(city, query)))
        assert query.asked.codes.tolist() == codes.tolist()
        assert query.cell == row_of(DATABASE, query)


def test_classes_are_matched_by_name_and_unknown_ones_are_dropped() -> None:
    shifted = Taxonomy(tuple(replace(item, code=item.code % 200 + 3) for item in TAXONOMY.classes))
    codes = (DATABASE.codes.astype(int) % 200 + 3).astype(np.uint8)
    city = replace(DATABASE, codes=codes, taxonomy=shifted)
    rare = int(DATABASE.present_codes[0])
    owners = np.repeat(np.arange(len(DATABASE)), DATABASE.lengths)
    seeing = np.isin(np.arange(len(DATABASE)), owners[DATABASE.codes == rare])
    without_rare = DATABASE.select((DATABASE.lengths > 0) & ~seeing)
    assert rare not in without_rare.present_codes
    for query in draw_queries(without_rare, replace(PLAIN, number=len(city)), city=city):
        codes, _ = parts_of(DATABASE.signature(row_of(city, query)))
        assert query.asked.codes.tolist() == codes[codes != rare].tolist()
        assert query.length == len(codes)


def monaco(geodata: Path, year: int) -> tuple[SignatureDatabase, ObjectStore]:
    catalog = load_catalog("openstreetmap")
    file = geodata / "osm" / f"monaco_{year}.osm.pbf"
    # Of street furniture only, so that there are places from which no object is visible.
    furniture = {item.name for item in catalog.taxonomy.classes if item.family == "furniture"}
    specs = [spec for spec in catalog.layers if not spec.optional and spec.classes]
    names = [spec.name for spec in specs if furniture.issuperset(spec.classes)]
    layers, _ = read_files(choose_layers(catalog, names, surroundings=True), [file])
    loaded = assemble(layers, catalog)
    database = build_database(
        loaded.objects, viewpoints=ViewpointSpec(mode="outdoor"), footprints=loaded.buildings
    )
    return database, ObjectStore.of(loaded.objects, footprints=loaded.buildings)


def test_queries_in_monaco_a_year_later(geodata: Path) -> None:
    database, _ = monaco(geodata, 2021)
    city, store = monaco(geodata, 2022)
    queries = draw_queries(database, replace(ANYWHERE, number=200), store=store, city=city)
    unknown = sum(query.cell < 0 for query in queries)
    assert 5 < unknown < 100  # new objects, at places from which no object was visible
    present = set(database.present_codes.tolist())
    assert all(set(query.asked.codes.tolist()) <= present for query in queries)
    houses = store.footprints
    assert houses is not None
    places = gpd.GeoSeries([shapely.Point(query.xy) for query in queries], crs=city.crs)
    assert len(houses.sindex.query(places, predicate="intersects")[0]) == 0
    # Queries see as many objects as the cells of that year.
    mean_length = np.mean([query.length for query in queries])
    assert mean_length == pytest.approx(city.lengths.mean(), rel=0.3)
