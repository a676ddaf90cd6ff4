"""Builds with dask processes: a cluster for the module, and processes that a test kills."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest
from machine import PATIENCE_S, largest_file
from sentences import refused
from worlds import CODES, CORNER, World, assert_same, random_town

from semsig_gis.core import DatabaseError, InputError
from semsig_gis.database import TileSpec, build_tile, build_tiles, open_database, save_database
from semsig_gis.database import tiles as distributed
from semsig_gis.objects import save_objects

if TYPE_CHECKING:
    from distributed import LocalCluster

    from semsig_gis.database import PartFile, TilePlan

SIDE = 200.0
CHECKOUT = Path(distributed.__file__).parents[2]


# Two places of different size, some tiles apart.
CITY = random_town(11, count=1500, side=700.0, codes=CODES[:5])
HAMLET = random_town(12, count=100, codes=CODES[:5])
TOWN = World((*CITY.objects, *((x + 1500.0, y + 1500.0, code) for x, y, code in HAMLET.objects)))


def build(folder: Path, name: str = "city", **options: object) -> dict[str, bytes]:
    """Build the town in tiles and return every file of the result."""
    if not (folder / "objects.parquet").exists():
        save_objects(TOWN.street_objects, folder / "objects.parquet")
    build_tiles(folder / "objects.parquet", folder / name, tile=TileSpec(SIDE), **options)  # type: ignore[arg-type]
    # After an interrupt, a task on a cluster may still be removing its temporary folder.
    tiles = folder / name
    files = [path.relative_to(tiles).as_posix() for path in tiles.rglob("*") if path.is_file()]
    return {file: (tiles / file).read_bytes() for file in files if not file.startswith(".semsig-")}


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("serial")
    files = build(folder)
    assert len(files) > 15
    assert_same(open_database(folder / "city"), TOWN.database)
    return files


def script(folder: Path, body: str) -> list[str]:
    """Return the command of a script that builds the town."""
    path = folder / "script.py"
    head = f"""
        import sys
        sys.path.insert(0, {str(CHECKOUT)!r})
        from semsig_gis.database.tiles import TileSpec, build_tiles
        paths = {str(folder / "objects.parquet")!r}, {str(folder / "city")!r}
        tile = TileSpec({SIDE})
    """
    path.write_text(textwrap.dedent(head) + textwrap.dedent(body), encoding="utf-8")
    return [sys.executable, "-W", "error", str(path)]


@pytest.mark.parametrize("workers", [1, 2])
def test_workers_write_the_same_files_as_one_process(
    serial: dict[str, bytes], tmp_path: Path, workers: int, capfd: pytest.CaptureFixture[str]
) -> None:
    others = set(multiprocessing.active_children())
    calls: list[tuple[int, int]] = []
    assert build(tmp_path, workers=workers, progress=lambda *call: calls.append(call)) == serial
    assert {path.name for path in tmp_path.iterdir()} == {"city", "objects.parquet"}
    total = calls[-1][1]
    assert calls == [(count, total) for count in range(1, total + 1)]
    assert capfd.readouterr() == ("", "")
    assert set(multiprocessing.active_children()) == others


def test_a_scheduler_writes_the_same_files_as_one_process(
    serial: dict[str, bytes], tmp_path: Path, cluster: LocalCluster
) -> None:
    assert build(tmp_path, scheduler=cluster.scheduler_address) == serial
    assert len(cluster.workers) == 2  # the cluster is still running


def test_one_process_does_not_load_dask(tmp_path: Path) -> None:
    save_objects(TOWN.street_objects, tmp_path / "objects.parquet")
    body = """
        build_tiles(*paths, tile=tile)
        print([name for name in ("dask", "distributed", "tornado") if name in sys.modules])
    """
    run = subprocess.run(script(tmp_path, body), check=True, capture_output=True, text=True)
    assert (run.stdout, run.stderr) == ("[]\n", "")


def test_a_killed_worker_does_not_change_the_files(
    serial: dict[str, bytes], tmp_path: Path, cluster: LocalCluster
) -> None:
    killed: list[int] = []

    def kill(count: int, total: int) -> None:
        if not killed:
            assert count < total
            killed.append(cluster.workers[0].pid)
            os.kill(killed[0], signal.SIGKILL)

    assert build(tmp_path, scheduler=cluster.scheduler_address, progress=kill) == serial
    end = time.monotonic() + PATIENCE_S
    while cluster.workers[0].pid in {None, killed[0]}:  # until the cluster has started a new worker
        assert time.monotonic() < end
        time.sleep(0.1)


@pytest.mark.skipif(os.name != "posix", reason="kills a group of processes")
def test_a_killed_run_is_resumed(serial: dict[str, bytes], tmp_path: Path) -> None:
    save_objects(TOWN.street_objects, tmp_path / "objects.parquet")
    body = """
        def stop(done, total):
            print(done, flush=True)
            if done == 3:
                import os, signal
                os.kill(os.getpid(), signal.SIGKILL)
        if __name__ == "__main__":
            build_tiles(*paths, tile=tile, workers=2, progress=stop)
    """
    # The killed process cannot remove its temporary files; the test does.
    (tmp_path / "scratch").mkdir()
    # `run` returns when the workers have closed the output too: they end without their parent.
    run = subprocess.run(
        script(tmp_path, body),
        check=False,
        capture_output=True,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path / "scratch")},
    )
    assert run.returncode == -signal.SIGKILL
    assert run.stdout == "1\n2\n3\n"
    assert not (tmp_path / "city").exists()

    def finished() -> dict[str, tuple[int, int]]:
        return {
            path.name: (path.stat().st_ino, path.stat().st_mtime_ns)
            for path in sorted(tmp_path.glob("city*/tile_*.parquet"))
        }

    before = finished()
    assert 2 <= len(before) < len(serial)  # of three tiles one may have no cell
    messages: list[str] = []
    assert build(tmp_path, remark=messages.append) == serial
    assert before.items() <= finished().items()
    assert len(messages) == 1
    assert "unfinished run" in messages[0]


def test_an_interrupted_run_keeps_its_tiles(
    serial: dict[str, bytes], tmp_path: Path, cluster: LocalCluster
) -> None:
    def interrupt(count: int, _: int) -> None:
        if count >= 4:
            raise KeyboardInterrupt

    for options in ({"scheduler": cluster.scheduler_address}, {}):
        with pytest.raises(KeyboardInterrupt):
            build(tmp_path, progress=interrupt, **options)
    counts: list[int] = []
    assert build(tmp_path, progress=lambda count, _: counts.append(count)) == serial
    assert counts[0] > 4


@pytest.mark.parametrize("where", ["here", "cluster"])
def test_a_failing_tile_is_reported_and_the_others_are_kept(
    serial: dict[str, bytes], tmp_path: Path, cluster: LocalCluster, where: str
) -> None:
    path = tmp_path / "objects.parquet"
    # An unknown class, in a tile far from the others.
    odd = World((*TOWN.objects, (*(CORNER + 3100.0).tolist(), CODES[5])))
    save_objects(odd.street_objects, path)
    table = pq.read_table(path)
    codes = table["class_code"].to_numpy().copy()
    codes[codes == CODES[5]] = 250
    table = table.set_column(0, "class_code", [codes])
    pq.write_table(table, path, row_group_size=100)
    options = {} if where == "here" else {"scheduler": cluster.scheduler_address}
    with refused(DatabaseError, "tile_3841_31390.parquet could not be built", "250", "kept"):
        build(tmp_path, **options)
    assert not (tmp_path / "city").exists()
    files = (tmp_path / "city.partial").glob("*.parquet")
    expected = {name: serial[name] for name in serial if name.startswith("tile")}
    assert {file.name: file.read_bytes() for file in files} == expected


def test_a_tile_that_kills_its_workers_is_reported_and_the_others_are_kept(
    serial: dict[str, bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    def deadly(plan: TilePlan, tile: tuple[int, int]) -> PartFile | None:
        if tile == (3827, 31376):
            os.kill(os.getpid(), signal.SIGKILL)
        return build_tile(plan, tile)

    monkeypatch.setattr(distributed, "build_tile", deadly)
    message = "tile_3827_31376.parquet could not be built (3 processes died"
    with refused(DatabaseError, message, "kept"):
        build(tmp_path, workers=2)
    assert capfd.readouterr() == ("", "")
    monkeypatch.undo()
    calls: list[tuple[int, int]] = []
    assert build(tmp_path, progress=lambda *call: calls.append(call)) == serial
    assert len(calls) == 1  # only this tile was missing


def test_a_run_stops_after_ten_failures_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = set()

    def fail(_: TilePlan, tile: tuple[int, int]) -> PartFile | None:
        tried.add(tile)
        raise ValueError("nothing works")

    monkeypatch.setattr(distributed, "build_tile", fail)
    with refused(DatabaseError, "and 9 more", "ValueError: nothing works", "0 tiles"):
        build(tmp_path)
    assert len(tried) == 10
    assert [path.name for path in tmp_path.iterdir()] == ["objects.parquet"]


def test_a_full_disk_leaves_the_old_database(tmp_path: Path) -> None:
    small, city, file = World(TOWN.objects[-40:]), tmp_path / "city", tmp_path / "city.parquet"
    save_objects(small.street_objects, tmp_path / "small.parquet")
    save_objects(TOWN.street_objects, tmp_path / "objects.parquet")
    build_tiles(tmp_path / "small.parquet", city)
    save_database(small.database, file)
    large = TOWN.database
    with largest_file(max(path.stat().st_size for path in (file, *city.iterdir()))):
        with refused(InputError, "city.parquet could not be written (File too large)"):
            save_database(large, file)
        with refused(InputError, "objects.parquet could not be written (File too"):
            build_tiles(tmp_path / "objects.parquet", city)
    for path in (city, file):
        assert_same(open_database(path), small.database)
