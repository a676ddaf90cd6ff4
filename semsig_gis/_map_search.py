"""The script of what stands around a map: search, light and dark, attribution."""

from __future__ import annotations

__all__ = ["SCRIPT"]

SCRIPT = r"""
semsig.finders = [];  // of each layer with named things: what is called so, with how to show it
semsig.plain = (text) => String(text).toLowerCase().replace(/(\d),(?=\d{3})/g, "$1").trim();
// The places in a list of those that hold the words, whole words first.
semsig.matches = (names, words, limit) => {
  const whole = [];
  const part = [];
  const ends = (sign) => sign === undefined || !/[\p{L}\p{N}]/u.test(sign);
  for (let at = 0; at < names.length && whole.length < limit; at += 1) {
    const place = names[at].indexOf(words);
    if (place < 0) continue;
    const apart = ends(names[at][place - 1]) && ends(names[at][place + words.length]);
    if (apart) whole.push(at); else if (part.length < limit) part.push(at);
  }
  return whole.concat(part).slice(0, limit);
};
semsig.reveal = (map, layer, place) => {
  let outermost = layer;
  while (outermost.semsigWhole) outermost = outermost.semsigWhole;
  map.addLayer(outermost);
  map.setView(place, Math.max(map.getZoom(), 18), {animate: false});
};
semsig.degrees = (place) => ["Degrees", place.map((part) => part.toFixed(6)).join(", ")];
// Latitude and longitude of a place in the coordinate system of the data.
semsig.latlng = ({middle, half, terms}, x, y) => {
  const [u, v] = [(x - middle[0]) / half, (y - middle[1]) / half];
  return terms.reduce(([latitude, longitude], [i, j, north, east]) => {
    const power = u ** i * v ** j;
    return [latitude + north * power, longitude + east * power];
  }, [0, 0]);
};
semsig.point = (map, name, place, facts, corners) => {
  const look = {pane: "shadowPane", interactive: false, color: "#d55e00", weight: 3, fill: false};
  const mark = corners ? L.polygon(corners, look) : L.circleMarker(place, {...look, radius: 10});
  const popup = L.popup({maxWidth: 300, minWidth: 180}).setLatLng(place).setContent(
    semsig.details(name, facts.map((fact) => fact[0]), facts.map((fact) => fact[1]), {}));
  popup.on("remove", () => mark.remove());
  map.setView(place, Math.max(map.getZoom(), 18), {animate: false});
  mark.addTo(map);
  popup.openOn(map);
};
semsig.cellsCalled = (text, area) => {
  if (!area || !area.grid || !/^-?\d{1,19}$/.test(text)) return [];
  const {step, origin, columns, rows} = area.grid;
  const [span, half] = [100000000n, 50000000n];
  const row = (((BigInt(text) + half) % span) + span) % span - half;
  const cell = [(BigInt(text) - row) / span, row].map(Number);
  const within = [columns, rows].every(([low, high], at) => low <= cell[at] && cell[at] <= high);
  if (!within) return [];
  const at = ([across, along]) => [
    origin[0] + step * (cell[0] + across), origin[1] + step * (cell[1] + along)];
  const [middle, ...corners] = [[0.5, 0.5], [0, 0], [1, 0], [1, 1], [0, 1]].map(at);
  const latlngs = corners.map((corner) => semsig.latlng(area, ...corner));
  const show = (map) => {
    const place = semsig.latlng(area, ...middle);
    const facts = [["Middle", middle.join(", ") + " in " + area.crs], semsig.degrees(place)];
    semsig.point(map, "Cell " + text, place, facts, latlngs);
    // A layer that knows the cell tells of it instead.
    map.fire("click", {latlng: L.latLng(place), semsigSearch: true});
  };
  return [{name: "Cell " + text, hint: "", show}];
};
semsig.placesAt = (text, area) => {
  const pair = /^(-?\d+(?:\.\d+)?)\u00b0?[\s,;]+(-?\d+(?:\.\d+)?)\u00b0?$/.exec(text);
  if (!pair) return [];
  const [first, second] = pair.slice(1).map(Number);
  const found = [];
  const bounds = area && L.latLngBounds([[0, 1], [2, 1], [0, 3], [2, 3]].map(
    ([x, y]) => semsig.latlng(area, area.box[x], area.box[y]))).pad(0.1);
  const degrees = Math.abs(first) <= 90 && Math.abs(second) <= 180;
  if (degrees && (!bounds || bounds.contains([first, second]))) {
    const name = first + ", " + second;
    const hint = "latitude, longitude";
    const show = (map) => semsig.point(map, name, [first, second], [["Is", hint]]);
    found.push({name, hint, show});
  }
  const [west, south, east, north] = area ? area.box : [0, 0, 0, 0];
  if (area && west <= first && first <= east && south <= second && second <= north) {
    const name = first + ", " + second;
    const hint = "x, y in " + area.crs;
    const place = semsig.latlng(area, first, second);
    const show = (map) => semsig.point(map, name, place, [["Is", hint], semsig.degrees(place)]);
    found.push({name, hint, show});
  }
  return found;
};
semsig.search = (map, area) => {
  const most = 8;
  const box = L.DomUtil.create("form", "semsig-search");
  const input = L.DomUtil.create("input", "", box);
  const list = L.DomUtil.create("ul", "", box);
  const message = L.DomUtil.create("p", "", box);
  const number = document.querySelectorAll(".semsig-search").length;
  list.id = "semsig-found-" + number;
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
  let found = [];
  let chosen = -1;
  const tell = (text) => {
    message.textContent = text;
    message.hidden = !text;
  };
  const choose = (one) => {
    chosen = one;
    [...list.children].forEach((item, at) => item.setAttribute("aria-selected", at === one));
    if (one >= 0) input.setAttribute("aria-activedescendant", list.children[one].id);
    else input.removeAttribute("aria-activedescendant");
    if (one >= 0) list.children[one].scrollIntoView({block: "nearest"});
  };
  const close = () => {
    list.hidden = true;
    input.setAttribute("aria-expanded", "false");
    choose(-1);
  };
  const take = (one) => {
    close();
    tell("");
    input.value = one.name;
    input.blur();
    one.show(map);
  };
  const look = () => {
    const text = input.value.trim();
    const words = semsig.plain(text);
    tell("");
    found = [];
    if (words) {
      found = [...semsig.cellsCalled(text, area), ...semsig.placesAt(text, area)];
      for (const finder of semsig.finders) found.push(...finder(words, most));
      found = found.slice(0, most);
    }
    list.replaceChildren(...found.map((one, at) => {
      const item = L.DomUtil.create("li", "");
      item.id = list.id + "-" + at;
      item.setAttribute("role", "option");
      semsig.text(item, "span", one.name);
      if (one.hint) semsig.text(item, "small", one.hint);
      L.DomEvent.on(item, "mousedown", L.DomEvent.preventDefault);
      L.DomEvent.on(item, "click", () => take(one));
      return item;
    }));
    list.hidden = !found.length;
    input.setAttribute("aria-expanded", String(!list.hidden));
    choose(found.length ? 0 : -1);
  };
  L.DomEvent.on(input, "input", look);
  L.DomEvent.on(input, "focus", () => { if (input.value) look(); });
  L.DomEvent.on(input, "blur", close);
  L.DomEvent.on(input, "keydown", (event) => {
    const steps = {ArrowDown: 1, ArrowUp: -1}[event.key];
    if (steps && found.length && !list.hidden) {
      choose((chosen + steps + found.length) % found.length);
      event.preventDefault();
    } else if (event.key === "Escape") close();
  });
  L.DomEvent.on(box, "submit", (event) => {
    L.DomEvent.preventDefault(event);
    if (list.hidden) look();
    if (found.length) take(found[Math.max(chosen, 0)]);
    else if (input.value.trim()) tell("Nothing on this map is called so, or lies there.");
  });
  L.DomEvent.disableClickPropagation(box);
  L.DomEvent.disableScrollPropagation(box);
  const control = L.control({position: "topleft"});
  control.onAdd = () => box;
  control.addTo(map);
  L.DomUtil.addClass(box, "leaflet-control");
  box.parentElement.prepend(box);
};
semsig.colours = (map) => {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const control = L.control({position: "topleft"});
  control.onAdd = () => {
    const bar = L.DomUtil.create("div", "leaflet-bar");
    const button = L.DomUtil.create("a", "semsig-colours", bar);
    button.href = "#";
    button.textContent = "\u25d0";
    button.setAttribute("role", "button");
    let chosen = null;
    const show = () => {
      const is = chosen === null ? dark.matches : chosen;
      map.getContainer().classList.toggle("semsig-dark", is);
      button.title = is ? "Light colours" : "Dark colours";
      button.setAttribute("aria-label", button.title);
      map.fire("semsig-colours");
    };
    L.DomEvent.on(button, "click", (event) => {
      L.DomEvent.stop(event);
      chosen = !semsig.isDark(map);
      show();
    });
    L.DomEvent.on(button, "keydown", (event) => {
      if (event.key !== " ") return;
      L.DomEvent.stop(event);
      button.click();
    });
    dark.addEventListener("change", show);
    show();
    return bar;
  };
  control.addTo(map);
};
semsig.isDark = (map) => map.getContainer().classList.contains("semsig-dark");
semsig.furnish = (map, area, credits) => {
  for (const credit of map.attributionControl ? credits : []) {
    const text = L.DomUtil.create("span", "");
    text.textContent = credit;
    map.attributionControl.addAttribution(text.innerHTML);
  }
  const told = (is) => () => map.getContainer().classList.toggle("semsig-told", is);
  map.on("popupopen", told(true)).on("popupclose", told(false));
  semsig.colours(map);
  semsig.search(map, area);
};
"""
