from __future__ import annotations

import dataclasses
import json
import shutil
import tempfile
import threading
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
import shapely
import worlds
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import CODES, CORNER, TAXONOMY, assert_index_fits, assert_same, surroundings

from semsig_gis.core import (
    CrsError,
    DatabaseError,
    EmptyResultError,
    InputError,
    ObjectClass,
    Taxonomy,
)
from semsig_gis.database import (
    ObjectStore,
    TileSpec,
    ViewpointSpec,
    build_cells,
    build_database,
    build_tiles,
    compare_cells,
    open_database,
    open_store,
    save_with_store,
    store_path,
    update_database,
    update_file,
    update_tile,
    update_tiles,
)
from semsig_gis.objects import (
    Licence,
    assemble,
    choose_layers,
    open_objects,
    read_files,
    save_objects,
)
from semsig_gis.sources import load_catalog

if TYPE_CHECKING:
    from collections.abc import Callable

    from worlds import World

    from semsig_gis.database import SignatureDatabase, UpdateReport, ViewpointMode
    from semsig_gis.objects import Loaded, Selection, StreetObjects

# One class with a larger visibility range than the others, and one with a smaller.
RANGES = zip((TAXONOMY.by_code(code).name for code in CODES), (45.0, 12.5), strict=False)
CLASSES = TAXONOMY.with_ranges(dict(RANGES))
SIZE = 300.0


def at(x: float, y: float) -> tuple[float, float]:
    """Return a place in the town."""
    return CORNER[0] + x, CORNER[1] + y


def house(x: float, y: float) -> shapely.Polygon:
    return shapely.box(*at(x, y), *at(x + 20, y + 12))


# Rows of joined houses, an invalid one and a detached one.
HOUSES = surroundings(
    *(house(x, y) for x in (30, 50, 70) for y in (40, 52.05, 200)),
    shapely.Polygon([at(150, 150), at(180, 170), at(180, 150), at(150, 170)]),
    house(230, 230),
)
STREETS = surroundings(
    shapely.LineString([at(0, 30), at(SIZE, 30)]),
    shapely.LineString([at(110, 0), at(120, SIZE)]),
    half_width=[np.nan, 14.0],
)
HOUSES.attrs["licenses"] = ["City (CC0): houses"]
STREETS.attrs["licenses"] = ["Roads (OGL): lanes"]
AREA = shapely.Polygon([at(-20, -20), at(400, 0), at(200, 280)])


def objects_of(table: pd.DataFrame, taxonomy: Taxonomy = CLASSES) -> StreetObjects:
    things = table[["x", "y", "class_code", "source", "source_id"]].itertuples(index=False)
    licenses = (Licence("A (CC0)", tuple(sorted(table["source"].unique()))),)
    return worlds.objects_of(*things, licenses=licenses, taxonomy=taxonomy)


def random_table(rng: np.random.Generator, size: int) -> pd.DataFrame:
    places = np.round(rng.uniform(0, SIZE, (size, 2)) * 4) / 4 + CORNER
    return pd.DataFrame(
        {
            "class_code": rng.choice(CODES[:6], size),
            "source": rng.choice(["trees", "lamps", "signs"], size),
            "source_id": [str(number) for number in rng.integers(0, 10 * size, size)],
            "x": places[:, 0],
            "y": places[:, 1],
        }
    )


def edited(table: pd.DataFrame, rng: np.random.Generator, edits: int) -> pd.DataFrame:
    """Return the table after random additions, moves, removals and changes of class."""
    for kind in rng.choice(["add", "move", "remove", "class"], edits):
        row = rng.choice(table.index)
        if kind == "add":
            table = pd.concat([table, random_table(rng, 1)], ignore_index=True)
        elif kind == "move":
            table.loc[row, ["x", "y"]] += np.round(rng.normal(0, 8, 2), 2)
        elif kind == "class":
            table.loc[row, "class_code"] = rng.choice(CODES[:6])
        elif len(table) > 1:
            table = table.drop(index=row)
    return table.sample(frac=1.0, random_state=int(rng.integers(2**31)))


