"""A layer of a map of which a click on any cell tells what is known of it.

Hundreds of thousands of cells have their numbers in the page: packed arrays, which the script
unpacks once. Nothing is drawn of them but what a click asks for; an image shows the rest.
"""

from __future__ import annotations

import base64
import zlib
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from branca.element import Element
from folium.map import Layer
from folium.template import Template

from semsig_gis._map_parts import Furniture, class_titles
from semsig_gis.map_image import place_lattices
from semsig_gis.map_page import script_json

if TYPE_CHECKING:
    from branca.element import Figure
    from numpy.typing import NDArray

    from semsig_gis.identifiability import Identifiability

__all__ = ["CellLayer"]

CHANCES = 250  # steps of a chance in a byte
BITS = 8  # steps of a bit
HELPERS = 2  # classes that are named

SCRIPT = """\
semsig.unpacked = async (packed) => {
  const kinds = {u1: Uint8Array, i4: Int32Array, f8: Float64Array};
  const arrays = {};
  for (const [name, [kind, text]] of Object.entries(packed)) {
    const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    arrays[name] = new kinds[kind](await new Response(stream).arrayBuffer());
  }
  for (const name of ["rows", "columnEnds", "typeEnds"]) {
    const steps = arrays[name];
    for (let at = 1; at < steps.length; at += 1) steps[at] += steps[at - 1];
  }
  return arrays;
};
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
semsig.cells = (packed, grid, titles) => {
  const {step, origin, firstColumn, radius} = grid;
  const group = L.layerGroup();
  const ready = semsig.unpacked(packed);
  const firstOf = (low, high, wanted) => {
    while (low < high) {
      const middle = (low + high) >> 1;
      if (wanted(middle)) high = middle; else low = middle + 1;
    }
    return low;
  };
  const placeOf = (data, cell) =>
    [firstOf(0, data.columnEnds.length, (one) => data.columnEnds[one] > cell), data.rows[cell]];
  const cellAt = (data, column, row) => {
    if (column < 0 || column >= data.columnEnds.length) return -1;
    const high = data.columnEnds[column];
    const low = column > 0 ? data.columnEnds[column - 1] : 0;
    const cell = firstOf(low, high, (one) => data.rows[one] >= row);
    return cell < high && data.rows[cell] === row ? cell : -1;
  };
  const latlng = (data, column, row) => semsig.between(data.degrees, grid.metres,
    origin[0] + step * (firstColumn + column), origin[1] + step * row);
  const nearest = (data, map, clicked) => {
    const point = L.CRS.EPSG3857.project(clicked);
    const [x, y] = semsig.between(data.metres, grid.mercator, point.x, point.y);
    const column = Math.floor((x - origin[0]) / step) - firstColumn;
    const row = Math.floor((y - origin[1]) / step);
    // From afar a cell is smaller than a finger.
    const beside = map.containerPointToLatLng(map.latLngToContainerPoint(clicked).add([8, 0]));
    const reach = Math.min(Math.floor(map.distance(clicked, beside) / step), 20);
    let [best, least] = [-1, Infinity];
    for (let across = -reach; across <= reach; across += 1) {
      for (let along = -reach; along <= reach; along += 1) {
        const away = across * across + along * along;
        const cell = away < least ? cellAt(data, column + across, row + along) : -1;
        if (cell >= 0) [best, least] = [cell, away];
      }
    }
    return best;
  };
  const types = (data, cell) => String.fromCharCode(
    ...data.types.subarray(cell > 0 ? data.typeEnds[cell - 1] : 0, data.typeEnds[cell]));
  const percent = (steps) => {
    const value = 100 * steps / grid.chances;
    return value < 1 ? "below 1 %" : value > 99 ? "above 99 %" : Math.round(value) + " %";
  };
  const others = (data, cell) => {
    const [column, row] = placeOf(data, cell);
    const found = [];
    for (let at = cell * grid.places; at < (cell + 1) * grid.places; at += 1) {
      const other = data.lookalikes[at];
      if (other < 0) continue;
      const [across, along] = placeOf(data, other);
      const metres = step * Math.hypot(across - column, along - row);
      const turn = Math.round(Math.atan2(across - column, along - row) / Math.PI * 4 + 8) % 8;
      const seen = types(data, other);
      found.push({
        cell: other,
        place: latlng(data, across + 0.5, along + 0.5),
        text: percent(data.lookalikeChances[at]) + ": "
          + (metres < 1000 ? Math.round(metres) + " m" : (metres / 1000).toFixed(1) + " km")
          + " to the " + ["north", "north-east", "east", "south-east", "south", "south-west",
            "west", "north-west"][turn]
          + ", sees " + (seen.length > 16 ? seen.slice(0, 16) + "\\u2026" : seen),
      });
    }
    return found;
  };
  const details = (data, cell, alike) => {
    const [column, row] = placeOf(data, cell);
    const bits = data.bits[cell] / grid.bits;
    const facts = [
      ["It sees", [types(data, cell), null]],
      ["Found within " + radius + " m", percent(data.found[cell])],
      ["Chance given", percent(data.itself[cell]) + " to this cell, " + percent(data.near[cell])
        + " to all within " + radius + " m"],
      ["Looks like", "about " + Number((2 ** bits).toPrecision(2)).toLocaleString("en")
        + " cells (" + bits.toFixed(1) + " bits are left)"],
      ...alike.map((one, at) => ["Taken for " + (at + 1), one.text]),
    ];
    const helpers = [];
    for (let at = cell * grid.helpers; at < (cell + 1) * grid.helpers; at += 1) {
      const gain = 100 * data.gains[at] / grid.chances;
      if (gain >= 1) helpers.push(grid.classes[data.helpers[at]] + " +" + Math.round(gain) + " %");
    }
    if (helpers.length) facts.push(["Helped by", helpers.join(", ")]);
    facts.push(["Cell", String(BigInt(firstColumn + column) * 100000000n + BigInt(row))]);
    return semsig.details("A query from here", facts.map((one) => one[0]),
      facts.map((one) => one[1]), titles);
  };
  const show = (data, map, cell) => {
    map.closePopup();
    const drawn = L.layerGroup();
    const [column, row] = placeOf(data, cell);
    const middle = latlng(data, column + 0.5, row + 0.5);
    const look = {pane: "shadowPane", interactive: false, color: "#d55e00", weight: 3};
    const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(
      ([across, along]) => latlng(data, column + across, row + along));
    drawn.addLayer(L.polygon(corners, {...look, fill: false}));
    const alike = others(data, cell);
    alike.forEach((one, at) => {
      drawn.addLayer(L.polyline([middle, one.place], {...look, weight: 2, dashArray: "5 5"}));
      const marker = L.circleMarker(one.place, {
        pane: "markerPane", radius: 9, color: "#222", weight: 1, fillColor: "#fff",
        fillOpacity: 0.95, bubblingMouseEvents: false,
      });
      const text = L.DomUtil.create("b", "");
      text.textContent = at + 1;
      const label = {permanent: true, direction: "center", className: "semsig-number"};
      marker.bindTooltip(text, label);
      marker.on("click", () => show(data, map, one.cell));
      drawn.addLayer(marker);
    });
    const popup = L.popup({maxWidth: 340, minWidth: 220, maxHeight: 400});
    popup.setLatLng(middle).setContent(details(data, cell, alike));
    popup.on("remove", () => group.removeLayer(drawn));
    group.addLayer(drawn);
    popup.openOn(map);
  };
  const click = async (event) => {
    const map = event.target;
    const data = await ready;
    const cell = nearest(data, map, event.latlng);
    if (cell >= 0) show(data, map, cell);
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
STYLE = ".semsig-cells.leaflet-grab { cursor: pointer; }\n"


class CellLayer(Furniture, Layer):
    """What is known of the cells before any query, told by a click."""

    _template = Template(
        """
        {% macro script(this, kwargs) %}
        var {{ this.get_name() }} = semsig.cells({{ this.arguments }});
        {% endmacro %}
        """
    )

    def __init__(self, name: str, told: Identifiability) -> None:
        super().__init__(name=name, overlay=True, show=True)
        self._name = "SemsigCells"
        packed, grid = _packed(told)
        titles = class_titles(told.database)
        self.arguments = ", ".join(map(script_json, (packed, grid, titles)))

    def render(self, **kwargs: Any) -> Any:  # noqa: ANN401 - as branca has it
        """Put the script into the page, then the layer."""
        rendered = super().render(**kwargs)
        figure = cast("Figure", self.get_root())
        page = f"<style>{STYLE}</style>\n<script>{SCRIPT}</script>"
        figure.header.add_child(Element(page), name="semsig_cells")
        return rendered


def _packed(told: Identifiability) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the numbers of all cells, and how to read them."""
    database = told.database
    columns = database.columns.astype(np.int64)
    lattices = place_lattices(database)
    # The classes that a cell gains most by, best first.
    count = min(HELPERS, told.gains.shape[1])
    helpers = np.argsort(-told.gains, axis=1, kind="stable")[:, :count]
    arrays: dict[str, NDArray[Any]] = {
        "rows": _steps(database.rows),
        "columnEnds": np.bincount(columns - columns[0]).astype(np.int32),
        "types": database.taxonomy.symbol_bytes[database.codes],
        "typeEnds": database.lengths.astype(np.int32),
        "found": _chance_bytes(told.found),
        "near": _chance_bytes(told.near),
        "itself": _chance_bytes(told.itself),
        "bits": np.rint(told.bits * BITS).clip(0, 255).astype(np.uint8),
        "lookalikes": told.lookalikes.astype(np.int32),
        "lookalikeChances": _chance_bytes(told.lookalike_chances),
        "helpers": helpers.astype(np.uint8),
        "gains": _chance_bytes(np.take_along_axis(told.gains, helpers, axis=1)),
        "metres": lattices.metres,
        "degrees": lattices.degrees,
    }
    titles = {item.code: item.title for item in database.taxonomy.classes}
    grid = {
        "step": database.grid.step,
        "origin": list(database.grid.origin),
        "firstColumn": int(columns[0]),
        "radius": told.radius,
        "places": told.lookalikes.shape[1],
        "helpers": count,
        "chances": CHANCES,
        "bits": BITS,
        "classes": [titles[item.code] for item in told.classes],
        "mercator": lattices.mercator_box,
        "metres": lattices.metric_box,
    }
    return {name: _text(array) for name, array in arrays.items()}, grid


def _steps(values: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return each value less the one before: far smaller once it is compressed."""
    return np.diff(values, prepend=np.int32(0))


def _chance_bytes(chances: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(chances * CHANCES).clip(0, CHANCES).astype(np.uint8)


def _text(array: NDArray[Any]) -> list[str]:
    """Return the kind of an array and its compressed bytes as text."""
    kind = array.dtype.newbyteorder("<")
    data = zlib.compress(np.ascontiguousarray(array, dtype=kind).tobytes(), 9)
    return [f"{array.dtype.kind}{array.dtype.itemsize}", base64.b64encode(data).decode("ascii")]
