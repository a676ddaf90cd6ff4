"""Positions in the values of tables: their notations, and the choice of their fields."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from semsig_gis.sources import find_positions

if TYPE_CHECKING:
    from collections.abc import Sequence


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([{"place": "48.85, 2.35"}, {"place": None}], ("place",)),
        ([{"place": "rue 1, 2"}], ()),
        ([{"x": 1, "y": 2}], ("x", "y")),
        ([{"lng": "here", "lat": "there"}], ("lng", "lat")),  # the first bad value is an error
        ([{"x": 1}], ()),
        ([{"Coord_X": "770000,5", "Coord_Y": "6 280 000,5"}], ("Coord_X", "Coord_Y")),
        ([{"X_L93": 770000, "Y_L93": 6280000}], ("X_L93", "Y_L93")),
        ([{"lon_wgs84": 2.5, "lat_wgs84": 48.5}], ("lon_wgs84", "lat_wgs84")),
        ([{"X_L93": 7e5, "lat": 48, "Y_L93": 6e6, "lon": 2}], ("lon", "lat")),
        ([{"x_old": 1, "lat_new": 48, "y_old": 2, "lon_new": 2}], ("x_old", "y_old")),
        ([{"lon": "?", "lat": 1}, {"lon": 2.5, "lat": 48}], ("lon", "lat")),
    ],
)
def test_fields_of_positions_are_found(
    rows: Sequence[dict[str, Any]], expected: tuple[str, ...]
) -> None:
    fields = list(dict.fromkeys(name for row in rows for name in row))
    found = find_positions(fields, rows)
    assert (found.names if found else ()) == expected
