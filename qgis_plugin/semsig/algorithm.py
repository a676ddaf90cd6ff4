"""The base class of the algorithms, which calls the command, and their common parameters."""

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
from .results import move_to_group
from .translation import tr

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
"""Title of the layer of regions."""
# How the paths of layers that are not in a file begin, such as memory: (but not C: of Windows).
NO_FILE = re.compile(r"\w\w+:")


class SemsigAlgorithm(QgsProcessingAlgorithm):
    """An algorithm that runs the command; subclasses define its names, parameters and work."""

    NAME = ""
    TITLE = ""
    HELP = ""
    TAGS: tuple[str, ...] = ()

    # The names of these methods are those of QGIS.

    def createInstance(self) -> SemsigAlgorithm:  # noqa: N802
        """Return a new instance."""
        return type(self)()

    def name(self) -> str:
        """Return the second part of the identifier."""
        return self.NAME

    def displayName(self) -> str:  # noqa: N802
        """Return the name in the toolbox."""
        return tr(self.TITLE)

    def tags(self) -> list[str]:
        """Return more words for the search in the toolbox."""
        return list(self.TAGS)

    def icon(self) -> QIcon:
        """Return the icon."""
        return QIcon(self.svgIconPath())

    def svgIconPath(self) -> str:  # noqa: N802
        """Return the path of the icon."""
        return settings.icon_path()

    def shortHelpString(self) -> str:  # noqa: N802
        """Return the help of the tool and of its parameters, in HTML."""
        parts = [
            *(
                tr(" ".join(part.split())) for part in self.HELP.split("\n\n")
            ),  # line breaks would be shown
            *(
                f"<b>{parameter.description()}</b><br>{html.escape(parameter.help())}"
                for parameter in self.parameterDefinitions()
            ),
        ]
        return "".join(f"<p>{part}</p>" for part in parts)

    def canExecute(self) -> tuple[bool, str]:  # noqa: N802
        """Whether the command exists, and what to do if not."""
        try:
            settings.command()
        except CommandError as error:
            return False, str(error)
        return True, ""

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:  # noqa: N802, ARG002
        """Add the parameters."""
        for parameter in self.definitions():
            self.addParameter(parameter)

    def definitions(self) -> Definitions:
        """Return the parameters, inputs first."""
        raise NotImplementedError

    def processAlgorithm(  # noqa: N802
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run the algorithm; raise QgsProcessingException with one sentence if it fails."""
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
        """Run the command and return the outputs by their names."""
        raise NotImplementedError

    def _check_outputs(self, parameters: dict[str, Any], context: QgsProcessingContext) -> None:
        """Raise CommandError before the work if an output cannot be written."""
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
        """Run the command, which may write a file, and return its standard output."""
        last_label = ""

        def progress(percent: int, label: str) -> None:
            nonlocal last_label
            if label != last_label:  # each call adds a line to the log
                last_label = label
                feedback.setProgressText(label[:1].upper() + label[1:])
            feedback.setProgress(percent)

        feedback.pushCommandInfo(shlex.join(["semsig", *arguments]))
        watcher = Watcher(progress, feedback.pushInfo, feedback.isCanceled)
        return run_command(
            [settings.command(), *arguments], settings.environment(), watcher, written=written
        )

    def execute(
        self, arguments: list[str], feedback: QgsProcessingFeedback, written: str | None = None
    ) -> None:
        """Run the command, which may write a file, and show its standard output in the log."""
        feedback.pushConsoleInfo(log_text(self.call(arguments, feedback, written)))

    def file(self, parameters: dict[str, Any], name: str, context: QgsProcessingContext) -> str:
        """Return the path of a file to read; empty if not set."""
        return str(self.parameterAsFile(parameters, name, context))

    def file_out(self, parameters: dict[str, Any], name: str, context: QgsProcessingContext) -> str:
        """Return the path of a file to write; empty if not set."""
        return str(self.parameterAsFileOutput(parameters, name, context))

    def sink_file(
        self, parameters: dict[str, Any], name: str, context: QgsProcessingContext
    ) -> str:
        """Return the path of a layer that QGIS itself writes; empty if it is not in a file."""
        path = self.file_out(parameters, name, context)
        return "" if NO_FILE.match(path) else path

    def text(self, parameters: dict[str, Any], name: str, context: QgsProcessingContext) -> str:
        """Return the choice or text of a parameter; empty if not set."""
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
        """Return the path of a file with the polygons of a layer; empty if not set."""
        if self.parameterAsVectorLayer(parameters, name, context) is None:
            return ""
        # Not GeoPackages: the command does not know which of their layers to read.
        formats = ["shp", "geojson"]
        return str(
            self.parameterAsCompatibleSourceLayerPath(
                parameters, name, context, formats, "gpkg", feedback
            )
        )


def show_layers(
    context: QgsProcessingContext, path: str, titles: dict[str, str], *, group: str
) -> str:
    """Show the layers of a GeoPackage, if the user wants to see the file.

    Parameters
    ----------
    context : QgsProcessingContext
        Contains the file if it is to be shown.
    path : str
        The file.
    titles : dict of str to str
        Titles of its layers, by their names.
    group : str
        Title of the group for the layers.

    Returns
    -------
    str
        The source of the first layer, in the notation of QGIS.
    """
    layers = context.layersToLoadOnCompletion()
    details = layers.pop(path, None)
    if details is not None:
        context.setLayersToLoadOnCompletion(layers)
        add_layers(context, path, titles, group=group, project=details.project)
    return _source(path, next(iter(titles)))


def add_layers(
    context: QgsProcessingContext,
    path: str,
    titles: dict[str, str],
    *,
    group: str,
    project: QgsProject | None = None,
) -> None:
    """Show the layers of a GeoPackage.

    Parameters
    ----------
    context : QgsProcessingContext
        The context of the run.
    path : str
        The file.
    titles : dict of str to str
        Titles of its layers by their names, the lowest first.
    group : str
        Title of the group for the layers.
    project : QgsProject, optional
        The project that shows them; the project of the context by default.
    """
    project = project or context.project()
    if project is None:  # there is no window
        return
    for layer, title in titles.items():
        details = QgsProcessingContext.LayerDetails(tr(title), project, title)
        details.setPostProcessor(_styler(group=group))
        context.addLayerToLoadOnCompletion(_source(path, layer), details)


def _source(path: str, layer: str) -> str:
    """Return the source of a layer of a GeoPackage, in the notation of QGIS."""
    # QGIS loads layers in alphabetical order of these texts, each above the one before. It ignores
    # the case of the key, and capitals come first, so lines are loaded below points.
    word = "LAYERNAME" if layer.endswith("_lines") else "layername"
    return f"{path}|{word}={layer}"


class _Styler(QgsProcessingLayerPostProcessorInterface):
    """Applies a style to a layer after it is loaded: from the plugin, or from its GeoPackage."""

    def __init__(self, name: str, group: str) -> None:
        super().__init__()
        self.name, self.group = name, group

    def postProcessLayer(  # noqa: N802
        self,
        layer: QgsVectorLayer,
        _context: QgsProcessingContext,
        _feedback: QgsProcessingFeedback,
    ) -> None:
        """Apply the style, since Processing does not load the default one."""
        # The layer may be in the project already, with the previous version of the file open.
        layer.dataProvider().reloadData()
        if self.name:
            load_style(layer, self.name)
        else:
            layer.loadDefaultStyle()
        if layer.name() == tr(REGIONS):  # layers below stay visible
            layer.setBlendMode(QPainter.CompositionMode.CompositionMode_Multiply)
        layer.triggerRepaint()
        move_to_group(layer.id(), self.group)


def _styler(name: str = "", *, group: str) -> _Styler:
    """Return a styler for one layer, and keep a reference, since QGIS does not."""
    styler = _Styler(name, tr(group).lstrip("0123456789. "))
    _STYLERS.append(styler)
    return styler


# More than there are layers at a time; QGIS deletes stylers after use.
_STYLERS: deque[_Styler] = deque(maxlen=1000)


def style_layer(context: QgsProcessingContext, source: str, style: str, *, group: str) -> None:
    """Apply a style of the plugin to a layer, if the user wants to see it.

    Parameters
    ----------
    context : QgsProcessingContext
        Contains the layer if it is to be shown.
    source : str
        The layer.
    style : str
        Name of the style's file, without its suffix.
    group : str
        Title of the group for the layer.
    """
    if context.willLoadLayerOnCompletion(source):
        context.layerToLoadOnCompletionDetails(source).setPostProcessor(_styler(style, group=group))


def keep_style(source: str, style: str) -> None:
    """Write a style of the plugin into the GeoPackage of a layer, if it is in one.

    Parameters
    ----------
    source : str
        The layer.
    style : str
        Name of the style's file, without its suffix.
    """
    layer = QgsVectorLayer(source, style, "ogr")
    if layer.storageType() == "GPKG":  # a temporary layer is in no file
        load_style(layer, style)
        layer.saveStyleToDatabase(style, "", True, "")  # noqa: FBT003 - as QGIS calls it


def load_style(layer: QgsVectorLayer, style: str) -> None:
    """Apply a style of the plugin to a layer.

    Parameters
    ----------
    layer : QgsVectorLayer
        The layer.
    style : str
        Name of the style's file, without its suffix.
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
    """Return the parameter for a choice of names; the first is the default."""
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
    """Return the parameter for a number, optional if it has no default."""
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
    """Return the parameter for a file to write; an optional file is not written by default."""
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
