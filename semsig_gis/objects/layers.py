"""Read layers from files, and assemble them to street objects, buildings and streets."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import shapely

from semsig_gis.core import (
    CLASS_CODE,
    CLASS_NAME,
    COUNT,
    GEOMETRY,
    GROUP,
    HEIGHT,
    LICENSES,
    NAME,
    SOURCE,
    SOURCE_ID,
    TEXTS,
    Displayed,
    EmptyResultError,
    InputError,
    SignatureSpec,
    Taxonomy,
    crs_text,
    map_with,
    require_metric_crs,
)
from semsig_gis.objects.conflation import ConflationReport, conflate
from semsig_gis.objects.derived import covered_area, derived_layers
from semsig_gis.objects.extended import thing_points
from semsig_gis.objects.extent import BEYOND_EARTH_M, MAX_DISTORTION, settle_extent
from semsig_gis.objects.fronts import moved_to_fronts
from semsig_gis.objects.surroundings import DIMENSIONS, KIND_OF
from semsig_gis.objects.table import (
    OPTIONAL,
    arrow_objects,
    layer_licences,
    layer_note,
    with_notes,
    without_empty,
)
from semsig_gis.sources import (
    READERS,
    TAGS_READER,
    derived_layer,
    file_reader,
    find_files,
    note_outside,
    paper_taxonomy,
    reader,
    transformed,
)
from semsig_gis.storage import points_to_wkb

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
    from pathlib import Path

    import geopandas as gpd
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.core import AnyCrs, MapFrame
    from semsig_gis.objects.extended import ThingPoints
    from semsig_gis.objects.table import StreetObjects
    from semsig_gis.sources import Area, Catalog, LayerSpec, RawLayer, Role, RowCounts


# Objects of a class at the same place, rounded to this, are one object listed several times.
SAME_PLACE_M = 0.01
# Lines or areas of one row with a middle that is farther from all of them get a note.
PARTS_APART_M = 20.0
AREA_DIMENSIONS = 2


@dataclass(frozen=True, slots=True)
class LayerReport:
    """Counts of the rows of a layer; `notes` are warnings and messages on unreadable rows.

    `role` is "objects", "buildings" or "streets"; `classes` are the possible classes of objects.
    `derived` objects were computed from streets and buildings.
    """

    name: str
    counts: RowCounts
    notes: tuple[str, ...] = ()
    role: Role = "objects"
    classes: tuple[str, ...] = ()
    derived: bool = False


@dataclass(frozen=True, slots=True)
class UnreadLayer:
    """A layer of objects that was not read; `objects` is their number, None if not counted."""

    name: str
    classes: tuple[str, ...]
    objects: int | None = None


@dataclass(frozen=True, repr=False, slots=True)
class LoadReport(Displayed):
    """Reports of all layers in their order, and the layers that were not read.

    `fronts` is the number of objects that were moved to the fronts of their buildings.
    """

    layers: tuple[LayerReport, ...]
    unread: tuple[UnreadLayer, ...] = ()
    fronts: int = 0

    def _facts(self) -> dict[str, object]:
        return {
            "layers": len(self.layers),
            "rows read": sum(layer.counts.read for layer in self.layers),
            "kept": sum(layer.counts.kept for layer in self.layers),
            "not read": f"{len(self.unread)} layers",
            "notes": len(self.notes),
        }

    @property
    def notes(self) -> tuple[str, ...]:
        """The notes on all layers, each beginning with the name of its layer."""
        return tuple(layer_note(item.name, note) for item in self.layers for note in item.notes)


def build_objects(
    layers: Iterable[RawLayer],
    *,
    taxonomy: Taxonomy,
    crs: AnyCrs,
    collapse: bool = True,
    apart: Collection[str] = (),
) -> tuple[StreetObjects, LoadReport]:
    """Return one table of street objects from raw layers.

    A geometry that is not a point is represented by its centroid in the metric CRS (paper, section
    on semantic signatures), and an extended thing by points along its line or outline, with a
    number in ``group``. Rows without a valid position are dropped and counted.

    Parameters
    ----------
    layers : iterable of RawLayer
        The layers. CrsError if one has no coordinate reference system.
    taxonomy : Taxonomy
        The classes. UnknownNameError if it lacks a class of the layers.
    crs : int, str or pyproj.CRS
        Metric coordinate reference system of the result.
    collapse : bool, default True
        Whether objects of one class at the same place (within the same centimetre) become one,
        with their number in ``count``. The place of an area is a point of its class in it, if any.
    apart : collection of str
        Classes that are collapsed within each layer only, because they will be conflated (see
        `conflate`), which needs their sources.

    Returns
    -------
    objects : StreetObjects
        The objects, in the order of the layers; EmptyResultError if there are none.
    report : LoadReport
        The counts of rows by layer.

    Examples
    --------
    >>> from semsig_gis import CitySpec, build_objects, paper_taxonomy, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> _, report = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> all(layer.counts.kept == layer.counts.read for layer in report.layers)
    True
    """
    system = require_metric_crs(crs)
    layers = tuple(layers)
    parts = [_placed(layer, taxonomy, system) for layer in layers]
    sizes = [len(part.xy) for part in parts]
    if not any(sizes):
        raise EmptyResultError(
            f"no object remains of {sum(layer.counts.read for layer in layers)} rows in "
            f"{len(layers)} layers; look at the filters, the area, the geometries and the "
            "coordinate systems."
        )
    # Layers are identified by number, because two may have the same name.
    owner = np.repeat(np.arange(len(parts)), sizes)
    ids = pa.chunked_array([part.ids for part in parts]).combine_chunks()
    codes, xy, shapes = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("codes", "xy", "shapes")
    )
    # Drop rows with the id of an earlier row, as in a second file of a layer. OpenStreetMap
    # elements have the same id in all files.
    unique = np.array([layer.spec.unique_id or bool(layer.spec.tags) for layer in layers])[owner]
    names, source = np.unique([layer.spec.name for layer in layers], return_inverse=True)
    numbered = ids.dictionary_encode()
    keys = source[owner] * len(numbered.dictionary) + numbered.indices.to_numpy()
    is_duplicate = unique & pc.not_equal(ids, "").to_numpy(zero_copy_only=False)
    is_duplicate[np.unique(keys, return_index=True)[1]] = False
    duplicates = np.bincount(owner[is_duplicate], minlength=len(parts)).tolist()
    rows = np.flatnonzero(~is_duplicate)
    is_thing = np.isin(codes, [item.code for item in taxonomy.classes if item.shape != "point"])
    # The middle of lines or areas that lie apart is at none of them.
    several = np.flatnonzero(~is_thing & (shapely.get_num_geometries(shapes) > 1))
    gaps = shapely.distance(shapes[several], shapely.points(xy[several]))
    apart_rows = np.bincount(owner[several[gaps > PARTS_APART_M]], minlength=len(parts)).tolist()
    things, rows = rows[is_thing[rows]], rows[~is_thing[rows]]
    # Collapse objects of a class at the same place, by layer for the classes in `apart`.
    counts = np.ones(len(rows), np.int64)
    if collapse:
        of_layer = np.isin(codes, [taxonomy.by_name(name).code for name in apart])
        group = np.column_stack([np.where(of_layer, owner, -1), codes])
        xy[rows] = _at_points(xy[rows], shapes[rows], group[rows])
        first, counts = _first_at_place(xy[rows], group[rows])
        rows = rows[first]
    remaining = np.bincount(owner[[*rows, *things]], minlength=len(parts)).tolist()
    facts = _facts(parts)
    points = _thing_points(shapes[things], codes[things], facts, things, taxonomy)
    groups = np.concatenate([np.full(len(rows), -1), points.groups]).astype(np.int32)
    places = np.concatenate([xy[rows], points.xy])
    rows = np.concatenate([rows, things[points.rows]])
    counts = np.concatenate([counts, np.ones(len(points.rows), np.int64)])
    reports = []
    for layer, part, duplicate_count, remaining_count, apart_count in zip(
        layers, parts, duplicates, remaining, apart_rows, strict=True
    ):
        row_counts = replace(
            layer.counts,
            missing=part.missing,
            duplicates=layer.counts.duplicates + duplicate_count,
            misplaced=layer.counts.misplaced + part.misplaced,
            collapsed=len(part.xy) - duplicate_count - remaining_count,
        )
        notes = (*layer.notes, *layer.errors)
        if apart_count and not layer.spec.tags:
            note = (
                f"{apart_count:,} rows have parts that lie apart; each is one object in their "
                f"middle, more than {PARTS_APART_M:.0f} m from all of them"
            )
            notes += (note,)
        reports.append(
            LayerReport(
                layer.spec.name,
                row_counts,
                notes,
                classes=layer.spec.classes,
                derived=layer.spec.derive is not None,
            )
        )
    report = LoadReport(tuple(reports))
    columns = {
        CLASS_CODE: codes[rows],
        SOURCE: pa.array(names.tolist(), pa.string()).take(pa.array(source[owner[rows]])),
        SOURCE_ID: ids.take(pa.array(rows)),
        COUNT: counts.astype(np.int32),
        **{name: values.take(pa.array(rows)) for name, values in facts.items()},
        GROUP: groups,
        GEOMETRY: points_to_wkb(places),
    }
    objects = arrow_objects(
        without_empty(pa.table(columns)),
        xy=places,
        crs=system,
        taxonomy=taxonomy,
        licenses=layer_licences(layers),
        notes=report.notes,
    )
    return objects, report


def _thing_points(
    shapes: NDArray[np.object_],
    codes: NDArray[np.uint8],
    facts: Mapping[str, pa.ChunkedArray],
    rows: NDArray[np.int64],
    taxonomy: Taxonomy,
) -> ThingPoints:
    """Return the points of the extended things in some rows."""
    names, keys = (
        facts[name].take(pa.array(rows)).to_pylist() if name in facts else [""] * len(rows)
        for name in (NAME, GROUP)
    )
    lines = [item.code for item in taxonomy.classes if item.shape == "line"]
    return thing_points(shapes, codes, names, keys=keys, joins=np.isin(codes, lines))


def _facts(parts: Sequence[_Placed]) -> dict[str, pa.ChunkedArray]:
    """Return heights, texts and groups of all layers; layers without a column have no value."""
    columns = {}
    for name in (HEIGHT, GROUP, *TEXTS):
        if any(name in part.facts.column_names for part in parts):
            kind = pa.float32() if name == HEIGHT else pa.string()
            empty = pa.scalar(OPTIONAL[name] if name == HEIGHT else "", kind)
            values = pa.chunked_array(
                [
                    chunk
                    for part in parts
                    for chunk in (
                        part.facts[name].cast(kind).chunks
                        if name in part.facts.column_names
                        else [pa.repeat(empty, len(part.xy))]
                    )
                ],
                kind,
            )
            columns[name] = pc.fill_null(values, empty)
    return columns


class _Placed(NamedTuple):
    """The rows of a layer with a valid position, and the numbers of the others.

    `shapes` are the geometries in the metric CRS, `xy` their centroids, `facts` the other columns.
    """

    ids: pa.Array
    codes: NDArray[np.uint8]
    xy: NDArray[np.float64]
    shapes: NDArray[np.object_]
    facts: pa.Table
    missing: int
    misplaced: int


def _placed(layer: RawLayer, taxonomy: Taxonomy, crs: CRS) -> _Placed:
    own = layer.known_crs
    usable = ~(shapely.is_missing(layer.geometry) | shapely.is_empty(layer.geometry))
    # Centroids in the metric CRS, because those in degrees are elsewhere.
    shapes = layer.geometry[usable]
    shapes = shapes if own == crs else transformed(shapes, own, crs)
    others = shapely.get_type_id(shapes) != shapely.GeometryType.POINT
    points = shapes.copy()
    with np.errstate(invalid="ignore", over="ignore"):  # such rows are dropped below
        points[others] = shapely.centroid(shapes[others])
    # An invalid geometry may have an empty centroid, which has no coordinates.
    xy = np.full((len(points), 2), np.nan)
    coordinates, row = shapely.get_coordinates(points, return_index=True)
    xy[row] = coordinates
    placed = (np.abs(xy) < BEYOND_EARTH_M).all(axis=1)  # false for NaN too
    rows = pa.array(np.flatnonzero(usable)[placed])
    classes = layer.columns[CLASS_NAME].combine_chunks().dictionary_encode()
    codes = [taxonomy.by_name(name).code for name in classes.dictionary.to_pylist()]
    return _Placed(
        ids=layer.columns[SOURCE_ID].take(rows).cast(pa.string()).combine_chunks(),
        codes=np.array(codes, np.uint8)[classes.indices.take(rows).to_numpy()],
        xy=xy[placed],
        shapes=shapes[placed],
        facts=layer.columns.drop_columns([CLASS_NAME, SOURCE_ID]).take(rows),
        missing=int((~usable).sum()),
        misplaced=int((~placed).sum()),
    )


def _at_points(
    xy: NDArray[np.float64], shapes: NDArray[np.object_], group: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return positions of objects; an area is moved to the first point of its group in it.

    An area and a point of the same class are one object, mapped twice, and the point is more exact.
    Several points in an area are several objects. A group, shape (n, 2), is a layer and a class.
    """
    areas = np.flatnonzero(shapely.get_dimensions(shapes) == AREA_DIMENSIONS)
    points = np.flatnonzero(shapely.get_type_id(shapes) == shapely.GeometryType.POINT)
    if not len(areas):
        return xy
    area, point = shapely.STRtree(shapes[points]).query(shapes[areas], predicate="covers")
    area, point = areas[area], points[point]
    same = (group[area] == group[point]).all(axis=1)
    order = np.lexsort((point[same], area[same]))
    area, first = np.unique(area[same][order], return_index=True)
    places = xy.copy()
    places[area] = xy[point[same][order][first]]
    return places


