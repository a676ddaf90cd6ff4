"""The algorithm of a tool, made from the schema of its command."""

from __future__ import annotations

import html
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qgis.core import (
    QgsProcessingAlgorithm,
    QgsProcessingException,
    QgsProcessingParameterDefinition,
)
from qgis.PyQt.QtGui import QIcon

from . import settings
from .answers import log_text
from .arguments import check_output, command_line, parameter_kinds
from .command import Cancelled, CommandError, Watcher, run_command
from .parameters import NEW, make_parameters, new_file, read_option
from .results import add_layers, show_layers
from .tools import STEPS, make_tools, tool_options
from .translation import tr

if TYPE_CHECKING:
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    from .tools import Extra, Tool

__all__ = ["SemsigAlgorithm"]

PRINTED = "OUT"
"""Parameter of the file for the text that a command prints."""


class SemsigAlgorithm(QgsProcessingAlgorithm):
    """The algorithm of a tool.

    Parameters
    ----------
    tool : Tool
        The tool.
    commands : dict
        The schema of each command.
    """

    def __init__(self, tool: Tool, commands: dict[str, dict[str, Any]]) -> None:
        super().__init__()
        self.tool, self.commands = tool, commands
        self.command = commands[tool.command]
        self.options = tool_options(tool, self.command)

    # The names of these methods are those of QGIS.

    def createInstance(self) -> SemsigAlgorithm:  # noqa: N802
        """Return a new instance."""
        return type(self)(self.tool, self.commands)

    def name(self) -> str:
        """Return the second part of the identifier."""
        return self.tool.name

    def displayName(self) -> str:  # noqa: N802
        """Return the name in the toolbox, with the number of a main step."""
        title, name = tr(self.tool.title or self.command["title"]), self.tool.name
        return f"{STEPS.index(name) + 1}. {title}" if name in STEPS else title

    def group(self) -> str:
        """Return the name of the group in the toolbox."""
        return tr(self.command["group"])

    def groupId(self) -> str:  # noqa: N802
        """Return the identifier of the group."""
        return str(self.command["group"]).lower()

    def tags(self) -> list[str]:
        """Return more words for the search in the toolbox: those of the English help."""
        return sorted(set(re.findall(r"\w{4,}", self._help().lower())))

    def icon(self) -> QIcon:
        """Return the icon."""
        return QIcon(self.svgIconPath())

    def svgIconPath(self) -> str:  # noqa: N802
        """Return the path of the icon."""
        return settings.icon_path()

    def _help(self) -> str:
        return self.tool.help.strip() or str(self.command["description"])

    def shortHelpString(self) -> str:  # noqa: N802
        """Return the help of the tool and of its parameters, in HTML."""
        parts = [
            *(html.escape(self._shown(part)) for part in self._help().split("\n\n")),
            *(
                f"<b>{html.escape(parameter.description())}</b><br>{html.escape(parameter.help())}"
                for parameter in self.parameterDefinitions()
                if parameter.help()
            ),
        ]
        return "".join(f"<p>{part}</p>" for part in parts)

    def _shown(self, text: str) -> str:
        """Return a translated text with the titles of commands and options for their names."""
        request = self.command["request"]["properties"]
        titles = {option["x-flag"]: tr(option["title"]) for option in request.values()}
        tools = make_tools(self.commands)

        def command_title(match: re.Match[str]) -> str:
            if match[1] not in tools:
                return match[0]
            title = SemsigAlgorithm(tools[match[1]], self.commands).displayName()
            return tr("“{}”").format(title)

        def option_title(match: re.Match[str]) -> str:
            return tr("“{}”").format(titles[match[0]]) if match[0] in titles else match[0]

        text = re.sub(r"`semsig ([\w-]+)[^`]*`", command_title, tr(" ".join(text.split())))
        return re.sub(r"--[a-z][a-z-]*", option_title, text)

    def canExecute(self) -> tuple[bool, str]:  # noqa: N802
        """Whether the command exists, and what to do if not."""
        try:
            settings.command()
        except CommandError as error:
            return False, str(error)
        return True, ""

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:  # noqa: N802, ARG002
        """Add the parameters: those of the options, inputs first, and those of more files."""
        required = self.command["request"]["required"]
        written = {name for name, option in self.options.items() if "x-writes" in option}
        for name in sorted(self.options, key=lambda name: name in written):
            option = self.options[name]
            # The default of a file to write is in the folder where the command is started.
            needed = name in required or (name in written and option["default"] is not None)
            text = self._shown(option["description"])
            if "x-default" in option:
                text += " " + tr("Default: {}.").format(self._shown(option["x-default"]))
            for parameter in make_parameters(name, option, required=needed, text=text):
                self.addParameter(parameter)
        if self.tool.printed:
            title = tr("File to write")
            self.addParameter(new_file("new file", PRINTED, title, [self.tool.printed]))
        for name, extra in self.tool.extras.items():
            kind = "layers" if extra.suffix == ".gpkg" else "new file"
            parameter = new_file(kind, name, tr(extra.title), [extra.suffix], created=False)
            optional = QgsProcessingParameterDefinition.Flag.FlagOptional
            parameter.setFlags(parameter.flags() | optional)
            if kind != "layers":
                options = self.commands[extra.command]["request"]["properties"]
                parameter.setHelp(self._shown(options["out"]["description"]))
            self.addParameter(parameter)

    def processAlgorithm(  # noqa: N802
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run the commands; raise QgsProcessingException with one sentence if they fail."""
        try:
            return self._run(parameters, context, feedback)
        except CommandError as error:
            raise QgsProcessingException(str(error)) from error
        except Cancelled:
            message = "Cancelled; no file is half-written."
            raise QgsProcessingException(message) from None

    def _run(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        """Run the commands, show their layers, and return the outputs by their names."""
        run = (self, parameters, context, feedback)
        values = {**self.tool.fixed}
        values |= {name: read_option(name, option, run) for name, option in self.options.items()}
        if self.tool.command == "fetch" and values["catalog"] == "openstreetmap":
            values["server"] = values.get("server") or settings.value(settings.OVERPASS)
        outputs = self._outputs(values, parameters, context)
        line = command_line(self.tool.command, self.command, values)
        if not self.tool.printed:
            line.insert(1, "--tables")  # the log has room for the details
        own = [values[name] for name, option in self.options.items() if "x-writes" in option]
        first = next((path for path in own if path and Path(path).suffix), None)
        printed = self._call(line, feedback, first)
        if self.tool.printed:
            Path(outputs[PRINTED]).parent.mkdir(parents=True, exist_ok=True)
            Path(outputs[PRINTED]).write_text(printed, encoding="utf-8")
        for name, extra in self.tool.extras.items():
            if name in outputs:
                self._write_extra(extra, values, outputs[name], feedback)
        if self.tool.layers:
            layers = str(Path(next(iter(outputs.values())), self.tool.layers))
            add_layers(context, layers, group=self._legend_group())
        # Not every source has buildings and streets; their files are missing then.
        return {
            name: show_layers(context, path, group=self._legend_group())
            if path.endswith(".gpkg")
            else path
            for name, path in outputs.items()
            if Path(path).exists()
        }

    def _outputs(
        self, values: dict[str, Any], parameters: dict[str, Any], context: QgsProcessingContext
    ) -> dict[str, str]:
        """Return the files to write by their parameters; raise CommandError if one cannot be."""
        outputs, suffixes = {}, {}
        for name, option in self.options.items():
            for parameter, kind in parameter_kinds(name, option).items():
                if kind in NEW:
                    outputs[parameter], suffixes[parameter] = values[name], option["x-writes"]
        for name, extra in self.tool.extras.items():
            layers = extra.suffix == ".gpkg"
            read = self.parameterAsOutputLayer if layers else self.parameterAsFileOutput
            outputs[name], suffixes[name] = read(parameters, name, context), [extra.suffix]
        if self.tool.printed:
            outputs[PRINTED] = self.parameterAsFileOutput(parameters, PRINTED, context)
            suffixes[PRINTED] = [self.tool.printed]
        outputs = {name: str(path) for name, path in outputs.items() if path}
        for name, path in outputs.items():
            check_output(path, suffixes[name])
        return outputs

    def _legend_group(self) -> str:
        """Return the title of the group for the layers."""
        return tr(self.tool.title or self.command["title"])

    def _write_extra(
        self, extra: Extra, values: dict[str, Any], path: str, feedback: QgsProcessingFeedback
    ) -> None:
        """Write one more file, with another command."""
        options = {
            name: values[value[1:].lower()] if str(value).startswith("=") else value
            for name, value in extra.values.items()
        }
        line = command_line(extra.command, self.commands[extra.command], {**options, "out": path})
        self._call(line, feedback, path)

    def _call(
        self, arguments: list[str], feedback: QgsProcessingFeedback, written: str | None
    ) -> str:
        """Run a command, which may write a file; log its standard output, and return it."""
        last_label = ""

        def progress(percent: int, label: str) -> None:
            nonlocal last_label
            if label != last_label:  # each call adds a line to the log
                last_label = label
                feedback.setProgressText(label[:1].upper() + label[1:])
            feedback.setProgress(percent)

        feedback.pushCommandInfo(shlex.join(["semsig", *arguments]))
        watcher = Watcher(progress, feedback.pushInfo, feedback.isCanceled)
        printed = run_command(
            [settings.command(), *arguments], settings.environment(), watcher, written=written
        )
        feedback.pushConsoleInfo(log_text(printed))
        return printed
