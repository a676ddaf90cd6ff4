"""Draw simulated queries."""

from __future__ import annotations

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
    """Return class code and bearing of what is seen from a place, one object at a time."""
    seen = []
    for other_x, other_y, code in TOWN.objects:
        if math.hypot(other_x - x, other_y - y) <= TOWN.radius:
            bearing = math.degrees(math.atan2(other_x - x, other_y - y)) % 360.0
            seen.append((code, bearing))
    return sorted(seen, key=lambda one: one[1])


def test_from_the_cells_it_is_their_signatures() -> None:
    drawn = draw_queries(DATABASE, PLAIN)
    assert len({query.cell for query in drawn}) == 40
    for number, query in enumerate(drawn):
        codes, bearings = parts_of(DATABASE.signature(query.cell))
        assert rows(query) == list(zip(codes.tolist(), bearings.tolist(), strict=True))
        assert query.length == len(codes)
        assert query.xy == tuple(DATABASE.xy[query.cell])
        assert (query.seed, query.number, query.asked.heading) == (0, number, 0.0)
        part = slice(DATABASE.offsets[query.cell], DATABASE.offsets[query.cell + 1])
        assert query.asked.distances == pytest.approx(DATABASE.distances[part])


def test_from_anywhere_it_is_what_is_seen_from_there() -> None:
    drawn = draw_queries(DATABASE, ANYWHERE, store=STORE)
    offsets = []
    for query in drawn:
        away = np.array(query.xy) - DATABASE.xy[query.cell]
        assert (np.abs(away) <= 5.0).all()
        offsets.append(away)
        told = brute_force(*query.xy)
        assert np.ravel(rows(query)) == pytest.approx(np.ravel(told))
        assert query.length == len(told)
    # Anywhere: a place in a cell is uniform.
    assert np.abs(np.mean(offsets, axis=0)).max() < 6 * 10 / math.sqrt(12 * len(offsets))
    assert np.std(offsets) == pytest.approx(10 / math.sqrt(12), rel=0.25)


@pytest.mark.parametrize("seen_from", ["cells", "anywhere"])
def test_fewer_queries_seeds_and_parts_are_parts_of_the_whole(seen_from: SeenFrom) -> None:
    strong = parse_chain("strong, view:180")
    spec = QuerySpec(number=5, seeds=(7, 2), seen_from=seen_from, distortions=strong)

    def drawn(spec: QuerySpec, part: slice = slice(None)) -> list[tuple[object, ...]]:
        queries = draw_queries(DATABASE, spec, store=STORE, part=part)
        return [(one.seed, one.number, one.xy, one.pick, rows(one)) for one in queries]

    whole = drawn(spec)
    assert [one[:2] for one in whole] == [(seed, number) for seed in (7, 2) for number in range(5)]
    assert len({one[2] for one in whole}) == 10
    assert drawn(replace(spec, number=3)) == whole[:3] + whole[5:8]
    assert drawn(replace(spec, seeds=(2,))) == whole[5:]
    for start, stop in ((0, 10), (0, 3), (3, 7), (5, 10), (9, 20), (10, 12)):
        assert drawn(spec, slice(start, stop)) == whole[start:stop]
    plain = drawn(replace(spec, distortions=()))  # distortions do not move the places
    assert [one[:4] for one in plain] == [one[:4] for one in whole]


def store_with(*houses: shapely.Polygon) -> ObjectStore:
    footprints = gpd.GeoDataFrame(geometry=list(houses), crs="EPSG:2154")
    return ObjectStore.of(TOWN.street_objects, footprints=footprints)


def test_nobody_stands_in_a_building() -> None:
    x, y = CORNER
    house = shapely.box(x + 20, y + 20, x + 146, y + 150)  # it ends within cells
    drawn = draw_queries(DATABASE, replace(ANYWHERE, number=150), store=store_with(house))
    places = [shapely.Point(query.xy) for query in drawn]
    assert not any(house.intersects(place) for place in places)
    assert any(house.distance(place) < 5.0 for place in places)
    # Buildings hide what is behind them, too.
    hidden = [len(brute_force(*query.xy)) - len(query.asked) for query in drawn]
    assert min(hidden) == 0
    assert sum(hidden) > 0


