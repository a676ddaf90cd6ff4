"""`semsig update` of a database in tiles, and `semsig merge`."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


def test_tiles_are_updated_by_the_objects_in_their_folder(town: Path, run: Run) -> None:
    tiles, objects = town / "tiles", town / "objects.parquet"
    assert run("build", objects, "--out", tiles, "--tile", 100)[0] == 0
    before = {path: path.read_bytes() for path in tiles.rglob("*.*")}
    code, printed, _ = run("update", tiles, "--objects", objects, "--json")
    assert (code, '"recomputed": 0' in printed) == (0, True)
    assert {path: path.read_bytes() for path in tiles.rglob("*.*")} == before
    assert run("build", objects, "--out", town / "city.parquet")[0] == 0
    code, _, err = run("update", town / "city.parquet", "--objects", objects, "--workers", 2)
    assert (code, "is a single file, not tiles" in err) == (2, True)
    # The objects are in the folder until `clean` removes them.
    code, _, err = run("localize", tiles, "bench at 40, tree at 90")
    assert (code, "no street objects" in err) == (0, False)
    assert run("clean", tiles, "--objects")[0] == 0
    code, _, err = run("update", tiles, "--objects", objects)
    assert (code, "has no street objects" in err) == (2, True)


def test_cities_are_merged(town: Path, run: Run) -> None:
    city, region = town / "city.parquet", town / "region.parquet"
    objects = town / "objects.parquet"
    assert run("build", objects, "--out", city)[0] == 0
    code, printed, _ = run("merge", city, city, "--out", region)
    assert (code, "were computed again" in printed) == (0, True)
    assert region.read_bytes() == city.read_bytes()
    code, _, err = run("merge", city, city, "--out", city)
    assert (code, "give another name" in err) == (2, True)
