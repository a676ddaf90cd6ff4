from __future__ import annotations

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pyproj import CRS
from sentences import refused
from worlds import ARRAYS, TAXONOMY, assert_same

import semsig_gis
from semsig_gis.core import DatabaseError, GridSpec, InputError, SignatureSpec, UnknownNameError
from semsig_gis.database import (
    SequenceTable,
    ViewpointSpec,
    checked_sequence,
    join_databases,
    open_database,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase


def test_cells_are_ordered_and_numbered(database: SignatureDatabase) -> None:
    assert (np.diff(database.cell_ids) > 0).all()
    assert len(database) == len(database.columns) == len(database.offsets) - 1
    assert (database.lengths > 0).all()
    assert database.crs == CRS("EPSG:2154")
    assert database.licenses == ("World (CC0): world",)
    assert database.version == semsig_gis.__version__
    assert database.present_codes.tolist() == sorted(set(database.codes.tolist()))


def test_places_are_assigned_to_their_cells(database: SignatureDatabase) -> None:
    cells = np.arange(len(database))
    offsets = np.random.default_rng(1).uniform(-4.9, 4.9, (len(cells), 2))
    assert (database.cells_at(database.xy + offsets) == cells).all()
    far = database.xy.min(axis=0) - 1000.0
    assert database.cells_at([far, database.xy[2]]).tolist() == [-1, 2]


def test_cells_are_a_table_of_squares_or_points(database: SignatureDatabase) -> None:
    table = database.to_geodataframe()
    assert table.crs == database.crs
    assert table.attrs["licenses"] == list(database.licenses)
    assert table["types"].tolist() == [database.types(cell) for cell in range(len(database))]
    numbers = [float(text) for row in table["bearings"] for text in row.split()]
    assert numbers == pytest.approx(database.bearings.tolist(), abs=0.006)
    assert set(table.geometry.area.round(6)) == {database.grid.step**2}
    points = database.to_geodataframe(geometry="point")
    assert np.column_stack([points.geometry.x, points.geometry.y]).tolist() == database.xy.tolist()
    with refused(UnknownNameError, "'square'", "'polygon' or 'point'"):
        database.to_geodataframe(geometry="square")  # type: ignore[arg-type]


def test_a_signature_is_a_slice_of_the_arrays(database: SignatureDatabase) -> None:
    for cell in range(0, len(database), 37):
        part = slice(database.offsets[cell], database.offsets[cell + 1])
        signature = database.signature(cell)
        types = TAXONOMY.decode(database.codes[part])
        bearings = database.bearings[part].tolist()
        values = {"types": types, "bearings": bearings, "length": len(types)}
        assert signature.to_dict(TAXONOMY) == values
        assert database.types(cell) == types
        for levels in (7, 8, 16, 24, 32):
            again = dataclasses.replace(database, spec=SignatureSpec(levels=levels))
            assert signature.levels(levels).tolist() == again.levels[part].tolist()
    assert ((database.bearings >= 0) & (database.bearings < 360)).all()


@given(st.lists(st.integers(0, 3), min_size=1))
def test_joined_parts_equal_the_whole_database(
    database: SignatureDatabase, owners: list[int]
) -> None:
    owner = np.resize(owners, len(database))
    parts = [database.select(owner == number) for number in range(4)]
    joined = join_databases(parts[::-1])
    assert_same(joined, database)
    assert joined.licenses == database.licenses


def test_selected_cells_keep_their_signatures(database: SignatureDatabase) -> None:
    some = database.select(np.array([5, 2, 9]))
    assert [some.types(i) for i in range(3)] == [database.types(i) for i in (5, 2, 9)]
    assert some.cell_ids.tolist() == database.cell_ids[[5, 2, 9]].tolist()
    assert len(database.select(slice(0, 0))) == 0


def test_databases_with_different_settings_are_not_joined(database: SignatureDatabase) -> None:
    half = database.select(slice(10))
    for change, word in (
        ({"grid": GridSpec(20.0)}, "grid (GridSpec(step=10.0, "),
        ({"spec": SignatureSpec(25.0)}, "range"),
        ({"crs": CRS("EPSG:32631")}, "coordinate"),
        ({"viewpoints": ViewpointSpec(mode="outdoor")}, "viewpoints"),
        ({"occlusion": 0.5}, "occlusion"),
    ):
        with refused(DatabaseError, word, "build both in the same way"):
            join_databases([half, dataclasses.replace(database, **change)])
    with refused(DatabaseError, "same cell"):
        join_databases([half, database])
    with refused(DatabaseError, "no database"):
        join_databases([])


# Few values make equal sequences likely; 255 and 64 reach the last and the second word of bits.
VALUES = st.sampled_from([0, 1, 2, 63, 64, 255])
ROWS = st.lists(st.lists(VALUES, max_size=5), max_size=12)


def table_of(rows: list[list[int]]) -> SequenceTable:
    values = np.array([value for row in rows for value in row], np.uint8)
    return SequenceTable.from_csr(values, np.cumsum([0, *map(len, rows)]))


def sequence(*values: int) -> NDArray[np.uint8]:
    return np.array(values, np.uint8)


@given(ROWS)
def test_distinct_sequences_by_length_then_first_appearance(rows: list[list[int]]) -> None:
    distinct = sorted(dict.fromkeys(map(tuple, rows)), key=len)
    counts = Counter(map(tuple, rows))
    table = table_of(rows)
    assert len(table) == len(distinct)
    assert [tuple(table[index].tolist()) for index in range(len(table))] == distinct
    assert [distinct[index] for index in table.inverse.tolist()] == list(map(tuple, rows))
    assert table.counts.tolist() == [counts[row] for row in distinct]
    assert table.lengths.tolist() == [len(row) for row in distinct]
    assert table.strings == ["".join(map(chr, row)) for row in distinct]


@given(ROWS, st.sampled_from([1, 130, 600, 1 << 20]))
@example([[number] * number for number in range(9)], 27)
def test_histogram_counts_every_value_block_by_block(rows: list[list[int]], block: int) -> None:
    table = table_of(rows)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("semsig_gis.database.sequences.HISTOGRAM_BLOCK", block)
        histogram = table.histogram
    assert histogram.dtype == np.uint16
    width = max((value + 1 for row in rows for value in row), default=0)
    assert histogram.shape == (len(table), width)
    for index in range(len(table)):
        assert histogram[index].tolist() == np.bincount(table[index], minlength=width).tolist()


@given(ROWS, st.lists(VALUES, max_size=5))
def test_overlap_equals_set_operations(rows: list[list[int]], query: list[int]) -> None:
    table = table_of(rows)
    both, either = table.overlap(sequence(*query))
    sets = [set(table[index].tolist()) for index in range(len(table))]
    assert both.tolist() == [len(values & set(query)) for values in sets]
    assert either.tolist() == [len(values | set(query)) for values in sets]
    some = np.arange(0, len(table), 2)
    assert [part.tolist() for part in table.overlap(sequence(*query), only=some)] == [
        both[some].tolist(),
        either[some].tolist(),
    ]


def test_counts_of_a_very_long_sequence_do_not_wrap() -> None:
    table = table_of([[3] * 70_000, [3]])
    assert table.histogram[:, 3].tolist() == [1, 70_000]


def test_arrays_are_read_only(database: SignatureDatabase, path: Path) -> None:
    of_database = (*ARRAYS, "xy", "lengths", "levels", "present_codes")
    of_table = ("values", "offsets", "inverse", "counts", "lengths", "histogram")
    for owner, names in (
        (database, of_database),
        (open_database(path), of_database),
        (database.signature(0), ("codes",)),
        (table_of([[1, 2], [1]]), of_table),
    ):
        for name in names:
            with pytest.raises(ValueError, match="read-only"):
                getattr(owner, name)[...] = 0


def test_a_table_copies_its_input() -> None:
    values = np.arange(8, dtype=np.uint8)[::2]
    table = SequenceTable.from_csr(values, np.array([0, 2, 4], np.int32))
    values[:] = 9
    assert [table[0].tolist(), table[1].tolist()] == [[0, 2], [4, 6]]


@pytest.mark.parametrize(
    "offsets", [[], [0], [1, 3], [0, 2], [0, 4], [0, 3, 2, 3], [[0, 3]]], ids=str
)
def test_offsets_that_do_not_divide_the_values_are_refused(offsets: list[int]) -> None:
    with pytest.raises(InputError, match="do not divide their 3 values"):
        SequenceTable.from_csr(sequence(1, 2, 3), np.array(offsets, np.int64))


@pytest.mark.parametrize("values", [np.array([1, 300]), np.zeros((2, 2), np.uint8)])
def test_values_that_are_not_sequences_are_refused(values: NDArray[np.uint8]) -> None:
    with pytest.raises(InputError, match="one-dimensional uint8 array"):
        checked_sequence(values)
    with pytest.raises(InputError, match="one-dimensional uint8 array"):
        SequenceTable.from_csr(values, np.array([0, 2]))
