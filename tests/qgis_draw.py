"""Draw layers of GeoPackages as QGIS draws them when they are opened; run by QGIS's own Python.

Usage: ``python3 qgis_draw.py OUT.png WIDTHxHEIGHT XMIN,YMIN,XMAX,YMAX LAYER...``, the uppermost
layer first, each as ``FILE|layername=NAME``. Prints one line of JSON for each layer.
"""

# ruff: noqa: T201 - a program, which imports what only QGIS has
import json
import os
import sys
from typing import Any


def main(out: str, size: str, extent: str, *sources: str) -> None:
    from qgis.core import (
        QgsApplication,
        QgsMapRendererParallelJob,
        QgsMapSettings,
        QgsRectangle,
        QgsVectorLayer,
    )
    from qgis.PyQt.QtCore import QSize
    from qgis.PyQt.QtGui import QColor

    application = QgsApplication([], False)  # noqa: FBT003
    application.initQgis()
    layers: list[Any] = [QgsVectorLayer(source, source, "ogr") for source in sources]
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
        print(json.dumps({**facts, "features": layer.featureCount()}))
    # Exit at once: QGIS and Python would both delete the layers.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
