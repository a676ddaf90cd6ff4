"""Read and write buildings and streets, and read areas."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import shapely
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from semsig_gis.core import CLASS_NAME, HALF_WIDTH, LICENSES, NAME, InputError, SourceError
from semsig_gis.objects.table import layer_licences, save_objects
from semsig_gis.sources import (
    NUMBERS,
    SUFFIXES,
    WGS84,
    Area,
    LayerSpec,
    elsewhere_error,
    file_reader,
    frame_fields,
    frame_layers,
    has_element_columns,
    join_areas,
    list_layers,
    load_catalog,
    parse_area,
    parse_crs,
    read_parquet,
    read_polygons,
    reader,
    transformed,
)
from semsig_gis.storage import (
    GROUP_ROWS,
    WRITE_CHECKSUMS,
    add_footer_checksum,
    digest,
    hilbert_order,
    parse_json,
    require_regular,
    whole_file,
    whole_files,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import geopandas as gpd

    from semsig_gis.core import AnyCrs
    from semsig_gis.objects.table import StreetObjects
    from semsig_gis.sources import GeometryKind, RawLayer

GROUND = "semsig_ground"
"""Key in the `attrs` of ground files of `save_with_ground`, which it may remove again."""
RUN = "semsig_objects"
"""Key in the `attrs`: name and digest of the file of street objects that was written with them."""
NEAR_M = 1000.0
"""Distance from the street objects of a city to its buildings and streets."""
FAR_M = 10_000.0
"""Distance from all objects at which an area is refused, because none is seen from there."""
DIMENSIONS: dict[GeometryKind, int] = {"line": 1, "polygon": 2}
KIND_OF: dict[str, GeometryKind] = {"buildings": "polygon", "streets": "line", "area": "polygon"}
# Distance between points along the edges of a box, which are curves in the metric CRS: this is
# accurate to centimetres.
EDGE_DEGREES = 0.01


def save_surroundings(table: gpd.GeoDataFrame, path: str | Path) -> None:
    """Save buildings or streets as a GeoParquet file that can be read by box.

    Parameters
    ----------
    table : GeoDataFrame
        Features, all with a geometry; all columns and the `attrs` are stored. The file has them in
        a spatial order, with their bounds in the column ``bbox``.
    path : str or Path
        File to write, atomically.

    Examples
    --------
    >>> import tempfile
    >>> import geopandas as gpd
    >>> houses = gpd.GeoDataFrame(
    ...     geometry=[shapely.box(0, 0, 5, 5), shapely.box(90, 0, 95, 5)], crs="EPSG:2154"
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = f"{folder}/houses.parquet"
    ...     save_surroundings(houses, file)
    ...     len(read_surroundings(file, role="buildings", crs="EPSG:2154", box=(0, 0, 9, 9)))
    1
    """
    _save(table, path, {})


def _save(table: gpd.GeoDataFrame, path: str | Path, marks: dict[str, Any]) -> None:
    """Save buildings or streets with some more `attrs`."""
    ordered = table.iloc[hilbert_order(table.bounds.to_numpy())]
    attributes = {key: table.attrs[key] for key in table.attrs if key not in {GROUND, RUN}}
    ordered.attrs = attributes | marks
    with whole_file(path) as partial:
        ordered.to_parquet(
            partial,
            index=False,
            compression="zstd",
            schema_version="1.1.0",
            write_covering_bbox=True,
            row_group_size=GROUP_ROWS,
            **WRITE_CHECKSUMS,
        )
        add_footer_checksum(partial)


def read_surroundings(
    path: str | Path | gpd.GeoDataFrame,
    *,
    role: Literal["buildings", "streets"],
    crs: AnyCrs,
    box: Sequence[float] | None = None,
    remark: Callable[[str], None] | None = None,
) -> gpd.GeoDataFrame:
    """Read the buildings or the streets of a city.

    Parameters
    ----------
    path : str, Path or GeoDataFrame
        Any vector file that `read_layer` reads, a ``.parquet`` file as from ``semsig load
        --buildings``, or a table. From OpenStreetMap elements, the buildings or streets are
        selected by their tags. SourceError if it is missing, damaged, or of another kind.
    role : {"buildings", "streets"}
        The features: polygons or lines. InputError if there are none, or also other geometries.
    crs : int, str or pyproj.CRS
        CRS of the result. CrsError if the CRS of the file is unknown.
    box : sequence of float, optional
        ``xmin, ymin, xmax, ymax`` in the CRS of a file by `save_surroundings`: only features with
        bounds that intersect it.
    remark : callable, optional
        Called with notes on the file, for example on outlines omitted because they are not closed.

    Returns
    -------
    GeoDataFrame
        One row per feature with a geometry; in a box there may be none. A ``.parquet`` file keeps
        all columns. ``attrs["licenses"]`` has the attribution lines, if known.

    Examples
    --------
    >>> import tempfile
    >>> import geopandas as gpd
    >>> house = shapely.box(*demo_objects.xy[0], *(demo_objects.xy[0] + 5.0))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = f"{folder}/houses.parquet"
    ...     save_surroundings(gpd.GeoDataFrame(geometry=[house], crs=demo_objects.crs), file)
    ...     houses = read_surroundings(file, role="buildings", crs=demo_objects.crs)
    >>> houses.area.round().tolist()
    [25.0]
    """
    return _read(path, role, crs, box, remark)


def ground_file(objects: str | Path, role: Literal["buildings", "streets"]) -> Path:
    """Return the file of buildings or streets that belongs to a file of street objects.

    That of ``town.parquet`` is ``town.buildings.parquet``.
    """
    return Path(objects).with_suffix(f".{role}.parquet")


def save_with_ground(
    objects: StreetObjects,
    path: str | Path,
    *,
    buildings: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
    others: Mapping[Path, gpd.GeoDataFrame] | None = None,
    keep_order: bool = False,
    remark: Callable[[str], None],
) -> dict[str, Path]:
    """Save street objects with buildings and streets next to them; return their files by role.

    Files of earlier objects of that name are removed (see `ground_file`). `others` are tables of
    buildings and streets by the file to write. No file is replaced before all are written, and
    all carry the digest of the street objects (see `other_run`). InputError, and nothing is
    written, if a file would be replaced that was not written by this function; where there is
    nothing to write, such a file is left. `remark` is called with notes on such files.
    """
    roles: dict[Literal["buildings", "streets"], gpd.GeoDataFrame | None] = {
        "buildings": buildings,
        "streets": streets,
    }
    paths = {role: ground_file(path, role) for role in roles}
    present = [role for role in roles if paths[role].exists()]
    foreign = [role for role in present if not _is_ground(paths[role])]
    written: dict[str, Path] = {
        role: paths[role] for role, table in roles.items() if table is not None and len(table)
    }
    if blocked := [str(paths[role]) for role in foreign if role in written]:
        raise InputError(
            f"{' and '.join(blocked)} would be replaced, but semsig did not write it as part of "
            f"{path}; rename it, write to another file, or give --no-ground."
        )
    tables = [
        *((paths[role], table, True) for role, table in roles.items() if role in written),
        *((file, table, False) for file, table in (others or {}).items()),
    ]
    with whole_files(path, *(file for file, _, _ in tables)) as (first, *partials):
        save_objects(objects, first, keep_order=keep_order)
        run = [Path(path).name, digest(first)]
        for partial, (_, table, is_ground) in zip(partials, tables, strict=True):
            _save(table, partial, {RUN: run, **({GROUND: True} if is_ground else {})})
    for role in present:
        if role in foreign:
            remark(f"{paths[role]} was not written by semsig with {path}, and is left as it is")
        elif role not in written:
            paths[role].unlink()
            remark(f"{paths[role]}, of earlier objects, was removed")
    return written


def other_run(path: str | Path, objects: str | Path) -> bool:
    """Whether a file was written with a file of the same name as `objects`, but other content.

    So it is of another run, perhaps of one that was interrupted.
    """
    try:
        name, expected = _metadata(path, b"PANDAS_ATTRS")[RUN]
    except (pa.ArrowException, OSError, LookupError, TypeError, ValueError):
        return False
    return bool(name == Path(objects).name and expected != digest(Path(objects)))


def _is_ground(path: Path) -> bool:
    """Whether a file was written by `save_with_ground` as ground."""
    try:
        return GROUND in _metadata(path, b"PANDAS_ATTRS")
    except (pa.ArrowException, OSError, LookupError, TypeError, ValueError):
        return False


def _metadata(path: str | Path, key: bytes) -> Any:  # noqa: ANN401 - any value of JSON
    """Return the JSON under a key of the metadata of a Parquet file."""
    require_regular(path)
    return parse_json((pq.read_schema(path).metadata or {})[key])


def covers_place(path: str | Path, *, crs: CRS, box: Sequence[float]) -> bool:
    """Whether a GeoParquet file may have features in or near a box, in metres in `crs`.

    Only its metadata is read; one that cannot be read may have some.
    """
    try:
        geo = _metadata(path, b"geo")
        column = geo["columns"][geo["primary_column"]]
        own = CRS.from_user_input(column["crs"])
        to_box = Transformer.from_crs(own, crs, always_xy=True)
        west, south, east, north = to_box.transform_bounds(*column["bbox"])
    except (pa.ArrowException, OSError, LookupError, TypeError, ValueError, ProjError):
        return True
    extent = shapely.box(box[0], box[1], box[2], box[3]).buffer(NEAR_M).bounds
    return bool(
        west <= extent[2] and east >= extent[0] and south <= extent[3] and north >= extent[1]
    )


def select_role(table: gpd.GeoDataFrame, role: Literal["buildings", "streets"]) -> gpd.GeoDataFrame:
    """Return the buildings or streets in a table of OpenStreetMap elements; other tables unchanged.

    InputError if there are none.
    """
    if not has_element_columns(frame_fields(table)):
        return table
    (layer,) = frame_layers(table, [load_catalog("openstreetmap").layer(role)])
    if not len(layer):
        raise InputError(f"the table of OpenStreetMap's elements has no {role}; give one that has.")
    return _with_licences(layer)


def _with_licences(layer: RawLayer) -> gpd.GeoDataFrame:
    table = layer.table.drop(columns=CLASS_NAME)
    table.attrs[LICENSES] = [str(licence) for licence in layer_licences([layer])]
    return table


def read_area(
    area: str | Path | gpd.GeoDataFrame,
    *,
    crs: AnyCrs,
    near: Sequence[float] | None = None,
) -> shapely.Polygon | shapely.MultiPolygon:
    """Return a box ``west,south,east,north`` in degrees, or the polygons of a file or table.

    The result is one (multi)polygon in `crs`. Errors are those of `parse_area` and
    `read_surroundings`, and InputError if the area is far from the box `near`, ``xmin, ymin,
    xmax, ymax`` in `crs`, or would meet it with its numbers in another order.
    """
    system = parse_crs(crs)
    numbers: tuple[float, ...] = ()
    if isinstance(area, str | Path) and NUMBERS.fullmatch(str(area)):
        own_area = parse_area(str(area))
        numbers = own_area.numbers
        shapes = transformed(
            np.array([shapely.segmentize(own_area.polygon, EDGE_DEGREES)]), WGS84, system
        )
    else:
        shapes = _read(area, "area", crs).geometry.to_numpy()
    joined = join_areas(shapes)
    if joined is None:
        raise InputError(f"{_named(area)} encloses no area; give {_of_kind(area, 'polygon')}.")
    around = None if near is None else shapely.box(near[0], near[1], near[2], near[3])
    if around is None or joined.intersects(around):
        return joined

    def meets(other: Area) -> bool:
        (shape,) = transformed(np.array([other.polygon]), WGS84, system)
        return bool(np.isfinite(shape.bounds).all() and shape.intersects(around))

    (polygon,) = transformed(np.array([joined]), system, WGS84)
    (centre,) = transformed(np.array([around.centroid]), system, WGS84)
    degrees = Area(polygon, str(area) if numbers else _named(area), numbers)
    if joined.distance(around) > FAR_M or any(meets(other) for _, other in degrees.others):
        raise elsewhere_error(degrees, meets, (centre.x, centre.y))
    return joined


def _read(
    path: str | Path | gpd.GeoDataFrame,
    role: Literal["buildings", "streets", "area"],
    crs: AnyCrs,
    box: Sequence[float] | None = None,
    remark: Callable[[str], None] | None = None,
) -> gpd.GeoDataFrame:
    kind = KIND_OF[role]
    notes: tuple[str, ...] = ()
    where = _named(path)
    if not isinstance(path, str | Path):
        table = path if role == "area" else select_role(path, role)
        table = table if box is None else table.iloc[np.sort(table.sindex.intersection(box))]
    else:
        table, notes = _read_file(Path(path), role, kind, box)
    if remark is not None:
        for note in notes:
            remark(f"{where}: {note}")
    if table.crs is None:
        raise SourceError(f"{where} states no coordinate reference system; write it with one.")
    geometry = table.geometry
    table = table[~(geometry.isna() | geometry.is_empty)].reset_index(drop=True)
    dimensions = shapely.get_dimensions(table.geometry.to_numpy())
    others = table.geometry[dimensions != DIMENSIONS[kind]]
    if (len(table) == 0 and box is None) or len(others):
        content = f"contains a {others.iloc[0].geom_type}" if len(others) else f"contains no {kind}"
        raise InputError(f"{where} {content}; give {_of_kind(path, kind)}.")
    if HALF_WIDTH in table:  # a file of a user may have widths that are not numbers
        import pandas as pd  # noqa: PLC0415 - 0.4 s

        widths = pd.to_numeric(table[HALF_WIDTH], errors="coerce").astype(np.float64)
        if remark is not None and (wrong := int((widths.isna() & table[HALF_WIDTH].notna()).sum())):
            remark(f"{where}: {HALF_WIDTH} is no number in {wrong:,} rows, and not used there")
        table[HALF_WIDTH] = widths
    return table.to_crs(parse_crs(crs))


def _named(path: object) -> str:
    return "the table" if not isinstance(path, str | Path) else str(path)


def _of_kind(path: object, kind: str) -> str:
    return f"a {'table' if not isinstance(path, str | Path) else 'file'} of {kind}s"


def _read_file(
    path: Path,
    role: Literal["buildings", "streets", "area"],
    kind: GeometryKind,
    box: Sequence[float] | None,
) -> tuple[gpd.GeoDataFrame, tuple[str, ...]]:
    """Return the features of a file, and notes on it."""
    reader_name = None if role == "area" else file_reader(path, sure=True)
    if reader_name is not None:
        (layer,) = reader(reader_name)(path, [load_catalog("openstreetmap").layer(role)])
        return _with_licences(layer), layer.notes
    if role == "area":
        return read_polygons(path).to_frame("geometry"), ()
    if path.suffix.lower() in SUFFIXES:
        return read_parquet(path, kind=f"{kind}s", box=box), ()
    fields = [field for layer in list_layers(path) for field in layer.fields]
    name_field = next((name for name in fields if name.lower() == NAME), None)
    spec = LayerSpec(name=role, class_name="", geometry=kind, name_field=name_field)
    (layer,) = reader("vector_file")(path, [spec])
    if layer.errors:
        raise SourceError(
            f"{path} has {layer.counts.unreadable} features that cannot be read "
            f"({layer.errors[0]}); correct the file."
        )
    return layer.table, layer.notes
