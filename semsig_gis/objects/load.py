"""From files to street objects, and what surrounds them: read, in one metric CRS, merged."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.core import (
    CLASS_CODE,
    CLASS_NAME,
    COUNT,
    LICENSES,
    SOURCE,
    SOURCE_ID,
    CrsError,
    Displayed,
    EmptyResultError,
    InputError,
    require_metric_crs,
)
from semsig_gis.objects.conflation import ConflationReport, conflate
from semsig_gis.objects.extent import BEYOND_EARTH_M, MAX_DISTORTION, settle_extent
from semsig_gis.objects.surroundings import DIMENSIONS, KIND_OF
from semsig_gis.objects.table import StreetObjects, layer_licences, layer_note
from semsig_gis.sources import (
    MERGING,
    PRUNING,
    TAGS_READER,
    file_reader,
    find_files,
    note_outside,
    paper_taxonomy,
    reader,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.core import Taxonomy
    from semsig_gis.sources import Area, Catalog, LayerSpec, RawLayer, Role, RowCounts


# Two objects of a class within the same centimetre are one object listed twice.
SAME_PLACE_M = 0.01
# Column of the geometries that positions come from; dimensions of an area.
SHAPE = "shape"
AREA = 2


@dataclass(frozen=True, slots=True)
class LayerReport:
    """What became of one layer's rows; `notes` are warnings and messages on unreadable rows.

    `role` is that of the layer: street objects, buildings or streets. `classes` are those that its
    objects may have.
    """

    name: str
    counts: RowCounts
    notes: tuple[str, ...] = ()
    role: Role = "objects"
    classes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class UnreadLayer:
    """A layer of objects that was not read, and how many it has; None where nobody counted."""

    name: str
    classes: tuple[str, ...]
    objects: int | None = None


@dataclass(frozen=True, repr=False, slots=True)
class LoadReport(Displayed):
    """What became of every layer, in the order they were given, and which were not read."""

    layers: tuple[LayerReport, ...]
    unread: tuple[UnreadLayer, ...] = ()

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
        """The notes on all layers, each with the name of its layer before it."""
        return tuple(layer_note(item.name, note) for item in self.layers for note in item.notes)


def build_objects(
    layers: Iterable[RawLayer],
    *,
    taxonomy: Taxonomy,
    crs: CRS | str,
    collapse: bool = True,
    apart: Collection[str] = (),
) -> tuple[StreetObjects, LoadReport]:
    """Turn raw layers into one table of street objects.

    A geometry that is not a point is represented by its centroid in the metric CRS (paper, section
    on semantic signatures). Rows without a usable position are dropped and counted.

    Parameters
    ----------
    layers : iterable of RawLayer
        What readers return. CrsError if one has no coordinate reference system.
    taxonomy : Taxonomy
        Classes that the layers name. UnknownNameError if it lacks one.
    crs : pyproj.CRS or str
        Metric coordinate reference system to work in.
    collapse : bool, default True
        Whether objects of one class at the same place (within the same centimetre) become one,
        with their number in ``count``. The place of an area is a point of its class in it, if any.
    apart : collection of str
        Classes that are collapsed within each layer only, because they will be conflated (see
        `conflate`), which keeps account of where objects came from.

    Returns
    -------
    objects : StreetObjects
        The objects, in the order of the layers; EmptyResultError if there is none.
    report : LoadReport
        What became of every row.

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
    parts = [_positions(layer, taxonomy, system) for layer in layers]
    if not any(len(part) for part, _, _ in parts):
        raise EmptyResultError(
            f"no object remains of {sum(layer.counts.read for layer in layers)} rows in "
            f"{len(layers)} layers; look at the filters, the area, the geometries and the "
            "coordinate systems."
        )
    everything = pd.concat([part for part, _, _ in parts], ignore_index=True)
    # By number, because two layers may bear one name.
    owner = np.repeat(np.arange(len(parts)), [len(part) for part, _, _ in parts])
    # An element of the map is the same in files of all kinds.
    unique = np.array([layer.spec.unique_id or bool(layer.spec.tags) for layer in layers])[owner]
    has_id = (everything[SOURCE_ID] != "") & unique
    # Of the id of an earlier row of the layer, as in a second file of it.
    again = (has_id & everything.duplicated([SOURCE, SOURCE_ID])).to_numpy(bool)
    repeated = np.bincount(owner[again], minlength=len(parts)).tolist()
    everything, owner = everything[~again].reset_index(drop=True), owner[~again]
    if collapse:
        codes = [taxonomy.by_name(name).code for name in apart]
        group = np.where(everything[CLASS_CODE].isin(codes), owner, -1)
        everything[["x", "y"]] = _at_points(everything, group)
        first, counts = _first_at_place(everything, group)
    else:
        first, counts = np.arange(len(everything)), np.ones(len(everything), np.int64)
    kept = everything.iloc[first].reset_index(drop=True)
    table = gpd.GeoDataFrame(
        {
            CLASS_CODE: kept[CLASS_CODE].to_numpy(np.uint8),
            SOURCE: kept[SOURCE].to_numpy(str).astype(object),
            SOURCE_ID: kept[SOURCE_ID].to_numpy(str).astype(object),
            COUNT: counts.astype(np.int32),
        },
        geometry=shapely.points(kept["x"].to_numpy(), kept["y"].to_numpy()),
        crs=system,
    )
    remaining = np.bincount(owner[first], minlength=len(parts)).tolist()
    reports = []
    for layer, (part, missing, misplaced), twice, kept_here in zip(
        layers, parts, repeated, remaining, strict=True
    ):
        dropped = replace(
            layer.counts,
            missing=missing,
            duplicates=layer.counts.duplicates + twice,
            misplaced=layer.counts.misplaced + misplaced,
            collapsed=len(part) - twice - kept_here,
        )
        reports.append(
            LayerReport(
                layer.spec.name,
                dropped,
                (*layer.notes, *layer.errors),
                classes=layer.spec.classes,
            )
        )
    report = LoadReport(tuple(reports))
    return StreetObjects(table, taxonomy, layer_licences(layers), report.notes), report


