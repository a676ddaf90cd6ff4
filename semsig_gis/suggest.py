"""A first draft of a catalogue for a file that nobody has described yet, for a person to edit."""

from __future__ import annotations

import glob
import itertools
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.catalog import catalog_names, load_catalog, paper_taxonomy
from semsig_gis.errors import CrsError, SourceError
from semsig_gis.guesses import (
    columns_of,
    guess_class,
    guess_class_by,
    guess_position,
)
from semsig_gis.keywords import words_of
from semsig_gis.schema import require_metric_crs
from semsig_gis.sources._sample import VECTOR, samples
from semsig_gis.sources.vector_file import NO_GEOMETRY
from semsig_gis.taxonomy import MAX_CODE, ObjectClass

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.guesses import ClassGuess, Column
    from semsig_gis.sources._sample import Sample

__all__ = ["suggest_catalog"]

# Marks what a person must fill in; as a class, it does not load.
EDIT = "EDIT"
SAMPLE_ROWS = 100_000
FILTERS_SHOWN = 8
# A field that has more rows a value than this does not identify anything.
FEW_PER_ID = 10
GEOMETRIES = {"Point": "point", "LineString": "line", "LinearRing": "line", "Polygon": "polygon"}
FIRST_OWN_CODE = 12
SYMBOLS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"


@dataclass(frozen=True, slots=True)
class _Draft:
    """What is known and guessed of one layer."""

    file: Path
    sample: Sample
    columns: tuple[Column, ...]
    geometry: str | None
    guess: ClassGuess
    class_by: tuple[str, dict[str, str]] | None
    position: tuple[str, ...]


def suggest_catalog(path: str | Path) -> str:
    r"""Draft a catalogue for a file from its names, its fields and its values.

    Parameters
    ----------
    path : str or Path
        A vector file, an archive with such files, or a table of a portal (JSON, CSV, Parquet).

    Returns
    -------
    str
        TOML text. What only a person can know is marked ``EDIT`` in a comment; where not even
        the class could be guessed, ``EDIT`` stands for it, which `load_catalog` refuses. Filters,
        classes by the value of a field and the like are offered in comments.

    Raises
    ------
    SourceError
        If the file is missing, damaged, of another kind, or holds no positions.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "town_benches.csv")
    ...     _ = path.write_text("id;lon;lat;wood\n7;3.88;43.61;yes\n8;3.89;43.61;no\n")
    ...     draft = suggest_catalog(path)
    >>> print(draft[draft.index("[[layers]]"):], end="")
    [[layers]]
    name = "town_benches"
    class = "bench"  # from the name: "benches"
    files = ["town_benches.csv"]
    id_field = "id"  # a value of its own in every row
    geometry = "point"
    x_field = "lon"
    y_field = "lat"
    crs = "EPSG:4326"  # EDIT: the file does not say; its coordinates could be degrees
    rows = [1, 4]  # now 2; a load tells when they are fewer or more
    # Fields: id, lon, lat, wood
    """
    path = Path(path)
    found = samples(path, limit=SAMPLE_ROWS)
    layers = [item for item in found if item.info.geometry != NO_GEOMETRY]
    if not layers:
        msg = f"{path} holds no layer with positions; give a file that does."
        raise SourceError(msg)
    drafts = [_draft(path, item) for item in layers]
    lines = [
        f"# Draft of a catalogue for {_text(path.name)}, from its names, fields and values.",
        f"# Check every line; what only a person can know is marked {EDIT}.",
        "",
        f"name = {_text(_snake(path.stem))}",
        f"title = {_text(path.stem)}",
        f'license = "unknown"  # {EDIT}: what the publisher allows',
        f'attribution = ""  # {EDIT}: the line that the publisher asks for',
        *_metric_crs(layers),
    ]
    if layers[0].reader != VECTOR:
        lines.append(f"reader = {_text(layers[0].reader)}")
    lines += _classes(drafts)
    for name, draft in zip(_unique(_snake(item.info.name) for item in layers), drafts, strict=True):
        lines += ["", *_stanza(name, draft, several=len(layers) > 1)]
    if len(layers) < len(found):
        tables = ", ".join(_text(item.info.name) for item in found if item not in layers)
        lines += ["", f"# Left out, because they have no geometry: {tables}"]
    return "\n".join(lines) + "\n"


def _draft(path: Path, sample: Sample) -> _Draft:
    columns = columns_of(sample)
    geometry = GEOMETRIES.get(sample.info.geometry.removeprefix("3D ").removeprefix("Multi"))
    position = sample.coordinates if sample.placed else guess_position(sample, columns)
    if not sample.placed and not position:
        fields = ", ".join(column.name for column in columns)
        msg = (
            f"{path} has no field that looks like a position, only {fields}; "
            "give a file with coordinates."
        )
        raise SourceError(msg)
    names = f"{path.stem} / {sample.info.name}"
    guess = guess_class(names, columns, geometry=geometry, rows=len(sample.rows))
    kinds = [column for column in columns if column.meant_for("filter") or not guess.sure]
    class_by = None if guess.is_role else guess_class_by(kinds, guess.name)
    return _Draft(path, sample, columns, geometry, guess, class_by, position)


