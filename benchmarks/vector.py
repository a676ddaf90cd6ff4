"""Time of reading shapefiles, compared with fiona: ``python -m benchmarks.vector FOLDER``.

The folder contains zipped shapefiles, for example of a city. Both read every field and geometry.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.comparison import compare
from semsig_gis.sources import describe, members, read_each, read_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semsig_gis.sources import LayerDescription, Member

REPEATS = 3


def main() -> None:
    """Measure all files of a folder, and the largest one."""
    files = [member for path in sorted(Path(sys.argv[1]).glob("*.zip")) for member in members(path)]
    layers = [(member, describe(member)) for member in files]
    largest = max(layers, key=lambda item: item[1].rows)
    for name, group in (
        (f"reading {len(layers)} published shapefiles", layers),
        (f"reading the largest, {largest[1].rows:,} rows", [largest]),
    ):
        print(
            compare(
                name,
                partial(_read_all, group, _whole),
                partial(_read_all, group, read_each),
                peer_name="fiona",
                repeats=REPEATS,
            )
        )


def _read_all(
    layers: Sequence[tuple[Member, LayerDescription]],
    read: Callable[[Member, Sequence[str], int], object],
    _: int,
) -> None:
    for member, layer in layers:
        read(member, layer.fields, layer.rows)


def _whole(member: Member, fields: Sequence[str], count: int) -> object:
    """Read as the package does: whole, or row by row if a row may be damaged."""
    rows = read_whole(member, fields, count)
    return read_each(member, fields, count) if rows is None else rows


if __name__ == "__main__":
    main()
