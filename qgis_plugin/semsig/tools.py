"""The tools of the toolbox: one for each command, and what is particular to some of them."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["STEPS", "Extra", "Tool", "make_tools", "tool_options"]

STEPS = ("load", "build", "localize", "evaluate")
"""The main commands, which have a number in the toolbox."""
LEFT_OUT = ("schema", "serve")
"""Commands that make no sense in a toolbox."""


EMPTY: Mapping[str, Any] = MappingProxyType({})


class Extra(NamedTuple):
    """A file that a tool writes with another command after its own."""

    title: str
    command: str
    values: dict[str, Any]
    """Values of its options; ``=NAME`` is the value of a parameter of the tool."""
    suffix: str = ".gpkg"


class Tool(NamedTuple):
    """A tool of the toolbox."""

    name: str
    command: str
    title: str = ""
    """The title, if not that of the command."""
    help: str = ""
    """The help, if not that of the command."""
    only: tuple[str, ...] = ()
    """The options that are shown, if not all."""
    hidden: tuple[str, ...] = ()
    """Options that are not shown."""
    fixed: Mapping[str, Any] = EMPTY
    """Values of options that are not shown."""
    changed: Mapping[str, dict[str, Any]] = EMPTY
    """Replacements in the schema of options."""
    extras: Mapping[str, Extra] = EMPTY
    """More files to write, by the names of their parameters."""
    layers: str = ""
    """Name of a GeoPackage in the folder that is written; its layers are shown."""
    printed: str = ""
    """Suffix of a file for the text that the command prints."""


_TOOLS = (
    Tool(
        "build",
        "build",
        extras={
            # With the streets and buildings of the database.
            "CELLS": Extra("Cells", "export", {"database": "=OUT", "objects": "=OBJECTS"})
        },
    ),
    # Many queries are answered with a line of JSON each, which is for other programs.
    Tool("localize", "localize", hidden=("more", "queries", "adapt", "symbols")),
    Tool(
        "evaluate",
        "evaluate",
        extras={
            "LAYERS": Extra(
                "Queries",
                "export",
                {
                    "database": "=DATABASE",
                    "evaluation": "=OUT",
                    "layer": ["evaluation", "evaluation_lines"],
                },
            ),
            "MAP": Extra(
                "Map page", "map", {"database": "=DATABASE", "evaluation": "=OUT"}, ".html"
            ),
        },
    ),
    Tool(
        "identify",
        "identify",
        extras={
            "CELLS": Extra("Cells", "export", {"database": "=DATABASE", "layer": ["cells"]}),
            "MAP": Extra(
                "Map page", "map", {"database": "=DATABASE", "identifiability": True}, ".html"
            ),
        },
    ),
    Tool("demo", "demo", layers="city.gpkg"),
    Tool("draft", "draft", printed=".toml"),
    Tool(
        "ambiguity",
        "export",
        title="Ambiguity",
        help="""
Show how many cells see the same types in the same order.

A unique cell can be identified at once, one of a thousand cannot. The raster holds, for each cell,
the number of cells that look the same. `semsig identify` gives more detail, and takes longer.
""",
        only=("database", "out"),
        fixed={"layer": ["ambiguity"]},
        changed={"out": {"x-writes": [".tif"], "description": "Raster to write (.tif)."}},
        extras={
            "MAP": Extra("Map page", "map", {"database": "=DATABASE", "ambiguity": True}, ".html")
        },
    ),
    Tool(
        "fetchcanvas",
        "fetch",
        title="Download OpenStreetMap for this canvas",
        help="""
Download the street objects of OpenStreetMap in a part of the map, from an Overpass server.

Some square kilometres take seconds to minutes. What was downloaded before is taken from the cache.
The server is a setting: Settings > Options > Processing > Providers > Semantic signatures.
""",
        only=("area", "out", "buildings", "streets"),
        fixed={"catalog": "openstreetmap"},
        changed={
            "area": {
                "x-metavar": "WEST,SOUTH,EAST,NORTH|CANVAS",
                "description": "The extent to download; by default the extent of the canvas.",
            }
        },
    ),
)


def make_tools(commands: dict[str, dict[str, Any]]) -> dict[str, Tool]:
    """Return the tools by their names, in the order of the commands."""
    particular = {tool.name: tool for tool in _TOOLS if tool.command in commands}
    usual = {name: Tool(name, name) for name in commands if name not in LEFT_OUT}
    return {**usual, **particular}


def tool_options(tool: Tool, command: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the schema of the options that a tool shows, by their names."""
    options = command["request"]["properties"]
    return {
        name: {**option, **tool.changed.get(name, {})}
        for name, option in options.items()
        if name not in (*tool.hidden, *tool.fixed) and (not tool.only or name in tool.only)
    }
