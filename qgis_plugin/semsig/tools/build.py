"""Build a signature database from street objects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..algorithm import (
    SemsigAlgorithm,
    advanced,
    area,
    choice,
    file_to_read,
    file_to_write,
    layers_to_write,
    number,
    whole_number,
)
from ..arguments import command_line
from .export import CELLS, OBJECTS, export_layers

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from ..algorithm import Definitions

__all__ = ["Build"]


class Build(SemsigAlgorithm):
    """`semsig build`."""

    NAME = "build"
    TITLE = "2. Build signature database"
    TAGS = ("cells", "grid", "visibility", "occlusion", "viewpoints")
    HELP = """
Divides the city into square cells and stores for each which street objects are seen from its
centre, clockwise from north: its signature. Queries are compared with these signatures.

Cells that see nothing are left out. A folder with the street objects, ready to be searched, is
written next to the database; keep it there.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        any_vector = "Vector files (*.parquet *.gpkg *.shp *.geojson *.zip)"
        return (
            file_to_read("OBJECTS", "Street objects", "The file that “Load street objects” wrote."),
            number(
                "STEP",
                "Side of a cell (m)",
                10.0,
                (1.0, 1000.0),
                "The paper of Weng, Gouet-Brunet and Soheilian uses 10 m.",
            ),
            number(
                "RADIUS",
                "Visibility range (m)",
                30.0,
                (1.0, 1000.0),
                "Largest distance from which an object is seen, unless the catalogue gives one for"
                " its class.",
            ),
            file_to_read(
                "BUILDINGS",
                "Buildings",
                "Building footprints; objects behind them are not seen.",
                kind=any_vector,
                optional=True,
            ),
            choice(
                "VIEWPOINTS",
                "Viewpoints",
                ("all", "outdoor", "streets"),
                "Every cell, outdoor cells, or outdoor cells near streets.",
            ),
            file_to_read(
                "STREETS",
                "Streets",
                "Centre lines, for the viewpoints along streets.",
                kind=any_vector,
                optional=True,
            ),
            area("Polygons that the cells must lie in."),
            advanced(
                whole_number(
                    "LEVELS",
                    "Angle levels",
                    16,
                    (2, 180),
                    "Number of equal sectors in which the methods of the paper compare bearings. "
                    "More sectors distinguish cells better, but tolerate smaller errors of "
                    "bearings.",
                )
            ),
            file_to_write(
                "OUTPUT",
                "Signature database",
                "The database to write. A temporary file is lost when QGIS is closed.",
            ),
            layers_to_write(
                "CELLS",
                "Cells",
                "The cells and the street objects as layers, in a GeoPackage.",
                optional=True,
            ),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig build`, and `semsig export` where layers are wished for."""
        objects = self.file(parameters, "OBJECTS", context)
        written = self.file_out(parameters, "OUTPUT", context)
        self.execute(
            command_line(
                "build",
                objects,
                out=written,
                step=self.parameterAsDouble(parameters, "STEP", context),
                radius=self.parameterAsDouble(parameters, "RADIUS", context),
                levels=self.parameterAsInt(parameters, "LEVELS", context),
                viewpoints=self.text(parameters, "VIEWPOINTS", context),
                buildings=self.file(parameters, "BUILDINGS", context),
                streets=self.file(parameters, "STREETS", context),
                area=self.polygons(parameters, "AREA", context, feedback),
            ),
            feedback,
            written,
        )
        shown = export_layers(
            self,
            (parameters, "CELLS", context, feedback),
            {**CELLS, **OBJECTS},
            written,
            objects=objects,
        )
        return {"OUTPUT": written, **shown}
