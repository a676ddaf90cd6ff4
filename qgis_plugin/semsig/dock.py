"""The dock: click a cell, compose a view, go through the places where it may be."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransform,
    QgsGeometry,
    QgsPointXY,
    QgsProject,
    QgsSettings,
)
from qgis.gui import QgsDockWidget, QgsFileWidget, QgsMapToolEmitPoint, QgsRubberBand
from qgis.PyQt.QtCore import QSize, Qt
from qgis.PyQt.QtGui import QColor
from qgis.PyQt.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QHBoxLayout,
    QLabel,
    QListView,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from .algorithm import load_style
from .bench import Bench
from .results import WGS84, show_answer
from .wheel import Mark, Sign, Wheel, sign_icon
from .words import tr

if TYPE_CHECKING:
    from collections.abc import Callable

    from qgis.core import QgsRectangle
    from qgis.gui import QgisInterface

__all__ = ["SemsigDock"]

LAST = "semsig/database"
"""The setting that remembers the database."""
CELL, LOOKALIKE = QColor("#d55e00"), QColor("#0072b2")
LOOKALIKES = 20
SCALE = 2500.0
KIND = 0x0100  # the first role of data that is ours


class SemsigDock(QgsDockWidget):
    """Asks a city.

    Parameters
    ----------
    iface : QgisInterface
        The window of QGIS.
    """

    def __init__(self, iface: QgisInterface) -> None:
        super().__init__(tr("Semantic signatures"), iface.mainWindow())
        self.setObjectName("SemsigDock")
        self.canvas = iface.mapCanvas()
        self.bench = Bench(self)
        self.bench.opened.connect(self._opened)
        self.bench.failed.connect(self._failed)
        self.candidates: list[dict[str, Any]] = []
        self.bands: list[QgsRubberBand] = []
        self.tool: QgsMapToolEmitPoint | None = None
        self._build()

    def _build(self) -> None:
        self.database = QgsFileWidget()
        self.database.setFilter(tr("Signature databases (*.parquet)"))
        self.database.setFilePath(str(QgsSettings().value(LAST, "") or ""))
        self.open = QPushButton(tr("Open"))
        self.open.clicked.connect(self.open_database)
        self.told = QLabel(tr("Choose a signature database, and open it."))
        self.told.setWordWrap(True)
        self.click = self._tool(tr("Click a cell"), self._ask_cell)
        self.click.setToolTip(tr("Shows what is seen from a cell, and the cells most like it."))
        self.stand = self._tool(tr("Seen from here"), self._simulate)
        self.stand.setToolTip(tr("Composes the view that is seen from a place of the map."))
        self.wheel = Wheel()
        self.wheel.pressed.connect(self._add)
        self.wheel.taken.connect(self._take)
        self.palette_ = QListWidget()
        self.palette_.setViewMode(QListView.ViewMode.ListMode)
        self.palette_.setFlow(QListView.Flow.LeftToRight)
        self.palette_.setWrapping(True)
        self.palette_.setResizeMode(QListView.ResizeMode.Adjust)
        self.palette_.setIconSize(QSize(20, 20))
        self.palette_.setMaximumHeight(84)
        self.palette_.setToolTip(
            tr("Choose what you see, and click its direction in the wheel. A click takes it away.")
        )
        self.north = QCheckBox(tr("North is unknown"))
        self.clear = QPushButton(tr("Clear"))
        self.clear.clicked.connect(self.start_anew)
        self.find = QPushButton(tr("Find the place"))
        self.find.clicked.connect(self.ask_place)
        self.verdict = QLabel()
        self.verdict.setWordWrap(True)
        self.table = self._table()
        content = QWidget()
        whole = QVBoxLayout(content)
        whole.addLayout(_row(self.database, self.open))
        whole.addWidget(self.told)
        whole.addLayout(_row(self.click, self.stand))
        whole.addWidget(self.wheel, 2)
        whole.addWidget(self.palette_)
        whole.addLayout(_row(self.north, self.clear, self.find))
        whole.addWidget(self.verdict)
        whole.addWidget(self.table, 1)
        self.setWidget(content)
        self._enable(on=False)

    def _table(self) -> QTableWidget:
        """Return the list of ranks."""
        table = QTableWidget(0, 3)
        table.setHorizontalHeaderLabels([tr("Rank"), tr("Chance"), tr("Sees")])
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.verticalHeader().hide()
        table.verticalHeader().setDefaultSectionSize(22)
        table.setMinimumHeight(160)
        table.horizontalHeader().setStretchLastSection(True)
        table.itemSelectionChanged.connect(self._zoom)
        return table

    def _tool(self, title: str, asked: Callable[[QgsPointXY], None]) -> QPushButton:
        """Return a button that turns a map tool on and off."""
        button = QPushButton(title)
        button.setCheckable(True)
        button.toggled.connect(lambda on: self._use(button, asked, on=on))
        return button

    def _use(self, button: QPushButton, asked: Callable[[QgsPointXY], None], *, on: bool) -> None:
        if on:
            tool = QgsMapToolEmitPoint(self.canvas)
            tool.canvasClicked.connect(lambda point, _button: asked(self.degrees(point)))
            tool.deactivated.connect(lambda: button.setChecked(False))
            self.canvas.setMapTool(tool)
            self.tool = tool
        elif self.tool is not None and self.canvas.mapTool() is self.tool:
            self.canvas.unsetMapTool(self.tool)

    def _enable(self, *, on: bool) -> None:
        for widget in (self.click, self.stand, self.palette_, self.find, self.clear, self.wheel):
            widget.setEnabled(on)

    def open_database(self) -> None:
        """Open the database that is chosen."""
        path = self.database.filePath()
        if not path:
            self.told.setText(tr("Choose a signature database, and open it."))
            return
        QgsSettings().setValue(LAST, path)
        self._enable(on=False)
        self.told.setText(tr("Opening; a large city takes some seconds..."))
        self.bench.open(path)

    def _opened(self, city: dict[str, Any]) -> None:
        self.told.setText(
            tr("{name}: {cells} cells. Click a cell, or compose what you see.").format(
                name=city["name"], cells=f"{city['cells']:,}"
            )
        )
        self.wheel.reach = city["radius"]
        self.wheel.signs = {
            one["name"]: Sign(one["title"], one["symbol"], one["colour"], one["ink"])
            for one in city["classes"]
        }
        self.palette_.clear()
        for name, sign in self.wheel.signs.items():
            item = QListWidgetItem(sign_icon(sign), sign.title)
            item.setData(KIND, name)
            self.palette_.addItem(item)
        self.palette_.setCurrentRow(0)
        self.start_anew()
        self._enable(on=True)

    def _failed(self, message: str) -> None:
        self.told.setText(message)

    # --- Places ------------------------------------------------------------------------------

    def _to_degrees(self) -> QgsCoordinateTransform:
        return QgsCoordinateTransform(
            self.canvas.mapSettings().destinationCrs(),
            QgsCoordinateReferenceSystem(WGS84),
            QgsProject.instance(),
        )

    def degrees(self, point: QgsPointXY) -> QgsPointXY:
        """Return a place of the canvas in degrees.

        Parameters
        ----------
        point : QgsPointXY
            In the CRS of the canvas.

        Returns
        -------
        QgsPointXY
            Longitude and latitude.
        """
        return self._to_degrees().transform(point)

    def _geometry(self, places: list[list[float]]) -> QgsGeometry:
        """Return places, given as latitudes and longitudes, in the CRS of the canvas."""
        found = QgsGeometry.fromMultiPointXY([QgsPointXY(lon, lat) for lat, lon in places])
        back = QgsCoordinateTransform(
            QgsCoordinateReferenceSystem(WGS84),
            self.canvas.mapSettings().destinationCrs(),
            QgsProject.instance(),
        )
        found.transform(back)
        return found

    def _light(self, places: list[list[float]], colour: QColor, size: int) -> None:
        if not places:
            return
        band = QgsRubberBand(self.canvas)
        band.setToGeometry(self._geometry(places), None)
        band.setIcon(QgsRubberBand.IconType.ICON_CIRCLE)
        band.setIconSize(size)
        band.setColor(colour)
        band.setWidth(3)
        self.bands.append(band)

    def _unlight(self) -> None:
        for band in self.bands:
            self.canvas.scene().removeItem(band)
        self.bands = []

    # --- A cell ------------------------------------------------------------------------------

    def _ask_cell(self, point: QgsPointXY) -> None:
        self.ask_cell(point.y(), point.x())

    def ask_cell(self, lat: float, lon: float) -> None:
        """Show the cell at a place: its wheel, and its lookalikes on the canvas.

        Parameters
        ----------
        lat, lon : float
            The place in degrees.
        """
        self.bench.ask("cell", {"place": [lat, lon]}, self._show_cell)

    def _show_cell(self, cell: dict[str, Any]) -> None:
        marks = [
            Mark(one["class"], one["bearing"], metres)
            for one, metres in zip(cell["view"]["compass"], cell["distances"])
        ]
        self.wheel.show_marks(marks)
        self.north.setChecked(False)
        question = {"views": [cell["view"]], "seen_from": "cells", "top": LOOKALIKES}
        self.bench.ask("answer", question, partial(self._show_lookalikes, cell))

    def _show_lookalikes(self, cell: dict[str, Any], answer: dict[str, Any]) -> None:
        others = [one for one in answer["candidates"] if one["cell"] != cell["cell"]]
        self._unlight()
        self._light([one["place"] for one in others], LOOKALIKE, 12)
        self._light([cell["place"]], CELL, 20)
        self.told.setText(
            tr("Cell {cell} sees {types}; {alike} other cells see the same types.").format(
                cell=cell["cell"], types=cell["types"], alike=f"{cell['alike']:,}"
            )
        )
        self._list(answer, tr("The cells that a view from here would be taken for, by chance:"))

    # --- A view ------------------------------------------------------------------------------

    def _simulate(self, point: QgsPointXY) -> None:
        self.simulate(point.y(), point.x())

    def simulate(self, lat: float, lon: float) -> None:
        """Compose the view that is seen from a place.

        Parameters
        ----------
        lat, lon : float
            The place in degrees.
        """
        self.bench.ask("simulate", {"place": [lat, lon]}, self._show_view)

    def _show_view(self, told: dict[str, Any]) -> None:
        marks = [Mark(one["class"], one["bearing"]) for one in told["view"]["compass"]]
        self.wheel.show_marks(marks)
        self._unlight()
        self._light([told["truth"]["place"]], CELL, 20)
        self.told.setText(tr("This is what is seen from there; change it, or find the place."))

    def _add(self, bearing: float) -> None:
        """Add an object of the class that is chosen."""
        item = self.palette_.currentItem()
        if item is not None:
            marks = [Mark(one.kind, one.bearing) for one in self.wheel.marks]
            self.wheel.show_marks([*marks, Mark(item.data(KIND), bearing)])

    def _take(self, number: int) -> None:
        """Take an object away."""
        kept = (one for place, one in enumerate(self.wheel.marks) if place != number)
        self.wheel.show_marks([Mark(one.kind, one.bearing) for one in kept])

    def start_anew(self) -> None:
        """Compose another view."""
        self.wheel.show_marks([])
        self._unlight()
        self.verdict.setText("")
        self.table.setRowCount(0)

    def ask_place(self) -> None:
        """Find where the view on the wheel was seen."""
        marks = sorted(self.wheel.marks, key=lambda mark: mark.bearing)
        compass = [{"class": one.kind, "bearing": one.bearing, "range": None} for one in marks]
        error = "unknown" if self.north.isChecked() else None
        view = {"compass": compass, "heading_error": error, "step": None}
        self.bench.ask("answer", {"views": [view], "top": LOOKALIKES}, self._show_place)

    def _show_place(self, answer: dict[str, Any]) -> None:
        self._unlight()
        told = (
            tr("Found: the place is within {metres} m with a chance of {chance}.")
            if answer["given"]
            else tr("Cannot tell: within {metres} m of the best place with a chance of {chance}.")
        )
        chance = f"{answer['mass']:.1%}"
        self._list(answer, told.format(metres=f"{answer['radius']:g}", chance=chance))
        self.told.setText(tr("Choose a rank in the list to go there."))
        show_answer(answer, load_style)
        self._go_to([one["place"] for one in self.candidates[:3]])

    def _list(self, answer: dict[str, Any], verdict: str) -> None:
        self.candidates = answer["candidates"]
        self.verdict.setText(verdict)
        self.table.blockSignals(True)  # noqa: FBT003 - as Qt calls it
        self.table.setRowCount(len(self.candidates))
        for row, one in enumerate(self.candidates):
            for column, text in enumerate((str(one["rank"]), f"{one['chance']:.1%}", one["types"])):
                item = QTableWidgetItem(text)
                if column < 2:  # noqa: PLR2004 - the numbers
                    right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
                    item.setTextAlignment(right)
                self.table.setItem(row, column, item)
        self.table.resizeColumnsToContents()
        self.table.clearSelection()
        self.table.blockSignals(False)  # noqa: FBT003

    def _zoom(self) -> None:
        """Go to the candidate that is chosen in the list."""
        rows = self.table.selectionModel().selectedRows()
        if rows:
            self._go_to([self.candidates[rows[0].row()]["place"]])

    def _go_to(self, places: list[list[float]]) -> None:
        """Show places on the canvas, not from nearer than is of use."""
        if not places:
            return
        box: QgsRectangle = self._geometry(places).boundingBox()
        if len(places) > 1:
            box.scale(1.5)
            self.canvas.setExtent(box)
        else:
            self.canvas.setCenter(box.center())
        if self.canvas.scale() < SCALE or len(places) == 1:
            self.canvas.zoomScale(SCALE)
        self.canvas.refresh()

    def leave(self) -> None:
        """Put everything back; the plugin is unloaded."""
        self._unlight()
        if self.tool is not None:
            self.canvas.unsetMapTool(self.tool)
        self.bench.close()


def _row(*widgets: QWidget) -> QHBoxLayout:
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    return row
