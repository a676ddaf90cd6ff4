"""The layer of the street objects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import shapely

from semsig_gis.core import (
    CLASS_CODE,
    CLASS_NAME,
    COUNT,
    GEOMETRY,
    GROUP,
    HEIGHT,
    MERGED,
    SOURCE,
    SOURCE_ID,
    TEXTS,
)
from semsig_gis.objects import objects_specs
from semsig_gis.output.layers import LAYERS
from semsig_gis.output.layers.columns import form_of
from semsig_gis.output.layers.model import EXPORTED, Display, Layer
from semsig_gis.output.layers.styles import by_class

if TYPE_CHECKING:
    from semsig_gis.objects import StreetObjects

FORM = form_of("""
[Object]
title = ["Class", "What it is."]
symbol = ["Symbol", "Letter of its class."]
name = ["Name", "Name that people read on it or know it by."]
brand = ["Brand", "Brand on its sign."]
operator = ["Operator", "Who operates it."]
ref = ["Number on it", "Number or code that is written on it."]
house_number = ["House number", "Number of its house."]
street = ["Street", "Street of its address."]
height = ["Height", "Above the ground.", "m", 1]
group = ["Extended thing", "Points with the same number belong to one line or area."]
family = ["Family", "Family of its class."]
count = ["Objects", "How many objects of the source it stands for."]
class_code = ["Class number", "Number of its class; a new object needs only this."]
class_name = ["Class identifier", "Name of its class in catalogues."]
[Source]
source = ["Source", "Layer that it is from."]
source_id = ["Number at the source", "What the source calls it."]
merged = ["Also listed as", "The same object in other sources."]
""")
DISPLAY = Display(
    level=1,
    group="City",
    name="""coalesce("title", "class_name") || coalesce(' ' || "source_id", '')""",
    tip=("name", "brand", "ref", "street", "house_number", "source", "count"),
    nearer=6000,
)


@LAYERS.register
def objects_layer(objects: StreetObjects) -> Layer:
    """Return the layer of the street objects."""
    classes = {item.code: item for item in objects.taxonomy.classes}
    present = [name for name in (*TEXTS, MERGED) if name in objects.table.columns]
    texts = [SOURCE, SOURCE_ID, *present]
    groups, heights = objects.groups, objects.heights
    has_families = any(item.family for item in classes.values())

    def read(rows: slice) -> pa.Table:
        table = objects.table.iloc[rows]
        row_classes = [classes[code] for code in objects.codes[rows].tolist()]
        more: dict[str, Any] = {}
        if has_families:
            more["family"] = [item.family for item in row_classes]
        if heights is not None:
            more[HEIGHT] = pa.array(heights[rows], mask=np.isnan(heights[rows]))
        if groups is not None:
            more[GROUP] = pa.array(groups[rows], mask=groups[rows] < 0)
        return pa.table(
            {
                CLASS_CODE: objects.codes[rows],
                "symbol": [item.symbol for item in row_classes],
                CLASS_NAME: [item.name for item in row_classes],
                "title": [item.title for item in row_classes],
                **{name: pa.array(table[name].tolist(), pa.string()) for name in texts},
                **more,
                COUNT: table[COUNT].to_numpy(np.int32),
                GEOMETRY: shapely.to_wkb(table.geometry.array),
            }
        )

    return Layer(
        name="objects",
        title="Street objects",
        description=f"The {len(objects)} street objects.",
        geometry="point",
        crs=objects.crs,
        rows=len(objects),
        bounds=(*objects.xy.min(axis=0).tolist(), *objects.xy.max(axis=0).tolist()),
        read=read,
        licenses=tuple(map(str, objects.licenses)),
        facts={
            **objects_specs(objects),
            "crs": objects.crs.to_json_dict(),
            EXPORTED: len(objects),
        },
        form=FORM,
        display=DISPLAY,
        styles=(by_class(objects.taxonomy, objects.class_counts),),
        taxonomy=objects.taxonomy,
    )
