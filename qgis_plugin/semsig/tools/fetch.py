"""Download the street objects in the extent of the canvas, or of a city."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis import utils
from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsProcessingParameterExtent,
    QgsProcessingParameterString,
)

from .. import settings
from ..algorithm import SemsigAlgorithm, area, choice, described, file_to_write
from ..arguments import SERVICES, command_line
from ..command import CommandError

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from ..algorithm import Definitions

__all__ = ["FetchCanvas", "FetchCity"]

OPENSTREETMAP = "openstreetmap"
OUTPUTS = (
    (
        "OUTPUT",
        "Street objects",
        "The table of street objects to write. A temporary file is lost when QGIS is closed.",
    ),
    (
        "BUILDINGS",
        "Buildings",
        "Building footprints to write too. “Build signature database” hides what is behind them.",
    ),
    ("STREETS", "Streets", "Centre lines of streets to write too."),
)


class _Fetch(SemsigAlgorithm):
    """`semsig fetch`."""

    def definitions(self) -> Definitions:
        """Return the parameters of the outputs."""
        return tuple(
            file_to_write(name, title, text, optional=name != "OUTPUT")
            for name, title, text in OUTPUTS
        )

    def fetch(
        self,
        place: tuple[str, str],
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Download the objects of a catalogue in an area."""
        catalog, where = place
        written = {name: self.file_out(parameters, name, context) for name, _, _ in OUTPUTS}
        server = settings.value(settings.OVERPASS) if catalog == OPENSTREETMAP else ""
        line = command_line(
            "fetch",
            catalog,
            area=where,
            server=server,
            out=written["OUTPUT"],
            buildings=written["BUILDINGS"],
            streets=written["STREETS"],
        )
        self.execute(line, feedback, written["OUTPUT"])
        return {name: path for name, path in written.items() if path and Path(path).is_file()}


class FetchCanvas(_Fetch):
    """`semsig fetch openstreetmap` of an extent."""

    NAME = "fetchcanvas"
    TITLE = "Download OpenStreetMap for this canvas"
    TAGS = ("overpass", "osm", "trees", "lamps", "download")
    HELP = """
Downloads the street objects of OpenStreetMap (trees, lamps, benches, stops...) in a part of the
map, from an Overpass server, into a table that “Build signature database” takes.

Some square kilometres take seconds to minutes. What was downloaded before is taken from the cache.
The server is a setting: Settings > Options > Processing > Providers > Semantic signatures.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        extent = QgsProcessingParameterExtent("EXTENT", "Extent", _canvas())
        text = "The extent to download; by default the extent of the canvas."
        return (described(extent, text), *super().definitions())

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig fetch`."""
        degrees = QgsCoordinateReferenceSystem("EPSG:4326")
        box = self.parameterAsExtent(parameters, "EXTENT", context, degrees)
        if box.isEmpty():
            message = "The extent is empty; zoom to a place, and use the extent of the canvas."
            raise CommandError(message)
        sides = (box.xMinimum(), box.yMinimum(), box.xMaximum(), box.yMaximum())
        where = ",".join(f"{side:.7f}" for side in sides)
        return self.fetch((OPENSTREETMAP, where), parameters, context, feedback)


def _canvas() -> str | None:
    """Return the extent of the canvas as a parameter; None without a canvas."""
    if utils.iface is None:
        return None
    canvas = utils.iface.mapCanvas()
    box, crs = canvas.extent(), canvas.mapSettings().destinationCrs().authid()
    sides = (box.xMinimum(), box.xMaximum(), box.yMinimum(), box.yMaximum())
    return f"{','.join(map(str, sides))} [{crs}]" if crs and not box.isEmpty() else None


class FetchCity(_Fetch):
    """`semsig fetch`."""

    NAME = "fetch"
    TITLE = "Fetch a city"
    TAGS = ("open data", "osm", "download", "portal")
    HELP = """
Downloads the street objects of a city: by its name, or in the polygons of a layer. A catalogue says
from where: OpenStreetMap has every place; a city's own portal has more of that city.
"""

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        place = QgsProcessingParameterString("PLACE", "Place", optional=True)
        return (
            choice(
                "CATALOG",
                "Catalogue",
                SERVICES,
                "Where the data come from.",
                default=OPENSTREETMAP,
            ),
            described(place, "Name of a city or quarter, such as Gentilly, France."),
            area("Polygons instead of a name."),
            *super().definitions(),
        )

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run `semsig fetch`."""
        place = self.text(parameters, "PLACE", context)
        where = self.polygons(parameters, "AREA", context, feedback) or place
        if not where:
            message = "No place was given; type a name, or choose a layer of polygons."
            raise CommandError(message)
        catalog = self.text(parameters, "CATALOG", context)
        return self.fetch((catalog, where), parameters, context, feedback)
