window.semsig = {
  // Fields with names of an object; the search finds it by their values.
  naming: new Set(["Class", "Class before", "Seen as", "Street object", "Identifier"]),
  layers: 0,  // number of point layers
  highlight: "#7733ff",  // colour of the selected object, visible on all backgrounds
  points(fields, titles, records, shape) {
    const group = L.featureGroup();
    const markers = [];
    const layer = semsig.layers++;
    // Key of a record in the address: its kind and number, or its position in this layer.
    const keyOf = (at) => {
      const [, kind, number] = /^(\w+) (\d[\d,]*)/.exec(records[at][3]) || [];
      return kind ? `${kind.toLowerCase()}:${number.replaceAll(",", "")}` : `sign:${layer}/${at}`;
    };
    for (const [place, colour, radius, name, values, label] of records) {
      const look = {
        pane: "markerPane", radius: radius, color: "#222", weight: 1,
        fillColor: colour, fillOpacity: 1,
      };
      const marker = shape
        ? new semsig.Sign(place, {...look, outline: shape}) : L.circleMarker(place, look);
      if (label) {
        const text = L.DomUtil.create("b", "");
        text.textContent = label;
        marker.bindTooltip(
          text, {permanent: true, direction: "center", className: "semsig-number"});
      }
      marker.on("click", (event) => {
        L.DomEvent.stop(event);
        const box = semsig.details(name, fields, values, titles);
        semsig.show(marker._map, box, place, {key: keyOf(markers.indexOf(marker))});
      });
      marker.addTo(group);
      markers.push(marker);
    }
    const outline = () => group.setStyle({color: semsig.outline(group._map)});
    group.on("add", () => {
      group._map.on("semsig-colours", outline);
      outline();
    });
    group.on("remove", () => group._map.off("semsig-colours", outline));
    const showRecord = (map, at) => {
      semsig.reveal(map, group, markers[at].getLatLng());
      markers[at].fire("click");
    };
    const keys = new Map(records.map((_, at) => [keyOf(at), at]));
    for (const kind of new Set([...keys.keys()].map((key) => key.split(":")[0]))) {
      semsig.addOpener(kind, (map, rest) => {
        const at = keys.get(`${kind}:${rest}`);
        if (at === undefined) return false;
        semsig.whole(group).addTo(map);
        markers[at].fire("click");
        return true;
      });
    }
    const named = [...fields.keys()].filter((at) => semsig.naming.has(fields[at]));
    const hint = (values) => [...new Set(named.map((at) => values[at]))].filter(Boolean).join(", ");
    let names = null;
    semsig.finders.push((words, limit) => {
      // The number in a name is a name too.
      names = names || records.map(([, , , name, values]) => semsig.plain(
        [name, /\d[\d,]*/.exec(name), ...named.map((at) => values[at])].join("\n")));
      return semsig.matches(names, words, limit).map(({rank, at}) => ({
        rank,
        name: records[at][3],
        hint: hint(records[at][4]),
        show: (map) => showRecord(map, at),
      }));
    });
    return group;
  },
  // Lines and circles that connect a sign with its estimated places, the best first.
  hint(place, places) {
    const look = {pane: "shadowPane", interactive: false, color: semsig.highlight, weight: 2};
    return L.layerGroup([
      L.polyline([place, places[0]], {...look, dashArray: "5 5"}),
      ...places.map((other, at) => L.circleMarker(other, {
        ...look, radius: at ? 5 : 8, weight: at ? 1 : 2, fill: false,
      })),
    ]);
  },
  lines(bundles) {
    return L.featureGroup(bundles.map(([look, lines]) => L.polyline(lines, {
      pane: "shadowPane", interactive: false, weight: 1, opacity: 0.6, ...look,
    })));
  },
  // A layer may be in several groups; the first layer of a group lies below the others.
  together(...layers) {
    const group = L.layerGroup(layers);
    group.setZIndex = () => group;
    return group;
  },
  // The layer control in groups; only one layer of the group "cells" is on at a time.
  layerGroups(map, control, titles, groups) {
    const rankOf = ({name}) => [...Object.keys(titles), undefined].indexOf(groups[name]);
    const nothing = {layer: L.layerGroup(), name: "Nothing"};
    const colours = control._layers.filter(({name}) => groups[name] === "cells");
    if (colours.length) {
      groups[nothing.name] = "cells";
      control.addOverlay(nothing.layer, nothing.name);
      if (!colours.some(({layer}) => map.hasLayer(layer))) map.addLayer(nothing.layer);
      colours.push(nothing);
    }
    control._layers.sort((first, second) => rankOf(first) - rankOf(second));
    // A group with families has a folded list for each, with a box that switches all its layers.
    const opened = new Set();
    const families = new Map();
    const refresh = () => {
      for (const [group, box] of families) {
        const layers = control._layers.filter(({name}) => groups[name] === group);
        const count = layers.filter(({layer}) => map.hasLayer(layer)).length;
        box.checked = count > 0;
        box.indeterminate = count > 0 && count < layers.length;
      }
    };
    const switchAll = (group, on) => {
      control._handlingClick = true;  // or Leaflet lists all layers again after each of them
      for (const {layer, name} of control._layers) {
        if (groups[name] === group) map[on ? "addLayer" : "removeLayer"](layer);
      }
      control._handlingClick = false;
      control._update();
      families.get(group).focus();
    };
    const boxOf = (group) => {
      const box = control._overlaysList.querySelector(`[data-group="${group}"]`);
      if (box) return box;
      const [parent, family] = group.split(":");
      if (family === undefined) {
        const fieldset = L.DomUtil.create("fieldset", "", control._overlaysList);
        fieldset.dataset.group = group;
        semsig.text(fieldset, "legend", titles[group]);
        return fieldset;
      }
      const line = L.DomUtil.create("div", "semsig-family", boxOf(parent));
      const all = L.DomUtil.create("input", "", line);
      all.type = "checkbox";
      all.setAttribute("aria-label", `All of ${titles[group]}`);
      families.set(group, all);
      L.DomEvent.on(all, "change", () => switchAll(group, all.checked));
      const list = L.DomUtil.create("details", "", line);
      list.dataset.group = group;
      list.open = opened.has(group);
      L.DomEvent.on(list, "toggle", () => opened[list.open ? "add" : "delete"](group));
      semsig.text(list, "summary", titles[group]);
      return list;
    };
    map.on("overlayadd overlayremove", refresh);
    control._addItem = (item) => {
      const label = L.Control.Layers.prototype._addItem.call(control, item);
      item.layer.semsigLabel = {text: label.querySelector("span > span"), name: item.name};
      if (item.layer.semsigCount) semsig.countLayer(item.layer, item.layer.semsigCount);
      const group = groups[item.name];
      if (!group) return label;
      boxOf(group).append(label);
      refresh();
      if (group === "cells") {
        const input = label.querySelector("input");
        input.type = "radio";
        input.name = `semsig-cells-${L.stamp(control)}`;
      }
      return label;
    };
    map.on("overlayadd", ({layer}) => {
      if (!colours.some((entry) => entry.layer === layer)) return;
      for (const entry of colours) if (entry.layer !== layer) map.removeLayer(entry.layer);
    });
    control.remove().addTo(map);
  },
  // Changes the number of things of a layer in the layer control.
  countLayer(layer, count) {
    layer.semsigCount = count;
    const {text, name} = layer.semsigLabel || {};
    if (text) text.textContent = ` ${name.replace(/\([\d,]+\)/, `(${count})`)}`;
  },
  drawings(parts) {
    const group = L.featureGroup();
    for (const [name, ...values] of parts) {
      const part = semsig[name](...values);
      part.semsigWhole = group;
      part.addTo(group);
    }
    return group;
  },
  legend(map, text, view, zoom) {
    const box = L.DomUtil.create("details", "semsig-legend");
    box.open = !semsig.small.matches && !document.querySelector(".semsig-legend[open]");
    box.setAttribute("name", "semsig-legend");  // only one legend is open at a time
    box.innerHTML = text;
    L.DomEvent.disableClickPropagation(box);
    L.DomEvent.disableScrollPropagation(box);
    const control = L.control({position: "bottomleft"});
    control.onAdd = () => box;
    control.addTo(map);
    // At high zoom cells are drawn with sharp edges, else interpolated.
    const close = () => map.getContainer().classList.toggle("semsig-close", map.getZoom() > 16);
    map.on("zoomend", close);
    close();
    if (view !== null) map.semsigView = {view, zoom};
  },
};
