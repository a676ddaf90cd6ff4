"""Save the output and files of the commands, to check that new code does not change them.

``python -m benchmarks.golden OUT`` runs the commands of ``golden.toml`` on a made-up city, on
Helsinki and Monaco, and on Montpellier (from the folder that SEMSIG_GEODATA names).
``OUT/golden.json`` gets the SHA-256 of the output of each command and of each file that it wrote;
``OUT/CITY.txt`` gets the output, as a transcript to read with ``diff -F '^[$]'``. ``--compare OLD
NEW`` prints which of these differ. Both need the same versions of other packages.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import json
import os
import shlex
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import semsig_gis
from benchmarks._contents import TIMES, digest, file_digest, masked

if TYPE_CHECKING:
    from collections.abc import Iterator

semsig_gis.__version__ = "0"  # in the metadata of every file; worker processes do the same
from semsig_gis.cli import main as semsig  # noqa: E402

_CITIES = ("general", "synthetic", "helsinki", "montpellier")  # the last one is not quick
_QUERIES, _SAMPLES = 6, 30
_LEAST_OBJECTS = 6  # of the cells from which queries are made


_TABLE = tomllib.loads(Path(__file__).with_name("golden.toml").read_text(encoding="utf-8"))


def main() -> None:
    """Run all commands and save their digests, or compare two results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.golden", description=__doc__)
    parser.add_argument("out", type=Path, nargs="?", metavar="OUT")
    parser.add_argument("--quick", action="store_true", help="all but Montpellier")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    options = parser.parse_args()
    if options.compare:
        sys.exit(_compare(*options.compare))
    if options.out is None or "SEMSIG_GEODATA" not in os.environ:
        parser.error("give OUT, and the folder of the open data in SEMSIG_GEODATA")
    out, geodata = options.out.resolve(), Path(os.environ["SEMSIG_GEODATA"]).resolve()
    out.mkdir(parents=True, exist_ok=True)
    digests: dict[str, str] = {}
    for city in _CITIES[:-1] if options.quick else _CITIES:
        start, transcript = time.perf_counter(), []
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            Path("geodata").symlink_to(geodata)  # so that no path depends on the machine
            for command in _commands(city):
                printed, written = _run(command)
                transcript.append(f"$ semsig {command}\n{printed}\n")
                digests[f"{city}: {command}"] = digest(printed.encode())
                digests |= {f"{city}: {name}": digest for name, digest in written.items()}
        (out / f"{city}.txt").write_text("".join(transcript), encoding="utf-8")
        seconds = time.perf_counter() - start
        print(f"{city}: {len(transcript)} commands, {seconds:.0f} s", flush=True)
    _write_lines(out / "golden.json", [json.dumps(digests, indent=1, sort_keys=True)])


def _commands(city: str) -> Iterator[str]:
    """Yield the commands of a city; some read files that earlier ones write."""
    table = _TABLE[city]
    if city == "general":
        yield from _lines(table["before"])
        return
    _write_area(*table["box"])
    _write_lines(Path("experiment.toml"), [_TABLE["experiment"]])
    yield from _lines(table["before"])
    yield "export city.parquet --out cells.csv"
    yield from _lines(_TABLE["suite"].format(objects=table["objects"], **_write_queries()))
    if "after" in table:
        yield from _lines(table["after"])


def _lines(table: str) -> Iterator[str]:
    """Yield the commands of a table."""
    for line in table.strip().splitlines():
        shared, _, rests = line.partition("|")
        for rest in rests.split(";"):
            yield " ".join(f"{shared} {rest}".split())


