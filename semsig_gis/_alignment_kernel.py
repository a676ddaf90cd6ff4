"""The loop of the re-ranking, as machine code; it has a slow, obvious twin in the tests."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.compiling import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["align"]

_REACH = 4.5  # deviations beyond which a detection is not taken for an object
_WIDE = 45.0  # deviation in degrees from which on the tails meet behind the observer
_ROUNDS = 30
_SETTLED = 1e-2  # relative change at which the messages are taken for settled
_LARGE = 1e200
_TURN = 360.0


@compiled
def align(  # noqa: C901, PLR0912, PLR0915, PLR0917 - one pass over the cells; a kernel takes no keywords
    cells: NDArray[np.int64],
    offsets: NDArray[np.int64],
    codes: NDArray[np.uint8],
    bearing_units: NDArray[np.uint16],
    distance_units: NDArray[np.uint8],
    row_of: NDArray[np.int64],
    unit: float,
    kinds: NDArray[np.int64],
    seen: NDArray[np.float64],
    turns: NDArray[np.float64],
    odds: NDArray[np.float64],
    naming: NDArray[np.float64],
    sigma: NDArray[np.float64],
    found: NDArray[np.float64],
) -> None:
    """Sum over the one-to-one associations of a query with each of some cells.

    Fills `found`, shape (models, cells, turns), with logarithms; the empty association counts as
    one. The query has class rows `kinds` and bearings `seen` in degrees, and is turned by `turns`
    degrees, shape (cells, turns). `unit` is the degrees in a unit of bearing, and `row_of`, shape
    (256,), the row of each class code in the tables.

    Tables are by model, signature length (0 to longest) and class: `odds` of detection over a miss,
    and `naming`, with a fourth axis of k + 1 names, the chance of each name over the density of
    such clutter. `sigma`, shape (models, k, 256), is the deviation of a bearing in degrees by
    distance.
    """
    models, longest = odds.shape[0], odds.shape[1] - 1
    size = len(kinds)
    most = 0
    for cell in cells:
        most = max(most, offsets[cell + 1] - offsets[cell])
    pairs = most * size
    left = np.empty(pairs, np.int64)
    right = np.empty(pairs, np.int64)
    weight = np.empty(pairs)
    forth = np.empty(pairs)  # messages from the objects of the cell to those of the query
    back = np.empty(pairs)
    at_left = np.empty(most)
    at_right = np.empty(size)
    for number in range(len(cells)):
        low = offsets[cells[number]]
        count = offsets[cells[number] + 1] - low
        length = min(count, longest)
        for way in range(turns.shape[1]):
            turn = turns[number, way]
            for model in range(models):
                edges = 0
                for one in range(count):
                    kind = row_of[codes[low + one]]
                    spread = sigma[model, kind, distance_units[low + one]]
                    factor = odds[model, length, kind] / (spread * math.sqrt(2.0 * math.pi))
                    reach = min(_REACH * spread, 180.0)
                    shift = turn - (bearing_units[low + one] + 0.5) * unit
                    for other in range(size):
                        away = seen[other] + shift
                        away -= _TURN * math.floor(away / _TURN + 0.5)
                        if abs(away) > reach:
                            continue
                        density = math.exp(-0.5 * (away / spread) ** 2)
                        if spread > _WIDE:
                            for lap in range(1, 4):
                                density += math.exp(-0.5 * ((away + _TURN * lap) / spread) ** 2)
                                density += math.exp(-0.5 * ((away - _TURN * lap) / spread) ** 2)
                        left[edges] = one
                        right[edges] = other
                        weight[edges] = factor * density * naming[model, length, kind, kinds[other]]
                        back[edges] = 1.0
                        edges += 1
                # Belief propagation; what is settled is the Bethe approximation of the sum.
                for _ in range(_ROUNDS):
                    at_left[:count] = 1.0
                    for edge in range(edges):
                        at_left[left[edge]] += weight[edge] * back[edge]
                    at_right[:] = 1.0
                    for edge in range(edges):
                        rest = at_left[left[edge]] - weight[edge] * back[edge]
                        forth[edge] = weight[edge] / max(rest, 1.0)
                        at_right[right[edge]] += forth[edge]
                    change = 0.0
                    for edge in range(edges):
                        new = 1.0 / max(at_right[right[edge]] - forth[edge], 1.0)
                        change = max(change, abs(new - back[edge]) / new)
                        back[edge] = new
                    if change < _SETTLED:
                        break
                at_left[:count] = 1.0
                for edge in range(edges):
                    at_left[left[edge]] += weight[edge] * back[edge]
                total = 0.0
                product = 1.0
                for one in range(count):
                    product *= at_left[one]
                    if product > _LARGE:
                        total += math.log(product)
                        product = 1.0
                for other in range(size):
                    product *= at_right[other]
                    if product > _LARGE:
                        total += math.log(product)
                        product = 1.0
                for edge in range(edges):
                    product /= 1.0 + forth[edge] * back[edge]
                    if product < 1.0 / _LARGE:
                        total += math.log(product)
                        product = 1.0
                found[model, number, way] = total + math.log(product)
