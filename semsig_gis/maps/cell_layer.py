"""A layer of a map of which a click on any cell tells what is known of it.

Hundreds of thousands of cells have their numbers in the page: packed arrays, which the script
unpacks once. Nothing is drawn of them but what a click asks for; images show the rest. What is
told of a cell comes from parts (`CellFacts`), each with arrays and a function of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from branca.element import Element
from folium.map import Layer
from folium.template import Template

from semsig_gis.core.errors import InputError
from semsig_gis.maps.image import place_lattices
from semsig_gis.maps.map_page import script_json
from semsig_gis.maps.packing import packed, steps
from semsig_gis.maps.parts import Furniture, class_titles, to_latlon

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from branca.element import Figure
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase

SCRIPT = """\
// A place in a box, by the values at the crossings of a lattice over it.
semsig.between = (lattice, [west, south, east, north], x, y) => {
  const lines = Math.sqrt(lattice.length / 2) - 1;
  const [[column, right], [row, up]] = [[x, west, east], [y, south, north]].map(
    ([value, low, high]) => {
      const place = Math.min(Math.max((value - low) / (high - low), 0), 1) * lines;
      const line = Math.min(Math.floor(place), lines - 1);
      return [line, place - line];
    });
  return [0, 1].map((part) => {
    const value = (across, along) =>
      lattice[2 * ((row + along) * (lines + 1) + column + across) + part];
    const [low, high] = [0, 1].map(
      (along) => value(0, along) * (1 - right) + value(1, along) * right);
    return low * (1 - up) + high * up;
  });
};
// The cells of a page, by their row numbers.
semsig.City = class {
  constructor(data, grid) {
    Object.assign(this, {data, grid, count: data.rows.length});
  }
  static firstOf(low, high, wanted) {
    while (low < high) {
      const middle = (low + high) >> 1;
      if (wanted(middle)) high = middle; else low = middle + 1;
    }
    return low;
  }
  placeOf(cell) {
    const ends = this.data.columnEnds;
    return [semsig.City.firstOf(0, ends.length, (one) => ends[one] > cell), this.data.rows[cell]];
  }
  cellAt(column, row) {
    const {columnEnds: ends, rows} = this.data;
    if (column < 0 || column >= ends.length) return -1;
    const cell = semsig.City.firstOf(
      column > 0 ? ends[column - 1] : 0, ends[column], (one) => rows[one] >= row);
    return cell < ends[column] && rows[cell] === row ? cell : -1;
  }
  latlng(column, row) {
    const {step, origin, firstColumn, box} = this.grid;
    return semsig.between(
      this.data.degrees, box, origin[0] + step * (firstColumn + column), origin[1] + step * row);
  }
  middle(cell) {
    return this.latlng(...this.placeOf(cell).map((corner) => corner + 0.5));
  }
  id(cell) {
    const [column, row] = this.placeOf(cell);
    return String(BigInt(this.grid.firstColumn + column) * 100000000n + BigInt(row));
  }
  nearest(map, clicked) {
    const {step, origin, firstColumn, mercatorBox} = this.grid;
    const point = L.CRS.EPSG3857.project(clicked);
    const [x, y] = semsig.between(this.data.metres, mercatorBox, point.x, point.y);
    const column = Math.floor((x - origin[0]) / step) - firstColumn;
    const row = Math.floor((y - origin[1]) / step);
    // From afar a cell is smaller than a finger.
    const beside = map.containerPointToLatLng(map.latLngToContainerPoint(clicked).add([8, 0]));
    const reach = Math.min(Math.floor(map.distance(clicked, beside) / step), 20);
    let [best, least] = [-1, Infinity];
    for (let across = -reach; across <= reach; across += 1) {
      for (let along = -reach; along <= reach; along += 1) {
        const away = across * across + along * along;
        const cell = away < least ? this.cellAt(column + across, row + along) : -1;
        if (cell >= 0) [best, least] = [cell, away];
      }
    }
    return best;
  }
  metres(cell, other) {
    const [[x, y], [u, v]] = [this.placeOf(cell), this.placeOf(other)];
    return this.grid.step * Math.hypot(u - x, v - y);
  }
  far(cell, other) {
    const metres = this.metres(cell, other);
    return metres < 1000 ? Math.round(metres) + " m" : (metres / 1000).toFixed(1) + " km";
  }
  // Eighths of a turn, clockwise from north.
  eighth(cell, other) {
    const [[x, y], [u, v]] = [this.placeOf(cell), this.placeOf(other)];
    return Math.round(Math.atan2(u - x, v - y) / Math.PI * 4 + 8) % 8;
  }
  part(name, cell) {
    const ends = this.data[name + ".ends"];
    return [cell > 0 ? ends[cell - 1] : 0, ends[cell]];
  }
  types(name, cell) {
    return String.fromCharCode(
      ...this.data[name + ".types"].subarray(...this.part(name, cell)));
  }
  signature(name, cell) {
    const levels = this.data[name + ".levels"].subarray(...this.part(name, cell));
    const degrees = 360 / this.grid.levels;
    return [this.types(name, cell),
      Array.from(levels, (level) => Math.floor((level + 0.5) * degrees))];
  }
};
semsig.told = {};
semsig.cells = (packed, grid, titles, told) => {
  const group = L.layerGroup();
  const ready = semsig.arrays(packed).then((data) => new semsig.City(data, grid));
  const buttons = (city, map, cell, box, jumps) => {
    // Below the title, so that they are in sight however much there is to tell.
    const lines = jumps.map(([label, goals]) => {
      const line = L.DomUtil.create("div", "semsig-jumps");
      if (label) semsig.text(line, "span", label);
      for (const [text, other, title] of goals) {
        const button = L.DomUtil.create("button", "", line);
        button.textContent = text;
        button.title = title;
        button.setAttribute("aria-label", title === "near" ? text : title);
        L.DomEvent.on(button, "click", () => {
          // The map moves, so that the next click finds the button where it was.
          const [from, to] = [cell, other].map(
            (one) => map.latLngToContainerPoint(city.middle(one)));
          map.panBy(to.subtract(from), {animate: false});
          const at = [...box.querySelectorAll("button")].indexOf(button);
          show(city, map, other).querySelectorAll("button")[at]?.focus();
        });
      }
      return line;
    });
    box.firstChild.after(...lines);
  };
  const show = (city, map, cell) => {
    map.closePopup();
    const drawn = L.layerGroup();
    const [column, row] = city.placeOf(cell);
    const middle = city.middle(cell);
    const look = {pane: "shadowPane", interactive: false, color: "#d55e00", weight: 3};
    const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(
      ([across, along]) => city.latlng(column + across, row + along));
    drawn.addLayer(L.polygon(corners, {...look, fill: false}));
    const parts = told.map((name) => ({
      rows: [], jumps: [], marks: [], dots: [], ...semsig.told[name](city, cell)}));
    const sign = (other, options) => {
      const marker = L.circleMarker(city.middle(other), {
        pane: "markerPane", color: semsig.outline(map), weight: 1, fillOpacity: 0.95,
        bubblingMouseEvents: false, ...options,
      });
      marker.on("click", () => show(city, map, other));
      return drawn.addLayer(marker), marker;
    };
    for (const [other, colour] of parts.flatMap((part) => part.dots)) {
      sign(other, {radius: 4, fillColor: colour});
    }
    parts.flatMap((part) => part.marks).forEach((other, at) => {
      drawn.addLayer(
        L.polyline([middle, city.middle(other)], {...look, weight: 2, dashArray: "5 5"}));
      const text = L.DomUtil.create("b", "");
      text.textContent = at + 1;
      const label = {permanent: true, direction: "center", className: "semsig-number"};
      sign(other, {radius: 9, fillColor: "#fff"}).bindTooltip(text, label);
    });
    // The page has the level of a bearing, whose middle is told.
    const half = "\u00b1" + Math.round(180 / grid.levels) + "\u00b0, middles of levels";
    const rows = [
      ...parts.flatMap((part) => part.rows), ["Cell", city.id(cell)], ["Bearings", half]];
    const title = parts.map((part) => part.title).filter(Boolean).pop();
    const box = semsig.details(
      title, rows.map((one) => one[0]), rows.map((one) => one[1]), titles);
    buttons(city, map, cell, box, parts.flatMap((part) => part.jumps));
    const narrow = Math.min(340, map.getSize().x - 70);
    const popup = L.popup({maxWidth: narrow, minWidth: 220});
    popup.setLatLng(middle).setContent(box);
    popup.on("remove", () => group.removeLayer(drawn));
    group.addLayer(drawn);
    popup.openOn(map);
    return box;
  };
  const click = async (event) => {
    const map = event.target;
    const city = await ready;
    const cell = city.nearest(map, event.latlng);
    if (cell >= 0) show(city, map, cell);
  };
  group.onAdd = (map) => {
    L.LayerGroup.prototype.onAdd.call(group, map);
    map.on("click", click);
    map.getContainer().classList.add("semsig-cells");
  };
  group.onRemove = (map) => {
    map.off("click", click);
    map.closePopup();
    map.getContainer().classList.remove("semsig-cells");
    L.LayerGroup.prototype.onRemove.call(group, map);
  };
  return group;
};
"""
STYLE = """\
.semsig-legend td + td { overflow-wrap: normal; }
.semsig-cells.leaflet-grab { cursor: pointer; }
.semsig-jumps { margin-top: 5px; }
.semsig-jumps span { margin-right: 4px; }
.semsig-jumps button {
  font: inherit; color: inherit; background: transparent; border: 1px solid #888;
  border-radius: 4px; padding: 2px 8px; margin: 1px 4px 2px 0; cursor: pointer;
  min-width: 28px; min-height: 26px; }
