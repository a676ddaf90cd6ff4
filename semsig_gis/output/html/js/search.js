// Search functions of the layers: each returns the objects with a name that matches.
semsig.finders = [];
semsig.plain = (text) => String(text).normalize("NFD").replace(/\p{M}/gu, "").toLowerCase()
  .replace(/(\d),(?=\d{3})/g, "$1").trim();
// Indices of the names that contain the words, by rank: 0 if the words are a line of the name, 1 if
// they are whole words of it, 2 if they are parts of words.
semsig.matches = (names, words, limit) => {
  const quoted = words.replace(/[\\^$.*+?()[\]{}|]/g, "\\$&");
  const line = new RegExp(`^${quoted}$`, "mu");
  const whole = new RegExp(`(?<![\\p{L}\\p{N}])${quoted}(?![\\p{L}\\p{N}])`, "u");
  const ranked = [[], [], []];
  names.forEach((name, at) => {
    if (!name.includes(words)) return;
    const rank = line.test(name) ? 0 : whole.test(name) ? 1 : 2;
    if (ranked[rank].length < limit) ranked[rank].push({rank, at});
  });
  return ranked.flat().slice(0, limit);
};
// The layer of the layer control that a part belongs to.
semsig.whole = (layer) => (layer.semsigWhole ? semsig.whole(layer.semsigWhole) : layer);
semsig.reveal = (map, layer, place) => {
  map.addLayer(semsig.whole(layer));
  map.setView(place, Math.max(map.getZoom(), 18), {animate: false});
};
// Convert x and y of the data to latitude and longitude, by a polynomial.
semsig.latlng = ({middle, half, terms}, x, y) => {
  const [u, v] = [(x - middle[0]) / half, (y - middle[1]) / half];
  return terms.reduce(([latitude, longitude], [i, j, north, east]) => {
    const power = u ** i * v ** j;
    return [latitude + north * power, longitude + east * power];
  }, [0, 0]);
};
// Convert latitude and longitude to x and y of the data, by Newton's method.
semsig.xy = (area, place) => {
  const reach = area.half / 1000;
  let [x, y] = area.middle;
  for (let step = 0; step < 8; step += 1) {
    const [here, east, north] = [[0, 0], [reach, 0], [0, reach]].map(
      ([right, up]) => semsig.latlng(area, x + right, y + up));
    const [a, b, c, d] = [east[0] - here[0], north[0] - here[0], east[1] - here[1],
      north[1] - here[1]];
    const [u, v] = [place[0] - here[0], place[1] - here[1]];
    x += reach * (d * u - b * v) / (a * d - b * c);
    y += reach * (a * v - c * u) / (a * d - b * c);
  }
  return [x, y];
};
semsig.whereabouts = (area, place, xy) => {
  const facts = [["Latitude, longitude", place.map((part) => part.toFixed(6)).join(", ")]];
  if (area) facts.push([`x, y in ${area.crs}`, xy.map((part) => part.toFixed(2)).join(", ")]);
  return facts;
};
semsig.point = (map, name, place, facts, corners) => {
  const look = {
    pane: "shadowPane", interactive: false, color: semsig.highlight, weight: 3, fill: false,
  };
  const mark = corners ? L.polygon(corners, look) : L.circleMarker(place, {...look, radius: 10});
  map.setView(place, Math.max(map.getZoom(), 18), {animate: false});
  semsig.show(
    map, semsig.details(name, facts.map((fact) => fact[0]), facts.map((fact) => fact[1]), {}),
    place, {corners, drawn: mark});
};
semsig.within = ({columns, rows}, cell) =>
  [columns, rows].every(([low, high], at) => low <= cell[at] && cell[at] <= high);
