"""Quality of a load of street objects: counts, densities, extent and distortion.

A density needs an area, and the data does not define one. Two are used, and named wherever a
density is shown: the convex hull of all objects, which includes empty areas between them (a river,
a park, the sea), and the squares of 100 m on the metric grid that contain an object of any class.
These exclude empty ground, but their number grows with the number of objects. The true density is
mostly between the two.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import shapely

from semsig_gis.core import (
    COUNT,
    SOURCE,
    SOURCE_ID,
    Displayed,
    crs_label,
    degree_bounds,
    plane_distortion,
    town_of,
)
from semsig_gis.storage import whole_numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Distortion, ObjectClass, Town
    from semsig_gis.objects.conflation import ConflatedPair, ConflationReport
    from semsig_gis.objects.layers import LayerReport, LoadReport, UnreadLayer
    from semsig_gis.objects.table import StreetObjects


SQUARE_M = 100.0
M2_PER_KM2 = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassQuality:
    """Number and density of the objects of one class, after collapsing and conflation.

    An extended thing counts as one object; `points` is the number of points that such things are
    stored as, 0 for a class of points. `rows` is the number of rows of the sources that they were
    made of. `per_km2_hull` is None if the hull has no area; `nearest_m` is the median distance in
    metres to the nearest other object of the class, None for a single object and extended things.
    """

    class_name: str
    title: str
    objects: int
    rows: int
    per_km2_hull: float | None
    per_km2_occupied: float
    nearest_m: float | None
    family: str = ""
    points: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TextColumn:
    """A column of what is written on objects: how many have a text, and its bytes, compressed."""

    name: str
    objects: int
    bytes: int


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class QualityReport(Displayed):
    """The quality report of a load.

    `classes` are the classes with objects in the order of the taxonomy, `absent` the classes of the
    loaded layers without objects; classes only in `unread` layers are in neither. `sources` are in
    the order of loading. `crs` is a code, or else a name. Extents are west, south, east and north,
    in metres and in degrees of WGS 84; `town` is the nearest one of the middle of all objects.
    `hull_km2` is the area of their convex hull, `occupied_km2` the area of the squares of 100 m
    that contain an object. `fronts` objects were moved to the fronts of their buildings, `derived`
    objects were computed from streets and buildings, and `texts` are the columns of what is written
    on objects. `notes` are warnings about the whole load; warnings about a layer are in `sources`.
    """

    classes: tuple[ClassQuality, ...]
    absent: tuple[str, ...]
    sources: tuple[LayerReport, ...]
    conflated: tuple[ConflatedPair, ...]
    crs: str
    extent: tuple[float, float, float, float]
    extent_degrees: tuple[float, float, float, float]
    town: Town
    distortion: Distortion
    hull_km2: float
    occupied_km2: float
    licenses: tuple[str, ...]
    unread: tuple[UnreadLayer, ...] = ()
    notes: tuple[str, ...] = ()
    fronts: int = 0
    derived: int = 0
    texts: tuple[TextColumn, ...] = ()

    def _facts(self) -> dict[str, object]:
        return {
            "objects": self.objects,
            "classes": len(self.classes),
            "absent": len(self.absent),
            "sources": len(self.sources),
            "hull": f"{self.hull_km2:.2f} km²",
            "CRS": self.crs,
            "notes": len(self.notes),
        }

    @property
    def objects(self) -> int:
        """Number of objects of all classes."""
        return sum(item.objects for item in self.classes)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and ``objects``, their number, as plain values for JSON."""
        sources = [
            {"name": item.name}
            | asdict(item.counts)
            | {"kept": item.counts.kept, "role": item.role, "notes": item.notes}
            for item in self.sources
        ]
        distortion = self.distortion.to_dict()
        plain = {**asdict(self), "sources": sources, "distortion": distortion}
        return {"objects": self.objects, **plain}


