"""Measure how far the answers to distorted queries are from the true places."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsProcessingOutputNumber,
    QgsProcessingParameterFolderDestination,
    QgsProcessingParameterString,
)

from ..algorithm import (
    SemsigAlgorithm,
    advanced,
    choice,
    database,
    described,
    layers_to_write,
    map_to_write,
    whole_number,
)
from ..arguments import (
    DISTORTIONS,
    LIKELIHOOD,
    METHOD_HELP,
    METHODS,
    NOISES,
    command_line,
    require_likelihood,
)
from .export import export_layers

if TYPE_CHECKING:
    from qgis.core import (
        QgsProcessingContext,
        QgsProcessingFeedback,
    )

    from ..algorithm import Definitions

__all__ = ["Evaluate"]

LAYERS = {"evaluation": "Queries", "evaluation_lines": "From the true to the best place"}


class Evaluate(SemsigAlgorithm):
    """`semsig evaluate` and `semsig map`."""

    NAME = "evaluate"
    TITLE = "4. Evaluate"
    TAGS = ("error", "recall", "queries", "distortion", "accuracy")
    HELP = """
Measures how often answers are right. Cells are drawn as queries, their signatures are distorted as
a bad detector would (objects missed, made up or misnamed, bearings off), and the best answer is
compared with the true place.

The log has a table of the results; the folder contains them for other programs, and the layers and
the map page show them.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        more = QgsProcessingParameterString("MORE", "Further distortions", optional=True)
        folder = QgsProcessingParameterFolderDestination("OUTPUT", "Folder for the results")
        return (
            database(),
            whole_number(
                "QUERIES", "Number of queries", 500, (1, 1_000_000), "How many queries are asked."
            ),
            choice(
                "DISTORTION",
                "Distortion",
                DISTORTIONS,
                "How many objects the detector gets wrong: none, 1, 7 or 13.",
                default="medium",
            ),
            advanced(
                described(
                    more,
                    "More distortions of a query, separated by commas, such as compass:10,view:90 "
                    "(a compass that is off by 10°, a view of 90°).",
                )
            ),
            choice("METHOD", "Method", METHODS, METHOD_HELP),
            choice(
                "NOISE",
                "Detector",
                NOISES,
                "With likelihood, how much of what is seen may be wrong: light, medium, strong, or "
                "generic where that is not known, by-hand for what a person noted down.",
            ),
            whole_number(
                "TOP",
                "Best candidates that count",
                1,
                (1, 100_000),
                "A query counts as right if one of this many candidates is right.",
            ),
            advanced(
                whole_number(
                    "SEED", "Seed", 0, (0, 2**31 - 1), "Another number draws other queries."
                )
            ),
            described(folder, "The queries, their errors and a summary, for other programs."),
            layers_to_write(
                "LAYERS",
                "Queries",
                "The queries at their true places, and lines to the places that were found, in a "
                "GeoPackage.",
                optional=True,
            ),
            map_to_write(
                "A page for the browser: successful and failed queries, and where they fail."
            ),
        )

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:  # noqa: N802
        """Add the parameters and the computed output."""
        super().initAlgorithm(configuration)
        self.addOutput(
            QgsProcessingOutputNumber("WITHIN_50_M", "Chance of an error of 50 m or less")
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig evaluate`, then `semsig map` if a page is requested."""
        source = self.file(parameters, "DATABASE", context)
        folder = self.file_out(parameters, "OUTPUT", context)
        results = Path(folder, "evaluation.json")
        page = self.file_out(parameters, "MAP", context)
        method = self.text(parameters, "METHOD", context)
        noise = self.text(parameters, "NOISE", context)
        if noise != NOISES[0]:
            require_likelihood(method, "Detector")
        distortions = [
            self.text(parameters, "DISTORTION", context),
            self.text(parameters, "MORE", context),
        ]
        self.execute(
            command_line(
                "evaluate",
                source,
                out=folder,
                queries=self.parameterAsInt(parameters, "QUERIES", context),
                distortion=",".join(filter(None, distortions)),
                method=method,
                noise=noise if method == LIKELIHOOD else "",
                top=self.parameterAsInt(parameters, "TOP", context),
                seed=self.parameterAsInt(parameters, "SEED", context),
            ),
            feedback,
            str(results),
        )
        summary = json.loads(results.read_text(encoding="utf-8"))
        within = summary["results"]["p_error_within_m"]["50"]
        shown = export_layers(
            self, (parameters, "LAYERS", context, feedback), LAYERS, source, evaluation=folder
        )
        outputs = {"OUTPUT": folder, "WITHIN_50_M": within, **shown}
        if page:
            self.execute(command_line("map", source, evaluation=folder, out=page), feedback, page)
            outputs["MAP"] = page
        return outputs
