"""Command lines of `semsig` from the values of parameters. Nothing here imports QGIS."""

from __future__ import annotations

from typing import Union

__all__ = ["CATALOGS", "DISTORTIONS", "LIKELIHOOD", "METHODS", "NOISES", "command_line"]

CATALOGS = ("montpellier", "opendata_paris", "openstreetmap")
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
NOISES = ("generic", "light", "medium", "strong")
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
