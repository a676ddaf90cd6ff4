"""Columns of layers, described for a person: title, unit, meaning, decimals."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from semsig_gis.core import one_lines, percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

LABEL_LETTERS = 60
LINKS = "Links"
"""Tab of the columns of addresses."""


@dataclass(frozen=True)
class Column:
    """A column of a layer.

    The unit ``1`` is a chance or a share from 0 to 1. In the name, ``#`` matches a number and ``*``
    the name of a class; ``{}`` in the title is replaced by it.
    """

    name: str
    title: str
    about: str = ""
    unit: str = ""
    decimals: int | None = None
    tab: str = "More"

    @property
    def alias(self) -> str:
        """Title with the unit."""
        return f"{self.title} ({self.unit})" if self.unit not in {"", "1"} else self.title

    def text(self, value: Any) -> str | None:  # noqa: ANN401 - any value of a table
        """Return a value with its unit, a chance in percent; None if it is missing."""
        if value is None or value != value or value == "":  # noqa: PLR0124 - NaN
            return None
        if self.unit == "1":
            return percent(float(value))
        if self.decimals is None:
            # Integers become floats in a file and in a column with missing values.
            return f"{value:.0f}" if isinstance(value, float) else str(value)
        return f"{value:,.{self.decimals}f}{'' if self.unit == '°' else ' '}{self.unit}".rstrip()


# Columns of a layer by tab of its form.
Form = Mapping[str, tuple[Column, ...]]


def form_of(text: str) -> Form:
    """Return the columns that a TOML text describes, by tab of the form.

    A line is ``name = [title, meaning, unit, decimals]``, without decimals for other than numbers.
    """
    return {
        tab: tuple(replace(Column(name, *values), tab=tab) for name, values in columns.items())
        for tab, columns in tomllib.loads(text).items()
    }


def described(names: Sequence[str], form: Form, classes: Mapping[str, str]) -> tuple[Column, ...]:
    """Return the description of each column, in the order of the form, undescribed columns last.

    A column has its first matching description. `classes` are titles by the name of a class.
    """
    columns = list(_matches(names, form, classes))
    titles = shown_lines(column.title for column in columns)
    columns = [replace(column, title=title) for column, title in zip(columns, titles, strict=True)]
    form_names = {column.name for column in columns}
    columns += [Column(name, name) for name in names if name not in form_names]
    # Classes may have equal titles, but the titles of two columns differ.
    counts = Counter(column.title for column in columns)
    return tuple(
        replace(column, title=f"{column.title} ({column.name})")
        if counts[column.title] > 1
        else column
        for column in columns
    )


def _matches(names: Sequence[str], form: Form, classes: Mapping[str, str]) -> Iterator[Column]:
    remaining = list(names)
    for tab, columns in form.items():
        for column in columns:
            regex = re.compile(column.name.replace("#", r"(\d+)").replace("*", r"(\w+)"))
            for match in [*filter(None, map(regex.fullmatch, remaining))]:
                remaining.remove(match.string)
                word = match[1] if match.groups() else ""
                title = column.title.format(classes.get(word, word))
                yield replace(column, name=match.string, title=title, tab=tab)


def shown_lines(texts: Iterable[str], letters: int = LABEL_LETTERS) -> list[str]:
    """Return texts from data for QGIS: short single lines, without expressions to evaluate."""
    lines = [line.replace("[%", "[ %") for line in one_lines(texts)]
    return [line if len(line) <= letters else f"{line[: letters - 1].rstrip()}…" for line in lines]
