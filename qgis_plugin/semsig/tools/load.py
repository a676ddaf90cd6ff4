"""Load street objects from open data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsProcessing,
    QgsProcessingParameterCrs,
    QgsProcessingParameterEnum,
    QgsProcessingParameterFile,
    QgsProcessingParameterMultipleLayers,
)

from ..algorithm import SemsigAlgorithm, advanced, described, file_to_read, file_to_write
from ..arguments import CATALOGS, command_line
from ..command import CommandError

if TYPE_CHECKING:
    from qgis.core import (
        QgsCoordinateReferenceSystem,
        QgsProcessingContext,
        QgsProcessingFeedback,
    )

    from ..algorithm import Definitions

__all__ = ["Load"]


class Load(SemsigAlgorithm):
    """`semsig load`."""

    NAME = "load"
    TITLE = "1. Load street objects"
    TAGS = ("trees", "lamps", "benches", "open data", "openstreetmap", "catalogue")
    HELP = """
Reads files of open data (trees, street lights, benches, bus stops...) into one table of street
objects, which “Build signature database” takes.

A catalogue says which file holds what: the open data of Montpellier and of Paris, and
OpenStreetMap, are built in; for other data, write one (“Suggest a catalogue” drafts it).

The log reports how many rows became objects, how many were left out, and why.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        files = QgsProcessingParameterMultipleLayers(
            "FILES", "Files", layerType=QgsProcessing.SourceType.TypeFile, optional=True
        )
        folder = QgsProcessingParameterFile(
            "FOLDER",
            "Folder",
            behavior=QgsProcessingParameterFile.Behavior.Folder,
            optional=True,
        )
        catalogs = QgsProcessingParameterEnum(
            "CATALOGS",
            "Catalogues",
            options=list(CATALOGS),
            allowMultiple=True,
            optional=True,
            usesStaticStrings=True,
        )
        own = QgsProcessingParameterCrs("CRS", "CRS of the files", optional=True)
        metric = QgsProcessingParameterCrs("METRIC_CRS", "CRS to work in", optional=True)
        return (
            described(files, "Vector files of any format, .osm or .osm.pbf; zipped is fine."),
            described(
                folder, "A folder in which the catalogue's files are looked for, instead of files."
            ),
            described(
                catalogs,
                "The catalogues of the files. With several, objects that two of them contain are "
                "merged; the first is treated as the best source.",
            ),
            file_to_read(
                "CATALOG_FILE",
                "Catalogue of your own",
                "A catalogue file, in addition to the catalogues chosen above or instead of them.",
                kind="Catalogue (*.toml)",
                optional=True,
            ),
            advanced(described(own, "For files that do not state theirs.")),
            advanced(
                described(
                    metric,
                    "A CRS in metres; by default that of the catalogue, or the UTM zone.",
                )
            ),
            file_to_write(
                "OUTPUT",
                "Street objects",
                "The table of street objects to write. A temporary file is lost when QGIS is "
                "closed.",
            ),
            file_to_write(
                "BUILDINGS",
                "Buildings",
                "Building footprints to write too, where the files have some. “Build signature "
                "database” hides what is behind them.",
                optional=True,
            ),
            file_to_write(
                "STREETS",
                "Streets",
                "Centre lines of streets to write too, where the files have some.",
                optional=True,
            ),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig load`."""
        files = [
            *map(str, self.parameterAsFileList(parameters, "FILES", context)),
            self.file(parameters, "FOLDER", context),
        ]
        files = [path for path in files if path]  # without files, QGIS gives an empty text
        if not files:
            message = "No files were given; choose files, or the folder that holds them."
            raise CommandError(message)
        catalogs = [
            *map(str, self.parameterAsEnumStrings(parameters, "CATALOGS", context)),
            self.file(parameters, "CATALOG_FILE", context),
        ]
        catalogs = [catalog for catalog in catalogs if catalog]
        if not catalogs:
            message = "No catalogue was given; choose one, or a file of your own."
            raise CommandError(message)
        written = {
            name: self.file_out(parameters, name, context)
            for name in ("OUTPUT", "BUILDINGS", "STREETS")
        }
        self.execute(
            command_line(
                "load",
                *files,
                catalog=catalogs,
                crs=_crs_text(self.parameterAsCrs(parameters, "CRS", context)),
                metric_crs=_crs_text(self.parameterAsCrs(parameters, "METRIC_CRS", context)),
                out=written["OUTPUT"],
                buildings=written["BUILDINGS"],
                streets=written["STREETS"],
            ),
            feedback,
            written["OUTPUT"],
        )
        # Not every catalogue has buildings and streets.
        return {name: path for name, path in written.items() if path and Path(path).is_file()}


def _crs_text(crs: QgsCoordinateReferenceSystem) -> str:
    """Return the identifier of a CRS, or its WKT; empty if it is not set."""
    if not crs.isValid():
        return ""
    identifier = str(crs.authid())
    return identifier if identifier and not identifier.startswith("USER:") else str(crs.toWkt())
