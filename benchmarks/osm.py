"""Reading a large OpenStreetMap file, compared with only pyosmium's loop over the same file."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import osmium
from osmium.osm.mutable import Node

from benchmarks.comparison import Comparison, compare
from benchmarks.memory import own_peak
from semsig_gis.sources import load_catalog, read_layers

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["comparisons"]

_NODES = {"full": 2_000_000, "small": 2_000}
_OBJECTS = 50  # one node in 50 is an object, as in a city
_NUMBERS = 12_000_000_000  # the largest id of real nodes
_PEER = "pyosmium's bare loop"


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure the time and the memory of reading one file."""
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
    """Read the file with the package."""
    read_layers(path, [spec for spec in load_catalog("openstreetmap").layers if spec.tags])


def bare(path: Path) -> None:
    """Go through the elements of the file."""
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
        # A way, because its position is computed from its nodes.
        writer.add_way(
            osmium.osm.mutable.Way(id=1, version=1, nodes=ends, tags=[("amenity", "bench")])
        )


def _peak(which: str, path: Path) -> float:
    """Return the peak memory in MB of a process that only does this."""
    command = [sys.executable, "-m", "benchmarks.osm", which, str(path)]
    return float(subprocess.check_output(command, text=True))  # noqa: S603


if __name__ == "__main__":
    {"ours": ours, "bare": bare}[sys.argv[1]](Path(sys.argv[2]))
    print(own_peak())
