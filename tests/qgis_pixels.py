"""The colours in which QGIS draws a raster when it is opened; run by QGIS's own Python.

Usage: ``python3 qgis_pixels.py RASTER``. Prints JSON: the labels of its legend, their colours, and
the colour of each pixel, from the north-west, null where it is clear.
"""

# ruff: noqa: T201 - a program, which imports what only QGIS has
import json
import os
import sys


def main(path: str) -> None:
    from qgis.core import QgsApplication, QgsRasterLayer
    from qgis.PyQt.QtGui import QColor

    application = QgsApplication([], False)  # noqa: FBT003
    application.initQgis()
    layer = QgsRasterLayer(path)
    renderer, source = layer.renderer(), layer.dataProvider()
    items = renderer.shader().rasterShaderFunction().colorRampItemList()
    block = renderer.block(1, source.extent(), source.xSize(), source.ySize())
    pixels = [
        [QColor.fromRgba(block.color(row, column)) for column in range(block.width())]
        for row in range(block.height())
    ]
    shown = [[one.name() if one.alpha() else None for one in line] for line in pixels]
    facts = {"labels": [item.label for item in items], "pixels": shown}
    print(json.dumps({**facts, "colours": [item.color.name() for item in items]}))
    # QGIS and Python do not agree on who takes the layers down.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
