"""Small worlds of street objects, their signatures by a simple loop, and files of a town."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import shapely
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import (
    BEARING_UNITS,
    DISTANCE_UNITS,
    FAMILIES,
    EmptyResultError,
    GridSpec,
    ObjectClass,
    ObjectIndex,
    SignatureSpec,
    Taxonomy,
)
from semsig_gis.database import ObjectStore, build_database, save_with_store
from semsig_gis.objects import Licence, StreetObjects
from semsig_gis.sources import load_catalog, paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase

TAXONOMY = load_catalog("montpellier").taxonomy
CORNER = np.array([765_200.0, 6_275_000.0])
CODES = [item.code for item in TAXONOMY.classes]
Thing = tuple[float, float, int, str, str]  # x, y, class code, source, id
KINDS = {"class_code": np.uint8, "count": np.int32}
ARRAYS = ("columns", "rows", "offsets", "codes", "bearing_units", "distance_units")
SPECS = ("grid", "spec", "taxonomy", "crs", "licenses", "version", "viewpoints", "occlusion")


def objects_of(
    *things: Thing,
    licenses: tuple[Licence, ...],
    taxonomy: Taxonomy = TAXONOMY,
    crs: str = "EPSG:2154",
    **columns: Sequence[object],
) -> StreetObjects:
    """Return street objects; `columns` are further columns or replace those of `things`."""
    x, y, codes, sources, ids = zip(*things, strict=True) if things else ((),) * 5
    plain = {"class_code": codes, "source": sources, "source_id": ids, "count": [1] * len(things)}
    values_of = (plain | columns).items()
    table = gpd.GeoDataFrame(
        {name: np.array(values, KINDS.get(name, object)) for name, values in values_of},
        geometry=shapely.points(np.array(x, float), np.array(y, float)),
        crs=crs,
    )
    return StreetObjects(table, taxonomy, licenses)


@dataclass(frozen=True)
class World:
    """Objects as (x, y, class code), with the parameters of their signatures."""

    objects: tuple[tuple[float, float, int], ...]
    step: float = 10.0
    origin: tuple[float, float] = (0.0, 0.0)
    radius: float = 30.0
    levels: int = 16
    ranges: Mapping[int, float] = field(default_factory=dict)
    """Visibility ranges of some classes by code; the others have the radius."""

    @property
    def taxonomy(self) -> Taxonomy:
        names = {TAXONOMY.by_code(code).name: metres for code, metres in self.ranges.items()}
        return TAXONOMY.with_ranges(names)

    @property
    def reach(self) -> float:
        return max(self.radius, *self.ranges.values(), 0.0)

    @property
    def street_objects(self) -> StreetObjects:
        things = [(*item, "world", str(row)) for row, item in enumerate(self.objects)]
        licenses = (Licence("World (CC0)", ("world",)),)
        return objects_of(*things, licenses=licenses, taxonomy=self.taxonomy)

    @property
    def database(self) -> SignatureDatabase:
        return build_database(
            self.street_objects,
            grid=GridSpec(self.step, self.origin),
            spec=SignatureSpec(self.radius, self.levels),
        )


def brute_force(world: World) -> dict[tuple[int, int], list[tuple[float, float, int]]]:
    """Return (bearing, distance, class code) of the visible objects of every cell, by a loop."""
    cells: dict[tuple[int, int], list[tuple[float, float, int]]] = {}
    reach = int(world.reach / world.step) + 2
    for x, y, code in world.objects:
        middle = math.floor((x - world.origin[0]) / world.step)
        level = math.floor((y - world.origin[1]) / world.step)
        for column in range(middle - reach, middle + reach + 1):
            for row in range(level - reach, level + reach + 1):
                dx = x - (world.origin[0] + (column + 0.5) * world.step)
                dy = y - (world.origin[1] + (row + 0.5) * world.step)
                distance = math.hypot(dx, dy)
                if distance <= world.ranges.get(code, world.radius):
                    bearing = round(math.degrees(math.atan2(dx, dy)) % 360.0, 9) % 360.0
                    cells.setdefault((column, row), []).append((bearing, distance, code))
    return {cell: sorted(cells[cell]) for cell in sorted(cells)}


def check_against_brute_force(world: World) -> None:
    expected = brute_force(world)
    if not expected:
        with refused(EmptyResultError, f"{len(world.objects)} objects", "range", "larger"):
            world.database  # noqa: B018
        return
    database = world.database
    cells = list(zip(database.columns.tolist(), database.rows.tolist(), strict=True))
    assert cells == list(expected)
    assert database.lengths.tolist() == [len(visible) for visible in expected.values()]
    entries = [entry for visible in expected.values() for entry in visible]
    assert database.codes.tolist() == [code for _, _, code in entries]
    units = [math.floor(bearing * 20) for bearing, _, _ in entries]
    assert database.bearing_units.tolist() == units
    scale = DISTANCE_UNITS / world.reach
    assert database.distance_units.tolist() == [round(d * scale) for _, d, _ in entries]
    if BEARING_UNITS % world.levels == 0:
        levels = [math.floor(bearing / (360 / world.levels)) for bearing, _, _ in entries]
    else:  # an edge may be between two units; the lower is stored
        levels = [unit * world.levels // BEARING_UNITS for unit in units]
    assert database.levels.tolist() == levels
    ends = database.offsets.tolist()
    for values, sequences, sizes in (
        (database.codes, database.type_sequences, database.type_group_sizes),
        (database.levels, database.angle_sequences, database.angle_group_sizes),
    ):
        rows = [tuple(values[a:b].tolist()) for a, b in pairwise(ends)]
        groups = Counter(rows)
        assert sizes.tolist() == [groups[row] for row in rows]
        assert len(sequences) == len(groups)
        assert [tuple(sequences[i].tolist()) for i in sequences.inverse] == rows


def assert_same(first: SignatureDatabase, second: SignatureDatabase) -> None:
    for name in ARRAYS:
        assert getattr(first, name).tolist() == getattr(second, name).tolist(), name
        assert getattr(first, name).dtype == getattr(second, name).dtype, name
    for name in SPECS:
        assert getattr(first, name) == getattr(second, name), name


def assert_index_fits(store: ObjectStore) -> None:
    """Check that the R-tree of a store is over its objects."""
    xy = store.objects.xy
    for radius in (0.0, 25.0):
        ours, fresh = (
            sorted(zip(*index.pairs_within(xy, radius=radius), strict=True))
            for index in (store.index, ObjectIndex(xy))
        )
        assert ours == fresh


NUMBERS = st.integers(-160, 160)
# Sums of the squares of quarters of a metre are exact, so that a circle has an exact edge.
UNITS = st.sampled_from([0.25, 0.25, math.e / 10])
LEVELS = st.sampled_from([8, 16, 24, 32, 7])
RANGES = st.sampled_from([2.5, 12.5, 40.0])


@st.composite
def worlds(draw: st.DrawFn) -> World:
    places = st.tuples(NUMBERS, NUMBERS, st.sampled_from(CODES))
    unit = draw(UNITS)
    corner = draw(st.sampled_from([(0.0, 0.0), (765_200.0, 6_275_000.0), (-3e6, -1e6)]))
    return World(
        objects=tuple(
            (x * unit + corner[0], y * unit + corner[1], code)
            for x, y, code in draw(st.lists(places, min_size=1, max_size=12))
        ),
        step=draw(st.sampled_from([5.0, 7.3, 10.0, 12.5, 40.0])),
        origin=(draw(NUMBERS) * unit, draw(NUMBERS) * unit),
        radius=draw(st.sampled_from([0.25, 5.0, 12.5, 17.3, 30.0])),
        levels=draw(LEVELS),
        ranges=draw(st.dictionaries(st.sampled_from(CODES), RANGES, max_size=2)),
    )


def random_town(
    seed: int = 7, *, count: int = 60, side: float = 200.0, codes: Sequence[int] = CODES
) -> World:
    """Return `count` objects in a square."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(0, side, (count, 2)) + CORNER
    return World(tuple((x, y, int(rng.choice(codes))) for x, y in places.tolist()))


