semsig.text = (parent, tag, text) => {
  L.DomUtil.create(tag, "", parent).textContent = text;
};
// A signature as it is seen from above: north up, every symbol at its bearing. A view has a look:
// metres to each object, null where unknown, the reach of the ring in metres, the sectors that were
// looked at, and the objects outside them.
semsig.wheel = (size, label, types, bearings, look = {}) => {
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
  const entries = semsig.entries(types, bearings, look).join(", ").replaceAll("\u00a0", " ");
  drawing.setAttribute("viewBox", "-58 -68 116 126");
  drawing.setAttribute("role", "img");
  drawing.setAttribute("aria-label", `${label}, clockwise from north: ${entries}`);
  for (const [from, to] of look.sectors || []) {
    const [[x, y], [endX, endY]] = [at(from * Math.PI / 180, 54), at(to * Math.PI / 180, 54)];
    const large = to - from > 180 ? 1 : 0;
    draw("path", {d: `M0,0L${x},${y}A54,54 0 ${large} 1 ${endX},${endY}Z`, class: "looked"});
  }
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
    // Where it is known how far away they are, they stand about as far out.
    const metres = look.metres?.[one] ?? null;
    const out = metres === null ? 54 : Math.min(1, metres / look.reach) * circles[0].radius;
    const nearest = [...circles].sort(
      (a, b) => Math.abs(a.radius - out) - Math.abs(b.radius - out));
    const free = nearest.find((circle) => room(circle) >= size)
      || circles.reduce((best, circle) => (room(circle) > room(best) ? circle : best));
    free.taken.push(angle);
    const pale = look.outside?.includes(one) ? " pale" : "";
    const [[x, y], [outX, outY]] = [at(angle, free.radius + (types ? size / 2 : 0)), at(angle, 54)];
    if (metres === null) draw("line", {x1: x, y1: y, x2: outX, y2: outY, class: `ray${pale}`});
    const [left, top] = at(angle, free.radius);
    if (types) {
      draw("text", {x: left, y: top, dy: "0.35em", "font-size": size, class: pale}, types[one]);
    } else draw("circle", {cx: left, cy: top, r: 3, class: `north${pale}`});
  });
  figure.append(drawing);
  semsig.text(figure, "figcaption", look.metres ? `${label}, to ${look.reach} m` : label);
  return figure;
};
// What is told of each object of a signature.
semsig.entries = (types, bearings, look = {}) => bearings.map((degrees, one) => {
  const metres = look.metres?.[one] ?? null;
  const far = metres === null ? "" : `\u00a0${metres}\u00a0m`;
  const outside = look.outside?.includes(one) ? "\u00a0(outside)" : "";
  return `${types ? `${types[one]}\u00a0` : ""}${degrees}\u00b0${far}${outside}`;
});
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
  for (const [label, [types, bearings, look]] of signatures) {
    const cell = row(label);
    if (types !== null) {
      semsig.text(cell, "code", types);
      for (const symbol of types) symbols.add(symbol);
    }
    const entries = semsig.entries(types, bearings || [], look);
    semsig.text(cell, "div", entries.join(look?.metres || look?.outside?.length ? ", " : " "));
  }
  if (symbols.size) {
    const known = [...symbols].sort().map(
      (symbol) => `${symbol} ${titles[symbol] || "any class"}`);
    fact("Classes", known.join(", "));
  }
  return box;
};
