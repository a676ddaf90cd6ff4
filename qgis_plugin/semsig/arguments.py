"""Command lines of `semsig` from the values of parameters. Nothing here imports QGIS."""

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
"""Catalogues that are downloaded from."""
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
    "How cells are compared with a query. likelihood: by the chance that a detector sees the query "
    "from there. edit+edit: by how many objects must be added, taken away or exchanged to turn one "
    "sequence into the other, the mean of types and angles. edit+edit:5%: the same, among the 5 % "
    "of the cells whose types fit best. histogram+histogram: by how often each type and each angle "
    "occurs, whatever the order. jaccard+jaccard: by which types and which angles occur at all. "
    "types:edit and angles:edit: as edit+edit, by the types or the angles alone."
)
NOISES = ("generic", "light", "medium", "strong", "by-hand")
DISTORTIONS = ("none", "light", "medium", "strong")

Value = Union[str, float, bool, None, "list[str]"]


def command_line(command: str, *given: str, **options: Value) -> list[str]:
    """Return the arguments of a command.

    Parameters
    ----------
    command : str
        Such as ``"build"``.
    *given : str
        What has no name: the files that the command takes.
    **options : str, float, bool, list of str or None
        What has a name; the name of an option without its dashes, ``_`` where it has ``-``. What
        is empty or None is left out, True is an option without a value, and a list is an option
        that is given several times.

    Returns
    -------
    list of str
        The arguments.

    Examples
    --------
    >>> command_line("build", "objects.parquet", out="city.parquet", step=10.0, area=None)
    ['build', '--out=city.parquet', '--step=10.0', '--', 'objects.parquet']
    """
    named: list[str] = []
    for name, value in options.items():
        option = "--" + name.rstrip("_").replace("_", "-")
        if value is True:
            named.append(option)
        elif isinstance(value, list):
            named += [f"{option}={one}" for one in value]
        elif value is not None and value is not False and value != "":
            named.append(f"{option}={value}")
    # Nothing after the two dashes is taken for an option, whatever a file is called.
    return [command, *named, "--", *given]


def require_likelihood(method: str, parameter: str) -> None:
    """Refuse what only the likelihood method has.

    Parameters
    ----------
    method : str
        The method that was chosen.
    parameter : str
        What was given for it, as the dialog calls it.

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
    """Refuse what cannot be written, before the work is done for it.

    Parameters
    ----------
    path : str
        The file or folder to write. Folders that are missing are made by the command.
    suffix : str
        How a file must end, without the dot; empty for a folder.

    Raises
    ------
    CommandError
        If it cannot be written.
    """
    target = Path(path)
    if suffix and target.suffix.lower() != f".{suffix}":
        message = f"{path} does not end in .{suffix}; give the name of a .{suffix} file."
        raise CommandError(message)
    if suffix and os.path.isdir(target):  # noqa: PTH112 - it answers where Path.is_dir raises
        message = f"{path} is a folder; give the name of a file to write."
        raise CommandError(message)
    # The nearest folder that is there; of what is a folder itself, that may be the one.
    whole = target.absolute()
    places = [*whole.parents] if suffix else [whole, *whole.parents]
    there = (place for place in places if os.path.exists(place))  # noqa: PTH110 - as above
    folder = next(there, places[-1])
    if not folder.is_dir():
        message = f"{path} cannot be written, since {folder} is not a folder; choose another place."
        raise CommandError(message)
    if not os.access(folder, os.W_OK | os.X_OK):
        message = (
            f"{path} cannot be written, since {folder} is read-only; choose a folder you can "
            "write to."
        )
        raise CommandError(message)
