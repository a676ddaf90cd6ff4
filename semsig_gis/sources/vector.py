"""Vector files through fiona: one driver a suffix, features streamed, bad ones counted."""

from __future__ import annotations

import contextlib
import contextvars
import itertools
import logging
import math
import re
import sqlite3
import struct
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import fiona
import numpy as np
import shapely
import shapely.geometry
from fiona.errors import DriverError

from semsig_gis.core.errors import SourceError, UnknownNameError, nearest_name
from semsig_gis.core.geometry import crs_label
from semsig_gis.sources import require_file
from semsig_gis.sources.csv_layer import NO_GEOMETRY, csv_table, read_csv_layer
from semsig_gis.sources.packed import bomb, swells
from semsig_gis.sources.raw_layer import (
    WGS84,
    BadFeatureError,
    RowRules,
    Rows,
    fits_the_globe,
    raw_layer,
    settle_crs,
    usable_crs,
)
from semsig_gis.storage.text import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from pyproj import CRS

    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.catalog import LayerSpec
    from semsig_gis.sources.csv_layer import CsvTable
    from semsig_gis.sources.raw_layer import Position

CSV = "CSV"
# The only drivers that may open a file: GDAL has some eighty, and a few of them follow links.
DRIVERS = {
    ".csv": CSV,
    ".fgb": "FlatGeobuf",
    ".geojson": "GeoJSON",
    ".gpkg": "GPKG",
    ".json": "GeoJSON",
    ".shp": "ESRI Shapefile",
}
# In an archive beside other data, these hold a legend or metadata.
SIDE_SUFFIXES = frozenset({".csv", ".json"})


@dataclass(frozen=True, slots=True)
class Member:
    """One layer of a file, or of the file `inner` of an archive; `layer` is None until known."""

    file: Path
    inner: str | None
    layer: str | None = None

    @property
    def driver(self) -> str:
        """GDAL's name of the one driver that may open it."""
        return DRIVERS[Path(self.inner or self.file).suffix.lower()]

    @property
    def address(self) -> str | Path:
        """What GDAL opens."""
        if self.inner is None:
            return self.file
        # GDAL's own form: fiona parses zip:// as a URL and loses what follows a '#' or a '?'.
        return f"/vsizip/{{{self.file.resolve().as_posix()}}}/{self.inner}"

    def __str__(self) -> str:
        """Return the name as messages say it."""
        return str(self.file) if self.inner is None else f"{self.inner} in {self.file}"

    def open(self) -> IO[bytes]:
        """Return a stream of the bytes of the file."""
        if self.inner is None:
            return self.file.open("rb")
        with zipfile.ZipFile(self.file) as archive:
            return archive.open(self.inner)


def unreadable(what: object, error: BaseException) -> SourceError:
    """Return the plain sentence for what a library raised on opening something."""
    if isinstance(error, UnicodeDecodeError):
        return SourceError(f"{what} is not UTF-8 text; save it as UTF-8.")
    cause = " ".join(str(error.__cause__ or error).split()).rpartition(" failed: ")[2].rstrip(".")
    if "not recognized" in cause:
        return SourceError(f"{what} is not the kind of file that its name says; get it again.")
    return SourceError(f"{what} cannot be read ({cause}); it may be damaged, get it again.")


def members(path: Path) -> tuple[Member, ...]:
    """Return the parts of a file that hold layers: itself, or the vector files in an archive."""
    suffix = path.suffix.lower()
    require_file(path, "a vector file")
    suffixes = {*DRIVERS, ".zip"}
    if suffix not in suffixes:
        msg = f"{path} is not a vector file; give one of {', '.join(sorted(suffixes))}."
        raise SourceError(msg)
    inner = _archived(path) if suffix == ".zip" else (None,)
    return tuple(Member(path, name) for name in inner)


# What zipfile raises at damaged archives.
_ZIP_FAULTS = (
    *(EOFError, IndexError, NotImplementedError, OSError, RuntimeError, ValueError),
    *(struct.error, zipfile.BadZipFile, zlib.error),
)


