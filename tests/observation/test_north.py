"""Grid, true and magnetic north of bearings."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from noisy_cells import parts_of
from pyproj import CRS
from sentences import refused
from worlds import random_town

from semsig_gis.core import GridSpec, InputError, Signature, UnknownNameError, grid_convergence
from semsig_gis.database import PartitionedDatabase, save_database
from semsig_gis.localization import Method, build_index, localize, locate, named_noise
from semsig_gis.observation import GRID_NORTH, North, Photo, View, declination

if TYPE_CHECKING:
    from pathlib import Path

CITY = random_town().database
DAY = dt.date(2024, 5, 31)
CELL = int(CITY.lengths.argmax())


def moved(crs: str, x: float, y: float, step: float = 10.0) -> Any:  # noqa: ANN401
    west, south = x - step * int(CITY.columns.min()), y - step * int(CITY.rows.min())
    return replace(CITY, crs=CRS(crs), grid=GridSpec(step=step, origin=(west, south)))


@pytest.mark.parametrize(
    ("lon", "lat", "day", "expected"),
    [  # from another model, the World Magnetic Model
        (24.94, 60.17, dt.date(2026, 11, 22), 10.49),
        (2.35, 48.86, dt.date(2020, 1, 1), 1.04),
        (-122.4, 37.8, dt.date(2025, 1, 1), 12.99),
    ],
)
def test_declination_equals_world_magnetic_model(
    lon: float, lat: float, day: dt.date, expected: float
) -> None:
    result = declination(np.array([lon]), np.array([lat]), day)
    assert result == pytest.approx(expected, abs=0.05)


def test_north_is_that_of_middle_of_city(tmp_path: Path) -> None:
    # West of the middle of its zone, grid north lies west of true north.
    helsinki = moved("EPSG:32635", 386_000.0, 6_672_000.0)
    convergence = grid_convergence(helsinki.crs, helsinki.xy).mean()
    true = North.of("true", helsinki.crs, helsinki.bounds)
    assert true.turn == pytest.approx(-convergence, abs=0.01)
    assert 1.7 < true.turn < 1.9
    magnetic = North.of("magnetic", helsinki.crs, helsinki.bounds, date=DAY)
    assert magnetic.turn - true.turn == pytest.approx(10.10, abs=0.02)
    assert magnetic.to_dict()["date"] == "2024-05-31"
    assert North.of("magnetic", helsinki.crs, helsinki.bounds).date is not None
    assert North.of("grid", helsinki.crs, helsinki.bounds) == GRID_NORTH
    save_database(helsinki, tmp_path / "part.parquet")
    parted = PartitionedDatabase((tmp_path / "part.parquet",), len(helsinki))
    assert North.of("true", parted.crs, parted.bounds) == true
    with pytest.warns(DeprecationWarning, match=r"database\.bounds"):
        assert North.of("true", helsinki) == true


def test_note_if_north_varies_within_city() -> None:
    narrow = moved("EPSG:32635", 386_000.0, 6_672_000.0)
    assert not North.of("true", narrow.crs, narrow.bounds).notes
    city = moved("EPSG:32635", 386_000.0, 6_672_000.0, step=5000.0)
    wide = North.of("true", city.crs, city.bounds)
    (note,) = wide.notes
    assert f"true north differs by up to {wide.spread:.1f}" in note
    assert localize(CITY, CITY.signature(CELL), north=wide, method=Method()).notes == (note,)


def test_bearings_are_converted_from_and_to_their_north() -> None:
    north = North(name="magnetic", turn=12.0, date=DAY)
    codes, bearings = parts_of(CITY.signature(CELL))
    query = Signature(codes, bearings).turned(-12.0)
    assert parts_of(query)[1].min() >= 0
    assert np.allclose(parts_of(north.to_grid(query))[1], bearings)
    index = build_index(CITY, named_noise("light"))
    plain = locate(index, Signature(codes, bearings), explained=1)
    answer = locate(index, query, north=north, explained=1)
    assert np.allclose(answer.chances, plain.chances)
    values, expected = answer.to_dict(), plain.to_dict()
    described = {"name": "magnetic", "turn": 12.0, "spread": 0.0, "date": "2024-05-31"}
    assert values["north"] == described
    assert values["query"]["bearings"] == parts_of(query)[1].tolist()
    rows, others = (item["candidates"][0]["explanation"]["rows"] for item in (values, expected))
    for name in ("query_bearing", "object_bearing"):
        here, there = (
            np.array(sorted(value for row in part if (value := row[name]) is not None))
            for part in (rows, others)
        )
        assert np.allclose(np.sort((here + 12.0) % 360.0), there)
    ranked = localize(CITY, query, north=north, method=Method())
    assert ranked.candidates["cell"][0] == CELL
    assert ranked.candidates["distance"][0] == 0.0
    # The photos of a view are turned, too.
    photo = Photo.looking(heading=float(bearings[0]), fov=200)
    view = View.of(CITY.signature(CELL), ranges=np.full(len(codes), 12.0), photos=(photo,))
    here, there, other = (
        item.candidates["loglik"].to_numpy()
        for item in (locate(index, view), locate(index, view.turned(-12.0), north=north), plain)
    )
    assert np.allclose(here, there)
    assert not np.allclose(here, other)
    # The heading of the answer is relative to the north of the query.
    turned = locate(index, query.turned(-30.0), north=north, north_sigma=float("inf"))
    assert turned.estimate.heading == pytest.approx(30.0, abs=3.0)


def test_invalid_norths_are_refused() -> None:
    with refused(UnknownNameError, "'tru'", "nearest is 'true'"):
        North.of("tru", CITY.crs, CITY.bounds)  # type: ignore[arg-type]
    with refused(InputError, "true north"):
        North.of("true", CITY.crs, CITY.bounds, date=DAY)
    with refused(InputError, "2030-01-01", "1900-01-01 to 2029-12-31"):
        North.of("magnetic", CITY.crs, CITY.bounds, date=dt.date(2030, 1, 1))
