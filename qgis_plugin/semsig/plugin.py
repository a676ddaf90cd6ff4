"""What QGIS loads and unloads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from qgis.core import QgsApplication
from qgis.PyQt.QtGui import QIcon

from . import settings
from .provider import SemsigProvider
from .words import tr

if TYPE_CHECKING:
    from qgis.gui import QgisInterface
    from qgis.PyQt.QtWidgets import QMenu

    from .installer import EngineDialog

__all__ = ["SemsigPlugin"]


class SemsigPlugin:
    """The plugin: a Processing provider, and a menu.

    Parameters
    ----------
    iface : QgisInterface or None
        The window of QGIS; None where there is none.
    """

    def __init__(self, iface: QgisInterface | None = None) -> None:
        self.iface = iface
        self.provider: SemsigProvider | None = None
        self.menu: QMenu | None = None
        self.dialog: EngineDialog | None = None

    def initProcessing(self) -> None:  # noqa: N802 - the names are those of QGIS
        """Add the provider; all that `qgis_process` calls."""
        self.provider = SemsigProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:  # noqa: N802
        """Add the provider, and the menu to a QGIS with a window."""
        self.initProcessing()
        if self.iface is None:
            return
        self.menu = self.iface.pluginMenu().addMenu(
            QIcon(settings.icon_path()), tr("Semantic signatures")
        )
        self.menu.addAction(tr("Engine...")).triggered.connect(self.show_engine)

    def show_engine(self) -> None:
        """Show the dialog that installs the engine."""
        from .installer import EngineDialog

        if self.dialog is None and self.iface is not None:
            self.dialog = EngineDialog(self.iface.mainWindow())
        if self.dialog is not None:
            self.dialog.show_state()
            self.dialog.show()
            self.dialog.raise_()

    def unload(self) -> None:
        """Take all of it away."""
        if self.dialog is not None:
            self.dialog.cancel()
            self.dialog.deleteLater()
        if self.menu is not None:
            self.menu.deleteLater()
        QgsApplication.processingRegistry().removeProvider(self.provider)
