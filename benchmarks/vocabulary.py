"""Count the classes of OpenStreetMap's catalogue: ``python -m benchmarks.vocabulary FILE...``.

The lines are the table in ``data_sources/openstreetmap.toml``, with a count for each file. Layers
that are rarely mapped are named last; the catalogue says which of these are optional.
"""

from __future__ import annotations

import argparse
import textwrap
from collections import defaultdict
from pathlib import Path

from semsig_gis.objects import read_files
from semsig_gis.sources import load_catalog

__all__ = ["main"]

# A layer is rare with fewer objects than this in every extract, and than these in all but one.
_FEW, _FEW_IN_MOST = 20, 3
_WIDTH = 98


def main() -> None:
    """Print the objects of each class with tags, by extract, and the rare layers."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.vocabulary", description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    files = parser.parse_args().files
    specs = [spec for spec in load_catalog("openstreetmap").layers if spec.classes and spec.tags]
    counts: dict[str, list[int]] = defaultdict(lambda: [0] * len(files))
    rows: dict[str, list[int]] = {}
    for place, file in enumerate(files):
        layers, _ = read_files(specs, [file])
        for layer in layers:
            rows.setdefault(layer.spec.name, [0] * len(files))[place] = len(layer)
            for name in layer.columns["class_name"].to_pylist():
                counts[name][place] += 1
    names = {name for spec in specs for name in spec.classes}
    texts = [f"{name} {'/'.join(map(str, counts[name]))}" for name in sorted(names)]
    rare = [
        name
        for name, numbers in rows.items()
        if max(numbers) < _FEW and sum(number >= _FEW_IN_MOST for number in numbers) <= 1
    ]
    for text in ("; ".join(texts), f"Rare layers: {', '.join(rare)}"):
        print("\n".join(f"# {line}" for line in textwrap.wrap(f"{text}.", _WIDTH)))


if __name__ == "__main__":
    main()
