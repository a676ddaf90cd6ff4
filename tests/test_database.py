from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS
from sentences import assert_sentence

import semsig_gis
from semsig_gis import database as database_module
from semsig_gis.catalog import load_catalog
from semsig_gis.database import (
    BEARING_UNITS,
    build_database,
    open_database,
    save_database,
)
from semsig_gis.errors import CrsError, DatabaseError, EmptyResultError
from semsig_gis.grid import GridSpec
from semsig_gis.objects import StreetObjects
from semsig_gis.signatures import SignatureSpec
from semsig_gis.viewpoints import ViewpointSpec

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.database import (
        SignatureDatabase,
    )

TAXONOMY = load_catalog("montpellier").taxonomy
CORNER = np.array([765_200.0, 6_275_000.0])
CODES = [item.code for item in TAXONOMY.classes]
ARRAYS = ("columns", "rows", "offsets", "codes", "bearing_units", "distance_dm")


@dataclass(frozen=True)
class World:
    """Objects as (x, y, class code), and how to look at them."""

    objects: tuple[tuple[float, float, int], ...]
    step: float = 10.0
    origin: tuple[float, float] = (0.0, 0.0)
    radius: float = 30.0
    levels: int = 16

    @property
    def street_objects(self) -> StreetObjects:
        x, y, codes = (np.array(part) for part in zip(*self.objects, strict=True))
        size = len(self.objects)
        table = gpd.GeoDataFrame(
            {
                "class_code": codes.astype(np.uint8),
                "source": ["world"] * size,
                "source_id": [str(row) for row in range(size)],
                "count": np.ones(size, np.int32),
            },
            geometry=shapely.points(x.astype(float), y.astype(float)),
            crs="EPSG:2154",
        )
        return StreetObjects(table, TAXONOMY, ("World (CC0): world",))

    @property
    def database(self) -> SignatureDatabase:
        return build_database(
            self.street_objects,
            grid=GridSpec(self.step, self.origin),
            spec=SignatureSpec(self.radius, self.levels),
        )


def brute_force(world: World) -> dict[tuple[int, int], list[tuple[float, float, int]]]:
    """Return (bearing, distance, class code) of what every cell sees, one pair at a time."""
    cells: dict[tuple[int, int], list[tuple[float, float, int]]] = {}
    reach = int(world.radius / world.step) + 2
    for x, y, code in world.objects:
        middle = (
            math.floor((x - world.origin[0]) / world.step),
            math.floor((y - world.origin[1]) / world.step),
        )
        for column in range(middle[0] - reach, middle[0] + reach + 1):
            for row in range(middle[1] - reach, middle[1] + reach + 1):
                dx = x - (world.origin[0] + (column + 0.5) * world.step)
                dy = y - (world.origin[1] + (row + 0.5) * world.step)
                distance = math.hypot(dx, dy)
                if distance <= world.radius:
                    bearing = round(math.degrees(math.atan2(dx, dy)) % 360.0, 9) % 360.0
                    cells.setdefault((column, row), []).append((bearing, distance, code))
    return {cell: sorted(cells[cell]) for cell in sorted(cells)}


