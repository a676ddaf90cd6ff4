"""What is done now and then: update a database, draft a catalogue, see ambiguity, try a city."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsProcessingParameterFolderDestination,
    QgsProcessingParameterRasterDestination,
)

from .algorithm import (
    SemsigAlgorithm,
    add_layers,
    database,
    described,
    file_to_read,
    file_to_write,
    map_to_write,
    whole_number,
)
from .arguments import command_line

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from .algorithm import Definitions

__all__ = ["Ambiguity", "Demo", "Draft", "Update"]


class Update(SemsigAlgorithm):
    """`semsig update`."""

    NAME = "update"
    TITLE = "Update a signature database"
    TAGS = ("changes", "new data")
    HELP = """
Applies new street objects to a database: only the cells that see a change are made anew. The layers
of the new objects take the place of those in the database.
"""

    def definitions(self) -> Definitions:
        """Return what goes in and out."""
        return (
            database(),
            file_to_read(
                "OBJECTS",
                "Street objects",
                "New ones: the file that “Load street objects” or a download wrote.",
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
        self.tell(command_line("update", source, objects=objects, out=written), feedback, written)
        return {"OUTPUT": written}


class Draft(SemsigAlgorithm):
    """`semsig draft`."""

    NAME = "draft"
    TITLE = "Suggest a catalogue"
    TAGS = ("catalogue", "own data", "toml")
    HELP = """
Drafts a catalogue for a file of your own: which column says what an object is, and which class of
street objects each of its values may be. Look through the draft in a text editor, mend it, and give
it to “Load street objects” as a catalogue of your own.
"""

    def definitions(self) -> Definitions:
        """Return what goes in and out."""
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


class Ambiguity(SemsigAlgorithm):
    """`semsig export --layer ambiguity` and `semsig map --ambiguity`."""

    NAME = "ambiguity"
    TITLE = "Ambiguity"
    TAGS = ("look alike", "unique", "raster", "groups")
    HELP = """
Shows how many cells see the same types in the same order: a cell alone can be told at once, one of
a thousand cannot. “Where queries can be placed” tells more, and takes longer.
"""

    def definitions(self) -> Definitions:
        """Return what goes in and out."""
        raster = QgsProcessingParameterRasterDestination("OUTPUT", "Ambiguity")
        return (
            database(),
            described(raster, "A GeoTIFF: of each cell, how many look the same."),
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
        self.tell(line, feedback, written)
        if page:
            self.tell(command_line("map", source, ambiguity=True, out=page), feedback, page)
        return {"OUTPUT": written, **({"MAP": page} if page else {})}


class Demo(SemsigAlgorithm):
    """`semsig demo`."""

    NAME = "demo"
    TITLE = "Demo city"
    TAGS = ("example", "try", "synthetic")
    HELP = """
Makes up a small city, builds its database, asks it, and shows what came out: for trying things,
without any data or network. The folder holds city.parquet for the other tools.
"""

    def definitions(self) -> Definitions:
        """Return what goes in and out."""
        folder = QgsProcessingParameterFolderDestination("OUTPUT", "Folder")
        return (
            whole_number("QUERIES", "Queries", 200, (1, 100_000), "How many are asked."),
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
        self.tell(line, feedback)
        titles = {
            "cells": "Cells",
            "objects": "Street objects",
            "evaluation_lines": "From the true to the best place",
            "evaluation": "Queries",
        }
        add_layers(context, str(Path(folder, "city.gpkg")), titles, group=self.TITLE)
        return {"OUTPUT": folder}
