"""KML: all layers of an answer, in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.output.files import writer
from semsig_gis.output.files.answers import write_answer_kml

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from semsig_gis.output.layers.model import Layer


@writer("answer")
def write_kml(layers: Sequence[Layer], path: str | Path) -> None:
    """Write the layers of an answer as one KML 2.2, atomically."""
    write_answer_kml(layers, path)