def builder(**options: Any) -> Callable[[StreetObjects], SignatureDatabase]:  # noqa: ANN401
    return lambda objects: build_database(objects, **options)


def check_report(report: UpdateReport, before: SignatureDatabase, after: SignatureDatabase) -> None:
    """Check the counts of a report with a plain comparison of the signatures."""

    def signatures(database: SignatureDatabase) -> dict[int, tuple[bytes, ...]]:
        extents = () if database.extent_units is None else (database.extent_units,)
        arrays = (database.codes, database.bearing_units, database.distance_units, *extents)
        cuts = database.offsets[1:-1]
        parts = zip(*([part.tobytes() for part in np.split(a, cuts)] for a in arrays), strict=True)
        return dict(zip(database.cell_ids.tolist(), parts, strict=True))

    old, new = signatures(before), signatures(after)
    same = [cell for cell in old if new.get(cell) == old[cell]]
    changed = [cell for cell in old if new.get(cell, old[cell]) != old[cell]]
    vanished = [cell for cell in old if cell not in new]
    appeared = [cell for cell in new if cell not in old]
    drift = compare_cells(before, after)
    for rows, cells in ((drift.same, same), (drift.changed, changed)):
        assert before.cell_ids[rows[:, 0]].tolist() == cells
        assert after.cell_ids[rows[:, 1]].tolist() == cells
    assert before.cell_ids[drift.vanished].tolist() == vanished
    assert after.cell_ids[drift.appeared].tolist() == appeared
    assert (report.cells_before, report.cells) == (len(old), len(new))
    drifted = [len(changed), len(appeared), len(vanished)]
    assert [report.changed, report.appeared, report.vanished] == drifted
    assert sum(drifted) <= report.recomputed
    assert report.share == pytest.approx(sum(drifted) / len(old.keys() | new.keys()))


@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.integers(1, 150),
    edits=st.lists(st.integers(0, 40), min_size=1, max_size=2),
    houses=st.booleans(),
    mode=st.sampled_from(["all", "outdoor", "streets"]),
    area=st.booleans(),
)
@example(seed=1, size=120, edits=[30], houses=True, mode="outdoor", area=False)
@example(seed=2, size=120, edits=[30], houses=True, mode="streets", area=True)
@example(seed=11, size=250, edits=[20] * 10, houses=True, mode="streets", area=False)
def test_an_update_equals_a_rebuild(
    *, seed: int, size: int, edits: list[int], houses: bool, mode: ViewpointMode, area: bool
) -> None:
    rng = np.random.default_rng(seed)
    table = random_table(rng, size)
    options: dict[str, Any] = {
        "footprints": HOUSES if houses or mode == "outdoor" else None,
        "streets": STREETS if mode == "streets" else None,
    }
    build = builder(viewpoints=ViewpointSpec(mode=mode, area=AREA if area else None), **options)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "city.parquet")
        try:
            first = build(objects_of(table))
        except EmptyResultError:
            return
        save_with_store(first, ObjectStore.of(objects_of(table), **options), path)
        for number in edits:  # each update continues from the last one
            before, layers = open_database(path), {*open_store(path).objects.table["source"]}
            table = edited(table, rng, number)
            new = objects_of(table)
            try:
                report = update_file(path, new)
            except EmptyResultError:
                with pytest.raises(EmptyResultError):
                    build(new)
                return
            after, store = open_database(path), open_store(path)
            # Layers without objects are not in the new table, so they are kept.
            assert {*report.kept} == layers - {*table["source"]}
            assert_same(after, build(store.objects if report.kept else new))
            assert_index_fits(store)
            check_report(report, before, after)
        assert {file.name for file in path.parent.iterdir()} == {"city.objects", "city.parquet"}


