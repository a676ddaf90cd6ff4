"""What the layers of streets and of buildings have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from semsig_gis.core import HALF_WIDTH, NAME
from semsig_gis.objects import licenses_of
from semsig_gis.output.layers.columns import form_of
from semsig_gis.output.layers.model import Display, table_layer
from semsig_gis.output.layers.styles import Style, StyleClass

if TYPE_CHECKING:
    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.output.layers.model import Layer
    from semsig_gis.output.layers.styles import Symbol

FORM = form_of(f"""
[Ground]
{NAME} = ["Name", "Where the source has one."]
{HALF_WIDTH} = ["Half width", "From the middle of the street to its edge.", "m", 1]
""")
AROUND_M = 250.0
LARGEST_LABELLED = 8000  # denominator of the scale


def ground_layer(
    database: SignatureDatabase,
    table: gpd.GeoDataFrame,
    around: NDArray[np.object_] | None,
    *,
    name: str,
    symbol: Symbol,
    **about: Any,  # noqa: ANN401 - as `Layer` has
) -> Layer:
    """Return a layer of streets or buildings below all other layers, in the CRS of a database.

    It has what is within 250 m of shapes, by default of the box of the cells.
    """
    if around is None:
        xy = database.xy
        around = np.array([shapely.box(*xy.min(axis=0), *xy.max(axis=0))])
    places = table.to_crs(database.crs)
    _, near = places.sindex.query(around, predicate="dwithin", distance=AROUND_M)
    columns = [column for column in (NAME, HALF_WIDTH) if column in places]
    rows = places.iloc[np.unique(near)][[*columns, places.geometry.name]]
    text = f'"{NAME}"' if NAME in table else ""
    return table_layer(
        rows.explode(index_parts=False),
        name=name,
        licenses=licenses_of(table),
        facts={},
        form=FORM,
        display=Display(
            level=-1 if about["geometry"] == "line" else -2,
            group="Ground",
            name=text,
            label=text and f"case when @map_scale < {LARGEST_LABELLED} then {text} end",
        ),
        styles=(Style(name="Plain", classes=(StyleClass(label="", symbol=symbol),)),),
        **about,
    )
