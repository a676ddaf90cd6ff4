"""The cells of a database as a small picture that lies right on a web map."""

from __future__ import annotations

import math
import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np
from pyproj import Transformer

from semsig_gis.grid import cell_ids

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase

__all__ = ["city_image", "level_image"]

_BLOCKS = 2048
_LATTICE = 64


def city_image(
    database: SignatureDatabase, shades: Mapping[int, str]
) -> tuple[bytes, list[list[float]]]:
    r"""Draw how many objects are seen from every cell.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    shades : mapping of int to str
        Smallest number of objects, rising from 1, and colour (``#rrggbb``).

    Returns
    -------
    image : bytes
        A PNG, transparent where nothing is seen. Its rows and columns are even steps of Web
        Mercator, as the map's are, so it needs no warping.
    bounds : list of [latitude, longitude]
        South-western and north-eastern corner in degrees, WGS 84.

    Notes
    -----
    A city wider than 2048 cells is drawn in blocks of cells, each with its mean.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> image, bounds = city_image(build_database(objects), {1: "#cccccc", 10: "#999999"})
    >>> image[:4]
    b'\x89PNG'
    """

    def mean_shades(members: NDArray[np.int64]) -> NDArray[np.uint8]:
        means = np.bincount(members, weights=database.lengths) / np.bincount(members)
        return np.digitize(means, list(shades)).astype(np.uint8)

    return _drawn(database, mean_shades, list(shades.values()))


def level_image(
    database: SignatureDatabase, levels: NDArray[np.uint8], colours: Sequence[str]
) -> tuple[bytes, list[list[float]]]:
    r"""Draw a level of every cell.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    levels : ndarray of uint8, shape (n,)
        Level of each cell from 1, or 0 for nothing.
    colours : sequence of str
        Colour (``#rrggbb``) of each level.

    Returns
    -------
    image : bytes
        A PNG (see `city_image`). Of several cells in a block the highest level is shown.
    bounds : list of [latitude, longitude]
        South-western and north-eastern corner in degrees, WGS 84.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> image, bounds = level_image(database, np.ones(len(database), np.uint8), ["#cccccc"])
    >>> image[:4]
    b'\x89PNG'
    """

    def highest(members: NDArray[np.int64]) -> NDArray[np.uint8]:
        found = np.zeros(int(members.max()) + 1, np.uint8)
        np.maximum.at(found, members, levels)
        return found

    return _drawn(database, highest, colours)


def _drawn(
    database: SignatureDatabase,
    values_of: Callable[[NDArray[np.int64]], NDArray[np.uint8]],
    colours: Sequence[str],
) -> tuple[bytes, list[list[float]]]:
    """Draw a value of each block of cells, from the number of the block of every cell."""
    columns, rows = database.columns.astype(np.int64), database.rows.astype(np.int64)
    cells = max(int(np.ptp(columns)), int(np.ptp(rows))) + 1
    block = math.ceil(cells / _BLOCKS)
    columns, rows = columns // block, rows // block
    blocks, members = np.unique(cell_ids(columns, rows), return_inverse=True)
    values = values_of(members)
    side = database.grid.step * block
    origin = np.array(database.grid.origin)
    low = origin + side * np.array([columns.min(), rows.min()])
    high = origin + side * np.array([columns.max() + 1, rows.max() + 1])
    # At least two pixels a block, because the grid is a little turned against the pixels.
    zoom = max(2, min(4, _BLOCKS // (cells // block)))
    width, height = (np.rint((high - low) / side).astype(int) * zoom).tolist()
    across, corners = _lattice_places(database, low, high, width=width)
    pixels = np.empty((height, width), np.uint8)
    for line, weights in enumerate(_between(height)):
        places = weights @ across
        wanted = cell_ids(*np.floor((places - origin[:, None]) / side).astype(np.int64))
        found = np.minimum(np.searchsorted(blocks, wanted), len(blocks) - 1)
        pixels[line] = np.where(blocks[found] == wanted, values[found], 0)
    return _png(pixels, colours), corners


def _lattice_places(
    database: SignatureDatabase, low: NDArray[np.float64], high: NDArray[np.float64], *, width: int
) -> tuple[NDArray[np.float64], list[list[float]]]:
    """Return x and y of the pixels on the lines of a lattice over an area, and its corners.

    Projecting a lattice and interpolating in it is far faster than projecting every pixel, and
    exact to a centimetre in a city.
    """
    to_mercator = Transformer.from_crs(database.crs, "EPSG:3857", always_xy=True)
    sides = np.linspace(low, high, _LATTICE + 1)
    x, y = to_mercator.transform(*np.meshgrid(sides[:, 0], sides[:, 1]))
    west, east, south, north = x.min(), x.max(), y.min(), y.max()
    lattice = np.meshgrid(
        np.linspace(west, east, _LATTICE + 1), np.linspace(north, south, _LATTICE + 1)
    )
    metric = np.stack(to_mercator.transform(*lattice, direction="INVERSE"))
    to_degrees = Transformer.from_crs("EPSG:3857", "EPSG:4326", always_xy=True)
    longitudes, latitudes = to_degrees.transform([west, east], [south, north])
    return metric @ _between(width).T, np.stack([latitudes, longitudes], axis=1).tolist()


def _between(pixels: int) -> NDArray[np.float64]:
    """Return the matrix that interpolates the values of a lattice at the centres of pixels."""
    places = (np.arange(pixels) + 0.5) * (_LATTICE / pixels)
    weights: NDArray[np.float64] = 1.0 - np.abs(places[:, None] - np.arange(_LATTICE + 1))
    return np.maximum(weights, 0.0)


def _png(pixels: NDArray[np.uint8], colours: Sequence[str]) -> bytes:
    """Return a PNG with a palette: 0 is transparent, 1 the first colour, and so on."""
    height, width = pixels.shape
    lines = np.pad(pixels, ((0, 0), (1, 0)))  # each line begins with its filter: none
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
        (b"PLTE", bytes(3) + b"".join(bytes.fromhex(colour[1:]) for colour in colours)),
        (b"tRNS", b"\0"),
        (b"IDAT", zlib.compress(lines.tobytes(), 9)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
