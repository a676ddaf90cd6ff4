semsig.text = (parent, tag, text) => {
  L.DomUtil.create(tag, "", parent).textContent = text;
};
// A signature as it is seen from above: north up, every symbol at its bearing.
semsig.wheel = (size, label, types, bearings) => {
  const figure = L.DomUtil.create("figure", "");
  const drawing = L.SVG.create("svg");
  const draw = (name, values, text) => {
    const part = L.SVG.create(name);
    for (const [key, value] of Object.entries(values)) part.setAttribute(key, value);
    if (text !== undefined) part.textContent = text;
    drawing.append(part);
  };
  const places = bearings.map((degrees) => degrees * Math.PI / 180);
  const at = (angle, radius) => [radius * Math.sin(angle), -radius * Math.cos(angle)];
  const entries = bearings.map(
    (degrees, one) => `${types ? `${types[one]} ` : ""}${degrees}\u00b0`);
  drawing.setAttribute("viewBox", "-58 -68 116 126");
  drawing.setAttribute("role", "img");
  drawing.setAttribute("aria-label", `${label}, clockwise from north: ${entries.join(", ")}`);
  draw("circle", {r: 54, class: "ring"});
  draw("path", {d: "M0,-67L4,-56H-4Z", class: "north"});
  draw("circle", {r: 1.5, class: "north"});
  // Symbols that would lie on one another go nearer to the middle.
  const circles = [];
  for (let radius = 53 - size * 0.8; radius > size; radius -= size) {
    circles.push({radius, taken: []});
  }
  places.forEach((angle, one) => {
    const room = ({radius, taken}) => Math.min(7, ...taken.map((other) => {
      const turn = Math.abs(angle - other) % (2 * Math.PI);
      return Math.min(turn, 2 * Math.PI - turn);
    })) * radius;
    const free = circles.find((circle) => room(circle) >= size)
      || circles.reduce((best, circle) => (room(circle) > room(best) ? circle : best));
    free.taken.push(angle);
    const [[x, y], [outX, outY]] = [at(angle, free.radius + (types ? size / 2 : 0)), at(angle, 54)];
    draw("line", {x1: x, y1: y, x2: outX, y2: outY, class: "ray"});
    const [left, top] = at(angle, free.radius);
    if (types) draw("text", {x: left, y: top, dy: "0.35em", "font-size": size}, types[one]);
    else draw("circle", {cx: left, cy: top, r: 3, class: "north"});
  });
  figure.append(drawing);
  semsig.text(figure, "figcaption", label);
  return figure;
};
semsig.details = (name, fields, values, titles) => {
  const box = L.DomUtil.create("div", "semsig-details");
  semsig.text(box, "b", name);
  let table = L.DomUtil.create("table", "", box);
  const row = (label) => {
    const line = L.DomUtil.create("tr", "", table);
    semsig.text(line, "th", label);
    return L.DomUtil.create("td", "", line);
  };
  const fact = (label, value) => {
    L.DomUtil.create("span", "semsig-fact", row(label)).textContent = value;
  };
  const facts = fields.map((label, at) => [label, values[at]]).filter((one) => one[1] !== null);
  for (const [label, value] of facts) if (!Array.isArray(value)) fact(label, value);
  // Signatures come last, as they are long.
  const signatures = facts.filter((one) => Array.isArray(one[1]));
  const seen = signatures.filter(([, [, bearings]]) => bearings?.length);
  if (seen.length) {
    // The letters have 9 pixels and more: there is room for three wheels, or for two of many.
    const large = seen.length === 1 || seen.some(([, [, bearings]]) => bearings.length > 24);
    const wheels = L.DomUtil.create("div", `semsig-wheels ${large ? "large" : "small"}`, box);
    wheels.append(...seen.map(([label, value]) => semsig.wheel(large ? 7.5 : 11, label, ...value)));
  }
  table = L.DomUtil.create("table", "", box);
  const symbols = new Set();
  for (const [label, [types, bearings]] of signatures) {
    const cell = row(label);
    const places = (bearings || []).map((degrees) => `${degrees}\u00b0`);
    if (types !== null) {
      semsig.text(cell, "code", types);
      for (const symbol of types) symbols.add(symbol);
    }
    const pairs = places.map((place, at) => (types ? `${types[at]}\u00a0${place}` : place));
    semsig.text(cell, "div", pairs.join(" "));
  }
  if (symbols.size) {
    const known = [...symbols].sort().map(
      (symbol) => `${symbol} ${titles[symbol] || "any class"}`);
    fact("Classes", known.join(", "));
  }
  return box;
};
