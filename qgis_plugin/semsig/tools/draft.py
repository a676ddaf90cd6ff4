"""Draft a catalogue for a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..algorithm import SemsigAlgorithm, file_to_read, file_to_write
from ..arguments import command_line

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from ..algorithm import Definitions

__all__ = ["Draft"]


class Draft(SemsigAlgorithm):
    """`semsig draft`."""

    NAME = "draft"
    TITLE = "Suggest a catalogue"
    TAGS = ("catalogue", "own data", "toml")
    HELP = """
Drafts a catalogue for a file of your own: which column contains the kind of an object, and which
class of street objects each of its values may be. Check and correct the draft in a text editor, and
give it to “Load street objects” as a catalogue of your own.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        any_vector = "Vector files (*.gpkg *.shp *.geojson *.parquet *.csv *.zip *.fgb *.kml *.gml)"
        return (
            file_to_read("FILE", "File", "A vector file of any format.", kind=any_vector),
            file_to_write("OUTPUT", "Catalogue", "The draft to write.", kind="Catalogue (*.toml)"),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig draft`, and write what it prints."""
        drafted = self.call(command_line("draft", self.file(parameters, "FILE", context)), feedback)
        written = self.file_out(parameters, "OUTPUT", context)
        Path(written).parent.mkdir(parents=True, exist_ok=True)
        Path(written).write_text(drafted, encoding="utf-8")
        feedback.pushInfo(drafted)
        return {"OUTPUT": written}