def check_against_brute_force(world: World) -> None:
    expected = brute_force(world)
    if not expected:
        with pytest.raises(EmptyResultError) as caught:
            world.database  # noqa: B018
        assert_sentence(caught.value, f"{len(world.objects)} objects", "range", "larger")
        return
    database = world.database
    cells = list(zip(database.columns.tolist(), database.rows.tolist(), strict=True))
    assert cells == list(expected)
    assert database.lengths.tolist() == [len(seen) for seen in expected.values()]
    entries = [entry for seen in expected.values() for entry in seen]
    assert database.codes.tolist() == [code for _, _, code in entries]
    units = [math.floor(bearing * 180) for bearing, _, _ in entries]
    assert database.bearing_units.tolist() == units
    assert database.distance_dm.tolist() == [round(distance * 10) for _, distance, _ in entries]
    if BEARING_UNITS % world.levels == 0:
        levels = [math.floor(bearing / (360 / world.levels)) for bearing, _, _ in entries]
    else:  # an edge may lie between two units, of which the lower is stored
        levels = [unit * world.levels // BEARING_UNITS for unit in units]
    assert database.levels.tolist() == levels
    ends = database.offsets.tolist()
    for seen, kind, sizes in (
        (database.codes, database.type_sequences, database.type_group_sizes),
        (database.levels, database.angle_sequences, database.angle_group_sizes),
    ):
        rows = [tuple(seen[a:b].tolist()) for a, b in pairwise(ends)]
        groups = Counter(rows)
        assert sizes.tolist() == [groups[row] for row in rows]
        assert len(kind) == len(groups)
        assert [tuple(kind[i].tolist()) for i in kind.inverse] == rows


def assert_same(one: SignatureDatabase, other: SignatureDatabase) -> None:
    for name in ARRAYS:
        assert getattr(one, name).tolist() == getattr(other, name).tolist(), name
        assert getattr(one, name).dtype == getattr(other, name).dtype, name
    for name in ("grid", "spec", "taxonomy", "crs", "licenses", "version"):
        assert getattr(one, name) == getattr(other, name), name


# Quarters of a metre: sums of their squares are exact, so a circle has an exact edge.
QUARTERS = st.integers(-160, 160).map(lambda number: number / 4)
LEVELS = st.sampled_from([8, 16, 24, 32, 7])


@st.composite
def worlds(draw: st.DrawFn) -> World:
    places = st.tuples(QUARTERS, QUARTERS, st.sampled_from(CODES))
    corner = draw(st.sampled_from([(0.0, 0.0), (765_200.0, 6_275_000.0), (-3e6, -1e6)]))
    return World(
        objects=tuple(
            (x + corner[0], y + corner[1], code)
            for x, y, code in draw(st.lists(places, min_size=1, max_size=12))
        ),
        step=draw(st.sampled_from([5.0, 10.0, 12.5, 40.0])),
        origin=draw(st.tuples(QUARTERS, QUARTERS)),
        radius=draw(st.sampled_from([0.25, 5.0, 12.5, 30.0])),
        levels=draw(LEVELS),
    )


@given(worlds())
def test_a_database_is_what_a_plain_loop_finds(world: World) -> None:
    check_against_brute_force(world)


@given(st.integers(0, 2**32 - 1), LEVELS)
@settings(max_examples=25)
def test_any_coordinates_step_origin_and_range_will_do(seed: int, levels: int) -> None:
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, 150, (20, 2)) + rng.uniform(-1e6, 1e7, 2)
    check_against_brute_force(
        World(
            objects=tuple((x, y, int(rng.choice(CODES))) for x, y in places.tolist()),
            step=float(rng.uniform(4, 30)),
            origin=(float(rng.uniform(-50, 50)), float(rng.uniform(-1e6, 1e6))),
            radius=float(rng.uniform(2, 40)),
            levels=levels,
        )
    )


@pytest.mark.parametrize("levels", [8, 16, 24, 32])
def test_objects_on_the_edge_of_a_level_belong_to_the_next(levels: int) -> None:
    ring = [math.radians(360 * level / levels) for level in range(levels)]
    objects = tuple((5 + 20 * math.sin(a), 5 + 20 * math.cos(a), 3) for a in ring)
    database = World(objects, levels=levels).database
    cell = database.cell_ids.tolist().index(0)
    part = slice(*database.offsets[cell : cell + 2])
    assert database.levels[part].tolist() == list(range(levels))
    assert database.signature(cell).levels(levels).tolist() == list(range(levels))


def test_on_one_bearing_the_nearer_comes_first_then_the_lower_code() -> None:
    # From the centre of cell (0, 0), three objects in one direction that no fraction rounds well.
    objects = [(5 + 3 * k, 5 + 7 * k, code) for k, code in ((3, 1), (1, 9), (2, 5), (1, 2))]
    database = World(tuple((float(x), float(y), code) for x, y, code in objects)).database
    cell = database.cell_ids.tolist().index(0)
    assert database.types(cell) == TAXONOMY.decode([2, 9, 5, 1])
    part = slice(*database.offsets[cell : cell + 2])
    assert len(set(database.bearing_units[part].tolist())) == 1