// The number of the cell around a place, if the map has cells there.
semsig.cellAround = (area, xy) => {
  if (!area?.grid) return [];
  const {step, origin} = area.grid;
  const cell = xy.map((part, at) => Math.floor((part - origin[at]) / step));
  const number = BigInt(cell[0]) * 100000000n + BigInt(cell[1]);
  return semsig.within(area.grid, cell) ? [["Cell", String(number)]] : [];
};
semsig.columnAndRow = (number) => {
  const [span, half] = [100000000n, 50000000n];
  const row = (((number + half) % span) + span) % span - half;
  return [(number - row) / span, row].map(Number);
};
semsig.cellsCalled = (typed, area) => {
  if (!area?.grid || !/^-?(\d{1,19}|\d{1,3}(,\d{3}){1,6})$/.test(typed)) return [];
  const {step, origin} = area.grid;
  const number = BigInt(typed.replaceAll(",", ""));
  const cell = semsig.columnAndRow(number);
  if (!semsig.within(area.grid, cell)) return [];
  const at = ([across, along]) => [
    origin[0] + step * (cell[0] + across), origin[1] + step * (cell[1] + along)];
  const [middle, ...corners] = [[0.5, 0.5], [0, 0], [1, 0], [1, 1], [0, 1]].map(at);
  const latlngs = corners.map((corner) => semsig.latlng(area, ...corner));
  const name = `Cell ${number}`;
  const show = (map) => {
    const place = semsig.latlng(area, ...middle);
    semsig.point(map, name, place, semsig.whereabouts(area, place, middle), latlngs);
    // A layer of cells replaces this by its own description of the cell.
    semsig.openers.cell?.(map, String(number));
  };
  return [{rank: 0, name, hint: "", show}];
};
semsig.placesAt = (text, area) => {
  const part = (letters) => `(-?\\d+(?:[.,]\\d+)?)\\s*\u00b0?\\s*([${letters}]?)`;
  const pair = new RegExp(`^[(\\s]*${part("NS")}[\\s,;]+${part("EW")}[)\\s]*$`, "i").exec(text);
  if (!pair) return [];
  const [first, second] = [[pair[1], pair[2]], [pair[3], pair[4]]].map(
    ([number, letter]) => Number(number.replace(",", ".")) * (/[SW]/i.test(letter) ? -1 : 1));
  const name = `${first}, ${second}`;
  const places = [];
  const offer = (hint, place, xy) => {
    const facts = [...semsig.whereabouts(area, place, xy), ...semsig.cellAround(area, xy)];
    places.push({rank: 0, name, hint, show: (map) => semsig.point(map, name, place, facts)});
  };
  const bounds = area && L.latLngBounds([[0, 1], [2, 1], [0, 3], [2, 3]].map(
    ([x, y]) => semsig.latlng(area, area.box[x], area.box[y]))).pad(0.1);
  const degrees = Math.abs(first) <= 90 && Math.abs(second) <= 180;
  if (degrees && (!bounds || bounds.contains([first, second]))) {
    const place = [first, second];
    offer("latitude, longitude", place, area && semsig.xy(area, place));
  }
  const [west, south, east, north] = area ? area.box : [0, 0, 0, 0];
  if (area && west <= first && first <= east && south <= second && second <= north) {
    offer(`x, y in ${area.crs}`, semsig.latlng(area, first, second), [first, second]);
  }
  return places;
};
semsig.search = (map, area) => {
  const most = 8;
  const box = L.DomUtil.create("form", "semsig-search");
  const input = L.DomUtil.create("input", "", box);
  const list = L.DomUtil.create("ul", "", box);
  const message = L.DomUtil.create("p", "", box);
  const number = document.querySelectorAll(".semsig-search").length;
  list.id = `semsig-found-${number}`;
  list.hidden = true;
  message.hidden = true;
  for (const [part, values] of [
    [box, {role: "search"}],
    [input, {type: "search", role: "combobox", autocomplete: "off",
      placeholder: "Cell, place or name\u2026",
      "aria-label": "Search: the number of a cell, latitude and longitude, x and y, or a name",
      title: "The number of a cell, latitude and longitude, x and y, or a name",
      spellcheck: "false", "aria-autocomplete": "list", "aria-expanded": "false",
      "aria-controls": list.id}],
    [list, {role: "listbox", "aria-label": "Found"}],
    [message, {role: "status"}],
  ]) for (const [name, value] of Object.entries(values)) part.setAttribute(name, value);
  let offers = [];
  let active = -1;
  const showMessage = (text) => {
    message.textContent = text;
    message.hidden = !text;
  };
  const choose = (index) => {
    active = index;
    for (const [at, item] of [...list.children].entries()) {
      item.setAttribute("aria-selected", at === index);
    }
    if (index >= 0) input.setAttribute("aria-activedescendant", list.children[index].id);
    else input.removeAttribute("aria-activedescendant");
    if (index >= 0) list.children[index].scrollIntoView({block: "nearest"});
  };
  const close = () => {
    list.hidden = true;
    input.setAttribute("aria-expanded", "false");
    choose(-1);
  };
  const take = (offer) => {
    close();
    showMessage("");
    input.value = offer.name;
    input.blur();
    map.getContainer().focus({preventScroll: true});  // so that Escape closes the panel
    offer.show(map);
  };
  const look = () => {
    const text = input.value.trim();
    const words = semsig.plain(text);
    showMessage("");
    offers = [];
    if (words) {
      offers = [...semsig.cellsCalled(text, area), ...semsig.placesAt(text, area)];
      for (const finder of semsig.finders) offers.push(...finder(words, most));
      offers = offers.sort((first, second) => first.rank - second.rank).slice(0, most);
    }
    list.replaceChildren(...offers.map((offer, at) => {
      const item = L.DomUtil.create("li", "");
      item.id = `${list.id}-${at}`;
      item.setAttribute("role", "option");
      semsig.text(item, "span", offer.name);
      if (offer.hint) semsig.text(item, "small", offer.hint);
      L.DomEvent.on(item, "mousedown", L.DomEvent.preventDefault);
      L.DomEvent.on(item, "click", () => take(offer));
      return item;
    }));
    list.hidden = !offers.length;
    input.setAttribute("aria-expanded", String(!list.hidden));
    choose(offers.length ? 0 : -1);
  };
  L.DomEvent.on(input, "input", look);
  L.DomEvent.on(input, "focus", () => { if (input.value) look(); });
  L.DomEvent.on(input, "blur", close);
  L.DomEvent.on(input, "keydown", (event) => {
    const steps = {ArrowDown: 1, ArrowUp: -1}[event.key];
    if (steps && offers.length && !list.hidden) {
      choose((active + steps + offers.length) % offers.length);
      event.preventDefault();
    } else if (event.key === "Escape") close();
  });
  L.DomEvent.on(box, "submit", (event) => {
    L.DomEvent.preventDefault(event);
    if (list.hidden) look();
    if (offers.length) take(offers[Math.max(active, 0)]);
    else if (input.value.trim()) showMessage("Nothing on this map has that name, number or place.");
  });
  L.DomEvent.disableClickPropagation(box);
  L.DomEvent.disableScrollPropagation(box);
  const control = L.control({position: "topleft"});
  control.onAdd = () => box;
  control.addTo(map);
  L.DomUtil.addClass(box, "leaflet-control");
  box.parentElement.prepend(box);
};
