"""Show the layers of GeoPackages in the project, with the styles that are stored in them."""

from __future__ import annotations

import contextlib
import sqlite3
from collections import deque
from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingLayerPostProcessorInterface,
    QgsProject,
    QgsRenderContext,
    QgsSingleSymbolRenderer,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QTimer
from qgis.PyQt.QtGui import QColor, QPainter

from .translation import tr

if TYPE_CHECKING:
    from collections.abc import Iterator

    from qgis.core import QgsLayerTreeGroup, QgsProcessingFeedback

__all__ = [
    "add_layers",
    "mute_cells",
    "remove_answer",
    "replace_answer",
    "restore_cells",
    "show_layers",
]

BLENDED = ("regions",)
"""Layers of areas through which the layers below stay visible."""
GROUND = ("streets", "buildings")
"""Layers below all others, from above."""
MUTED = ("cells", "hexagons")
"""Layers that turn grey when there is an answer."""
GREY = QColor(190, 190, 186, 140)
KEY = "semsig"
"""Custom property of the layers of the dock, and of the style that the grey one replaces."""
LOWEST = 3


def _titles(path: str) -> dict[str, str]:
    """Return the titles of the layers of a GeoPackage by their names; none if it is missing."""
    query = "SELECT table_name, identifier FROM gpkg_contents WHERE data_type = 'features'"
    with contextlib.closing(sqlite3.connect(path)) as connection:
        try:
            return dict(connection.execute(query))
        except sqlite3.Error:
            return {}


def _source(path: str, name: str) -> str:
    """Return the source of a layer of a GeoPackage, in the notation of QGIS."""
    return f"{path}|layername={name}"


def _group_of(title: str) -> QgsLayerTreeGroup:
    """Return the group with a title; create it above all layers if it is missing."""
    root = QgsProject.instance().layerTreeRoot()
    group = root.findGroup(title)
    if group is None:
        group = root.insertGroup(0, title)
        group.setExpanded(True)
    return group


def _place_in_group(group: QgsLayerTreeGroup, layer: Any) -> int:  # noqa: ANN401 - any layer
    """Return the place of a layer in a group: above layers of its height, below the others."""
    layers = [child.layer() for child in group.findLayers()]
    return sum(1 for item in layers if item is None or _height(item) < _height(layer))


def _height(layer: Any) -> float:  # noqa: ANN401 - any kind of layer
    """Return the place of a layer from above: points 0, lines 1, areas 2, others and the ground.

    Blended layers are below other layers of the same geometry, so that nothing is hidden.
    """
    if not isinstance(layer, QgsVectorLayer):
        return LOWEST + 1
    for number, name in enumerate(GROUND):
        if _is_one_of(layer, (name,)):
            return LOWEST + 2 + number
    kind = layer.geometryType()
    height = min(int(getattr(kind, "value", kind)), LOWEST)
    plain = QPainter.CompositionMode.CompositionMode_SourceOver
    return height if layer.blendMode() == plain else height + 0.5


def _move_to_group(identifier: str, title: str) -> None:
    """Move a layer into a group, after QGIS has added it to the layer tree."""

    def move() -> None:
        node = QgsProject.instance().layerTreeRoot().findLayer(identifier)
        group = None if node is None else _group_of(title)
        if node is None or group is None or node.parent() == group:
            return
        group.insertChildNode(_place_in_group(group, node.layer()), node.clone())
        node.parent().removeChildNode(node)

    QTimer.singleShot(0, move)


def _apply_style(layer: QgsVectorLayer) -> None:
    """Apply the style that is stored in the GeoPackage of a layer; an answer mutes the cells."""
    layer.loadDefaultStyle()
    if _is_one_of(layer, BLENDED):
        layer.setBlendMode(QPainter.CompositionMode.CompositionMode_Multiply)
        mute_cells()
    layer.triggerRepaint()


def _is_one_of(layer: Any, names: tuple[str, ...]) -> bool:  # noqa: ANN401 - any kind of layer
    """Return whether a layer has one of the names in a GeoPackage."""
    return bool(layer.source().endswith(tuple(f"|layername={name}" for name in names)))


def _cell_layers() -> Iterator[QgsVectorLayer]:
    """Yield the layers of cells in the project."""
    for layer in QgsProject.instance().mapLayers().values():
        if isinstance(layer, QgsVectorLayer) and _is_one_of(layer, MUTED):
            yield layer


