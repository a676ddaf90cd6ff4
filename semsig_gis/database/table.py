"""The cells of a database as a table: what each of them sees, in columns that people read."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import shapely

from semsig_gis.core import BEARING_UNITS, DISTANCE_UNITS, LICENSES, UnknownNameError, nearest_name

if TYPE_CHECKING:
    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase

CellGeometry = Literal["polygon", "point"]
ROWS_A_BLOCK = 1 << 16


class CellTable:
    """The columns and the geometry of the cells, of which some rows at a time are made."""

    def __init__(self, database: SignatureDatabase, *, geometry: CellGeometry = "polygon") -> None:
        if geometry not in get_args(CellGeometry):
            names = " or ".join(repr(name) for name in get_args(CellGeometry))
            hint = nearest_name(str(geometry), get_args(CellGeometry))
            raise UnknownNameError(f"{geometry!r} is not a way to draw a cell; give {names}{hint}.")
        self._database, self._geometry = database, geometry
        self._symbols = pa.array([chr(symbol) for symbol in database.taxonomy.symbol_bytes])
        degrees = (unit * 360 / BEARING_UNITS for unit in range(BEARING_UNITS))
        self._degrees = pa.array([f"{bearing:.2f}" for bearing in degrees])
        self._levels = pa.array([str(level) for level in range(1 << 8)])
        distances = database.reach * np.arange(DISTANCE_UNITS + 1) / DISTANCE_UNITS
        decimals = max(2, math.ceil(-math.log10(distances[1])))  # which tell each from the next
        self._metres = pa.array([f"{distance:.{decimals}f}" for distance in distances.tolist()])
        self._groups = {
            "type_group_size": database.type_group_sizes,
            "angle_group_size": database.angle_group_sizes,
        }

    def columns(self, rows: slice) -> dict[str, Any]:
        """Return the columns of some rows by name, as NumPy or Arrow arrays."""
        database = self._database
        places = database.xy[rows]
        offsets = database.offsets[rows.start : rows.stop + 1]
        return {
            "cell_id": database.cell_ids[rows],
            "x": np.ascontiguousarray(places[:, 0]),
            "y": np.ascontiguousarray(places[:, 1]),
            "length": database.lengths[rows].astype(np.int32),
            "types": _joined(database.codes, offsets, texts=self._symbols, separator=""),
            "bearings": _joined(database.bearing_units, offsets, texts=self._degrees),
            "levels": _joined(database.levels, offsets, texts=self._levels),
            "distances": _joined(database.distance_units, offsets, texts=self._metres),
            **{name: sizes[rows] for name, sizes in self._groups.items()},
        }

    def shapes(self, rows: slice) -> NDArray[np.object_]:
        """Return the viewpoints or the squares; neighbours share their corners to the last bit."""
        database = self._database
        if self._geometry == "point":
            return np.asarray(shapely.points(database.xy[rows]))
        step, (west, south) = database.grid.step, database.grid.origin
        columns, lines = database.columns[rows], database.rows[rows]
        left, right = west + columns * step, west + (columns + 1) * step
        bottom, top = south + lines * step, south + (lines + 1) * step
        return np.asarray(shapely.box(left, bottom, right, top))

    def frame(self) -> gpd.GeoDataFrame:
        """Return all cells, with whom to name for them in ``attrs``."""
        import geopandas as gpd  # noqa: PLC0415 - it loads slowly

        database, size = self._database, len(self._database)
        starts = range(0, max(size, 1), ROWS_A_BLOCK)
        blocks = [slice(start, min(start + ROWS_A_BLOCK, size)) for start in starts]
        table = pa.concat_tables([pa.table(self.columns(rows)) for rows in blocks])
        shapes = np.concatenate([self.shapes(rows) for rows in blocks])
        frame = gpd.GeoDataFrame(table.to_pandas(), geometry=shapes, crs=database.crs)
        frame.attrs[LICENSES] = list(database.licenses)
        return frame


def _joined(
    values: NDArray[Any], offsets: NDArray[np.int64], *, texts: pa.Array, separator: str = " "
) -> pa.Array:
    """Return the values of each cell as one text; `texts` holds every possible value as text."""
    entries = pa.array(values[offsets[0] : offsets[-1]])
    # From 0, and small enough for Arrow's 32-bit lists: a block has few cells.
    starts = pa.array((offsets - offsets[0]).astype(np.int32))
    lists = pa.ListArray.from_arrays(starts, texts.take(entries))
    return pc.binary_join(lists, separator)
