"""A signature database becomes layers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .algorithm import (
    SemsigAlgorithm,
    cells,
    choice,
    database,
    file_to_read,
    layer_source,
    show_layers,
)
from .arguments import command_line

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

__all__ = ["Export", "export_cells"]


class Export(SemsigAlgorithm):
    """`semsig export`."""

    NAME = "export"
    TITLE = "6. Export cells"
    TAGS = ("geopackage", "cells", "layers")
    HELP = """
Writes the cells of a database to a GeoPackage: what is seen from each, clockwise from north, and
how many other cells look the same; with the street objects, these become a second layer.

If “Where queries can be placed” was run, what it found goes with the cells.
"""

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:  # noqa: N802, ARG002
        """Say what goes in and out."""
        for parameter in (
            database(),
            file_to_read(
                "OBJECTS",
                "Street objects",
                "The file that “Load street objects” wrote, for a second layer.",
                optional=True,
            ),
            choice(
                "GEOMETRY",
                "A cell is drawn as",
                ("polygon", "point"),
                "Its square, or its centre.",
            ),
            cells("OUTPUT", "Cells", "The GeoPackage to write."),
        ):
            self.addParameter(parameter)

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig export`."""
        return export_cells(
            self,
            self.file(parameters, "DATABASE", context),
            (parameters, "OUTPUT"),
            context,
            feedback,
            objects=self.file(parameters, "OBJECTS", context),
            geometry=self.text(parameters, "GEOMETRY", context),
        )


def export_cells(
    algorithm: SemsigAlgorithm,
    source: str,
    destination: tuple[dict[str, Any], str],
    context: QgsProcessingContext,
    feedback: QgsProcessingFeedback,
    *,
    objects: str = "",
    geometry: str = "",
) -> dict[str, Any]:
    """Write the cells of a database, and let them be shown, where that is wished for.

    Parameters
    ----------
    algorithm : SemsigAlgorithm
        Who asks.
    source : str
        The database.
    destination : tuple of dict and str
        The values of the parameters, and the name of the one that says where to write to.
    context : QgsProcessingContext
        Where layers to be shown are listed.
    feedback : QgsProcessingFeedback
        Who hears of it.
    objects : str, default ""
        Street objects for a second layer.
    geometry : str, default ""
        How a cell is drawn.

    Returns
    -------
    dict
        The layer by the name of its parameter; empty where none is wished for.
    """
    parameters, name = destination
    path = str(algorithm.parameterAsOutputLayer(parameters, name, context) or "")
    if not path:
        return {}
    algorithm.tell(
        command_line("export", source, out=path, objects=objects, geometry=geometry), feedback
    )
    # The last to be listed is drawn on top.
    titles = {"cells": "Cells", **({"objects": "Street objects"} if objects else {})}
    show_layers(context, path, titles)
    return {name: layer_source(path, "cells")}
