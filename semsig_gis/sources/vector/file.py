"""Read vector files, each suffix with one driver of GDAL; count and report bad rows.

pyogrio reads a layer as a whole, in Arrow. If a row may be damaged, fiona reads the layer again row
by row and reports the error of each row; without fiona, pyogrio does it.
"""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from semsig_gis.core import SourceError, UnknownNameError, crs_label, nearest_name
from semsig_gis.sources.csv_layer import NO_GEOMETRY, csv_table, read_csv_layer
from semsig_gis.sources.encodings import Guess
from semsig_gis.sources.positions import (
    SAMPLE_ROWS,
    PlaceReader,
    find_positions,
    no_positions,
    stated_fields,
    uncertain_positions,
)
from semsig_gis.sources.rows import BadFeatureError, LayerBuilder, choose_crs, fits_the_globe
from semsig_gis.sources.vector import by_pyogrio
from semsig_gis.sources.vector.by_pyogrio import describe, first_rows_of, layer_names, read_whole
from semsig_gis.sources.vector.contents import members
from semsig_gis.sources.vector.formats import CSV, GEOJSON, KML, SINGLE, WITH_FIONA
from semsig_gis.sources.vector.member import unreadable

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from pyproj import CRS

    from semsig_gis.sources.csv_layer import CsvTable
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.positions import PositionFields
    from semsig_gis.sources.rows import Position, Rows
    from semsig_gis.sources.vector.member import LayerDescription, Member


UTF8 = "utf-8"
# Guesses that need no note: most programs read these encodings if none is stated.
EXPECTED = (Guess(UTF8, sure=True), Guess("cp1252", sure=True))


@dataclass(frozen=True, slots=True)
class LayerInfo:
    """Name, geometry type, CRS, number of rows and fields of a layer of a file.

    `geometry` is a term of GDAL, ``"Point"`` for a CSV file with coordinates; `crs` is a code or
    name. `encoding` is a guess for a file that does not state its encoding, and is not ASCII or
    UTF-8.
    """

    name: str
    geometry: str
    crs: str | None
    rows: int
    fields: tuple[str, ...]
    encoding: Guess | None = None


def list_layers(path: str | Path) -> tuple[LayerInfo, ...]:
    """List the layers of a vector file or archive; SourceError for another file."""
    return tuple(_describe(member) for member in _layers(Path(path)))


def read_layer(
    path: str | Path, spec: LayerSpec, *, filters: bool = True, crs: str | None = None
) -> RawLayer:
    r"""Read one layer of a vector file.

    A row that cannot be read is counted and reported, and the other rows are read.
    The CRS of the file has priority; the CRS of `spec` and `crs` apply to a file without one.
    GeoJSON without a ``crs`` member is such a file: it is WGS 84 only if no CRS is given and the
    coordinates are in its range.

    Parameters
    ----------
    path : str or Path
        A vector file or table with a suffix of `DRIVERS`, or an archive of such.
    spec : LayerSpec
        Description of the layer, its rows and their class.
    filters : bool, default True
        Whether ``where`` of the specification applies.
    crs : str, optional
        CRS of a file that states none; it overrides the CRS of the specification.

    Returns
    -------
    RawLayer
        The features in the CRS of the file, and notes on differences from the expectation.

    Raises
    ------
    SourceError
        If the file is missing, damaged or of another kind, or has several layers and `spec` names
        none.
    UnknownNameError, CatalogError
        If the file does not have the layer, or a field, that `spec` names.
    CrsError
        If there is no CRS, or it is in degrees and most coordinates are out of range.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.sources import LayerSpec, read_layer
    >>> spec = LayerSpec(name="benches", class_name="bench", crs="EPSG:4326")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "benches.csv")
    ...     _ = path.write_text("id;lon;lat\n7;3.88;43.61\n8;here;43.61\n")
    ...     layer = read_layer(path, spec)
    >>> len(layer.table), layer.counts.read, layer.errors
    (1, 2, ("row 2: lon 'here' is not a number",))
    """
    where = f"layer {spec.name!r} ({path})"
    member = replace(_pick(Path(path), spec.layer), encoding=spec.encoding)
    if (csv := _csv(member, spec, where=where)) is not None:
        return read_csv_layer(csv, spec, filters=filters, crs=crs, where=where)
    layer = describe(member)
    builder = LayerBuilder(spec, layer.fields, filters=filters, where=where)
    table = layer.geometry == NO_GEOMETRY or len(layer.empty) == layer.rows > 0
    if table and (places := _places(member, layer, spec, where=where)) is not None:
        return _read_table(member, layer, builder, places, crs=crs)
    builder.rows, notes = _read_rows(member, layer, builder.rules.fields)
    return builder.layer(layer.crs, implicit=layer.implicit, requested=crs, notes=notes)


