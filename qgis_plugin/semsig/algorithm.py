"""What the algorithms share: how they call the command, and their common parameters."""

from __future__ import annotations

import html
import re
import shlex
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsProcessing,
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingLayerPostProcessorInterface,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterEnum,
    QgsProcessingParameterFeatureSink,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterNumber,
    QgsProcessingParameterVectorDestination,
    QgsProcessingParameterVectorLayer,
    QgsVectorLayer,
)
from qgis.PyQt.QtGui import QIcon, QPainter

from . import settings
from .answers import log_text
from .arguments import check_output
from .command import Cancelled, CommandError, Watcher, run_command
from .results import gather
from .words import tr

if TYPE_CHECKING:
    from qgis.core import QgsProcessingFeedback, QgsProject

    Definitions = tuple[QgsProcessingParameterDefinition, ...]

__all__ = [
    "REGIONS",
    "SemsigAlgorithm",
    "add_layers",
    "advanced",
    "area",
    "choice",
    "database",
    "described",
    "file_to_read",
    "file_to_write",
    "keep_style",
    "layers_to_write",
    "load_style",
    "map_to_write",
    "number",
    "show_layers",
    "style_layer",
    "whole_number",
]

HERE = Path(__file__).parent
PARQUET = "GeoParquet (*.parquet)"
REGIONS = "Regions to search"
"""What the layer of regions is called."""
# How QGIS names what is no file, such as memory: or postgres: (a disk of Windows has one letter).
NO_FILE = re.compile(r"\w\w+:")


