"""A compass dial that shows the objects around a place, and takes clicks to edit them."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, NamedTuple, Optional

from qgis.PyQt.QtCore import QPointF, QRectF, QSize, Qt, pyqtSignal
from qgis.PyQt.QtGui import QColor, QIcon, QPainter, QPen, QPixmap
from qgis.PyQt.QtSvg import QSvgRenderer
from qgis.PyQt.QtWidgets import QToolTip, QWidget

if TYPE_CHECKING:
    from qgis.PyQt.QtCore import QEvent
    from qgis.PyQt.QtGui import QMouseEvent, QPaintEvent

__all__ = ["CompassDial", "Mark", "Sign", "sign_icon"]

MARGIN, DISC = 18.0, 10.0  # pixels
PICTURE = 0.65  # half of the side of a pictogram, in radii of its disc
SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><path d="{}" fill="{}"/></svg>'
CROWD, SMALLEST = 16, 6.0  # marks, from which their discs are smaller; pixels
FAR_REACH = 60.0  # metres, beyond which distances are drawn on a logarithmic scale
RINGS = (0.33, 0.66, 1.0)  # shares of the radius


class Sign(NamedTuple):
    """The look of a class."""

    title: str
    symbol: str
    colour: str
    ink: str
    pictogram: str = ""
    """SVG path data in a box of 16 x 16; empty for the letter."""


class Mark(NamedTuple):
    """An object: class, bearing in degrees clockwise from north, distance in metres if known."""

    kind: str
    bearing: float
    distance: Optional[float] = None  # noqa: UP045 - QGIS's Python may be 3.9


@functools.cache
def _drawing(pictogram: str, ink: str) -> QSvgRenderer:
    """Return a pictogram; it is kept, because QGIS 3.22 crashes where one is deleted in a slot."""
    return QSvgRenderer(SVG.format(pictogram, ink).encode())


def paint_sign(painter: QPainter, sign: Sign, place: QPointF, radius: float = DISC) -> None:
    """Draw a disc in the colour of a class, with its pictogram or letter.

    Parameters
    ----------
    painter : QPainter
        The painter.
    sign : Sign
        The look of the class.
    place : QPointF
        The centre.
    radius : float, optional
        The radius in pixels.
    """
    painter.setPen(QPen(QColor("white"), 1.5))
    painter.setBrush(QColor(sign.colour))
    painter.drawEllipse(place, radius, radius)
    if sign.pictogram:
        half = PICTURE * radius
        box = QRectF(place.x() - half, place.y() - half, 2 * half, 2 * half)
        _drawing(sign.pictogram, sign.ink).render(painter, box)
        return
    painter.setPen(QColor(sign.ink))
    font = painter.font()
    font.setPixelSize(int(radius * 1.25))
    font.setBold(True)
    painter.setFont(font)
    box = QRectF(place.x() - radius, place.y() - radius, 2 * radius, 2 * radius)
    painter.drawText(box, Qt.AlignmentFlag.AlignCenter, sign.symbol)


def _apart(place: QPointF, other: QPointF) -> float:
    return math.hypot(place.x() - other.x(), place.y() - other.y())


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
    pixmap = QPixmap(side, side)
    pixmap.fill(QColor(0, 0, 0, 0))
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    paint_sign(painter, sign, QPointF(side / 2, side / 2))
    painter.end()
    return QIcon(pixmap)


class CompassDial(QWidget):
    """Shows marks by bearing, north up, and by distance, or at the rim if it is unknown."""

    bearing_clicked = pyqtSignal(float)
    """A place without a mark was clicked; its bearing."""
    mark_clicked = pyqtSignal(int)
    """A mark was clicked; its number."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.marks: list[Mark] = []
        self.signs: dict[str, Sign] = {}
        self.reach = 30.0
        self.setMinimumSize(QSize(220, 220))
        self.setMouseTracking(True)

    def show_marks(self, marks: list[Mark]) -> None:
        """Replace the marks.

        Parameters
        ----------
        marks : list of Mark
            The new marks.
        """
        self.marks = marks
        self.update()

    def _radius(self) -> float:
        side: int = min(self.width(), self.height())
        return side / 2 - MARGIN

    def _middle(self) -> QPointF:
        return QPointF(self.width() / 2, self.height() / 2)

    def place(self, mark: Mark) -> QPointF:
        """Return the place of a mark on the widget.

        Parameters
        ----------
        mark : Mark
            The mark.

        Returns
        -------
        QPointF
            The place in pixels.
        """
        return self._at(mark.bearing, self._share(mark) * self._radius())

    def _at(self, bearing: float, radius: float) -> QPointF:
        turn, middle = math.radians(bearing), self._middle()
        return QPointF(middle.x() + radius * math.sin(turn), middle.y() - radius * math.cos(turn))

    def _share(self, mark: Mark) -> float:
        """Return the distance of a mark from the middle, as a share of the radius."""
        if mark.distance is None:
            return 1.0
        share = mark.distance / self.reach
        if self.reach > FAR_REACH:
            share = math.log1p(mark.distance / 10.0) / math.log1p(self.reach / 10.0)
        return max(0.15, min(1.0, share))

    @property
    def disc(self) -> float:
        """Radius of the discs in pixels: the more marks, the smaller."""
        if len(self.marks) <= CROWD:
            return DISC
        return max(SMALLEST, DISC * math.sqrt(CROWD / len(self.marks)))

    def places(self) -> list[QPointF]:
        """Return the places of all marks; in a crowd they move along their bearings.

        Returns
        -------
        list of QPointF
            The place of each mark in pixels.
        """
        if len(self.marks) <= CROWD:
            return [self.place(mark) for mark in self.marks]
        others: list[QPointF] = []
        radius, disc = self._radius(), self.disc
        for mark in self.marks:
            ideal = self._share(mark) * radius
            steps = (0.5 * disc * number for number in range(int(2.0 * radius / disc)))
            radii = [ideal + side * step for step in steps for side in (-1, 1)]
            spots = [self._at(mark.bearing, out) for out in radii if 0.15 * radius <= out <= radius]
            space = [min((_apart(spot, near) for near in others), default=radius) for spot in spots]
            free = next((row for row, away in enumerate(space) if away >= 2.0 * disc), None)
            others.append(spots[space.index(max(space)) if free is None else free])
        return others

    def paintEvent(self, _event: QPaintEvent) -> None:  # noqa: N802 - the names are those of Qt
        """Draw the rings, the axes, and the marks."""
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
        places = self.places()
        for spot in places:
            painter.setPen(QPen(faint, 1))
            painter.drawLine(middle, spot)
        for mark, spot in zip(self.marks, places):
            sign = self.signs.get(mark.kind)
            if sign is not None:
                paint_sign(painter, sign, spot, self.disc)
        painter.end()

    def _mark_at(self, spot: QPointF) -> int | None:
        """Return the number of the uppermost mark at a place; None without one."""
        hit = [_apart(place, spot) <= self.disc + 2 for place in self.places()]
        return max((number for number, is_hit in enumerate(hit) if is_hit), default=None)

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        """Emit the clicked mark or bearing."""
        spot = QPointF(event.pos())
        number = self._mark_at(spot)
        if number is not None:
            self.mark_clicked.emit(number)
            return
        middle = self._middle()
        turn = math.degrees(math.atan2(spot.x() - middle.x(), middle.y() - spot.y()))
        self.bearing_clicked.emit(round(turn % 360.0, 1))

    def event(self, event: QEvent) -> bool:
        """Show a tool tip for the mark below the pointer."""
        if event.type() == event.Type.ToolTip:
            number = self._mark_at(QPointF(event.pos()))
            if number is None:
                QToolTip.hideText()
            else:
                QToolTip.showText(event.globalPos(), self.description(self.marks[number]), self)
            return True
        return bool(super().event(event))

    def description(self, mark: Mark) -> str:
        """Return the text for a mark.

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
