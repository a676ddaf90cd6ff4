"""What the page of a map holds beside folium's own: style, script, and text made safe for it.

folium renders what it has rendered once more as a Jinja template, so that ``{{...}}`` in a class
title would be *run* when the map is made. Text from data therefore enters a page only through
`script_json`, and the script shows it as text nodes; legends are HTML-escaped as well.
"""

from __future__ import annotations

import json
import re

__all__ = ["SCRIPT", "STYLE", "script_json"]

STYLE = """\
.leaflet-container { background: #fcfcfa; }
.leaflet-container .leaflet-control-attribution { font-size: 11px; }
.leaflet-control-scale-line { font-size: 11px; }
.leaflet-control-scale-line + .leaflet-control-scale-line { display: none; }
.leaflet-heatmap-layer, .semsig-legend i.heat { opacity: 0.5; }
.semsig-legend {
  font: 13px/1.4 system-ui, sans-serif; color: #222; background: rgba(255, 255, 255, 0.93);
  border-radius: 5px; box-shadow: 0 1px 5px rgba(0, 0, 0, 0.4); padding: 7px 10px;
  box-sizing: border-box; width: 290px; max-width: calc(100vw - 20px);
  max-height: calc(100vh - 90px); overflow: auto; overflow-wrap: anywhere; }
.semsig-legend summary { font-weight: 600; font-size: 14px; cursor: pointer; }
.semsig-legend:not([open]) { width: auto; }
.semsig-legend p { margin: 6px 0; }
.semsig-legend small { color: #555; }
.semsig-legend i {
  display: inline-block; box-sizing: border-box; width: 12px; height: 12px; margin-right: 5px;
  vertical-align: -1px; border: 1px solid #444; }
.semsig-legend i.round { border-radius: 50%; }
.semsig-legend i.ramp { display: block; width: 100%; height: 10px; margin: 2px 0; }
.semsig-legend .ends { display: flex; justify-content: space-between; }
.semsig-legend table, .semsig-details table { border-collapse: collapse; }
.semsig-legend td { padding: 0 12px 0 0; }
.semsig-details { font: 13px/1.4 system-ui, sans-serif; overflow-wrap: anywhere; }
.semsig-details th { text-align: left; font-weight: 400; color: #555; white-space: nowrap; }
.semsig-details th, .semsig-details td { vertical-align: top; padding: 2px 6px 2px 0; }
.semsig-details code { font-size: 14px; font-weight: 600; }
.leaflet-tooltip.semsig-number {
  background: none; border: none; box-shadow: none; padding: 0; color: #222;
  font: 11px/1 system-ui, sans-serif; }
.semsig-close .leaflet-image-layer { image-rendering: pixelated; }
.leaflet-control-layers { font: 13px/1.5 system-ui, sans-serif; }
"""

# Popups are made when they are opened, from text nodes only: nothing in them is read as HTML.
SCRIPT = """\
const semsig = {
  text(parent, tag, text) {
    L.DomUtil.create(tag, "", parent).textContent = text;
  },
  details(name, fields, values, titles) {
    const box = L.DomUtil.create("div", "semsig-details");
    semsig.text(box, "b", name);
    const table = L.DomUtil.create("table", "", box);
    const row = (label) => {
      const line = L.DomUtil.create("tr", "", table);
      semsig.text(line, "th", label);
      return L.DomUtil.create("td", "", line);
    };
    const symbols = new Set();
    fields.forEach((label, number) => {
      const value = values[number];
      if (value === null) return;
      const cell = row(label);
      if (!Array.isArray(value)) {
        cell.textContent = value;
        return;
      }
      const [types, bearings] = value;
      const places = (bearings || []).map((degrees) => degrees + "\\u00b0");
      if (types !== null) {
        semsig.text(cell, "code", types);
        for (const symbol of types) symbols.add(symbol);
      }
      const pairs = places.map((place, at) => (types ? types[at] + "\\u00a0" + place : place));
      semsig.text(cell, "div", pairs.join(" "));
    });
    if (symbols.size) {
      const known = [...symbols].sort().map((symbol) => symbol + " " + titles[symbol]);
      row("Classes").textContent = known.join(", ");
    }
    return box;
  },
  points(fields, titles, records) {
    const group = L.featureGroup();
    for (const [place, colour, radius, found, name, values, label] of records) {
      const marker = L.circleMarker(place, {
        pane: "markerPane", radius: radius, color: "#222", weight: 1,
        fillColor: colour, fillOpacity: 0.95,
      });
      marker.bindPopup(() => semsig.details(name, fields, values, titles),
        {maxWidth: 340, minWidth: 220, maxHeight: 400});
      if (label) {
        const text = L.DomUtil.create("b", "");
        text.textContent = label;
        const look = {permanent: true, direction: "center", className: "semsig-number"};
        marker.bindTooltip(text, look);
      }
      if (found !== null) {
        const look = {pane: "shadowPane", interactive: false, color: "#222", weight: 2};
        const hint = L.layerGroup([
          L.polyline([place, found], {...look, dashArray: "5 5"}),
          L.circleMarker(found, {...look, radius: 8, fill: false}),
        ]);
        marker.on("popupopen", (event) => hint.addTo(event.popup._map));
        marker.on("popupclose", () => hint.remove());
      }
      marker.addTo(group);
    }
    return group;
  },
  lines(bundles) {
    return L.featureGroup(bundles.map(([look, lines]) => L.polyline(lines, {
      pane: "shadowPane", interactive: false, weight: 1, opacity: 0.6, ...look,
    })));
  },
  drawings(parts) {
    return L.featureGroup(parts.map(([name, ...values]) => semsig[name](...values)));
  },
  heat(points, {maxZoom, ...options}) {
    // leaflet.heat means by it where its points are strongest, but the layer control disables a
    // layer beyond it. So it is there only while the heat is drawn.
    const layer = L.heatLayer(points, options);
    const redraw = layer._redraw;
    layer._redraw = function() {
      this.options.maxZoom = maxZoom;
      redraw.call(this);
      delete this.options.maxZoom;
    };
    return layer;
  },
  legend(map, text, view, zoom) {
    const box = L.DomUtil.create("details", "semsig-legend");
    box.open = window.innerWidth > 700;
    box.innerHTML = text;
    L.DomEvent.disableClickPropagation(box);
    L.DomEvent.disableScrollPropagation(box);
    const control = L.control({position: "bottomleft"});
    control.onAdd = () => box;
    control.addTo(map);
    // Cells have edges from near, and melt into each other from afar.
    const close = () => map.getContainer().classList.toggle("semsig-close", map.getZoom() > 16);
    map.on("zoomend", close);
    if (view !== null) {
      const left = box.open ? box.offsetWidth + 20 : 10;
      map.fitBounds(view, {
        paddingTopLeft: [left, 10], paddingBottomRight: [10, 10], maxZoom: zoom, animate: false,
      });
    }
    close();
  },
};
"""


def script_json(value: object) -> str:
    r"""Return a value as JSON that may stand in the script of a folium page.

    Parameters
    ----------
    value : object
        Anything that JSON can hold; numbers are finite.

    Returns
    -------
    str
        JSON in ASCII that no HTML parser takes for markup and no Jinja rendering changes.

    Examples
    --------
    >>> script_json({"title": "{{7*7}}</script>"})
    '{"title":"\\u007b{7*7}}\\u003c/script\\u003e"}'
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    # Only a brace of text can be followed by one of these: JSON's own is by a quote or a "}".
    text = re.sub(r"\{(?=[{%#])", r"\\u007b", text)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text
