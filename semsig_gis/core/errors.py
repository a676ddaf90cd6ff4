"""Exceptions of the package, all subclasses of `SemsigError`."""

from __future__ import annotations

import contextlib
import difflib
from typing import TYPE_CHECKING

from semsig_gis.core.text import shortened

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

NAMES_LISTED = 40
MOST_CHARACTERS = 200


class SemsigError(Exception):
    """Base class of the package's exceptions; the message is one plain sentence for the user.

    Examples
    --------
    >>> from semsig_gis import load_catalog
    >>> try:
    ...     load_catalog("montpelier")
    ... except SemsigError as error:
    ...     print("montpellier" in str(error))
    True
    """

    def __str__(self) -> str:
        """Return the message without long quotations, such as of the content of a file."""
        return shortened(super().__str__())


class InputError(SemsigError, ValueError):
    """An argument or input value cannot be used."""


class UnknownNameError(SemsigError, LookupError):
    """A name (of a class, symbol, layer, method...) does not exist."""


class CatalogError(SemsigError, ValueError):
    """A catalogue or taxonomy file is wrong, or does not fit the data it describes."""


class SourceError(SemsigError, RuntimeError):
    """A file of source data cannot be read."""


class CrsError(SemsigError, ValueError):
    """A coordinate reference system is missing or cannot be used."""


class EmptyResultError(SemsigError, ValueError):
    """The result of a step is empty."""


class DatabaseError(SemsigError, RuntimeError):
    """A file written by the package is damaged or does not fit the request."""


def brief(error: Exception) -> str:
    """Return the first sentence of the message of an error, shortened, for a part of a sentence.

    Examples
    --------
    >>> brief(ValueError("It has no rows. Give others."))
    'It has no rows'
    """
    text = " ".join(str(error).split()).partition(". ")[0].rstrip(".")
    return text if len(text) <= MOST_CHARACTERS else f"{text[:MOST_CHARACTERS]}…"


def nearest_name(name: str, names: Iterable[str]) -> str:
    """Return ``"; the nearest is 'x'"`` for a misspelt name; empty if no name is similar."""
    lower_case = {candidate.lower(): candidate for candidate in names}
    matches = difflib.get_close_matches(name.lower(), lower_case, n=1, cutoff=0.5)
    return f"; the nearest is {lower_case[matches[0]]!r}" if matches else ""


def listed(names: Sequence[str]) -> str:
    """Return names for a message, of many the first ones and the number of the others."""
    others = len(names) - NAMES_LISTED
    more = f" and {others} others" if others > 0 else ""
    return ", ".join(names[:NAMES_LISTED]) + more


@contextlib.contextmanager
def extra(name: str, what: str) -> Iterator[None]:
    """Raise InputError if an optional package that is imported in the block is not installed.

    `name` is the extra that installs it; `what` is the feature that needs it, such as
    "the workbench".
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
