"""GeoJSON: one layer, or all layers of an answer, in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.output.features import geojson_options, write_file
from semsig_gis.output.files import writer
from semsig_gis.output.files.answers import write_answer_geojson

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.output.layers.model import Layer, Progress


@writer(write_answer=write_answer_geojson)
def write_geojson(layer: Layer, path: str | Path, *, progress: Progress = None) -> None:
    """Write a layer as one GeoJSON (RFC 7946), atomically.

    Coordinates are longitude and latitude (WGS 84) to a centimetre. The member ``semsig`` holds the
    specs, the classes and the licences.
    """
    options = geojson_options(layer.abstract, layer.metadata)
    write_file(layer, path, "GeoJSON", progress, layer_options=options)