def lamps() -> StreetObjects:
    return random_town(5, side=100.0, codes=CODES[:1]).street_objects


def surroundings(*shapes: shapely.Geometry, **columns: list[Any]) -> gpd.GeoDataFrame:
    # In degrees, so that they must be reprojected.
    return gpd.GeoDataFrame(columns, geometry=list(shapes), crs="EPSG:2154").to_crs("EPSG:4326")


TOWN = random_town()
QUERIES = 30


def save_town(folder: Path, town: World = TOWN, name: str = "city.parquet") -> Path:
    """Save a town with its street objects, and return its file."""
    save_with_store(town.database, ObjectStore.of(town.street_objects), folder / name)
    return folder / name


def contents(folder: Path) -> dict[str, bytes]:
    """Return the contents of all files in a folder, except files with times."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in {"timing.json", "times.json"}
    }


def many_classes(a_family: int = 8) -> Taxonomy:
    """Return the paper's classes, and `a_family` more of every family."""
    letters = map(chr, (*range(0x410, 0x450), *range(0x100, 0x180)))
    kinds = ((name, number) for name in FAMILIES for number in range(a_family))
    return Taxonomy(
        (
            *paper_taxonomy().classes,
            *(
                ObjectClass(
                    code, next(letters), f"{name}_{number}", f"{name} {number}", family=name
                )
                for code, (name, number) in enumerate(kinds, start=90)
            ),
        )
    )
