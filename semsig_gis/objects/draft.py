"""Draft a catalogue for a file from its names, fields and values."""

from __future__ import annotations

import contextlib
import glob
import itertools
import json
import re
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import (
    MAX_CODE,
    OWN_CODES,
    CatalogError,
    CrsError,
    EmptyResultError,
    SemsigError,
    SourceError,
    crs_text,
    nearest_town,
    require_metric_crs,
    temporary_folder,
    town_of,
)
from semsig_gis.objects.draft_folder import command, known_sources, need_of, sort_files
from semsig_gis.objects.draft_layers import (
    LayerDraft,
    own_classes,
    shared_layers,
    snake,
    without_code,
)
from semsig_gis.objects.guesses import (
    VECTOR,
    ClassGuess,
    columns_of,
    guess_class,
    guess_class_by,
    sample_layers,
)
from semsig_gis.objects.layers import assemble, read_files
from semsig_gis.sources import (
    ANY_VALUE,
    BETWEEN_SLASHES,
    LATITUDE_LIMIT,
    WGS84,
    Condition,
    LayerSpec,
    built_in_taxonomy,
    for_crs,
    is_folder,
    load_catalog,
    no_positions,
    off_the_globe,
    reader,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import AnyCrs
    from semsig_gis.objects.guesses import Column, LayerSample
    from semsig_gis.objects.layers import LayerReport
    from semsig_gis.sources import PositionFields, RawLayer


# Data of a city is not far from a town.
NEAR_KM, FAR_KM = 10.0, 50.0
# Any projected CRS, to read coordinates unchanged.
PLANE = "EPSG:3857"
# Mark of lines that a person must check.
EDIT = "EDIT"
FILTERS_SHOWN = 8
VALUES_SHOWN = 6
# Maximum number of rows per value of a field that may identify objects.
MAX_ROWS_PER_ID = 10
# Minimum share of rows with a class by a field, for it to decide; and the minimum share of other
# classes than that of the name of the layer.
MIN_NAMED, MIN_OTHERS = 0.5, 0.2
GEOMETRIES = {"Point": "point", "LineString": "line", "LinearRing": "line", "Polygon": "polygon"}


def draft_catalog(path: str | Path, *, crs: AnyCrs | None = None) -> str:
    r"""Draft a catalogue for a file from its names, its fields and its values.

    Parameters
    ----------
    path : str or Path
        A vector file, an archive with such files, or a table of a portal (JSON, CSV, Parquet).
    crs : int, str or pyproj.CRS, optional
        CRS of a file that does not state one.

    Returns
    -------
    str
        TOML text that can load the file. Values that only a person can know are marked ``EDIT`` in
        a comment. If nothing suggests a class, the layer gets a class of its own. Filters, classes
        by the value of a field and similar settings are offered in comments.

    Raises
    ------
    SourceError
        If the file is missing, damaged, of another kind, or contains no positions.
    CrsError
        If the CRS is not stated, and the coordinates cannot be degrees.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "town_benches.csv")
    ...     _ = path.write_text("id;lon;lat;wood\n7;3.88;43.61;yes\n8;3.89;43.61;no\n")
    ...     draft = draft_catalog(path)
    >>> print(draft[draft.index("[[layers]]"):], end="")
    [[layers]]
    name = "town_benches"
    class = "bench"  # from the name: "benches"
    files = ["town_benches.csv"]
    id_field = "id"  # a different value in every row
    geometry = "point"
    x_field = "lon"
    y_field = "lat"
    crs = "EPSG:4326"  # EDIT: the file does not say; its coordinates could be degrees
    rows = [1, 4]  # now 2; loading reports when there are fewer or more
    # Fields: id, lon, lat, wood
    """
    path = Path(path)
    stated = None if crs is None else crs_text(crs)
    if is_folder(path):
        return _Folder(path, stated).draft()
    need = need_of(path) if path.exists() else ""
    drafts, remarks = _drafts(path, stated)
    if need.startswith("no catalogue"):
        remarks.insert(0, f"{path.name}: {need}")
    return _loading(path, drafts, remarks)


class _Folder:
    """The files of a folder: layers of those that are drafted, and lines on the others."""

    def __init__(self, folder: Path, crs: str | None) -> None:
        """Read the files that need a catalogue."""
        self.folder = folder
        files, self.lines = sort_files(folder)
        self.remarks: list[str] = []
        self.layers_of: dict[Path, list[LayerDraft]] = {}
        for file in files:
            try:
                self.layers_of[file], remarks = _drafts(file, crs)
            except SemsigError as error:
                self.leave_out(file, error)
            else:
                self.remarks += remarks
        for file in without_code(self.layers_of):
            self.leave_out(
                file,
                f"no code for another class is free; draft it by itself: {command('draft', file)}",
            )

    def leave_out(self, file: Path, reason: object) -> None:
        """Leave a file out of the draft, with a line on the reason."""
        self.layers_of.pop(file, None)
        self.lines.append(f"{file.name}: left out: {str(reason).rstrip('.')}")

    def draft(self) -> str:
        """Draft a catalogue for all files, without those that do not load with it."""
        while True:
            try:
                return self._together()
            except SourceError as error:
                if not self.layers_of or not (self._unusable() or self._misplaced(error)):
                    raise

    def _together(self) -> str:
        if not self.layers_of:
            why = "; ".join(self.lines) or "it is empty"
            raise SourceError(
                f"{self.folder} has no file that a catalogue can be drafted for; {why}."
            )
        drafts = [layer for layers in self.layers_of.values() for layer in layers]
        shared = shared_layers(drafts, self.folder)
        return _loading(self.folder, shared, [*self.remarks, *self.lines])

    def _unusable(self) -> bool:
        """Leave out the files that do not load by themselves; return whether there are some."""
        size = len(self.layers_of)
        for file, layers in list(self.layers_of.items()):
            try:
                _loading(file, layers, [])
            except SourceError as error:
                self.leave_out(file, error)
        return len(self.layers_of) < size

    def _misplaced(self, error: SourceError) -> bool:
        """Leave out the file that an error says is far from the others, if it does."""
        for file, layers in list(self.layers_of.items()):
            if any(f"layer {snake(layer.name)!r} lies" in str(error) for layer in layers):
                self.leave_out(file, error.__cause__ or error)
                return True
        return False


def _drafts(path: Path, crs: str | None) -> tuple[list[LayerDraft], list[str]]:
    """Return the layers of a file, and comments on it."""
    items = sample_layers(path)
    layers = [item for item in items if item.placed or item.positions]
    if not layers:
        fields = items[0].info.fields
        raise SourceError(f"{path} has no layer with positions and {no_positions(fields)}.")
    drafts = [_draft(path, item, crs, several=len(layers) > 1) for item in layers]
    remarks = []
    if len(layers) < len(items):
        tables = ", ".join(_text(item.info.name) for item in items if item not in layers)
        remarks.append(f"Layers of {path.name} without geometry are left out: {tables}")
    return drafts, remarks


def _loading(path: Path, drafts: Sequence[LayerDraft], remarks: Sequence[str]) -> str:
    """Return the catalogue of a file or folder; SourceError if it cannot load that."""
    drafts = own_classes(drafts)
    readers = Counter(draft.sample.reader for draft in drafts)
    ((usual, _),) = readers.most_common(1)
    title = path.name if is_folder(path) else path.stem
    title = title or path.resolve().name  # of the working folder
    name = path.name or title
    lines = [
        f"# Draft of a catalogue for {_text(name)}, from its names, fields and values.",
        f"# Check every line; what only a person can know is marked {EDIT}.",
        *(f"# {_plain(remark)}" for remark in (*known_sources(path, drafts), *remarks)),
        "",
        f"name = {_text(snake(title))}",
        f"title = {_text(title)}",
        f'license = "unknown"  # {EDIT}: what the publisher allows',
        f'attribution = ""  # {EDIT}: the line that the publisher asks for',
        _metric_crs([draft.sample for draft in drafts]),
    ]
    if usual != VECTOR:
        lines.append(f"reader = {_text(usual)}")
    try:
        lines += _classes(drafts)
    except CatalogError as error:
        raise SourceError(
            f"{path} has more layers of unknown classes than there are codes for own classes, "
            f"{MAX_CODE - OWN_CODES + 1}; move some of its files to another folder."
        ) from error
    in_file = Counter(draft.file for draft in drafts)
    names = _unique(snake(draft.name) for draft in drafts)
    for name, draft in zip(names, drafts, strict=True):
        lines += ["", *_stanza(name, draft, several=in_file[draft.file] > 1, usual=usual)]
    lines[1:1] = _towns(_loaded(lines, path))
    return "\n".join(lines) + "\n"


def _towns(layers: Sequence[RawLayer]) -> Iterator[str]:
    """Yield a line on the town of the first layer that has positions."""
    for layer in layers:
        xy = shapely.get_coordinates(layer.geometry)
        xy = xy[np.isfinite(xy).all(axis=1)]
        if len(xy):
            yield f"# Its positions are {town_of(xy, layer.known_crs)}."
            x, y = np.median(xy, axis=0).tolist()
            degrees = layer.known_crs.is_geographic and max(abs(x), abs(y)) <= LATITUDE_LIMIT
            if degrees and nearest_town(x, y).distance_km > FAR_KM:
                exchanged = nearest_town(y, x)
                if exchanged.distance_km <= NEAR_KM:
                    yield (
                        f"# {EDIT}: with longitude and latitude exchanged they would be "
                        f"{exchanged}; if that is right, exchange them in the file."
                    )
            return


def _loaded(lines: Sequence[str], path: Path) -> tuple[RawLayer, ...]:
    """Return the layers that are read with a draft; SourceError if the file does not load."""
    layers: tuple[RawLayer, ...] = ()
    far: list[LayerReport] = []
    with temporary_folder(Path(tempfile.gettempdir())) as folder:
        file = folder / "draft.toml"
        file.write_text("\n".join(lines), encoding="utf-8")
        try:
            catalog = load_catalog(file)
            layers, _ = read_files(catalog.layers, [path])
            # A file may have layers without rows, but not only these.
            with_positions = {
                files: any(layer.table.geometry.notna().any() for layer in of_files)
                for files, of_files in itertools.groupby(layers, lambda layer: layer.spec.files)
            }
            empty = not all(with_positions.values())
            if not empty and any(layer.spec.role == "objects" for layer in layers):
                report = assemble(layers, catalog).report.layers
                far = [item for item in report if item.counts.misplaced and not item.counts.kept]
        except EmptyResultError:
            empty = True
        except SemsigError as error:
            raise SourceError(
                f"no catalogue can be drafted for {path}: {str(error).rstrip('.')}."
            ) from error
    if empty:
        bad = next((f" ({layer.errors[0]})" for layer in layers if layer.errors), "")
        raise SourceError(f"{path} has no layer with positions{bad}; give a file that has one.")
    if far and is_folder(path):
        raise SourceError(
            f"layer {far[0].name!r} lies far from all others; look at its coordinate system and "
            "at the order of its coordinates."
        )
    return layers


def _draft(path: Path, sample: LayerSample, crs: str | None, *, several: bool) -> LayerDraft:
    """Guess what a layer of a file holds, one of `several`."""
    columns = columns_of(sample)
    # As "3D Point" or "Point Z", with heights.
    kind = re.sub(r"^(3D )?(Multi)?| Z?M?$", "", sample.info.geometry)
    geometry = GEOMETRIES.get(kind)
    names = f"{path.stem} / {sample.info.name}"
    rows = len(sample.rows)
    guess = guess_class(sample.info.name, columns, geometry=geometry, rows=rows)
    if not several or guess.by_values or not guess.name:
        guess = guess_class(names, columns, geometry=geometry, rows=rows)
        # One of several layers of a file may be something else than the file says.
        guess = replace(guess, sure=guess.sure and not several)
    candidates = [column for column in columns if column.meant_for("filter") or not guess.sure]
    name = "" if guess.by_values else guess.name
    class_by = None if guess.is_role else guess_class_by(candidates, name, sure=guess.sure)
    mixed = class_by is not None and _is_mixed(class_by, columns, guess, rows)
    if mixed and not guess.sure:
        guess = ClassGuess()  # a class of its own for other values
    positions = sample.positions
    if crs is not None and positions is not None:
        positions = for_crs(positions, sample.rows, crs)
    crs, crs_reason = _crs(path, sample, positions, crs)
    return LayerDraft(
        path, sample, columns, geometry, guess, class_by, mixed, positions, crs, crs_reason
    )


def _is_mixed(
    class_by: tuple[str, dict[str, str]], columns: Sequence[Column], guess: ClassGuess, rows: int
) -> bool:
    """Whether a field gives the classes of most rows, and the name of the layer does not."""
    field, classes = class_by
    (counts,) = (column.counts for column in columns if column.name == field)
    rows_named = sum(counts[value] for value in classes)
    others = sum(counts[value] for value, name in classes.items() if name != guess.name)
    # Of a guess by values, rows with others are not of this class.
    several = len(set(classes.values())) > 1 or (guess.by_values and rows_named < rows)
    return several and rows_named >= MIN_NAMED * rows and others >= MIN_OTHERS * rows * guess.sure


def _crs(
    path: Path, sample: LayerSample, positions: PositionFields | None, crs: str | None
) -> tuple[str | None, str]:
    """Return the CRS for the catalogue, None if the file states it, and a comment on it.

    CrsError if it is unknown; `crs` is that of a file that does not state one.
    """
    stated = sample.info.crs
    if stated is not None:
        return (stated if sample.reader == VECTOR else None), ""
    if crs is not None:
        return crs, ""
    if sample.reader != VECTOR and positions is None:
        return None, ""  # degrees, by the rules of these formats
    if positions is not None and positions.crs is not None:
        return positions.crs, "the file does not say; its coordinates are in the range of this one"
    # Read the coordinates in any CRS, to see whether they can be degrees.
    layer = sample.info.name if sample.reader == VECTOR else None
    spec = LayerSpec(name="draft", class_name="", layer=layer, crs=PLANE)
    if positions is not None:
        x, y, whole, order = positions.x, positions.y, positions.field, positions.order
        spec = replace(spec, x_field=x, y_field=y, geometry_field=whole, axis_order=order)
    (raw,) = reader(sample.reader)(path, [spec])
    xy = shapely.get_coordinates(raw.table.geometry.dropna().array)
    if 2 * np.count_nonzero(off_the_globe(xy, WGS84)) <= len(xy):
        return "EPSG:4326", "the file does not say; its coordinates could be degrees"
    raise CrsError(
        f"{path} has coordinates such as ({xy[0][0]:.12g}, {xy[0][1]:.12g}) and does not say in "
        f"which CRS; state it with --crs, such as --crs EPSG:2154{_whole_degrees(xy)}."
    )


def _whole_degrees(xy: NDArray[np.float64]) -> str:
    """Return what to do if whole numbers may be degrees that were multiplied, or nothing."""
    if not (xy == np.round(xy)).all():
        return ""
    for factor in (10**5, 10**6, 10**7):
        degrees = xy / factor
        if off_the_globe(degrees, WGS84).any():
            continue
        town = nearest_town(*np.median(degrees, axis=0).tolist())
        if town.distance_km <= NEAR_KM:
            return f"; divided by {factor:,} they are degrees {town}: if so, divide them first"
    return ""


def _metric_crs(layers: Sequence[LayerSample]) -> str:
    """Return the line with the CRS of all layers if it is metric, or else a comment."""
    crs, *others = {item.info.crs for item in layers}
    if not others:
        with contextlib.suppress(CrsError):
            require_metric_crs(crs)
            return f"metric_crs = {_text(str(crs))}"
    return "# Without metric_crs, distances are computed in the UTM zone of the data."


def _classes(drafts: Sequence[LayerDraft]) -> Iterator[str]:
    """Yield stanzas for classes that are not built in."""
    taxonomy = built_in_taxonomy()
    built_in = {item.name for item in taxonomy.classes}
    used = [draft.guess.name for draft in drafts if draft.needs_class and not draft.guess.is_role]
    for name in dict.fromkeys(used):
        if name not in built_in:
            taxonomy = taxonomy.extended([name])
            item = taxonomy.by_name(name)
            yield from ("", "[[classes]]")
            for key in ("code", "symbol", "name", "title"):
                yield f"{key} = {json.dumps(getattr(item, key), ensure_ascii=False)}"


def _stanza(name: str, draft: LayerDraft, *, several: bool, usual: str) -> Iterator[str]:
    """Yield the lines of a layer, in a file with `several`; `usual` is the catalogue's reader."""
    info = draft.sample.info
    yield "[[layers]]"
    yield f"name = {_text(name)}"
    yield from _class(draft)
    yield f"files = [{_text(draft.pattern or glob.escape(draft.file.name))}]"
    if draft.remark:
        yield f"# {EDIT}: {_plain(draft.remark)}"
    if draft.sample.reader != usual:
        yield f"reader = {_text(draft.sample.reader)}"
    if several:
        yield f"layer = {_text(info.name)}"
    if info.encoding is not None:
        doubt = "" if info.encoding.sure else f"{EDIT}: "
        yield (
            f"encoding = {_text(info.encoding.encoding)}  # {doubt}the file does not say; look "
            "whether its texts are right"
        )
    yield from _identifier(draft)
    if draft.geometry:
        yield f"geometry = {_text(draft.geometry)}"
    else:
        yield f"# geometry is of several kinds ({info.geometry}); centroids are used."
    yield from _place(draft)
    sizes = [part.sample.info.rows for part in (draft, *draft.others)]
    yield (
        f"rows = [{(min(sizes) + 1) // 2}, {max(sizes) * 2}]  # now "
        f"{' and '.join(f'{size:,}' for size in sizes)}; loading reports when there are fewer or "
        "more"
    )
    yield from _filters(draft)
    yield f"# Fields: {', '.join(_plain(field) for field in info.fields) or 'none'}"


def _class(draft: LayerDraft) -> Iterator[str]:
    """Yield the lines with the class or the role, and with the field that decides the class."""
    guess = draft.guess
    line = f"{'role' if guess.is_role else 'class'} = {_text(guess.name)}  # "
    others = f"; or is it {' or '.join(guess.others)}?" if guess.others else "; is this right?"
    if draft.mixed and draft.class_by:
        field, classes = draft.class_by
        if draft.needs_class:
            unlisted = [f"{_text(value)} ({rows:,})" for value, rows in draft.unlisted.items()]
            more = f", and {len(unlisted) - VALUES_SHOWN} more" * (len(unlisted) > VALUES_SHOWN)
            such = f": {', '.join(unlisted[:VALUES_SHOWN])}{more}" if unlisted else ""
            yield f"{line}{EDIT}: of rows without a {_plain(field)} that class_by lists{such}"
        otherwise = ', otherwise = "class"' * draft.needs_class
        values = ", ".join(
            f"{_key(_exactly(value))} = {_text(name)}" for value, name in classes.items()
        )
        yield (
            f"class_by = {{ field = {_text(field)}, values = {{ {values} }}{otherwise} }}"
            f"  # {EDIT}: is the class of each value right?"
        )
    elif not guess.reason:
        yield (
            f"{line}{EDIT}: unknown; write a class (or "
            'role = "buildings" or "streets" instead), or remove the layer'
        )
    elif guess.sure:
        yield line + _plain(guess.reason)
    else:
        yield f"{line}{EDIT}: {_plain(guess.reason)}{others}"


def _identifier(draft: LayerDraft) -> Iterator[str]:
    """Yield the line with the identifier of rows, or comments on possible ones."""
    if draft.others:
        yield f"id_field = {_text(draft.id_field)}  # a different value in every row of the files"
        yield "unique_id = true"
        return
    rows = len(draft.sample.rows)
    where = "every row" if rows == draft.sample.info.rows else f"each of the first {rows:,} rows"
    identifiers = [column for column in draft.columns if column.meant_for("identifier")]
    numbers = [column for column in draft.columns if column.meant_for("row_number")]
    for column in [*identifiers, *numbers]:
        if column.unique:
            warning = (
                ""
                if column in identifiers
                else "; assigned by a program, which may assign others next time"
            )
            yield f"id_field = {_text(column.name)}  # a different value in {where}{warning}"
            return
    yield (
        f"# No field that is named like an identifier has a different value in {where}; rows "
        "are identified by their number."
    )
    best = max(identifiers, key=lambda column: len(column.counts), default=None)
    if best is not None and best.counts and len(best.counts) * MAX_ROWS_PER_ID >= rows:
        yield f"# id_field = {_text(best.name)}  # {len(best.counts):,} values in {rows:,} rows"
        yield "# unique_id = true  # if rows of the same id are the same object"
        return
    for column in draft.columns:
        # Numbers with decimals are measurements, which are unique by chance.
        measured = any(str(value).count(".") == 1 for value in column.counts)
        used = draft.positions.names if draft.positions else ()
        if column.unique and not measured and column.name not in used:
            name = _text(column.name)
            yield f"# id_field = {name}  # different in {where}; use it if it is an id"
            return


def _place(draft: LayerDraft) -> Iterator[str]:
    """Yield the lines with the fields of positions and the CRS."""
    fields = draft.positions
    if fields is not None:
        questions = fields.questions if fields.sure else ("by their values only", *fields.questions)
        comment = f"  # {EDIT}: {_plain('; '.join(questions))}" if questions else ""
        if fields.field is not None:
            yield f"geometry_field = {_text(fields.field)}{comment}"
            if fields.order is not None:
                yield f"axis_order = {_text(fields.order)}"
        else:
            yield f"x_field = {_text(str(fields.x))}{comment}"
            yield f"y_field = {_text(str(fields.y))}"
    if draft.crs is None:
        return
    try:
        CRS.from_user_input(draft.crs)
    except CRSError:
        yield f"# The file states its own coordinate system, {_text(draft.crs)}, which has no code."
    else:
        comment = f"  # {EDIT}: {draft.crs_reason}" if draft.crs_reason else ""
        yield f"crs = {_text(draft.crs)}{comment}"


def _filters(draft: LayerDraft) -> Iterator[str]:
    """Yield comments with fields of few values, and with a field that may contain the class."""
    rows = len(draft.sample.rows)
    sampled = "" if rows == draft.sample.info.rows else f" (seen in the first {rows:,} rows)"
    if draft.class_by is not None and not draft.mixed:
        field, classes = draft.class_by
        (counts,) = (column.counts for column in draft.columns if column.name == field)
        values = ", ".join(
            f"{_key(_exactly(str(value)))} = {_text(classes.get(value, draft.guess.name))}"
            for value, _ in counts.most_common()
        )
        yield f"# If {_plain(field)} gives the class of a row, with all of its values{sampled}:"
        yield f"# class_by = {{ field = {_text(field)}, values = {{ {values} }} }}"
    few = [column for column in draft.columns if column.few]
    few.sort(key=lambda column: not column.meant_for("filter"))  # stable: typical filters first
    if few:
        yield f"# To keep only some rows, use one of these without the unwanted values{sampled}:"
    for column in few[:FILTERS_SHOWN]:
        values = ", ".join(
            str(value).lower() if isinstance(value, bool) else _text(_exactly(str(value)))
            for value, _ in column.counts.most_common()
        )
        numbers = ", ".join(f"{number:,}" for _, number in column.counts.most_common())
        missing = f"; without: {column.missing:,}" if column.missing else ""
        yield f"# where = {{ {_key(column.name)} = [{values}] }}  # rows: {numbers}{missing}"
    if len(few) > FILTERS_SHOWN:
        names = ", ".join(_plain(column.name) for column in few[FILTERS_SHOWN:])
        yield f"# Other fields with few values: {names}"


def _text(text: str) -> str:
    """Return a TOML string: a JSON string with U+007F escaped as well."""
    clean = text.encode("utf-8", "replace").decode("utf-8")  # a file name may be anything
    return json.dumps(clean, ensure_ascii=False).replace("\x7f", "\\u007f")


def _plain(text: str) -> str:
    """Return text escaped for a comment."""
    return _text(text)[1:-1].replace('\\"', '"')


def _exactly(value: str) -> str:
    """Return a condition for exactly this value, which may itself look like a condition."""
    with contextlib.suppress(CatalogError):
        if Condition.parse([value]) == Condition((value,)) and value != ANY_VALUE:
            return value if not BETWEEN_SLASHES.fullmatch(value) else f"/{re.escape(value)}/"
    return f"/{re.escape(value)}/"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def _unique(names: Iterable[str]) -> Iterator[str]:
    """Yield the names, with a number appended to repeated ones."""
    used: set[str] = set()
    for name in names:
        candidates = (f"{name}_{number}" if number > 1 else name for number in itertools.count(1))
        used.add(unique := next(candidate for candidate in candidates if candidate not in used))
        yield unique