# --- The top of the catalogue -----------------------------------------------------------------


def _metric_crs(layers: Sequence[Sample]) -> list[str]:
    """Take the CRS of the layers, where it is one in which distances can be taken."""
    systems = {item.info.crs for item in layers}
    for crs in systems if len(systems) == 1 else ():
        try:
            require_metric_crs(crs)
        except CrsError:
            break
        return [f"metric_crs = {_text(str(crs))}"]
    return ["# Without metric_crs, distances are taken in the UTM zone of the data."]


def _classes(drafts: Sequence[_Draft]) -> Iterator[str]:
    """Yield stanzas for classes that the paper does not have."""
    taxonomies = [load_catalog(name).taxonomy for name in catalog_names()]
    shipped = {item.name: item for taxonomy in taxonomies for item in taxonomy.classes}
    taken = list(shipped.values())
    paper = {item.name for item in paper_taxonomy().classes}
    sure = [draft.guess.name for draft in drafts if draft.guess.name and not draft.guess.is_role]
    maybe = [name for draft in drafts if draft.class_by for name in draft.class_by[1].values()]
    for name in dict.fromkeys([*sure, *maybe]):
        if name in paper:
            continue
        item = shipped.get(name) or _new_class(name, taken)
        taken.append(item)
        comment = "" if name in sure else "# "
        yield ""
        if comment:
            yield "# For class_by below:"
        yield f"{comment}[[classes]]"
        yield f"{comment}code = {item.code}"
        yield f"{comment}symbol = {_text(item.symbol)}"
        yield f"{comment}name = {_text(item.name)}"
        yield f"{comment}title = {_text(item.title)}"


def _new_class(name: str, taken: Sequence[ObjectClass]) -> ObjectClass:
    """Return a class with a code and a symbol that no shipped class has."""
    codes = {item.code for item in taken}
    symbols = {item.symbol for item in taken}
    code = next(code for code in range(FIRST_OWN_CODE, MAX_CODE) if code not in codes)
    wanted = name.upper() + name + SYMBOLS
    symbol = next(letter for letter in wanted if letter in SYMBOLS and letter not in symbols)
    return ObjectClass(code, symbol, name, name.replace("_", " ").capitalize())


# --- A layer ----------------------------------------------------------------------------------


def _stanza(name: str, draft: _Draft, *, several: bool) -> Iterator[str]:
    info = draft.sample.info
    yield "[[layers]]"
    yield f"name = {_text(name)}"
    yield from _class(draft.guess)
    yield f"files = [{_text(glob.escape(draft.file.name))}]"
    if several:
        yield f"layer = {_text(info.name)}"
    yield from _identifier(draft)
    if draft.geometry:
        yield f"geometry = {_text(draft.geometry)}"
    else:
        yield f"# geometry is of several kinds ({info.geometry}); centroids are taken."
    yield from _place(draft)
    least, most = (info.rows + 1) // 2, info.rows * 2
    yield f"rows = [{least}, {most}]  # now {info.rows:,}; a load tells when they are fewer or more"
    yield from _filters(draft)
    yield f"# Fields: {', '.join(_plain(field) for field, _ in info.fields) or 'none'}"


def _class(guess: ClassGuess) -> Iterator[str]:
    key = "role" if guess.is_role else "class"
    if not guess.name:
        yield (
            f'class = "{EDIT}"  # {EDIT}: nothing tells what this is; write a class (or role = '
            '"buildings" or "streets" instead), or remove the layer'
        )
    elif guess.sure:
        yield f"{key} = {_text(guess.name)}  # {_plain(guess.reason)}"
    else:
        others = f"; or is it {' or '.join(guess.others)}?" if guess.others else "; is it so?"
        yield f"{key} = {_text(guess.name)}  # {EDIT}: {_plain(guess.reason)}{others}"


