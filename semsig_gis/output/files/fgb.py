"""FlatGeobuf: one layer with a spatial index."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.output.features import write_file
from semsig_gis.output.files import writer

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.output.layers.model import Layer, Progress


@writer()
def write_flatgeobuf(layer: Layer, path: str | Path, *, progress: Progress = None) -> None:
    """Write a layer as one FlatGeobuf, atomically.

    Its metadata hold the specs, the classes and the licences as JSON, by name.
    """
    options = {"TITLE": layer.title, "DESCRIPTION": layer.abstract}
    metadata = layer.metadata_texts
    write_file(layer, path, "FlatGeobuf", progress, layer_metadata=metadata, layer_options=options)
