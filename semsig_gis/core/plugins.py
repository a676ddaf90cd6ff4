"""Catalogues, readers, commands and formats of other packages, found by their entry points.

``data_sources/README.md`` shows how a package declares them. Its code is imported only when one
of the functions below is called.
"""

from __future__ import annotations

import os
import sys
import warnings
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import CatalogError, InputError, SourceError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping
    from importlib.metadata import EntryPoint

    from semsig_gis.core.errors import SemsigError

CATALOGS = "semsig_gis.catalogs"
READERS = "semsig_gis.readers"
COMMANDS = "semsig_gis.commands"
EXPORTS = "semsig_gis.exports"
LAYERS = "semsig_gis.layers"
RASTERS = "semsig_gis.rasters"


def installed_catalogs(*, reserved: Collection[str] = ()) -> Mapping[str, Path]:
    """Return the TOML files of other packages' catalogues by name, sorted; they are not read.

    CatalogError if a name is in `reserved` or provided twice. An entry that fails to load or is
    not the path of a TOML file is skipped with a warning.
    """
    return _installed(CATALOGS, _toml_path, reserved, CatalogError)


def installed_readers(*, reserved: Collection[str] = ()) -> Mapping[str, Callable[..., Any]]:
    """Return the functions of other packages' readers by name, sorted.

    SourceError if a name is in `reserved` or provided twice. An entry that fails to load or is not
    a function is skipped with a warning.
    """
    return _installed(READERS, _function, reserved, SourceError)


def installed_command_names() -> Mapping[str, str]:
    """Return the names of other packages' commands with their packages, without importing them."""
    return {entry.name: _package(entry) for entry in _entries(COMMANDS, tuple(sys.path))}


def installed_commands(*, reserved: Collection[str] = ()) -> Mapping[str, Callable[..., Any]]:
    """Return the classes of other packages' commands by name, sorted.

    InputError if a name is in `reserved` or provided twice. An entry that fails to load or is not
    a class is skipped with a warning.
    """
    return _installed(COMMANDS, _function, reserved, InputError)


def installed_outputs(group: str, reserved: Collection[str] = ()) -> Mapping[str, Any]:
    """Return the layers, the rasters or the formats of files of other packages by name, sorted.

    InputError if a name is in `reserved` or provided twice. An entry that fails to load or is not
    a function is skipped with a warning.
    """
    return _installed(group, _function, reserved, InputError)


def _installed(
    group: str,
    check: Callable[[object], Any],
    reserved: Collection[str],
    error_type: type[SemsigError],
) -> dict[str, Any]:
    """Load the entries of a group, by name; `check` returns the value of an entry or raises."""
    entries: dict[str, EntryPoint] = {}
    for entry in _entries(group, tuple(sys.path)):
        if entry.name in reserved or entry.name in entries:
            other = _package(entries[entry.name]) if entry.name in entries else "semsig_gis itself"
            raise error_type(
                f"{entry.name!r} of {group} is provided by {other} and by {_package(entry)}; "
                "uninstall one of the two packages or rename its entry."
            )
        entries[entry.name] = entry
    values = {}
    for name, entry in entries.items():
        # No error of another package is fatal here, not even one that exits the process.
        try:
            values[name] = check(entry.load())
        except (Exception, SystemExit) as error:  # noqa: BLE001
            cause = " ".join(str(error).split()).rstrip(".") or type(error).__name__
            warnings.warn(
                f"{name!r} of {group}, provided by {_package(entry)}, is left out because it "
                f"cannot be loaded ({cause}); correct or uninstall that package.",
                stacklevel=3,  # the caller of the public function
            )
    return values


@cache  # finding them reads the metadata of all installed packages
def _entries(group: str, _path: tuple[str, ...]) -> list[EntryPoint]:
    """Return the entries of a group, for one state of ``sys.path``."""
    from importlib.metadata import entry_points  # noqa: PLC0415 - slow, and rarely needed

    return sorted(entry_points(group=group), key=lambda entry: (entry.name, _package(entry)))


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unknown package"


def _toml_path(value: object) -> Path:
    """Return the path of a TOML file, or raise if an entry has another value."""
    location = value() if callable(value) else value
    if not isinstance(location, str | os.PathLike):
        raise TypeError(f"it gives {location!r}, not the path of a .toml file")
    path = Path(location)
    if path.suffix != ".toml" or not path.is_file():
        what = "does not exist" if path.suffix == ".toml" else "is not a .toml file"
        raise FileNotFoundError(f"{path} {what}")
    return path


def _function(value: object) -> object:
    """Return a function, or raise if an entry has another value."""
    if not callable(value):
        raise TypeError(f"it gives {value!r}, not a function")
    return value
