"""The dock to explore a city: click a cell, compose a view, and list the places that match."""

from __future__ import annotations

import contextlib
import tempfile
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis.core import (
    Qgis,
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
    QLineEdit,
    QListView,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from .answers import doubt, likely, links_line, percent, words
from .compass_dial import CompassDial, Mark, Sign, sign_icon
from .results import remove_answer, replace_answer, restore_cells
from .server import CityServer
from .translation import tr

if TYPE_CHECKING:
    from collections.abc import Callable

    from qgis.core import QgsRectangle
    from qgis.gui import QgisInterface

__all__ = ["SemsigDock"]

WGS84 = "EPSG:4326"
LAST_DATABASE = "semsig/database"
"""The setting with the last opened database."""
CELL_COLOUR, LOOKALIKE_COLOUR = QColor("#d55e00"), QColor("#0072b2")
LOOKALIKES = 20
LARGEST_SCALE = 2500.0  # denominator
WIDEST = 110  # pixels, of a column of the table
CLASS_ROLE, WORDS_ROLE = 0x0100, 0x0101  # the first roles for data of plugins


class SemsigDock(QgsDockWidget):
    """The dock.

    Parameters
    ----------
    iface : QgisInterface
        The window of QGIS.
    """

    def __init__(self, iface: QgisInterface) -> None:
        super().__init__(tr("Semantic signatures"), iface.mainWindow())
        self.setObjectName("SemsigDock")
        self.canvas = iface.mapCanvas()
        self.server = CityServer(self)
        self.server.opened.connect(self._show_city)
        self.candidates: list[dict[str, Any]] = []
        self.titles: dict[str, str] = {}  # of classes, by symbol
        self.bands: list[QgsRubberBand] = []
        self.tool: QgsMapToolEmitPoint | None = None
        self.answers = tempfile.TemporaryDirectory(prefix="semsig")
        self.answered = 0  # number of answers, each in a file of its own
        self._create_widgets()
        self.server.failed.connect(self.message.setText)
        self._lay_out_widgets()
        self._enable(on=False)

    def _create_widgets(self) -> None:
        self.database = QgsFileWidget()
        self.database.setFilter(tr("Signature databases (*.parquet)"))
        self.database.setFilePath(str(QgsSettings().value(LAST_DATABASE, "") or ""))
        self.open = QPushButton(tr("Open"))
        self.open.clicked.connect(self.open_database)
        self.message = QLabel(tr("Choose a signature database, and open it."))
        self.message.setWordWrap(True)
        self.cell_tool = self._tool(tr("Click a cell"), self.ask_cell)
        self.cell_tool.setToolTip(tr("Shows what is seen from a cell, and the most similar cells."))
        self.view_tool = self._tool(tr("Seen from here"), self.simulate)
        self.view_tool.setToolTip(tr("Composes the view that is seen from a place of the map."))
        self.dial = CompassDial()
        self.dial.bearing_clicked.connect(self._add_object)
        self.dial.mark_clicked.connect(self._remove_object)
        self.search = QLineEdit()
        self.search.setPlaceholderText(tr("Find a class"))
        self.search.setClearButtonEnabled(True)
        self.search.textChanged.connect(self._filter_classes)
        self.palette_ = QListWidget()
        self.palette_.setViewMode(QListView.ViewMode.ListMode)
        self.palette_.setFlow(QListView.Flow.LeftToRight)
        self.palette_.setWrapping(True)
        self.palette_.setResizeMode(QListView.ResizeMode.Adjust)
        self.palette_.setIconSize(QSize(20, 20))
        self.palette_.setMaximumHeight(84)
        self.palette_.setToolTip(
            tr(
                "Choose what you see, and click its direction in the dial. Click an object to "
                "remove it."
            )
        )
        self.north = QCheckBox(tr("North is unknown"))
        self.clear = QPushButton(tr("Clear"))
        self.clear.clicked.connect(self.clear_view)
        self.find = QPushButton(tr("Find the place"))
        self.find.clicked.connect(self.ask_place)
        self.verdict = QLabel()
        self.verdict.setWordWrap(True)
        self.verdict.setTextFormat(Qt.TextFormat.RichText)
        self.verdict.setOpenExternalLinks(True)
        self.table = self._candidate_table()

    def _lay_out_widgets(self) -> None:
        content = QWidget()
        layout = QVBoxLayout(content)
        layout.addLayout(_row(self.database, self.open))
        layout.addWidget(self.message)
        layout.addLayout(_row(self.cell_tool, self.view_tool))
        layout.addWidget(self.dial, 2)
        layout.addWidget(self.search)
        layout.addWidget(self.palette_)
        layout.addLayout(_row(self.north, self.clear, self.find))
        layout.addWidget(self.verdict)
        layout.addWidget(self.table, 1)
        self.setWidget(content)

    def _candidate_table(self) -> QTableWidget:
        """Return the table of candidates."""
        table = QTableWidget(0, 4)
        table.setHorizontalHeaderLabels([tr("Rank"), tr("Chance"), tr("Place"), tr("Sees")])
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        table.verticalHeader().hide()
        table.verticalHeader().setDefaultSectionSize(22)
        table.setMinimumHeight(160)
        table.horizontalHeader().setStretchLastSection(True)
        table.horizontalHeader().setMaximumSectionSize(WIDEST)
        table.itemSelectionChanged.connect(self._zoom_to_selected)
        return table

    def _tool(self, title: str, action: Callable[[float, float], None]) -> QPushButton:
        """Return a button for a map tool that calls `action` with latitude and longitude."""
        button = QPushButton(title)
        button.setCheckable(True)

        def ask(point: QgsPointXY, _button: object) -> None:
            place = self.degrees(point)
            action(place.y(), place.x())

        def use(on: bool) -> None:  # noqa: FBT001 - as Qt calls it
            if on:
                tool = QgsMapToolEmitPoint(self.canvas)
                tool.canvasClicked.connect(ask)
                tool.deactivated.connect(lambda: button.setChecked(False))
                self.canvas.setMapTool(tool)
                self.tool = tool
            elif self.tool is not None and self.canvas.mapTool() is self.tool:
                self.canvas.unsetMapTool(self.tool)

        button.toggled.connect(use)
        return button

    def _enable(self, *, on: bool) -> None:
        tools = (self.cell_tool, self.view_tool)
        for widget in (*tools, self.search, self.palette_, self.find, self.clear, self.dial):
            widget.setEnabled(on)

    def open_database(self) -> None:
        """Open the chosen database."""
        path = self.database.filePath()
        if not path:
            self.message.setText(tr("Choose a signature database, and open it."))
            return
        QgsSettings().setValue(LAST_DATABASE, path)
        self._enable(on=False)
        self.message.setText(tr("Opening; a large city takes some seconds..."))
        self.server.open(path)

    def _show_city(self, city: dict[str, Any]) -> None:
        """Show the name and the classes of the opened city."""
        self.message.setText(
            tr("{name}: {cells} cells. Click a cell, or compose what you see.").format(
                name=city["name"], cells=f"{city['cells']:,}"
            )
        )
        self.dial.reach = city["reach"]
        families, classes = city.get("families", []), city["classes"]
        # By family, each with an entry for any of its classes; the commonest classes first.
        kinds = []
        for family in families or [{"name": ""}]:
            kinds += [family] if family["name"] else []
            kinds += [item for item in classes if item.get("family", "") == family["name"]]
        kinds += [item for item in classes if item not in kinds]
        self.dial.signs = {
            item["name"]: Sign(
                item["title"],
                item.get("symbol", ""),
                item["colour"],
                item["ink"],
                item.get("pictogram", ""),
            )
            for item in kinds
        }
        self.titles = {sign.symbol: sign.title for sign in self.dial.signs.values()}
        self.palette_.clear()
        for item in kinds:
            sign = self.dial.signs[item["name"]]
            entry = QListWidgetItem(sign_icon(sign), sign.title)
            entry.setData(CLASS_ROLE, item["name"])
            entry.setData(WORDS_ROLE, "\n".join([sign.title, *item.get("words", [])]).lower())
            self.palette_.addItem(entry)
        self.palette_.setCurrentRow(0)
        self.clear_view()
        self._enable(on=True)

    def _filter_classes(self, text: str) -> None:
        """Show the classes with a title or another word that contains a text."""
        shown = []
        for row in range(self.palette_.count()):
            entry = self.palette_.item(row)
            hidden = text.strip().lower() not in entry.data(WORDS_ROLE)
            entry.setHidden(hidden)
            shown += [] if hidden else [row]
        if shown and self.palette_.currentRow() not in shown:
            self.palette_.setCurrentRow(shown[0])

    # --- Places ------------------------------------------------------------------------------

    def _to_canvas(self) -> QgsCoordinateTransform:
        """Return the transformation from degrees to the CRS of the canvas."""
        degrees = QgsCoordinateReferenceSystem(WGS84)
        crs = self.canvas.mapSettings().destinationCrs()
        return QgsCoordinateTransform(degrees, crs, QgsProject.instance())

    def degrees(self, point: QgsPointXY) -> QgsPointXY:
        """Return a place of the canvas in degrees.

        Parameters
        ----------
        point : QgsPointXY
            The place in the CRS of the canvas.

        Returns
        -------
        QgsPointXY
            Longitude and latitude.
        """
        return self._to_canvas().transform(point, Qgis.TransformDirection.Reverse)

    def _geometry(self, places: list[list[float]]) -> QgsGeometry:
        """Return places, given as latitudes and longitudes, in the CRS of the canvas."""
        points = QgsGeometry.fromMultiPointXY([QgsPointXY(lon, lat) for lat, lon in places])
        points.transform(self._to_canvas())
        return points

    def _highlight(self, places: list[list[float]], colour: QColor, size: int) -> None:
        """Draw circles on the canvas."""
        if not places:
            return
        band = QgsRubberBand(self.canvas)
        band.setToGeometry(self._geometry(places), None)
        band.setIcon(QgsRubberBand.IconType.ICON_CIRCLE)
        band.setIconSize(size)
        band.setColor(colour)
        band.setWidth(3)
        self.bands.append(band)

    def _remove_highlights(self) -> None:
        for band in self.bands:
            self.canvas.scene().removeItem(band)
        self.bands = []

    # --- A cell ------------------------------------------------------------------------------

    def ask_cell(self, lat: float, lon: float) -> None:
        """Show the cell at a place: its objects in the dial, and its lookalikes on the canvas.

        Parameters
        ----------
        lat, lon : float
            The place in degrees.
        """
        self.server.ask("cell", {"place": [lat, lon]}, self._show_cell)

    def _show_cell(self, cell: dict[str, Any]) -> None:
        marks = [
            Mark(item["class"], item["bearing"], metres)
            for item, metres in zip(cell["view"]["compass"], cell["distances"])
        ]
        self.dial.show_marks(marks)
        self.north.setChecked(False)
        question = {"views": [cell["view"]], "seen_from": "cells", "top": LOOKALIKES}
        self.server.ask("answer", question, partial(self._show_lookalikes, cell))

    def _show_lookalikes(self, cell: dict[str, Any], answer: dict[str, Any]) -> None:
        candidates = likely(answer["candidates"])
        others = [row["place"] for row in candidates if row["cell_id"] != cell["cell"]]
        self._remove_highlights()
        self._highlight(others, LOOKALIKE_COLOUR, 12)
        self._highlight([cell["place"]], CELL_COLOUR, 20)
        self.message.setText(
            tr("Seen from here: {seen}. {count} other cells see the same in this order.").format(
                seen=words(cell["types"], self.titles), count=f"{cell['alike']:,}"
            )
        )
        self._list(answer, tr("The places that a view from here may be confused with, by chance:"))

    # --- A view ------------------------------------------------------------------------------

    def simulate(self, lat: float, lon: float) -> None:
        """Compose the view that is seen from a place.

        Parameters
        ----------
        lat, lon : float
            The place in degrees.
        """
        self.server.ask("simulate", {"place": [lat, lon]}, self._show_view)

    def _show_view(self, simulation: dict[str, Any]) -> None:
        compass = simulation["view"]["compass"]
        self.dial.show_marks([Mark(item["class"], item["bearing"]) for item in compass])
        self._remove_highlights()
        self._highlight([simulation["truth"]["place"]], CELL_COLOUR, 20)
        self.message.setText(tr("This is what is seen from there; change it, or find the place."))

    def _add_object(self, bearing: float) -> None:
        """Add an object of the chosen class."""
        entry = self.palette_.currentItem()
        if entry is not None:
            marks = [Mark(mark.kind, mark.bearing) for mark in self.dial.marks]
            self.dial.show_marks([*marks, Mark(entry.data(CLASS_ROLE), bearing)])

    def _remove_object(self, number: int) -> None:
        marks = [mark for index, mark in enumerate(self.dial.marks) if index != number]
        self.dial.show_marks([Mark(mark.kind, mark.bearing) for mark in marks])

    def clear_view(self) -> None:
        """Remove all objects of the view, and the answer."""
        self.dial.show_marks([])
        remove_answer()
        restore_cells()
        self._remove_highlights()
        self.verdict.setText("")
        self.table.setRowCount(0)

    def ask_place(self) -> None:
        """Localize the view on the dial."""
        marks = sorted(self.dial.marks, key=lambda mark: mark.bearing)
        compass = [{"class": mark.kind, "bearing": mark.bearing, "range": None} for mark in marks]
        error = "unknown" if self.north.isChecked() else None
        view = {"compass": compass, "heading_error": error, "step": None}
        question = {"views": [view], "top": LOOKALIKES}
        self.server.ask("answer", question, partial(self._show_place, question))

    def _show_place(self, question: dict[str, Any], answer: dict[str, Any]) -> None:
        self._remove_highlights()
        verdict = (
            tr("Found: the place is within {metres} m with a chance of {chance}.")
            if answer["given"]
            else tr(
                "Cannot tell: 90 % of the chance is in {cells} cells, and {chance} within "
                "{metres} m of the best place."
            )
        )
        text = verdict.format(
            cells=f"{answer['region']['counts']['0.9']:,}",
            metres=f"{answer['radius']:g}",
            chance=percent(answer["mass"], tr),
        )
        lat, lon = answer["estimate"]["place"]
        place, name = f"{lat:.6f}, {lon:.6f}", answer.get("place_name")
        place = f"{name} ({place})" if name else place
        lines = [text, doubt(answer, tr), tr("Best place: {place}").format(place=place)]
        links = links_line(answer.get("links", {}))
        self._list(answer, "<br>".join([*(escape(line) for line in lines if line), links]))
        self.message.setText(tr("Choose a rank in the list to go there."))
        self._go_to([candidate["place"] for candidate in self.candidates[:3]])
        self.server.ask("export?format=gpkg", question, self._show_layers)

    def _show_layers(self, content: bytes) -> None:
        """Show the layers of an answer from the content of its GeoPackage."""
        self.answered += 1
        file = Path(self.answers.name, f"answer{self.answered}.gpkg")
        file.write_bytes(content)
        replace_answer(str(file))

    def _list(self, answer: dict[str, Any], verdict: str) -> None:
        """Show the candidates of an answer in the table."""
        self.candidates = likely(answer["candidates"])
        self.verdict.setText(verdict)
        self.table.blockSignals(True)  # noqa: FBT003 - as Qt calls it
        self.table.setRowCount(len(self.candidates))
        for row, candidate in enumerate(self.candidates):
            texts = (
                *(str(candidate["rank"]), percent(candidate["chance"], tr)),
                *(candidate.get("place_name") or "", words(candidate["types"], self.titles)),
            )
            for column, text in enumerate(texts):
                item = QTableWidgetItem(text)
                item.setToolTip(text)
                if column < 2:  # noqa: PLR2004 - the numbers
                    right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
                    item.setTextAlignment(right)
                self.table.setItem(row, column, item)
        has_names = any(candidate.get("place_name") for candidate in self.candidates)
        self.table.setColumnHidden(2, not has_names)
        for column in range(3):  # the last has the rest, in several lines
            self.table.resizeColumnToContents(column)
        self.table.resizeRowsToContents()
        self.table.clearSelection()
        self.table.blockSignals(False)  # noqa: FBT003

    def _zoom_to_selected(self) -> None:
        """Show the candidate that is selected in the table."""
        rows = self.table.selectionModel().selectedRows()
        if rows:
            self._go_to([self.candidates[rows[0].row()]["place"]])

    def _go_to(self, places: list[list[float]]) -> None:
        """Show places on the canvas, at most at the largest useful scale."""
        if not places:
            return
        box: QgsRectangle = self._geometry(places).boundingBox()
        if len(places) > 1:
            box.scale(1.5)
            self.canvas.setExtent(box)
        else:
            self.canvas.setCenter(box.center())
        if self.canvas.scale() < LARGEST_SCALE or len(places) == 1:
            self.canvas.zoomScale(LARGEST_SCALE)
        self.canvas.refresh()

    def clean_up(self) -> None:
        """Remove everything from the canvas and end the server, before the plugin is unloaded."""
        self._remove_highlights()
        if self.tool is not None:
            self.canvas.unsetMapTool(self.tool)
        self.server.close()
        with contextlib.suppress(OSError):  # a layer may have its file open
            self.answers.cleanup()


def _row(*widgets: QWidget) -> QHBoxLayout:
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    return row
