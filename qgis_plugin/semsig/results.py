"""Answers of the dock as layers of the project, in a group of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsFeature,
    QgsGeometry,
    QgsPointXY,
    QgsProject,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QTimer
from qgis.PyQt.QtGui import QPainter

from .answers import CANDIDATE_FIELDS, PLACE_FIELDS
from .words import tr

if TYPE_CHECKING:
    from collections.abc import Iterable

    from qgis.core import QgsLayerTreeGroup

__all__ = ["gather", "group_of", "show_answer"]

WGS84 = "EPSG:4326"
KEY = "semsig"
"""Property of the layers and groups that are ours."""


def group_of(title: str) -> QgsLayerTreeGroup:
    """Return the group of that title above all layers, made where it is missing.

    Parameters
    ----------
    title : str
        The title.

    Returns
    -------
    QgsLayerTreeGroup
        The group.
    """
    root = QgsProject.instance().layerTreeRoot()
    group = root.findGroup(title)
    if group is None:
        group = root.insertGroup(0, title)
        group.setExpanded(True)
    return group


def gather(identifier: str, title: str) -> None:
    """Put a layer into a group, once QGIS has put it into the tree.

    Parameters
    ----------
    identifier : str
        Of the layer.
    title : str
        Of the group.
    """

    def move() -> None:
        node = QgsProject.instance().layerTreeRoot().findLayer(identifier)
        group = None if node is None else group_of(title)
        if node is None or group is None or node.parent() == group:
            return
        number = sum(1 for one in group.findLayers() if not _below(one.layer(), node.layer()))
        group.insertChildNode(number, node.clone())
        node.parent().removeChildNode(node)

    QTimer.singleShot(0, move)


# What belongs above what, so that nothing is painted over: points, then lines, then areas. What
# is blended with what is below lies below its like.
HEIGHT = {0: 0, 1: 1, 2: 2}


def _below(there: QgsVectorLayer, new: QgsVectorLayer) -> bool:
    """Tell whether a layer that is there belongs below a new one."""
    if there is None or new is None:
        return False
    return _height(there) >= _height(new)


def _height(layer: Any) -> float:  # noqa: ANN401 - any kind of layer
    if not isinstance(layer, QgsVectorLayer):
        return len(HEIGHT) + 1
    kind = layer.geometryType()
    height = HEIGHT.get(int(getattr(kind, "value", kind)), len(HEIGHT))
    if layer.blendMode() == QPainter.CompositionMode.CompositionMode_SourceOver:
        return height
    return height + 0.5


def show_answer(answer: dict[str, Any], load_style: Any) -> None:  # noqa: ANN401 - a function
    """Show an answer of the workbench as two layers, which take the place of the last answer's.

    Parameters
    ----------
    answer : dict
        See `semsig_gis.serve.drawing.answer_drawing`.
    load_style : callable
        Takes a layer and the name of its style.
    """
    estimate = answer["estimate"]
    ring = [QgsPointXY(lon, lat) for lat, lon in estimate["ellipse"]]
    place = {
        "answered": "yes" if answer["given"] else "cannot tell",
        "chance": answer["mass"],
        "within_m": answer["radius"],
        "sigma_m": estimate["sigma"],
        "heading": estimate["heading"],
    }
    rows: list[tuple[QgsGeometry, dict[str, Any]]] = []
    for one in answer["candidates"]:
        lat, lon = one["place"]
        point = QgsGeometry.fromPointXY(QgsPointXY(lon, lat))
        row = {"rank": one["rank"], "rank_high": one["rank"], "cell_id": one["cell"]}
        types = one["types"]
        rows.append((point, {**row, "types": types, "length": len(types), "chance": one["chance"]}))
    polygon = QgsGeometry.fromPolygonXY([ring])
    for name, title, kind, fields, contents in (
        ("place", tr("Place"), "Polygon", PLACE_FIELDS, [(polygon, place)]),
        ("candidates", tr("Candidates"), "Point", CANDIDATE_FIELDS, rows),
    ):
        layer = _layer(name, title, kind, fields, load_style)
        _fill(layer, contents)
    group_of(tr("Answer")).setExpanded(True)


def _layer(
    name: str,
    title: str,
    kind: str,
    fields: dict[str, str],
    load_style: Any,  # noqa: ANN401
) -> QgsVectorLayer:
    """Return the layer of ours that is there, or a new one in the group of answers."""
    project = QgsProject.instance()
    for layer in project.mapLayers().values():
        if layer.customProperty(KEY) == name:
            return layer
    told = "&".join(f"field={field}:{type_}" for field, type_ in fields.items())
    layer = QgsVectorLayer(f"{kind}?crs={WGS84}&{told}", title, "memory")
    layer.setCustomProperty(KEY, name)
    layer.setCustomProperty("skipMemoryLayersCheck", 1)
    load_style(layer, name)
    project.addMapLayer(layer, False)  # noqa: FBT003 - as QGIS calls it: not into the tree
    group_of(tr("Answer")).insertLayer(0, layer)
    return layer


def _fill(layer: QgsVectorLayer, contents: Iterable[tuple[QgsGeometry, dict[str, Any]]]) -> None:
    provider = layer.dataProvider()
    provider.truncate()
    features = []
    for geometry, values in contents:
        feature = QgsFeature(layer.fields())
        feature.setGeometry(geometry)
        for name, value in values.items():
            if value is not None:
                feature.setAttribute(name, value)
        features.append(feature)
    provider.addFeatures(features)
    layer.updateExtents()
    layer.triggerRepaint()
