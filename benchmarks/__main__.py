"""Run the benchmarks, print them, and write ``benchmarks/results.json``."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks import answers, building, country, maps, matching, occlusion, osm
from benchmarks._measuring import FOLDER, SIZES, read_rows, write_rows

_PARTS = {
    module.__name__.rpartition(".")[2]: module
    for module in (matching, answers, building, occlusion, country, osm, maps)
}


def main() -> None:
    """Run the parts, print and write their results; results of other parts stay in the file."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"some of {', '.join(_PARTS)}")
    parser.add_argument("--size", choices=SIZES, default="full")
    parser.add_argument("--out", type=Path, default=FOLDER / "results.json", metavar="FILE")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(_PARTS):
        parser.error(f"there is no part {min(unknown)}; give some of {', '.join(_PARTS)}")
    results = {}
    if options.parts:
        results = {row["name"]: row for row in read_rows(options.out)}
    for name in options.parts or _PARTS:
        for comparison in _PARTS[name].comparisons(options.size):
            print(comparison, flush=True)
            results[comparison.name] = comparison.to_dict()
    write_rows(options.out, [*results.values()])


if __name__ == "__main__":
    main()
