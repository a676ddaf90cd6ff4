// Interpolate the two values of a lattice over a box at x and y, or extrapolate outside the box.
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
// The cells of a page; a cell is its index in the packed arrays.
semsig.City = class {
  constructor(data, grid, signs) {
    Object.assign(this, {data, grid, signs, count: data.rows.length});
  }
  // Binary search for the first index from low to high for which a condition holds.
  static firstOf(low, high, holds) {
    while (low < high) {
      const middle = (low + high) >> 1;
      if (holds(middle)) high = middle; else low = middle + 1;
    }
    return low;
  }
  placeOf(cell) {
    const ends = this.data.columnEnds;
    const column = semsig.City.firstOf(0, ends.length, (index) => ends[index] > cell);
    return [column, this.data.rows[cell]];
  }
  cellAt(column, row) {
    const {columnEnds: ends, rows} = this.data;
    if (column < 0 || column >= ends.length) return -1;
    const cell = semsig.City.firstOf(
      column > 0 ? ends[column - 1] : 0, ends[column], (index) => rows[index] >= row);
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
  // The nearest cell within `reach` metres of a click, or -1, and the distance of its middle.
  nearest(map, clicked, reach) {
    const {step, origin, firstColumn, mercatorBox} = this.grid;
    const point = L.CRS.EPSG3857.project(clicked);
    const [x, y] = semsig.between(this.data.metres, mercatorBox, point.x, point.y);
    const column = Math.floor((x - origin[0]) / step) - firstColumn;
    const row = Math.floor((y - origin[1]) / step);
    // At low zoom a cell is smaller than a finger.
    const other = map.containerPointToLatLng(map.latLngToContainerPoint(clicked).add([8, 0]));
    const finger = Math.min(map.distance(clicked, other), 20 * step);
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
  // The cell with an id, given as text, or -1.
  cellOfId(id) {
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
  towards(cell, other) {
    const [[x, y], [u, v]] = [this.placeOf(cell), this.placeOf(other)];
    return ["north", "north-east", "east", "south-east", "south", "south-west", "west",
      "north-west"][Math.round(Math.atan2(u - x, v - y) / Math.PI * 4 + 8) % 8];
  }
  coordinates(cell) {
    return this.middle(cell).map((part) => part.toFixed(5)).join(", ");
  }
  part(name, cell) {
    const ends = this.data[`${name}.ends`];
    return [cell > 0 ? ends[cell - 1] : 0, ends[cell]];
  }
  types(name, cell) {
    const codes = this.data[`${name}.types`].subarray(...this.part(name, cell));
    return Array.from(codes, (code) => this.grid.symbols[code]).join("");
  }
  // The objects around a cell, nearest first: class, degrees, metres, offset from its middle.
  around(name, cell) {
    const {[`${name}.x`]: x, [`${name}.y`]: y, [`${name}.classes`]: classes} = this.data;
    const [column, row] = this.placeOf(cell);
    const {step, firstColumn, quantum, reach} = this.grid;
    const [east, north] = [step * (firstColumn + column + 0.5), step * (row + 0.5)];
    const near = [];
    for (let at = 0; at < x.length; at += 1) {
      const [right, up] = [x[at] * quantum - east, y[at] * quantum - north];
      const metres = Math.hypot(right, up);
      if (metres > reach + 1) continue;
      const degrees = (Math.atan2(right, up) / Math.PI * 180 + 360) % 360;
      near.push({symbol: this.grid.symbols[classes[at]], degrees, metres, right, up});
    }
    return near.sort((first, second) => first.metres - second.metres);
  }
  // The signature of a cell. Bearings are stored as levels; exact bearings and distances come from
  // the object of the same class in the direction of the level, if there is one.
  signature(name, cell) {
    const levels = this.data[`${name}.levels`].subarray(...this.part(name, cell));
    const types = this.types(name, cell);
    const span = 360 / this.grid.levels;
    const near = types ? this.around(name, cell) : [];
    // Landmarks have bearings and distances of their own.
    const [farUnits, farBearings] = ["farUnits", "farBearings"].map(
      (part) => this.data[`${name}.${part}`]?.subarray(...this.part(name, cell)));
    const metres = [];
    // An object may occur twice, at slightly different places: use only one of them.
    const used = [];
    const twice = (object) => used.some((other) => other === object
      || (other.symbol === object.symbol
        && Math.hypot(other.right - object.right, other.up - object.up) < 1.5));
    const bearings = Array.from(levels, (level, at) => {
      if (farUnits?.[at]) {
        metres.push(this.grid.distances[farUnits[at]]);
        return Math.round(farBearings[at] / 20) % 360;
      }
      const middle = (level + 0.5) * span;
      const off = ({degrees}) => Math.abs((degrees - middle + 540) % 360 - 180);
      const fit = near.filter((object) =>
        object.symbol === types[at] && !used.includes(object) && off(object) <= span / 2 + 1);
      const nearest = fit.find((object) => !twice(object)) || fit[0];
      if (nearest) used.push(nearest);
      metres.push(nearest ? Math.round(nearest.metres) : null);
      return Math.round(nearest ? nearest.degrees : middle) % 360;
    });
    const extents = Array.from(
      this.data[`${name}.extents`]?.subarray(...this.part(name, cell)) || []);
    return [types, bearings, {metres, extents, reach: this.grid.reach, place: this.middle(cell)}];
  }
  // The cells with the most similar counts of classes, best first: cell, difference, distance.
  mostSimilar(name, cell, count) {
    // Count the objects of each class in each cell, once.
    if (!this.counts) {
      const {[`${name}.types`]: types, [`${name}.ends`]: ends} = this.data;
      const numbers = new Map();
      for (const type of types) if (!numbers.has(type)) numbers.set(type, numbers.size);
      this.counts = new Uint8Array(this.count * numbers.size);
      this.classes = numbers.size;
      for (let target = 0, at = 0; target < this.count; target += 1) {
        for (; at < ends[target]; at += 1) {
          const place = target * this.classes + numbers.get(types[at]);
          if (this.counts[place] < 255) this.counts[place] += 1;
        }
      }
    }
    const {counts, classes} = this;
    const best = [];
    for (let other = 0; other < this.count; other += 1) {
      if (other === cell) continue;
      let differ = 0;
      for (let at = 0; at < classes; at += 1) {
        differ += Math.abs(counts[other * classes + at] - counts[cell * classes + at]);
      }
      if (best.length === count && differ > best.at(-1)[1]) continue;
      const away = this.metres(cell, other);
      best.push([other, differ, away]);
      best.sort((first, second) => first[1] - second[1] || first[2] - second[2]);
      best.length = Math.min(best.length, count);
    }
    return best;
  }
};
semsig.cellFacts = {};
semsig.cells = (packed, grid, signs, names) => {
  const group = L.layerGroup();
  const ready = semsig.arrays(packed).then((data) => new semsig.City(data, grid, signs));
  const buttons = (city, map, box, jumps) => {
    // Below the title, so that they stay visible in a long panel.
    const lines = jumps.map(([label, goals]) => {
      const line = L.DomUtil.create("div", "semsig-jumps");
      if (label) semsig.text(line, "span", label);
      for (const [text, other, title] of goals) {
        const button = L.DomUtil.create("button", "", line);
        button.textContent = text;
        button.title = title;
        button.setAttribute("aria-label", title);
        L.DomEvent.on(button, "click", () => {
          const at = [...box.querySelectorAll(".semsig-jumps button")].indexOf(button);
          show(city, map, other).querySelectorAll(".semsig-jumps button")[at]?.focus();
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
    const look = {pane: "shadowPane", interactive: false, color: semsig.highlight, weight: 3};
    const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(
      ([across, along]) => city.latlng(column + across, row + along));
    drawn.addLayer(L.polygon(corners, {...look, fill: false}));
    const parts = names.map((name) => ({
      rows: [], jumps: [], dots: [], lookalikes: [], ...semsig.cellFacts[name](city, cell)}));
    // The lookalikes of the last part come first: likely confusions before equal signatures.
    const lookalikes = [];
    for (const [other, reason] of parts.toReversed().flatMap((part) => part.lookalikes)) {
      if (lookalikes.length < 3 && !lookalikes.some((entry) => entry[0] === other)) {
        lookalikes.push([other, reason]);
      }
    }
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
    lookalikes.forEach(([other], at) => {
      drawn.addLayer(
        L.polyline([middle, city.middle(other)], {...look, weight: 2, dashArray: "5 5"}));
      const text = L.DomUtil.create("b", "");
      text.textContent = at + 1;
      const label = {permanent: true, direction: "center", className: "semsig-number"};
      sign(other, {radius: 9, fillColor: "#fff"}).bindTooltip(text, label);
    });
    const rows = [
      ...(away ? [["Nearest cell", `${Math.round(away)} m from the click`]] : []),
      ...parts.flatMap((part) => part.rows), ["Latitude, longitude", city.coordinates(cell)],
      ["Cell", city.id(cell)]];
    const title = parts.map((part) => part.title).filter(Boolean).pop();
    const others = lookalikes.map(([other, reason], at) => ({
      label: `${at + 1}: ${city.far(cell, other)} to the ${city.towards(cell, other)}`,
      line: `${reason}; ${city.coordinates(other)}`,
      signature: () => city.signature("now", other),
      go: () => show(city, map, other),
    }));
    const kind = parts.map((part) => part.kind).find(Boolean);
    const box = semsig.details(title, rows.map((row) => row[0]), rows.map((row) => row[1]), signs,
      {others: others.length ? others : null, kind});
    buttons(city, map, box, parts.flatMap((part) => part.jumps));
    semsig.show(map, box, middle, {key: `cell:${city.id(cell)}`, corners, drawn});
    return box;
  };
  const answer = (map) => async (event) => {
    const city = await ready;
    const [cell, away] = city.nearest(map, event.latlng, grid.tolerance);
    if (cell >= 0) show(city, map, cell, away);
    else {
      semsig.showPlace(map, event.latlng, "No cell here", [["Seen", "nothing from this place"]]);
    }
    return true;
  };
  semsig.addOpener("cell", (map, id) => {
    if (!map.hasLayer(group)) return false;
    ready.then((city) => {
      const cell = city.cellOfId(id);
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
    if (map.semsigPanel?.selection?.layers.includes(drawn)) semsig.hide(map);
    map.getContainer().classList.remove("semsig-cells");
    L.LayerGroup.prototype.onRemove.call(group, map);
  };
  return group;
};
