"""GeoPackage: many layers, with their styles and a project for QGIS."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.output.files import writer
from semsig_gis.output.qgis.geopackage import write_layers

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from semsig_gis.output.layers.model import Layer, Progress


@writer("layers", write_answer=write_layers)
def write_geopackage(
    layers: Sequence[Layer], path: str | Path, *, progress: Progress = None
) -> None:
    """Write layers as one GeoPackage, atomically."""
    write_layers(layers, path, progress=progress)
