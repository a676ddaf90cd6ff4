"""Catalogues and readers that other installed packages bring, found by entry points.

``data_sources/README.md`` shows how a package announces them. Its code is imported only when a
function below is called.
"""

from __future__ import annotations

import os
import sys
import warnings
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import CatalogError, SourceError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping
    from importlib.metadata import EntryPoint

    from semsig_gis.core.errors import SemsigError

CATALOGS = "semsig_gis.catalogs"
READERS = "semsig_gis.readers"


def installed_catalogs(*, taken: Collection[str] = ()) -> Mapping[str, Path]:
    """Return the names and TOML files of other packages' catalogues, sorted by name, not read.

    `taken` are names that are no longer free. Raises CatalogError if a name is taken or stands
    twice. An entry that fails to load or is not the path of a TOML file is left out with a warning.
    """
    return _installed(CATALOGS, _toml_path, taken, CatalogError)


def installed_readers(*, taken: Collection[str] = ()) -> Mapping[str, Callable[..., Any]]:
    """Return the names and functions of other packages' readers, sorted by name.

    As `installed_catalogs`, but SourceError, and an entry that is not a function is left out.
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
    for entry in _announced(group, tuple(sys.path)):
        if entry.name in taken or entry.name in entries:
            other = _package(entries[entry.name]) if entry.name in entries else "semsig_gis itself"
            raise fault(
                f"{entry.name!r} of {group} is provided by {other} and by {_package(entry)}; "
                "uninstall one of the two packages or rename its entry."
            )
        entries[entry.name] = entry
    found = {}
    for name, entry in entries.items():
        # Whatever is wrong with somebody else's package, even one that exits, is not fatal here.
        try:
            found[name] = use(entry.load())
        except (Exception, SystemExit) as error:  # noqa: BLE001
            cause = " ".join(str(error).split()).rstrip(".") or type(error).__name__
            warnings.warn(
                f"{name!r} of {group}, provided by {_package(entry)}, is left out because it "
                f"cannot be loaded ({cause}); correct or uninstall that package.",
                stacklevel=3,  # the caller of the public function
            )
    return found


@cache  # because all that is installed is looked through
def _announced(group: str, _path: tuple[str, ...]) -> list[EntryPoint]:
    """Return the entries of a group that packages on the import path announce."""
    return sorted(entry_points(group=group), key=lambda entry: (entry.name, _package(entry)))


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unknown package"


def _toml_path(value: object) -> Path:
    """Return the path that an entry gives, or raise what is wrong with it."""
    given = value() if callable(value) else value
    if not isinstance(given, str | os.PathLike):
        raise TypeError(f"it gives {given!r}, not the path of a .toml file")
    path = Path(given)
    if path.suffix != ".toml" or not path.is_file():
        what = "does not exist" if path.suffix == ".toml" else "is not a .toml file"
        raise FileNotFoundError(f"{path} {what}")
    return path


def _function(value: object) -> object:
    """Return the function that an entry gives, or raise what is wrong with it."""
    if not callable(value):
        raise TypeError(f"it gives {value!r}, not a function")
    return value
