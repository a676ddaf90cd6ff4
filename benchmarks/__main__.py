"""Run the benchmarks, print them, and write ``benchmarks/results.json``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks import answers, building, country, maps, matching, occlusion, osm

_PARTS = {
    module.__name__.rpartition(".")[2]: module
    for module in (matching, answers, building, occlusion, country, osm, maps)
}


def main() -> None:
    """Read the options, run, print and write; of what is not run, the lines of before stay."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"some of {', '.join(_PARTS)}")
    parser.add_argument("--size", choices=["full", "small"], default="full")
    parser.add_argument(
        "--out", type=Path, default=Path(__file__).with_name("results.json"), metavar="FILE"
    )
    options = parser.parse_args()
    if unknown := set(options.parts) - set(_PARTS):
        parser.error(f"there is no part {min(unknown)}; give some of {', '.join(_PARTS)}")
    results = {}
    if options.parts and options.out.exists():
        results = {one["name"]: one for one in json.loads(options.out.read_text("utf-8"))}
    for name in options.parts or _PARTS:
        for comparison in _PARTS[name].comparisons(options.size):
            print(comparison, flush=True)
            results[comparison.name] = comparison.to_dict()
    options.out.write_text(json.dumps([*results.values()], indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
