"""Vector files: one driver of GDAL a suffix, whole layers at once, bad rows counted.

pyogrio reads a layer whole. Where anything in it could be damaged, fiona reads it again row by row
and says what is wrong with which; where fiona is not installed, pyogrio does that, too.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.errors import SourceError, UnknownNameError, nearest_name
from semsig_gis.core.geometry import crs_label
from semsig_gis.sources.csv_layer import NO_GEOMETRY, csv_table, read_csv_layer
from semsig_gis.sources.rows import (
    WGS84,
    RowRules,
    fits_the_globe,
    raw_layer,
    settle_crs,
    usable_crs,
)
from semsig_gis.sources.vector.by_pyogrio import (
    describe,
    first_rows_of,
    layer_names,
    read_whole,
)
from semsig_gis.sources.vector.member import CONTAINER, CSV, GEOJSON, Member, members, unreadable
from semsig_gis.storage.text import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from pyproj import CRS

    from semsig_gis.sources.csv_layer import CsvTable
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Rows
    from semsig_gis.sources.vector.by_pyogrio import Layer

WGS84_NAMES = re.compile(r"4326|CRS84|WGS ?84", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class LayerInfo:
    """What one layer of a file is: its name, kind, CRS, number of rows, and fields.

    `geometry` is GDAL's word, ``"Point"`` for a CSV file with coordinates; `crs` is a code or name.
    """

    name: str
    geometry: str
    crs: str | None
    rows: int
    fields: tuple[str, ...]


def list_layers(path: str | Path) -> tuple[LayerInfo, ...]:
    """List the layers of a vector file or archive, in its order; SourceError if it is none."""
    return tuple(_describe(member) for member in _layers(Path(path)))


def read_layer(
    path: str | Path, spec: LayerSpec, *, filters: bool = True, crs: str | None = None
) -> RawLayer:
    r"""Read one layer of a vector file.

    A row that cannot be read is counted and reported, and the rest are read.
    The file's own CRS is used; those of `spec` and `crs` are for a file without one. GeoJSON
    without a ``crs`` member counts as such a file: it is WGS 84 only if no other is given and the
    coordinates fit.

    Parameters
    ----------
    path : str or Path
        A shapefile, GeoJSON, GeoPackage, FlatGeobuf or CSV file, or an archive of such.
    spec : LayerSpec
        Which layer and rows are wanted, and what they are.
    filters : bool, default True
        Whether the specification's ``where`` is applied.
    crs : str, optional
        CRS of a file that states none; it overrides the specification's.

    Returns
    -------
    RawLayer
        The features in the CRS of the file, and notes where the file is not as expected.

    Raises
    ------
    SourceError
        If the file is missing, damaged or of another kind, or has several layers and `spec` names
        none.
    UnknownNameError, CatalogError
        If the file does not have the layer, or a field, that `spec` names.
    CrsError
        If nobody states the CRS, or it is in degrees and most coordinates cannot be.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import LayerSpec, read_layer
    >>> spec = LayerSpec(name="benches", class_name="bench", crs="EPSG:4326")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "benches.csv")
    ...     _ = path.write_text("id;lon;lat\n7;3.88;43.61\n8;here;43.61\n")
    ...     layer = read_layer(path, spec)
    >>> len(layer.table), layer.counts.read, layer.errors
    (1, 2, ("row 2: lon 'here' is not a number",))
    """
    where = f"layer {spec.name!r} ({path})"
    member = _pick(Path(path), spec.layer)
    if (lines := _csv(member, spec, where=where)) is not None:
        return read_csv_layer(lines, spec, filters=filters, crs=crs, where=where)
    layer = describe(member)
    if layer.geometry == NO_GEOMETRY:
        raise SourceError(f"{where} has no geometry; give the layer that contains the positions.")
    rules = RowRules(spec, layer.fields, filters=filters, where=where)
    table = _read_member(member, layer, rules.fields, expected=spec.crs, given=crs, where=where)
    return raw_layer(table.rows, rules, table.crs, by_file=table.by_file, notes=table.notes)


@dataclass(frozen=True, slots=True)
class TableRows:
    """The rows of a layer of a file, with the values of some `fields`, in the CRS that holds."""

    fields: tuple[str, ...]
    rows: Rows
    crs: CRS
    by_file: bool
    notes: tuple[str, ...]


def layer_fields(path: Path) -> list[list[str]]:
    """Return the fields of every layer of a vector file that has a geometry and is no CSV file."""
    return [list(layer.fields) for _, layer in _with_geometry(path)]


def read_tables(
    path: Path, choose: Callable[[Sequence[str]], Collection[str]], *, crs: str | None = None
) -> Iterator[TableRows]:
    """Yield the rows of the layers of a vector file of which fields are chosen, and these."""
    for member, layer in list(_with_geometry(path)):
        chosen = choose(layer.fields)
        if chosen:
            fields = tuple(field for field in layer.fields if field in chosen)
            yield _read_member(member, layer, fields, expected=None, given=crs, where=str(member))


def _with_geometry(path: Path) -> Iterator[tuple[Member, Layer]]:
    for member in _layers(path):
        if member.driver != CSV:
            layer = describe(member)
            if layer.geometry != NO_GEOMETRY:
                yield member, layer


def _read_member(
    member: Member,
    layer: Layer,
    fields: tuple[str, ...],
    *,
    expected: str | None,
    given: str | None,
    where: str,
) -> TableRows:
    """Read a layer of a file whose CRS is its own, or `given` by the user, or `expected`."""
    own, implicit = _own_crs(member, layer)
    system, notes = settle_crs(own, implicit=implicit, expected=expected, given=given, where=where)
    rows = read_whole(member, fields, layer.rows)
    if rows is None:
        rows, more = _read_each(member, fields, layer.rows)
        notes += more
    if member.driver == GEOJSON:
        _refuse_broken(rows, member)
    return TableRows(fields, rows, system, own is not None and not implicit, notes)


def _read_each(member: Member, fields: Sequence[str], count: int) -> tuple[Rows, tuple[str, ...]]:
    """Read a layer row by row, with fiona where it is installed."""
    try:
        from semsig_gis.sources.vector.by_fiona import read_each  # noqa: PLC0415 - loads slowly
    except ModuleNotFoundError as error:
        if error.name != "fiona":
            raise
        from semsig_gis.sources.vector.by_pyogrio import read_each  # noqa: PLC0415
    return read_each(member, fields, count)


def read_layers(
    path: str | Path, specs: Iterable[LayerSpec], *, filters: bool = True, crs: str | None = None
) -> tuple[RawLayer, ...]:
    """Read several layers of one file, as `read_layer` reads one."""
    return tuple(read_layer(path, spec, filters=filters, crs=crs) for spec in specs)


def first_rows(
    path: Path, *, limit: int
) -> Iterator[tuple[LayerInfo, tuple[Mapping[str, Any], ...], tuple[str, ...]]]:
    """Yield every layer of a file, its first readable rows, and its coordinate columns if any."""
    for member in _layers(path):
        table = _csv(member, None, where=str(member))
        info = _describe(member)
        if table is None:
            count = min(limit, info.rows)
            yield info, tuple(first_rows_of(member, info.fields, count)), ()
            continue
        good = (row for row in table.rows() if not isinstance(row, str))
        coordinates = (table.x, table.y) if table.x and table.y else ()
        yield info, tuple(itertools.islice(good, limit)), coordinates


def _layers(path: Path) -> tuple[Member, ...]:
    """Return the layers of a file, or of all the files in an archive."""
    layers: list[Member] = []
    for member in members(path):
        if member.driver == CSV:
            layers.append(Member(member.file, member.inner, Path(member.inner or path).stem))
            continue
        layers += [Member(member.file, member.inner, name) for name in layer_names(member)]
    return tuple(layers)


def _pick(path: Path, wanted: str | None) -> Member:
    """Return the layer that a specification means."""
    files = members(path)
    if wanted is None and len(files) == 1 and files[0].driver != CONTAINER:
        return files[0]
    layers = _layers(path)
    if wanted is None and len(layers) > 1:
        # A GeoPackage keeps its styles in a table without geometry, which is never meant.
        with_geometry = [item for item in layers if _describe(item).geometry != NO_GEOMETRY]
        layers = tuple(with_geometry) or layers
    names = [str(member.layer) for member in layers]
    matches = [item for item in layers if wanted is None or item.layer == wanted]
    if len(matches) == 1:
        return matches[0]
    if wanted is not None and not matches:
        raise UnknownNameError(
            f"{path} has no layer {wanted!r}{nearest_name(wanted, names)}; "
            f"its layers are {', '.join(names)}."
        )
    raise SourceError(
        f"{path} contains {len(matches)} layers ({', '.join(names)}); give the name of one."
    )


def _csv(member: Member, spec: LayerSpec | None, *, where: str) -> CsvTable | None:
    """Look at a CSV file, which GDAL does not read here; None for a file of another kind."""
    if member.driver != CSV:
        return None
    try:
        return csv_table(member.open, spec, what=str(member), where=where)
    except OSError as error:
        raise unreadable(member, error) from error


def _describe(member: Member) -> LayerInfo:
    table = _csv(member, None, where=str(member))
    if table is not None:
        rows, kinds = table.survey()
        return LayerInfo(
            name=str(member.layer),
            geometry=kinds,
            crs=None if table.crs is None else crs_label(table.crs),
            rows=rows,
            fields=tuple(table.names),
        )
    layer = describe(member)
    crs, implicit = _own_crs(member, layer)
    if implicit and layer.bounds and not fits_the_globe(np.reshape(layer.bounds, (2, 2))):
        crs = None
    return LayerInfo(
        name=str(member.layer),
        geometry=layer.geometry,
        crs=None if crs is None else crs_label(crs),
        rows=layer.rows,
        fields=layer.fields,
    )


def _own_crs(member: Member, layer: Layer) -> tuple[CRS | None, bool]:
    """Return the CRS of a layer, and whether it is only what GeoJSON means by saying nothing."""
    own = usable_crs(layer.crs)
    if member.driver == GEOJSON:
        document = _geojson(member)
        if "crs" not in document:
            return WGS84, True
        if own == WGS84 and not WGS84_NAMES.search(str(document["crs"])):
            return None, False  # GDAL takes what it does not understand for WGS 84
    return own, False


def _geojson(member: Member) -> dict[str, Any]:
    """Return what a GeoJSON file holds; SourceError for what GDAL alone takes for JSON."""
    try:
        with member.open() as stream:
            document = parse_json(stream.read().decode("utf-8-sig", errors="replace"))
    except (OSError, ValueError) as error:
        raise unreadable(member, error) from error
    return document if isinstance(document, dict) else {}


def _refuse_broken(rows: Rows, member: Member) -> None:
    """Tell the null geometries of a GeoJSON file from those that GDAL could make nothing of."""
    null = [row for row, position in enumerate(rows.positions) if position is None]
    if not null:
        return
    document = _geojson(member)
    listed = document.get("features", [document])
    features = [item for item in listed if isinstance(item, dict) and item.get("type") == "Feature"]
    if len(features) != rows.read:
        return  # GDAL counts otherwise, so that rows cannot be told apart
    for row in null:
        if not _is_nothing(features[rows.numbers[row] - 1].get("geometry")):
            rows.positions[row] = "its geometry is not valid GeoJSON"


def _is_nothing(geometry: object) -> bool:
    """Tell whether a GeoJSON geometry is null or properly empty."""
    if not isinstance(geometry, dict):
        return geometry is None
    return _is_blank(geometry.get("coordinates", geometry.get("geometries")))


def _is_blank(parts: object) -> bool:
    return isinstance(parts, list) and all(_is_blank(part) for part in parts)
