// Edges of errors for the axis of a histogram, ten to a power of ten (Renard's series), in metres:
// from 0 to beyond the largest.
semsig.errorEdges = (errors) => {
  const finite = errors.filter((error) => Number.isFinite(error) && error > 0);
  const [low, high] = [Math.min, Math.max].map(
    (pick) => finite.reduce((one, other) => pick(one, other), 10));
  const series = [1, 1.25, 1.6, 2, 2.5, 3.15, 4, 5, 6.3, 8];
  const edges = [0];
  for (let power = low < 10 ? 1 : 10; ; power *= 10) {
    for (const part of series) {
      edges.push(Number((part * power).toPrecision(3)));
      if (edges.at(-1) >= high) return errors.includes(Infinity) ? [...edges, Infinity] : edges;
    }
  }
};
semsig.metres = (metres) => {
  if (metres === Infinity) return "not localized";
  return metres < 1000 ? `${metres} m` : `${metres / 1000} km`;
};
// Two sliders on one line, for the least and the most of something.
semsig.rangeSlider = (parent, label, last, textOf, changed) => {
  const line = L.DomUtil.create("div", "semsig-range", parent);
  const told = L.DomUtil.create("span", "semsig-range-told", line);
  const track = L.DomUtil.create("div", "semsig-track", line);
  const sliders = [`${label}, least`, `${label}, most`].map((name, at) => {
    const slider = L.DomUtil.create("input", "", track);
    Object.assign(slider, {type: "range", min: 0, max: last, step: 1, value: at ? last : 0});
    slider.setAttribute("aria-label", name);
    return slider;
  });
  const range = {low: 0, high: last, last};
  const tell = () => {
    sliders.forEach((slider, at) => {
      slider.value = at ? range.high : range.low;
      slider.setAttribute("aria-valuetext", textOf(Number(slider.value), at));
    });
    // At the right end both lie on each other, and the lower one must be free to leave.
    sliders[0].style.zIndex = range.low > last / 2 ? 1 : 0;
    track.style.setProperty("--low", range.low / last);
    track.style.setProperty("--high", range.high / last);
    told.textContent = range.low === 0 && range.high === last
      ? `${label}: any` : `${label}: ${textOf(range.low, 0)} to ${textOf(range.high, 1)}`;
  };
  range.set = (low, high) => {
    [range.low, range.high] = [Math.max(0, Math.min(low, high)), Math.min(last, Math.max(low, high))];
    tell();
  };
  sliders.forEach((slider, at) => {
    L.DomEvent.on(slider, "input", () => {
      const value = Number(slider.value);
      if (at) range.set(Math.min(range.low, value), value);
      else range.set(value, Math.max(range.high, value));
      changed();
    });
  });
  tell();
  return range;
};
// How many queries have which error, on an axis of `edges`: pale all, dark those that are chosen.
semsig.histogram = (parent, edges, outcomes, brushed) => {
  const [width, height, foot] = [270, 70, 16];
  const step = width / (edges.length - 1);
  const drawing = L.SVG.create("svg");
  const draw = (name, values, text) => {
    const part = L.SVG.create(name);
    for (const [key, value] of Object.entries(values)) part.setAttribute(key, value);
    if (text !== undefined) part.textContent = text;
    drawing.append(part);
    return part;
  };
  drawing.setAttribute("viewBox", `0 0 ${width} ${height + foot}`);
  drawing.setAttribute("class", "semsig-histogram");
  drawing.setAttribute("role", "img");
  drawing.setAttribute("aria-label", "Queries by their expected error, on a logarithmic axis");
  const beside = ["semsig-brush", "semsig-brush"].map((kind) =>
    draw("rect", {class: kind, y: 0, height, x: 0, width: 0}));
  const pale = draw("path", {class: "semsig-all"});
  const bars = outcomes.map(({colour}) => draw("path", {fill: colour}));
  draw("path", {d: `M0,${height}H${width}`, class: "semsig-axis"});
  for (const [at, edge] of edges.entries()) {
    if (!(edge > 0 && Number.isInteger(Math.log10(edge)))) continue;
    draw("path", {d: `M${at * step},${height}v4`, class: "semsig-axis"});
    const anchor = at * step > width - 20 ? "end" : at * step < 20 ? "start" : "middle";
    draw("text", {x: at * step, y: height + 14, "text-anchor": anchor}, semsig.metres(edge));
  }
  parent.append(drawing);
  let from = null;
  const edgeAt = (event) => {
    const box = drawing.getBoundingClientRect();
    return Math.min(1, Math.max(0, (event.clientX - box.left) / box.width)) * (edges.length - 1);
  };
  L.DomEvent.on(drawing, "pointerdown", (event) => {
    L.DomEvent.preventDefault(event);
    drawing.setPointerCapture(event.pointerId);
    from = edgeAt(event);
    brushed(Math.floor(from), Math.ceil(from));
  });
  L.DomEvent.on(drawing, "pointermove", (event) => {
    if (from === null) return;
    const to = edgeAt(event);
    brushed(Math.floor(Math.min(from, to)), Math.ceil(Math.max(from, to)));
  });
  L.DomEvent.on(drawing, "pointerup pointercancel", () => { from = null; });
  const pathOf = (counts, below, most) => counts.reduce((path, count, bin) => {
    if (!count) return path;
    // One query among many is seen, too.
    const high = Math.max(1.5, count / most * height);
    const foot = height - below[bin] / most * height;
    return `${path}M${bin * step + 0.5},${foot.toFixed(1)}v${-high.toFixed(1)}h${
      (step - 1).toFixed(2)}v${high.toFixed(1)}z`;
  }, "");
  return (all, chosen, low, high) => {
    const most = Math.max(1, ...all);
    const none = all.map(() => 0);
    pale.setAttribute("d", pathOf(all, none, most));
    let below = none;
    for (const [at, counts] of chosen.entries()) {
      bars[at].setAttribute("d", pathOf(counts, below, most));
      below = below.map((count, bin) => count + counts[bin]);
    }
    beside[0].setAttribute("width", low * step);
    beside[1].setAttribute("x", high * step);
    beside[1].setAttribute("width", width - high * step);
  };
};
// What of the selection a file holds, by the names of its columns.
semsig.queryColumns = ({data, about, placeOf}) => ({
  query: (one) => one + 1,
  outcome: (one) => about.outcomes[data.outcome[one]].name,
  error_m: (one) => (Number.isFinite(data.error[one]) ? data.error[one] : null),
  [about.chance.column]: (one) => data.chance[one] / 100,
  objects_seen: (one) => data.length[one],
  types: (one) => data.types[one],
  query_types: (one) => data.asked[one],
  cell_id: (one) => data.cells[one],
  best_cell_id: (one) => data.bestCells[one],
  longitude: (one) => placeOf(one)[1],
  latitude: (one) => placeOf(one)[0],
});
semsig.files = {
  csv(columns, rows) {
    // No text may be taken for a formula.
    const field = (value) => (typeof value !== "string" ? String(value ?? "")
      : `"${value.replaceAll('"', '""').replace(/^[=+\-@'\t\r]/, "'$&")}"`);
    const lines = rows.map((one) => Object.values(columns).map((of) => field(of(one))).join(","));
    return ["text/csv", [Object.keys(columns).join(","), ...lines, ""].join("\r\n")];
  },
  geojson({longitude, latitude, ...columns}, rows) {
    const features = rows.map((one) => ({
      type: "Feature",
      geometry: {type: "Point", coordinates: [longitude(one), latitude(one)]},
      properties: Object.fromEntries(
        Object.entries(columns).map(([name, of]) => [name, of(one)])),
    }));
    return ["application/geo+json", JSON.stringify({type: "FeatureCollection", features})];
  },
};
// A box to choose which queries are drawn: by outcome, error, objects seen, class and chance.
semsig.filters = async (map, key) => {
  const box = L.DomUtil.create("details", "semsig-filters");
  const told = L.DomUtil.create("summary", "", box);
  told.setAttribute("aria-live", "polite");
  box.open = !semsig.small.matches && !document.querySelector(".semsig-filters[open]");
  L.DomEvent.disableClickPropagation(box);
  L.DomEvent.disableScrollPropagation(box);
  const control = L.control({position: "topright"});
  control.onAdd = () => box;
  control.addTo(map);
  const set = await semsig.held[key].ready;
  const {data, about, layers} = set;
  const {outcomes} = about;
  const number = (value) => value.toLocaleString("en");
  const count = data.outcome.length;
  const edges = semsig.errorEdges([...data.error]);
  const bins = Uint8Array.from(data.error, (error) =>
    Math.max(0, edges.findIndex((edge) => error <= edge) - 1));
  const lengths = Math.max(1, ...data.length);
  const drawn = semsig.histogram(box, edges, outcomes, (low, high) => {
    error.set(low, high);
    changed();
  });
  const error = semsig.rangeSlider(
    box, "Expected error", edges.length - 1, (at) => semsig.metres(edges[at]), () => changed());
  const boxes = outcomes.map(({name, colour, outline}, at) => {
    const label = L.DomUtil.create("label", "", box);
    const input = L.DomUtil.create("input", "", label);
    input.type = "checkbox";
    const sign = L.SVG.create("svg");
    sign.setAttribute("viewBox", "-1.5 -1.5 3 3");
    sign.setAttribute("class", "semsig-sign");
    sign.setAttribute("aria-hidden", "true");
    const path = L.SVG.create("path");
    path.setAttribute("d", outline);
    path.setAttribute("fill", colour);
    sign.append(path);
    label.append(sign, ` ${name}`);
    L.DomEvent.on(input, "change", () => {
      map[input.checked ? "addLayer" : "removeLayer"](layers[at]);
    });
    return input;
  });
  const seen = semsig.rangeSlider(box, "Objects seen", lengths, String, () => changed());
  const chance = semsig.rangeSlider(
    box, about.chance.label, 20, (at) => `${5 * at} %`, () => changed());
  const label = L.DomUtil.create("label", "semsig-class", box);
  label.append("Sees ");
  const select = L.DomUtil.create("select", "", label);
  const present = new Set(data.types.join(""));
  const symbols = ["", ...[...present].sort()];
  for (const symbol of symbols) {
    const option = semsig.text(select, "option", symbol ? about.signs.classes[symbol].title : "anything");
    option.value = symbol;
  }
  L.DomEvent.on(select, "change", () => changed());
  const foot = L.DomUtil.create("div", "semsig-download", box);
  const button = (text, title, act) => {
    const one = semsig.text(foot, "button", text);
    Object.assign(one, {type: "button", title});
    L.DomEvent.on(one, "click", act);
  };
  const ranges = {error, seen, chance};
  button("All", "Select all queries", () => {
    for (const range of Object.values(ranges)) range.set(0, range.last);
    select.value = "";
    for (const layer of layers.slice(0, outcomes.length)) map.addLayer(layer);
    changed();
  });
  for (const [text, kind] of [["GeoJSON", "geojson"], ["CSV", "csv"]]) {
    button(text, `Download the selection as ${text}`, () => {
      const [type, file] = semsig.files[kind](semsig.queryColumns(set), set.selection());
      semsig.download(`queries.${kind}`, new Blob([file], {type}));
    });
  }
  const inside = ({low, high, last}, value) =>
    (low === 0 || value >= low) && (high === last || value <= high);
  const show = () => {
    const [all, chosen] = [[null], outcomes].map(
      (parts) => parts.map(() => new Array(edges.length - 1).fill(0)));
    const selected = outcomes.map(() => 0);
    const on = outcomes.map((_, at) => map.hasLayer(layers[at]));
    const symbol = select.value;
    for (let one = 0; one < count; one += 1) {
      const [bin, outcome] = [bins[one], data.outcome[one]];
      const others = inside(seen, data.length[one]) && inside(chance, data.chance[one] / 5)
        && (symbol === "" || data.types[one].includes(symbol));
      set.chosen[one] = others && bin >= error.low && bin < error.high ? 1 : 0;
      all[0][bin] += 1;
      if (!others || !on[outcome]) continue;
      chosen[outcome][bin] += 1;
      selected[outcome] += set.chosen[one];
    }
    boxes.forEach((input, at) => { input.checked = on[at]; });
    drawn(all[0], chosen, error.low, error.high);
    const sum = selected.reduce((one, other) => one + other);
    const failed = selected[outcomes.findIndex(({name}) => name === "failed")];
    told.textContent = `${sum < count ? `${number(sum)} of ` : ""}${number(count)} queries, ${
      number(failed)} failed`;
    set.redraw();
    map.fire("semsig-selection", {key, count: sum, failed});
  };
  const changed = () => {
    show();
    map.fire("semsig-state");
  };
  map.on("layeradd layerremove", ({layer}) => { if (layers.includes(layer)) show(); });
  show();
  // As `error:50~1000,class:D`; an end that is left out is free.
  const units = {error: (at) => edges[at], seen: (at) => at, chance: (at) => 5 * at};
  const read = () => {
    const parts = Object.entries(ranges).filter(([, {low, high, last}]) => low || high < last).map(
      ([name, {low, high, last}]) => `${name}:${low ? units[name](low) : ""}~${
        high < last ? units[name](high) : ""}`);
    if (select.value) parts.push(`class:${encodeURIComponent(select.value)}`);
    return parts.join(",") || null;
  };
  semsig.remember(map, key, read, (text) => {
    const parts = Object.fromEntries(text.split(",").map((part) => part.split(/:(.*)/)));
    for (const [name, range] of Object.entries(ranges)) {
      const [low, high] = (parts[name] || "").split("~").map((end) => {
        const at = [...new Array(range.last + 1).keys()].find(
          (one) => end && units[name](one) === Number(end));
        return at;
      });
      range.set(low ?? 0, high ?? range.last);
    }
    const symbol = decodeURIComponent(parts.class || "");
    select.value = present.has(symbol) ? symbol : "";
    show();
  });
};
