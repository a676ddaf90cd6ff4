"""The wheel of what is seen around a place: drawn, and composed by clicks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Optional

from qgis.PyQt.QtCore import QPointF, QRectF, QSize, Qt, pyqtSignal
from qgis.PyQt.QtGui import QColor, QIcon, QPainter, QPen, QPixmap
from qgis.PyQt.QtWidgets import QToolTip, QWidget

if TYPE_CHECKING:
    from qgis.PyQt.QtCore import QEvent
    from qgis.PyQt.QtGui import QMouseEvent, QPaintEvent

__all__ = ["Mark", "Sign", "Wheel", "sign_icon"]

MARGIN, DISC = 18.0, 9.0
RINGS = (0.33, 0.66, 1.0)


class Sign(NamedTuple):
    """How a class is drawn."""

    title: str
    symbol: str
    colour: str
    ink: str


class Mark(NamedTuple):
    """One object: its class, degrees clockwise from north, and metres if they are known."""

    kind: str
    bearing: float
    distance: Optional[float] = None  # noqa: UP045 - QGIS's Python may be 3.9


def paint_sign(painter: QPainter, sign: Sign, place: QPointF, radius: float = DISC) -> None:
    """Draw a disc in the colour of a class, with its letter.

    Parameters
    ----------
    painter : QPainter
        What draws.
    sign : Sign
        The look of the class.
    place : QPointF
        Its middle.
    radius : float, optional
        In pixels.
    """
    painter.setPen(QPen(QColor("white"), 1.5))
    painter.setBrush(QColor(sign.colour))
    painter.drawEllipse(place, radius, radius)
    painter.setPen(QColor(sign.ink))
    font = painter.font()
    font.setPixelSize(int(radius * 1.25))
    font.setBold(True)
    painter.setFont(font)
    box = QRectF(place.x() - radius, place.y() - radius, 2 * radius, 2 * radius)
    painter.drawText(box, Qt.AlignmentFlag.AlignCenter, sign.symbol)


def sign_icon(sign: Sign) -> QIcon:
    """Return the sign of a class as an icon.

    Parameters
    ----------
    sign : Sign
        The look of the class.

    Returns
    -------
    QIcon
        The icon.
    """
    side = int(2 * DISC) + 4
    drawn = QPixmap(side, side)
    drawn.fill(QColor(0, 0, 0, 0))
    painter = QPainter(drawn)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    paint_sign(painter, sign, QPointF(side / 2, side / 2))
    painter.end()
    return QIcon(drawn)


class Wheel(QWidget):
    """Shows marks around the middle, north up: by their distance, or at the rim where unknown."""

    pressed = pyqtSignal(float)
    """A bearing was clicked where no mark is."""
    taken = pyqtSignal(int)
    """The mark of this number was clicked."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.marks: list[Mark] = []
        self.signs: dict[str, Sign] = {}
        self.reach = 30.0
        self.setMinimumSize(QSize(220, 220))
        self.setMouseTracking(True)

    def show_marks(self, marks: list[Mark]) -> None:
        """Show other marks.

        Parameters
        ----------
        marks : list of Mark
            The marks.
        """
        self.marks = marks
        self.update()

    def _radius(self) -> float:
        side: int = min(self.width(), self.height())
        return side / 2 - MARGIN

    def _middle(self) -> QPointF:
        return QPointF(self.width() / 2, self.height() / 2)

    def place(self, mark: Mark) -> QPointF:
        """Return where a mark is drawn.

        Parameters
        ----------
        mark : Mark
            The mark.

        Returns
        -------
        QPointF
            In pixels.
        """
        share = 1.0 if mark.distance is None else max(0.15, min(1.0, mark.distance / self.reach))
        turn, radius = math.radians(mark.bearing), self._radius() * share
        middle = self._middle()
        return QPointF(middle.x() + radius * math.sin(turn), middle.y() - radius * math.cos(turn))

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - the names are those of Qt
        """Draw the rings, the directions, and the marks."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        middle, radius = self._middle(), self._radius()
        palette = self.palette()
        faint = palette.color(palette.ColorRole.Mid)
        painter.setPen(QPen(faint, 1))
        for ring in RINGS:
            painter.drawEllipse(middle, radius * ring, radius * ring)
        painter.drawLine(
            QPointF(middle.x(), middle.y() - radius), QPointF(middle.x(), middle.y() + radius)
        )
        painter.drawLine(
            QPointF(middle.x() - radius, middle.y()), QPointF(middle.x() + radius, middle.y())
        )
        painter.setPen(palette.color(palette.ColorRole.WindowText))
        painter.drawText(
            QRectF(middle.x() - 20, middle.y() - radius - MARGIN, 40, MARGIN - 8),
            Qt.AlignmentFlag.AlignCenter,
            "N",
        )
        for mark in self.marks:
            spot = self.place(mark)
            painter.setPen(QPen(faint, 1))
            painter.drawLine(middle, spot)
        for mark in self.marks:
            sign = self.signs.get(mark.kind)
            if sign is not None:
                paint_sign(painter, sign, self.place(mark))
        painter.end()

    def _at(self, spot: QPointF) -> int | None:
        """Return the number of the mark at a place."""
        for number in reversed(range(len(self.marks))):
            there = self.place(self.marks[number])
            if math.hypot(there.x() - spot.x(), there.y() - spot.y()) <= DISC + 2:
                return number
        return None

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        """Tell what was clicked."""
        spot = QPointF(event.pos())
        number = self._at(spot)
        if number is not None:
            self.taken.emit(number)
            return
        middle = self._middle()
        turn = math.degrees(math.atan2(spot.x() - middle.x(), middle.y() - spot.y()))
        self.pressed.emit(round(turn % 360.0, 1))

    def event(self, event: QEvent) -> bool:
        """Say what a mark is when the pointer rests on it."""
        if event.type() == event.Type.ToolTip:
            number = self._at(QPointF(event.pos()))
            if number is None:
                QToolTip.hideText()
            else:
                QToolTip.showText(event.globalPos(), self.words(self.marks[number]), self)
            return True
        return bool(super().event(event))

    def words(self, mark: Mark) -> str:
        """Return a mark in words.

        Parameters
        ----------
        mark : Mark
            The mark.

        Returns
        -------
        str
            Such as ``Bench, 40°, 12 m``.
        """
        sign = self.signs.get(mark.kind)
        metres = "" if mark.distance is None else f", {mark.distance:.0f} m"
        return f"{sign.title if sign else mark.kind}, {mark.bearing:.0f}°{metres}"