def test_the_range_is_kept_to_the_last_bit() -> None:
    ring = [(35.0, 5.0), (5.0, -25.0), (23.0, 29.0), (math.nextafter(35.0, 99.0), 5.0)]
    database = World(tuple((x, y, 3) for x, y in ring)).database
    cell = database.cell_ids.tolist().index(0)
    assert database.lengths[cell] == 3
    assert database.distance_dm[database.offsets[cell] : database.offsets[cell + 1]].tolist() == [
        300,
        300,
        300,
    ]


def test_the_largest_range_fits_the_file(tmp_path: Path) -> None:
    world = World(((0.0, 5999.99, 3), (0.0, 0.0, 1)), step=1000.0, radius=6000.0)
    database = world.database
    save_database(database, tmp_path / "a.parquet")
    assert_same(open_database(tmp_path / "a.parquet"), database)
    check_against_brute_force(world)


def test_nothing_seen_is_an_error() -> None:
    world = World(((0.0, 0.0, 3),), step=100.0, radius=10.0)
    assert brute_force(world) == {}
    check_against_brute_force(world)


# --- Blocks and progress ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def town() -> World:
    rng = np.random.default_rng(7)
    places = rng.uniform(0, 200, (60, 2)) + CORNER
    return World(tuple((x, y, int(rng.choice(CODES))) for x, y in places.tolist()))


