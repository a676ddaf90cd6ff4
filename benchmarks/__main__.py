"""Run the benchmarks, print them, and write ``benchmarks/results.json``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks import answers, building, country, maps, matching, occlusion, osm


def main() -> None:
    """Read the options, run, print and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--size", choices=["full", "small"], default="full")
    parser.add_argument(
        "--out", type=Path, default=Path(__file__).with_name("results.json"), metavar="FILE"
    )
    options = parser.parse_args()
    results = []
    for module in (matching, answers, building, occlusion, country, osm, maps):
        for comparison in module.comparisons(options.size):
            print(comparison, flush=True)
            results.append(comparison.to_dict())
    options.out.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
