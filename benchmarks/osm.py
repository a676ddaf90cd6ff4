"""Reading a large OpenStreetMap file, beside pyosmium's bare loop over the same file."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import osmium
from osmium.osm.mutable import Node

from benchmarks.comparison import Comparison, compare
from semsig_gis.sources import load_catalog, read_layers

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["comparisons"]

_NODES = {"full": 2_000_000, "small": 2_000}
_OBJECTS = 50  # every so many nodes, as in a city
_NUMBERS = 12_000_000_000  # as far as those of real nodes go
_PEER = "pyosmium's bare loop"


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure one file, in time and in memory.

    Parameters
    ----------
    size : str
        ``"full"`` or ``"small"``.

    Yields
    ------
    Comparison
        The result.
    """
    nodes = _NODES[size]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "city.osm.pbf"
        _write(path, nodes)
        yield compare(
            f"reading every layer of a pbf file of {nodes:,} nodes",
            lambda _: ours(path),
            lambda _: bare(path),
            peer_name=_PEER,
            repeats=1,
            bar=1 / 3,
        )
        yield Comparison(
            name=f"peak memory of reading every layer of a pbf file of {nodes:,} nodes",
            unit="MB",
            ours=_peak("ours", path),
            peer=_peak("bare", path),
            peer_name=f"{_PEER}, after the same imports",
            bar=1 / 3,
        )


def ours(path: Path) -> None:
    """Read the file as the package does."""
    read_layers(path, load_catalog("openstreetmap").layers)


def bare(path: Path) -> None:
    """Look at every element of the file and do nothing."""
    for _ in osmium.FileProcessor(path):
        pass


def _write(path: Path, nodes: int) -> None:
    with osmium.SimpleWriter(str(path)) as writer:
        for number in range(1, nodes + 1):
            kind = ("natural", "tree") if number % (2 * _OBJECTS) else ("amenity", "bench")
            writer.add_node(
                Node(
                    id=number * (_NUMBERS // nodes),
                    version=1,
                    location=(2.0 + number % 1000 / 5000, 48.0 + number // 1000 / 5000),
                    tags=[kind] if number % _OBJECTS == 0 else [],
                )
            )
        ends = [number * (_NUMBERS // nodes) for number in (1, 2)]
        # A way, because it needs the places of nodes.
        writer.add_way(
            osmium.osm.mutable.Way(id=1, version=1, nodes=ends, tags=[("amenity", "bench")])
        )


def _peak(which: str, path: Path) -> float:
    """Return the peak memory in MB of a process that only does this."""
    command = [sys.executable, "-m", "benchmarks.osm", which, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
    return float(done.stdout)


def _own_peak() -> float:
    """Return the peak memory of this process in MB."""
    status = Path("/proc/self/status")
    if status.exists():
        # What Linux tells by getrusage includes the process that started this one.
        lines = status.read_text(encoding="ascii").splitlines()
        return float(dict(line.split(":", 1) for line in lines)["VmHWM"].split()[0]) / 2**10
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


if __name__ == "__main__":
    {"ours": ours, "bare": bare}[sys.argv[1]](Path(sys.argv[2]))
    print(_own_peak())
