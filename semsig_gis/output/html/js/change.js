semsig.cellFacts.change = (city, cell) => {
  const kind = city.grid.kinds[city.data.kind[cell] - 1];
  const [before, after] = ["before", "now"].map((part) => city.signature(part, cell));
  const title = {same: "A cell that sees what it saw", changed: "A cell that sees something else",
    appeared: "A new cell: it saw nothing", vanished: "A cell that no longer sees anything"}[kind];
  if (kind === "same") return {title, rows: [["It sees", before]]};
  const count = {};
  for (const symbol of after[0]) count[symbol] = (count[symbol] || 0) + 1;
  for (const symbol of before[0]) count[symbol] = (count[symbol] || 0) - 1;
  const differences = Object.entries(count).filter((entry) => entry[1] !== 0).map(
    ([symbol, more]) => `${more > 0 ? "+" : "\u2212"}${Math.abs(more)}\u00a0${
      city.signs.classes[symbol].title.toLowerCase()}`);
  const shown = (signature) => (signature[0] ? signature : "nothing");
  return {title, kind: "dates", rows: [
    ["Before", shown(before)],
    ["Now", shown(after)],
    ["Difference", differences.join(", ") || "only in bearings or distances"],
  ]};
};
