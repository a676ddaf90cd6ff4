"""Label maps: TOML files with the classes of the labels of a detector."""

from __future__ import annotations

import contextlib
import functools
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

from semsig_gis.core import (
    MAX_HEIGHT_M,
    WILDCARD,
    Accepts,
    CatalogError,
    FileTable,
    Flag,  # noqa: TC001 - of fields, as the next
    InputError,
    Parsed,
    Texts,  # noqa: TC001
    UnknownNameError,
    check_height,
    file_key,
    metres,
    nearest_name,
    number,
    pairs,
    read_table,
)
from semsig_gis.sources import built_in_taxonomy, class_codes, data_folder, families
from semsig_gis.storage import parse_toml, read_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from importlib.resources.abc import Traversable

    from semsig_gis.core import Taxonomy

ROUNDING = 1e-6


def _shares(entry: str | dict[str, float]) -> tuple[tuple[str, float], ...]:
    """Return classes with their chances; ValueError if these do not fit each other."""
    shares = {entry: 1.0} if isinstance(entry, str) else entry
    if not shares or sum(shares.values()) > 1 + ROUNDING:
        raise ValueError
    return tuple(shares.items())


class _LabelFile(FileTable):
    labels: Annotated[tuple[tuple[str, Any], ...], pairs(Any)] = ()
    left_out: Texts = ()


class _Label(FileTable):
    classes: Annotated[
        tuple[tuple[str, float], ...],
        Parsed(_shares, str | dict[str, Annotated[float, number("a chance", 0, 1, above=True)]]),
        Accepts(
            "the name of a class or a family, or a table of these with their chances, which sum to "
            "1 at most"
        ),
        file_key("class"),
    ]
    part: Flag = False
    height_m: Annotated[float, metres(MAX_HEIGHT_M)] | None = None
    height_sigma: Annotated[float, metres(MAX_HEIGHT_M)] | None = None


@dataclass(frozen=True, slots=True)
class Meaning:
    """The meaning of a label: names of classes with probabilities; empty for no street object.

    The rest of the probability, up to 1, is for any class. `height` is the height of the objects
    and its standard deviation, in metres, if it differs from the class; `part` means that boxes
    contain a part of the object, of unknown height.
    """

    classes: tuple[tuple[str, float], ...]
    height: tuple[float, float] | None = None
    part: bool = False

    @classmethod
    def parse(cls, value: object, where: str, classes: Mapping[str, Sequence[str]]) -> Self:
        """Parse an entry of a map; CatalogError if it is not valid.

        `classes` are names of classes and families, each with the classes that it stands for.
        """
        label = read_table(_Label, value if isinstance(value, dict) else {"class": value}, where)
        for name, _ in label.classes:
            if name not in classes:
                raise CatalogError(
                    f"{where} has the class {name!r}, which is unknown"
                    f"{nearest_name(name, classes)}."
                )
        height, sigma = label.height_m, label.height_sigma
        check_height(height, sigma, where)
        shares: dict[str, float] = {}
        for name, share in label.classes:
            for item in classes[name]:
                shares[item] = shares.get(item, 0.0) + share / len(classes[name])
        return cls(
            tuple(shares.items()),
            None if height is None or sigma is None else (height, sigma),
            part=label.part,
        )


NO_OBJECT = Meaning(())


@dataclass(frozen=True)
class LabelMap:
    """The meanings of the labels of detectors.

    Labels are compared without case, and blanks equal underscores. In a map, ``*`` is any number of
    characters and ``?`` is one. Exact labels have priority over patterns, then earlier entries over
    later ones. A label in no map that is a word for a class means this class.

    Parameters
    ----------
    meanings : tuple of (str, Meaning)
        Labels, or patterns, and their meanings.
    taxonomies : tuple of Taxonomy
        The classes for words, in order of priority.

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
        """Merge maps, given by name (see `label_maps`) or file; without any, all built-in maps.

        Earlier maps have priority. UnknownNameError if a name is unknown; CatalogError or
        InputError if a file is invalid or cannot be read.
        """
        sources = list(maps) or list(label_maps())
        taxonomies = taxonomy, built_in_taxonomy()
        classes = _classes(taxonomies)
        meanings: list[tuple[str, Meaning]] = []
        built_in = _built_in_maps()
        for source in sources:
            name = str(source)
            try:
                if name in built_in:
                    text = built_in[name].read_text(encoding="utf-8")
                elif Path(source).suffix.lower() == ".toml":
                    text = read_text(source)
                else:
                    raise UnknownNameError(
                        f"label map {name!r} is unknown{nearest_name(name, built_in)}; give "
                        f"{', '.join(built_in)} or a TOML file."
                    )
            except (OSError, UnicodeDecodeError) as error:
                reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
                raise InputError(
                    f"label map {name} cannot be read ({reason}); give a TOML file."
                ) from error
            where = f"label map {name}"
            content = read_table(_LabelFile, parse_toml(text, where), where)
            meanings += [
                (label, Meaning.parse(value, f"{where}, label {label!r}", classes))
                for label, value in content.labels
            ]
            meanings += [(label, NO_OBJECT) for label in content.left_out]
        return cls(tuple(meanings), taxonomies)

    def find(self, label: str) -> Meaning | None:
        """Return the meaning of a label; None if it is unknown."""
        plain = _plain(label)
        if plain in self._exact:
            return self._exact[plain]
        for pattern, meaning in self._patterns:
            if pattern.fullmatch(plain):
                return meaning
        for taxonomy in self.taxonomies:
            with contextlib.suppress(UnknownNameError):
                codes = class_codes(label, taxonomy)
                if codes != (WILDCARD,):
                    names = [taxonomy.by_code(code).name for code in codes]
                    return Meaning(tuple((name, 1.0 / len(names)) for name in names))
        return None

    @functools.cached_property
    def _exact(self) -> dict[str, Meaning]:
        return {_plain(label): meaning for label, meaning in reversed(self.meanings)}

    @functools.cached_property
    def _patterns(self) -> list[tuple[re.Pattern[str], Meaning]]:
        wild = {r"\*": ".*", r"\?": "."}
        return [
            (
                re.compile(
                    re.sub(r"\\[*?]", lambda match: wild[match[0]], re.escape(_plain(label)))
                ),
                meaning,
            )
            for label, meaning in self.meanings
            if {"*", "?"} & set(label)
        ]


def _classes(taxonomies: Iterable[Taxonomy]) -> dict[str, list[str]]:
    """Return the names of classes and families, each with the classes that it stands for.

    Those of a family are from the first taxonomy that has any.
    """
    classes: dict[str, list[str]] = {}
    for taxonomy in taxonomies:
        for item in taxonomy.classes:
            classes[item.name] = [item.name]
    for taxonomy in taxonomies:
        for name, codes in families(taxonomy).items():
            classes.setdefault(name, [taxonomy.by_code(code).name for code in codes])
    return classes


def label_maps() -> tuple[str, ...]:
    """Return the names of the label maps that come with the package, sorted."""
    return tuple(sorted(_built_in_maps()))


def _built_in_maps() -> dict[str, Traversable]:
    return {
        Path(item.name).stem: item
        for item in (data_folder() / "labels").iterdir()
        if item.name.endswith(".toml")
    }


def _plain(label: str) -> str:
    return re.sub(r"[\s_]+", " ", label).strip().casefold()