def _archived(path: Path) -> tuple[str, ...]:
    """Return the names of the vector files in an archive whose checksums hold."""
    try:
        with zipfile.ZipFile(path) as archive:
            items = [item for item in archive.infolist() if not item.is_dir()]
            for item in items:
                if swells(item.compress_size, item.file_size):
                    what = f"{item.filename} in {path}"
                    raise bomb(what)
            names = [item.filename for item in items]
            broken = archive.testzip()
    except SourceError:
        raise
    except _ZIP_FAULTS as error:
        raise unreadable(path, error) from error
    if broken is not None:
        msg = f"archive {path} is damaged at {broken}; get it again."
        raise SourceError(msg)
    usable = [
        name
        for name in names
        if Path(name).suffix.lower() in DRIVERS and not name.startswith("__MACOSX/")
    ]
    if not usable:
        msg = (
            f"archive {path} holds no vector file, only {', '.join(names) or 'nothing'}; "
            f"one of {', '.join(sorted(DRIVERS))} is needed."
        )
        raise SourceError(msg)
    data = [name for name in usable if Path(name).suffix.lower() not in SIDE_SUFFIXES]
    return tuple(data or usable)


# fiona's loggers; a filter acts on the very logger that emits, not on those below it.
LOGGERS = ("fiona._env", "fiona._err", "fiona.collection", "fiona.ogrext")
_heard: contextvars.ContextVar[list[logging.LogRecord] | None] = contextvars.ContextVar(
    "_heard", default=None
)


def _hear(record: logging.LogRecord) -> bool:
    heard = _heard.get()
    if heard is None:
        return True
    heard.append(record)
    return False


# A filter and not a handler: another user of fiona in the process keeps its messages, and two
# threads that read at once do not hear each other.
for _name in LOGGERS:
    logging.getLogger(_name).addFilter(_hear)


@contextlib.contextmanager
def listening() -> Iterator[list[logging.LogRecord]]:
    """Collect the messages of the block in the list that is given."""
    heard: list[logging.LogRecord] = []
    token = _heard.set(heard)
    try:
        yield heard
    finally:
        _heard.reset(token)


