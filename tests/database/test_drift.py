from __future__ import annotations

import dataclasses
import json

import numpy as np
from sentences import refused
from worlds import CODES, random_town

from semsig_gis.core.errors import DatabaseError
from semsig_gis.core.grid import GridSpec
from semsig_gis.core.taxonomy import Taxonomy
from semsig_gis.database.update import UpdateReport, compare_cells
from semsig_gis.objects.changes import ClassChange

TREES = ClassChange(
    class_name="tree",
    before=1200,
    after=1290,
    added=100,
    removed=9,
    moved=2,
    moved_m=2.5,
    gained=0,
    lost=1,
)
LAMPS = ClassChange(
    class_name="lamp",
    before=8,
    after=9,
    added=0,
    removed=0,
    moved=0,
    moved_m=None,
    gained=1,
    lost=0,
)
REPORT = UpdateReport(
    classes=(TREES, LAMPS),
    replaced=("lamps", "trees"),
    kept=(),
    cells_before=9_000,
    cells=9_900,
    recomputed=3_000,
    changed=1_500,
    appeared=1_000,
    vanished=100,
)


def test_the_share_is_of_all_cells_before_or_after() -> None:
    assert REPORT.share == 2_600 / 10_000
    nothing = dataclasses.replace(REPORT, changed=0, appeared=0, vanished=0)
    assert nothing.share == 0.0


def test_machines_get_all_of_it() -> None:
    values = json.loads(json.dumps(REPORT.to_dict()))
    assert values["share"] == 0.26
    assert values["classes"][1] == dataclasses.asdict(LAMPS)
    assert values["kept"] == values["notes"] == []
    assert (values["cells_before"], values["cells"], values["recomputed"]) == (9000, 9900, 3000)


def test_cells_differ_in_length_class_bearing_or_distance() -> None:
    database = random_town().database
    long = np.flatnonzero(database.lengths > 1)[:4]
    entries = database.offsets[long]
    codes, bearings = database.codes.copy(), database.bearing_units.copy()
    distances = database.distance_units.copy()
    codes[entries[0]] = next(code for code in CODES if code != codes[entries[0]])
    bearings[entries[1]] ^= 1
    distances[entries[2]] ^= 1
    distances[entries[2] + 1] ^= 1
    other = dataclasses.replace(
        database, codes=codes, bearing_units=bearings, distance_units=distances
    )
    assert compare_cells(database, database).same.tolist() == [
        [row, row] for row in range(len(database))
    ]
    found = compare_cells(database, other)
    assert found.changed.tolist() == [[row, row] for row in long[:3].tolist()]
    assert len(found.same) == len(database) - 3
    shared = np.sort(long)
    found = compare_cells(database.select(shared), other)
    assert found.changed.tolist() == [[at, row] for at, row in enumerate(long[:3].tolist())]
    assert found.appeared.tolist() == sorted(set(range(len(database))) - set(shared.tolist()))
    # The signature of another cell in the place of the last one, which sees another number.
    lengths = database.lengths
    cell = int(np.flatnonzero(lengths != lengths[long[3]])[0])
    swapped = dataclasses.replace(
        database.select(np.array([cell])),
        columns=database.columns[long[3:]],
        rows=database.rows[long[3:]],
    )
    found = compare_cells(database, swapped)
    assert found.changed.tolist() == [[int(long[3]), 0]]
    found = compare_cells(database.select(slice(2)), database.select(slice(2, 5)))
    assert (found.same.size, found.changed.size) == (0, 0)
    assert (found.vanished.tolist(), found.appeared.tolist()) == ([0, 1], [0, 1, 2])


def test_cells_of_different_grids_or_ranges_are_not_compared() -> None:
    database = random_town().database
    finer = dataclasses.replace(database, grid=GridSpec(5.0))
    with refused(DatabaseError, "grid", "step=5.0", "in the same way"):
        compare_cells(database, finer)
    first = database.taxonomy.classes[0]
    farther = Taxonomy((dataclasses.replace(first, range_m=99.0), *database.taxonomy.classes[1:]))
    with refused(DatabaseError, "30.0 and 99.0"):
        compare_cells(database, dataclasses.replace(database, taxonomy=farther))
