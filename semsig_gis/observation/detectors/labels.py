"""Label maps: TOML files that say which classes the labels of a detector stand for."""

from __future__ import annotations

import contextlib
import functools
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import (
    MAX_HEIGHT_M,
    CatalogError,
    InputError,
    UnknownNameError,
    check_height,
    nearest_name,
)
from semsig_gis.sources import built_in_taxonomy, class_code, data_folder
from semsig_gis.storage import check_keys, metres, parse_toml, read_text, texts

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from importlib.resources.abc import Traversable

    from semsig_gis.core import Taxonomy

MAP_KEYS = {"labels": dict, "left_out": list}
MEANING_KEYS = {"class": object, "part": bool, "height_m": object, "height_sigma": object}
ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Meaning:
    """What a label stands for: classes by name, each with its chance; none for no street object.

    What the chances lack to 1 is any class. `height` is how tall the boxes of the label are and its
    deviation, in metres, where that differs from the class; `part` tells that they hold a part of
    the object, of unknown height.
    """

    classes: tuple[tuple[str, float], ...]
    height: tuple[float, float] | None = None
    part: bool = False


NO_OBJECT = Meaning(())


@dataclass(frozen=True)
class LabelMap:
    """What the labels of detectors stand for.

    Labels are compared without capitals, a blank being as good as an underscore; ``*`` and ``?``
    in a map stand for any letters, or one. A label that is written out goes before a pattern, and
    the first of several decides; one of no map that is a word for a class stands for it.

    Parameters
    ----------
    meanings : tuple of (str, Meaning)
        Labels, or patterns, and what they stand for.
    taxonomies : tuple of Taxonomy
        The classes that words stand for, those of the first one first.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> labels = LabelMap.open(["coco"], paper_taxonomy())
    >>> labels.find("Traffic_Light").classes, labels.find("dog").classes, labels.find("lion")
    ((('traffic_light', 1.0),), (), None)
    """

    meanings: tuple[tuple[str, Meaning], ...]
    taxonomies: tuple[Taxonomy, ...] = ()

    @classmethod
    def open(cls, maps: Iterable[str | Path], taxonomy: Taxonomy) -> LabelMap:
        """Return several maps as one, by their names (see `label_maps`) or files; all if none.

        The first that knows a label decides. UnknownNameError if there is none of a name;
        CatalogError or InputError if a file is wrong or cannot be read.
        """
        chosen = list(maps) or list(label_maps())
        taxonomies = taxonomy, built_in_taxonomy()
        classes = {item.name for one in taxonomies for item in one.classes}
        return cls(tuple(pair for one in chosen for pair in _meanings(one, classes)), taxonomies)

    def find(self, label: str) -> Meaning | None:
        """Return what a label stands for, None if that is not known."""
        plain = _plain(label)
        if plain in self._exact:
            return self._exact[plain]
        for pattern, meaning in self._patterns:
            if pattern.fullmatch(plain):
                return meaning
        for taxonomy in self.taxonomies:
            with contextlib.suppress(UnknownNameError):
                if code := class_code(label, taxonomy):
                    return Meaning(((taxonomy.by_code(code).name, 1.0),))
        return None

    @functools.cached_property
    def _exact(self) -> dict[str, Meaning]:
        return {_plain(label): meaning for label, meaning in reversed(self.meanings)}

    @functools.cached_property
    def _patterns(self) -> list[tuple[re.Pattern[str], Meaning]]:
        wild = {r"\*": ".*", r"\?": "."}
        return [
            (
                re.compile(re.sub(r"\\[*?]", lambda one: wild[one[0]], re.escape(_plain(label)))),
                meaning,
            )
            for label, meaning in self.meanings
            if {"*", "?"} & set(label)
        ]


def label_maps() -> tuple[str, ...]:
    """Return the names of the label maps that come with the package, sorted."""
    return tuple(sorted(_shipped()))


def _shipped() -> dict[str, Traversable]:
    return {
        Path(item.name).stem: item
        for item in (data_folder() / "labels").iterdir()
        if item.name.endswith(".toml")
    }


def _plain(label: str) -> str:
    return re.sub(r"[\s_]+", " ", label).strip().casefold()


def _meanings(one: str | Path, classes: set[str]) -> list[tuple[str, Meaning]]:
    """Return what a map says of each label."""
    shipped = _shipped()
    try:
        if str(one) in shipped:
            text = shipped[str(one)].read_text(encoding="utf-8")
        elif Path(one).suffix.lower() == ".toml":
            text = read_text(one)
        else:
            known = ", ".join(shipped)
            raise UnknownNameError(
                f"label map {str(one)!r} is unknown{nearest_name(str(one), shipped)}; give {known} "
                "or a TOML file."
            )
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"label map {one} cannot be read ({reason}); give a TOML file.") from error
    where = f"label map {one}"
    content = parse_toml(text, where)
    check_keys(content, MAP_KEYS, where)
    said = [
        (label, _meaning(value, f"{where}, label {label!r}", classes))
        for label, value in content.get("labels", {}).items()
    ]
    left_out = texts(content.get("left_out", []), "left_out", where)
    return said + [(label, NO_OBJECT) for label in left_out]


def _meaning(value: object, where: str, classes: set[str]) -> Meaning:
    """Return what a map says of one label."""
    item: Mapping[str, Any] = value if isinstance(value, dict) else {"class": value}
    check_keys(item, MEANING_KEYS, where, ("class",))
    named = item["class"]
    shares = {named: 1.0} if isinstance(named, str) else named
    numbers = isinstance(shares, dict) and all(
        isinstance(share, int | float) and not isinstance(share, bool) and 0 < share <= 1
        for share in shares.values()
    )
    if not shares or not numbers or sum(shares.values()) > 1 + ROUNDING:
        raise CatalogError(
            f"{where} has class = {named!r}; write the name of a class, or a table of classes with "
            "their chances, which sum to 1 at most."
        )
    for name in shares:
        if name not in classes:
            raise CatalogError(
                f"{where} has the class {name!r}, which is unknown{nearest_name(name, classes)}."
            )
    height, sigma = (
        metres(item[key], key, where, most=MAX_HEIGHT_M) if key in item else None
        for key in ("height_m", "height_sigma")
    )
    check_height(height, sigma, where)
    return Meaning(
        tuple((name, float(share)) for name, share in shares.items()),
        None if height is None or sigma is None else (height, sigma),
        part=item.get("part", False),
    )
