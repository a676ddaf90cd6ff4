"""Catalogues and readers that other installed packages bring, found by entry points.

A package announces them in its ``pyproject.toml``::

    [project.entry-points."semsig_gis.catalogs"]
    lyon = "my_package:LYON"                # path of a TOML file, or a function that returns one

    [project.entry-points."semsig_gis.readers"]
    my_format = "my_package.reader:read_layers"     # a `semsig_gis.sources.Reader`

Importing them runs code of that package, which happens only when one of the functions below is
called.
"""

from __future__ import annotations

import os
import warnings
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.errors import CatalogError, SourceError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping
    from importlib.metadata import EntryPoint

    from semsig_gis.errors import SemsigError

__all__ = ["CATALOGS", "READERS", "installed_catalogs", "installed_readers"]

CATALOGS = "semsig_gis.catalogs"
READERS = "semsig_gis.readers"


def installed_catalogs(*, taken: Collection[str] = ()) -> Mapping[str, Path]:
    """Return the catalogues of other packages.

    Parameters
    ----------
    taken : collection of str
        Names that are no longer free, such as those of the built-in catalogues.

    Returns
    -------
    mapping of str to Path
        Names and TOML files, sorted by name. What is in the files is not looked at.

    Raises
    ------
    CatalogError
        If two packages bring a catalogue of one name, or its name is taken.

    Warns
    -----
    UserWarning
        For an entry that fails to load or is not the path of a TOML file; it is left out.

    Examples
    --------
    >>> all(path.suffix == ".toml" for path in installed_catalogs().values())
    True
    """
    return _installed(CATALOGS, _toml_path, taken, CatalogError)


def installed_readers(*, taken: Collection[str] = ()) -> Mapping[str, Callable[..., Any]]:
    """Return the readers of other packages.

    Parameters
    ----------
    taken : collection of str
        Names that are no longer free, such as those of the built-in readers.

    Returns
    -------
    mapping of str to callable
        Names and functions that are called as `semsig_gis.sources.Reader` says, sorted by name.

    Raises
    ------
    SourceError
        If two packages bring a reader of one name, or its name is taken.

    Warns
    -----
    UserWarning
        For an entry that fails to load or is not a function; it is left out.

    Examples
    --------
    >>> all(callable(read) for read in installed_readers().values())
    True
    """
    return _installed(READERS, _function, taken, SourceError)


def _installed(
    group: str,
    use: Callable[[Any], Any],
    taken: Collection[str],
    fault: type[SemsigError],
) -> dict[str, Any]:
    """Load the entries of a group, by name."""
    entries: dict[str, EntryPoint] = {}
    for entry in sorted(entry_points(group=group), key=lambda entry: (entry.name, _package(entry))):
        if entry.name in taken or entry.name in entries:
            other = _package(entries[entry.name]) if entry.name in entries else "semsig_gis itself"
            msg = (
                f"{entry.name!r} of {group} is brought by {other} and by {_package(entry)}; "
                "uninstall one of the two packages or rename its entry."
            )
            raise fault(msg)
        entries[entry.name] = entry
    found = {}
    for name, entry in entries.items():
        # Whatever is wrong with somebody else's package, even one that exits, is not fatal here.
        try:
            found[name] = use(entry.load())
        except (Exception, SystemExit) as error:  # noqa: BLE001
            cause = " ".join(str(error).split()).rstrip(".") or type(error).__name__
            warnings.warn(
                f"{name!r} of {group}, brought by {_package(entry)}, is left out because it cannot "
                f"be loaded ({cause}); correct or uninstall that package.",
                stacklevel=3,  # the caller of the public function
            )
    return found


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unknown package"


def _toml_path(value: object) -> Path:
    """Return the path that an entry gives, or raise what is wrong with it."""
    given = value() if callable(value) else value
    if not isinstance(given, str | os.PathLike):
        msg = f"it gives {given!r}, not the path of a .toml file"
        raise TypeError(msg)
    path = Path(given)
    if path.suffix != ".toml" or not path.is_file():
        what = "does not exist" if path.suffix == ".toml" else "is not a .toml file"
        msg = f"{path} {what}"
        raise FileNotFoundError(msg)
    return path


def _function(value: object) -> object:
    """Return the function that an entry gives, or raise what is wrong with it."""
    if not callable(value):
        msg = f"it gives {value!r}, not a function"
        raise TypeError(msg)
    return value
