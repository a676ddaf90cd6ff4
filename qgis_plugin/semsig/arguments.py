"""Make command lines of `semsig` from the values of parameters, without QGIS."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Union

from .command import CommandError

__all__ = [
    "CATALOGS",
    "DISTORTIONS",
    "LIKELIHOOD",
    "METHODS",
    "METHOD_HELP",
    "NOISES",
    "SERVICES",
    "check_output",
    "command_line",
    "require_likelihood",
]

CATALOGS = (
    "barcelona",
    "hamburg",
    "mapillary",
    "melbourne",
    "montpellier",
    "new_york",
    "opendata_paris",
    "openstreetmap",
    "overture",
    "vienna",
    "washington",
)
FILES_ONLY = ("montpellier",)
SERVICES = tuple(name for name in CATALOGS if name not in FILES_ONLY)
"""Catalogues with a service to download from."""
LIKELIHOOD = "likelihood"
METHODS = (
    LIKELIHOOD,
    "edit+edit",
    "edit+edit:5%",
    "histogram+histogram",
    "jaccard+jaccard",
    "types:edit",
    "angles:edit",
)
METHOD_HELP = (
    "How cells are compared with a query. likelihood: by the chance that a detector sees the query"
    " from there. edit+edit: by the number of objects to add, remove or exchange to change one "
    "sequence into the other, the mean of types and angles. edit+edit:5%: the same, among the 5 % "
    "of the cells with the best types. histogram+histogram: by how often each type and each angle "
    "occurs, in any order. jaccard+jaccard: by which types and which angles occur at all. "
    "types:edit and angles:edit: as edit+edit, by only the types or only the angles."
)
NOISES = ("generic", "light", "medium", "strong", "by-hand", "photo", "panorama")
DISTORTIONS = ("none", "light", "medium", "strong")

Value = Union[str, float, bool, None, "list[str]"]


def command_line(command: str, *arguments: str, **options: Value) -> list[str]:
    """Return the arguments of a command.

    Parameters
    ----------
    command : str
        Such as ``"build"``.
    *arguments : str
        Arguments without a name: the files that the command takes.
    **options : str, float, bool, list of str or None
        Options by name, without the dashes and with ``_`` for ``-``. An empty value or None is
        left out, True is an option without a value, and a list repeats the option.

    Returns
    -------
    list of str
        The arguments.

    Examples
    --------
    >>> command_line("build", "objects.parquet", out="city.parquet", step=10.0, area=None)
    ['build', '--out=city.parquet', '--step=10.0', '--', 'objects.parquet']
    """
    line: list[str] = []
    for name, value in options.items():
        option = "--" + name.rstrip("_").replace("_", "-")
        if value is True:
            line.append(option)
        elif isinstance(value, list):
            line += [f"{option}={item}" for item in value]
        elif value is not None and value is not False and value != "":
            line.append(f"{option}={value}")
    # Files after the two dashes are never read as options, whatever their names.
    return [command, *line, "--", *arguments]


def require_likelihood(method: str, parameter: str) -> None:
    """Raise an error if a parameter of the likelihood method is given with another method.

    Parameters
    ----------
    method : str
        The chosen method.
    parameter : str
        The name of the parameter in the dialog.

    Raises
    ------
    CommandError
        If it is another method.
    """
    if method != LIKELIHOOD:
        message = (
            f"{parameter} was given with the method {method}, which does not have it; choose the "
            f"method {LIKELIHOOD}, or leave it out."
        )
        raise CommandError(message)


def check_output(path: str, suffix: str) -> None:
    """Raise an error before the work if an output cannot be written.

    Parameters
    ----------
    path : str
        The file or folder to write. Missing folders are created by the command.
    suffix : str
        The suffix of the file without the dot; empty for a folder.

    Raises
    ------
    CommandError
        If it cannot be written.
    """
    target = Path(path)
    if suffix and target.suffix.lower() != f".{suffix}":
        message = f"{path} does not end in .{suffix}; give the name of a .{suffix} file."
        raise CommandError(message)
    if suffix and os.path.isdir(target):  # noqa: PTH112 - Path.is_dir may raise
        message = f"{path} is a folder; give the name of a file to write."
        raise CommandError(message)
    # Find the nearest folder that exists; a folder to write may exist itself.
    absolute = target.absolute()
    places = [*absolute.parents] if suffix else [absolute, *absolute.parents]
    existing = (place for place in places if os.path.exists(place))  # noqa: PTH110 - as above
    folder = next(existing, places[-1])
    if not folder.is_dir():
        message = f"{path} cannot be written, since {folder} is not a folder; choose another place."
        raise CommandError(message)
    if not os.access(folder, os.W_OK | os.X_OK):
        message = (
            f"{path} cannot be written, since {folder} is read-only; choose a folder you can "
            "write to."
        )
        raise CommandError(message)