def mute_cells() -> None:
    """Draw the cells in grey, so that an answer is visible; their style is kept for later."""
    grey = tr("Grey")
    for layer in _cell_layers():
        manager = layer.styleManager()
        style = manager.currentStyle()
        symbols = layer.renderer().symbols(QgsRenderContext())
        if style == grey or not symbols:
            continue
        symbol = symbols[0].clone()
        symbol.setColor(GREY)
        for part in symbol.symbolLayers():
            part.setStrokeColor(GREY)
        manager.addStyleFromLayer(grey)
        manager.setCurrentStyle(grey)
        layer.setCustomProperty(KEY, style)
        layer.setRenderer(QgsSingleSymbolRenderer(symbol))
        layer.triggerRepaint()


def restore_cells() -> None:
    """Draw the cells in the style that `mute_cells` replaced."""
    for layer in _cell_layers():
        manager = layer.styleManager()
        if manager.currentStyle() == tr("Grey"):
            manager.setCurrentStyle(layer.customProperty(KEY))
            manager.removeStyle(tr("Grey"))
            layer.triggerRepaint()


class _Styler(QgsProcessingLayerPostProcessorInterface):
    """Applies its style to a layer after it is loaded, and moves it into a group."""

    def __init__(self, group: str) -> None:
        super().__init__()
        self.group = group

    def postProcessLayer(  # noqa: N802 - as QGIS calls it
        self,
        layer: QgsVectorLayer,
        _context: QgsProcessingContext,
        _feedback: QgsProcessingFeedback,
    ) -> None:
        """Apply the style, since Processing does not load the default one."""
        # The layer may be in the project already, with the previous version of the file open.
        layer.dataProvider().reloadData()
        _apply_style(layer)
        _move_to_group(layer.id(), self.group)


# QGIS does not keep a reference, and deletes stylers after use: more than there are at a time.
_STYLERS: deque[_Styler] = deque(maxlen=1000)


def show_layers(context: QgsProcessingContext, path: str, *, group: str) -> str:
    """Show the layers of a GeoPackage, if the user wants to see the file.

    Return the source of the first layer, in the notation of QGIS.
    """
    layers = context.layersToLoadOnCompletion()
    details = layers.pop(path, None)
    if details is not None:
        context.setLayersToLoadOnCompletion(layers)
        add_layers(context, path, group=group, project=details.project)
    return _source(path, next(iter(_titles(path)), ""))


def add_layers(
    context: QgsProcessingContext, path: str, *, group: str, project: QgsProject | None = None
) -> None:
    """Show the layers of a GeoPackage in a project, by default that of the context."""
    project = project or context.project()
    if project is None:  # there is no window
        return
    for name, title in _titles(path).items():
        details = QgsProcessingContext.LayerDetails(tr(title), project, title)
        styler = _Styler(group)
        _STYLERS.append(styler)
        details.setPostProcessor(styler)
        context.addLayerToLoadOnCompletion(_source(path, name), details)


def replace_answer(path: str) -> None:
    """Show the layers of an answer of the dock, in place of those of the previous answer.

    Streets and buildings are left out where the project has some: their names would appear twice.
    """
    project = QgsProject.instance()
    remove_answer()
    ground = [layer for layer in project.mapLayers().values() if _is_one_of(layer, GROUND)]
    group = _group_of(tr("Answer"))
    for name, title in _titles(path).items():
        if name in GROUND and ground:
            continue
        layer = QgsVectorLayer(_source(path, name), tr(title), "ogr")
        layer.setCustomProperty(KEY, name)
        _apply_style(layer)
        project.addMapLayer(layer, False)  # noqa: FBT003 - as QGIS calls it: not into the tree
        group.insertLayer(_place_in_group(group, layer), layer)
    group.setExpanded(False)  # or QGIS ignores the next line
    group.setExpanded(True)


def remove_answer() -> None:
    """Remove the layers of the answer of the dock."""
    layers = QgsProject.instance().mapLayers().items()
    QgsProject.instance().removeMapLayers(
        [
            name
            for name, layer in layers
            if layer.customProperty(KEY) and not _is_one_of(layer, MUTED)
        ]
    )
