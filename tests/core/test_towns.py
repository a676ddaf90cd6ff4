"""The nearest town of a place."""

from __future__ import annotations

import pytest

from semsig_gis.core import nearest_town


@pytest.mark.parametrize(
    ("lon", "lat", "name", "country"),
    [
        (4.8357, 45.764, "Lyon", "France"),
        (16.3727, 48.2085, "Vienna", "Austria"),
        (179.9, -16.8, "Labasa", "Fiji"),
        (-179.9, -16.8, "Labasa", "Fiji"),  # over the date line
    ],
)
def test_nearest_town_is_found(lon: float, lat: float, name: str, country: str) -> None:
    town = nearest_town(lon, lat)
    assert (town.name, town.country) == (name, country)
    assert town.distance_km < 100.0


def test_middle_of_an_ocean_is_far_from_towns() -> None:
    assert nearest_town(-30.0, -40.0).distance_km > 1_000.0