def _positions(layer: RawLayer, taxonomy: Taxonomy, crs: CRS) -> tuple[pd.DataFrame, int, int]:
    """Return the usable rows of a layer, and how many are missing and misplaced."""
    table = layer.table
    if table.crs is None:
        raise CrsError(
            f"layer {layer.spec.name!r} has no coordinate reference system; "
            "state its crs in the catalogue."
        )
    geometry = table.geometry
    usable = ~(geometry.isna() | geometry.is_empty).to_numpy(bool)
    shapes = geometry[usable]
    # In metres first: by degrees, a line that turns would have its middle elsewhere.
    shapes = (shapes if shapes.crs == crs else shapes.to_crs(crs)).to_numpy()
    others = shapely.get_type_id(shapes) != shapely.GeometryType.POINT
    points = shapes.copy()
    with np.errstate(invalid="ignore", over="ignore"):  # such rows are dropped below
        points[others] = shapely.centroid(shapes[others])
    # A broken geometry may have an empty centroid, which has no coordinates at all.
    xy = np.full((len(points), 2), np.nan)
    coordinates, row = shapely.get_coordinates(points, return_index=True)
    xy[row] = coordinates
    placed = (np.abs(xy) < BEYOND_EARTH_M).all(axis=1)  # false for NaN too
    codes = {name: taxonomy.by_name(name).code for name in table[CLASS_NAME].unique()}
    rows = table[usable][placed]
    part = pd.DataFrame(
        {
            SOURCE: layer.spec.name,
            SOURCE_ID: rows[SOURCE_ID].to_numpy(),
            CLASS_CODE: rows[CLASS_NAME].map(codes).to_numpy(),
            "x": xy[placed, 0],
            "y": xy[placed, 1],
            SHAPE: shapes[placed],
        }
    )
    return part, int((~usable).sum()), int((~placed).sum())


