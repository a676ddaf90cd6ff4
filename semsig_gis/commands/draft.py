"""`semsig draft`: a catalogue for a vector file, or for all files of a folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from semsig_gis.commands.load import Crs
from semsig_gis.commands.model import Option, Reporter, Result, command


@command(
    "draft",
    title="Draft a catalogue",
    group="Prepare",
    order=4,
    examples=(
        "semsig draft my_city/",
        "semsig draft lamps.shp --crs EPSG:2154",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Draft:
    """Draft a catalogue for a vector file or a folder of files, for you to edit."""

    file: Annotated[
        Path,
        Option("Vector file, or folder of files, to draft for.", positional=True, reads=True),
    ]
    crs: Crs = None

    def run(self, _reporter: Reporter) -> Result:
        """Return the lines of the catalogue."""
        from semsig_gis.objects import draft_catalog

        return Result(summary=[draft_catalog(self.file, crs=self.crs).removesuffix("\n")])
