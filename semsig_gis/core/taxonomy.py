"""Classes of street objects: stable code, one-character symbol and name."""

from __future__ import annotations

import functools
import itertools
import re
from dataclasses import asdict, dataclass, field, fields, replace
from string import ascii_letters, digits
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from semsig_gis.core.display import Displayed
from semsig_gis.core.errors import CatalogError, UnknownNameError, listed, nearest_name
from semsig_gis.core.inputs import (
    Flag,  # noqa: TC001 - of fields
    check_fields,
    matching,
    metres,
    number,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import ArrayLike, NDArray

MAX_CODE = 255
OWN_CODES = 224
"""First code of the classes that a user names; those of built-in catalogues are below."""
LETTERS = (
    "\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u024f"  # Latin
    "\u0391-\u03a1\u03a3-\u03a9\u03b1-\u03c9\u0410-\u044f"  # Greek and Cyrillic
)
"""Letters beyond ASCII that may be symbols, two bytes in UTF-8."""
Shape = Literal["point", "line", "area"]
WILDCARD = 0
"""Code of an object of unknown class."""
UNKNOWN_NAME = "unknown"
"""Name of any class, in views and explanations."""
MAX_RANGE_M = 6000.0
MAX_HEIGHT_M = 500.0


@dataclass(frozen=True, slots=True)
class ObjectClass:
    """A class of street objects.

    Classes are equal if they differ only in their titles, because each city may have its own.

    Parameters
    ----------
    code : int
        Stable number, 1 to 255.
    symbol : str
        Letter (Latin, Greek or Cyrillic) or digit of the class in a type sequence.
    name : str
        Lower-case identifier such as ``street_light``.
    title : str
        Name for people, in answers, reports and legends.
    range_m : float, optional
        Distance from which an object of the class is visible, in metres; None for the default.
    height_m, height_sigma : float, optional
        Mean and standard deviation of the height of an object above the ground, in metres; None if
        the distance cannot be estimated from the height.
    family : str, optional
        Lower-case identifier of classes that are confused more easily with each other than with
        others, such as ``shop``; empty if it has none.
    shape : {"point", "line", "area"}
        Whether its objects are points, or extended things; a viewpoint sees their nearest visible
        point.
    tall : bool, default False
        Whether its objects are landmarks, seen over roofs up to `range_m`.

    Raises
    ------
    CatalogError
        If the code, symbol or name has another form, the range is not above 0, or only one of
        height and deviation is given or it is not above 0.

    Examples
    --------
    >>> ObjectClass(3, "D", "street_light", "Street light").symbol
    'D'
    """

    code: Annotated[int, number("a whole number from 1 to 255", 1, MAX_CODE, whole=True)]
    symbol: Annotated[str, matching("[A-Za-z0-9" + LETTERS + "]", "one letter or digit")]
    name: Annotated[str, matching("[a-z][a-z0-9_]*", "lower-case letters, digits and underscores")]
    title: str = field(compare=False)
    range_m: Annotated[float, metres(MAX_RANGE_M)] | None = None
    height_m: Annotated[float, metres(MAX_HEIGHT_M)] | None = None
    height_sigma: Annotated[float, metres(MAX_HEIGHT_M)] | None = None
    family: Annotated[
        str, matching("([a-z][a-z0-9_]*)?", "lower-case letters, digits and underscores")
    ] = field(default="", compare=False)
    shape: Shape = field(default="point", compare=False)
    tall: Flag = False

    def __post_init__(self) -> None:  # noqa: D105
        check_fields(self, f"class {self.name!r}", error=CatalogError)
        check_height(self.height_m, self.height_sigma, f"class {self.name!r}")


def _usual_family(code: int) -> str:
    """Return the family of a class that states none in a file."""
    return "furniture" if code < OWN_CODES else ""


def check_height(height: float | None, sigma: float | None, what: str) -> None:
    """Raise CatalogError if a height and its deviation (metres) are incomplete or out of range.

    `what` names the object in the message.
    """
    if height is None and sigma is None:
        return
    if height is None or sigma is None or not 0 < sigma <= height <= MAX_HEIGHT_M:
        raise CatalogError(
            f"{what} has a height of {height} m and a height_sigma of {sigma} m; give height_m "
            f"above 0 and up to {MAX_HEIGHT_M:.0f}, and height_sigma above 0 and at most height_m."
        )


@dataclass(frozen=True, repr=False)
class Taxonomy(Displayed):
    """An immutable list of object classes with unique codes, symbols and names.

    Parameters
    ----------
    classes : tuple of ObjectClass
        The classes, in any order.

    Raises
    ------
    CatalogError
        If a code, symbol or name is not unique.

    Examples
    --------
    >>> lights = Taxonomy((ObjectClass(3, "D", "street_light", "Street light"),))
    >>> lights.encode("DD").tolist()
    [3, 3]
    >>> lights.decode([3, 3])
    'DD'
    >>> lights.words([3, 3])
    '2 × street light'
    """

    classes: tuple[ObjectClass, ...]

    def __post_init__(self) -> None:  # noqa: D105
        for attribute in ("code", "symbol", "name"):
            names: dict[object, str] = {}
            for item in self.classes:
                value = getattr(item, attribute)
                if value in names:
                    raise CatalogError(
                        f"{attribute} {value!r} is given to both {names[value]!r} and "
                        f"{item.name!r}; give each class a {attribute} of its own."
                    )
                names[value] = item.name

    def _facts(self) -> dict[str, object]:
        symbols = "".join(item.symbol for item in self.classes)
        return {"classes": len(self.classes), "symbols": symbols}

    @classmethod
    def from_list(cls, items: Iterable[Mapping[str, Any]]) -> Taxonomy:
        """Return a taxonomy from plain mappings, the inverse of `to_list`; TypeError for others."""
        items = list(items)
        if not all(isinstance(item, dict) for item in items):
            raise TypeError("a class is no mapping")
        return cls(
            tuple(
                ObjectClass(**{"family": _usual_family(item.get("code", MAX_CODE)), **item})
                for item in items
            )
        )

    def to_list(self) -> list[dict[str, Any]]:
        """Return the classes as plain mappings for JSON, without fields that have their default.

        The family of a built-in class is furniture by default.
        """
        defaults = {item.name: item.default for item in fields(ObjectClass)}
        return [
            {
                key: value
                for key, value in asdict(item).items()
                if value != defaults[key] and (key, value) != ("family", _usual_family(item.code))
            }
            for item in self.classes
        ]

    def extended(self, classes: Iterable[ObjectClass | str]) -> Taxonomy:
        """Return a taxonomy with further classes; their codes, symbols and names must be new.

        A class that is only a name, such as ``"statue"``, gets a code from 224 and a free symbol.

        >>> from semsig_gis import paper_taxonomy
        >>> statue = paper_taxonomy().extended(["statue"]).by_name("statue")
        >>> statue.code, statue.symbol, statue.title
        (224, 's', 'Statue')
        """
        taxonomy = self
        for item in classes:
            new = item if isinstance(item, ObjectClass) else taxonomy._new_class(item)
            taxonomy = Taxonomy((*taxonomy.classes, new))
        return taxonomy

    def _new_class(self, name: str) -> ObjectClass:
        """Return a class with a free code and symbol, a letter of its name if possible."""
        codes = {item.code for item in self.classes}
        symbols = {item.symbol for item in self.classes}
        code = next((code for code in range(OWN_CODES, MAX_CODE + 1) if code not in codes), None)
        own = (sign for sign in name if sign.isalnum())
        more = re.findall(f"[{LETTERS}]", "".join(map(chr, range(0xC0, 0x450))))
        free = (
            sign
            for sign in itertools.chain(own, ascii_letters, more, digits)
            if sign not in symbols
        )
        symbol = next(free, None)
        if code is None or symbol is None:
            raise CatalogError(
                f"class {name!r} cannot be added, because the codes from {OWN_CODES} or the "
                "symbols are all in use; use fewer classes."
            )
        return ObjectClass(code, symbol, name, name.replace("_", " ").capitalize())

    def with_ranges(self, ranges: Mapping[str, float]) -> Taxonomy:
        """Return a taxonomy with the visibility ranges (metres) of some classes, by name, replaced.

        The other classes keep their range.
        """
        return self._with("range_m", {name: float(metres) for name, metres in ranges.items()})

    def with_titles(self, titles: Mapping[str, str]) -> Taxonomy:
        """Return a taxonomy with the titles of some classes, by name, replaced."""
        return self._with("title", titles)

    def _with(self, attribute: str, values: Mapping[str, Any]) -> Taxonomy:
        for name in values:
            self.by_name(name)
        return Taxonomy(
            tuple(
                replace(item, **{attribute: values[item.name]}) if item.name in values else item
                for item in self.classes
            )
        )

    def by_name(self, name: str) -> ObjectClass:
        """Return the class with a name; UnknownNameError, with the nearest name, if none has it."""
        if result := self._class_with("name", name):
            return result
        names = [item.name for item in self.classes]
        raise UnknownNameError(
            f"class {name!r} is unknown{nearest_name(name, names)}; "
            f"the classes are {listed(names)}; Taxonomy.extended adds one, as does [[classes]] "
            "in a catalogue."
        )

    def by_code(self, code: int) -> ObjectClass:
        """Return the class with a code; UnknownNameError if none has it."""
        if result := self._class_with("code", code):
            return result
        raise UnknownNameError(
            f"class code {code} is unknown; the codes are "
            f"{listed([str(item.code) for item in self.classes])}."
        )

    def by_symbol(self, symbol: str) -> ObjectClass:
        """Return the class with a symbol; UnknownNameError if none has it."""
        if result := self._class_with("symbol", symbol):
            return result
        raise self._unknown_symbol(symbol)

    def _class_with(self, attribute: str, value: object) -> ObjectClass | None:
        return next((item for item in self.classes if getattr(item, attribute) == value), None)

    def encode(self, symbols: str) -> NDArray[np.uint8]:
        """Return the class codes of symbols such as ``"DDBL"``, shape (n,); ``?`` is `WILDCARD`."""
        codes = {item.symbol: item.code for item in self.classes}
        codes["?"] = WILDCARD
        unknown = next((symbol for symbol in symbols if symbol not in codes), None)
        if unknown is not None:
            raise self._unknown_symbol(unknown)
        return np.fromiter((codes[symbol] for symbol in symbols), np.uint8, count=len(symbols))

    def _unknown_symbol(self, symbol: str) -> UnknownNameError:
        near = nearest_name(symbol, [item.symbol for item in self.classes])
        return UnknownNameError(
            f"symbol {symbol!r} is unknown{near}; `semsig info --symbols` lists those of a city."
        )

    def decode(self, codes: ArrayLike) -> str:
        """Return the symbols of class codes, shape (n,), the inverse of `encode`."""
        points = self.symbol_points[np.asarray(codes, dtype=np.uint8)]
        return points.tobytes().decode("utf-32-le")

    def title_of(self, name: str) -> str:
        """Return the title of what an object was said to be (see `View.class_names`).

        >>> from semsig_gis import paper_taxonomy
        >>> taxonomy = paper_taxonomy()
        >>> [taxonomy.title_of(name) for name in ("shop", "bus_stop or bench", "unknown")]
        ['Shop', 'Bus stop or bench', 'Something']
        """
        titles = {item.name: item.title for item in self.classes} | {UNKNOWN_NAME: "Something"}
        first, *rest = (
            titles.get(part, part.replace("_", " ").capitalize()) for part in name.split(" or ")
        )
        return " or ".join([first, *map(str.lower, rest)])

    def words(self, codes: ArrayLike) -> str:
        """Return the titles of class codes, shape (n,), for people.

        They are in lower case and in the order of the codes, with equal neighbours counted.

        >>> from semsig_gis import paper_taxonomy
        >>> paper_taxonomy().words([11, 5, 5, 0])
        'bus stop, 2 × traffic light, something'
        >>> paper_taxonomy().words([])
        'nothing'
        """
        parts = []
        for code, group in itertools.groupby(np.asarray(codes, dtype=np.uint8).tolist()):
            title = "something" if code == WILDCARD else self.by_code(code).title.lower()
            count = len([*group])
            parts.append(title if count == 1 else f"{count} × {title}")
        return ", ".join(parts) or "nothing"

    def family_codes(self, family: str) -> NDArray[np.uint8]:
        """Return the class codes of a family, ascending; UnknownNameError if no class is in it.

        >>> from semsig_gis import load_catalog
        >>> 10 in load_catalog("openstreetmap").taxonomy.family_codes("furniture")
        True
        """
        codes = sorted(item.code for item in self.classes if item.family == family != "")
        if not codes:
            names = list(dict.fromkeys(item.family for item in self.classes if item.family))
            raise UnknownNameError(
                f"family {family!r} is unknown{nearest_name(family, names)}; the families are "
                f"{', '.join(names) or 'none'}."
            )
        return np.array(codes, dtype=np.uint8)

    @functools.cached_property
    def symbol_points(self) -> NDArray[np.uint32]:
        """Unicode code points of the symbols of all codes, shape (256,); ``?`` for unused codes."""
        table = np.full(MAX_CODE + 1, ord("?"), dtype="<u4")
        for item in self.classes:
            table[item.code] = ord(item.symbol)
        table.setflags(write=False)
        return table

    @property
    def tall_codes(self) -> NDArray[np.uint8]:
        """Class codes of the landmarks, ascending."""
        return np.array(sorted(item.code for item in self.classes if item.tall), np.uint8)

    def ranges(self, radius: float) -> NDArray[np.float64]:
        """Return the visibility range of each class code in metres, shape (256,).

        It is `radius` for classes without a range and for unused codes.
        """
        table = np.full(MAX_CODE + 1, float(radius))
        for item in self.classes:
            if item.range_m is not None:
                table[item.code] = item.range_m
        return table

    def near_reach(self, radius: float) -> float:
        """Return the longest visibility range in metres of the classes that are not tall.

        It is at least `radius`, the range of classes without their own.
        """
        ranges = (item.range_m or 0.0 for item in self.classes if not item.tall)
        return float(max([radius, *ranges]))
