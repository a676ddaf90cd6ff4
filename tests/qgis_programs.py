"""What QGIS makes of files; run by QGIS's own Python, and prints lines of JSON.

``python3 qgis_programs.py draw OUT.png WIDTHxHEIGHT XMIN,YMIN,XMAX,YMAX LAYER...`` draws layers of
GeoPackages as QGIS draws them when they are opened, the uppermost layer first, each given as
``FILE|layername=NAME``, and prints a line for each layer.

``pixels RASTER...`` prints for each raster the labels of its legend, their colours, and the colour
of each pixel, from the north-west, null where it is clear.

``project FILE...`` prints for each GeoPackage the layers of its project by name, with the tip of
the first feature, and the `SCALES` at which they are drawn. It draws the page next to the file, as
``.png``.
"""

# ruff: noqa: T201 - a program, which imports what only QGIS has
import json
import os
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

SCALES = (50_000, 10_000, 5_000, 1_000)
OPEN: list[Any] = []  # layers, which QGIS and Python would both delete


def draw(out: str, size: str, extent: str, *sources: str) -> "Iterator[dict[str, Any]]":
    from qgis.core import (
        QgsMapRendererParallelJob,
        QgsMapSettings,
        QgsRectangle,
        QgsVectorLayer,
    )
    from qgis.PyQt.QtCore import QSize
    from qgis.PyQt.QtGui import QColor

    layers = [QgsVectorLayer(source, source, "ogr") for source in sources]
    OPEN.extend(layers)
    settings = QgsMapSettings()
    settings.setLayers(layers)
    settings.setDestinationCrs(layers[0].crs())
    settings.setBackgroundColor(QColor("white"))
    settings.setOutputSize(QSize(*map(int, size.split("x"))))
    settings.setExtent(QgsRectangle(*map(float, extent.split(","))))
    job = QgsMapRendererParallelJob(settings)
    job.start()
    job.waitForFinished()
    job.renderedImage().save(out)
    for layer in layers:
        renderer = layer.renderer()
        labels = [item.label() for item in renderer.legendSymbolItems()]
        facts = {"valid": layer.isValid(), "renderer": renderer.type(), "labels": labels}
        yield {**facts, "features": layer.featureCount()}


def pixels(path: str) -> dict[str, object]:
    from qgis.core import QgsRasterLayer
    from qgis.PyQt.QtGui import QColor

    layer = QgsRasterLayer(path)
    renderer, source = layer.renderer(), layer.dataProvider()
    items = renderer.shader().rasterShaderFunction().colorRampItemList()
    block = renderer.block(1, source.extent(), source.xSize(), source.ySize())
    colours = [
        [QColor.fromRgba(block.color(row, column)) for column in range(block.width())]
        for row in range(block.height())
    ]
    return {
        "labels": [item.label for item in items],
        "colours": [item.color.name() for item in items],
        "pixels": [[pixel.name() if pixel.alpha() else None for pixel in line] for line in colours],
    }


def project(path: str) -> dict[str, Any]:
    from qgis.core import QgsProject

    instance = QgsProject.instance()
    is_read = instance.read(f"geopackage:{path}?projectName=semsig")
    return {"found": is_read, **contents(instance, f"{path}.png")}


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
        "shown": shown(layer),
        "actions": [
            (action.name(), QgsExpression.replaceExpressionText(action.command(), context))
            for action in layer.actions().actions()
        ],
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


def shown(layer: Any) -> int:  # noqa: ANN401
    """Return the number of features that are drawn."""
    from qgis.core import QgsRenderContext

    if layer.renderer() is None:
        return 0
    context, renderer = QgsRenderContext(), layer.renderer().clone()
    renderer.startRender(context, layer.fields())
    count = 0
    for feature in layer.getFeatures():
        context.expressionContext().setFeature(feature)
        count += renderer.willRenderFeature(feature, context)
    renderer.stopRender(context)
    return count


def main(program: str, *arguments: str) -> None:
    from qgis.core import QgsApplication

    application = QgsApplication([], False)  # noqa: FBT003
    application.initQgis()
    if program == "draw":
        results = draw(*arguments)
    else:
        results = map({"pixels": pixels, "project": project}[program], arguments)
    for result in results:
        print(json.dumps(result), flush=True)
    os._exit(0)  # without deleting `OPEN`


if __name__ == "__main__":
    main(*sys.argv[1:])
