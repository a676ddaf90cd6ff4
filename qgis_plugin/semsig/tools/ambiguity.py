"""Show how many cells look the same."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from qgis.core import QgsProcessingParameterRasterDestination

from ..algorithm import SemsigAlgorithm, database, described, map_to_write
from ..arguments import command_line

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from ..algorithm import Definitions

__all__ = ["Ambiguity"]


class Ambiguity(SemsigAlgorithm):
    """`semsig export --layer ambiguity` and `semsig map --ambiguity`."""

    NAME = "ambiguity"
    TITLE = "Ambiguity"
    TAGS = ("look alike", "unique", "raster", "groups")
    HELP = """
Shows how many cells see the same types in the same order: a unique cell can be identified at once,
one of a thousand cannot. “Where queries can be placed” gives more detail, and takes longer.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        raster = QgsProcessingParameterRasterDestination("OUTPUT", "Ambiguity")
        return (
            database(),
            described(raster, "A GeoTIFF: for each cell, the number of cells that look the same."),
            map_to_write("A page for the browser, on which cells can be clicked."),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig export` and `semsig map`."""
        source = self.file(parameters, "DATABASE", context)
        written = str(self.parameterAsOutputLayer(parameters, "OUTPUT", context))
        page = self.file_out(parameters, "MAP", context)
        line = command_line("export", source, layer="ambiguity", out=written)
        self.execute(line, feedback, written)
        if page:
            self.execute(command_line("map", source, ambiguity=True, out=page), feedback, page)
        return {"OUTPUT": written, **({"MAP": page} if page else {})}
