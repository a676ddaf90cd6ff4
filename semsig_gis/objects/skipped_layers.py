"""Read layers that were not requested, if that is cheap, to report how many objects they have."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from semsig_gis.core import SemsigError
from semsig_gis.objects.layers import read_files
from semsig_gis.sources import READERS, find_files

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from semsig_gis.core import AnyCrs
    from semsig_gis.sources import Catalog, LayerSpec, RawLayer

# Files up to this size are read in about a second.
SMALL_BYTES = 2**21


def layers_in_same_extracts(catalog: Catalog, specs: Sequence[LayerSpec]) -> tuple[LayerSpec, ...]:
    """Return the other layers in the same OpenStreetMap extracts as `specs`.

    They can be counted without reading another file, because an extract is always read completely.
    """
    files = {spec.files for spec in specs if READERS[spec.reader].merging}
    others = (spec for spec in _others(catalog, specs) if READERS[spec.reader].merging)
    return tuple(spec for spec in others if spec.files in files)


def read_small_layers(
    catalog: Catalog,
    specs: Sequence[LayerSpec],
    paths: Sequence[Path],
    *,
    filters: bool = True,
    crs: AnyCrs | None = None,
) -> tuple[RawLayer, ...]:
    """Read the other layers with small files; layers that cannot be read are skipped silently."""
    layers: list[RawLayer] = []
    for spec in _others(catalog, specs):
        files: list[Path] = []
        for path in paths:
            with contextlib.suppress(SemsigError, OSError):  # the path is of another layer
                files += [file for _, file in find_files([spec], [path])[0]]
        if files and sum(file.stat().st_size for file in files) <= SMALL_BYTES:
            with contextlib.suppress(SemsigError, OSError):
                layers.extend(read_files([spec], files, filters=filters, crs=crs)[0])
    return tuple(layers)


def _others(catalog: Catalog, specs: Sequence[LayerSpec]) -> Iterator[LayerSpec]:
    names = {spec.name for spec in specs}
    return (
        spec
        for spec in catalog.layers
        if spec.role == "objects" and spec.derive is None and spec.name not in names
    )
