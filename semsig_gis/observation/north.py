"""The north from which the bearings of a query are measured: grid, true or magnetic."""

from __future__ import annotations

import datetime as dt
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import (
    InputError,
    UnknownNameError,
    grid_convergence,
    nearest_name,
    signed_degrees,
    to_degrees,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core import Signature

NorthName = Literal["grid", "true", "magnetic"]
NORTHS: tuple[NorthName, ...] = get_args(NorthName)

MODELLED = dt.date(1900, 1, 1), dt.date(2029, 12, 31)
"""First and last day of the magnetic field model (IGRF-14)."""
WIDE = 0.5  # degrees; an answer has a note if north varies by more within the city


class NorthRecord(TypedDict):
    """A north as plain values, in degrees; the date is that of magnetic north."""

    name: NorthName
    turn: float
    spread: float
    date: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class North:
    """The north from which the bearings of a query are measured.

    Parameters
    ----------
    name : {"grid", "true", "magnetic"}, default "grid"
        Grid north is that of the CRS of the database.
    turn : float, default 0
        Its bearing from grid north in the middle of the city, in degrees clockwise.
    spread : float, default 0
        Maximum deviation from `turn` in the city, in degrees.
    date : datetime.date, optional
        The day for which the magnetic north was computed.

    Examples
    --------
    >>> import datetime as dt
    >>> crs, bounds = demo_database.crs, demo_database.bounds
    >>> north = North.of("magnetic", crs, bounds, date=dt.date(2024, 5, 1))
    >>> round(north.turn, 1), round(north.spread, 3)
    (1.9, 0.001)
    """

    name: NorthName = "grid"
    turn: float = 0.0
    spread: float = 0.0
    date: dt.date | None = None

    @classmethod
    def of(
        cls,
        name: NorthName,
        crs: CRS,
        bounds: ArrayLike | None = None,
        *,
        date: dt.date | None = None,
    ) -> Self:
        """Return the north of a city, from the grid convergence and the declination there.

        `crs` and `bounds` (west, south, east, north in metres) are those of its database. Magnetic
        north is that of `date`, by default of today. Raises UnknownNameError for an unknown name;
        InputError if a date is given for another north, or lies outside `MODELLED`.
        """
        if name not in NORTHS:
            raise UnknownNameError(
                f"north {name!r} is unknown{nearest_name(name, NORTHS)}; give one of {NORTHS}."
            )
        if date is not None and name != "magnetic":
            raise InputError(
                f"a date was given for {name} north, but only magnetic north changes with "
                "time; leave it out."
            )
        if name == "grid":
            return cls()
        if bounds is None:
            warnings.warn(
                "North.of(name, database) is North.of(name, database.crs, database.bounds) now; "
                "version 0.3.0 removes the old form.",
                DeprecationWarning,
                stacklevel=2,
            )
            database: Any = crs
            crs, bounds = database.crs, database.bounds
        # The middle of the city, then its corners.
        west, south, east, north = np.asarray(bounds, dtype=np.float64)
        middle = (west + east) / 2.0, (south + north) / 2.0
        places = np.array([middle, (west, south), (east, south), (east, north), (west, north)])
        turns = -grid_convergence(crs, places)
        if name == "magnetic":
            date = dt.datetime.now().astimezone().date() if date is None else date
            lon, lat = to_degrees(crs).transform(places[:, 0], places[:, 1])
            turns = turns + declination(lon, lat, date)
        turn = float(signed_degrees(turns[0]))
        spread = float(np.abs(signed_degrees(turns - turn)).max())
        return cls(name=name, turn=turn, spread=spread, date=date)

    def __str__(self) -> str:
        """Return its name, with the date of a magnetic north."""
        return f"{self.name} north" + (f" of {self.date}" if self.date else "")

    @property
    def notes(self) -> tuple[str, ...]:
        """A note if north varies within the city."""
        if self.spread <= WIDE:
            return ()
        note = (
            f"{self.name} north differs by up to {self.spread:.1f}° from its bearing in the middle "
            "of the city, which is used for the whole city."
        )
        return (note,)

    def to_grid(self, query: Signature) -> Signature:
        """Return a query with its bearings measured from grid north."""
        return query.turned(self.turn) if self.turn else query

    def from_grid(self, bearing: float) -> float:
        """Convert a bearing from grid north to a bearing from this north, in [0, 360)."""
        return (bearing - self.turn) % 360.0 if self.turn else bearing

    def to_dict(self) -> NorthRecord:
        """Return plain values for JSON."""
        date = None if self.date is None else self.date.isoformat()
        return {"name": self.name, "turn": self.turn, "spread": self.spread, "date": date}


GRID_NORTH: North = North()
"""The north of stored bearings."""


def declination(
    lon: NDArray[np.float64], lat: NDArray[np.float64], date: dt.date
) -> NDArray[np.float64]:
    """Return the bearing of magnetic north from true north at places, in degrees clockwise.

    The model is the International Geomagnetic Reference Field. Raises InputError if the date is
    outside `MODELLED`.
    """
    import ppigrf  # noqa: PLC0415 - it imports pandas, 0.25 s

    first, last = MODELLED
    if not first <= date <= last:
        raise InputError(
            f"the date {date} was given for magnetic north; give one from {first} to {last}."
        )
    day = dt.datetime.combine(date, dt.time())
    east, north, _ = ppigrf.igrf(lon, lat, 0.0, day)
    return np.asarray(np.degrees(np.arctan2(east, north))).reshape(-1)
