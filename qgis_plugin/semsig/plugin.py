"""The plugin object that QGIS loads and unloads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from qgis.core import QgsApplication
from qgis.PyQt.QtCore import QCoreApplication, Qt
from qgis.PyQt.QtGui import QIcon

from . import settings
from .provider import SemsigProvider
from .translation import install_translator, tr

if TYPE_CHECKING:
    from qgis.gui import QgisInterface
    from qgis.PyQt.QtWidgets import QMenu, QTextBrowser, QToolBar

    from .dock import SemsigDock
    from .installer import EngineDialog

__all__ = ["SemsigPlugin"]

HERE = Path(__file__).parent


class SemsigPlugin:
    """The plugin: a Processing provider, and a menu.

    Parameters
    ----------
    iface : QgisInterface or None
        The window of QGIS; None without a window.
    """

    def __init__(self, iface: QgisInterface | None = None) -> None:
        self.iface = iface
        self.translator = install_translator()
        self.provider: SemsigProvider | None = None
        self.menu: QMenu | None = None
        self.bar: QToolBar | None = None
        self.dialog: EngineDialog | None = None
        self.dock: SemsigDock | None = None
        self.help: QTextBrowser | None = None

    def initProcessing(self) -> None:  # noqa: N802 - the names are those of QGIS
        """Add the provider; `qgis_process` calls only this."""
        self.provider = SemsigProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:  # noqa: N802
        """Add the provider, and the menu to a QGIS with a window."""
        self.initProcessing()
        if self.iface is None:
            return
        icon = QIcon(settings.icon_path())
        self.menu = self.iface.pluginMenu().addMenu(icon, tr("Semantic signatures"))
        self.menu.addAction(icon, tr("Explore a city")).triggered.connect(self.show_dock)
        self.menu.addAction(tr("Engine...")).triggered.connect(self.show_engine)
        self.menu.addAction(tr("Help")).triggered.connect(self.show_help)
        self.bar = self.iface.addToolBar(tr("Semantic signatures"))
        self.bar.setObjectName("SemsigToolBar")
        self.bar.addAction(icon, tr("Explore a city")).triggered.connect(self.show_dock)

    def show_dock(self) -> None:
        """Show the dock to explore a city."""
        from .dock import SemsigDock

        if self.dock is None and self.iface is not None:
            self.dock = SemsigDock(self.iface)
            self.iface.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, self.dock)
        if self.dock is not None:
            self.dock.show()
            self.dock.raise_()

    def show_engine(self) -> None:
        """Show the dialog that installs the engine."""
        from .installer import EngineDialog

        if self.dialog is None and self.iface is not None:
            self.dialog = EngineDialog(self.iface.mainWindow())
        if self.dialog is not None:
            self.dialog.show_state()
            self.dialog.show()
            self.dialog.raise_()

    def show_help(self) -> None:
        """Show the help, a page of the documentation."""
        from qgis.PyQt.QtWidgets import QTextBrowser

        if self.help is None and self.iface is not None:
            self.help = QTextBrowser(self.iface.mainWindow())
            self.help.setWindowFlags(Qt.WindowType.Window)
            self.help.setWindowTitle(tr("Semantic signatures"))
            self.help.setOpenExternalLinks(True)
            self.help.setMarkdown((HERE / "help.md").read_text("utf-8"))
            self.help.resize(760, 720)
        if self.help is not None:
            self.help.show()
            self.help.raise_()

    def unload(self) -> None:
        """Remove all parts of the plugin."""
        if self.dialog is not None:
            self.dialog.cancel()
            self.dialog.deleteLater()
        if self.dock is not None and self.iface is not None:
            self.dock.clean_up()
            self.iface.removeDockWidget(self.dock)
            self.dock.deleteLater()
        for widget in (self.menu, self.bar, self.help):
            if widget is not None:
                widget.deleteLater()
        QgsApplication.processingRegistry().removeProvider(self.provider)
        if self.translator is not None:
            QCoreApplication.removeTranslator(self.translator)
