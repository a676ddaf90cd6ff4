"""Raw layers, as readers return them, from geometries."""

from __future__ import annotations

from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np

from semsig_gis.sources import LayerSpec, RawLayer, RowCounts

if TYPE_CHECKING:
    from collections.abc import Sequence


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
