"""Export the cells of a signature database as layers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..algorithm import (
    SemsigAlgorithm,
    choice,
    database,
    file_to_read,
    layers_to_write,
    show_layers,
)
from ..arguments import command_line

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from ..algorithm import Definitions

__all__ = ["CELLS", "OBJECTS", "Export", "export_layers"]

CELLS = {"cells": "Cells"}
OBJECTS = {"objects": "Street objects"}
"""Titles of layers."""


class Export(SemsigAlgorithm):
    """`semsig export`."""

    NAME = "export"
    TITLE = "6. Export cells"
    TAGS = ("geopackage", "cells", "layers")
    HELP = """
Writes the cells of a database to a GeoPackage: what is seen from each, clockwise from north, and
how many other cells look the same; with the street objects, these become a second layer.

If “Where queries can be placed” was run, its results are written with the cells.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        return (
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
            layers_to_write("OUTPUT", "Cells", "The GeoPackage to write."),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig export`."""
        objects = self.file(parameters, "OBJECTS", context)
        return export_layers(
            self,
            (parameters, "OUTPUT", context, feedback),
            {**CELLS, **OBJECTS} if objects else CELLS,
            self.file(parameters, "DATABASE", context),
            objects=objects,
            geometry=self.text(parameters, "GEOMETRY", context),
        )


def export_layers(
    algorithm: SemsigAlgorithm,
    run: tuple[dict[str, Any], str, QgsProcessingContext, QgsProcessingFeedback],
    titles: dict[str, str],
    database: str,
    **options: str,
) -> dict[str, Any]:
    """Write layers to a GeoPackage and show them, if this is requested.

    Parameters
    ----------
    algorithm : SemsigAlgorithm
        The algorithm that runs.
    run : tuple
        The values of the parameters, the name of the parameter with the file to write, the context
        and the feedback of the run.
    titles : dict of str to str
        Titles of the layers to write and show, by their names.
    database : str
        The signature database.
    **options : str
        Options of `semsig export`.

    Returns
    -------
    dict
        The first layer by the name of its parameter; empty if no file is requested.
    """
    parameters, name, context, feedback = run
    path = str(algorithm.parameterAsOutputLayer(parameters, name, context) or "")
    if not path:
        return {}
    algorithm.execute(
        command_line("export", database, out=path, layer=list(titles), **options), feedback, path
    )
    return {name: show_layers(context, path, titles, group=algorithm.TITLE)}
