window.semsig = {
  // Fields that say what a thing is called; the search knows it by them, too.
  naming: new Set(["Class", "Class before", "Seen as", "Street object", "Identifier"]),
  layers: 0,  // of points, so far
  pointed: "#7733ff",  // colour of what is pointed at, on whatever it lies
  points(fields, titles, records, shape) {
    const group = L.featureGroup();
    const markers = [];
    const layer = semsig.layers++;
    // By its number, where it has one.
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
    const tell = (map, at) => {
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
      // What has a number is called by it alone, too.
      names = names || records.map(([, , , name, values]) => semsig.plain(
        [name, /\d[\d,]*/.exec(name), ...named.map((at) => values[at])].join("\n")));
      return semsig.matches(names, words, limit).map(({rank, at}) => ({
        rank,
        name: records[at][3],
        hint: hint(records[at][4]),
        show: (map) => tell(map, at),
      }));
    });
    return group;
  },
  // What joins a sign to the places found for it, the best first.
  hint(place, places) {
    const look = {pane: "shadowPane", interactive: false, color: semsig.pointed, weight: 2};
    return L.layerGroup([
      L.polyline([place, places[0]], {...look, dashArray: "5 5"}),
      ...places.map((one, at) => L.circleMarker(one, {
        ...look, radius: at ? 5 : 8, weight: at ? 1 : 2, fill: false,
      })),
    ]);
  },
  lines(bundles) {
    return L.featureGroup(bundles.map(([look, lines]) => L.polyline(lines, {
      pane: "shadowPane", interactive: false, weight: 1, opacity: 0.6, ...look,
    })));
  },
  // One of the layers may be in several groups: the first is below in each.
  together(...layers) {
    const group = L.layerGroup(layers);
    group.setZIndex = () => group;
    return group;
  },
  // The layer control in groups. Cells have one colour at a time, or none.
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
    control._layers.sort((one, other) => rankOf(one) - rankOf(other));
    control._addItem = (item) => {
      const label = L.Control.Layers.prototype._addItem.call(control, item);
      const group = groups[item.name];
      if (!group) return label;
      const list = control._overlaysList;
      let box = list.querySelector(`[data-group="${group}"]`);
      if (!box) {
        box = L.DomUtil.create("fieldset", "", list);
        box.dataset.group = group;
        semsig.text(box, "legend", titles[group]);
      }
      box.append(label);
      if (group === "cells") {
        const input = label.querySelector("input");
        input.type = "radio";
        input.name = `semsig-cells-${L.stamp(control)}`;
      }
      return label;
    };
    map.on("overlayadd", ({layer}) => {
      if (!colours.some((one) => one.layer === layer)) return;
      for (const one of colours) if (one.layer !== layer) map.removeLayer(one.layer);
    });
    control.remove().addTo(map);
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
    box.setAttribute("name", "semsig-legend");  // one is open at a time
    box.innerHTML = text;
    L.DomEvent.disableClickPropagation(box);
    L.DomEvent.disableScrollPropagation(box);
    const control = L.control({position: "bottomleft"});
    control.onAdd = () => box;
    control.addTo(map);
    // Cells have edges from near, and melt into each other from afar.
    const close = () => map.getContainer().classList.toggle("semsig-close", map.getZoom() > 16);
    map.on("zoomend", close);
    close();
    if (view !== null) map.semsigView = {view, zoom};
  },
};