@media (pointer: coarse) { .semsig-jumps button { min-width: 40px; min-height: 36px; } }
.semsig-jumps button:hover, .semsig-jumps button:focus-visible { background: #8883; }
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class CellFacts:
    """A part of what a click on a cell tells, with numbers and a JavaScript function of its own.

    ``script`` defines the function ``semsig.told.NAME(city, cell)``, where NAME is ``name``. It
    returns what there is of ``title``; ``rows``: label and value each, as `semsig.details` shows
    them; ``jumps``: a label and buttons, each with a text, a cell and a hint; ``marks``: cells to
    number and to join by lines; ``dots``: cells and colours. ``arrays`` are packed numbers of the
    cells (see `maps.packing`); ``settings`` reach the function in ``city.grid``.
    """

    name: str
    script: str
    arrays: Mapping[str, list[str]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)


class CellLayer(Furniture, Layer):
    """What is known of the cells, told by a click."""

    _template = Template(
        """
        {% macro script(this, kwargs) %}
        var {{ this.get_name() }} = semsig.cells({{ this.arguments }});
        {% endmacro %}
        """
    )

    def __init__(self, name: str, database: SignatureDatabase, facts: Sequence[CellFacts]) -> None:
        super().__init__(name=name, overlay=True, show=True)
        self._name = "SemsigCells"
        self.facts = facts
        arrays, grid = _cells(database)
        for part in facts:
            arrays |= part.arrays
            grid |= part.settings
        told = [part.name for part in facts]
        self.arguments = ", ".join(map(script_json, (arrays, grid, class_titles(database), told)))

    def render(self, **kwargs: Any) -> Any:  # noqa: ANN401 - as branca has it
        """Put the scripts into the page, then the layer."""
        rendered = super().render(**kwargs)
        figure = cast("Figure", self.get_root())
        page = f"<style>{STYLE}</style>\n<script>{SCRIPT}</script>"
        figure.header.add_child(Element(page), name="semsig_cells")
        for part in self.facts:
            own = Element(f"<script>{part.script}</script>")
            figure.header.add_child(own, name=f"semsig_cells_{part.name}")
        return rendered


def city_view(database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the latitudes and longitudes of the corners of all cells."""
    if len(database) == 0:
        msg = "the database has no cells to show; give one with at least one cell."
        raise InputError(msg)
    corners = np.stack([database.xy.min(axis=0), database.xy.max(axis=0)])
    return to_latlon(corners, database.crs)


def packed_signatures(
    name: str, database: SignatureDatabase, ends: NDArray[np.int64]
) -> dict[str, list[str]]:
    """Return signatures, with angle levels for bearings, and where those of each cell end."""
    return {
        f"{name}.types": packed(database.taxonomy.symbol_bytes[database.codes]),
        f"{name}.ends": steps(ends.astype(np.int32)),
        f"{name}.levels": packed(database.levels),
    }


def _cells(database: SignatureDatabase) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return where the cells are, and how to read it."""
    lattices = place_lattices(database)
    columns = database.columns - database.columns[0]
    arrays = {
        "rows": steps(database.rows),
        "columnEnds": steps(np.cumsum(np.bincount(columns)).astype(np.int32)),
        "metres": packed(lattices.metres),
        "degrees": packed(lattices.degrees),
    }
    grid = {
        "levels": database.spec.levels,
        "step": database.grid.step,
        "origin": list(database.grid.origin),
        "firstColumn": int(database.columns[0]),
        "mercatorBox": lattices.mercator_box,
        "box": lattices.metric_box,
    }
    return arrays, grid