@pytest.mark.parametrize("mode", ["outdoor", "streets"])
def test_updates_far_from_buildings_and_streets_equal_a_rebuild(mode: ViewpointMode) -> None:
    rng = np.random.default_rng(3)
    town, hamlet = random_table(rng, 80), random_table(rng, 30)
    hamlet[["x", "y"]] += 2000.0
    options = {"footprints": HOUSES, "streets": STREETS}
    build = builder(viewpoints=ViewpointSpec(mode=mode), **options)
    old = objects_of(pd.concat([town, hamlet]))
    for new in (objects_of(pd.concat([town, hamlet[9:]])), objects_of(town)):
        before = build(old)
        after, store, report = update_database(before, ObjectStore.of(old, **options), new)
        assert_same(after, build(new))
        assert_index_fits(store)
        assert report.recomputed > 100
        assert (report.vanished > 0) == (mode == "outdoor")


@pytest.fixture
def table() -> pd.DataFrame:
    return random_table(np.random.default_rng(5), 120)


@pytest.fixture
def path(table: pd.DataFrame, tmp_path: Path) -> Path:
    objects = objects_of(table)
    save_with_store(build_database(objects), ObjectStore.of(objects), tmp_path / "city.parquet")
    return tmp_path / "city.parquet"


def test_only_cells_in_range_of_a_change_are_recomputed(path: Path, table: pd.DataFrame) -> None:
    database = open_database(path)
    x, y = at(100.25, 120.5)
    columns, rows = np.meshgrid(np.arange(76520, 76550), np.arange(627500, 627530))
    centres = database.grid.viewpoints(columns.ravel(), rows.ravel())
    distances = np.hypot(centres[:, 0] - x, centres[:, 1] - y)
    for code, reach in ((CODES[0], 45.0), (CODES[1], 12.5), (CODES[2], 30.0)):
        thing = table[:1].assign(class_code=code, x=x, y=y)
        more = objects_of(pd.concat([table, thing]))
        _, _, report = update_database(database, open_store(path), more)
        near = distances <= reach
        assert report.recomputed == near.sum()
        assert report.changed + report.appeared == near.sum()
        (item,) = (change for change in report.classes if change.added)
        assert (item.class_name, item.added) == (CLASSES.by_code(code).name, 1)


def test_an_update_without_changes_keeps_the_file(path: Path, table: pd.DataFrame) -> None:
    content, other = path.read_bytes(), path.with_name("later.parquet")
    update_file(path, objects_of(table[3:]), out=other)
    assert_same(open_database(other), build_database(objects_of(table[3:])))
    assert (len(open_store(path).objects), len(open_store(other).objects)) == (120, 117)
    report = update_file(path, objects_of(table.sample(frac=1.0, random_state=1)))
    assert path.read_bytes() == content
    assert (report.recomputed, report.share) == (0, 0.0)
    assert_index_fits(open_store(path))


def test_layers_that_were_not_loaded_are_kept(path: Path, table: pd.DataFrame) -> None:
    trees = table[table["source"] == "trees"][5:]
    report = update_file(path, objects_of(trees))
    values = json.loads(json.dumps(report.to_dict()))
    assert (values["share"], values["kept"]) == (report.share, ["lamps", "signs"])
    assert values["classes"] == [dataclasses.asdict(item) for item in report.classes]
    expected = pd.concat([table[table["source"] != "trees"], trees])
    rebuilt = build_database(objects_of(expected))
    updated = open_database(path)
    assert updated.licenses == ("A (CC0): lamps, signs, trees",)
    assert_same(updated, rebuilt)
    assert (report.replaced, report.kept) == (("trees",), ("lamps", "signs"))
    assert sum(item.removed for item in report.classes) == 5


