semsig.text = (parent, tag, text) => {
  const part = L.DomUtil.create(tag, "", parent);
  part.textContent = text;
  return part;
};
// Whether the last input came from the keyboard, not from a mouse or a finger.
semsig.keyed = false;
for (const kind of ["keydown", "pointerdown"]) {
  document.addEventListener(kind, () => { semsig.keyed = kind === "keydown"; }, true);
}
// The panel of a map, at its right side or, on a narrow screen, below it. A closed panel stays in
// the page as an empty element, so that screen readers read its new content.
semsig.panel = (map) => {
  if (map.semsigPanel) return map.semsigPanel;
  const container = map.getContainer();
  const panel = L.DomUtil.create("section", "semsig-panel", container);
  for (const [name, value] of Object.entries(
    {role: "region", "aria-label": "About this place", "aria-live": "polite",
      tabindex: "-1"})) panel.setAttribute(name, value);
  L.DomEvent.disableClickPropagation(panel);
  // Leaflet looks up the parents of a clicked button, which may be removed by then.
  L.DomEvent.on(panel, "click", L.DomEvent.stopPropagation);
  L.DomEvent.disableScrollPropagation(panel);
  L.DomEvent.on(container, "keydown", (event) => {
    if (event.key === "Escape" && !event.target.matches("input")) semsig.hide(map);
  });
  map.semsigPanel = {panel, selection: null};
  map.on("resize", () => semsig.uncover(map));
  return map.semsigPanel;
};
semsig.panelHead = (map, panel, title) => {
  const head = L.DomUtil.create("div", "semsig-panel-head");
  head.append(title);
  const what = "Copy latitude and longitude (C)";
  semsig.mapButton(head, "semsig-copy", "", what, () => semsig.copy(map))
    .append(semsig.icon("M7 7h10v10h-10zM4 13h-1v-10h10v1"));
  semsig.mapButton(head, "semsig-hide", "", "Close", () => semsig.hide(map));
  // A swipe closes the panel: down if it is below the map, else to the right.
  let from = null;
  const moved = (event) => Math.max(0, semsig.isSheet(map, panel)
    ? event.clientY - from.clientY : event.clientX - from.clientX);
  L.DomEvent.on(head, "pointerdown", (event) => {
    if (event.target.closest("button")) return;
    from = event;
    head.setPointerCapture(event.pointerId);
  });
  L.DomEvent.on(head, "pointermove", (event) => {
    if (from === null) return;
    const axis = semsig.isSheet(map, panel) ? "Y" : "X";
    panel.style.transform = `translate${axis}(${moved(event)}px)`;
  });
  L.DomEvent.on(head, "pointerup pointercancel", (event) => {
    if (from === null) return;
    const far = moved(event) > 60;
    from = null;
    panel.style.transform = "";
    if (far) semsig.hide(map);
  });
  return head;
};
semsig.isSheet = (map, panel) => panel.offsetWidth >= map.getSize().x;
// Moves the map so that the selected object is not covered by the panel nor, if there is room, by
// the other boxes.
semsig.uncover = (map) => {
  const {panel, selection} = map.semsigPanel;
  if (selection === null) return;
  const size = map.getSize();
  const low = L.point(10, 10);
  const high = size.subtract([10, 10]);
  map.getContainer().style.setProperty("--panel-height", `${panel.offsetHeight}px`);
  if (semsig.isSheet(map, panel)) {
    high.y -= panel.offsetHeight;
    const tops = [...map.getContainer().querySelectorAll(".leaflet-top")];
    const covered = Math.max(...tops.map((box) => box.offsetHeight));
    if (high.y - covered > 150) low.y += covered;
  } else {
    const [left, right] = semsig.margins(map, 300 + panel.offsetWidth);
    low.x = left;
    high.x = size.x - panel.offsetWidth - right;
  }
  const whole = L.bounds([selection.place, ...(selection.corners || [])].map(
    (corner) => map.latLngToContainerPoint(corner)));
  const room = high.subtract(low);
  const middle = map.latLngToContainerPoint(selection.place);
  const {min, max} = ["x", "y"].every((axis) => whole.getSize()[axis] <= room[axis] - 60)
    ? whole : L.bounds([middle]);
  const shift = (axis) => Math.min(0, min[axis] - low[axis] - 30)
    || Math.max(0, max[axis] - high[axis] + 30);
  const offset = L.point(shift("x"), shift("y"));
  const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (offset.x || offset.y) map.panBy(offset, {animate: !still});
};
// Links to a place in public maps and photographs.
semsig.links = (map, {lat, lng}) => {
  const line = L.DomUtil.create("p", "semsig-links");
  line.append("Look there: ");
  for (const [title, address] of map.semsigLinks([lat, lng])) {
    const link = semsig.text(line, "a", title);
    Object.assign(link, {href: address, target: "_blank", rel: "noopener noreferrer"});
    line.append(" ");
  }
  return line;
};
// Opens the panel for a place. `corners` should be in view as well, `drawn` stays on the map while
// the panel is open, and `key` restores the panel from the address.
semsig.show = (map, box, place, {corners, key = null, drawn} = {}) => {
  const state = semsig.panel(map);
  const inside = state.panel.contains(document.activeElement);
  for (const layer of state.selection?.layers ?? []) layer.remove();
  const lights = box.querySelector(".semsig-scenes")?.semsigLights(map);
  const layers = [drawn, lights].filter(Boolean);
  state.selection = {place: L.latLng(place), corners, key, layers};
  for (const layer of layers) layer.addTo(map);
  if (map.semsigLinks && !box.querySelector(".semsig-links")) {
    box.append(semsig.links(map, state.selection.place));
  }
  const title = box.querySelector("h2");
  state.panel.replaceChildren(semsig.panelHead(map, state.panel, title), box);
  map.getContainer().classList.add("semsig-panel-open");
  if (inside || semsig.keyed) state.panel.focus({preventScroll: true});
  semsig.uncover(map);
  map.fire("semsig-panel", {key, place: state.selection.place});
};
semsig.hide = (map) => {
  const state = semsig.panel(map);
  if (state.selection === null) return;
  const inside = state.panel.contains(document.activeElement);
  for (const layer of state.selection.layers) layer.remove();
  state.selection = null;
  state.panel.replaceChildren();
  map.getContainer().classList.remove("semsig-panel-open");
  if (inside) map.getContainer().focus({preventScroll: true});
  map.fire("semsig-panel", {key: null, place: null});
};
// Adds an opener for keys of a kind; it is tried before the openers of other layers.
semsig.addOpener = (kind, open) => {
  const others = semsig.openers[kind];
  semsig.openers[kind] = (map, rest) => open(map, rest) || Boolean(others?.(map, rest));
};
// Adds a handler of clicks on the map. Handlers are tried by rank (objects, cells, places), the
// newest of a rank first, until one returns true.
semsig.answers = (map, rank, answer) => {
  if (!map.semsigAnswers) {
    map.semsigAnswers = [];
    map.on("click", async (event) => {
      for (const entry of [...map.semsigAnswers]) if (await entry.answer(event)) return;
    });
  }
  const entry = {rank, answer};
  map.semsigAnswers.unshift(entry);
  map.semsigAnswers.sort((first, second) => first.rank - second.rank);
  return () => { map.semsigAnswers = map.semsigAnswers.filter((other) => other !== entry); };
};
// A box with the fields of an object. Signatures among the values are drawn: the first next to one
// of the others, or of `others`. `signs` has the signs of classes by symbol and of verdicts.
semsig.details = (name, fields, values, signs, {others, kind} = {}) => {
  const box = L.DomUtil.create("div", "semsig-details");
  semsig.text(box, "h2", name);
  const facts = fields.map((label, at) => [label, values[at]]).filter((fact) => fact[1] !== null);
  const signatures = facts.filter((fact) => Array.isArray(fact[1]));
  const seen = signatures.filter(([, [, bearings]]) => bearings?.length).map(
    ([label, signature]) => ({label, signature}));
  if (seen.length) {
    const [first, ...rest] = seen;
    box.append(semsig.scenes(first, others || rest, signs, kind || first.signature[2]?.kind));
  }
  let table = L.DomUtil.create("table", "", box);
  const row = (label) => {
    const line = L.DomUtil.create("tr", "", table);
    semsig.text(line, "th", label);
    return L.DomUtil.create("td", "", line);
  };
  const fact = (label, value) => {
    L.DomUtil.create("span", "semsig-fact", row(label)).textContent = value;
  };
  for (const [label, value] of facts) if (!Array.isArray(value)) fact(label, value);
  // Signatures come last, as they are long.
  table = L.DomUtil.create("table", "", box);
  for (const [label, [types, bearings, look]] of signatures) {
    const cell = row(label);
    const entries = bearings ? semsig.entries(types, bearings, look, signs.classes)
      : [...types || ""].map((symbol) => (signs.classes?.[symbol] || semsig.anySign).title);
    semsig.text(cell, "span", entries.join(", "));
    if (types !== null) semsig.text(cell, "code", types);
  }
  return box;
};
// Opens the panel for a place without an object or cell.
semsig.showPlace = (map, latlng, name = "A place on the map", facts = []) => {
  const place = [latlng.lat, latlng.lng];
  const area = map.semsigArea;
  const coordinates = semsig.whereabouts(area, place, area && semsig.xy(area, place));
  const rows = [...facts, ...coordinates];
  const mark = L.circleMarker(place, {
    pane: "shadowPane", interactive: false, color: semsig.highlight, weight: 3, fill: false,
    radius: 10,
  });
  const box = semsig.details(name, rows.map((row) => row[0]), rows.map((row) => row[1]), {});
  semsig.show(map, box, place, {
    key: `place:${place.map((part) => part.toFixed(6)).join(",")}`, drawn: mark,
  });
  return true;
};
semsig.addOpener("place", (map, rest) => {
  const place = rest.split(",").map(Number);
  return place.length === 2 && place.every(Number.isFinite)
    && semsig.showPlace(map, L.latLng(place));
});
