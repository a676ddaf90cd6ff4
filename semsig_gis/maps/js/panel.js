semsig.text = (parent, tag, text) => {
  const part = L.DomUtil.create(tag, "", parent);
  part.textContent = text;
  return part;
};
// Whether the keyboard was used last, and not a mouse or a finger.
semsig.keyed = false;
for (const kind of ["keydown", "pointerdown"]) {
  document.addEventListener(kind, () => { semsig.keyed = kind === "keydown"; }, true);
}
// The panel of a map, beside it or, on a narrow screen, below it. Closed, it stays as an empty
// element, so that what comes into it is read out.
semsig.panel = (map) => {
  if (map.semsigPanel) return map.semsigPanel;
  const container = map.getContainer();
  const panel = L.DomUtil.create("section", "semsig-panel", container);
  for (const [name, value] of Object.entries(
    {role: "region", "aria-label": "About this place", "aria-live": "polite",
      tabindex: "-1"})) panel.setAttribute(name, value);
  L.DomEvent.disableClickPropagation(panel);
  // Leaflet asks what is around a button, which may be gone by then.
  L.DomEvent.on(panel, "click", L.DomEvent.stopPropagation);
  L.DomEvent.disableScrollPropagation(panel);
  L.DomEvent.on(container, "keydown", (event) => {
    if (event.key === "Escape" && !event.target.matches("input")) semsig.hide(map);
  });
  map.semsigPanel = {panel, told: null};
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
  // A swipe: down where the panel is below the map, to the right where it is beside it.
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
// Moves the map so that what is told of is seen beside the panel and, where there is room, beside
// the other boxes.
semsig.uncover = (map) => {
  const {panel, told} = map.semsigPanel;
  if (told === null) return;
  const size = map.getSize();
  const low = L.point(10, 10);
  const high = size.subtract([10, 10]);
  map.getContainer().style.setProperty("--told", `${panel.offsetHeight}px`);
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
  const whole = L.bounds([told.place, ...(told.corners || [])].map(
    (one) => map.latLngToContainerPoint(one)));
  const room = high.subtract(low);
  const middle = map.latLngToContainerPoint(told.place);
  const {min, max} = ["x", "y"].every((axis) => whole.getSize()[axis] <= room[axis] - 60)
    ? whole : L.bounds([middle]);
  const shift = (axis) => Math.min(0, min[axis] - low[axis] - 30)
    || Math.max(0, max[axis] - high[axis] + 30);
  const offset = L.point(shift("x"), shift("y"));
  const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (offset.x || offset.y) map.panBy(offset, {animate: !still});
};
// Tells of a place: `corners` shall be in view, too; `drawn` is on the map meanwhile; by its `key`
// it is told of again.
semsig.show = (map, box, place, {corners, key = null, drawn} = {}) => {
  const held = semsig.panel(map);
  const inside = held.panel.contains(document.activeElement);
  for (const layer of held.told?.layers ?? []) layer.remove();
  const lights = box.querySelector(".semsig-scenes")?.semsigLights(map);
  const layers = [drawn, lights].filter(Boolean);
  held.told = {place: L.latLng(place), corners, key, layers};
  for (const layer of layers) layer.addTo(map);
  const title = box.querySelector("h2");
  held.panel.replaceChildren(semsig.panelHead(map, held.panel, title), box);
  map.getContainer().classList.add("semsig-told");
  if (inside || semsig.keyed) held.panel.focus({preventScroll: true});
  semsig.uncover(map);
  map.fire("semsig-told", {key, place: held.told.place});
};
semsig.hide = (map) => {
  const held = semsig.panel(map);
  if (held.told === null) return;
  const inside = held.panel.contains(document.activeElement);
  for (const layer of held.told.layers) layer.remove();
  held.told = null;
  held.panel.replaceChildren();
  map.getContainer().classList.remove("semsig-told");
  if (inside) map.getContainer().focus({preventScroll: true});
  map.fire("semsig-told", {key: null, place: null});
};
// What tells again of things of a kind, beside what does so already.
semsig.addOpener = (kind, open) => {
  const others = semsig.openers[kind];
  semsig.openers[kind] = (map, rest) => open(map, rest) || Boolean(others?.(map, rest));
};
// Who may answer a click on the map: things, cells, places, by rank, the newest of a rank first.
semsig.answers = (map, rank, answer) => {
  if (!map.semsigAnswers) {
    map.semsigAnswers = [];
    map.on("click", async (event) => {
      for (const one of [...map.semsigAnswers]) if (await one.answer(event)) return;
    });
  }
  const one = {rank, answer};
  map.semsigAnswers.unshift(one);
  map.semsigAnswers.sort((first, second) => first.rank - second.rank);
  return () => { map.semsigAnswers = map.semsigAnswers.filter((other) => other !== one); };
};
// A box that tells of a thing. Signatures among the values are drawn, the first beside one of the
// others, or beside what `others` has; `signs` has the classes by symbol and the verdicts.
semsig.details = (name, fields, values, signs, {others, kind} = {}) => {
  const box = L.DomUtil.create("div", "semsig-details");
  semsig.text(box, "h2", name);
  const facts = fields.map((label, at) => [label, values[at]]).filter((one) => one[1] !== null);
  const signatures = facts.filter((one) => Array.isArray(one[1]));
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
      (symbol) => `${symbol} ${(signs.classes?.[symbol] || semsig.anySign).title}`);
    fact("Classes", known.join(", "));
  }
  return box;
};
// What there is to say where nothing is known.
semsig.tellPlace = (map, latlng, name = "A place on the map", facts = []) => {
  const place = [latlng.lat, latlng.lng];
  const area = map.semsigArea;
  const known = semsig.whereabouts(area, place, area && semsig.xy(area, place));
  const rows = [...facts, ...known];
  const mark = L.circleMarker(place, {
    pane: "shadowPane", interactive: false, color: semsig.pointed, weight: 3, fill: false,
    radius: 10,
  });
  const box = semsig.details(name, rows.map((one) => one[0]), rows.map((one) => one[1]), {});
  semsig.show(map, box, place, {
    key: `place:${place.map((part) => part.toFixed(6)).join(",")}`, drawn: mark,
  });
  return true;
};
semsig.addOpener("place", (map, rest) => {
  const place = rest.split(",").map(Number);
  return place.length === 2 && place.every(Number.isFinite)
    && semsig.tellPlace(map, L.latLng(place));
});
