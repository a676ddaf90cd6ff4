"""Print the colours in which QGIS draws rasters; run by QGIS's own Python.

Usage: ``python3 qgis_pixels.py RASTER...``. Prints a JSON list: of each the labels of its legend,
their colours, and the colour of each pixel, from the north-west, null where it is clear.
"""

# ruff: noqa: T201 - a program, which imports what only QGIS has
import json
import os
import sys


def drawn(path: str) -> dict[str, object]:
    from qgis.core import QgsRasterLayer
    from qgis.PyQt.QtGui import QColor

    layer = QgsRasterLayer(path)
    renderer, source = layer.renderer(), layer.dataProvider()
    items = renderer.shader().rasterShaderFunction().colorRampItemList()
    block = renderer.block(1, source.extent(), source.xSize(), source.ySize())
    pixels = [
        [QColor.fromRgba(block.color(row, column)) for column in range(block.width())]
        for row in range(block.height())
    ]
    return {
        "labels": [item.label for item in items],
        "colours": [item.color.name() for item in items],
        "pixels": [[pixel.name() if pixel.alpha() else None for pixel in line] for line in pixels],
    }


def main(*paths: str) -> None:
    from qgis.core import QgsApplication

    application = QgsApplication([], False)  # noqa: FBT003
    application.initQgis()
    print(json.dumps([drawn(path) for path in paths]))
    # QGIS and Python would both delete the layers.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
