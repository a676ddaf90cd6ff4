"""R-trees over street objects: which of them lie near a viewpoint.

Two trees with one question: `ObjectIndex` (libspatialindex) for some places, `PackedIndex` (GEOS)
for very many; it answers for boxes too.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np
import shapely
from rtree import index as rtree_index
from rtree.exceptions import RTreeError

from semsig_gis.core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

# More than the distance between neighbouring floats anywhere on Earth.
ROUNDING_M = 1e-6


class _Index:
    """A tree of libspatialindex over points; `_rows` are those of its numbers."""

    _tree: rtree_index.Index
    _xy: NDArray[np.float64]
    _rows: NDArray[np.int64]

    def pairs_within(
        self, viewpoints: NDArray[np.float64], *, radius: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the rows of viewpoint and point of every pair within a radius, by viewpoint.

        Viewpoints, shape (v, 2), and radius are in metres; a point at exactly the radius counts.
        """
        places = np.ascontiguousarray(viewpoints, dtype=np.float64)
        reach = _a_touch_more(radius)
        found, counts = self._tree.intersection_v(places - reach, places + reach)
        point = self._rows[found.astype(np.int64)]
        viewpoint = np.repeat(np.arange(len(places)), counts.astype(np.int64))
        return _near(viewpoint, point, places, self._xy, radius)


class ObjectIndex(_Index):
    """An R-tree over points in metres, shape (n, 2).

    InputError if there is no point, or one is not finite. The tree is packed in one go and asked
    for many boxes at once. It belongs to the process and thread that made it.
    """

    def __init__(self, xy: NDArray[np.float64]) -> None:
        self._xy = checked_points(xy)
        self._rows = np.arange(len(self._xy))
        self._tree = rtree_index.Index((self._rows, self._xy, self._xy))

    def __reduce__(self) -> str | tuple[object, ...]:  # noqa: D105
        return (type(self), (self._xy,))


