// The state of a map in the address of its page, so that a link restores it: a short text for each
// part, such as `place=43.61000,3.88000,15&told=cell:123`.
semsig.state = {
  read() {
    return new URLSearchParams(location.hash.slice(1));
  },
  write(parts) {
    const text = parts.toString().replace(/%(2C|3A|2F|7E)/g, decodeURIComponent);
    const address = location.href.split("#")[0] + (text ? `#${text}` : "");
    if (address !== location.href) history.replaceState(history.state, "", address);
  },
};
// Adds a part of the state: `read` returns its text or null, `write` restores it from a text. Every
// change of a part fires "semsig-state".
semsig.remember = (map, key, read, write) => {
  if (location.protocol === "about:") return;  // the frame of a notebook has no address
  if (!map.semsigParts) {
    const parts = new Map();
    map.semsigParts = parts;
    let waiting = null;
    map.on("semsig-state", () => {
      clearTimeout(waiting);
      waiting = setTimeout(() => {
        const state = semsig.state.read();
        for (const [name, part] of parts) {
          const text = part.read();
          if (text === null) state.delete(name); else state.set(name, text);
        }
        semsig.state.write(state);
      }, 200);
    });
    window.addEventListener("hashchange", () => {
      const state = semsig.state.read();
      for (const [name, part] of parts) if (state.has(name)) part.write(state.get(name));
    });
  }
  map.semsigParts.set(key, {read, write});
  const text = semsig.state.read().get(key);
  if (text !== null) write(text);
};
// Functions that open the panel for a key, by the kind of the key (the part before ":").
semsig.openers = {};
// The part for the object in the panel. It has this name so that older links still work.
semsig.selectionPart = "told";
// Remembers the object in the panel.
semsig.rememberSelection = (map) => {
  let selection = null;
  map.on("semsig-panel", ({key}) => {
    selection = key;
    map.fire("semsig-state");
  });
  semsig.remember(map, semsig.selectionPart, () => selection, (text) => {
    const [kind, ...rest] = text.split(":");
    if (text !== selection && Object.hasOwn(semsig.openers, kind)) {
      semsig.openers[kind](map, rest.join(":"));
    }
  });
};
semsig.rememberPlace = (map) => {
  const read = () => {
    const {lat, lng} = map.getCenter();
    return `${lat.toFixed(5)},${lng.toFixed(5)},${Number(map.getZoom().toFixed(2))}`;
  };
  let view = read();
  semsig.remember(map, "place", () => view, (text) => {
    const [latitude, longitude, zoom] = text.split(",").map(Number);
    if (![latitude, longitude, zoom].every(Number.isFinite)) return;
    map.setView([latitude, longitude], zoom, {animate: false});
    view = read();
  });
  map.on("moveend", () => {
    view = read();
    map.fire("semsig-state");
  });
};
// The layers that were switched: names of those switched on, and with a "~" of those switched off.
semsig.rememberLayers = (map, control) => {
  const layers = control._layers.filter((entry) => entry.overlay).map(({layer, name}) => {
    const text = new DOMParser().parseFromString(name, "text/html");
    for (const sign of text.querySelectorAll("svg")) sign.remove();
    const words = text.body.textContent.replace(/\s*\([\d,]+\)/, "").match(/[\p{L}\p{N}]+/gu);
    return {layer, name: (words || []).join("-"), first: map.hasLayer(layer)};
  });
  const read = () => layers.filter(({layer, first}) => map.hasLayer(layer) !== first)
    .map(({name, first}) => (first ? `~${name}` : name)).join(",") || null;
  semsig.remember(map, "layers", read, (text) => {
    const changed = new Set(text.split(","));
    const on = layers.filter(({name, first}) =>
      (changed.has(first ? `~${name}` : name) ? !first : first));
    // Layers may share a part, so remove layers before others are added.
    for (const entry of layers) if (!on.includes(entry)) map.removeLayer(entry.layer);
    for (const entry of on) map.addLayer(entry.layer);
  });
  map.on("overlayadd overlayremove", () => map.fire("semsig-state"));
};
