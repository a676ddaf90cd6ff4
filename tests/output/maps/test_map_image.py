"""Images of cells, in which every cell is at its place; and data in scripts."""

from __future__ import annotations

import io
import json
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from folium.template import Template
from hypothesis import example, given
from hypothesis import strategies as st
from noisy_cells import cells_at
from PIL import Image
from pyproj import CRS, Transformer

from semsig_gis.core import SHADES, GridSpec
from semsig_gis.output import (
    city_image,
    corners_of,
    level_image,
    mercator,
    place_lattices,
    script_json,
)
from semsig_gis.output.html import image as map_image

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase

PLACES = [
    ("EPSG:2154", (765_200.0, 6_275_000.0)),
    ("EPSG:32631", (-3.5, 5_400_000.0)),  # west of its zone: much turned
    ("EPSG:32735", (500_000.0, 7_500_000.0)),  # south of the equator
]


def a_city(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    *,
    crs: str = "EPSG:2154",
    origin: tuple[float, float] = (765_200.0, 6_275_000.0),
) -> SignatureDatabase:
    """Return a city with random numbers of visible objects in the given cells."""
    return cells_at(columns, rows, longest=14, crs=CRS(crs), grid=GridSpec(10.0, origin))


@pytest.mark.parametrize("crs", ["EPSG:32760", "EPSG:32701", "EPSG:3460"])
def test_city_across_180_degrees_has_its_true_size(crs: str) -> None:
    place = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(180.0, -16.8)
    x, y = (10.0 * round(side / 10.0) - 200.0 for side in place)
    city = a_city(*scattered(40, 0.5), crs=crs, origin=(x, y))
    _, ((south, west), (north, east)) = city_image(city)
    assert 0 < east - west < 0.005
    assert 0 < north - south < 0.005
    assert min(abs(west - 180.0), abs(west + 180.0)) < 0.005
    places = place_lattices(city)
    assert np.ptp(places.degrees[..., 1]) < 0.005
    assert places.mercator_box[2] - places.mercator_box[0] < 500.0
    assert np.abs(places.metres - city.xy.mean(axis=0)).max() < 300.0
    spots, about = mercator(city.xy, city.crs)
    assert np.ptp(spots * about["quantum"], axis=0).max() < 500.0
    assert np.ptp(corners_of(city), axis=0).max() < 0.005


def scattered(side: int, share: float, seed: int = 1) -> tuple[NDArray[np.int64], ...]:
    return np.nonzero(np.random.default_rng(seed).random((side, side)) < share)


def decoded(png: bytes) -> tuple[NDArray[np.uint8], bytes]:
    """Return the palette indices of a PNG and its palette, where entry 0 is transparent."""
    image = Image.open(io.BytesIO(png))
    assert (image.mode, image.info["transparency"]) == ("P", 0)
    assert image.palette is not None
    return np.asarray(image), bytes(image.palette.palette)


def indices_at(
    image: bytes, bounds: list[list[float]], xy: NDArray[np.float64], crs: CRS
) -> NDArray[np.uint8]:
    """Return the palette indices at the pixels where a web map draws places."""
    pixels, _ = decoded(image)
    to_mercator = Transformer.from_crs(crs, "EPSG:3857", always_xy=True)
    from_degrees = Transformer.from_crs("EPSG:4326", "EPSG:3857")
    south_west, north_east = (
        np.array(from_degrees.transform(latitude, longitude)) for latitude, longitude in bounds
    )
    x, y = to_mercator.transform(xy[:, 0], xy[:, 1])
    height, width = pixels.shape
    across = (np.asarray(x) - south_west[0]) / (north_east[0] - south_west[0]) * width
    down = (north_east[1] - np.asarray(y)) / (north_east[1] - south_west[1]) * height
    indices: NDArray[np.uint8] = pixels[down.astype(int), across.astype(int)]
    return indices


@pytest.mark.parametrize("side", [7, 600])
@pytest.mark.parametrize(("crs", "origin"), PLACES)
def test_cells_are_at_their_places_in_the_image(
    side: int, crs: str, origin: tuple[float, float]
) -> None:
    database = a_city(*scattered(side, 0.4), crs=crs, origin=origin)
    image, bounds = city_image(database)
    # A pixel is at most half a cell wide, so the middle of a cell always has the cell's shade.
    expected = np.digitize(database.lengths, list(SHADES))
    assert (indices_at(image, bounds, database.xy, database.crs) == expected).all()
    free = np.ones((database.columns.max() + 1, database.rows.max() + 1), bool)
    free[database.columns, database.rows] = False
    free[: database.columns.min()] = free[:, : database.rows.min()] = False
    absent = database.grid.viewpoints(*np.nonzero(free))
    assert not indices_at(image, bounds, absent, database.crs).any()


