"""What a click on a cell tells of a query from there: its chances, and what it is taken for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.maps.cell_layer import CellFacts
from semsig_gis.maps.packing import packed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.evaluation.identify.result import Identifiability

CHANCES = 100  # steps of a chance in a byte
LEAST = 0.01  # chance of a place that is named; the others are many, and make a page large
BITS = 8  # steps of a bit
HELPERS = 2  # classes that are named

SCRIPT = """\
semsig.told.lookalikes = (city, cell) => {
  const {data, grid} = city;
  const percent = (steps) => {
    const value = 100 * steps / grid.chances;
    return value < 1 ? "below 1 %" : value > 99 ? "above 99 %" : Math.round(value) + " %";
  };
  const bits = data.bits[cell] / grid.bits;
  const like = Number((2 ** bits).toPrecision(2));
  const rows = [
    ["Found within " + grid.radius + " m", percent(data.found[cell])],
    ["Chance given", percent(data.itself[cell]) + " to this cell, " + percent(data.near[cell])
      + " to all within " + grid.radius + " m"],
    ["Looks like", "about " + like.toLocaleString("en") + (like === 1 ? " cell (" : " cells (")
      + bits.toFixed(1) + " bits are left)"],
  ];
  const marks = [];
  for (let at = cell * grid.places; at < (cell + 1) * grid.places; at += 1) {
    const other = data.lookalikes[at];
    if (other < 0) continue;
    marks.push(other);
    const types = city.types("now", other);
    const towards = ["north", "north-east", "east", "south-east", "south", "south-west", "west",
      "north-west"][city.eighth(cell, other)];
    rows.push(["Taken for " + marks.length, percent(data.lookalikeChances[at]) + ": "
      + city.far(cell, other) + " to the " + towards
      + ", sees " + (types.length > 16 ? types.slice(0, 16) + "\\u2026" : types)]);
  }
  const helpers = [];
  for (let at = cell * grid.helpers; at < (cell + 1) * grid.helpers; at += 1) {
    const gain = 100 * data.gains[at] / grid.chances;
    if (gain >= 1) helpers.push(grid.classes[data.helpers[at]] + " +" + Math.round(gain) + " %");
  }
  if (helpers.length) rows.push(["Helped by", helpers.join(", ")]);
  return {title: "A query from here", rows, marks};
};
"""


def lookalike_facts(told: Identifiability) -> CellFacts:
    """Return what is known of a query from each cell, beside the signatures of the cells."""
    # The classes that a cell gains most by, best first.
    count = min(HELPERS, told.gains.shape[1])
    helpers = np.argsort(-told.gains, axis=1, kind="stable")[:, :count]
    titles = {item.code: item.title for item in told.database.taxonomy.classes}
    likely = told.lookalike_chances >= LEAST
    return CellFacts(
        name="lookalikes",
        script=SCRIPT,
        arrays={
            "found": _chance_bytes(told.found),
            "near": _chance_bytes(told.near),
            "itself": _chance_bytes(told.itself),
            "bits": packed(np.rint(told.bits * BITS).clip(0, 255).astype(np.uint8)),
            "lookalikes": packed(np.where(likely, told.lookalikes, -1).astype(np.int32)),
            "lookalikeChances": _chance_bytes(np.where(likely, told.lookalike_chances, 0.0)),
            "helpers": packed(helpers.astype(np.uint8)),
            "gains": _chance_bytes(np.take_along_axis(told.gains, helpers, axis=1)),
        },
        settings={
            "radius": told.radius,
            "places": told.lookalikes.shape[1],
            "helpers": count,
            "chances": CHANCES,
            "bits": BITS,
            "classes": [titles[item.code] for item in told.classes],
        },
    )


def _chance_bytes(chances: NDArray[np.float64]) -> list[str]:
    return packed(np.rint(chances * CHANCES).clip(0, CHANCES).astype(np.uint8))
