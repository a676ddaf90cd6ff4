"""What the page of a map holds beside folium's own: style, script, and text made safe for it.

folium renders what it has rendered once more as a Jinja template, so that ``{{...}}`` in a class
title would be *run* when the map is made. Text from data therefore enters a page only through
`script_json`, and the script shows it as text nodes; legends are HTML-escaped as well.
"""

from __future__ import annotations

import json
import re

STYLE = """\
.leaflet-container {
  --paper: #fcfcfa; --panel: rgba(255, 255, 255, 0.95); --ink: #222; --faint: #555;
  --edge: rgba(0, 0, 0, 0.25); --chosen: #dcebf7; color-scheme: light; background: var(--paper); }
.leaflet-container.semsig-dark {
  --paper: #131518; --panel: rgba(36, 39, 44, 0.96); --ink: #e9e9e6; --faint: #b0b4ba;
  --edge: rgba(255, 255, 255, 0.25); --chosen: #2d4a63; color-scheme: dark; }
.leaflet-container .leaflet-bar a, .leaflet-container .leaflet-control-layers,
.leaflet-container .leaflet-popup-content-wrapper, .leaflet-container .leaflet-popup-tip {
  background-color: var(--panel); color: var(--ink); border-color: var(--edge); }
.leaflet-container .leaflet-bar a.leaflet-disabled { opacity: 0.5; }
.leaflet-container a.leaflet-popup-close-button { color: var(--faint); }
.leaflet-container .leaflet-control-layers-separator { border-color: var(--edge); }
.semsig-dark .leaflet-control-layers-toggle { filter: invert(0.85); }
.leaflet-container .leaflet-control-attribution {
  font-size: 11px; background: var(--panel); color: var(--faint); max-width: 60vw;
  box-sizing: border-box; overflow: hidden; white-space: nowrap; text-overflow: ellipsis; }
.leaflet-container .leaflet-control-attribution:hover { white-space: normal; }
.leaflet-container .leaflet-control-attribution a { color: inherit; }
.leaflet-container .leaflet-control-scale-line {
  font-size: 11px; background: var(--panel); color: var(--ink); border-color: var(--faint);
  text-shadow: none; }
.leaflet-control-scale-line + .leaflet-control-scale-line { display: none; }
.semsig-heat, .semsig-legend i.heat { opacity: 0.5; }
/* What is dark on light is light on dark: the ramps that begin near the colour of paper. */
.semsig-dark .semsig-flip, .semsig-dark .semsig-heat, .semsig-dark i.heat,
.semsig-dark img.leaflet-tile {
  filter: invert(1) hue-rotate(180deg) brightness(1.15); }
.semsig-dark .semsig-lift { filter: brightness(1.4); }
/* Streets and buildings are seen on the cells, whose colours they change but little. */
.semsig-ground { mix-blend-mode: multiply; }
.semsig-dark .semsig-ground { mix-blend-mode: screen; }
.semsig-legend, .semsig-search input, .semsig-search ul, .semsig-search p {
  font: 13px/1.4 system-ui, sans-serif; color: var(--ink); background: var(--panel);
  border-radius: 5px; box-shadow: 0 1px 5px rgba(0, 0, 0, 0.4); box-sizing: border-box; }
/* Below search, light and dark, and zoom; above another legend, folded, and the scale. */
.semsig-legend {
  padding: 7px 10px; width: 290px; max-width: calc(100vw - 20px);
  max-height: calc(100dvh - 260px); overflow: auto; overflow-wrap: anywhere; }
.semsig-legend summary { font-weight: 600; font-size: 14px; cursor: pointer; }
.semsig-legend:not([open]) { width: auto; }
.semsig-legend p { margin: 6px 0; }
.semsig-legend small { color: var(--faint); }
.semsig-legend i {
  display: inline-block; box-sizing: border-box; width: 12px; height: 12px; margin-right: 5px;
  vertical-align: -1px; border: 1px solid #777; }
.semsig-legend i.round { border-radius: 50%; }
.semsig-legend i.ramp { display: block; width: 100%; height: 10px; margin: 2px 0; }
.semsig-legend .ends { display: flex; justify-content: space-between; }
.semsig-legend table, .semsig-details table { border-collapse: collapse; }
.semsig-legend td { padding: 0 12px 0 0; vertical-align: top; overflow-wrap: break-word; }
.semsig-legend td.title { overflow-wrap: anywhere; }
.semsig-legend td.title bdi, .semsig-details b {
  display: -webkit-box; -webkit-box-orient: vertical; -webkit-line-clamp: 4; overflow: hidden; }
.semsig-legend td:last-child { padding: 0; }
.semsig-legend td.count { text-align: right; }
.semsig-legend td.count, .semsig-legend td:has(i) { white-space: nowrap; }
.semsig-sign { width: 17px; height: 17px; vertical-align: -4px; overflow: visible; }
.semsig-sign path { stroke: var(--panel); stroke-width: 0.1; }
.semsig-details {
  font: 13px/1.4 system-ui, sans-serif; overflow-wrap: anywhere; max-width: calc(100vw - 64px); }
.semsig-details th {
  text-align: left; font-weight: 400; color: var(--faint); white-space: nowrap; }
.semsig-details th, .semsig-details td { vertical-align: top; padding: 2px 6px 2px 0; }
.semsig-details code { font-size: 14px; font-weight: 600; }
.semsig-fact {
  display: inline-block; vertical-align: top; max-height: 14em; overflow: auto; }
.semsig-wheels { display: flex; flex-wrap: wrap; justify-content: space-around; margin: 4px 0; }
.semsig-wheels figure { margin: 0; text-align: center; }
.semsig-wheels.small figure { flex: 1 1 96px; max-width: 130px; }
.semsig-wheels.large figure { flex: 1 1 140px; max-width: 160px; }
.semsig-wheels.large figure:only-child { max-width: 200px; }
.semsig-wheels figcaption { color: var(--faint); font-size: 12px; line-height: 1.2; }
.semsig-wheels svg { display: block; width: 100%; }
.semsig-wheels .ring { fill: none; stroke: var(--faint); stroke-width: 0.7; }
.semsig-wheels .ray { stroke: var(--faint); stroke-width: 0.7; }
.semsig-wheels .north { fill: var(--ink); }
.semsig-wheels text {
  font-family: system-ui, sans-serif; font-weight: 700; fill: var(--ink); text-anchor: middle; }
.leaflet-container .semsig-search { width: 230px; z-index: 810; }
.leaflet-container .leaflet-top { z-index: 1001; }
.semsig-search input { width: 100%; height: 34px; padding: 0 9px; border: 0; font-size: 14px; }
.semsig-search input::placeholder { color: var(--faint); opacity: 1; }
.semsig-search ul {
  position: absolute; z-index: 1; top: 100%; width: 100%; list-style: none; margin: 4px 0 0;
  padding: 4px; max-height: 50vh; overflow: auto; }
.semsig-search li {
  padding: 4px 6px; border-radius: 3px; cursor: pointer; overflow-wrap: anywhere;
  max-height: 5.6em; overflow: hidden; }
.semsig-search li[aria-selected=true] { background: var(--chosen); }
.semsig-search li small { display: block; color: var(--faint); }
.semsig-search p {
  position: absolute; z-index: 1; top: 100%; width: 100%; margin: 4px 0 0; padding: 6px 9px; }
.semsig-search [hidden] { display: none; }
.leaflet-tooltip.semsig-number {
  background: none; border: none; box-shadow: none; padding: 0; color: #222;
  font: 11px/1 system-ui, sans-serif; }
.semsig-close .leaflet-image-layer { image-rendering: pixelated; }
.leaflet-control-layers { font: 13px/1.5 system-ui, sans-serif; overflow-wrap: anywhere; }
.leaflet-control-layers-expanded { max-width: min(320px, calc(100vw - 20px)); }
.leaflet-control-layers label { max-height: 6em; overflow: hidden; }
.semsig-small .semsig-search { width: calc(100vw - 80px); max-width: 300px; }
.semsig-small .semsig-search input { height: 40px; font-size: 16px; }
/* A popup takes the whole width, and goes by a tap beside it. */
.semsig-small.semsig-told :is(.leaflet-top, .semsig-legend) { visibility: hidden; }
"""

