"""Make up a small city and evaluate queries in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis.core import QgsProcessingParameterFolderDestination

from ..algorithm import SemsigAlgorithm, add_layers, described, whole_number
from ..arguments import command_line

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from ..algorithm import Definitions

__all__ = ["Demo"]


class Demo(SemsigAlgorithm):
    """`semsig demo`."""

    NAME = "demo"
    TITLE = "Demo city"
    TAGS = ("example", "try", "synthetic")
    HELP = """
Makes up a small city, builds its database, evaluates queries and shows the results: to try the
tools without data or a network. The folder contains city.parquet for the other tools.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        folder = QgsProcessingParameterFolderDestination("OUTPUT", "Folder")
        return (
            whole_number("QUERIES", "Queries", 200, (1, 100_000), "How many queries are asked."),
            whole_number("SEED", "Seed", 0, (0, 2**31 - 1), "Another number makes another city."),
            described(folder, "Folder to write to."),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig demo`, and show its layers."""
        folder = self.file_out(parameters, "OUTPUT", context)
        line = command_line(
            "demo",
            out=folder,
            queries=self.parameterAsInt(parameters, "QUERIES", context),
            seed=self.parameterAsInt(parameters, "SEED", context),
        )
        self.execute(line, feedback)
        titles = {
            "cells": "Cells",
            "objects": "Street objects",
            "evaluation_lines": "From the true to the best place",
            "evaluation": "Queries",
        }
        add_layers(context, str(Path(folder, "city.gpkg")), titles, group=self.TITLE)
        return {"OUTPUT": folder}
