"""Apply new street objects to a signature database."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..algorithm import SemsigAlgorithm, database, file_to_read, file_to_write
from ..arguments import command_line

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from ..algorithm import Definitions

__all__ = ["Update"]


class Update(SemsigAlgorithm):
    """`semsig update`."""

    NAME = "update"
    TITLE = "Update a signature database"
    TAGS = ("changes", "new data")
    HELP = """
Applies new street objects to a database: only the cells that see a change are computed again. The
layers of the new objects replace the same layers of the database.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        return (
            database(),
            file_to_read(
                "OBJECTS",
                "Street objects",
                "The new objects: the file that “Load street objects” or a download wrote.",
            ),
            file_to_write("OUTPUT", "Updated database", "The database to write."),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig update`."""
        written = self.file_out(parameters, "OUTPUT", context)
        source = self.file(parameters, "DATABASE", context)
        objects = self.file(parameters, "OBJECTS", context)
        self.execute(
            command_line("update", source, objects=objects, out=written), feedback, written
        )
        return {"OUTPUT": written}