def _places(
    member: Member, layer: LayerDescription, spec: LayerSpec, *, where: str
) -> PlaceReader | None:
    """Return the reader of positions in the fields of a layer without geometry.

    SourceError if there are none, or None if its geometries are only missing.
    """
    place_fields = stated_fields(spec, layer.fields, where=where)
    if place_fields is None:
        rows = [*first_rows_of(member, layer.fields, min(layer.rows, SAMPLE_ROWS))]
        place_fields = find_positions(layer.fields, rows, subject=str(member.layer))
    if place_fields is None and layer.geometry == NO_GEOMETRY:
        raise SourceError(
            f"{where} has no geometry, and {no_positions(layer.fields)}; or give the layer that "
            "contains the positions."
        )
    if place_fields is not None and not place_fields.sure:
        raise SourceError(f"{where} {uncertain_positions(place_fields)}.")
    return None if place_fields is None else PlaceReader(place_fields, where)


def _read_table(
    member: Member,
    layer: LayerDescription,
    builder: LayerBuilder,
    places: PlaceReader,
    *,
    crs: str | None,
) -> RawLayer:
    """Read a layer without geometry, with positions in its fields."""
    fields = tuple(dict.fromkeys((*builder.rules.fields, *places.fields.names)))
    for number, row in enumerate(first_rows_of(member, fields, layer.rows), start=1):
        try:
            place: Position | str = places.read(row)
        except BadFeatureError as error:
            place = str(error)
        builder.rows.add(row, str(number), place)
    return builder.layer(
        places.crs or layer.crs,
        implicit=layer.implicit and places.crs is None,
        requested=crs,
        notes=places.fields.questions,
    )


def read_tables(
    layers: Iterable[tuple[Member, LayerDescription]],
    choose: Callable[[Sequence[str]], Collection[str]],
    *,
    crs: str | None = None,
) -> Iterator[tuple[Rows, CRS, tuple[str, ...]]]:
    """Yield rows with the fields that `choose` selects, CRS and notes of each layer.

    Layers without such a field are skipped.
    """
    for member, layer in layers:
        if names := choose(layer.fields):
            fields = tuple(field for field in layer.fields if field in names)
            system, notes = choose_crs(
                layer.crs,
                implicit=layer.implicit,
                expected=None,
                requested=crs,
                where=str(member),
            )
            rows, more = _read_rows(member, layer, fields)
            yield rows, system, (*notes, *more)


def spatial_layers(path: Path) -> tuple[tuple[Member, LayerDescription], ...]:
    """Return the layers of a vector file that have a geometry, without those in CSV files."""
    layers = (
        layer
        for member in members(path)
        if member.driver != CSV
        for layer in (_layers_of(member) if member.driver not in SINGLE else [member])
    )
    described = ((layer, describe(layer)) for layer in layers)
    return tuple(item for item in described if item[1].geometry != NO_GEOMETRY)


def _read_rows(
    member: Member, layer: LayerDescription, fields: tuple[str, ...]
) -> tuple[Rows, tuple[str, ...]]:
    """Read the rows of a layer, and notes on them."""
    rows = read_whole(member, fields, layer.rows)
    notes: tuple[str, ...] = ()
    if rows is None and member.driver not in WITH_FIONA:
        rows, notes = by_pyogrio.read_each(member, fields, layer.rows)
    elif rows is None:
        try:
            # fiona takes 190 ms to import, and is needed only for damaged files.
            from semsig_gis.sources.vector.by_fiona import read_each  # noqa: PLC0415
        except ModuleNotFoundError as error:
            if error.name != "fiona":
                raise
            read_each = by_pyogrio.read_each
        rows, notes = read_each(member, fields, layer.rows)
    if member.driver == GEOJSON and rows.read < layer.rows:
        rows.mark_unreadable(layer.rows, "has the identifier of another row")
    # A geometry of GeoJSON that is not null but cannot be read; GDAL may count differently, so that
    # rows cannot be assigned.
    if member.driver == GEOJSON and rows.read == layer.rows:
        for row, position in enumerate(rows.positions):
            if position is None and rows.numbers[row] not in layer.empty:
                rows.positions[row] = "its geometry is not valid GeoJSON"
    guess = member.guess if member.encoding is None else None
    texts = itertools.chain.from_iterable(map(_texts, rows.columns.values()))
    if guess is not None and guess not in EXPECTED and not all(map(str.isascii, texts)):
        notes = (
            f"the encoding is not stated; read as {guess.encoding}"
            + ("" if guess.sure else ", which is not sure: state the right one as encoding"),
            *notes,
        )
    return rows, (*member.notes, *notes)