class PackedIndex:
    """An R-tree over points that is packed once and asked by very many viewpoints.

    Positions are in metres, shape (n, 2); `points` are the same as shapely points, where they are
    made already. InputError if there is none, or one is not finite.
    """

    def __init__(self, xy: NDArray[np.float64], points: NDArray[np.object_] | None = None) -> None:
        self._xy = checked_points(xy)
        if points is None:
            points = np.asarray(shapely.points(self._xy))
        self._tree = shapely.STRtree(points)

    def pairs_within(
        self, viewpoints: NDArray[np.float64], *, radius: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return all pairs within a radius, as `ObjectIndex.pairs_within` does."""
        places = np.ascontiguousarray(viewpoints, dtype=np.float64)
        viewpoint, point = self._tree.query(
            shapely.points(places), predicate="dwithin", distance=_a_touch_more(radius)
        )
        return _near(viewpoint, point, places, self._xy, radius)

    def pairs_in(
        self, low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the rows of box and point of every point in a box, ordered by box.

        Lower left and upper right corners have shape (b, 2); a point on an edge counts.
        """
        box, point = self._tree.query(shapely.box(*low.T, *high.T))
        return box, point


def checked_points(xy: ArrayLike) -> NDArray[np.float64]:
    """Return a C-ordered copy of points, shape (n, 2); refuse none, or one that is not finite."""
    points = np.array(xy, dtype=np.float64, order="C")  # a copy, as the tree has one too
    if len(points) == 0 or not np.isfinite(points).all():
        msg = "an R-tree needs at least one point, and finite coordinates."
        raise InputError(msg)
    return points


def _a_touch_more(radius: float) -> float:
    """Return a reach that no rounding in a tree makes too small; `_near` decides alone."""
    return radius * (1 + 1e-12) + ROUNDING_M


def _near(
    viewpoint: NDArray[np.int64],
    point: NDArray[np.int64],
    places: NDArray[np.float64],
    xy: NDArray[np.float64],
    radius: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Keep the pairs that are at most so far apart."""
    delta = xy[point] - places[viewpoint]
    near = np.hypot(delta[:, 0], delta[:, 1]) <= radius
    return viewpoint[near], point[near]


NAME = "rtree"
TREE_FILES = (f"{NAME}.dat", f"{NAME}.idx")
NUMBERS_FILE = f"{NAME}.npy"
INDEX_FILES = (*TREE_FILES, NUMBERS_FILE)

# A node that falls below half of this is dissolved, and its points are put in again: with the
# 100 of libspatialindex a deletion takes ten times as long.
NODE_CAPACITY = 32
NODE_FILL = 0.5
PAGE_BYTES = 1024
# An edit takes as long as packing this many points anew.
POINTS_AN_EDIT = 256
# Three times what an edit makes a tree grow by, and what any edit may.
EDIT_BYTES = 256
EDITS_BYTES = 1 << 16
# So few edits are quick in any case.
FEW_EDITS = 1000


class StoredIndex(_Index):
    """An R-tree over points that is kept in files; make one with `pack` or `open`.

    `folder` holds the tree and is removed with this object. `numbers` says under which number each
    point of `xy` (metres, shape (n, 2)) stands in the tree; a point keeps its number when others
    come and go.

    The library writes to the files of a tree even when it only reads from it, and two programs that
    do so at once destroy it. So the tree is worked on in a temporary copy, and `save` alone puts it
    elsewhere. It belongs to the process and thread that opened it, and cannot be pickled.
    """

    def __init__(self, folder: Path, xy: NDArray[np.float64], numbers: NDArray[np.int64]) -> None:
        self._folder = folder
        self._xy = xy
        self._numbers = numbers
        self._rows = np.zeros(int(numbers.max()) + 1, np.int64)
        self._rows[numbers] = np.arange(len(numbers))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._tree = _tree(folder)
        if len(self._tree) != len(xy):  # the library is silent about a full disk, too
            msg = (
                f"an R-tree over {len(xy)} points came out with {len(self._tree)}; make room in "
                f"{folder.parent}, or make the tree again."
            )
            raise InputError(msg)

    def __len__(self) -> int:  # noqa: D105
        return len(self._xy)

    def __reduce__(self) -> NoReturn:  # noqa: D105
        msg = "an R-tree in files cannot be pickled; open it in the process that asks it."
        raise InputError(msg)

    @classmethod
    def pack(cls, xy: ArrayLike) -> StoredIndex:
        """Make a tree of at least one finite point in metres, shape (n, 2), in one go."""
        points = checked_points(xy)
        numbers = np.arange(len(points))
        with _new_folder() as folder:
            packed = _tree(folder, (numbers, points, points))
            packed.close()  # a flush would leave the root out
            return cls(folder, points, numbers)

    @classmethod
    def open(cls, folder: str | Path, xy: ArrayLike) -> StoredIndex:
        """Open a tree that `save` wrote, over the points in the order in which they were saved.

        Whoever keeps the files sees to it that they are whole: the library takes a damaged tree for
        a small one.
        """
        points = checked_points(xy)
        try:
            numbers = np.load(Path(folder, NUMBERS_FILE), allow_pickle=False)
        except (OSError, ValueError) as error:
            msg = f"{folder} holds no R-tree that can be read ({error}); make it again."
            raise InputError(msg) from error
        if numbers.shape != (len(points),):
            msg = f"the R-tree in {folder} is over {numbers.size} points, not {len(points)}."
            raise InputError(msg)
        with _new_folder() as own:
            _copy(Path(folder), own)
            return cls(own, points, numbers)

    def save(self, folder: str | Path) -> None:
        """Write the files of the tree, which are `INDEX_FILES`, to a folder that exists."""
        # Whole since it was opened: edits are made in a copy, and asking writes when it is closed.
        _copy(self._folder, Path(folder))
        np.save(Path(folder, NUMBERS_FILE), self._numbers)

    def edited(self, xy: ArrayLike, kept: NDArray[np.int64]) -> StoredIndex:
        """Return a new tree of other points, some of which are in this one, which stays.

        `xy` holds all points of the new tree, shape (m, 2). `kept`, shape (m,), holds for each the
        row of the same point in this tree, or -1 where it is new; no row stands twice.
        """
        points = checked_points(xy)
        gone = np.ones(len(self), bool)
        gone[kept[kept >= 0]] = False
        new = np.flatnonzero(kept < 0)
        edits = int(gone.sum()) + len(new)
        if edits > FEW_EDITS + len(points) // POINTS_AN_EDIT:
            return self.pack(points)
        numbers = np.where(kept >= 0, self._numbers[kept], -1)
        # The lowest that are free, so that they stay near the number of points.
        free = np.ones(max(len(points), len(self._rows)), bool)
        free[numbers[kept >= 0]] = False
        numbers[new] = np.flatnonzero(free)[: len(new)]
        with _new_folder() as folder:
            _copy(self._folder, folder)
            _require_room(folder, edits)
            tree = _tree(folder)
            for row in np.flatnonzero(gone):
                tree.delete(int(self._numbers[row]), (*self._xy[row], *self._xy[row]))
            for row in new:
                tree.insert(int(numbers[row]), (*points[row], *points[row]))
            tree.close()
            return StoredIndex(folder, points, numbers)


def _tree(
    folder: Path, *arrays: tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]
) -> rtree_index.Index:
    """Open the tree in a folder, or make it from the numbers and positions of points."""
    properties = rtree_index.Property(
        leaf_capacity=NODE_CAPACITY,
        index_capacity=NODE_CAPACITY,
        near_minimum_overlap_factor=NODE_CAPACITY // 2,
        fill_factor=NODE_FILL,
        pagesize=PAGE_BYTES,
    )
    return rtree_index.Index(str(folder / NAME), *arrays, properties=properties)


@contextlib.contextmanager
def _new_folder() -> Iterator[Path]:
    """Give a temporary folder for a tree, which is removed if the tree comes to nothing."""
    try:
        folder = Path(tempfile.mkdtemp(prefix="semsig-rtree-"))
    except OSError as error:
        msg = f"no temporary folder can be made ({error}); make room, or set TMPDIR."
        raise InputError(msg) from error
    try:
        yield folder
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, OSError | RTreeError):
            msg = (
                f"no R-tree can be made in {folder.parent} ({error}); make room there, or set "
                "TMPDIR."
            )
            raise InputError(msg) from error
        raise


def _copy(folder: Path, to: Path) -> None:
    for name in TREE_FILES:
        shutil.copyfile(folder / name, to / name)


def _require_room(folder: Path, edits: int) -> None:
    """Raise where a tree could not grow: the library would end the whole program then."""
    with (folder / TREE_FILES[0]).open("r+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.write(bytes(EDITS_BYTES + edits * EDIT_BYTES))
        file.flush()
        file.truncate(size)
