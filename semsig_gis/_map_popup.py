"""The script that makes popups: what is known of a place, and signatures as small wheels."""

from __future__ import annotations

__all__ = ["SCRIPT"]

# Popups are made when they are opened, from text nodes only: nothing in them is read as HTML.
SCRIPT = r"""
semsig.text = (parent, tag, text) => {
  L.DomUtil.create(tag, "", parent).textContent = text;
};
// A signature as it is seen from above: north up, every symbol at its bearing.
semsig.wheel = (label, types, bearings) => {
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
  const told = bearings.map((degrees, one) => (types ? types[one] + " " : "") + degrees + "\u00b0");
  drawing.setAttribute("viewBox", "-58 -68 116 126");
  drawing.setAttribute("role", "img");
  drawing.setAttribute("aria-label", label + ", clockwise from north: " + told.join(", "));
  draw("circle", {r: 54, class: "ring"});
  draw("path", {d: "M0,-67L4,-56H-4Z", class: "north"});
  draw("circle", {r: 1.5, class: "north"});
  // Symbols that would lie on one another go nearer to the middle.
  const size = bearings.length > 16 ? 8 : 11;
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
  const signatures = fields.map((label, at) => [label, values[at]]).filter(
    ([, value]) => Array.isArray(value) && value[1] !== null && value[1].length);
  if (signatures.length) {
    const wheels = L.DomUtil.create("div", "semsig-wheels", box);
    for (const [label, value] of signatures) wheels.append(semsig.wheel(label, ...value));
  }
  const table = L.DomUtil.create("table", "", box);
  const row = (label) => {
    const line = L.DomUtil.create("tr", "", table);
    semsig.text(line, "th", label);
    return L.DomUtil.create("td", "", line);
  };
  const symbols = new Set();
  fields.forEach((label, number) => {
    const value = values[number];
    if (value === null) return;
    const cell = row(label);
    if (!Array.isArray(value)) {
      cell.textContent = value;
      return;
    }
    const [types, bearings] = value;
    const places = (bearings || []).map((degrees) => degrees + "\u00b0");
    if (types !== null) {
      semsig.text(cell, "code", types);
      for (const symbol of types) symbols.add(symbol);
    }
    const pairs = places.map((place, at) => (types ? types[at] + "\u00a0" + place : place));
    semsig.text(cell, "div", pairs.join(" "));
  });
  if (symbols.size) {
    const known = [...symbols].sort().map(
      (symbol) => symbol + " " + (titles[symbol] || "any class"));
    row("Classes").textContent = known.join(", ");
  }
  return box;
};
"""
