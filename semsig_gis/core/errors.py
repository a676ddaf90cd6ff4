"""The errors that the package raises on purpose, all children of `SemsigError`."""

from __future__ import annotations

import contextlib
import difflib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


class SemsigError(Exception):
    """Root of the package's errors: the message is one plain sentence for the user.

    Examples
    --------
    >>> from semsig_gis import load_catalog
    >>> try:
    ...     load_catalog("montpelier")
    ... except SemsigError as error:
    ...     print("montpellier" in str(error))
    True
    """


class InputError(SemsigError, ValueError):
    """A value that the caller gave cannot be used."""


class UnknownNameError(SemsigError, LookupError):
    """A name (class, symbol, layer, method...) is not in the list it was looked up in."""


class CatalogError(SemsigError, ValueError):
    """A catalogue or taxonomy file is wrong, or does not fit the data it describes."""


class SourceError(SemsigError, RuntimeError):
    """A file of source data cannot be read."""


class CrsError(SemsigError, ValueError):
    """A coordinate reference system is missing or cannot be used."""


class EmptyResultError(SemsigError, ValueError):
    """A step would have produced nothing."""


class DatabaseError(SemsigError, RuntimeError):
    """A file that the package wrote is damaged or does not fit the request."""


def nearest_name(name: str, known: Iterable[str]) -> str:
    """Return ``"; the nearest is 'x'"`` for a misspelt name, or nothing where no name is near."""
    lowered = {candidate.lower(): candidate for candidate in known}
    close = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.5)
    return f"; the nearest is {lowered[close[0]]!r}" if close else ""


@contextlib.contextmanager
def extra(name: str, what: str) -> Iterator[None]:
    """Import packages of an extra in the block; InputError says how to install one that is missing.

    `what` needs them, such as "the workbench".
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        if package == __name__.partition(".")[0]:
            raise
        raise InputError(
            f"{what} needs {package}, which is not installed; install it with pip install "
            f"'semsig_gis[{name}]'."
        ) from error