def test_an_update_adds_a_new_class(path: Path, table: pd.DataFrame) -> None:
    drain = ObjectClass(250, "9", "drain", "Drain", 20.0)
    extended = CLASSES.extended([drain])
    more = pd.concat([table, table[:4].assign(class_code=250, source="drains")])
    new = objects_of(more[more["source"] == "drains"], extended)
    report = update_file(path, new)
    assert open_database(path).taxonomy == extended
    assert_same(
        dataclasses.replace(open_database(path), licenses=()),
        dataclasses.replace(build_database(objects_of(more, extended)), licenses=()),
    )
    assert report.classes[-1].class_name == "drain"
    assert (report.classes[-1].before, report.classes[-1].added) == (0, 4)


def test_incompatible_updates_of_a_file_are_refused(path: Path, table: pd.DataFrame) -> None:
    before = {file: file.read_bytes() for file in (path, *store_path(path).iterdir())}
    far = CLASSES.extended([ObjectClass(250, "9", "tower", "Tower", 90.0)])
    with refused(InputError, "'tower'", "90 m", "45 m", "build the database again"):
        update_file(path, objects_of(table, far))
    with refused(InputError, "seen from 45 m"):
        update_file(path, objects_of(table, TAXONOMY))
    other_crs = objects_of(table)
    other_crs = dataclasses.replace(other_crs, table=other_crs.table.to_crs("EPSG:32631"))
    with refused(CrsError, "EPSG:32631", "EPSG:2154"):
        update_file(path, other_crs)
    for file in (path.with_name("none.parquet"), path.parent):
        with pytest.raises(DatabaseError):
            update_file(file, objects_of(table))
    assert {file: file.read_bytes() for file in before} == before


def test_an_update_without_remaining_cells_is_refused(town: World) -> None:
    objects = town.street_objects
    area = ViewpointSpec(area=shapely.box(*CORNER, *(CORNER + 30)))
    away = dataclasses.replace(objects, table=objects.table[(objects.xy > CORNER + 90).all(axis=1)])
    with refused(EmptyResultError, "no cell would see"):
        update_database(build_database(objects, viewpoints=area), ObjectStore.of(objects), away)


def test_a_store_without_buildings_or_streets_is_refused() -> None:
    objects = objects_of(random_table(np.random.default_rng(5), 60))
    spec = ViewpointSpec(mode="streets")
    database = build_database(objects, viewpoints=spec, footprints=HOUSES, streets=STREETS)
    with refused(DatabaseError, "buildings and streets", "build the database again"):
        update_database(database, ObjectStore.of(objects), objects)
    with refused(DatabaseError, "lacks the streets"):
        update_database(database, ObjectStore.of(objects, footprints=HOUSES), objects)


@given(
    seed=st.integers(0, 2**32 - 1),
    side=st.sampled_from([130.0, 1000.0]),
    edits=st.integers(0, 6),
    mode=st.sampled_from(["all", "outdoor", "streets"]),
)
@example(seed=1, side=130.0, edits=3, mode="streets")
@example(seed=2, side=130.0, edits=0, mode="all")
@settings(max_examples=3)
def test_an_update_of_tiles_equals_a_rebuild(
    *, seed: int, side: float, edits: int, mode: ViewpointMode
) -> None:
    rng = np.random.default_rng(seed)
    table = random_table(rng, 60)
    options: dict[str, Any] = {
        "buildings": None if mode == "all" else HOUSES,
        "streets": STREETS if mode == "streets" else None,
    }
    specs: dict[str, Any] = {"tile": TileSpec(side), "viewpoints": ViewpointSpec(mode=mode)}
    with tempfile.TemporaryDirectory() as folder:
        old, new, city, rebuilt = (Path(folder, name) for name in ("old", "new", "city", "rebuilt"))
        save_objects(objects_of(table), old)
        build_tiles(old, city, **specs, **options)
        save_objects(objects_of(edited(table, rng, edits)), new)
        before = open_database(city)
        report = update_tiles(city, new)
        if report.kept:  # layers without objects are not in the new file
            save_objects(open_store(city).objects, new)
        build_tiles(new, rebuilt, **specs, **options)
        assert folder_bytes(city) == folder_bytes(rebuilt)
        check_report(report, before, open_database(city))
        assert {path.name for path in Path(folder).iterdir()} == {"old", "new", "city", "rebuilt"}


