"""Queries that are drawn, and queries and routes in files."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import parts_of
from sentences import assert_sentence, refused
from worlds import CORNER, TAXONOMY, World, random_town

from semsig_gis.core import InputError, Signature, Taxonomy
from semsig_gis.database import ObjectStore, ViewpointSpec, build_database
from semsig_gis.evaluation import QuerySpec, draw_queries, parse_chain
from semsig_gis.localization import Leg
from semsig_gis.objects import assemble, choose_layers, read_files
from semsig_gis.observation import North, parse_queries, parse_route, read_queries, read_route
from semsig_gis.sources.catalog import load_catalog

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Query, SeenFrom
    from semsig_gis.observation import QueryLine

TOWN = random_town()
DATABASE = TOWN.database
STORE = ObjectStore.of(TOWN.street_objects)
PLAIN = QuerySpec(number=40, distortions=())
ANYWHERE = replace(PLAIN, seen_from="anywhere")


def rows(query: Query) -> list[tuple[int, float]]:
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


def row_of(city: SignatureDatabase, query: Query) -> int:
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


# --- Files ------------------------------------------------------------------------------------

ROWS = st.lists(
    st.lists(st.tuples(st.sampled_from("BCDEG?"), st.integers(0, 359)), min_size=1, max_size=6),
    min_size=1,
    max_size=5,
)


def signature_of(line: QueryLine) -> Signature:
    assert isinstance(line.query, Signature)
    return line.query


@given(ROWS)
def test_json_lines_and_csv_say_the_same(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[tuple[str, int]]]
) -> None:
    folder = tmp_path_factory.mktemp("queries")
    plain = [
        {"id": f"q{number}", "types": "".join(t for t, _ in row), "bearings": [b for _, b in row]}
        for number, row in enumerate(rows)
    ]
    lines = folder / "queries.jsonl"
    lines.write_text("\n".join(map(json.dumps, plain)) + "\n\n")
    table = folder / "queries.csv"
    text = [f"{q['id']},{q['types']},{' '.join(map(str, q['bearings']))}" for q in plain]
    table.write_text("\ufeffid,types,bearings\n" + "\n".join(text))
    one, other = (list(read_queries(path, taxonomy=TAXONOMY)) for path in (lines, table))
    assert [line.name for line in one] == [line.name for line in other] == [q["id"] for q in plain]
    for line, same, row in zip(one, other, rows, strict=True):
        codes, bearings = parts_of(signature_of(line))
        assert np.array_equal(parts_of(signature_of(same)), (codes, bearings))
        assert bearings.tolist() == sorted(b for _, b in row)


def test_sentences_tell_of_what_has_no_direction_and_of_what_is_not_there() -> None:
    lines = [
        json.dumps({"see": text})
        for text in ("bench at 40, bus stop, lamp at 80", "no tree", "lamp, bench", "no lampe")
    ]
    mixed, none, plain, slip = parse_queries(lines, "x", taxonomy=TAXONOMY)
    assert parts_of(signature_of(mixed))[1].tolist() == [40.0, 80.0]
    bus_stop, tree = (TAXONOMY.encode(symbol).tolist() for symbol in "MB")
    assert ([*mixed.unplaced], mixed.absent) == (bus_stop, ())
    assert (len(signature_of(none)), none.unplaced, [*none.absent]) == (0, (), tree)
    assert (signature_of(plain).bearings, plain.unplaced) == (None, ())
    assert isinstance(slip.query, InputError)


def test_a_part_may_be_missing_and_lines_are_numbered() -> None:
    lines = ["", '{"types": "DB"}', '{"bearings": [5, 6]}', '{"types": ""}', '{"bearings": []}']
    found = list(parse_queries(lines, "x", taxonomy=TAXONOMY))
    assert [one.name for one in found] == [2, 3, 4, 5]
    assert signature_of(found[0]).bearings is None
    assert signature_of(found[1]).codes is None
    assert [len(signature_of(one)) for one in found] == [2, 2, 0, 0]


def test_queries_are_read_when_they_are_needed() -> None:
    lines = iter([b'{"types": "D"}', b"{"])
    found = parse_queries(lines, "x", taxonomy=TAXONOMY)
    assert next(found).line == 1
    assert next(lines) == b"{"


BAD_LINES: list[tuple[str | bytes, str]] = [
    ("{", "not JSON"),
    (b"\xff", "not JSON"),
    ("[" * 100_000, "not JSON"),
    ("[1]", "no query"),
    ('{"types": "Z"}', "'Z'"),
    ('{"types": "DB", "bearings": [1]}', "2 types and 1 bearings"),
    ('{"types": "D", "bearings": [NaN]}', "nan"),
    ('{"bearings": ["north"]}', "not all numbers"),
    ('{"other": 1}', "types, bearings or both"),
]


def test_a_bad_line_takes_no_other_with_it() -> None:
    lines: list[str | bytes] = []
    for text, _ in BAD_LINES:
        lines += [text, '{"types": "D"}']
    found = list(parse_queries(lines, "these lines", taxonomy=TAXONOMY))
    assert [one.line for one in found] == list(range(1, len(lines) + 1))
    for number, (one, (_, word)) in enumerate(zip(found[::2], BAD_LINES, strict=True)):
        assert isinstance(one.query, InputError)
        assert_sentence(one.query, f"line {2 * number + 1} of these lines", word)
    assert all(len(signature_of(one)) == 1 for one in found[1::2])


def test_a_bad_row_of_a_table_takes_no_other_with_it(tmp_path: Path) -> None:
    rows = ["id,types", "a,D", f"b,{'D' * 200_000}", "c,Z", "d,", "e"]
    (tmp_path / "q.csv").write_text("\n".join(rows))
    found = list(read_queries(tmp_path / "q.csv", taxonomy=TAXONOMY))
    assert [one.line for one in found] == [2, 3, 4, 5, 6]
    assert [one.name for one in found] == ["a", 3, "c", "d", "e"]
    assert [isinstance(one.query, InputError) for one in found] == [False, True, True, False, True]


def test_a_route_tells_the_way_from_view_to_view() -> None:
    lines = """
{"id": "start", "types": "DB", "bearings": [10, 200]}
{"dx": 3, "dy": -4, "sigma": 2}
{"types": "D", "bearings": "90", "distance": 20, "bearing": 90}
"""
    views, legs = parse_route(lines.split("\n"), "these lines", taxonomy=TAXONOMY)
    assert [name for name, _ in views] == ["start", 3, 4]
    assert [len(view) for _, view in views] == [2, 0, 1]
    assert legs == [Leg(dx=3.0, dy=-4.0, sigma=2.0), Leg.towards(90.0, 20.0, sigma=0.0)]


def test_a_route_counts_its_bearings_from_the_north_of_its_views() -> None:
    lines = ['{"types": "D"}', '{"types": "D", "bearing": 80, "distance": 20}']
    (leg,) = parse_route(lines, "x", taxonomy=TAXONOMY, north=North(name="true", turn=10.0))[1]
    assert (leg.dx, leg.dy) == pytest.approx((20.0, 0.0))


def test_a_route_in_a_table(tmp_path: Path) -> None:
    (tmp_path / "route.csv").write_text("types,dx,dy\nDB,,\nD,0,5.5\n")
    views, legs = read_route(tmp_path / "route.csv", taxonomy=TAXONOMY)
    assert [name for name, _ in views] == [2, 3]
    assert legs == [Leg(dx=0.0, dy=5.5)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["no rows"]),
        ("{", ["line 1", "not JSON"]),
        ('{"types": "Z"}', ["line 1", "'Z'"]),
        ('{"types": "DB", "bearings": [1]}', ["2 types and 1 bear"]),
        ('{"bearings": ["north"]}', ["line 1", "not all numbers"]),
        ("[1]", ["line 1", "no view"]),
        ('{"types": "D", "dx": 1, "dy": 2}', ["line 1", "gives a step", "the first"]),
        ('{"types": "D"}\n{"types": "B"}', ["line 2", "does not give the step"]),
        ('{"dx": 5}', ["line 1", "dx and dy, or distance and bearing"]),
        ('{"dx": 1, "dy": 2, "bearing": 3}', ["dx and dy, or distance and bearing"]),
        ('{"types": "D"}\n{"dx": "far", "dy": 2}', ["line 2", "far"]),
        ('{"types": "D"}\n{"dx": Infinity, "dy": 2}', ["line 2", "leg is inf"]),
        ('{"types": "D"}\n{"dx": 1, "dy": 2, "sigma": -1.0}', ["line 2", "-1.0"]),
    ],
)
def test_lines_of_a_route(text: str, words: list[str]) -> None:
    with refused(InputError, "these lines", *words):
        parse_route(text.split("\n"), "these lines", taxonomy=TAXONOMY)


@pytest.mark.parametrize("read", [read_queries, read_route])
def test_files_that_cannot_be_read(tmp_path: Path, read: Callable[..., object]) -> None:
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("a.csv", "b.csv"):
        with refused(InputError, name, "cannot be read"):
            read(tmp_path / name, taxonomy=TAXONOMY)
