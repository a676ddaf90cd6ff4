"""Make the parameters of an algorithm from the schema of options, and read their values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from qgis import utils
from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsProcessing,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterCrs,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterEnum,
    QgsProcessingParameterExtent,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterFolderDestination,
    QgsProcessingParameterMultipleLayers,
    QgsProcessingParameterNumber,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterString,
    QgsProcessingParameterVectorDestination,
    QgsProcessingParameterVectorLayer,
)

from .arguments import KINDS_OF_ONE, parameter_kinds, value_schema
from .command import CommandError
from .translation import tr

if TYPE_CHECKING:
    from collections.abc import Iterator

    from qgis.core import (
        QgsProcessingAlgorithm,
        QgsProcessingContext,
        QgsProcessingFeedback,
    )

    Run = tuple[QgsProcessingAlgorithm, dict[str, Any], QgsProcessingContext, QgsProcessingFeedback]

__all__ = ["NEW", "make_parameters", "new_file", "read_option", "titled"]

DEGREES = "EPSG:4326"
NEW = ("layers", "new file", "new folder", "raster")
"""Kinds of parameters for what is written."""
LARGEST = 2**31 - 1  # in the widgets of QGIS
YES_OR_NO = ["yes", "no"]
POLYGONS = [QgsProcessing.SourceType.TypeVectorPolygon]
# The methods of an algorithm that read a parameter, by kind.
READERS = {
    "choice": "parameterAsEnumString",
    "choices": "parameterAsEnumStrings",
    "crs": "parameterAsCrs",
    "file": "parameterAsFile",
    "files": "parameterAsFileList",
    "folder": "parameterAsFile",
    "integer": "parameterAsInt",
    "layers": "parameterAsOutputLayer",
    "lines": "parameterAsString",
    "new file": "parameterAsFileOutput",
    "new folder": "parameterAsFileOutput",
    "number": "parameterAsDouble",
    "raster": "parameterAsOutputLayer",
    "switch": "parameterAsBool",
    "text": "parameterAsString",
    "yes or no": "parameterAsEnumString",
}


def titled(option: dict[str, Any]) -> str:
    """Return the title of an option, with its unit."""
    unit = option.get("x-unit", "")
    return tr(option["title"]) + (f" ({tr(unit)})" if unit else "")


def make_parameters(
    name: str, option: dict[str, Any], *, required: bool, text: str
) -> Iterator[QgsProcessingParameterDefinition]:
    """Yield the parameters for an option."""
    kinds = parameter_kinds(name, option)
    for parameter, kind in kinds.items():
        title = titled(option)
        if len(kinds) > 1 and kind in KINDS_OF_ONE:
            title = tr("{title}: {part}").format(title=title, part=tr(KINDS_OF_ONE[kind]))
        definition = _definition(kind, parameter, title, option, required=required)
        flags = definition.flags()
        if len(kinds) > 1 or (not required and option["default"] is None):
            flags |= QgsProcessingParameterDefinition.Flag.FlagOptional
        if option.get("x-advanced"):
            flags |= QgsProcessingParameterDefinition.Flag.FlagAdvanced
        definition.setFlags(flags)
        if kind != "layers":
            definition.setHelp(text)
        text = ""  # it is that of all parameters of the option
        yield definition


def _definition(kind: str, name: str, title: str, option: dict[str, Any], *, required: bool) -> Any:  # noqa: ANN401
    """Return the parameter of a kind."""
    default, schema = option.get("default"), value_schema(option)
    if kind in NEW:
        return new_file(kind, name, title, option["x-writes"], created=required)
    if kind in {"number", "integer"}:
        return _number(kind, name, title, schema, default)
    if kind in {"choice", "choices", "yes or no"}:
        choices = schema.get("items", schema).get("enum") or option.get("x-suggestions")
        many = kind == "choices"
        parameter = QgsProcessingParameterEnum(name, title, choices or YES_OR_NO, many, default)
        parameter.setUsesStaticStrings(True)
        return parameter
    if kind == "lines":
        return QgsProcessingParameterString(name, title, "\n".join(default or []), multiLine=True)
    make, values = {
        "crs": (QgsProcessingParameterCrs, default),
        "extent": (QgsProcessingParameterExtent, _canvas(option)),
        "file": (QgsProcessingParameterFile, QgsProcessingParameterFile.Behavior.File),
        "files": (QgsProcessingParameterMultipleLayers, QgsProcessing.SourceType.TypeFile),
        "folder": (QgsProcessingParameterFile, QgsProcessingParameterFile.Behavior.Folder),
        "polygons": (QgsProcessingParameterVectorLayer, POLYGONS),
        "switch": (QgsProcessingParameterBoolean, default),
        "text": (QgsProcessingParameterString, default),
    }[kind]
    return make(name, title, values)


def _number(kind: str, name: str, title: str, schema: dict[str, Any], default: float | None) -> Any:  # noqa: ANN401
    """Return the parameter for a number."""
    low, high = schema.get("minimum", -LARGEST), schema.get("maximum", LARGEST)
    whole = QgsProcessingParameterNumber.Type.Integer
    parameter = QgsProcessingParameterNumber(
        name,
        title,
        whole if kind == "integer" else QgsProcessingParameterNumber.Type.Double,
        default,
        False,  # noqa: FBT003 - as QGIS calls it: not optional
        low,
        min(high, LARGEST),
    )
    # As many decimals as the smallest number has; two for a share.
    decimals = -math.floor(math.log10(low)) if 0 < low < 1 else 1
    widget = {"decimals": max(decimals, 2) if high <= 1 else decimals}
    parameter.setMetadata({"widget_wrapper": widget})
    return parameter


def new_file(
    kind: str, name: str, title: str, suffixes: list[str], *, created: bool = True
) -> QgsProcessingParameterDefinition:
    """Return the parameter for a file or folder to write.

    The usual suffix is the first. Without `created`, nothing is written by default, layers
    excepted.
    """
    if kind == "layers":
        parameter = QgsProcessingParameterVectorDestination(name, title)
        parameter.setHelp(tr("The layers, in a GeoPackage."))
        return parameter
    if kind == "raster":
        return QgsProcessingParameterRasterDestination(name, title)
    if kind == "new folder":
        return QgsProcessingParameterFolderDestination(name, title, createByDefault=created)
    filters = [f"{suffix[1:].upper()} (*{suffix})" for suffix in suffixes if suffix]
    return QgsProcessingParameterFileDestination(
        name, title, ";;".join(filters), createByDefault=created
    )


def _canvas(option: dict[str, Any]) -> str | None:
    """Return the extent of the canvas as the default of an option; None if it has no such default.

    There may be no canvas.
    """
    if utils.iface is None or "CANVAS" not in option.get("x-metavar", ""):
        return None
    canvas = utils.iface.mapCanvas()
    box, crs = canvas.extent(), canvas.mapSettings().destinationCrs().authid()
    sides = (box.xMinimum(), box.xMaximum(), box.yMinimum(), box.yMaximum())
    return f"{','.join(map(str, sides))} [{crs}]" if crs and not box.isEmpty() else None


def read_option(name: str, option: dict[str, Any], run: Run) -> Any:  # noqa: ANN401 - any value
    """Return the value of an option, from all its parameters; None if it is not set.

    Raises CommandError if two parameters of an option with one value are set.
    """
    kinds = parameter_kinds(name, option)
    values = [_read(kind, parameter, run) for parameter, kind in kinds.items()]
    values = [value for value in values if value not in (None, "", [])]
    if "items" in value_schema(option):
        return [
            item for value in values for item in (value if isinstance(value, list) else [value])
        ]
    if len(kinds) > 1 and len(values) > 1 and values[0] == option.get("default"):
        values.pop(0)
    if len(values) > 1:
        message = f"{titled(option)} was given as {' and as '.join(values)}; give one of them."
        raise CommandError(message)
    return values[0] if values else None


def _read(kind: str, name: str, run: Run) -> Any:  # noqa: ANN401 - any value
    """Return the value of a parameter; None or empty if it is not set."""
    algorithm, parameters, context, feedback = run
    arguments = (parameters, name, context)
    default = algorithm.parameterDefinition(name).defaultValue()
    if kind not in NEW and parameters.get(name, default) is None:
        return None
    if kind == "extent":
        return _box_text(algorithm, arguments)
    if kind == "polygons":
        return _polygons(algorithm, arguments, feedback)
    value = getattr(algorithm, READERS[kind])(*arguments)
    if kind == "crs":
        value = _crs_text(value)
    elif kind == "lines":
        value = value.splitlines()
    elif kind == "yes or no":
        value = value == "yes"
    if isinstance(value, list):
        return [text for item in value if (text := str(item).strip())]
    return value.strip() if isinstance(value, str) else value


def _crs_text(crs: QgsCoordinateReferenceSystem) -> str:
    """Return the identifier of a CRS, or its WKT; empty if it is not set."""
    if not crs.isValid():
        return ""
    identifier = str(crs.authid())
    return identifier if identifier and not identifier.startswith("USER:") else str(crs.toWkt())


def _box_text(algorithm: QgsProcessingAlgorithm, arguments: tuple[Any, ...]) -> str:
    """Return a box in degrees; empty if it is not set."""
    box = algorithm.parameterAsExtent(*arguments, QgsCoordinateReferenceSystem(DEGREES))
    sides = (box.xMinimum(), box.yMinimum(), box.xMaximum(), box.yMaximum())
    return "" if box.isEmpty() else ",".join(f"{side:.7f}" for side in sides)


def _polygons(
    algorithm: QgsProcessingAlgorithm,
    arguments: tuple[Any, ...],
    feedback: QgsProcessingFeedback,
) -> str:
    """Return the path of a file with the polygons of a layer; empty if not set."""
    if algorithm.parameterAsVectorLayer(*arguments) is None:
        return ""
    # Not GeoPackages: the command does not know which of their layers to read.
    formats = ["shp", "geojson"]
    return str(
        algorithm.parameterAsCompatibleSourceLayerPath(*arguments, formats, "gpkg", feedback)
    )
