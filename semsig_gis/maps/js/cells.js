// A place in a box, or beside it, by the values at the crossings of a lattice over it.
semsig.between = (lattice, [west, south, east, north], x, y) => {
  const lines = Math.sqrt(lattice.length / 2) - 1;
  const [[column, right], [row, up]] = [[x, west, east], [y, south, north]].map(
    ([value, low, high]) => {
      const place = (value - low) / (high - low) * lines;
      const line = Math.min(Math.max(Math.floor(place), 0), lines - 1);
      return [line, place - line];
    });
  return [0, 1].map((part) => {
    const value = (across, along) =>
      lattice[2 * ((row + along) * (lines + 1) + column + across) + part];
    const [low, high] = [0, 1].map(
      (along) => value(0, along) * (1 - right) + value(1, along) * right);
    return low * (1 - up) + high * up;
  });
};
// The cells of a page, by their row numbers.
semsig.City = class {
  constructor(data, grid) {
    Object.assign(this, {data, grid, count: data.rows.length});
  }
  static firstOf(low, high, holds) {
    while (low < high) {
      const middle = (low + high) >> 1;
      if (holds(middle)) high = middle; else low = middle + 1;
    }
    return low;
  }
  placeOf(cell) {
    const ends = this.data.columnEnds;
    return [semsig.City.firstOf(0, ends.length, (one) => ends[one] > cell), this.data.rows[cell]];
  }
  cellAt(column, row) {
    const {columnEnds: ends, rows} = this.data;
    if (column < 0 || column >= ends.length) return -1;
    const cell = semsig.City.firstOf(
      column > 0 ? ends[column - 1] : 0, ends[column], (one) => rows[one] >= row);
    return cell < ends[column] && rows[cell] === row ? cell : -1;
  }
  latlng(column, row) {
    const {step, origin, firstColumn, box} = this.grid;
    return semsig.between(
      this.data.degrees, box, origin[0] + step * (firstColumn + column), origin[1] + step * row);
  }
  middle(cell) {
    return this.latlng(...this.placeOf(cell).map((corner) => corner + 0.5));
  }
  id(cell) {
    const [column, row] = this.placeOf(cell);
    return String(BigInt(this.grid.firstColumn + column) * 100000000n + BigInt(row));
  }
  // The nearest cell and how far away its middle is, in metres, as far as `reach`.
  nearest(map, clicked, reach) {
    const {step, origin, firstColumn, mercatorBox} = this.grid;
    const point = L.CRS.EPSG3857.project(clicked);
    const [x, y] = semsig.between(this.data.metres, mercatorBox, point.x, point.y);
    const column = Math.floor((x - origin[0]) / step) - firstColumn;
    const row = Math.floor((y - origin[1]) / step);
    // From afar a cell is smaller than a finger.
    const beside = map.containerPointToLatLng(map.latLngToContainerPoint(clicked).add([8, 0]));
    const finger = Math.min(map.distance(clicked, beside), 20 * step);
    const steps = Math.floor(Math.max(finger, reach) / step);
    let [best, least] = [-1, Infinity];
    for (let across = -steps; across <= steps; across += 1) {
      for (let along = -steps; along <= steps; along += 1) {
        const away = across * across + along * along;
        const cell = away < least ? this.cellAt(column + across, row + along) : -1;
        if (cell >= 0) [best, least] = [cell, away];
      }
    }
    return [best, Math.sqrt(least) * step <= finger ? 0 : Math.sqrt(least) * step];
  }
  // The cell of a number as it is told, or -1.
  called(id) {
    if (!/^-?\d{1,19}$/.test(id)) return -1;
    const [column, row] = semsig.columnAndRow(BigInt(id));
    return this.cellAt(column - this.grid.firstColumn, row);
  }
  metres(cell, other) {
    const [[x, y], [u, v]] = [this.placeOf(cell), this.placeOf(other)];
    return this.grid.step * Math.hypot(u - x, v - y);
  }
  far(cell, other) {
    const metres = this.metres(cell, other);
    return metres < 1000 ? `${Math.round(metres)} m` : `${(metres / 1000).toFixed(1)} km`;
  }
  // Eighths of a turn, clockwise from north.
  eighth(cell, other) {
    const [[x, y], [u, v]] = [this.placeOf(cell), this.placeOf(other)];
    return Math.round(Math.atan2(u - x, v - y) / Math.PI * 4 + 8) % 8;
  }
  part(name, cell) {
    const ends = this.data[`${name}.ends`];
    return [cell > 0 ? ends[cell - 1] : 0, ends[cell]];
  }
  types(name, cell) {
    return String.fromCharCode(
      ...this.data[`${name}.types`].subarray(...this.part(name, cell)));
  }
  signature(name, cell) {
    const levels = this.data[`${name}.levels`].subarray(...this.part(name, cell));
    const degrees = 360 / this.grid.levels;
    return [this.types(name, cell),
      Array.from(levels, (level) => Math.floor((level + 0.5) * degrees))];
  }
};
semsig.cellFacts = {};
semsig.cells = (packed, grid, titles, names) => {
  const group = L.layerGroup();
  const ready = semsig.arrays(packed).then((data) => new semsig.City(data, grid));
  const buttons = (city, map, box, jumps) => {
    // Below the title, so that they are in sight however much there is to tell.
    const lines = jumps.map(([label, goals]) => {
      const line = L.DomUtil.create("div", "semsig-jumps");
      if (label) semsig.text(line, "span", label);
      for (const [text, other, title] of goals) {
        const button = L.DomUtil.create("button", "", line);
        button.textContent = text;
        button.title = title;
        button.setAttribute("aria-label", title === "near" ? text : title);
        L.DomEvent.on(button, "click", () => {
          const at = [...box.querySelectorAll("button")].indexOf(button);
          show(city, map, other).querySelectorAll("button")[at]?.focus();
        });
      }
      return line;
    });
    box.firstChild.after(...lines);
  };
  let drawn = null;
  const show = (city, map, cell, away = 0) => {
    drawn = L.layerGroup();
    const [column, row] = city.placeOf(cell);
    const middle = city.middle(cell);
    const look = {pane: "shadowPane", interactive: false, color: "#d55e00", weight: 3};
    const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(
      ([across, along]) => city.latlng(column + across, row + along));
    drawn.addLayer(L.polygon(corners, {...look, fill: false}));
    const parts = names.map((name) => ({
      rows: [], jumps: [], marks: [], dots: [], ...semsig.cellFacts[name](city, cell)}));
    const sign = (other, options) => {
      const marker = L.circleMarker(city.middle(other), {
        pane: "markerPane", color: semsig.outline(map), weight: 1, fillOpacity: 0.95,
        bubblingMouseEvents: false, ...options,
      });
      marker.on("click", () => show(city, map, other));
      drawn.addLayer(marker);
      return marker;
    };
    for (const [other, colour] of parts.flatMap((part) => part.dots)) {
      sign(other, {radius: 4, fillColor: colour});
    }
    parts.flatMap((part) => part.marks).forEach((other, at) => {
      drawn.addLayer(
        L.polyline([middle, city.middle(other)], {...look, weight: 2, dashArray: "5 5"}));
      const text = L.DomUtil.create("b", "");
      text.textContent = at + 1;
      const label = {permanent: true, direction: "center", className: "semsig-number"};
      sign(other, {radius: 9, fillColor: "#fff"}).bindTooltip(text, label);
    });
    // The page has the level of a bearing, whose middle is told.
    const half = `\u00b1${Math.round(180 / grid.levels)}\u00b0, middles of levels`;
    const rows = [
      ...(away ? [["Nearest cell", `${Math.round(away)} m from the click`]] : []),
      ...parts.flatMap((part) => part.rows), ["Cell", city.id(cell)], ["Bearings", half]];
    const title = parts.map((part) => part.title).filter(Boolean).pop();
    const box = semsig.details(
      title, rows.map((one) => one[0]), rows.map((one) => one[1]), titles);
    buttons(city, map, box, parts.flatMap((part) => part.jumps));
    semsig.show(map, box, middle, {key: `cell:${city.id(cell)}`, corners, drawn});
    return box;
  };
  const answer = (map) => async (event) => {
    const city = await ready;
    const [cell, away] = city.nearest(map, event.latlng, grid.beside);
    if (cell >= 0) show(city, map, cell, away);
    else {
      semsig.tellPlace(map, event.latlng, "No cell here", [["Seen", "nothing from this place"]]);
    }
    return true;
  };
  semsig.addOpener("cell", (map, id) => {
    if (!map.hasLayer(group)) return false;
    ready.then((city) => {
      const cell = city.called(id);
      if (cell >= 0) show(city, map, cell);
    });
    return true;
  });
  let silence = null;
  group.onAdd = (map) => {
    L.LayerGroup.prototype.onAdd.call(group, map);
    silence = semsig.answers(map, 1, answer(map));
    map.getContainer().classList.add("semsig-cells");
  };
  group.onRemove = (map) => {
    silence();
    if (drawn && drawn === map.semsigPanel?.told?.drawn) semsig.hide(map);
    map.getContainer().classList.remove("semsig-cells");
    L.LayerGroup.prototype.onRemove.call(group, map);
  };
  return group;
};