class SemsigAlgorithm(QgsProcessingAlgorithm):
    """An algorithm that runs the command; a subclass says what it is called and what it does."""

    NAME = ""
    TITLE = ""
    HELP = ""
    TAGS: tuple[str, ...] = ()

    # The names of these methods are those of QGIS.

    def createInstance(self) -> SemsigAlgorithm:  # noqa: N802
        """Return a new one of the same kind."""
        return type(self)()

    def name(self) -> str:
        """Return the second part of the identifier."""
        return self.NAME

    def displayName(self) -> str:  # noqa: N802
        """Return the name in the toolbox."""
        return tr(self.TITLE)

    def tags(self) -> list[str]:
        """Return further words by which it is found."""
        return list(self.TAGS)

    def icon(self) -> QIcon:
        """Return the icon."""
        return QIcon(self.svgIconPath())

    def svgIconPath(self) -> str:  # noqa: N802
        """Return where the icon is."""
        return settings.icon_path()

    def shortHelpString(self) -> str:  # noqa: N802
        """Return what it does, and what each parameter means."""
        parts = [
            *(tr(" ".join(part.split())) for part in self.HELP.split("\n\n")),  # breaks would show
            *(
                f"<b>{one.description()}</b><br>{html.escape(one.help())}"
                for one in self.parameterDefinitions()
            ),
        ]
        return "".join(f"<p>{part}</p>" for part in parts)

    def canExecute(self) -> tuple[bool, str]:  # noqa: N802
        """Tell whether the command is there, and what to do if not."""
        try:
            settings.command()
        except CommandError as error:
            return False, str(error)
        return True, ""

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:  # noqa: N802, ARG002
        """Say what goes in and out."""
        for parameter in self.definitions():
            self.addParameter(parameter)

    def definitions(self) -> Definitions:
        """Return what goes in and out."""
        raise NotImplementedError

    def processAlgorithm(  # noqa: N802
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Do the work; what goes wrong is told in one sentence."""
        try:
            self._check_outputs(parameters, context)
            return self.work(parameters, context, feedback)
        except CommandError as error:
            raise QgsProcessingException(str(error)) from error
        except Cancelled:
            message = "Cancelled; no file is half-written."
            raise QgsProcessingException(message) from None

    def work(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Do the work and return the outputs by their names."""
        raise NotImplementedError

    def _check_outputs(self, parameters: dict[str, Any], context: QgsProcessingContext) -> None:
        """Refuse outputs that cannot be written, however late they are."""
        for output in self.destinationParameterDefinitions():
            if isinstance(output, QgsProcessingParameterFeatureSink):
                path = self.sink_file(parameters, output.name(), context)
                suffix = Path(path).suffix[1:].lower()  # QGIS writes many formats
            else:
                path = self.file_out(parameters, output.name(), context)
                suffix = output.defaultFileExtension()
            if path:
                check_output(path, suffix)

    def call(
        self, arguments: list[str], feedback: QgsProcessingFeedback, written: str | None = None
    ) -> str:
        """Run the command, which may write a file, and return what it prints."""
        told = ""

        def progress(percent: int, label: str) -> None:
            nonlocal told
            if label != told:  # each time is a line in the log
                told = label
                feedback.setProgressText(label[:1].upper() + label[1:])
            feedback.setProgress(percent)

        feedback.pushCommandInfo(shlex.join(["semsig", *arguments]))
        watcher = Watcher(progress, feedback.pushInfo, feedback.isCanceled)
        return run_command(
            [settings.command(), *arguments], settings.environment(), watcher, written=written
        )

    def tell(
        self, arguments: list[str], feedback: QgsProcessingFeedback, written: str | None = None
    ) -> None:
        """Run the command, which may write a file, and show what it prints."""
        feedback.pushConsoleInfo(log_text(self.call(arguments, feedback, written)))

    def file(self, parameters: dict[str, Any], name: str, context: QgsProcessingContext) -> str:
        """Return the path of a file to read, or nothing."""
        return str(self.parameterAsFile(parameters, name, context))

    def file_out(self, parameters: dict[str, Any], name: str, context: QgsProcessingContext) -> str:
        """Return the path of a file to write, or nothing."""
        return str(self.parameterAsFileOutput(parameters, name, context))

    def sink_file(
        self, parameters: dict[str, Any], name: str, context: QgsProcessingContext
    ) -> str:
        """Return the path of a layer that QGIS itself writes, or nothing if it is in no file."""
        path = self.file_out(parameters, name, context)
        return "" if NO_FILE.match(path) else path

    def text(self, parameters: dict[str, Any], name: str, context: QgsProcessingContext) -> str:
        """Return what was chosen or typed, or nothing."""
        definition = self.parameterDefinition(name)
        if isinstance(definition, QgsProcessingParameterEnum):
            return str(self.parameterAsEnumString(parameters, name, context))
        return str(self.parameterAsString(parameters, name, context)).strip()

    def polygons(
        self,
        parameters: dict[str, Any],
        name: str,
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> str:
        """Return a file with the polygons of a layer, or nothing."""
        if self.parameterAsVectorLayer(parameters, name, context) is None:
            return ""
        # Not GeoPackages: of those the command could not tell which layer is meant.
        formats = ["shp", "geojson"]
        return str(
            self.parameterAsCompatibleSourceLayerPath(
                parameters, name, context, formats, "gpkg", feedback
            )
        )


def show_layers(
    context: QgsProcessingContext, path: str, titles: dict[str, str], *, group: str
) -> str:
    """Let layers of a GeoPackage be shown, where the user wishes to see the file.

    Parameters
    ----------
    context : QgsProcessingContext
        Where the file is listed if it shall be shown.
    path : str
        The file.
    titles : dict of str to str
        What its layers are called.
    group : str
        The group of layers that they are put into.

    Returns
    -------
    str
        The first of the layers, as QGIS names it.
    """
    listed = context.layersToLoadOnCompletion()
    wished = listed.pop(path, None)
    if wished is not None:
        context.setLayersToLoadOnCompletion(listed)
        add_layers(context, path, titles, group=group, project=wished.project)
    return _source(path, next(iter(titles)))


def add_layers(
    context: QgsProcessingContext,
    path: str,
    titles: dict[str, str],
    *,
    group: str,
    project: QgsProject | None = None,
) -> None:
    """Let layers of a GeoPackage be shown.

    Parameters
    ----------
    context : QgsProcessingContext
        Where they are listed.
    path : str
        The file.
    titles : dict of str to str
        What its layers are called, the lowest first.
    group : str
        The group of layers that they are put into.
    project : QgsProject, optional
        Where they are shown; in that of the context by default.
    """
    project = project or context.project()
    if project is None:  # nobody looks
        return
    for layer, title in titles.items():
        details = QgsProcessingContext.LayerDetails(tr(title), project, title)
        details.setPostProcessor(_styler(group=group))
        context.addLayerToLoadOnCompletion(_source(path, layer), details)


def _source(path: str, layer: str) -> str:
    """Return how QGIS names a layer of a GeoPackage."""
    # It loads layers in the order of these texts, each above the one before: points belong above
    # lines, and capitals, which it does not mind, come first.
    word = "LAYERNAME" if layer.endswith("_lines") else "layername"
    return f"{path}|{word}={layer}"


class _Styler(QgsProcessingLayerPostProcessorInterface):
    """Gives a layer its style once it is loaded: one of ours, or that of its GeoPackage."""

    def __init__(self, name: str, group: str) -> None:
        super().__init__()
        self.name, self.group = name, group

    def postProcessLayer(  # noqa: N802
        self,
        layer: QgsVectorLayer,
        _context: QgsProcessingContext,
        _feedback: QgsProcessingFeedback,
    ) -> None:
        """Give the layer its style; Processing itself does not even load the default one."""
        # It may be in the project already, with the file open that was there before.
        layer.dataProvider().reloadData()
        if self.name:
            load_style(layer, self.name)
        else:
            layer.loadDefaultStyle()
        if layer.name() == tr(REGIONS):  # what is below shines through
            layer.setBlendMode(QPainter.CompositionMode.CompositionMode_Multiply)
        layer.triggerRepaint()
        gather(layer.id(), self.group)


def _styler(name: str = "", *, group: str) -> _Styler:
    """Return a styler for one layer; QGIS deletes it after use, but does not keep it until then."""
    made = _Styler(name, tr(group).lstrip("0123456789. "))
    _STYLERS.append(made)
    return made


# Enough for all layers that are being made at a time.
_STYLERS: deque[_Styler] = deque(maxlen=1000)


def style_layer(context: QgsProcessingContext, source: str, style: str, *, group: str) -> None:
    """Let a layer have a style of ours, where the user wishes to see it.

    Parameters
    ----------
    context : QgsProcessingContext
        Where it is listed if it shall be shown.
    source : str
        The layer.
    style : str
        Name of the style's file, without its ending.
    group : str
        The group of layers that it is put into.
    """
    if context.willLoadLayerOnCompletion(source):
        context.layerToLoadOnCompletionDetails(source).setPostProcessor(_styler(style, group=group))


def keep_style(source: str, style: str) -> None:
    """Write a style of ours into the GeoPackage that a layer is in, if it is in one.

    Parameters
    ----------
    source : str
        The layer.
    style : str
        Name of the style's file, without its ending.
    """
    layer = QgsVectorLayer(source, style, "ogr")
    if layer.storageType() == "GPKG":  # a temporary layer is in no file
        load_style(layer, style)
        layer.saveStyleToDatabase(style, "", True, "")  # noqa: FBT003 - as QGIS calls it


def load_style(layer: QgsVectorLayer, style: str) -> None:
    """Give a layer a style of ours.

    Parameters
    ----------
    layer : QgsVectorLayer
        The layer.
    style : str
        Name of the style's file, without its ending.
    """
    layer.loadNamedStyle(str(HERE / "styles" / f"{style}.qml"))


def described(
    parameter: QgsProcessingParameterDefinition, text: str
) -> QgsProcessingParameterDefinition:
    """Return a parameter with its help."""
    parameter.setHelp(tr(text))
    parameter.setDescription(tr(parameter.description()))
    return parameter


def advanced(parameter: QgsProcessingParameterDefinition) -> QgsProcessingParameterDefinition:
    """Return a parameter that is shown under "Advanced"."""
    parameter.setFlags(parameter.flags() | QgsProcessingParameterDefinition.Flag.FlagAdvanced)
    return parameter


def file_to_read(
    name: str, title: str, text: str, *, kind: str = PARQUET, optional: bool = False
) -> QgsProcessingParameterFile:
    """Return the parameter for a file."""
    parameter = QgsProcessingParameterFile(
        name,
        title,
        behavior=QgsProcessingParameterFile.Behavior.File,
        optional=optional,
        fileFilter=f"{kind};;All files (*)",
    )
    return described(parameter, text)


def database() -> QgsProcessingParameterFile:
    """Return the parameter for a signature database."""
    return file_to_read(
        "DATABASE",
        "Signature database",
        "The file that “Build signature database” wrote.",
    )


def area(text: str) -> QgsProcessingParameterVectorLayer:
    """Return the parameter for polygons."""
    parameter = QgsProcessingParameterVectorLayer(
        "AREA", "Area", types=[QgsProcessing.SourceType.TypeVectorPolygon], optional=True
    )
    return described(parameter, text)


def choice(
    name: str, title: str, options: tuple[str, ...], text: str, *, default: str | None = None
) -> QgsProcessingParameterEnum:
    """Return the parameter for one of several names; the first by default."""
    parameter = QgsProcessingParameterEnum(
        name,
        title,
        options=list(options),
        defaultValue=options[0] if default is None else default,
        usesStaticStrings=True,
    )
    return described(parameter, text)


def number(
    name: str, title: str, default: float | None, bounds: tuple[float, float], text: str
) -> QgsProcessingParameterNumber:
    """Return the parameter for a number; one without a default may be left out."""
    parameter = QgsProcessingParameterNumber(
        name,
        title,
        type=QgsProcessingParameterNumber.Type.Double,
        defaultValue=default,
        optional=default is None,
        minValue=bounds[0],
        maxValue=bounds[1],
    )
    parameter.setMetadata({"widget_wrapper": {"decimals": 1 if bounds[1] > 1 else 2}})
    return described(parameter, text)


def whole_number(
    name: str, title: str, default: int, bounds: tuple[int, int], text: str
) -> QgsProcessingParameterNumber:
    """Return the parameter for a whole number."""
    parameter = QgsProcessingParameterNumber(
        name,
        title,
        type=QgsProcessingParameterNumber.Type.Integer,
        defaultValue=default,
        minValue=bounds[0],
        maxValue=bounds[1],
    )
    return described(parameter, text)


def file_to_write(
    name: str, title: str, text: str, *, kind: str = PARQUET, optional: bool = False
) -> QgsProcessingParameterFileDestination:
    """Return the parameter for a file to write; an optional one is not written by default."""
    parameter = QgsProcessingParameterFileDestination(
        name, title, fileFilter=kind, optional=optional, createByDefault=not optional
    )
    return described(parameter, text)


def map_to_write(text: str) -> QgsProcessingParameterFileDestination:
    """Return the parameter for a map page."""
    return file_to_write("MAP", "Map page", text, kind="Web page (*.html)", optional=True)


def layers_to_write(
    name: str, title: str, text: str, *, optional: bool = False
) -> QgsProcessingParameterVectorDestination:
    """Return the parameter for a GeoPackage of layers."""
    parameter = QgsProcessingParameterVectorDestination(
        name,
        title,
        type=QgsProcessing.SourceType.TypeVectorAnyGeometry,
        optional=optional,
    )
    return described(parameter, text)
