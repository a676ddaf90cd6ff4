"""Layers of objects that are not read: how many objects they would add, where that is cheap."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from semsig_gis.core import SemsigError
from semsig_gis.objects.load import read_files
from semsig_gis.sources import MERGING, find_files

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from semsig_gis.sources import Catalog, LayerSpec, RawLayer

# Files that are read in about a second.
SMALL_BYTES = 2**21


def passed_by(catalog: Catalog, specs: Sequence[LayerSpec]) -> tuple[LayerSpec, ...]:
    """Return the other layers that a reading of `specs` passes by anyway.

    These are those of the same extracts of a map, of which every element is looked at.
    """
    files = {spec.files for spec in specs if spec.reader in MERGING}
    return tuple(
        spec for spec in _others(catalog, specs) if spec.reader in MERGING and spec.files in files
    )


def read_small(
    catalog: Catalog,
    specs: Sequence[LayerSpec],
    paths: Sequence[Path],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read the other layers whose files are there and small; one that cannot be read is left out.

    What is wrong with a layer that nobody asked for is not told.
    """
    layers: list[RawLayer] = []
    for spec in _others(catalog, specs):
        files = _files(spec, paths)
        if files and sum(file.stat().st_size for file in files) <= SMALL_BYTES:
            with contextlib.suppress(SemsigError, OSError):
                layers.extend(read_files([spec], files, filters=filters, crs=crs)[0])
    return tuple(layers)


def _others(catalog: Catalog, specs: Sequence[LayerSpec]) -> Iterator[LayerSpec]:
    names = {spec.name for spec in specs}
    return (spec for spec in catalog.layers if spec.role == "objects" and spec.name not in names)


def _files(spec: LayerSpec, paths: Sequence[Path]) -> list[Path]:
    files: list[Path] = []
    for path in paths:
        with contextlib.suppress(SemsigError, OSError):  # which a path of other layers raises
            files += [file for _, file in find_files([spec], [path])[0]]
    return files
