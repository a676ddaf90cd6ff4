// Bin edges in metres for a histogram of errors: 0, then ten per power of ten (Renard series) up to
// the largest error, and infinity if there are infinite errors.
semsig.errorEdges = (errors) => {
  const finite = errors.filter((error) => Number.isFinite(error) && error > 0);
  const [low, high] = [Math.min, Math.max].map(
    (pick) => finite.reduce((first, second) => pick(first, second), 10));
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
// A slider with two handles, for the smallest and the largest value of a range.
semsig.rangeSlider = (parent, label, last, textOf, changed) => {
  const line = L.DomUtil.create("div", "semsig-range", parent);
  const text = L.DomUtil.create("span", "semsig-range-text", line);
  const track = L.DomUtil.create("div", "semsig-track", line);
  const sliders = [`${label}, least`, `${label}, most`].map((name, at) => {
    const slider = L.DomUtil.create("input", "", track);
    Object.assign(slider, {type: "range", min: 0, max: last, step: 1, value: at ? last : 0});
    slider.setAttribute("aria-label", name);
    return slider;
  });
  const range = {low: 0, high: last, last, text};
  const showRange = () => {
    sliders.forEach((slider, at) => {
      slider.value = at ? range.high : range.low;
      slider.setAttribute("aria-valuetext", textOf(Number(slider.value), at));
    });
    // Handles at the same place: the lower one is on top in the right half, so that both can move.
    sliders[0].style.zIndex = range.low > last / 2 ? 1 : 0;
    track.style.setProperty("--low", range.low / last);
    track.style.setProperty("--high", range.high / last);
    text.textContent = range.low === 0 && range.high === last
      ? `${label}: any` : `${label}: ${textOf(range.low, 0)} to ${textOf(range.high, 1)}`;
  };
  range.set = (low, high) => {
    [range.low, range.high] = [Math.max(0, Math.min(low, high)), Math.min(last, Math.max(low, high))];
    showRange();
  };
  sliders.forEach((slider, at) => {
    L.DomEvent.on(slider, "input", () => {
      const value = Number(slider.value);
      if (at) range.set(Math.min(range.low, value), value);
      else range.set(value, Math.max(range.high, value));
      changed();
    });
  });
  showRange();
  return range;
};
// A histogram of errors: pale bars of all queries, dark bars of the selected ones by outcome.
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
  const shades = ["semsig-brush", "semsig-brush"].map((kind) =>
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
    // A minimum height, so that a single query is visible.
    const high = Math.max(1.5, count / most * height);
    const foot = height - below[bin] / most * height;
    return `${path}M${bin * step + 0.5},${foot.toFixed(1)}v${-high.toFixed(1)}h${
      (step - 1).toFixed(2)}v${high.toFixed(1)}z`;
  }, "");
  return (all, selection, low, high) => {
    const most = Math.max(1, ...all);
    const none = all.map(() => 0);
    pale.setAttribute("d", pathOf(all, none, most));
    let below = none;
    for (const [at, counts] of selection.entries()) {
      bars[at].setAttribute("d", pathOf(counts, below, most));
      below = below.map((count, bin) => count + counts[bin]);
    }
    shades[0].setAttribute("width", low * step);
    shades[1].setAttribute("x", high * step);
    shades[1].setAttribute("width", width - high * step);
  };
};
// Columns of the files of selected queries: functions of the index of a query.
semsig.queryColumns = ({data, about, placeOf}) => ({
  query: (query) => query + 1,
  outcome: (query) => about.outcomes[data.outcome[query]].name,
  error_m: (query) => (Number.isFinite(data.error[query]) ? data.error[query] : null),
  [about.chance.column]: (query) => data.chance[query] / 100,
  objects_seen: (query) => data.length[query],
  types: (query) => data.types[query],
  query_types: (query) => data.asked[query],
  cell_id: (query) => data.cells[query],
  best_cell_id: (query) => data.bestCells[query],
  longitude: (query) => placeOf(query)[1],
  latitude: (query) => placeOf(query)[0],
});
semsig.files = {
  csv(columns, rows) {
    // A quote before characters that a spreadsheet would read as the start of a formula.
    const field = (value) => (typeof value !== "string" ? String(value ?? "")
      : `"${value.replaceAll('"', '""').replace(/^[=+\-@'\t\r]/, "'$&")}"`);
    const lines = rows.map(
      (query) => Object.values(columns).map((of) => field(of(query))).join(","));
    return ["text/csv", [Object.keys(columns).join(","), ...lines, ""].join("\r\n")];
  },
  geojson({longitude, latitude, ...columns}, rows) {
    const features = rows.map((query) => ({
      type: "Feature",
      geometry: {type: "Point", coordinates: [longitude(query), latitude(query)]},
      properties: Object.fromEntries(
        Object.entries(columns).map(([name, of]) => [name, of(query)])),
    }));
    return ["application/geo+json", JSON.stringify({type: "FeatureCollection", features})];
  },
};
// A box to select the queries that are drawn: by outcome, error, objects seen, class and chance.
semsig.filters = async (map, key) => {
  const box = L.DomUtil.create("details", "semsig-filters");
  const summary = L.DomUtil.create("summary", "", box);
  summary.setAttribute("aria-live", "polite");
  box.open = !semsig.small.matches && !document.querySelector(".semsig-filters[open]");
  L.DomEvent.disableClickPropagation(box);
  L.DomEvent.disableScrollPropagation(box);
  const control = L.control({position: "topright"});
  control.onAdd = () => box;
  control.addTo(map);
  const set = await semsig.layerSets[key].ready;
  const {data, about, layers} = set;
  const {outcomes} = about;
  const number = (value) => value.toLocaleString("en");
  const count = data.outcome.length;
  const edges = semsig.errorEdges([...data.error]);
  const bins = Uint8Array.from(data.error, (error) =>
    Math.max(0, edges.findIndex((edge) => error <= edge) - 1));
  const lengths = Math.max(1, ...data.length);
  const drawHistogram = semsig.histogram(box, edges, outcomes, (low, high) => {
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
    sign.setAttribute("class", "semsig-sign mark");
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
  const lengthRange = semsig.rangeSlider(box, "Objects seen", lengths, String, () => changed());
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
    const element = semsig.text(foot, "button", text);
    Object.assign(element, {type: "button", title});
    L.DomEvent.on(element, "click", act);
  };
  const ranges = {error, seen: lengthRange, chance};
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
    const [all, counts] = [[null], outcomes].map(
      (parts) => parts.map(() => new Array(edges.length - 1).fill(0)));
    const selected = outcomes.map(() => 0);
    const on = outcomes.map((_, at) => map.hasLayer(layers[at]));
    const symbol = select.value;
    for (let query = 0; query < count; query += 1) {
      const [bin, outcome] = [bins[query], data.outcome[query]];
      // The histogram shows the queries that pass the other filters.
      const others = inside(lengthRange, data.length[query])
        && inside(chance, data.chance[query] / 5)
        && (symbol === "" || data.types[query].includes(symbol));
      set.selected[query] = others && bin >= error.low && bin < error.high ? 1 : 0;
      all[0][bin] += 1;
      if (!others || !on[outcome]) continue;
      counts[outcome][bin] += 1;
      selected[outcome] += set.selected[query];
    }
    boxes.forEach((input, at) => { input.checked = on[at]; });
    drawHistogram(all[0], counts, error.low, error.high);
    const sum = selected.reduce((first, second) => first + second);
    const failed = selected[outcomes.findIndex(({name}) => name === "failed")];
    const totals = outcomes.map((_, at) => data.outcome.filter((outcome) => outcome === at).length);
    const shares = totals.map((total, at) => (selected[at] < total || !on[at]
      ? `${number(selected[at])} of ${number(total)}` : number(total)));
    summary.textContent = `${sum < count ? `${number(sum)} of ` : ""}${number(count)} queries, ${
      number(failed)} failed`;
    set.redraw();
    // The numbers in the legend and in the list of layers are those of the selection as well.
    const limits = [
      ...Object.values(ranges).filter(({low, high, last}) => low || high < last).map(
        ({text}) => text.textContent.toLowerCase()),
      ...(symbol ? [`sees ${about.signs.classes[symbol].title.toLowerCase()}`] : []),
      ...outcomes.filter((_, at) => !on[at]).map(({name}) => `not ${name}`)];
    for (const part of map.getContainer().querySelectorAll(`[data-queries="${key}"]`)) {
      const {outcome} = part.dataset;
      if (outcome !== undefined) part.textContent = shares[outcome];
      else {
        part.hidden = !limits.length;
        part.textContent = `Selected: ${number(sum)} of ${number(count)} queries, ${
          number(failed)} failed (${limits.join("; ")}). Shares and colours are of all queries.`;
      }
    }
    for (const at of outcomes.keys()) semsig.countLayer(layers[at], shares[at]);
  };
  const changed = () => {
    show();
    map.fire("semsig-state");
  };
  map.on("layeradd layerremove", ({layer}) => { if (layers.includes(layer)) show(); });
  show();
  // The state in the address, such as `error:50~1000,class:D`; a missing end is not limited.
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
          (index) => end && units[name](index) === Number(end));
        return at;
      });
      range.set(low ?? 0, high ?? range.last);
    }
    const symbol = decodeURIComponent(parts.class || "");
    select.value = present.has(symbol) ? symbol : "";
    show();
  });
};
