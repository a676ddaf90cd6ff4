"""Layers of a draft: which files are a single layer, and the names of classes of their own."""

from __future__ import annotations

import glob
import itertools
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import MAX_CODE, OWN_CODES
from semsig_gis.sources import built_in_taxonomy, families, matches_pattern, words_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.objects.guesses import ClassGuess, Column, LayerSample
    from semsig_gis.sources import PositionFields

# Minimum number of letters that the names of the files of a layer have in common.
COMMON_LETTERS = 3
# Minimum share of the identifiers of a file that another one has as well, if it is an edition.
SAME_IDS = 0.5


@dataclass(frozen=True, slots=True)
class LayerDraft:
    """Facts and guesses about a layer."""

    file: Path
    sample: LayerSample
    columns: tuple[Column, ...]
    geometry: str | None
    guess: ClassGuess
    class_by: tuple[str, dict[str, str]] | None
    mixed: bool
    positions: PositionFields | None
    crs: str | None
    crs_reason: str = ""
    # Of a layer in several files: the pattern of their names, and the others.
    pattern: str = ""
    others: tuple[LayerDraft, ...] = ()
    remark: str = ""

    @property
    def name(self) -> str:
        """The name of the layer, for people."""
        if self.pattern:
            return Path(self.pattern).stem
        return self.sample.info.name

    @property
    def id_field(self) -> str:
        """The first field that is named like an identifier and differs in every row."""
        fields = [item for item in self.columns if item.meant_for("identifier") and item.unique]
        return fields[0].name if fields and self.is_whole else ""

    @property
    def ids(self) -> set[str]:
        """The values of the identifier."""
        (column,) = (item for item in self.columns if item.name == self.id_field)
        return {str(value) for value in column.counts}

    @property
    def kind(self) -> tuple[object, ...]:
        """What files have in common that can be a single layer."""
        info = self.sample.info
        # Files of an unknown class hold the same things if their names begin with the same word.
        thing = self.guess.name or snake(self.file.stem).partition("_")[0]
        form = self.file.suffix.lower(), self.sample.reader, info.fields, info.crs, info.encoding
        place = self.geometry, self.positions, self.crs
        return *form, *place, thing, self.mixed, self.id_field

    @property
    def unlisted(self) -> dict[str, int]:
        """Numbers of rows with a value of the field `class_by` that names no class."""
        if self.class_by is None:
            return {}
        field, classes = self.class_by
        (column,) = (column for column in self.columns if column.name == field)
        counts = {
            str(value): count
            for value, count in column.counts.most_common()
            if value not in classes
        }
        return counts | ({f"no {field}": column.missing} if column.missing else {})

    @property
    def is_whole(self) -> bool:
        """Whether all rows were read."""
        return len(self.sample.rows) == self.sample.info.rows

    @property
    def needs_class(self) -> bool:
        """Whether some rows get the class of the layer."""
        return not self.mixed or bool(self.unlisted) or not self.is_whole


def own_classes(drafts: Sequence[LayerDraft]) -> list[LayerDraft]:
    """Name the unknown classes of layers after their files, or after layers of the same file.

    Names differ unless they do so in numbers at their end only, as of "planters_2021".
    """
    taxonomy = built_in_taxonomy()
    # A family is a word for several classes.
    reserved = {*families(taxonomy), "unknown", "something"}
    reserved |= {item.name for item in taxonomy.classes}
    names: dict[str, str] = {}
    result = []
    for draft in drafts:
        guess = draft.guess
        if not guess.name:
            several = sum(other.file == draft.file for other in drafts) > 1
            text = draft.name if several or draft.pattern else draft.file.stem
            plain = re.sub(r"[\W\d_]+$", "", text) or text
            if plain.casefold() not in names:
                names[plain.casefold()] = _own_name(plain, {*reserved, *names.values()})
            guess = replace(guess, name=names[plain.casefold()])
        result.append(replace(draft, guess=guess))
    return result


def without_code(layers_of: Mapping[Path, Sequence[LayerDraft]]) -> list[Path]:
    """Return the files with unknown classes for which no code for an own class is left."""
    used = 0
    files = []
    for file, layers in layers_of.items():
        unknown = sum(not layer.guess.name for layer in layers)
        if unknown and used + unknown > MAX_CODE - OWN_CODES + 1:
            files.append(file)
        else:
            used += unknown
    return files


def _own_name(text: str, names: set[str]) -> str:
    """Return a name for a class that is not among some names."""
    name = re.sub(r"[^a-z0-9]+", "_", snake(text)).strip("_")
    name = name if name[:1].isalpha() else f"layer_{name}".rstrip("_")
    others = (f"{name}_{number}" for number in itertools.count(2))
    candidates = itertools.chain([name, f"{name}_object"], others)
    return next(candidate for candidate in candidates if candidate not in names)


def shared_layers(drafts: Sequence[LayerDraft], folder: Path) -> list[LayerDraft]:
    """Join files of the same kind to a layer if their rows have identifiers that all differ.

    Files that may hold the same things get a remark.
    """
    everything = [path.name for path in folder.iterdir()]
    files = [draft.file for draft in drafts]
    layers: list[LayerDraft] = []
    for draft in drafts:
        group = [
            other
            for other in drafts
            if other.kind == draft.kind and draft.id_field and files.count(other.file) == 1
        ]
        pattern = _pattern(group, everything)
        if pattern and draft is group[0]:
            layers.append(replace(draft, pattern=pattern, others=tuple(group[1:])))
        elif not pattern or draft not in group:
            layers.append(replace(draft, remark=_remark(draft, layers)))
    return layers


def _pattern(group: Sequence[LayerDraft], everything: Sequence[str]) -> str:
    """Return the pattern of the names of some files and of no other; empty if there is none."""
    names = [draft.file.name for draft in group]
    ids = [draft.ids for draft in group]
    if len(names) < 2 or sum(map(len, ids)) > len(set().union(*ids)):  # noqa: PLR2004 - several
        return ""
    if group[0].mixed:
        return ""
    start = _common(names)
    end = _common([name[len(start) :][::-1] for name in names])[::-1]
    # Whole words, as "lights_*.csv" for north and south.
    end = re.sub(r"^[^\W_]+", "", end)
    start = re.sub(r"(?<=[\W_])[^\W_]+$", "", start)
    pattern = f"{glob.escape(start)}*{glob.escape(end)}"
    common = len("".join(words_of(start))) + len("".join(words_of(Path(end).stem)))
    matching = [name for name in everything if matches_pattern(name, [pattern])]
    return pattern if common >= COMMON_LETTERS and sorted(matching) == sorted(names) else ""


def _common(texts: Sequence[str]) -> str:
    """Return the beginning that texts have in common."""
    equal = itertools.takewhile(lambda signs: len(set(signs)) == 1, zip(*texts, strict=False))
    return "".join(signs[0] for signs in equal)


def _remark(draft: LayerDraft, earlier: Sequence[LayerDraft]) -> str:
    """Return a question if an earlier layer may hold the same things as this one."""
    for other in earlier:
        if other.file == draft.file:
            continue
        if other.file.stem.casefold() == draft.file.stem.casefold():
            return f"is it the same data as {other.file.name}? then remove one of the two layers"
        same_kind = other.kind == draft.kind and draft.id_field
        if same_kind and len(draft.ids & other.ids) >= SAME_IDS * len(draft.ids):
            return (
                f"is it another edition of {other.file.name}, with the same ids? then remove one "
                "of the two layers"
            )
    return ""


def snake(text: str) -> str:
    """Return a name in lower case with underscores."""
    return "_".join(words_of(text)) or "layer"