def folder_bytes(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture
def tiled(table: pd.DataFrame, tmp_path: Path) -> Path:
    save_objects(objects_of(table), tmp_path / "old.parquet")
    build_tiles(tmp_path / "old.parquet", tmp_path / "tiles", tile=TileSpec(100.0))
    return tmp_path / "tiles"


def test_only_cells_of_tiles_in_range_of_a_change_are_recomputed(
    tiled: Path, table: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new, later = tmp_path / "new.parquet", tmp_path / "later.parquet"
    later_table = table.copy()
    later_table.loc[0, ["x", "y"]] = at(50.0, 50.0)
    objects = objects_of(later_table)
    objects = dataclasses.replace(objects, licenses=(Licence("B (ODbL)", ()),), notes=("new",))
    save_objects(objects_of(later_table), new)
    save_objects(objects, later)
    computed: list[int] = []

    def count(objects: StreetObjects, columns: Any, *args: Any, **options: Any) -> Any:  # noqa: ANN401
        computed.append(len(columns))
        return build_cells(objects, columns, *args, **options)

    monkeypatch.setattr("semsig_gis.database.tiles.build_cells", count)
    report = update_tiles(tiled, new)
    assert sum(computed) == report.recomputed > 0
    assert len(computed) < len(list(tiled.glob("tile_*")))
    computed.clear()
    update_tiles(tiled, later)
    assert not computed
    build_tiles(later, tmp_path / "rebuilt", tile=TileSpec(100.0))
    assert folder_bytes(tiled) == folder_bytes(tmp_path / "rebuilt")


def test_an_interrupted_update_of_tiles_is_resumed(
    tiled: Path, table: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new, before, tiles = tmp_path / "new.parquet", open_database(tiled), iter(range(4))
    later_table = table.copy()
    later_table[["x", "y"]] += 1.25
    save_objects(objects_of(later_table), new)

    def interrupted(*args: Any) -> Any:  # noqa: ANN401
        if next(tiles, None) is None:
            raise KeyboardInterrupt
        return update_tile(*args)

    monkeypatch.setattr("semsig_gis.database.update.update_tile", interrupted)
    with pytest.raises(KeyboardInterrupt):
        update_tiles(tiled, new)
    monkeypatch.undo()
    assert len(list(tiled.with_name("tiles.partial").glob("tile_*.parquet"))) == 4
    check_report(update_tiles(tiled, new), before, open_database(tiled))
    build_tiles(new, tmp_path / "rebuilt", tile=TileSpec(100.0))
    assert folder_bytes(tiled) == folder_bytes(tmp_path / "rebuilt")


@pytest.mark.parametrize("tiles", [True, False])
def test_updates_at_the_same_time_follow_each_other(
    *, tiles: bool, path: Path, tiled: Path, table: pd.DataFrame, tmp_path: Path
) -> None:
    """Each replaces another layer; none is lost, and none fails."""
    names = sorted(table["source"].unique())[:2]
    files, counts = [], {}
    for number, name in enumerate(names):
        layer = table[table["source"] == name]
        rows = layer.iloc[: len(layer) // (number + 2)]
        counts[name] = len(rows)
        files.append(tmp_path / f"{number}.parquet")
        save_objects(objects_of(rows), files[-1])
    place, errors = tiled if tiles else path, list[Exception]()

    def update(file: Path) -> None:
        try:
            update_tiles(place, file) if tiles else update_file(place, open_objects(file))
        except Exception as error:  # noqa: BLE001 - of another thread
            errors.append(error)

    threads = [threading.Thread(target=update, args=(file,)) for file in files]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    objects = open_store(place).objects
    assert {name: int((objects.table["source"] == name).sum()) for name in names} == counts
    assert len(open_database(place)) == len(build_database(objects))
    assert not [*place.parent.glob(".semsig-*")]


def test_tiles_keep_their_inputs_as_a_store(
    tiled: Path, table: pd.DataFrame, tmp_path: Path
) -> None:
    houses = tmp_path / "houses.gpkg"
    HOUSES.to_file(houses)
    options: dict[str, Any] = {"viewpoints": ViewpointSpec(mode="streets"), "streets": STREETS}
    build_tiles(tmp_path / "old.parquet", tiled, buildings=houses, **options)
    houses.unlink()  # the database has copies
    (tmp_path / "old.parquet").unlink()
    store = open_store(tiled)
    assert sorted(store.objects.table["source_id"]) == sorted(table["source_id"])
    assert store.footprints is not None
    assert store.streets is not None
    assert (len(store.footprints), len(store.streets)) == (len(HOUSES), len(STREETS))
    content = folder_bytes(tiled)
    new = tmp_path / "new.parquet"
    save_objects(objects_of(table[table["source"] == "trees"][3:]), new)
    report = update_tiles(tiled, new)
    assert (report.replaced, report.kept) == (("trees",), ("lamps", "signs"))
    save_objects(objects_of(table), new)
    update_tiles(tiled, new)
    assert folder_bytes(tiled) == content


def test_incompatible_updates_of_tiles_are_refused(
    tiled: Path, table: pd.DataFrame, tmp_path: Path
) -> None:
    far = tmp_path / "far.parquet"
    content = folder_bytes(tiled)
    tower = CLASSES.extended([ObjectClass(250, "9", "tower", "Tower", 90.0)])
    save_objects(objects_of(table, tower), far)
    with refused(InputError, "90 m", "45 m", "build the database again"):
        update_tiles(tiled, far)
    assert folder_bytes(tiled) == content
    assert not tiled.with_name("tiles.partial").exists()
    shutil.rmtree(tiled / "_inputs")
    with refused(DatabaseError, "no street objects", "build the database again"):
        update_tiles(tiled, far)


def test_cells_of_different_ranges_are_not_compared(database: SignatureDatabase) -> None:
    first, *others = database.taxonomy.classes
    farther = Taxonomy((dataclasses.replace(first, range_m=99.0), *others))
    with refused(DatabaseError, "30.0 and 99.0"):
        compare_cells(database, dataclasses.replace(database, taxonomy=farther))


@cache
def monaco(geodata: Path, year: int, selection: Selection) -> Loaded:
    catalog = load_catalog("openstreetmap")
    specs = choose_layers(catalog, selection=selection, surroundings=True)
    layers, _ = read_files(specs, [geodata / "osm" / f"monaco_{year}.osm.pbf"])
    return assemble(layers, catalog)


@pytest.mark.parametrize("mode", ["all", "outdoor", "streets"])
def test_an_update_of_monaco_by_a_year_equals_a_rebuild(
    geodata: Path, tmp_path: Path, mode: ViewpointMode
) -> None:
    # Very many cells see landmarks: those along streets are enough for a test.
    selection: Selection = "default" if mode == "streets" else "paper"
    before, after = (monaco(geodata, year, selection) for year in (2021, 2022))
    options: dict[str, Any] = {"footprints": before.buildings, "streets": before.streets}
    options = {} if mode == "all" else options
    build = builder(viewpoints=ViewpointSpec(mode=mode), **options)
    path = tmp_path / "monaco.parquet"
    first = build(before.objects)
    save_with_store(first, ObjectStore.of(before.objects, **options), path)
    report = update_file(path, after.objects)
    assert_same(open_database(path), build(after.objects))
    check_report(report, first, open_database(path))
    assert_index_fits(open_store(path))
    assert report.kept == report.notes == ()
    assert sum(item.added for item in report.classes) > 100
    # A landmark changes very many cells.
    assert 0.1 < report.share < (1.0 if mode == "streets" else 0.6)