def _identifier(draft: _Draft) -> Iterator[str]:
    """Yield the field that tells rows apart, or those that may."""
    rows = len(draft.sample.rows)
    some = "every row" if rows == draft.sample.info.rows else f"each of the first {rows:,} rows"
    named = [column for column in draft.columns if column.meant_for("identifier")]
    numbers = [column for column in draft.columns if column.meant_for("row_number")]
    for column in [*named, *numbers]:
        if column.unique:
            warning = "" if column in named else "; a program gave them, and may give others anew"
            yield f"id_field = {_text(column.name)}  # a value of its own in {some}{warning}"
            return
    yield (
        f"# No field that is named like an identifier has a value of its own in {some}; rows are "
        "told by their number."
    )
    best = max(named, key=lambda column: len(column.counts), default=None)
    if best is not None and best.counts and len(best.counts) * FEW_PER_ID >= rows:
        yield f"# id_field = {_text(best.name)}  # {len(best.counts):,} values in {rows:,} rows"
        yield "# unique_id = true  # if rows of the same id are the same object"
        return
    others = (column for column in draft.columns if column.unique and not _measured(column))
    other = next((column for column in others if column.name not in draft.position), None)
    if other is not None:
        yield f"# id_field = {_text(other.name)}  # has one, if it is meant to identify a row"


def _measured(column: Column) -> bool:
    """Tell whether the values are numbers with decimals, which are different by chance."""
    return any(str(value).count(".") == 1 for value in column.counts)


def _place(draft: _Draft) -> Iterator[str]:
    """Yield where positions are found, and in which CRS."""
    info, sample = draft.sample.info, draft.sample
    if len(draft.position) == 1:
        (field,) = draft.position
        yield f"aliases = {{ geo_point_2d = [{_text(field)}] }}  # latitude, longitude"
    degrees = True
    if len(draft.position) == 2:  # noqa: PLR2004 - x and y
        x, y = draft.position
        yield f"x_field = {_text(x)}"
        yield f"y_field = {_text(y)}"
        limits = {x: 180.0, y: 90.0}
        degrees = all(
            column.within(limits[column.name]) for column in draft.columns if column.name in limits
        )
    if info.crs is not None and sample.reader == VECTOR:
        yield from _known_crs(info.crs)
    elif draft.position and degrees and sample.reader == VECTOR:
        yield (
            f'crs = "EPSG:4326"  # {EDIT}: the file does not say; its coordinates could be degrees'
        )
    elif not degrees or sample.reader == VECTOR:
        yield (
            f"# {EDIT}: the file does not say its coordinate system; write its code, such as "
            'crs = "EPSG:2154"'
        )


def _known_crs(crs: str) -> Iterator[str]:
    try:
        CRS.from_user_input(crs)
    except CRSError:
        yield f"# The file states its own coordinate system, {_text(crs)}, which has no code."
    else:
        yield f"crs = {_text(crs)}"


def _filters(draft: _Draft) -> Iterator[str]:
    """Yield, in comments, the fields of few values, and the classes that one of them tells."""
    if draft.class_by is not None:
        field, classes = draft.class_by
        values = ", ".join(f"{_key(value)} = {_text(name)}" for value, name in classes.items())
        yield f"# If {_plain(field)} tells the class of a row:"
        yield f"# class_by = {{ field = {_text(field)}, values = {{ {values} }} }}"
    few = [column for column in draft.columns if column.few and not _pattern(column)]
    few.sort(key=lambda column: not column.meant_for("filter"))  # the others keep their order
    if few:
        rows = len(draft.sample.rows)
        seen = "" if rows == draft.sample.info.rows else f" (seen in the first {rows:,} rows)"
        yield f"# To keep some rows only, take one of these without the values not wanted{seen}:"
    for column in few[:FILTERS_SHOWN]:
        values = ", ".join(_value(value) for value, _ in column.counts.most_common())
        numbers = ", ".join(f"{number:,}" for _, number in column.counts.most_common())
        missing = f"; without: {column.missing:,}" if column.missing else ""
        yield f"# where = {{ {_key(column.name)} = [{values}] }}  # rows: {numbers}{missing}"
    if len(few) > FILTERS_SHOWN:
        names = ", ".join(_plain(column.name) for column in few[FILTERS_SHOWN:])
        yield f"# More fields of few values: {names}"


def _pattern(column: Column) -> bool:
    """Tell whether a catalogue would take a value for a pattern."""
    return any(str(value).startswith("/") for value in column.counts)


# --- TOML -------------------------------------------------------------------------------------


def _text(text: str) -> str:
    """Return a TOML string: JSON's, but for the one control character that JSON lets pass."""
    clean = text.encode("utf-8", "replace").decode("utf-8")  # a file name may be anything
    return json.dumps(clean, ensure_ascii=False).replace("\x7f", "\\u007f")


def _plain(text: str) -> str:
    """Return text that fits into a comment."""
    return _text(text)[1:-1].replace('\\"', '"')


def _value(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else _text(str(value))


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def _snake(text: str) -> str:
    return "_".join(words_of(text)) or "layer"


def _unique(names: Iterable[str]) -> Iterator[str]:
    """Yield the names, with a number where one comes again."""
    seen: set[str] = set()
    for name in names:
        free = (f"{name}_{number}" if number > 1 else name for number in itertools.count(1))
        chosen = next(candidate for candidate in free if candidate not in seen)
        seen.add(chosen)
        yield chosen
