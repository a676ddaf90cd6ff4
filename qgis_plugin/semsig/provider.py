"""The Processing provider: its algorithms, its icon, and its settings."""

from __future__ import annotations

from qgis.core import QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from . import settings
from .algorithm import SemsigAlgorithm
from .arguments import read_commands
from .tools import make_tools

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
        """Return the name with the name of the command."""
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
        """Remove the settings."""
        settings.remove_settings()

    def loadAlgorithms(self) -> None:  # noqa: N802
        """Add an algorithm for each tool."""
        commands = read_commands()
        for tool in make_tools(commands).values():
            self.addAlgorithm(SemsigAlgorithm(tool, commands))

    def defaultVectorFileExtension(self, _hasGeometry: bool = True) -> str:  # noqa: N802, N803, FBT001, FBT002
        """Return the suffix of layers by default."""
        return "gpkg"

    def supportedOutputVectorLayerExtensions(self) -> list[str]:  # noqa: N802
        """Return the suffixes that layers can have."""
        return ["gpkg"]
