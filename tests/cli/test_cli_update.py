"""`semsig update` of a database in tiles, and what it says where that cannot be done."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


def test_tiles_are_updated_with_the_objects_of_before(town: Path, run: Run) -> None:
    tiles, objects = town / "tiles", town / "objects.parquet"
    assert run("build", objects, "--out", tiles, "--tile", 100)[0] == 0
    before = {path.name: path.read_bytes() for path in tiles.iterdir()}
    code, printed, _ = run("update", tiles, "--objects", objects, "--before", objects, "--json")
    assert (code, '"recomputed": 0' in printed) == (0, True)
    assert {path.name: path.read_bytes() for path in tiles.iterdir()} == before
    for city, more, words in (
        (tiles, (), "--before"),
        (town / "city.parquet", ("--before", objects), "not in tiles"),
    ):
        code, _, told = run("update", city, "--objects", objects, *more)
        assert (code, words in told) == (2, True)


def test_two_cities_become_a_region(town: Path, run: Run) -> None:
    city, region = town / "city.parquet", town / "region.parquet"
    objects = town / "objects.parquet"
    assert run("build", objects, "--out", city)[0] == 0
    code, printed, _ = run("merge", city, city, "--out", region)
    assert (code, "were computed again" in printed) == (0, True)
    assert region.read_bytes() == city.read_bytes()
    code, _, told = run("merge", city, city, "--out", city)
    assert (code, "a name of its own" in told) == (2, True)