def _first_at_place(
    xy: NDArray[np.float64], group: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first row of every group and place, in order, and the number of rows."""
    places = np.rint(xy / SAME_PLACE_M).astype(np.int64)
    keys = np.column_stack([group, places])
    order = np.lexsort(keys.T)
    starts = np.flatnonzero((np.diff(keys[order], axis=0, prepend=-2) != 0).any(axis=1))
    first, counts = order[starts], np.diff(starts, append=len(keys))
    in_order = np.argsort(first)
    return first[in_order], counts[in_order]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Loaded(Displayed):
    """Street objects, buildings and streets that were loaded, with the reports.

    Parameters
    ----------
    objects : StreetObjects
        The street objects.
    report, conflation : LoadReport, ConflationReport
        Counts of rows by layer, and objects merged between layers.
    buildings, streets : GeoDataFrame, optional
        Footprints (polygons) and centre lines in the CRS of the objects, if there are such layers.
        Streets have ``half_width`` in metres and ``name``, if a layer has widths or names.
    notes : tuple of str
        Warnings about the whole load; those about a layer are in its report. The objects have both.

    Examples
    --------
    >>> from semsig_gis import CitySpec, assemble, load_catalog, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> loaded = assemble(layers, load_catalog("openstreetmap"))
    >>> loaded.objects.class_counts == demo_objects.class_counts
    True
    """

    objects: StreetObjects
    report: LoadReport
    conflation: ConflationReport
    buildings: gpd.GeoDataFrame | None = None
    streets: gpd.GeoDataFrame | None = None
    notes: tuple[str, ...] = ()

    def _facts(self) -> dict[str, object]:
        return {
            "objects": len(self.objects),
            "layers": len(self.report.layers),
            "merged": self.conflation.count,
            "buildings": "none" if self.buildings is None else len(self.buildings),
            "streets": "none" if self.streets is None else len(self.streets),
            "notes": len(self.objects.notes),
        }

    def explore(self) -> MapFrame:
        """Show the objects, buildings and streets on a map in a notebook (see `objects_map`)."""
        tables = {"buildings": self.buildings, "streets": self.streets}
        ground = {name: table for name, table in tables.items() if table is not None and len(table)}
        return map_with("objects_map", self.objects, ground=ground)


# The layers that are read if none is named.
Selection = Literal["default", "paper", "all"]


def choose_layers(
    catalog: Catalog,
    names: Sequence[str] = (),
    *,
    selection: Selection = "default",
    surroundings: bool = False,
) -> tuple[LayerSpec, ...]:
    """Return the layers to load, in the order of the catalogue.

    Parameters
    ----------
    catalog : Catalog
        The catalogue.
    names : sequence of str
        Names of the only layers to read. With a plus sign, as in ``"+cameras"``, a layer is read in
        addition to the selection. UnknownNameError for an unknown name.
    selection : {"default", "paper", "all"}
        The layers that are read if there are no names without a plus sign: layers that are not
        optional, only the paper's eleven classes of these, or all layers of objects. InputError if
        it is given together with names without a plus sign.
    surroundings : bool, default False
        Whether to include buildings and streets.

    Returns
    -------
    tuple of LayerSpec
        The layers.

    Examples
    --------
    >>> from semsig_gis import choose_layers, load_catalog
    >>> [spec.name for spec in choose_layers(load_catalog("montpellier"), ["cameras"])]
    ['cameras']
    >>> osm = load_catalog("openstreetmap")
    >>> chosen = choose_layers(osm, ["+telephones"], selection="paper")
    >>> [spec.name for spec in chosen][-2:]
    ['bus_platforms', 'telephones']
    """
    only = {catalog.layer(name).name for name in names if not name.startswith("+")}
    added = {catalog.layer(name[1:]).name for name in names if name.startswith("+")}
    if only and selection != "default":
        raise InputError(
            f"layer {min(only)!r} was given without a plus sign together with {selection} layers; "
            f"write '+{min(only)}' to read it as well, or give only the layers to read."
        )
    specs: list[LayerSpec | None] = []
    for spec in catalog.layers:
        if spec.name in only | added or (spec.role != "objects" and surroundings):
            specs.append(spec)
        elif spec.role == "objects" and not only and (selection == "all" or not spec.optional):
            specs.append(_paper_classes_only(spec) if selection == "paper" else spec)
    return tuple(spec for spec in specs if spec is not None)


def _paper_classes_only(spec: LayerSpec) -> LayerSpec | None:
    """Return a layer with only the paper's classes, or None if it has none of them."""
    paper = {item.name for item in paper_taxonomy().classes}
    by = spec.class_by
    if by is None or paper.issuperset(spec.classes):
        return spec if paper.issuperset(spec.classes) else None
    # Values of other classes remain, without a class, so that no later pattern matches them.
    classes = tuple((value, name if name in paper else "") for value, name in by.classes)
    class_name = spec.class_name if spec.class_name in paper else ""
    by = replace(by, classes=classes, otherwise=by.otherwise and class_name != "")
    spec = replace(spec, class_name=class_name, class_by=by)
    return spec if spec.classes else None


def read_files(
    specs: Sequence[LayerSpec],
    paths: Iterable[str | Path],
    *,
    filters: bool = True,
    crs: AnyCrs | None = None,
    area: Area | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[tuple[RawLayer, ...], tuple[LayerSpec, ...]]:
    """Read layers from local files, each file once, and OpenStreetMap extracts together.

    Parameters
    ----------
    specs : sequence of LayerSpec
        The layers.
    paths : iterable of str or Path
        Files, and folders with files. SourceError if one does not exist, matches no layer, or
        cannot be read.
    filters : bool, default True
        Whether the filters of the layers are applied.
    crs : int, str or pyproj.CRS, optional
        CRS of files that do not state one, such as 2154, its EPSG code.
    area : Area, optional
        Parts of large files outside this area need not be read (see `clip_layers`).
    progress : callable, optional
        Called with the number of files read and the total.

    Returns
    -------
    layers : tuple of RawLayer
        The layers with files, and those to be computed without rows, in the order of `specs`.
    absent : tuple of LayerSpec
        The layers without files in `paths`.

    Examples
    --------
    >>> from semsig_gis import SemsigError, choose_layers, load_catalog
    >>> try:
    ...     read_files(choose_layers(load_catalog("montpellier")), ["nowhere/"])
    ... except SemsigError as error:
    ...     print(error)
    nowhere does not exist; give a file or a folder of files.
    """
    pairs, absent = find_files([spec for spec in specs if spec.derive is None], paths)
    # A layer by tags may be in files of several formats, each with its own reader.
    reader_of = {
        path: file_reader(path) or TAGS_READER
        for path in {path for spec, path in pairs if spec.reader == TAGS_READER}
    }
    # Group the layers by reader and files, so that each file is read once for all its layers.
    specs_of: dict[tuple[str, tuple[Path, ...]], list[LayerSpec]] = {}
    for spec, spec_pairs in itertools.groupby(pairs, key=lambda pair: pair[0]):
        by_reader: dict[str, list[Path]] = {}
        for _, path in spec_pairs:
            name = reader_of[path] if spec.reader == TAGS_READER else spec.reader
            by_reader.setdefault(name, []).append(path)
        for name, files in by_reader.items():
            for group in [files] if READERS[name].merging else ([path] for path in files):
                specs_of.setdefault((name, tuple(group)), []).append(spec)
    layers: list[RawLayer] = []
    for count, ((name, sources), group_specs) in enumerate(specs_of.items(), start=1):
        source = sources if len(sources) > 1 else sources[0]
        options: dict[str, Any] = {"area": area} if READERS[name].pruning else {}
        options["crs"] = None if crs is None else crs_text(crs)
        layers.extend(reader(name)(source, group_specs, filters=filters, **options))
        if progress is not None:
            progress(count, len(specs_of))
    layers += [derived_layer(spec) for spec in specs if spec.derive is not None]
    order = {spec.name: number for number, spec in enumerate(specs)}
    return tuple(sorted(layers, key=lambda layer: order[layer.spec.name])), absent


def assemble(
    layers: Sequence[RawLayer],
    catalog: Catalog,
    *,
    metric_crs: AnyCrs | None = None,
    collapse: bool = True,
    merge: bool = True,
    counted: Sequence[RawLayer] = (),
    max_distortion: float = MAX_DISTORTION,
    keep_far: bool = False,
    notes: Sequence[str] = (),
) -> Loaded:
    """Transform raw layers to one metric CRS, and merge objects that occur in several layers.

    Parameters
    ----------
    layers : sequence of RawLayer
        Layers that were read or fetched.
    catalog : Catalog
        Catalogue with the classes, the metric CRS and the radii for merging.
    metric_crs : int, str or pyproj.CRS, optional
        Metric CRS; by default that of the catalogue, or else the UTM zone of the data.
    collapse : bool, default True
        Whether objects of one class at the same place become one.
    merge : bool, default True
        Whether objects of different layers are merged by the catalogue's radii.
    counted : sequence of RawLayer
        Further layers that are only counted, not included; the counts are in the report.
    max_distortion : float, default 6
        Maximum error of bearings in degrees, and of lengths in percent, over the data.
    keep_far : bool, default False
        Whether objects and layers far from all others are kept.
    notes : sequence of str
        Warnings from reading, to be included in the result.

    Returns
    -------
    Loaded
        The objects and counts of rows; objects far from all others are misplaced. CrsError if the
        CRS is not metric, a layer has none or is outside its area of use, or the distortion is too
        large; EmptyResultError if no object remains.

    Examples
    --------
    >>> from semsig_gis import CitySpec, assemble, load_catalog, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> assemble(layers, load_catalog("openstreetmap")).objects.crs.name
    'WGS 84 / UTM zone 31N'
    """
    layers, system, extent_notes = settle_extent(
        [note_outside(layer) for layer in layers],
        crs=metric_crs or catalog.metric_crs,
        max_distortion=max_distortion,
        keep_far=keep_far,
    )
    notes = (*notes, *extent_notes)
    buildings, building_reports = _surroundings(layers, "buildings", system)
    streets, street_reports = _surroundings(layers, "streets", system)
    layers = derived_layers(
        layers,
        streets=streets,
        buildings=buildings,
        crs=system,
        within=covered_area(layers, system),
    )
    of_objects = [layer for layer in layers if layer.spec.role == "objects"]
    taxonomy = _taxonomy_of(catalog, of_objects)
    names = {item.name for item in taxonomy.classes}
    radii = {name: radius for name, radius in catalog.conflate if name in names and merge}
    objects, report = build_objects(
        of_objects,
        taxonomy=taxonomy,
        crs=system,
        collapse=collapse,
        apart=radii,
    )
    merged = ConflationReport(())
    if radii:
        objects, merged = conflate(objects, radii)
    fronts = 0
    if buildings is not None and len(buildings):
        objects, fronts = moved_to_fronts(objects, buildings, streets)
    report = LoadReport(
        (*report.layers, *building_reports, *street_reports),
        _unread(catalog, layers, counted),
        fronts,
    )
    return Loaded(
        objects=with_notes(objects, (*notes, *report.notes)),
        report=report,
        conflation=merged,
        buildings=buildings,
        streets=streets,
        notes=notes,
    )


def _taxonomy_of(catalog: Catalog, layers: Sequence[RawLayer]) -> Taxonomy:
    """Return the classes of a catalogue, without those that are seen from far and no layer has.

    The longest range decides how coarsely a database stores distances.
    """
    names = {name for layer in layers for name in layer.spec.classes}
    usual = SignatureSpec().radius
    return Taxonomy(
        tuple(
            item
            for item in catalog.taxonomy.classes
            if item.name in names or (item.range_m or usual) <= usual
        )
    )


def _unread(
    catalog: Catalog, layers: Sequence[RawLayer], counted: Sequence[RawLayer]
) -> tuple[UnreadLayer, ...]:
    """Return the layers of objects in the catalogue that were not read."""
    read = {layer.spec.name for layer in layers}
    numbers: Counter[str] = Counter()
    for layer in counted:  # several may have the same name
        numbers[layer.spec.name] += layer.counts.kept
    return tuple(
        UnreadLayer(spec.name, spec.classes, numbers.get(spec.name))
        for spec in catalog.layers
        if spec.role == "objects" and spec.name not in read
    )


def _surroundings(
    layers: Sequence[RawLayer], role: Literal["buildings", "streets"], crs: CRS
) -> tuple[gpd.GeoDataFrame | None, tuple[LayerReport, ...]]:
    """Return the valid buildings or streets of all layers, and the reports of the layers."""
    of_role = [layer for layer in layers if layer.spec.role == role]
    if not of_role:
        return None, ()
    import pandas as pd  # noqa: PLC0415 - 0.4 s

    kind = KIND_OF[role]
    tables, reports = [], []
    for layer in of_role:
        table = layer.table.to_crs(crs)
        nowhere = (table.geometry.isna() | table.geometry.is_empty).to_numpy(bool)
        other = ~nowhere & (shapely.get_dimensions(table.geometry.array) != DIMENSIONS[kind])
        xy, row = shapely.get_coordinates(table.geometry.array, return_index=True)
        far = np.zeros(len(table), bool)
        far[row[~(np.abs(xy) < BEYOND_EARTH_M).all(axis=1)]] = True  # also for NaN
        far &= ~(nowhere | other)
        counts = replace(
            layer.counts,
            unreadable=layer.counts.unreadable + int(other.sum()),
            missing=int(nowhere.sum()),
            misplaced=layer.counts.misplaced + int(far.sum()),
        )
        reports.append(LayerReport(layer.spec.name, counts, (*layer.notes, *layer.errors), role))
        tables.append(table[~(nowhere | other | far)])
    table = pd.concat(tables, ignore_index=True).drop(columns=CLASS_NAME)
    table.attrs[LICENSES] = [str(licence) for licence in layer_licences(of_role)]
    return table, tuple(reports)