SCRIPT = """\
const semsig = {
  // Fields that say what a thing is called; the search knows it by them, too.
  naming: new Set(["Class", "Class before", "Seen as", "Street object", "Identifier"]),
  points(fields, titles, records) {
    const group = L.featureGroup();
    const markers = [];
    for (const [place, colour, radius, found, name, values, label] of records) {
      const marker = L.circleMarker(place, {
        pane: "markerPane", radius: radius, color: "#222", weight: 1,
        fillColor: colour, fillOpacity: 0.95,
      });
      marker.bindPopup(() => semsig.details(name, fields, values, titles),
        {maxWidth: 340, minWidth: 220});
      if (label) {
        const text = L.DomUtil.create("b", "");
        text.textContent = label;
        const look = {permanent: true, direction: "center", className: "semsig-number"};
        marker.bindTooltip(text, look);
      }
      if (found !== null) {
        const look = {pane: "shadowPane", interactive: false, color: "#d55e00", weight: 2};
        const hint = L.layerGroup([
          L.polyline([place, found[0]], {...look, dashArray: "5 5"}),
          ...found.map((one, at) => L.circleMarker(one, {
            ...look, radius: at ? 5 : 8, weight: at ? 1 : 2, fill: false,
          })),
        ]);
        marker.on("popupopen", (event) => hint.addTo(event.popup._map));
        marker.on("popupclose", () => hint.remove());
      }
      marker.addTo(group);
      markers.push(marker);
    }
    const outline = () => group.setStyle({color: semsig.outline(group._map)});
    group.on("add", () => {
      group._map.on("semsig-colours", outline);
      outline();
    });
    group.on("remove", () => group._map.off("semsig-colours", outline));
    const named = [...fields.keys()].filter((at) => semsig.naming.has(fields[at]));
    const hint = (values) => [...new Set(named.map((at) => values[at]))].filter(Boolean).join(", ");
    let names = null;
    semsig.finders.push((words, limit) => {
      // What has a number is called by it alone, too.
      names = names || records.map(([, , , , name, values]) => semsig.plain(
        [name, /\\d[\\d,]*/.exec(name), ...named.map((at) => values[at])].join("\\n")));
      return semsig.matches(names, words, limit).map(({rank, at}) => ({
        rank,
        name: records[at][4],
        hint: hint(records[at][5]),
        show: (map) => {
          semsig.reveal(map, group, markers[at].getLatLng());
          markers[at].openPopup();
        },
      }));
    });
    return group;
  },
  lines(bundles) {
    return L.featureGroup(bundles.map(([look, lines]) => L.polyline(lines, {
      pane: "shadowPane", interactive: false, weight: 1, opacity: 0.6, ...look,
    })));
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
"""


def script_json(value: object) -> str:
    """Return a value as JSON that may stand in the script of a folium page.

    It is ASCII that no HTML parser takes for markup and no Jinja rendering changes. Numbers must be
    finite.
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    # Only a brace of text can be followed by one of these: JSON's own is by a quote or a "}".
    text = re.sub(r"\{(?=[{%#])", r"\\u007b", text)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text
