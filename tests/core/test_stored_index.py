from __future__ import annotations

import gc
import math
import pickle
import sys
import tempfile
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence

from semsig_gis.core import rtree as stored_index
from semsig_gis.core.errors import InputError
from semsig_gis.core.rtree import INDEX_FILES, ObjectIndex, StoredIndex

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Places = NDArray[np.float64]

# Quarters of a metre, so that places repeat and lie at exactly the radius.
QUARTERS = st.integers(-60, 60).map(lambda number: number / 4)
PLACES = st.lists(st.tuples(QUARTERS, QUARTERS), max_size=30)
CORNERS = st.sampled_from([(0.0, 0.0), (765_200.0, 6_275_000.0), (-5e6, 1e7)])


def pairs(index: StoredIndex | ObjectIndex, radius: float, xy: Places) -> list[list[int]]:
    viewpoint, point = index.pairs_within(xy, radius=radius)
    assert viewpoint.dtype == point.dtype == np.int64
    assert (np.diff(viewpoint) >= 0).all()
    return sorted(np.stack([viewpoint, point], axis=1).tolist())


def shifted(places: list[tuple[float, float]], corner: tuple[float, float]) -> Places:
    moved: Places = np.array(places, float).reshape(-1, 2) + np.array(corner)
    return moved


@pytest.fixture
def town() -> Places:
    places = np.random.default_rng(3).uniform(0, 500, (400, 2))
    return shifted(places.tolist(), (765_200.3, 6_275_000.7))


@given(PLACES, CORNERS, st.integers(1, 80).map(lambda n: n / 4), st.data())
def test_after_any_edits_it_answers_as_a_fresh_one(
    start: list[tuple[float, float]],
    corner: tuple[float, float],
    radius: float,
    data: st.DataObject,
) -> None:
    xy = shifted([(0.0, 0.0), *start], corner)
    index = StoredIndex.pack(xy)
    for _ in range(data.draw(st.integers(0, 3), "rounds")):
        kept = np.array(data.draw(st.permutations(range(len(xy)))), np.int64)
        kept = kept[: data.draw(st.integers(0, len(xy)))]
        new = shifted([(1.0, 1.0), *data.draw(PLACES)], corner)
        shuffled = np.random.default_rng(len(new)).permutation(len(kept) + len(new))
        rows = np.concatenate([kept, np.full(len(new), -1)])[shuffled]
        old, xy = xy, np.concatenate([xy[kept], new])[shuffled]
        before = index
        index = index.edited(xy, rows)
        assert pairs(before, radius, old) == pairs(ObjectIndex(old), radius, old)
        assert pairs(index, radius, xy) == pairs(ObjectIndex(xy), radius, xy)
    with tempfile.TemporaryDirectory() as folder:
        index.save(folder)
        again = StoredIndex.open(folder, xy)
        assert len(again) == len(xy)
        for one in (index, again):
            assert pairs(one, radius, xy) == pairs(ObjectIndex(xy), radius, xy)


def test_many_edits_are_packed_anew(town: Places, monkeypatch: pytest.MonkeyPatch) -> None:
    index = StoredIndex.pack(town)
    moved = town.copy()
    moved[:90] += 1.0
    kept = np.where(np.arange(len(town)) < 90, -1, np.arange(len(town)))
    one = index.edited(moved, kept)
    monkeypatch.setattr(stored_index, "FEW_EDITS", 100)
    monkeypatch.setattr(StoredIndex, "open", None)
    packed = index.edited(moved, kept)
    for radius in (5.0, 60.0):
        assert pairs(one, radius, town) == pairs(packed, radius, town)
    assert (packed._numbers == np.arange(len(town))).all()
    assert (one._numbers == np.arange(len(town))).all()  # the free ones are taken again


def test_numbers_do_not_grow_with_the_edits(town: Places) -> None:
    index = StoredIndex.pack(town)
    for _ in range(5):
        kept = np.concatenate([np.arange(20, len(town)), np.full(20, -1)])
        town = np.concatenate([town[20:], town[:20] + 3.0])
        index = index.edited(town, kept)
    assert sorted(index._numbers.tolist()) == list(range(len(town)))
    assert pairs(index, 30.0, town) == pairs(ObjectIndex(town), 30.0, town)


