"""The Processing provider: its algorithms, its icon, and the setting of the command."""

from __future__ import annotations

from pathlib import Path

from processing.core.ProcessingConfig import ProcessingConfig, Setting
from qgis.core import QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from .algorithm import SETTING
from .build import Build
from .evaluate import Evaluate
from .export import Export
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
        return "Semantic signatures"

    def longName(self) -> str:  # noqa: N802 - the names are those of QGIS
        """Return the name with what it is for."""
        return "Semantic signatures (semsig)"

    def icon(self) -> QIcon:
        """Return the icon."""
        return QIcon(self.svgIconPath())

    def svgIconPath(self) -> str:  # noqa: N802
        """Return where the icon is."""
        return str(Path(__file__).with_name("icon.svg"))

    def load(self) -> bool:
        """Add the setting and the algorithms."""
        ProcessingConfig.settingIcons[self.name()] = self.icon()
        ProcessingConfig.addSetting(
            Setting(
                self.name(),
                SETTING,
                "The semsig command (leave empty to look for it)",
                "",
                valuetype=Setting.FILE,
            )
        )
        ProcessingConfig.readSettings()
        self.refreshAlgorithms()
        return True

    def unload(self) -> None:
        """Take the setting away."""
        ProcessingConfig.removeSetting(SETTING)

    def loadAlgorithms(self) -> None:  # noqa: N802
        """Add the algorithms, in the order in which they are used."""
        for algorithm in (Load, Build, Localize, Evaluate, Identify, Export):
            self.addAlgorithm(algorithm())

    def defaultVectorFileExtension(self, _hasGeometry: bool = True) -> str:  # noqa: N802, N803, FBT001, FBT002
        """Return what a layer is written to where nothing else is said."""
        return "gpkg"

    def supportedOutputVectorLayerExtensions(self) -> list[str]:  # noqa: N802
        """Return what a layer can be written to."""
        return ["gpkg"]