CONTAINER = "GPKG"  # the one driver whose files hold several layers
# A reader that fails so often without a good feature between does not move on.
FAILURES_IN_A_ROW = 1_000
WGS84_NAMES = re.compile(r"4326|CRS84|WGS ?84", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class LayerInfo:
    """What one layer of a file is: its name, kind, CRS, number of features and fields with types.

    `geometry` is GDAL's word, ``"Point"`` for a CSV file with coordinates; `crs` is a code or name.
    """

    name: str
    geometry: str
    crs: str | None
    rows: int
    fields: tuple[tuple[str, str], ...]


def list_layers(path: str | Path) -> tuple[LayerInfo, ...]:
    """List the layers of a vector file or archive, in its order; SourceError if it is none."""
    with listening():
        return tuple(_describe(member) for member in _layers(Path(path)))


def read_layer(
    path: str | Path, spec: LayerSpec, *, filters: bool = True, crs: str | None = None
) -> RawLayer:
    r"""Read one layer of a vector file.

    Features are streamed. One that cannot be read is counted and reported, and the rest are read.
    The file's own CRS holds; what `spec` and `crs` say is for a file without one. GeoJSON without a
    ``crs`` member counts as such: it is WGS 84 only if nothing else is said and the coordinates
    fit.

    Parameters
    ----------
    path : str or Path
        A shapefile, GeoJSON, GeoPackage, FlatGeobuf or CSV file, or an archive of such.
    spec : LayerSpec
        Which layer and rows are wanted, and what they are.
    filters : bool, default True
        Whether the specification's ``where`` holds.
    crs : str, optional
        CRS of a file that states none; it goes before the specification's.

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
    with listening() as heard:
        member = _pick(Path(path), spec.layer)
        if (table := _csv(member, spec, where=where)) is not None:
            return read_csv_layer(table, spec, filters=filters, crs=crs, where=where)
        rules = RowRules(spec, _fields(member, where=where), filters=filters, where=where)
        found = _read_member(member, rules.fields, heard, expected=spec.crs, given=crs, where=where)
    return raw_layer(found.rows, rules, found.crs, by_file=found.by_file, notes=found.notes)


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
    with listening():
        return [list(fields) for _, fields in _with_geometry(path)]


def read_tables(
    path: Path, choose: Callable[[Sequence[str]], Collection[str]], *, crs: str | None = None
) -> Iterator[TableRows]:
    """Yield the rows of the layers of a vector file of which fields are chosen, and these."""
    with listening():
        layers = list(_with_geometry(path))
    for member, fields in layers:
        chosen = choose(fields)
        if chosen:
            wanted = tuple(field for field in fields if field in chosen)
            with listening() as heard:
                found = _read_member(
                    member, wanted, heard, expected=None, given=crs, where=str(member)
                )
            yield found


def _with_geometry(path: Path) -> Iterator[tuple[Member, Sequence[str]]]:
    for member in _layers(path):
        if member.driver != CSV:
            with _opened(member) as source:
                kind, fields = source.schema["geometry"], list(source.schema["properties"])
            if kind != NO_GEOMETRY:
                yield member, fields


def _read_member(
    member: Member,
    fields: tuple[str, ...],
    heard: list[logging.LogRecord],
    *,
    expected: str | None,
    given: str | None,
    where: str,
) -> TableRows:
    """Read a layer of a file whose CRS is its own, or `given` by the user, or `expected`."""
    with _opened(member, fields=fields) as source:
        own, implicit = _own_crs(source)
        system, notes = settle_crs(
            own, implicit=implicit, expected=expected, given=given, where=where
        )
        rows = _read_rows(source, fields, heard)
    if member.driver == "GeoJSON":
        _refuse_broken(rows, member)
    if any(record.getMessage().startswith("Failed to decode") for record in heard):
        notes += ("some text is not UTF-8 and was read as missing",)
    return TableRows(fields, rows, system, own is not None and not implicit, notes)


def read_layers(
    path: str | Path, specs: Iterable[LayerSpec], *, filters: bool = True, crs: str | None = None
) -> tuple[RawLayer, ...]:
    """Read several layers of one file, as `read_layer` reads one."""
    return tuple(read_layer(path, spec, filters=filters, crs=crs) for spec in specs)


def first_rows(
    path: Path, *, limit: int
) -> Iterator[tuple[LayerInfo, tuple[Mapping[str, Any], ...], tuple[str, ...]]]:
    """Yield every layer of a file, its first readable rows, and its coordinate columns if any."""
    with listening():
        for member in _layers(path):
            table = _csv(member, None, where=str(member))
            if table is not None:
                good = (row for row in table.rows() if not isinstance(row, str))
                coordinates = (table.x, table.y) if table.x and table.y else ()
                yield _describe(member), tuple(itertools.islice(good, limit)), coordinates
                continue
            with _opened(member) as source:
                rows = tuple(_properties(source, limit))
            yield _describe(member), rows, ()


def _properties(source: Iterable[fiona.Feature], limit: int) -> Iterator[Mapping[str, Any]]:
    features = iter(source)
    for _ in range(limit):
        try:
            feature = next(features, None)
        except Exception:  # noqa: BLE001, S112 - a load reports it; here the other rows will do
            continue
        if feature is None:
            return
        yield feature.properties


@contextlib.contextmanager
def _opened(member: Member, *, fields: tuple[str, ...] | None = None) -> Iterator[fiona.Collection]:
    """Open a layer; what goes wrong in opening it becomes a `SourceError`."""
    options: dict[str, Any] = {}
    if member.driver == "GeoJSON":
        # Has GDAL keep the members of the file that are not features, `crs` among them.
        options["NATIVE_DATA"] = "YES"
    elif fields is not None:  # which GeoJSON's driver cannot select
        options["include_fields"] = list(fields)
    if member.driver == "GPKG" and member.inner is None:
        _refuse_damaged(member.file)
    try:
        source = fiona.open(
            member.address, layer=member.layer, enabled_drivers=[member.driver], **options
        )
        source.schema, source.crs_wkt  # noqa: B018 - names are decoded here, and companions read
    except Exception as error:
        raise unreadable(member, error) from error
    with source:
        yield source


def _refuse_damaged(path: Path) -> None:
    """Refuse a damaged GeoPackage, of which GDAL says things at which fiona crashes."""
    try:
        with contextlib.closing(
            sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
        ) as f:
            found = f.execute("PRAGMA quick_check(1)").fetchone()[0]
    except UnicodeDecodeError:
        found = "a name in it is not UTF-8 text"
    except sqlite3.Error as error:
        found = str(error)
    if found != "ok":
        msg = f"{path} cannot be read ({' '.join(found.split())}); it may be damaged, get it again."
        raise SourceError(msg)


def _layers(path: Path) -> tuple[Member, ...]:
    """Return the layers of a file, or of all the files in an archive."""
    layers: list[Member] = []
    for member in members(path):
        if member.driver == CSV:
            layers.append(Member(member.file, member.inner, Path(member.inner or path).stem))
            continue
        # Opened under the allow-list first, because listing would try every driver of GDAL.
        with _opened(member):
            pass
        names = fiona.listlayers(member.address)
        layers += [Member(member.file, member.inner, name) for name in names]
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
        msg = (
            f"{path} has no layer {wanted!r}{nearest_name(wanted, names)}; "
            f"its layers are {', '.join(names)}."
        )
        raise UnknownNameError(msg)
    msg = f"{path} holds {len(matches)} layers ({', '.join(names)}); name the one that is meant."
    raise SourceError(msg)


def _csv(member: Member, spec: LayerSpec | None, *, where: str) -> CsvTable | None:
    """Look at a CSV file, which GDAL does not read here; None for a file of another kind."""
    if member.driver != CSV:
        return None
    try:
        return csv_table(member.open, spec, what=str(member), where=where)
    except OSError as error:
        raise unreadable(member, error) from error


def _fields(member: Member, *, where: str) -> Sequence[str]:
    with _opened(member) as source:
        if source.schema["geometry"] == NO_GEOMETRY:
            msg = f"{where} has no geometry; give the layer that holds the positions."
            raise SourceError(msg)
        return list(source.schema["properties"])


def _describe(member: Member) -> LayerInfo:
    table = _csv(member, None, where=str(member))
    if table is not None:
        rows, kinds = table.survey()
        return LayerInfo(
            name=str(member.layer),
            geometry=kinds,
            crs=None if table.crs is None else crs_label(table.crs),
            rows=rows,
            fields=tuple((name, "str") for name in table.names),
        )
    with _opened(member) as source:
        crs, implicit = _own_crs(source)
        count = _count(source)
        if implicit and count and not _in_degrees(source):
            crs = None
        return LayerInfo(
            name=str(member.layer),
            geometry=source.schema["geometry"],
            crs=None if crs is None else crs_label(crs),
            rows=sum(1 for _ in source) if count is None else count,
            fields=tuple(source.schema["properties"].items()),
        )


def _in_degrees(source: fiona.Collection) -> bool:
    """Tell whether the features could be in degrees, as those without a geometry could."""
    try:
        return fits_the_globe(np.reshape(source.bounds, (2, 2)))
    except DriverError:  # no feature has a geometry
        return True


def _count(source: fiona.Collection) -> int | None:
    try:
        return len(source)
    except TypeError:  # a FlatGeobuf file that was written as a stream, or is empty
        return None


def _own_crs(source: fiona.Collection) -> tuple[CRS | None, bool]:
    """Return the CRS of a layer, and whether it is only what GeoJSON means by saying nothing."""
    if source.driver == "GeoJSON":
        with _sound_json(source.path):
            members = parse_json(source.tags(ns="NATIVE_DATA").get("NATIVE_DATA", "{}"))
        if "crs" not in members:
            return WGS84, True
        if usable_crs(source.crs_wkt) == WGS84 and not WGS84_NAMES.search(str(members["crs"])):
            return None, False  # GDAL takes what it does not understand for WGS 84
    return usable_crs(source.crs_wkt), False


@contextlib.contextmanager
def _sound_json(what: object) -> Iterator[None]:
    """Refuse what GDAL takes for GeoJSON although it is none, such as text after its end."""
    try:
        yield
    except ValueError as error:
        raise unreadable(what, error) from error


def _read_rows(
    source: fiona.Collection, fields: Sequence[str], heard: list[logging.LogRecord]
) -> Rows:
    rows = Rows()
    expected = _count(source) or 0
    # GDAL parses GeoJSON whole: what it says then belongs to no row (see `_refuse_broken`).
    by_row = source.driver != "GeoJSON"
    damage = ""
    features = iter(source)
    failures = 0
    while failures < FAILURES_IN_A_ROW:
        said = len(heard)
        try:
            feature = next(features, None)
        except Exception as error:  # noqa: BLE001 - of many kinds, and one must not stop the rest
            failures += 1
            rows.read += 1
            rows.errors[rows.read] = f"cannot be read ({error})"
            continue
        failures = 0
        if by_row and not damage:
            errors = (record for record in heard[said:] if record.levelno >= logging.ERROR)
            damage = next((record.getMessage().rstrip(".") for record in errors), "")
        if feature is None:
            break
        rows.read += 1
        properties = feature.properties
        rows.closed += feature.geometry is not None and _has_open_ring(feature.geometry)
        try:
            position = _position(feature.geometry)
            # From the first damage on, GDAL gives null for what it cannot read.
            place: Position | str = (damage or None) if position is None else position
        except BadFeatureError as error:
            place = str(error)
        rows.add([properties[field] for field in fields], feature.id, place)
    if rows.read < expected and (damage or failures):
        rest = range(rows.read + 1, expected + 1)
        rows.errors.update(dict.fromkeys(rest, damage or "out of reach behind unreadable rows"))
        rows.read = expected
    return rows


def _position(geometry: fiona.Geometry | None) -> Position:
    if geometry is None:
        return None
    if geometry.type == "Point":
        x, y = geometry.coordinates[:2]
        # A GeoPackage writes an empty point as one of NaN.
        return shapely.Point() if math.isnan(x) and math.isnan(y) else (x, y)
    try:
        with np.errstate(invalid="ignore"):  # NaN is looked for in all geometries at once
            return shapely.geometry.shape(geometry)
    except (AttributeError, TypeError, ValueError, shapely.errors.ShapelyError) as error:
        msg = f"its {geometry.type} is not valid ({error})"
        raise BadFeatureError(msg) from error


def _has_open_ring(geometry: fiona.Geometry) -> bool:
    """Tell whether a ring of a polygon does not end where it begins; shapely closes it untold."""
    if geometry.type not in {"Polygon", "MultiPolygon"}:
        return False
    parts = [geometry.coordinates] if geometry.type == "Polygon" else geometry.coordinates
    return any(ring[0] != ring[-1] for part in parts for ring in part if ring)


def _refuse_broken(rows: Rows, member: Member) -> None:
    """Tell the null geometries of a GeoJSON file from those that GDAL could make nothing of."""
    null = [row for row, position in enumerate(rows.positions) if position is None]
    if not null:
        return
    with _sound_json(member), member.open() as stream:
        document = parse_json(stream.read().decode("utf-8-sig", errors="replace"))
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
