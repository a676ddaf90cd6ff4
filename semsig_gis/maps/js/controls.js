semsig.colours = (map) => {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const control = L.control({position: "topleft"});
  control.onAdd = () => {
    const bar = L.DomUtil.create("div", "leaflet-bar");
    const button = L.DomUtil.create("a", "semsig-colours", bar);
    button.href = "#";
    button.textContent = "\u25d0";
    button.setAttribute("role", "button");
    // What is chosen is kept for the next time, where a page may keep something.
    const remembered = (choice) => {
      try {
        if (choice) localStorage.setItem("semsig-colours", choice);
        return localStorage.getItem("semsig-colours");
      } catch {
        return choice;
      }
    };
    let choice = remembered();
    const show = () => {
      const is = choice ? choice === "dark" : dark.matches;
      map.getContainer().classList.toggle("semsig-dark", is);
      button.title = is ? "Light colours" : "Dark colours";
      button.setAttribute("aria-label", button.title);
      map.fire("semsig-colours");
    };
    L.DomEvent.on(button, "click", (event) => {
      L.DomEvent.stop(event);
      choice = remembered(semsig.isDark(map) ? "light" : "dark");
      show();
      map.fire("semsig-state");
    });
    L.DomEvent.on(button, "keydown", (event) => {
      if (event.key !== " ") return;
      L.DomEvent.stop(event);
      button.click();
    });
    dark.addEventListener("change", show);
    semsig.remember(map, "colours", () => choice, (text) => {
      choice = text === "dark" ? "dark" : "light";
      show();
    });
    show();
    return bar;
  };
  control.addTo(map);
};
semsig.isDark = (map) => map.getContainer().classList.contains("semsig-dark");
// On light and on dark, what sets a sign off from what is below it.
semsig.outline = (map) => (semsig.isDark(map) ? "#e9e9e6" : "#222");
// Where boxes would cover half the map, they are folded.
semsig.small = window.matchMedia("(max-width: 800px), (max-height: 499px)");
// What the boxes at the left and right cover, as far as so many pixels remain beside them.
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
    // Leaflet asks only when the control is made whether it opens by itself.
    layers.options.collapsed = matches;
    map.off("click", layers.collapse, layers);
    layers.remove().addTo(map);
    if (matches) box.querySelectorAll(".semsig-legend").forEach((one) => { one.open = false; });
    fit();
  });
  fit();
};
semsig.furnish = (map, layers, area, credits) => {
  for (const credit of map.attributionControl ? credits : []) {
    // By itself, so that signs of direction in it turn no other text.
    const text = L.DomUtil.create("bdi", "");
    text.textContent = credit;
    map.attributionControl.addAttribution(text.outerHTML);
  }
  map.semsigArea = area;
  semsig.panel(map);
  semsig.answers(map, 2, (event) => semsig.tellPlace(map, event.latlng));
  semsig.colours(map);
  semsig.search(map, area);
  semsig.folding(map, layers);
  if (map.semsigView) {
    const {view, zoom} = map.semsigView;
    const [left, right] = semsig.margins(map, 500);
    map.fitBounds(view, {
      paddingTopLeft: [left, 10], paddingBottomRight: [right, 10], maxZoom: zoom, animate: false,
    });
  }
  semsig.rememberLayers(map, layers);
  semsig.rememberPlace(map);
  semsig.rememberTold(map);
};