def test_city_of_one_cell_has_an_image() -> None:
    database = a_city(np.array([-5]), np.array([3]))
    image, bounds = city_image(database)
    assert indices_at(image, bounds, database.xy, database.crs).all()
    assert 0 < np.diff(bounds, axis=0).min() <= np.diff(bounds, axis=0).max() < 2e-4


def test_image_has_the_palette_and_at_most_2048_pixels() -> None:
    image, _ = city_image(a_city(*scattered(500, 0.3)))
    pixels, palette = decoded(image)
    assert palette[3:] == bytes.fromhex("".join(SHADES.values()).replace("#", ""))
    assert 1000 <= min(pixels.shape) <= max(pixels.shape) <= 2048
    assert {0, 1, 2, 3} <= set(np.unique(pixels).tolist())


def test_blocks_of_a_wide_city_show_means(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_image, "_BLOCKS", 50)
    database = a_city(*scattered(140, 0.5))
    image, bounds = city_image(database)
    assert max(decoded(image)[0].shape) <= 100
    block = 3
    places = np.stack([database.columns, database.rows], axis=1) // block
    corners, members = np.unique(places, axis=0, return_inverse=True)
    means = np.bincount(members.ravel(), database.lengths) / np.bincount(members.ravel())
    middles = np.array(database.grid.origin) + (corners + 0.5) * block * database.grid.step
    expected = np.digitize(means, list(SHADES))
    assert (indices_at(image, bounds, middles, database.crs) == expected).all()


def test_level_image_shows_the_level_of_each_cell() -> None:
    city = a_city(*scattered(40, 0.4))
    levels = np.random.default_rng(3).integers(0, 4, len(city)).astype(np.uint8)
    image, bounds = level_image(city, levels, ["#111111", "#222222", "#333333"])
    assert indices_at(image, bounds, city.xy, city.crs).tolist() == levels.tolist()
    assert decoded(image)[1] == bytes([0, 0, 0, 17, 17, 17, 34, 34, 34, 51, 51, 51])


def test_block_shows_its_highest_level(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_image, "_BLOCKS", 8)
    city = a_city(*scattered(16, 1.0))
    levels = np.zeros(len(city), np.uint8)
    levels[[5, 200]] = 2, 1
    image, _ = level_image(city, levels, ["#111111", "#222222"])
    assert set(np.unique(decoded(image)[0])) == {0, 1, 2}


def between(
    lattice: NDArray[np.float64], box: list[float], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return interpolated values of a lattice at points, point by point."""
    lines = len(lattice) - 1
    values_at = []
    for point in points:
        place = (point - np.array(box[:2])) / (np.array(box[2:]) - np.array(box[:2])) * lines
        column, row = np.minimum(place.astype(int), lines - 1)
        right, up = place - [column, row]
        low = lattice[row, column] * (1 - right) + lattice[row, column + 1] * right
        high = lattice[row + 1, column] * (1 - right) + lattice[row + 1, column + 1] * right
        values_at.append(low * (1 - up) + high * up)
    return np.array(values_at)


@pytest.mark.parametrize(("crs", "origin"), PLACES)
def test_lattices_are_exact_to_a_centimetre(crs: str, origin: tuple[float, float]) -> None:
    database = a_city(*scattered(300, 0.01), crs=crs, origin=origin)
    lattices = place_lattices(database)
    to_degrees = Transformer.from_crs(crs, "EPSG:4326")
    latlon = np.stack(to_degrees.transform(*database.xy.T), axis=1)
    values_at = between(lattices.degrees, lattices.metric_box, database.xy)
    assert np.abs(values_at - latlon).max() < 1e-7  # degrees
    to_mercator = Transformer.from_crs(crs, "EPSG:3857", always_xy=True)
    web = np.stack(to_mercator.transform(*database.xy.T), axis=1)
    back = between(lattices.metres, lattices.mercator_box, web)
    assert np.abs(back - database.xy).max() < 0.01


nasty = st.text(st.sampled_from(list("{}%#<>&'\"`$\\/-! 7*é\u2028\ud7ff")), max_size=12)
values = st.recursive(
    st.none() | st.integers() | st.text() | nasty,
    lambda children: st.lists(children, max_size=4) | st.dictionaries(nasty, children, max_size=4),
    max_leaves=12,
)


@given(values)
@example("{{7*7}}")
@example("{{ this._parent }}{% raw %}{# gone #}")
@example({"{": {"{{": "{%"}, "": {}})
@example("</script><!--<script>")
def test_script_json_has_no_markup_and_is_not_changed_by_two_renderings(value: object) -> None:
    written = script_json(value)
    assert written.isascii()
    assert not re.search(r"[<>&]|\{[{%#]", written)
    once = Template(written).render()
    assert json.loads(Template(once).render()) == value


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_script_json_refuses_nan_and_infinity(number: float) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        script_json([number])
