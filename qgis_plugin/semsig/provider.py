"""The Processing provider: its algorithms, its icon, and its settings."""

from __future__ import annotations

from qgis.core import QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from . import settings
from .build import Build
from .evaluate import Evaluate
from .export import Export
from .extras import Ambiguity, Demo, Draft, Update
from .fetch import FetchCanvas, FetchCity
from .identify import Identify
from .load import Load
from .localize import Localize

__all__ = ["SemsigProvider"]


class SemsigProvider(QgsProcessingProvider):
    """The algorithms that call the `semsig` command."""

    def id(self) -> str:
        """Return the first part of the algorithms' identifiers."""
        return "semsig"

    def name(self) -> str:
        """Return the name in the toolbox."""
        return settings.GROUP

    def longName(self) -> str:  # noqa: N802 - the names are those of QGIS
        """Return the name with what it is for."""
        return "Semantic signatures (semsig)"

    def icon(self) -> QIcon:
        """Return the icon."""
        return QIcon(self.svgIconPath())

    def svgIconPath(self) -> str:  # noqa: N802
        """Return where the icon is."""
        return settings.icon_path()

    def load(self) -> bool:
        """Add the settings and the algorithms."""
        settings.add_settings()
        self.refreshAlgorithms()
        return True

    def unload(self) -> None:
        """Take the settings away."""
        settings.remove_settings()

    def loadAlgorithms(self) -> None:  # noqa: N802
        """Add the algorithms, in the order in which they are used."""
        for algorithm in (
            *(Load, Build, Localize, Evaluate, Identify, Export),
            *(FetchCanvas, FetchCity, Update, Draft, Ambiguity, Demo),
        ):
            self.addAlgorithm(algorithm())

    def defaultVectorFileExtension(self, _hasGeometry: bool = True) -> str:  # noqa: N802, N803, FBT001, FBT002
        """Return what a layer is written to where nothing else is said."""
        return "gpkg"

    def supportedOutputVectorLayerExtensions(self) -> list[str]:  # noqa: N802
        """Return what a layer can be written to."""
        return ["gpkg"]