def test_reading_does_not_change_the_files(town: Places, tmp_path: Path) -> None:
    StoredIndex.pack(town).save(tmp_path)
    before = {name: (tmp_path / name).read_bytes() for name in INDEX_FILES}
    times = {name: (tmp_path / name).stat().st_mtime_ns for name in INDEX_FILES}
    tmp_path.chmod(0o555)
    try:
        first, second = StoredIndex.open(tmp_path, town), StoredIndex.open(tmp_path, town)
        assert pairs(first, 9.0, town) == pairs(second, 9.0, town)
        edited = first.edited(town[1:], np.arange(1, len(town)))
        del first, second, edited
    finally:
        tmp_path.chmod(0o755)
    assert {name: (tmp_path / name).read_bytes() for name in INDEX_FILES} == before
    assert {name: (tmp_path / name).stat().st_mtime_ns for name in INDEX_FILES} == times
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(INDEX_FILES)


def test_nothing_is_left_behind(
    town: Places, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    index = StoredIndex.pack(town)
    other = index.edited(town[:50], np.arange(50))
    assert len(list(tmp_path.iterdir())) == 2
    del index, other
    assert list(tmp_path.iterdir()) == []


def test_it_cannot_be_pickled(town: Places) -> None:
    with pytest.raises(InputError) as caught:
        pickle.dumps(StoredIndex.pack(town))
    assert_sentence(caught.value, "pickled", "open it")


@pytest.mark.parametrize("xy", [np.empty((0, 2)), np.array([[0.0, math.nan]])])
def test_nothing_to_index_is_an_error(xy: Places) -> None:
    with pytest.raises(InputError) as caught:
        StoredIndex.pack(xy)
    assert_sentence(caught.value, "at least one point", "finite")


def test_files_that_cannot_be_used_are_told(town: Places, tmp_path: Path) -> None:
    with pytest.raises(InputError) as missing:
        StoredIndex.open(tmp_path, town)
    assert_sentence(missing.value, "no R-tree")
    StoredIndex.pack(town).save(tmp_path)
    with pytest.raises(InputError) as other:
        StoredIndex.open(tmp_path, town[1:])
    assert_sentence(other.value, "over 400 points, not 399")
    # The library opens half a tree without a word.
    with (tmp_path / "rtree.dat").open("r+b") as file:
        file.truncate(1024)
    with pytest.raises(InputError) as half:
        StoredIndex.open(tmp_path, town)
    assert_sentence(half.value, "no R-tree can be made")
    StoredIndex.pack(town[:50]).save(tmp_path)
    np.save(tmp_path / "rtree.npy", np.arange(len(town)))
    with pytest.raises(InputError) as fewer:
        StoredIndex.open(tmp_path, town)
    assert_sentence(fewer.value, "R-tree over 400 points came out with 50")
    (tmp_path / "rtree.dat").unlink()
    with pytest.raises(InputError) as gone:
        StoredIndex.open(tmp_path, town)
    assert_sentence(gone.value, "no R-tree can be made", "No such file")


def test_no_temporary_folder_is_told(
    town: Places, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    with pytest.raises(InputError) as caught:
        StoredIndex.pack(town)
    assert_sentence(caught.value, "temporary folder", "TMPDIR")


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of file sizes there")
def test_a_full_disk_is_told(town: Places, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import resource

    index = StoredIndex.pack(town)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    more = np.concatenate([town, town + 1.0])
    kept = np.concatenate([np.arange(len(town)), np.full(len(town), -1)])
    size = (index._folder / "rtree.dat").stat().st_size
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    failures = []
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        for attempt in ("pack", "edit"):
            with pytest.raises(InputError) as caught:
                StoredIndex.pack(more) if attempt == "pack" else index.edited(more, kept)
            failures.append(caught.value)
            gc.collect()  # a tree that could not be written would end the program here
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    for failure in failures:
        assert_sentence(failure, "no R-tree can be made", "make room")
    assert list(tmp_path.iterdir()) == []
    assert pairs(index, 9.0, town) == pairs(ObjectIndex(town), 9.0, town)