def quality_report(
    objects: StreetObjects,
    load: LoadReport,
    conflation: ConflationReport | None = None,
    *,
    notes: Sequence[str] = (),
) -> QualityReport:
    """Build a report on the quality of loaded street objects.

    Parameters
    ----------
    objects : StreetObjects
        The loaded objects, after conflation if it was used.
    load : LoadReport
        The report of `build_objects`.
    conflation : ConflationReport, optional
        The report of `conflate`, if it was used.
    notes : sequence of str
        Warnings about the whole load.

    Returns
    -------
    QualityReport
        The report.

    Examples
    --------
    >>> from semsig_gis import CitySpec, assemble, load_catalog, quality_report, synthetic_city
    >>> loaded = assemble(synthetic_city(CitySpec(size=300.0)), load_catalog("openstreetmap"))
    >>> quality_report(loaded.objects, loaded.report).classes[0].class_name
    'alignment_tree'
    """
    xy = objects.xy
    hull_km2 = float(shapely.area(shapely.convex_hull(shapely.multipoints(xy)))) / M2_PER_KM2
    squares = np.unique(np.floor(xy / SQUARE_M), axis=0)
    occupied_km2 = len(squares) * SQUARE_M**2 / M2_PER_KM2
    west, south = xy.min(axis=0).tolist()
    east, north = xy.max(axis=0).tolist()
    pairs = conflation.pairs if conflation is not None else ()
    present = set(np.unique(objects.codes).tolist())
    loaded_classes = {name for layer in load.layers for name in layer.classes}
    return QualityReport(
        classes=tuple(
            _class_quality(objects, item, hull_km2=hull_km2, occupied_km2=occupied_km2)
            for item in objects.taxonomy.classes
            if item.code in present
        ),
        absent=tuple(
            item.name
            for item in objects.taxonomy.classes
            if item.name in loaded_classes and item.code not in present
        ),
        sources=tuple(_sources(load.layers, pairs)),
        conflated=pairs,
        crs=crs_label(objects.crs),
        extent=(west, south, east, north),
        extent_degrees=degree_bounds(objects.crs, (west, south, east, north)),
        town=town_of(xy, objects.crs),
        distortion=plane_distortion(objects.crs, (west, south, east, north)),
        hull_km2=hull_km2,
        occupied_km2=occupied_km2,
        licenses=tuple(map(str, objects.licenses)),
        unread=load.unread,
        notes=tuple(notes),
        fronts=load.fronts,
        derived=sum(layer.counts.kept for layer in load.layers if layer.derived),
        texts=_text_columns(objects),
    )


def _text_columns(objects: StreetObjects) -> tuple[TextColumn, ...]:
    texts = objects.texts
    if texts is None:
        return ()
    columns = []
    for name in texts.column_names:
        values = [text for text in texts[name].to_pylist() if text]
        size = len(pa.compress("\0".join(values).encode(), codec="zstd", asbytes=True))
        columns.append(TextColumn(name=name, objects=len(values), bytes=size))
    return tuple(columns)


def _class_quality(
    objects: StreetObjects, item: ObjectClass, *, hull_km2: float, occupied_km2: float
) -> ClassQuality:
    members = objects.codes == item.code
    number = int(members.sum())
    rows = int(whole_numbers(objects.arrow[COUNT])[members].sum())
    points = 0
    if objects.groups is not None and (objects.groups[members] >= 0).any():
        points = number
        number = len(np.unique(objects.groups[members]))
        ids = objects.arrow.select([SOURCE, SOURCE_ID]).filter(pa.array(members))
        rows = len(ids.group_by([SOURCE, SOURCE_ID]).aggregate([]))
    return ClassQuality(
        class_name=item.name,
        title=item.title,
        objects=number,
        rows=rows,
        per_km2_hull=number / hull_km2 if hull_km2 > 0 else None,
        per_km2_occupied=number / occupied_km2,
        nearest_m=None if points else _nearest(objects.xy[members]),
        family=item.family,
        points=points,
    )


def _nearest(xy: NDArray[np.float64]) -> float | None:
    """Return the median distance to the nearest other point; None for a single point."""
    if len(xy) == 1:
        return None
    # As complex numbers, which numpy sorts faster than rows.
    flat = np.ascontiguousarray(xy).view(np.complex128).ravel()
    places, counts = np.unique(flat, return_counts=True)
    single = counts == 1
    # Points at the same place have the distance 0; the query of the tree ignores equal points.
    distances = np.zeros(len(xy))
    if single.any():
        points = np.asarray(shapely.points(places.real, places.imag))
        _, nearest = shapely.STRtree(points).query_nearest(
            points[single], exclusive=True, all_matches=False, return_distance=True
        )
        distances[: len(nearest)] = nearest
    return float(np.median(distances))


def _sources(
    layers: Sequence[LayerReport], pairs: Iterable[ConflatedPair]
) -> Iterator[LayerReport]:
    """Yield the reports of all layers, with the number of conflated rows added."""
    merged: Counter[str] = Counter()
    for pair in pairs:
        merged[pair.merged] += pair.count
    for layer in layers:
        # Conflation treats layers of the same name as one source; the first ones are counted first.
        conflated = min(layer.counts.kept, merged[layer.name])
        merged[layer.name] -= conflated
        yield replace(layer, counts=replace(layer.counts, conflated=conflated))
