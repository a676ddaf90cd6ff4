// What is seen of a map, in the address of its page, so that a link shows it again: for each part
// that is remembered a short text, as `place=43.61000,3.88000,15&told=cell:123`.
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
// `read` returns the text of a part, or null; `write` shows what a text tells. What changes a part
// fires "semsig-state".
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
// How what is told is shown again, by the kind of its key.
semsig.openers = {};
semsig.rememberTold = (map) => {
  let told = null;
  map.on("semsig-told", ({key}) => {
    told = key;
    map.fire("semsig-state");
  });
  semsig.remember(map, "told", () => told, (text) => {
    const [kind, ...rest] = text.split(":");
    if (text !== told && Object.hasOwn(semsig.openers, kind)) {
      semsig.openers[kind](map, rest.join(":"));
    }
  });
};
semsig.rememberPlace = (map) => {
  const read = () => {
    const {lat, lng} = map.getCenter();
    return `${lat.toFixed(5)},${lng.toFixed(5)},${Number(map.getZoom().toFixed(2))}`;
  };
  let shown = read();
  semsig.remember(map, "place", () => shown, (text) => {
    const [latitude, longitude, zoom] = text.split(",").map(Number);
    if (![latitude, longitude, zoom].every(Number.isFinite)) return;
    map.setView([latitude, longitude], zoom, {animate: false});
    shown = read();
  });
  map.on("moveend", () => {
    shown = read();
    map.fire("semsig-state");
  });
};
// The layers that are not as they were at first: those that are on, and after a "~" that are off.
semsig.rememberLayers = (map, control) => {
  const named = control._layers.filter((one) => one.overlay).map(({layer, name}) => {
    const text = new DOMParser().parseFromString(name, "text/html");
    for (const sign of text.querySelectorAll("svg")) sign.remove();
    const words = text.body.textContent.replace(/\s*\([\d,]+\)/, "").match(/[\p{L}\p{N}]+/gu);
    return {layer, name: (words || []).join("-"), first: map.hasLayer(layer)};
  });
  const read = () => named.filter(({layer, first}) => map.hasLayer(layer) !== first)
    .map(({name, first}) => (first ? `~${name}` : name)).join(",") || null;
  semsig.remember(map, "layers", read, (text) => {
    const changed = new Set(text.split(","));
    const on = named.filter(({name, first}) =>
      (changed.has(first ? `~${name}` : name) ? !first : first));
    // Layers may share a part, so that what goes, goes first.
    for (const one of named) if (!on.includes(one)) map.removeLayer(one.layer);
    for (const one of on) map.addLayer(one.layer);
  });
  map.on("overlayadd overlayremove", () => map.fire("semsig-state"));
};