@pytest.mark.parametrize("size", [1, 7, 100, 10**6])
def test_blocks_leave_no_seam(town: World, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = town.database
    calls: list[tuple[int, int]] = []
    monkeypatch.setattr(database_module, "CELLS_A_BLOCK", size)
    parts = build_database(
        town.street_objects, progress=lambda done, total: calls.append((done, total))
    )
    assert_same(parts, whole)
    total = calls[-1][1]
    assert calls == [(min(done, total), total) for done in range(size, total + size, size)]


# --- The parts of a database ------------------------------------------------------------------


def test_cells_are_ordered_and_numbered(town: World) -> None:
    database = town.database
    assert (np.diff(database.cell_ids) > 0).all()
    assert len(database) == len(database.columns) == len(database.offsets) - 1
    assert (database.lengths > 0).all()
    assert (
        database.xy.tolist() == database.grid.viewpoints(database.columns, database.rows).tolist()
    )
    assert database.crs == CRS("EPSG:2154")
    assert database.licenses == ("World (CC0): world",)
    assert database.version == semsig_gis.__version__
    assert database.present_codes.tolist() == sorted(set(database.codes.tolist()))
    assert set(database.present_codes) <= set(CODES)


def test_a_signature_is_a_part_of_the_arrays(town: World) -> None:
    database = town.database
    for cell in range(0, len(database), 37):
        part = slice(database.offsets[cell], database.offsets[cell + 1])
        signature = database.signature(cell)
        assert signature.codes is not None
        assert signature.bearings is not None
        assert signature.codes.tolist() == database.codes[part].tolist()
        assert signature.bearings.tolist() == database.bearings[part].tolist()
        assert database.types(cell) == TAXONOMY.decode(database.codes[part])
        for levels in (7, 8, 16, 24, 32):
            again = dataclasses.replace(database, spec=SignatureSpec(levels=levels))
            assert signature.levels(levels).tolist() == again.levels[part].tolist()
    assert ((database.bearings >= 0) & (database.bearings < 360)).all()


def test_a_database_cannot_be_changed_by_accident(town: World, tmp_path: Path) -> None:
    built = town.database
    save_database(built, tmp_path / "a.parquet")
    for database in (built, open_database(tmp_path / "a.parquet")):
        for name in (*ARRAYS, "xy", "lengths", "levels", "present_codes"):
            with pytest.raises(ValueError, match="read-only"):
                getattr(database, name)[0] = 0
        signature = database.signature(0)
        assert signature.codes is not None
        with pytest.raises(ValueError, match="read-only"):
            signature.codes[0] = 0
        with pytest.raises(dataclasses.FrozenInstanceError):
            database.spec = SignatureSpec()  # type: ignore[misc]


# --- Files ------------------------------------------------------------------------------------


@given(world=worlds())
@settings(max_examples=25)
def test_a_saved_database_comes_back(
    world: World, tmp_path_factory: pytest.TempPathFactory
) -> None:
    if not brute_force(world):
        return
    path = tmp_path_factory.mktemp("database") / "city.parquet"
    database = world.database
    save_database(database, str(path))
    again = open_database(str(path))
    assert_same(again, database)
    save_database(again, path)
    assert_same(open_database(path), database)


def test_geopandas_reads_the_columns(town: World, tmp_path: Path) -> None:
    database = town.database
    path = tmp_path / "city.parquet"
    save_database(database, path)
    frame = gpd.read_parquet(path)
    assert list(frame.columns) == [
        "cell_id",
        "types",
        "bearings",
        "distances",
        "length",
        "geometry",
    ]
    assert frame.crs == database.crs
    assert frame["cell_id"].tolist() == database.cell_ids.tolist()
    assert frame["types"].tolist() == [database.types(cell) for cell in range(len(database))]
    assert frame["length"].tolist() == database.lengths.tolist()
    assert shapely.get_coordinates(frame.geometry).tolist() == database.xy.tolist()
    assert frame.total_bounds.tolist() == [*database.xy.min(axis=0), *database.xy.max(axis=0)]
    units = np.frombuffer(b"".join(frame["bearings"]), "<u2")
    decimetres = np.frombuffer(b"".join(frame["distances"]), "<u2")
    assert units.tolist() == database.bearing_units.tolist()
    assert decimetres.tolist() == database.distance_dm.tolist()
    specs = json.loads(pq.read_metadata(path).metadata[b"semsig"])
    assert specs["grid"] == {"step": 10.0, "origin": [0.0, 0.0]}
    assert specs["signature"] == {"radius": 30.0, "levels": 16}
    assert specs["licenses"] == ["World (CC0): world"]
    assert [item["code"] for item in specs["taxonomy"]] == CODES


def test_a_cut_file_is_an_error(town: World, tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    content = path.read_bytes()
    sizes = np.linspace(0, len(content) - 1, 80).astype(int).tolist()
    for size in [*sizes, len(content) // 2]:
        path.write_bytes(content[:size])
        with pytest.raises(DatabaseError) as caught:
            open_database(path)
        assert_sentence(caught.value, str(path), "signature database")


def rewrite(path: Path, table: pa.Table, **specs: Any) -> None:  # noqa: ANN401
    """Write a table in the place of a file, with its metadata but for some of the specs."""
    metadata = dict(pq.read_metadata(path).metadata)
    changed = json.loads(metadata[b"semsig"])
    for key, value in specs.items():
        changed[key] = value
        if value is None:
            del changed[key]
    kept = {b"geo": metadata[b"geo"], b"semsig": json.dumps(changed).encode()}
    pq.write_table(table.replace_schema_metadata(kept), path)


def swap(table: pa.Table, one: str, other: str) -> pa.Table:
    names = {one: other, other: one}
    return table.rename_columns([names.get(name, name) for name in table.column_names])


def with_first(table: pa.Table, column: str, value: object) -> pa.Table:
    values = [value, *table[column].to_pylist()[1:]]
    place = table.column_names.index(column)
    return table.set_column(place, column, pa.array(values, table[column].type))


def turned_over(table: pa.Table) -> pa.Table:
    return table.take(list(range(len(table)))[::-1])


DAMAGE = {
    "bearings and distances swapped": lambda t: swap(t, "bearings", "distances"),
    "types and bearings swapped": lambda t: swap(t, "types", "bearings"),
    "a missing column": lambda t: t.drop_columns(["bearings"]),
    "another type of column": lambda t: swap(t, "types", "length"),
    "large strings": lambda t: t.set_column(1, "types", t["types"].cast(pa.large_string())),
    "cells as floats": lambda t: t.set_column(0, "cell_id", t["cell_id"].cast(pa.float64())),
    "a missing cell": lambda t: with_first(t, "cell_id", None),
    "cells out of order": turned_over,
    "a cell twice": lambda t: pa.concat_tables([t, t]),
    "no cells": lambda t: t.slice(0, 0),
    "a missing value": lambda t: with_first(t, "bearings", None),
    "an unknown symbol": lambda t: with_first(t, "types", "?" * t["length"][0].as_py()),
    "one object too many": lambda t: with_first(t, "types", t["types"][0].as_py() + "D"),
    "an empty signature": lambda t: with_first(
        with_first(with_first(t, "types", ""), "bearings", b""), "distances", b""
    ),
    "half a number": lambda t: with_first(t, "bearings", t["bearings"][0].as_py() + b"\0"),
    "a bearing of 360": lambda t: with_first(t, "bearings", b"\x20\xfd" * t["length"][0].as_py()),
    "bearings in another order": lambda t: t.set_column(
        2, "bearings", pa.array([b[::-1] for b in t["bearings"].to_pylist()], pa.binary())
    ),
    "an object beyond the range": lambda t: with_first(
        t, "distances", b"\x2d\x01" * t["length"][0].as_py()
    ),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_columns_that_do_not_fit_are_an_error(town: World, tmp_path: Path, damage: Any) -> None:  # noqa: ANN401
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    table = pq.read_table(path)
    rewrite(path, table)
    assert_same(open_database(path), town.database)  # the rewriting itself does no harm
    rewrite(path, damage(table))
    with pytest.raises(DatabaseError) as caught:
        open_database(path)
    assert_sentence(caught.value, str(path))


@pytest.mark.parametrize(
    "specs",
    [
        {"grid": None},
        {"grid": {"step": 10.0}},
        {"grid": {"step": 0.0, "origin": [0.0, 0.0]}},
        {"grid": {"step": "ten", "origin": [0.0, 0.0]}},
        {"grid": {"step": 10.0, "origin": None}},
        {"grid": {"step": 10.0, "origin": ["x", "y"]}},
        {"signature": None},
        {"signature": {"radius": -1.0, "levels": 16}},
        {"signature": {"radius": 30.0, "levels": 16, "shape": "round"}},
        {"signature": {"radius": 5.0, "levels": 16}},
        {"taxonomy": None},
        {"taxonomy": []},
        {"taxonomy": [{"code": 1, "symbol": "BB", "name": "b", "title": "B"}]},
        {"licenses": None},
        {"version": None},
    ],
)
def test_specs_that_do_not_fit_are_an_error(
    town: World, tmp_path: Path, specs: dict[str, Any]
) -> None:
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    rewrite(path, pq.read_table(path), **specs)
    with pytest.raises(DatabaseError) as caught:
        open_database(path)
    assert_sentence(caught.value, str(path), "is damaged", "build the database again")


def test_a_file_of_street_objects_is_named_as_such(town: World, tmp_path: Path) -> None:
    from semsig_gis.objects import save_objects

    path = tmp_path / "objects.parquet"
    save_objects(town.street_objects, path)
    with pytest.raises(DatabaseError) as caught:
        open_database(path)
    assert_sentence(caught.value, str(path), "street objects", "signature database")


def test_columns_of_others_in_the_file_do_no_harm(town: World, tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_database(town.database, path)
    table = pq.read_table(path).select(
        ["geometry", "distances", "length", "bearings", "types", "cell_id"]
    )
    rewrite(path, table.append_column("note", [["x"] * len(table)]))
    assert_same(open_database(path), town.database)


def surroundings(*shapes: shapely.Geometry, **columns: list[float]) -> gpd.GeoDataFrame:
    # In degrees, so that they have to be moved.
    return gpd.GeoDataFrame(columns, geometry=list(shapes), crs="EPSG:2154").to_crs("EPSG:4326")


def lamps() -> StreetObjects:
    rng = np.random.default_rng(5)
    places = rng.uniform(0, 100, (60, 2)) + CORNER
    return World(tuple((x, y, CODES[0]) for x, y in places)).street_objects


def test_what_buildings_hide_is_not_seen() -> None:
    objects, house = lamps(), shapely.box(*(CORNER + 22), *(CORNER + 71))
    open_air = build_database(objects)
    hindered = build_database(objects, footprints=surroundings(house))
    assert hindered.occlusion == 0.5
    assert open_air.occlusion is None
    moved = surroundings(house).to_crs("EPSG:2154").geometry[0]
    expected = {}
    for cell, viewpoint in zip(open_air.cell_ids, open_air.xy, strict=True):
        pairs = [
            (xy, shapely.LineString([viewpoint, xy]))
            for xy in objects.xy
            if np.hypot(*(xy - viewpoint)) <= 30
        ]
        deep = moved.buffer(-0.5)
        free = deep.intersects(shapely.Point(viewpoint))
        expected[cell] = sum(free or not line.intersects(deep) for _, line in pairs)
    seen = dict(zip(hindered.cell_ids.tolist(), hindered.lengths.tolist(), strict=True))
    assert seen == {cell: size for cell, size in expected.items() if size}
    assert hindered.lengths.sum() < open_air.lengths.sum()


def test_only_viewpoints_become_cells(tmp_path: Path) -> None:
    objects, house = lamps(), shapely.box(*(CORNER + 22), *(CORNER + 71))
    full = build_database(objects)
    street = shapely.LineString([CORNER, CORNER + np.array([100, 0])])
    area = shapely.box(*CORNER, *(CORNER + 50))
    houses, streets = surroundings(house), surroundings(street)
    outdoor = build_database(objects, viewpoints=ViewpointSpec(mode="outdoor"), footprints=houses)
    assert not shapely.contains_xy(house.buffer(-0.1), *outdoor.xy.T).any()
    spec = ViewpointSpec(mode="streets", width=12.0, area=area)
    along = build_database(objects, viewpoints=spec, streets=streets)
    near = (shapely.distance(street, shapely.points(full.xy)) <= 12.0) & shapely.intersects_xy(
        area, *full.xy.T
    )
    assert along.cell_ids.tolist() == full.cell_ids[near].tolist()
    assert along.lengths.tolist() == full.lengths[near].tolist()
    wide = build_database(
        objects,
        viewpoints=spec,
        streets=surroundings(street, half_width=[25.0]),
    )
    assert len(wide) > len(along)

    for database in (outdoor, along, full):
        save_database(database, tmp_path / "city.parquet")
        again = open_database(tmp_path / "city.parquet")
        assert (again.viewpoints, again.occlusion) == (database.viewpoints, database.occlusion)


def test_a_file_that_does_not_tell_its_viewpoints_still_opens(tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_database(build_database(lamps()), path)
    table = pq.read_table(path)
    specs = json.loads(table.schema.metadata[b"semsig"])
    del specs["viewpoints"], specs["occlusion"]
    metadata = {**table.schema.metadata, b"semsig": json.dumps(specs).encode()}
    pq.write_table(table.replace_schema_metadata(metadata), path)
    opened = open_database(path)
    assert (opened.viewpoints, opened.occlusion) == (ViewpointSpec(), None)
    specs["viewpoints"] = {"mode": "indoors", "width": 8.0, "area": None}
    metadata[b"semsig"] = json.dumps(specs).encode()
    pq.write_table(table.replace_schema_metadata(metadata), path)
    with pytest.raises(DatabaseError) as caught:
        open_database(path)
    assert_sentence(caught.value, "damaged", "indoors")


def test_no_viewpoint_and_no_crs_are_told() -> None:
    far = ViewpointSpec(area=shapely.box(0, 0, 10, 10))
    with pytest.raises(EmptyResultError) as caught:
        build_database(lamps(), viewpoints=far)
    assert_sentence(caught.value, "none of", "viewpoint", "area")
    bare = gpd.GeoDataFrame(geometry=[shapely.box(0, 0, 10, 10)])
    with pytest.raises(CrsError) as unplaced:
        build_database(lamps(), footprints=bare)
    assert_sentence(unplaced.value, "no coordinate reference system")


def test_a_city_that_is_hidden_altogether_is_told() -> None:
    # The lamp stands deep in a building, and so does no viewpoint that would see it.
    world = World(((0.0, 0.0, CODES[0]),), radius=12.0)
    house = gpd.GeoDataFrame(geometry=[shapely.box(-2, -2, 2, 2)], crs="EPSG:2154")
    with pytest.raises(EmptyResultError) as caught:
        build_database(world.street_objects, spec=SignatureSpec(12.0), footprints=house)
    assert_sentence(caught.value, "1 objects", "leave out the buildings")
