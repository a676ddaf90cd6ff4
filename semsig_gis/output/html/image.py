"""Images of the cells of a database for a web map, and arrays packed for its script."""

from __future__ import annotations

import base64
import json
import math
import re
import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pyproj import CRS, Transformer

from semsig_gis.core import across_180, cell_ids, to_degrees
from semsig_gis.output.layers.styles import SEEN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase


_BLOCKS = 2048  # most blocks of cells along a side of an image
_LATTICE = 64  # intervals along a side of a lattice


@dataclass(frozen=True, eq=False, kw_only=True)
class PlaceLattices:
    """Two lattices that convert places of a city to a web map and back.

    Interpolation between their points is exact to a centimetre in a city. ``metres`` (65, 65, 2;
    from south to north, west to east) holds x and y over ``mercator_box`` (Web Mercator),
    ``degrees`` latitude and longitude over ``metric_box``. Boxes are west, south, east, north.
    """

    metres: NDArray[np.float64]
    mercator_box: list[float]
    degrees: NDArray[np.float64]
    metric_box: list[float]


def place_lattices(database: SignatureDatabase) -> PlaceLattices:
    """Return lattices over all cells of a database."""
    step, origin = database.grid.step, np.array(database.grid.origin)
    low = origin + step * np.array([database.columns.min(), database.rows.min()])
    high = origin + step * np.array([database.columns.max() + 1.0, database.rows.max() + 1.0])
    metres, mercator_box = _mercator_lattice(database, low, high)
    sides = np.linspace(low, high, _LATTICE + 1)
    corners = np.meshgrid(sides[:, 0], sides[:, 1])
    longitude, latitude = to_degrees(database.crs).transform(*corners)
    return PlaceLattices(
        metres=np.moveaxis(metres, 0, 2),
        mercator_box=mercator_box,
        degrees=np.stack([latitude, across_180(longitude, database.crs)], axis=2),
        metric_box=[*low.tolist(), *high.tolist()],
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class CellPixels:
    """Pixels of the cells of a database in an image for a web map.

    Rows and columns are even steps of Web Mercator. ``blocks`` (height, width) holds the block
    number of each pixel, or the number of blocks where there is none; ``members`` (n,) the block of
    each cell. A block is one cell, or several in a city wider than 2048 cells. ``corners`` are
    south-west and north-east, latitude and longitude.
    """

    blocks: NDArray[np.int32]
    members: NDArray[np.int64]
    corners: list[list[float]]

    @classmethod
    def of(cls, database: SignatureDatabase) -> CellPixels:
        """Return the pixels of the cells of a database."""
        columns, rows = database.columns.astype(np.int64), database.rows.astype(np.int64)
        cells = max(int(np.ptp(columns)), int(np.ptp(rows))) + 1
        block = math.ceil(cells / _BLOCKS)
        columns, rows = columns // block, rows // block
        blocks, members = np.unique(cell_ids(columns, rows), return_inverse=True)
        side = database.grid.step * block
        origin = np.array(database.grid.origin)
        low = origin + side * np.array([columns.min(), rows.min()])
        high = origin + side * np.array([columns.max() + 1, rows.max() + 1])
        # At least two pixels a block, because the grid is slightly rotated against the pixels.
        zoom = max(2, min(4, _BLOCKS // (cells // block)))
        width, height = (np.rint((high - low) / side).astype(int) * zoom).tolist()
        lattice, (west, south, east, north) = _mercator_lattice(database, low, high)
        across = lattice[:, ::-1] @ _between(width).T
        pixels = np.empty((height, width), np.int32)
        # One row of pixels at a time: their places in the CRS, then the blocks around these places.
        for line, weights in enumerate(_between(height)):
            ids = cell_ids(*np.floor((weights @ across - origin[:, None]) / side).astype(np.int64))
            nearest = np.minimum(np.searchsorted(blocks, ids), len(blocks) - 1)
            pixels[line] = np.where(blocks[nearest] == ids, nearest, len(blocks))
        longitudes, latitudes = to_degrees(CRS(3857)).transform([west, east], [south, north])
        corners = np.stack([latitudes, across_180(longitudes, database.crs)], axis=1)
        return cls(blocks=pixels, members=members, corners=corners.tolist())

    def image(
        self, values: NDArray[np.uint8], colours: Sequence[str], *, effort: int = 9
    ) -> tuple[bytes, list[list[float]]]:
        """Return a PNG of a value of each block, and its corners; 0 is clear, 1 the first colour.

        ``effort`` is the compression level, 1 to 9.
        """
        return _png(np.append(values, np.uint8(0))[self.blocks], colours, effort), self.corners

    def levels(self, levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the highest level of the cells of each block."""
        values = np.zeros(int(self.members.max()) + 1, np.uint8)
        np.maximum.at(values, self.members, levels)
        return values


def city_image(database: SignatureDatabase) -> tuple[bytes, list[list[float]]]:
    """Return a PNG of the number of objects seen from each cell, and its corners.

    A block of several cells gets their mean (see `CellPixels`).
    """
    pixels = CellPixels.of(database)
    means = np.bincount(pixels.members, weights=database.lengths) / np.bincount(pixels.members)
    return pixels.image(SEEN.levels(means), SEEN.colours)


def level_image(
    database: SignatureDatabase, levels: NDArray[np.uint8], colours: Sequence[str]
) -> tuple[bytes, list[list[float]]]:
    """Return a PNG of a level of each cell, and its corners.

    Levels count from 1 into ``colours``; 0 is clear. A block gets the highest level of its cells.
    """
    pixels = CellPixels.of(database)
    return pixels.image(pixels.levels(levels), colours)


def _mercator_lattice(
    database: SignatureDatabase, low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[float]]:
    """Return x and y on a lattice over an area in Web Mercator, from the south, and its box."""
    to_mercator = Transformer.from_crs(database.crs, "EPSG:3857", always_xy=True)
    sides = np.linspace(low, high, _LATTICE + 1)
    x, y = to_mercator.transform(*np.meshgrid(sides[:, 0], sides[:, 1]))
    x = across_180(x, database.crs, turn=MERCATOR_TURN)
    west, south, east, north = float(x.min()), float(y.min()), float(x.max()), float(y.max())
    lattice = np.meshgrid(
        np.linspace(west, east, _LATTICE + 1), np.linspace(south, north, _LATTICE + 1)
    )
    metres = np.stack(to_mercator.transform(*lattice, direction="INVERSE"))
    return metres, [west, south, east, north]


def mercator_places(
    database: SignatureDatabase,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    shape: tuple[int, int],
) -> tuple[NDArray[np.float64], list[float]]:
    """Return places in the CRS of a database that are evenly spaced in Web Mercator, and their box.

    They are the centres of `shape` rows and columns over an area, from north to south, as an array
    of shape (rows, columns, 2).
    """
    lattice, box = _mercator_lattice(database, low, high)
    rows, columns = shape
    places = _between(rows) @ lattice @ _between(columns).T
    return np.moveaxis(places[:, ::-1], 0, 2), box


def _between(pixels: int) -> NDArray[np.float64]:
    """Return the weights that interpolate a lattice at pixel centres, shape (pixels, 65)."""
    places = (np.arange(pixels) + 0.5) * (_LATTICE / pixels)
    weights: NDArray[np.float64] = 1.0 - np.abs(places[:, None] - np.arange(_LATTICE + 1))
    return np.maximum(weights, 0.0)


def _png(pixels: NDArray[np.uint8], colours: Sequence[str], effort: int) -> bytes:
    """Return a PNG with a palette: 0 is transparent, 1 the first colour, and so on."""
    height, width = pixels.shape
    # As few bits a pixel as the colours need, which is faster to pack and to unpack.
    bits = next(bits for bits in (1, 2, 4, 8) if len(colours) < 1 << bits)
    each = 8 // bits
    # A byte holds several pixels, the first in the highest bits; a row begins with its filter, 0.
    joined = np.zeros((height, 1 + -(-width // each)), np.uint8)
    for part in range(each):
        column = pixels[:, part::each]
        joined[:, 1 : column.shape[1] + 1] |= column << np.uint8(8 - bits * (part + 1))
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, bits, 3, 0, 0, 0)),
        (b"PLTE", bytes(3) + b"".join(bytes.fromhex(colour[1:]) for colour in colours)),
        (b"tRNS", b"\0"),
        (b"IDAT", zlib.compress(joined.tobytes(), effort)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


QUANTUM_M = 0.25  # step of coordinates in the page, in metres of Web Mercator
MERCATOR_TURN = 2.0 * math.pi * 6_378_137.0  # width of Web Mercator in metres


def script_json(value: object) -> str:
    """Return a value as JSON for the script of a folium page; its numbers must be finite.

    The text is ASCII without HTML markup and without anything that Jinja would replace.
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    # A brace of JSON itself is followed by a quote or a "}", so these braces are inside texts.
    text = re.sub(r"\{(?=[{%#])", r"\\u007b", text)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def packed(values: NDArray[Any] | Sequence[object]) -> list[str]:
    """Return an array of u1, u2, i4 or f8, or a list as JSON, packed for `semsig.arrays`."""
    if not isinstance(values, np.ndarray):
        return ["json", _base64(json.dumps(values).encode())]
    kind = values.dtype.newbyteorder("<")
    text = _base64(np.ascontiguousarray(values, kind).tobytes())
    return [f"{kind.kind}{kind.itemsize}", text]


def steps(values: NDArray[np.int32]) -> list[str]:
    """Return integers as differences, packed by byte plane for `semsig.arrays`."""
    change = np.diff(values.astype("<i4"), prepend=np.int32(0))
    return ["steps", _base64(change.view(np.uint8).reshape(-1, 4).T.tobytes())]


def mercator(xy: NDArray[np.float64], crs: CRS) -> tuple[NDArray[np.int32], dict[str, Any]]:
    """Return places in steps of `QUANTUM_M`, shape (n, 2), and settings to convert them back."""
    to_mercator = Transformer.from_crs(crs, "EPSG:3857", always_xy=True)
    x, y = to_mercator.transform(xy[:, 0], xy[:, 1])
    metres = np.stack([across_180(x, crs, turn=MERCATOR_TURN), y], axis=1)
    origin = metres.min(axis=0)
    places = np.rint((metres - origin) / QUANTUM_M).astype(np.int32)
    return places, {"origin": origin.tolist(), "quantum": QUANTUM_M}


def _base64(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content)).decode("ascii")
