semsig.cellFacts.groups = (city, cell) => {
  const grid = city.grid;
  const {"now.types": types, "now.levels": levels, "now.ends": ends} = city.data;
  const [from, to] = city.part("now", cell);
  const equal = (values, start) => {
    for (let at = from; at < to; at += 1) {
      if (values[at] !== values[start + at - from]) return false;
    }
    return true;
  };
  const sameTypes = [];
  const sameLevels = [];
  let start = 0;
  for (let other = 0; other < city.count; other += 1) {
    const end = ends[other];
    if (end - start === to - from && equal(types, start)) {
      sameTypes.push(other);
      if (equal(levels, start)) sameLevels.push(other);
    }
    start = end;
  }
  const byDistance = (cells) => cells.filter((other) => other !== cell)
    .map((other) => [city.metres(cell, other), other])
    .sort((first, second) => first[0] - second[0]).map((entry) => entry[1]);
  const jumps = (label, cells) => {
    const at = cells.indexOf(cell);
    const neighbour = (step) => cells[(at + step + cells.length) % cells.length];
    const number = (value) => value.toLocaleString("en");
    return [
      [`${label}: ${number(at + 1)} of ${number(cells.length)}`,
        [["\u2039", neighbour(-1), "previous, from the west"],
          ["\u203a", neighbour(1), "next, from the west"]]],
    ];
  };
  // The nearest cells, and an even sample of the others.
  const drawn = (sorted) => sorted.filter(
    (_, at) => at < grid.near || at % Math.ceil(sorted.length / grid.dots) === 0);
  const facts = {
    title: "Cells that look the same",
    rows: [["It sees", city.signature("now", cell)]],
    jumps: [],
    dots: [],
    lookalikes: [],
    kind: "cells",
  };
  for (const [label, cells, colour] of [
    ["Same types", sameTypes, grid.colours[0]],
    ["Types and angle levels", sameLevels, grid.colours[1]],
  ].slice(0, sameTypes.length)) {
    if (cells.length === 1) {
      facts.rows.push([label, "no other cell"]);
    } else {
      const sorted = byDistance(cells);
      facts.jumps.push(...jumps(label, cells));
      const same = label.toLowerCase();
      facts.lookalikes.unshift(
        [sorted[0], `${same}, the nearest`],
        ...sorted.slice(1).slice(-1).map((other) => [other, `${same}, the farthest`]),
        ...sorted.slice(1, -1).slice(0, 1).map((other) => [other, `${same}, the next`]));
      facts.dots.push(...drawn(sorted).reverse().map((other) => [other, colour]));
    }
  }
  if (facts.lookalikes.length < 3) {
    facts.lookalikes.push(...city.mostSimilar("now", cell, 6).map(
      ([other, count]) => [other, count === 0 ? "the same objects, in another order"
        : count === 1 ? "1 object more or less" : `${count} objects more or less`]));
  }
  return facts;
};
