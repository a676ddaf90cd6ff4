semsig.colours = (map) => {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const control = L.control({position: "topleft"});
  control.onAdd = () => {
    const bar = L.DomUtil.create("div", "leaflet-bar semsig-bar");
    // The choice is stored for the next visit, if the page may use the local storage.
    const stored = (choice) => {
      try {
        if (choice) localStorage.setItem("semsig-colours", choice);
        return localStorage.getItem("semsig-colours");
      } catch {
        return choice;
      }
    };
    let choice = stored();
    const button = semsig.mapButton(bar, "semsig-colours", "", "", () => {
      choice = stored(semsig.isDark(map) ? "light" : "dark");
      show();
      map.fire("semsig-state");
    });
    const show = () => {
      const is = choice ? choice === "dark" : dark.matches;
      map.getContainer().classList.toggle("semsig-dark", is);
      // A sun or a moon, as a text character instead of an emoji.
      button.textContent = is ? "\u2600\ufe0e" : "\u263e\ufe0e";
      button.title = is ? "Light colours" : "Dark colours";
      button.setAttribute("aria-label", button.title);
      map.fire("semsig-colours");
    };
    dark.addEventListener("change", show);
    semsig.remember(map, "colours", () => choice, (text) => {
      choice = text === "dark" ? "dark" : "light";
      show();
    });
    show();
    map.semsigBar = bar;
    return bar;
  };
  control.addTo(map);
};
semsig.icon = (lines) => {
  const [icon, path] = ["svg", "path"].map((name) => L.SVG.create(name));
  icon.setAttribute("class", "semsig-icon");
  icon.setAttribute("viewBox", "0 0 20 20");
  icon.setAttribute("aria-hidden", "true");
  path.setAttribute("d", lines);
  icon.append(path);
  return icon;
};
semsig.mapButton = (parent, name, sign, title, act) => {
  const button = L.DomUtil.create("button", name, parent);
  Object.assign(button, {type: "button", textContent: sign, title});
  button.setAttribute("aria-label", title);
  L.DomEvent.on(button, "click", (event) => {
    L.DomEvent.stop(event);
    act();
  });
  return button;
};
// Downloads a blob as a file.
semsig.download = (name, blob) => {
  const link = document.createElement("a");
  Object.assign(link, {href: URL.createObjectURL(blob), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
};
// The title of the map and its results, and its accessible name.
semsig.title = (map) => {
  const container = map.getContainer();
  const texts = (selector) => [...new Set(
    [...container.querySelectorAll(selector)].map((element) => element.textContent))];
  const summaries = texts(".semsig-legend > summary");
  const title = document.title || summaries[0] || "Map";
  const box = L.DomUtil.create("div", "semsig-title", container);
  semsig.text(box, "h1", title);
  const more = [...summaries.filter((text) => text !== title), ...texts(".semsig-subtitle")];
  if (more.length) semsig.text(box, "p", more.join(" \u00b7 "));
  container.setAttribute("role", "main");
  container.setAttribute("aria-roledescription", "map");
  container.setAttribute("aria-label", title);
  container.setAttribute("aria-keyshortcuts", "c");
  L.DomUtil.create("p", "semsig-status", container).setAttribute("role", "status");
  L.DomEvent.on(container, "keydown", (event) => {
    const {key, target, ctrlKey, metaKey, altKey} = event;
    if (key === "c" && !(ctrlKey || metaKey || altKey) && !target.matches("input")) semsig.copy(map);
  });
};
// Hide the parts of legends that explain layers which are off.
semsig.explain = (map, control) => {
  const plain = (name) => name.replace(/( \([\d,]+\))?(, \d+)?$/, "");
  const show = () => {
    const on = control._layers.filter(({layer}) => map.hasLayer(layer)).map(({name}) => plain(name));
    for (const part of map.getContainer().querySelectorAll("[data-layer]")) {
      const {layer} = part.dataset;
      part.hidden = !on.some((name) => (layer.endsWith(" ") ? name.startsWith(layer) : name === layer));
    }
  };
  map.on("overlayadd overlayremove", show);
  show();
};
semsig.isDark = (map) => map.getContainer().classList.contains("semsig-dark");
// Colour of outlines of signs on a light and on a dark map.
semsig.outline = (map) => (semsig.isDark(map) ? "#e9e9e6" : "#222");
// On small screens the boxes are folded, because they would cover half the map.
semsig.small = window.matchMedia("(max-width: 800px), (max-height: 499px)");
// Width in pixels that the boxes cover at the left and at the right, if `least` pixels remain.
semsig.margins = (map, least) => {
  if (semsig.small.matches) return [10, 10];
  let room = map.getSize().x - 20;
  return [".leaflet-left", ".leaflet-top.leaflet-right"].map((side) => {
    const boxes = [...map.getContainer().querySelectorAll(side)];
    const width = Math.max(...boxes.map((box) => box.offsetWidth));
    if (room - width < least) return 10;
    room -= width;
    return width + 10;
  });
};
semsig.folding = (map, layers) => {
  const box = map.getContainer();
  const fit = () => box.classList.toggle("semsig-small", semsig.small.matches);
  semsig.small.addEventListener("change", ({matches}) => {
    // Leaflet reads this option only when it creates the control.
    layers.options.collapsed = matches;
    map.off("click", layers.collapse, layers);
    layers.remove().addTo(map);
    if (matches) for (const legend of box.querySelectorAll(".semsig-legend")) legend.open = false;
    fit();
  });
  fit();
};
// Shows the first view, next to the boxes and the panel.
semsig.fitView = (map) => {
  if (!map.semsigView) return;
  const {view, zoom} = map.semsigView;
  const {panel, selection} = map.semsigPanel;
  const open = selection !== null;
  const sheet = open && semsig.isSheet(map, panel);
  const [left, right] = semsig.margins(map, 500);
  const tops = [...map.getContainer().querySelectorAll(".leaflet-top")];
  map.fitBounds(view, {
    paddingTopLeft: [left, sheet ? Math.max(...tops.map((box) => box.offsetHeight)) + 10 : 10],
    paddingBottomRight: [
      right + (open && !sheet ? panel.offsetWidth : 0), sheet ? panel.offsetHeight + 10 : 10],
    maxZoom: zoom, animate: false,
  });
};
semsig.addControls = (map, layers, area, {credits, first, links, at}) => {
  // Addresses of public maps and photographs of a place; nothing is requested before a click.
  // They are written with five or six decimals.
  map.semsigLinks = (place) => links.map(([title, address]) => [title, [6, 5].reduce(
    (whole, digits) => at.reduce((text, degrees, part) =>
      text.replaceAll(degrees.toFixed(digits), place[part].toFixed(digits)), whole), address)]);
  map.attributionControl?.setPrefix(false);
  for (const credit of map.attributionControl ? credits : []) {
    // In an element of its own, so that its text direction does not change other text.
    const text = L.DomUtil.create("bdi", "");
    text.textContent = credit;
    map.attributionControl.addAttribution(text.outerHTML);
  }
  map.semsigArea = area;
  semsig.panel(map);
  semsig.answers(map, 2, (event) => semsig.showPlace(map, event.latlng));
  semsig.colours(map);
  semsig.pictureButtons(map);
  semsig.search(map, area);
  semsig.title(map);
  semsig.explain(map, layers);
  semsig.folding(map, layers);
  semsig.fitView(map);
  const state = semsig.state.read();
  if (first && !state.has(semsig.selectionPart)) {
    const [kind, key] = first.split(":");
    for (const legend of map.getContainer().querySelectorAll(".semsig-legend")) legend.open = false;
    layers.options.collapsed = true;
    layers.remove().addTo(map);
    semsig.openers[kind](map, key);
    semsig.fitView(map);
  }
  semsig.rememberLayers(map, layers);
  semsig.rememberPlace(map);
  semsig.rememberSelection(map);
};
