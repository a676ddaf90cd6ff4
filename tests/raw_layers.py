"""Raw layers, as readers return them, from geometries, and catalogues of few layers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import shapely

from semsig_gis.sources import Catalog, LayerSpec, RawLayer, RowCounts, paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Sequence


ENGINES = ("pyogrio, then fiona", "fiona", "pyogrio")
"""How vector files are read: usually, with fiona for all rows, and without fiona."""


def raw_layer(
    geometries: Sequence[object],
    *,
    name: str = "trees",
    classes: str | Sequence[str] = "alignment_tree",
    ids: Sequence[str] | None = None,
    crs: str | None = "EPSG:2154",
    attribution: str = "Town",
    filtered: int = 0,
    unreadable: int = 0,
    notes: tuple[str, ...] = (),
    unique_id: bool = False,
) -> RawLayer:
    """Return a raw layer."""
    size = len(geometries)
    names = [classes] * size if isinstance(classes, str) else list(classes)
    texts = {"class_name": names, "source_id": ids or [str(row) for row in range(size)]}
    table = gpd.GeoDataFrame(
        {column: np.array(values, dtype=object) for column, values in texts.items()},
        geometry=gpd.GeoSeries(list(geometries), crs=crs),
    )
    read = size + filtered + unreadable
    return RawLayer(
        spec=LayerSpec(
            name=name,
            class_name=names[0] if names else "alignment_tree",
            license="CC0",
            attribution=attribution,
            unique_id=unique_id,
        ),
        table=table,
        counts=RowCounts(read=read, filtered=filtered, unreadable=unreadable),
        errors=tuple(f"row {row}: broken" for row in range(min(unreadable, 10))),
        notes=notes,
    )


def ids(layer: RawLayer) -> list[str]:
    """Return the identifiers of the rows."""
    texts: list[str] = layer.table["source_id"].tolist()
    return texts


def xy(layer: RawLayer) -> list[tuple[float, float]]:
    """Return the centroids of the rows."""
    points = shapely.get_coordinates(shapely.centroid(layer.table.geometry.array))
    return [(x, y) for x, y in points.round(9).tolist()]


BENCHES = LayerSpec(name="benches", class_name="bench")


def catalog_of(**values: object) -> Catalog:
    """Return a catalogue with one layer, or with other values."""
    plain = {"name": "town", "title": "Town", "taxonomy": paper_taxonomy(), "layers": (BENCHES,)}
    return Catalog(**{**plain, **values})  # type: ignore[arg-type]