def _write_area(west: float, south: float, east: float, north: float) -> None:
    """Write a part of the city as a polygon."""
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    feature = {
        "type": "Feature",
        "properties": {"title": "part"},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    area = {"type": "FeatureCollection", "features": [feature]}
    _write_lines(Path("area.geojson"), [json.dumps(area)])


def _write_queries() -> dict[str, str]:
    """Write samples, queries and a route from cells.csv; return a query for the commands."""
    with Path("cells.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if int(row["length"]) >= _LEAST_OBJECTS]
    views: dict[tuple[float, float], dict[str, Any]] = {
        (float(row["x"]), float(row["y"])): {
            "types": row["types"],
            "bearings": [float(part) for part in row["bearings"].split()],
        }
        for row in rows
    }
    samples = [view | {"x": x + 2, "y": y - 1} for (x, y), view in views.items()]
    _write_rows("samples.jsonl", samples[:: len(samples) // _SAMPLES])
    # One object is missed, and in every other query the class of another one is unknown.
    queries = [
        {
            "id": f"q{number}",
            "types": "?" * (number % 2) + view["types"][1 + number % 2 :],
            "bearings": view["bearings"][1:],
        }
        for number, view in enumerate(samples[:: len(samples) // _QUERIES])
    ]
    _write_rows("queries.jsonl", queries)
    lines = [f"{row['id']},{row['types']},{_joined(row['bearings'], ' ')}" for row in queries]
    _write_lines(Path("queries.csv"), ["id,types,bearings", *lines])
    route = next(
        [view, views[x + 20, y], views[x + 20, y + 30]]
        for (x, y), view in views.items()
        if (x + 20, y) in views and (x + 20, y + 30) in views
    )
    legs: list[dict[str, int]] = [
        {},
        {"dx": 20, "dy": 0},
        {"distance": 30, "bearing": 0, "sigma": 2},
    ]
    _write_rows("route.jsonl", [view | leg for view, leg in zip(route, legs, strict=True)])
    sample = samples[len(samples) // 2]
    types = sample["types"][1:]
    return {
        "types": types,
        "query": f"--types {types} --bearings {_joined(sample['bearings'][1:], ',')}",
        "near": f"{sample['x']},{sample['y']},200",
        "lamp": types[0],
    }


def _joined(numbers: list[float], separator: str) -> str:
    return separator.join(map(str, numbers))


def _write_rows(name: str, rows: list[dict[str, Any]]) -> None:
    _write_lines(Path(name), [json.dumps(row) for row in rows])


def _write_lines(path: Path, lines: list[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _run(command: str) -> tuple[str, dict[str, str]]:
    """Run a command; return its output, and the digests of the files that it wrote."""
    words, _, file = command.partition(" < ")
    before = _files()
    output, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        sys.argv = ["semsig", *shlex.split(words)]
        sys.stdin = io.TextIOWrapper(io.BytesIO(Path(file).read_bytes() if file else b""))
        code: object = 0
        try:
            semsig()
        except SystemExit as end:
            code = end.code or 0
        except Exception as fault:  # noqa: BLE001 - the other commands are run nevertheless
            code = repr(fault)
    text = masked(f"{output.getvalue()}{errors.getvalue()}exit code: {code}\n")
    changed = [path for path, state in _files().items() if before.get(path) != state]
    changed = [path for path in changed if path.name not in TIMES]
    return text, {f"{command} > {path}": file_digest(path) for path in changed}


def _files() -> dict[Path, tuple[int, int]]:
    """Return the time of the last change and the size of each file."""
    paths = [Path(root, name) for root, _, names in os.walk(".") for name in names]
    return {path: (path.stat().st_mtime_ns, path.stat().st_size) for path in paths}


def _compare(old: Path, new: Path) -> int:
    """Print the outputs that differ, and return 1 if there are any."""
    before, after = (json.loads((folder / "golden.json").read_text()) for folder in (old, new))
    names = sorted(before.keys() | after.keys())
    wrong = [name for name in names if before.get(name) != after.get(name)]
    for name in wrong:
        state = "new" if name not in before else "differs" if name in after else "missing"
        print(f"{state}: {name}")
    print(f"{len(wrong)} of {len(names)} outputs differ")
    return min(len(wrong), 1)


if __name__ == "__main__":
    main()
