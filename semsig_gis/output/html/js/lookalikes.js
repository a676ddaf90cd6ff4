semsig.cellFacts.lookalikes = (city, cell) => {
  const {data, grid} = city;
  const percent = (steps) => {
    const value = 100 * steps / grid.chances;
    return value < 1 ? "under 1 %" : value > 99.5 ? "over 99 %" : `${Math.round(value)} %`;
  };
  const bits = data.bits[cell] / grid.bits;
  const like = Number((2 ** bits).toPrecision(2));
  const rows = [
    [`Found within ${grid.radius} m`, percent(data.found[cell])],
    ["Chance given", percent(data.itself[cell]) + " to this cell, " + percent(data.near[cell])
      + " to all within " + grid.radius + " m"],
    ["Looks like", "about " + like.toLocaleString("en") + (like === 1 ? " cell (" : " cells (")
      + bits.toFixed(1) + " bits are left)"],
  ];
  const lookalikes = [];
  for (let at = cell * grid.places; at < (cell + 1) * grid.places; at += 1) {
    const other = data.lookalikes[at];
    const chance = percent(data.lookalikeChances[at]);
    if (other >= 0) lookalikes.push([other, `mistaken for it: ${chance}`]);
  }
  const helpers = [];
  for (let at = cell * grid.helpers; at < (cell + 1) * grid.helpers; at += 1) {
    const gain = 100 * data.gains[at] / grid.chances;
    if (gain >= 1) helpers.push(`${grid.classes[data.helpers[at]]} +${Math.round(gain)} %`);
  }
  if (helpers.length) rows.push(["Helped by", helpers.join(", ")]);
  return {title: "A query from here", rows, lookalikes};
};