def _at_points(everything: pd.DataFrame, group: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return where objects are, an area at the first point of its group and class that is in it.

    They are one thing, drawn as both. Somebody has put the point where it stands, and several
    points in an area are several things.
    """
    xy = everything[["x", "y"]].to_numpy(copy=True)
    shapes = everything[SHAPE].to_numpy()
    areas = np.flatnonzero(shapely.get_dimensions(shapes) == AREA)
    points = np.flatnonzero(shapely.get_type_id(shapes) == shapely.GeometryType.POINT)
    area, point = shapely.STRtree(shapes[points]).query(shapes[areas], predicate="covers")
    area, point = areas[area], points[point]
    codes = everything[CLASS_CODE].to_numpy()
    same = (group[area] == group[point]) & (codes[area] == codes[point])
    order = np.lexsort((point[same], area[same]))
    area, first = np.unique(area[same][order], return_index=True)
    xy[area] = xy[point[same][order][first]]
    return xy


def _first_at_place(
    everything: pd.DataFrame, group: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first row of every group, class and place, in order, and how many share it."""
    places = np.rint(everything[["x", "y"]].to_numpy() / SAME_PLACE_M).astype(np.int64)
    keys = np.column_stack([group, everything[CLASS_CODE].to_numpy(np.int64), places])
    _, first, counts = np.unique(keys, axis=0, return_index=True, return_counts=True)
    order = np.argsort(first)
    return first[order], counts[order]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Loaded(Displayed):
    """What came of a load.

    Parameters
    ----------
    objects : StreetObjects
        The street objects.
    report, conflation : LoadReport, ConflationReport
        What became of every row, and what was merged between layers.
    buildings, streets : GeoDataFrame, optional
        Footprints (polygons) and centre lines in the CRS of the objects, where layers hold them;
        of streets whose widths a layer knows, ``half_width`` in metres, and whose names, ``name``.
    notes : tuple of str
        Warnings about all of it; those about a layer are in its report. The objects bear both.

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


# Which layers are read where none is named.
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
        Layers by name, which are read alone; with a plus sign before its name, as ``"+cameras"``,
        a layer is read as well. UnknownNameError if there is none of that name.
    selection : {"default", "paper", "all"}
        The layers that are read where none is named alone: those that are not optional, of these
        the paper's eleven classes only, or every layer of objects. InputError if layers are named
        alone as well.
    surroundings : bool, default False
        Whether buildings and streets are wanted too.

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
    >>> chosen = choose_layers(osm, ["+clocks"], selection="paper")
    >>> [spec.name for spec in chosen][-2:]
    ['bus_platforms', 'clocks']
    """
    alone = {catalog.layer(name).name for name in names if not name.startswith("+")}
    added = {catalog.layer(name[1:]).name for name in names if name.startswith("+")}
    if alone and selection != "default":
        raise InputError(
            f"layer {min(alone)!r} was given without a plus sign together with {selection} layers; "
            f"write '+{min(alone)}' to read it as well, or give only the layers to read."
        )
    chosen: list[LayerSpec | None] = []
    for spec in catalog.layers:
        if spec.name in alone | added or (spec.role != "objects" and surroundings):
            chosen.append(spec)
        elif spec.role == "objects" and not alone and (selection == "all" or not spec.optional):
            chosen.append(_of_the_paper(spec) if selection == "paper" else spec)
    return tuple(spec for spec in chosen if spec is not None)


def _of_the_paper(spec: LayerSpec) -> LayerSpec | None:
    """Return a layer without the classes that the paper lacks, or None if it has no other."""
    paper = {item.name for item in paper_taxonomy().classes}
    by = spec.class_by
    if by is None or paper.issuperset(spec.classes):
        return spec if paper.issuperset(spec.classes) else None
    # A value of such a class is still that value: no pattern below it may take it.
    classes = tuple((value, name if name in paper else "") for value, name in by.classes)
    class_name = spec.class_name if spec.class_name in paper else ""
    by = replace(by, classes=classes, otherwise=by.otherwise and class_name != "")
    own = replace(spec, class_name=class_name, class_by=by)
    return own if own.classes else None


def read_files(
    specs: Sequence[LayerSpec],
    paths: Iterable[str | Path],
    *,
    filters: bool = True,
    crs: str | None = None,
    area: Area | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[tuple[RawLayer, ...], tuple[LayerSpec, ...]]:
    """Read layers from local files, each file once, and extracts of OpenStreetMap as one.

    Parameters
    ----------
    specs : sequence of LayerSpec
        The layers to look for.
    paths : iterable of str or Path
        Files, and folders that hold them. SourceError if one does not exist, matches no layer, or
        cannot be read.
    filters : bool, default True
        Whether the filters of the layers apply.
    crs : str, optional
        CRS of files that state none.
    area : Area, optional
        What is wanted: of large files, what lies elsewhere need not be read (see `clip_layers`).
    progress : callable, optional
        Takes the number of files done and in all.

    Returns
    -------
    layers : tuple of RawLayer
        What was read, in the order of `specs`.
    absent : tuple of LayerSpec
        Layers that have no file among `paths`.

    Examples
    --------
    >>> from semsig_gis import SemsigError, choose_layers, load_catalog
    >>> try:
    ...     read_files(choose_layers(load_catalog("montpellier")), ["nowhere/"])
    ... except SemsigError as error:
    ...     print(error)
    nowhere does not exist; give a file or a folder of files.
    """
    pairs, absent = find_files(specs, paths)
    told = {
        path: file_reader(path) or TAGS_READER
        for path in {path for spec, path in pairs if spec.reader == TAGS_READER}
    }
    by_files: dict[tuple[str, tuple[Path, ...]], list[LayerSpec]] = {}
    for spec, found in itertools.groupby(pairs, key=lambda pair: pair[0]):
        by_reader: dict[str, list[Path]] = {}
        for _, path in found:
            name = told[path] if spec.reader == TAGS_READER else spec.reader
            by_reader.setdefault(name, []).append(path)
        for name, some in by_reader.items():
            for together in [some] if name in MERGING else ([path] for path in some):
                by_files.setdefault((name, tuple(together)), []).append(spec)
    layers: list[RawLayer] = []
    for done, ((name, (first, *more)), layers_of_files) in enumerate(by_files.items(), start=1):
        files = (first, *more) if more else first
        within = {"area": area} if name in PRUNING else {}
        layers.extend(reader(name)(files, layers_of_files, filters=filters, crs=crs, **within))
        if progress is not None:
            progress(done, len(by_files))
    order = {spec.name: number for number, spec in enumerate(specs)}
    return tuple(sorted(layers, key=lambda layer: order[layer.spec.name])), absent


def assemble(
    layers: Sequence[RawLayer],
    catalog: Catalog,
    *,
    metric_crs: str | None = None,
    collapse: bool = True,
    merge: bool = True,
    counted: Sequence[RawLayer] = (),
    max_distortion: float = MAX_DISTORTION,
    notes: Sequence[str] = (),
) -> Loaded:
    """Place raw layers in one metric CRS and merge what stands in several of them.

    Parameters
    ----------
    layers : sequence of RawLayer
        What was read or fetched.
    catalog : Catalog
        Whose classes, metric CRS and merging radii hold.
    metric_crs : str, optional
        CRS to work in; the catalogue's by default, or the UTM zone of the data where it has none.
    collapse : bool, default True
        Whether objects of one class at the same place become one.
    merge : bool, default True
        Whether objects of different layers are merged by the catalogue's radii.
    counted : sequence of RawLayer
        Layers that are none of the objects; the report tells how many they would add.
    max_distortion : float, default 6
        By how many degrees bearings, and by how many percent lengths, may be off over the data.
    notes : sequence of str
        Warnings of the reading, to be kept with those of this.

    Returns
    -------
    Loaded
        The objects and what became of every row; those far from all others are misplaced. CrsError
        if the CRS is not metric, a layer has none or lies where it cannot, or the plane is too far
        from the ground; EmptyResultError if no object remains.

    Examples
    --------
    >>> from semsig_gis import CitySpec, assemble, load_catalog, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> assemble(layers, load_catalog("openstreetmap")).objects.crs.name
    'WGS 84 / UTM zone 31N'
    """
    layers, system, more = settle_extent(
        [note_outside(layer) for layer in layers],
        crs=metric_crs or catalog.metric_crs,
        max_distortion=max_distortion,
    )
    of_all = (*notes, *more)
    objects, report = build_objects(
        [layer for layer in layers if layer.spec.role == "objects"],
        taxonomy=catalog.taxonomy,
        crs=system,
        collapse=collapse,
        apart=[name for name, _ in catalog.conflate] if merge else (),
    )
    merged = ConflationReport(())
    if merge and catalog.conflate:
        objects, merged = conflate(objects, dict(catalog.conflate))
    buildings, on_buildings = _surroundings(layers, "buildings", objects.crs)
    streets, on_streets = _surroundings(layers, "streets", objects.crs)
    report = LoadReport(
        (*report.layers, *on_buildings, *on_streets), _unread(catalog, layers, counted)
    )
    return Loaded(
        objects=replace(objects, notes=(*of_all, *report.notes)),
        report=report,
        conflation=merged,
        buildings=buildings,
        streets=streets,
        notes=of_all,
    )


def _unread(
    catalog: Catalog, layers: Sequence[RawLayer], counted: Sequence[RawLayer]
) -> tuple[UnreadLayer, ...]:
    """Return the layers of objects in the catalogue that are not among those read."""
    read = {layer.spec.name for layer in layers}
    numbers: Counter[str] = Counter()
    for layer in counted:  # of which there may be several of one name
        numbers[layer.spec.name] += layer.counts.kept
    return tuple(
        UnreadLayer(spec.name, spec.classes, numbers.get(spec.name))
        for spec in catalog.layers
        if spec.role == "objects" and spec.name not in read
    )


def _surroundings(
    layers: Sequence[RawLayer], role: Literal["buildings", "streets"], crs: CRS
) -> tuple[gpd.GeoDataFrame | None, tuple[LayerReport, ...]]:
    """Return the usable buildings or streets of all layers, and what became of their rows."""
    of_role = [layer for layer in layers if layer.spec.role == role]
    if not of_role:
        return None, ()
    kind = KIND_OF[role]
    tables, reports = [], []
    for layer in of_role:
        table = layer.table.to_crs(crs)
        nowhere = (table.geometry.isna() | table.geometry.is_empty).to_numpy(bool)
        other = ~nowhere & (shapely.get_dimensions(table.geometry.array) != DIMENSIONS[kind])
        far = ~(nowhere | other) & ~_on_earth(table.geometry.array)
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


def _on_earth(shapes: NDArray[np.object_]) -> NDArray[np.bool_]:
    """Tell which shapes have all of their coordinates on the Earth; false for NaN too."""
    xy, row = shapely.get_coordinates(shapes, return_index=True)
    placed = np.ones(len(shapes), bool)
    placed[row[~(np.abs(xy) < BEYOND_EARTH_M).all(axis=1)]] = False
    return placed
