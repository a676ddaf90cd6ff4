"""Predict where in a city queries can be located."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..algorithm import (
    SemsigAlgorithm,
    advanced,
    choice,
    database,
    layers_to_write,
    map_to_write,
    number,
    whole_number,
)
from ..arguments import NOISES, command_line
from .export import CELLS, export_layers

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from ..algorithm import Definitions

__all__ = ["Identify"]


class Identify(SemsigAlgorithm):
    """`semsig identify` and `semsig map`."""

    NAME = "identify"
    TITLE = "5. Where queries can be placed"
    TAGS = ("identifiability", "ambiguous", "map", "chance", "uniqueness")
    HELP = """
Predicts for every cell how likely a query from there will be found, and which other cells it may be
confused with. A street with three lamps looks like thousands of others; this tool shows them.

The results become columns of the database, and the cells are shown by their chance. The map page,
which opens in a browser, shows on a click which cells a cell may be confused with.

A large city takes minutes. Results that exist are not computed again.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        return (
            database(),
            choice(
                "NOISE",
                "Detector",
                NOISES,
                "How much of what is seen will be wrong: light, medium, strong, or generic where "
                "that is not known, by-hand for what a person notes down.",
            ),
            number(
                "RADIUS",
                "Found within (m)",
                50.0,
                (1.0, 10_000.0),
                "A query counts as found if its best place is at most this far from the true "
                "place.",
            ),
            advanced(
                whole_number(
                    "SEED", "Seed", 0, (0, 2**31 - 1), "Another number simulates other queries."
                )
            ),
            layers_to_write("CELLS", "Cells", "The cells by their chance, in a GeoPackage."),
            map_to_write("A page for the browser, on which cells can be clicked."),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig identify`, then `semsig export` and `semsig map`."""
        source = self.file(parameters, "DATABASE", context)
        self.execute(
            command_line(
                "identify",
                source,
                noise=self.text(parameters, "NOISE", context),
                radius=self.parameterAsDouble(parameters, "RADIUS", context),
                seed=self.parameterAsInt(parameters, "SEED", context),
            ),
            feedback,
        )
        shown = export_layers(self, (parameters, "CELLS", context, feedback), CELLS, source)
        page = self.file_out(parameters, "MAP", context)
        if page:
            self.execute(
                command_line("map", source, identifiability=True, out=page), feedback, page
            )
            shown["MAP"] = page
        return shown
