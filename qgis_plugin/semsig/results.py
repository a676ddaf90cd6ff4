"""Show the answers of the dock as layers of the project, in a group."""

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
from .translation import tr

if TYPE_CHECKING:
    from collections.abc import Iterable

    from qgis.core import QgsLayerTreeGroup

__all__ = ["group_of", "move_to_group", "show_answer"]

WGS84 = "EPSG:4326"
KEY = "semsig"
"""Custom property of the layers of the plugin."""


def group_of(title: str) -> QgsLayerTreeGroup:
    """Return the group with a title; create it above all layers if it is missing.

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


def move_to_group(identifier: str, title: str) -> None:
    """Move a layer into a group, after QGIS has added it to the layer tree.

    Parameters
    ----------
    identifier : str
        Identifier of the layer.
    title : str
        Title of the group.
    """

    def move() -> None:
        node = QgsProject.instance().layerTreeRoot().findLayer(identifier)
        group = None if node is None else group_of(title)
        if node is None or group is None or node.parent() == group:
            return
        # Insert the layer above the layers of its height and below the others.
        height = _height(node.layer())
        layers = [child.layer() for child in group.findLayers()]
        number = sum(1 for layer in layers if layer is None or _height(layer) < height)
        group.insertChildNode(number, node.clone())
        node.parent().removeChildNode(node)

    QTimer.singleShot(0, move)


LOWEST = 3


def _height(layer: Any) -> float:  # noqa: ANN401 - any kind of layer
    """Return the place of a layer from above: points 0, lines 1, areas 2, others below.

    Blended layers are below other layers of the same geometry, so that nothing is hidden.
    """
    if not isinstance(layer, QgsVectorLayer):
        return LOWEST + 1
    kind = layer.geometryType()
    height = min(int(getattr(kind, "value", kind)), LOWEST)
    if layer.blendMode() == QPainter.CompositionMode.CompositionMode_SourceOver:
        return height
    return height + 0.5


def show_answer(answer: dict[str, Any], load_style: Any) -> None:  # noqa: ANN401 - a function
    """Show an answer of the workbench as two layers, which replace the previous answer.

    Parameters
    ----------
    answer : dict
        See `semsig_gis.output.answer_drawing`.
    load_style : callable
        Called with a layer and the name of its style.
    """
    estimate = answer["estimate"]
    ring = [QgsPointXY(lon, lat) for lat, lon in estimate["ellipse"]]
    place = {
        "answered": "yes" if answer["given"] else "cannot tell",
        "chance": answer["mass"],
        "within_m": answer["radius"],
        "sigma_m": estimate["sigma"],
        "heading": estimate["heading"],
        "elsewhere": answer["elsewhere"],
        "fit": answer["fit"],
    }
    rows: list[tuple[QgsGeometry, dict[str, Any]]] = []
    for candidate in answer["candidates"]:
        lat, lon = candidate["place"]
        values = {
            "rank": candidate["rank"],
            "rank_high": candidate["rank"],
            "cell_id": candidate["cell_id"],
            "types": candidate["types"],
            "length": candidate["length"],
            "chance": candidate["chance"],
        }
        rows.append((QgsGeometry.fromPointXY(QgsPointXY(lon, lat)), values))
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
    """Return the existing layer of an answer, or a new one in the group of answers."""
    project = QgsProject.instance()
    for layer in project.mapLayers().values():
        if layer.customProperty(KEY) == name:
            return layer
    query = "&".join(f"field={field}:{type_}" for field, type_ in fields.items())
    layer = QgsVectorLayer(f"{kind}?crs={WGS84}&{query}", title, "memory")
    layer.setCustomProperty(KEY, name)
    layer.setCustomProperty("skipMemoryLayersCheck", 1)
    load_style(layer, name)
    project.addMapLayer(layer, False)  # noqa: FBT003 - as QGIS calls it: not into the tree
    group_of(tr("Answer")).insertLayer(0, layer)
    return layer


def _fill(layer: QgsVectorLayer, contents: Iterable[tuple[QgsGeometry, dict[str, Any]]]) -> None:
    """Replace the features of a layer."""
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
