"""Convert a GeoDataFrame to street objects, by OpenStreetMap tags, classes or a catalogue."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import geopandas as gpd

from semsig_gis.core import (
    GROUP,
    HEIGHT,
    LICENSES,
    SOURCE_ID,
    TEXTS,
    CrsError,
    EmptyResultError,
    InputError,
    Taxonomy,
    listed,
    nearest_name,
)
from semsig_gis.objects.layers import assemble, choose_layers
from semsig_gis.objects.table import Licence
from semsig_gis.sources import (
    TAGS_READER,
    Catalog,
    ClassBy,
    LayerSpec,
    RowRules,
    Rows,
    as_text,
    built_in_taxonomy,
    frame_fields,
    frame_layers,
    has_element_columns,
    has_tag_columns,
    load_catalog,
    paper_taxonomy,
    raw_layer,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.core import AnyCrs, ObjectClass
    from semsig_gis.objects.table import StreetObjects
    from semsig_gis.sources import RawLayer

WHERE = "the table"
COLUMNS_SHOWN, NAMES_SHOWN = 12, 5
CLASS_NAME_FORM = re.compile("[a-z][a-z0-9_]*")


def objects_from_frame(
    frame: gpd.GeoDataFrame,
    *,
    class_column: str | None = None,
    new_classes: Sequence[str | ObjectClass] = (),
    tags: bool = False,
    catalog: Catalog | str | Path | None = None,
    layers: Sequence[str] = (),
    metric_crs: AnyCrs | None = None,
) -> StreetObjects:
    """Convert a GeoDataFrame to street objects.

    A table of OpenStreetMap elements, as from osmnx or QuackOSM, needs no other parameter. Its tags
    are in columns of their own, or in a column ``tags`` (a map, JSON, or hstore text).

    Parameters
    ----------
    frame : GeoDataFrame
        One row per feature, in any CRS. A feature that is not a point is placed at its centroid.
    class_column : str, optional
        Column of class names; rows without a value are omitted. The classes are those of
        `catalog`, or of all built-in catalogues. Columns such as ``name``, ``height`` and ``group``
        are kept, as `StreetObjects` has them.
    new_classes : sequence of str or ObjectClass, optional
        Further classes in this column, by name (see `Taxonomy.extended`).
    tags : bool, default False
        Whether the columns are OpenStreetMap tags; not needed for a table with identifiers of
        elements (such as ``element`` and ``id``, ``feature_id``, or ``osm_id``).
    catalog : Catalog, str or Path, optional
        Catalogue of the layers: ``openstreetmap`` by tags, any other by the fields of its layers.
    layers : sequence of str, optional
        Layers of the catalogue, as in `choose_layers`.
    metric_crs : int, str or pyproj.CRS, optional
        Metric CRS; by default that of the catalogue, or else the UTM zone of the data.

    Returns
    -------
    StreetObjects
        The objects. With `class_column`, the licences are ``frame.attrs["licenses"]``.

    Raises
    ------
    InputError
        If the contents of the table are not clear, or a value of the column is not a class.
    CrsError
        If it has no CRS.
    EmptyResultError
        If no row is a street object.

    Examples
    --------
    >>> import geopandas as gpd
    >>> from shapely import Point
    >>> frame = gpd.GeoDataFrame(
    ...     {"kind": ["bench", "street_light", None]},
    ...     geometry=[Point(2.35, 48.85), Point(2.351, 48.85), Point(2.352, 48.85)],
    ...     crs="EPSG:4326",
    ... )
    >>> len(objects_from_frame(frame, class_column="kind"))
    2
    """
    _require_frame(frame)
    if tags and (class_column is not None or catalog is not None):
        raise InputError(
            "tags were given together with a column of classes or a catalogue; give one of them."
        )
    if isinstance(catalog, str | Path):
        catalog = load_catalog(catalog)
    if class_column is not None:
        return _by_column(frame, class_column, new_classes, catalog, metric_crs=metric_crs)
    if new_classes:
        raise InputError("new_classes were given without class_column; name the column as well.")
    if catalog is None:
        _require_tags(frame, with_elements=not tags)
        catalog = load_catalog("openstreetmap")
    specs = [spec for spec in choose_layers(catalog, layers) if spec.derive is None]
    by_tags = tuple(spec for spec in specs if spec.reader == TAGS_READER)
    if by_tags:
        _require_tags(frame)
        raw = frame_layers(frame, by_tags)
    else:
        raw = (_by_fields(frame, specs, catalog),)
    if not any(map(len, raw)):
        raise EmptyResultError(
            f"none of the {len(frame):,} rows of the table is a street object of catalogue "
            f"{catalog.name!r}; check their tags or fields (`semsig sources` lists what is read)."
        )
    return assemble(raw, catalog, metric_crs=metric_crs).objects


def _require_frame(frame: object) -> None:
    """Raise an error if `frame` is not a GeoDataFrame with geometry and CRS."""
    if isinstance(frame, str | Path):
        raise InputError(
            f"the path {frame} was given; give what open_objects returns for a file of street "
            "objects, or load for another file."
        )
    if not isinstance(frame, gpd.GeoDataFrame):
        raise InputError(
            f"a {type(frame).__name__} was given; give a GeoDataFrame, or what load or "
            "open_objects returns for a file."
        )
    if frame.active_geometry_name is None:
        raise InputError("the table has no geometry; state it with set_geometry.")
    if frame.crs is None:
        raise CrsError("the table has no coordinate reference system; state it with set_crs.")


def _require_tags(frame: gpd.GeoDataFrame, *, with_elements: bool = False) -> None:
    """Raise InputError if a table has no OpenStreetMap tags, or no identifiers of elements."""
    fields = frame_fields(frame)
    accepted = has_element_columns if with_elements else has_tag_columns
    if accepted(fields):
        return
    names = ", ".join(fields[:COLUMNS_SHOWN]) + (", ..." if len(fields) > COLUMNS_SHOWN else "")
    if with_elements and has_tag_columns(fields):
        msg = (
            f"the table does not say what its columns ({names}) are; give tags=True if they are "
            "tags of OpenStreetMap, or else class_column or catalog."
        )
    else:
        msg = (
            f"the table has no tags of OpenStreetMap among its columns ({names}); give it to "
            "objects_from_frame with class_column, the column of the classes, or a catalog."
        )
    raise InputError(msg)


def _by_column(
    frame: gpd.GeoDataFrame,
    column: str,
    new_classes: Sequence[str | ObjectClass],
    catalog: Catalog | None,
    *,
    metric_crs: AnyCrs | None,
) -> StreetObjects:
    """Return the objects of a table with a column of class names."""
    taxonomy = built_in_taxonomy() if catalog is None else catalog.taxonomy
    taxonomy = taxonomy.extended(new_classes)
    names = [item.name for item in taxonomy.classes]
    spec = LayerSpec(
        name="frame",
        class_name="",
        class_by=ClassBy(column, tuple((name, name) for name in names)),
        id_field=SOURCE_ID if SOURCE_ID in frame else None,
        texts=tuple((name, name) for name in TEXTS if name in frame and name != column),
        height_field=HEIGHT if HEIGHT in frame else None,
        group_field=GROUP if GROUP in frame else None,
    )
    layer = _by_rules(frame, spec)
    unknown = [str(value) for value in frame[column].dropna().unique() if value not in names]
    if unknown:
        usable = [name for name in unknown if CLASS_NAME_FORM.fullmatch(name)]
        advice = (
            f"new_classes={usable[:NAMES_SHOWN]} adds what is missing"
            if usable
            else "new_classes adds names of lower-case letters, digits and underscores"
        )
        raise InputError(
            f"column {column!r} contains {unknown[0]!r}, which is not a "
            f"class{nearest_name(unknown[0], names)}; the classes are {listed(names)}; "
            f"{advice}, and rows without a class are left out."
        )
    layer = replace(layer, notes=())  # rows without a class are intended, not worth a note
    if catalog is None:
        more = {item if isinstance(item, str) else item.name for item in new_classes}
        used = {item.name for item in paper_taxonomy().classes} | {*frame[column]} | more
        taxonomy = Taxonomy(tuple(item for item in taxonomy.classes if item.name in used))
    catalog = catalog or Catalog(name="frame", title="Table", taxonomy=taxonomy, layers=(spec,))
    catalog = replace(catalog, taxonomy=taxonomy, layers=(spec,))
    objects = assemble([layer], catalog, metric_crs=metric_crs).objects
    lines = frame.attrs.get(LICENSES, ())
    return replace(objects, licenses=tuple(map(Licence, lines))) if lines else objects


def _by_fields(frame: gpd.GeoDataFrame, specs: Sequence[LayerSpec], catalog: Catalog) -> RawLayer:
    """Return the only layer of a catalogue that has its fields in a table; else InputError."""
    fields = set(frame_fields(frame))
    matches = [spec for spec in specs if fields.issuperset(name for _, name in spec.fields)]
    if len(matches) != 1:
        what = "several of them" if matches else "none of them"
        names = ", ".join(spec.name for spec in (matches or specs))
        raise InputError(
            f"the table fits {what} of the layers of catalogue {catalog.name!r} ({names}); give "
            "the right one as layers, or the column of its classes as class_column."
        )
    return _by_rules(frame, matches[0])


def _by_rules(frame: gpd.GeoDataFrame, spec: LayerSpec) -> RawLayer:
    """Return the layer of a table that the rules of a layer spec select."""
    levels = [name for name in frame.index.names if name is not None and name not in frame]
    table = frame.reset_index(level=levels) if levels else frame
    rules = RowRules(spec, [str(name) for name in table.columns], filters=True, where=WHERE)
    missing = table[list(rules.fields)].isna()
    values = table[list(rules.fields)].astype(object).mask(missing, None)
    rows = Rows(
        {field: values[field].to_list() for field in rules.fields},
        read=len(table),
        numbers=list(range(1, len(table) + 1)),
        names=[as_text(name) for name in table.index],
        positions=table.geometry.to_list(),
    )
    return raw_layer(rows, rules, table.crs, by_file=True)
