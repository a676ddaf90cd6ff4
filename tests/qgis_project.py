"""Print how QGIS reads the project in a GeoPackage; run by QGIS's own Python.

Usage: ``python3 qgis_project.py FILE...``. Prints a line of JSON for each: the layers of the
project by name, with the tip of the first feature, and the `SCALES` at which they are drawn.
Draws the page next to the file, as ``.png``.
"""

# ruff: noqa: T201 - a program, which imports what only QGIS has
import json
import os
import sys
from typing import Any

SCALES = (50_000, 10_000, 5_000, 1_000)


def main(*paths: str) -> None:
    from qgis.core import QgsApplication, QgsProject

    application = QgsApplication([], False)  # noqa: FBT003
    application.initQgis()
    project = QgsProject.instance()
    for path in paths:
        is_read = project.read(f"geopackage:{path}?projectName=semsig")
        print(json.dumps({"found": is_read, **contents(project, f"{path}.png")}))
    # QGIS and Python would both delete the layers.
    sys.stdout.flush()
    os._exit(0)


def contents(project: Any, picture: str) -> dict[str, Any]:  # noqa: ANN401
    from qgis.core import QgsLayoutExporter

    tree = project.layerTreeRoot()
    groups = {
        group.name(): [layer.name() for layer in group.children()] for group in tree.children()
    }
    relations = project.relationManager().relations().values()
    layout = project.layoutManager().printLayouts()[0]
    settings = QgsLayoutExporter.ImageExportSettings()
    settings.dpi = 60
    return {
        "title": project.title(),
        "crs": project.crs().authid() or project.crs().toWkt(),
        "groups": groups,
        "off": [layer.name() for layer in tree.findLayers() if not layer.isVisible()],
        "layers": {layer.name(): about(layer) for layer in project.mapLayers().values()},
        "relations": [(relation.name(), relation.isValid()) for relation in relations],
        "texts": [item.currentText() for item in layout.items() if hasattr(item, "currentText")],
        "scale": round(layout.itemById("map").scale()),
        "drawn": QgsLayoutExporter(layout).exportToImage(picture, settings) == 0,
    }


def about(layer: Any) -> dict[str, Any]:  # noqa: ANN401
    from qgis.core import QgsExpression, QgsExpressionContext, QgsExpressionContextUtils

    context = QgsExpressionContext()
    for scope in QgsExpressionContextUtils.globalProjectLayerScopes(layer):
        context.appendScope(scope)
    context.setFeature(next(layer.getFeatures()))
    display_name = QgsExpression(layer.displayExpression())
    tabs = layer.editFormConfig().tabs()
    label = layer.labeling().settings().fieldName if layer.labelsEnabled() else "NULL"
    labels = QgsExpression(label)
    return {
        "features": layer.featureCount(),
        "aliases": {
            field.name(): layer.attributeAlias(n) for n, field in enumerate(layer.fields())
        },
        "form": {tab.name(): [field.name() for field in tab.children()] for tab in tabs},
        "styles": layer.styleManager().styles(),
        "name": display_name.evaluate(context),
        "label": labels.evaluate(context),
        "errors": display_name.evalErrorString() + labels.evalErrorString(),
        "tip": QgsExpression.replaceExpressionText(layer.mapTipTemplate(), context),
        "seen": [scale for scale in SCALES if layer.isInScaleRange(scale)],
    }


if __name__ == "__main__":
    main(*sys.argv[1:])