def test_more_queries_than_places_outside() -> None:
    x, y = CORNER
    house = shapely.box(x - 100, y - 100, x + 300, y + 195)
    with refused(InputError, "200 queries", "outside the buildings", "smaller number"):
        draw_queries(DATABASE, replace(ANYWHERE, number=200), store=store_with(house))


def row_of(city: SignatureDatabase, query: SimulatedQuery) -> int:
    """Return the row of the cell from whose viewpoint a query is seen, -1 if there is none."""
    (found,) = np.nonzero((city.xy == query.xy).all(axis=1))
    return int(found[0]) if len(found) else -1


def test_another_city_is_looked_at() -> None:
    # Half of the objects have moved far away.
    moved = ((x + 500.0 * (row % 2), y, code) for row, (x, y, code) in enumerate(TOWN.objects))
    city = World(tuple(moved)).database
    drawn = draw_queries(DATABASE, replace(PLAIN, number=len(city)), city=city)
    assert 0 < sum(query.cell >= 0 for query in drawn) < len(drawn)
    for query in drawn:
        codes, _ = parts_of(city.signature(row_of(city, query)))
        assert query.asked.codes.tolist() == codes.tolist()
        assert query.cell == row_of(DATABASE, query)


def test_classes_are_known_by_name_and_only_if_the_database_has_them() -> None:
    shifted = Taxonomy(tuple(replace(item, code=item.code % 200 + 3) for item in TAXONOMY.classes))
    codes = (DATABASE.codes.astype(int) % 200 + 3).astype(np.uint8)
    city = replace(DATABASE, codes=codes, taxonomy=shifted)
    rare = int(DATABASE.present_codes[0])
    owners = np.repeat(np.arange(len(DATABASE)), DATABASE.lengths)
    seeing = np.isin(np.arange(len(DATABASE)), owners[DATABASE.codes == rare])
    kept = DATABASE.select((DATABASE.lengths > 0) & ~seeing)
    assert rare not in kept.present_codes
    for query in draw_queries(kept, replace(PLAIN, number=len(city)), city=city):
        seen, _ = parts_of(DATABASE.signature(row_of(city, query)))
        assert query.asked.codes.tolist() == seen[seen != rare].tolist()
        assert query.length == len(seen)


def monaco(geodata: Path, year: int) -> tuple[SignatureDatabase, ObjectStore]:
    catalog = load_catalog("openstreetmap")
    layers, _ = read_files(
        choose_layers(catalog, surroundings=True), [geodata / "osm" / f"monaco_{year}.osm.pbf"]
    )
    loaded = assemble(layers, catalog)
    database = build_database(
        loaded.objects, viewpoints=ViewpointSpec(mode="outdoor"), footprints=loaded.buildings
    )
    return database, ObjectStore.of(loaded.objects, footprints=loaded.buildings)


def test_monaco_a_year_later(geodata: Path) -> None:
    database, _ = monaco(geodata, 2021)
    city, store = monaco(geodata, 2022)
    drawn = draw_queries(database, replace(ANYWHERE, number=200), store=store, city=city)
    unknown = sum(query.cell < 0 for query in drawn)
    assert 5 < unknown < 100  # new objects, where nothing was to be seen
    present = set(database.present_codes.tolist())
    assert all(set(query.asked.codes.tolist()) <= present for query in drawn)
    houses = store.footprints
    assert houses is not None
    places = gpd.GeoSeries([shapely.Point(query.xy) for query in drawn], crs=city.crs)
    assert len(houses.sindex.query(places, predicate="intersects")[0]) == 0
    # What is asked is as much as the cells of that year see.
    seen = np.mean([query.length for query in drawn])
    assert seen == pytest.approx(city.lengths.mean(), rel=0.3)