def _texts(column: pa.Array | list[Any]) -> Iterator[str]:
    """Yield the distinct texts of a column."""
    if isinstance(column, pa.Array):
        column = pc.unique(column).to_pylist()
    yield from (value for value in column if isinstance(value, str))


def read_layers(
    path: str | Path, specs: Iterable[LayerSpec], *, filters: bool = True, crs: str | None = None
) -> tuple[RawLayer, ...]:
    """Read several layers of one file, as `read_layer` reads one."""
    return tuple(read_layer(path, spec, filters=filters, crs=crs) for spec in specs)


def first_rows(
    path: Path, *, limit: int
) -> Iterator[tuple[LayerInfo, tuple[Mapping[str, Any], ...], PositionFields | None]]:
    """Yield each layer of a file, its first readable rows, and the fields of its positions."""
    for member in _layers(path):
        table = _csv(member, None, where=str(member))
        info = _describe(member)
        if table is None:
            rows = tuple(first_rows_of(member, info.fields, min(limit, info.rows)))
            plain_table = info.geometry == NO_GEOMETRY
            subject = f"{path.stem} {info.name}"
            place_fields = (
                find_positions(info.fields, rows, subject=subject) if plain_table else None
            )
            yield info, rows, place_fields
            continue
        readable = (row for row in table.rows() if not isinstance(row, str))
        place_fields = table.places.fields if table.places else None
        yield info, tuple(itertools.islice(readable, limit)), place_fields


def _layers(path: Path) -> tuple[Member, ...]:
    """Return the layers of a file, or of all the files in an archive."""
    layers = [layer for member in members(path) for layer in _layers_of(member)]
    # Folders of KML may contain only other folders or links.
    filled = [layer for layer in layers if layer.driver != KML or describe(layer).rows]
    layers = filled or layers
    names = Counter(layer.name for layer in layers)
    # Layers of the same name in several files are distinguished by the paths of these.
    return tuple(
        replace(layer, label=f"{layer.inner}/{layer.name}")
        if names[layer.name] > 1 and layer.inner
        else layer
        for layer in layers
    )


def _layers_of(member: Member) -> list[Member]:
    if member.driver == CSV or member.layer is not None:
        return [member]
    return [replace(member, layer=name) for name in layer_names(member)]


def _pick(path: Path, name: str | None) -> Member:
    """Return the layer of a name, or the only layer; SourceError if there are several."""
    files = members(path)
    if name is None and len(files) == 1 and files[0].driver in SINGLE:
        return files[0]
    layers = _layers(path)
    if name is None and len(layers) > 1:
        # Ignore tables without geometry, such as the styles in a GeoPackage.
        with_geometry = [item for item in layers if _describe(item).geometry != NO_GEOMETRY]
        layers = tuple(with_geometry) or layers
    names = [member.name for member in layers]
    matches = [item for item in layers if name is None or item.name == name]
    if len(matches) == 1:
        return matches[0]
    if name is not None and not matches:
        raise UnknownNameError(
            f"{path} has no layer {name!r}{nearest_name(name, names)}; "
            f"its layers are {', '.join(names)}."
        )
    raise SourceError(
        f"{path} contains {len(matches)} layers ({', '.join(names)}); give the name of one."
    )


def _csv(member: Member, spec: LayerSpec | None, *, where: str) -> CsvTable | None:
    """Return the table of a CSV file, which is read without GDAL; None for other formats."""
    if member.driver != CSV:
        return None
    try:
        return csv_table(member.open, spec, what=str(member), where=where)
    except OSError as error:
        raise unreadable(member, error) from error


def _describe(member: Member) -> LayerInfo:
    table = _csv(member, None, where=str(member))
    if table is not None:
        rows, geometry = table.survey()
        crs, fields = table.places.crs if table.places else None, table.names
        guess = table.file.guess
    else:
        layer = describe(member, bounds=True)
        rows, geometry, crs, fields = layer.rows, layer.geometry, layer.crs, layer.fields
        if member.driver == GEOJSON and rows and not layer.bounds:
            geometry, crs = NO_GEOMETRY, None if layer.implicit else crs  # all null or not valid
        if layer.implicit and layer.bounds and not fits_the_globe(np.reshape(layer.bounds, (2, 2))):
            crs = None
        guess = None if member.guess and member.guess.encoding == UTF8 else member.guess
    label = None if crs is None else crs_label(crs)
    return LayerInfo(member.name, geometry, label, rows, fields, guess)
