"""What a click on a cell tells of its signature, and of the cells that have the same one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis._map_cells import CellFacts, packed_signatures

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase

__all__ = ["group_facts"]

# A search through all cells takes some milliseconds, so that no list of groups is in the page.
SCRIPT = """\
semsig.told.groups = (city, cell) => {
  const types = city.data["now.types"];
  const levels = city.data["now.bearings"];
  const ends = city.data["now.ends"];
  const [from, to] = city.part("now", cell);
  const equal = (values, start) => {
    for (let at = from; at < to; at += 1) {
      if (values[at] !== values[start + at - from]) return false;
    }
    return true;
  };
  const alike = [];
  const twins = [];
  let start = 0;
  for (let other = 0; other < city.count; other += 1) {
    const end = ends[other];
    if (end - start === to - from && equal(types, start)) {
      alike.push(other);
      if (equal(levels, start)) twins.push(other);
    }
    start = end;
  }
  const byDistance = (cells) => cells.filter((other) => other !== cell)
    .map((other) => [city.metres(cell, other), other])
    .sort((one, two) => one[0] - two[0]).map((one) => one[1]);
  const goal = (other, text = "") => [text + city.far(cell, other) + " "
    + ["N", "NE", "E", "SE", "S", "SW", "W", "NW"][city.eighth(cell, other)], other];
  const jumps = (label, cells, sorted) => {
    const at = cells.indexOf(cell);
    const beside = (step) => cells[(at + step + cells.length) % cells.length];
    const number = (value) => value.toLocaleString("en");
    return [
      [label + ": cell " + number(at + 1) + " of " + number(cells.length) + " from the west",
        [["\\u2039 previous", beside(-1)], ["next \\u203a", beside(1)]]],
      ["", sorted.slice(0, 3).map((other) => goal(other))],
      ...sorted.length > 3 ? [["", [goal(sorted[sorted.length - 1], "farthest: ")]]] : [],
    ];
  };
  const told = {
    title: "Cells that look the same",
    rows: [["It sees", city.signature("now", cell)]],
    jumps: [],
    dots: [],
  };
  for (const [label, cells, colour] of [
    ["Same types", alike, "#ffffff"], ["Types and angle levels", twins, "#e69f00"],
  ].slice(0, alike.length)) {
    if (cells.length === 1) {
      told.rows.push([label, "no other cell"]);
    } else {
      const sorted = byDistance(cells);
      told.jumps.push(...jumps(label, cells, sorted));
      told.dots.push(...sorted.slice(0, city.grid.dots).reverse().map((one) => [one, colour]));
    }
  }
  return told;
};
"""
DOTS = 500  # cells of a group that are drawn, the nearest ones


def group_facts(database: SignatureDatabase) -> CellFacts:
    """Return the signatures of the cells, by which those that look the same are found."""
    return CellFacts(
        name="groups",
        script=SCRIPT,
        arrays=packed_signatures("now", database, database.levels, database.offsets[1:]),
        settings={"turn": database.spec.levels, "dots": DOTS},
    )
