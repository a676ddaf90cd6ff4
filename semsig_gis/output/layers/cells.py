"""The layer of the cells."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import pyarrow as pa
import shapely

from semsig_gis.core import (
    GEOMETRY,
)
from semsig_gis.database import CellTable, database_specs
from semsig_gis.output.layers.model import Layer
from semsig_gis.output.styles import (
    AMBIGUITY,
    IDENTIFIABILITY,
    by_amount,
)

if TYPE_CHECKING:
    from semsig_gis.database import CellGeometry, SignatureDatabase
    from semsig_gis.evaluation import Identifiability


def cells_layer(
    database: SignatureDatabase,
    *,
    identifiability: Identifiability | None = None,
    geometry: CellGeometry = "polygon",
) -> Layer:
    """Return the layer of the cells, as squares or as points."""
    cells = CellTable(database, geometry=geometry)
    if identifiability is not None:
        identifiability.require_cells_of(database)

    def read(rows: slice) -> pa.Table:
        columns = cells.columns(rows)
        if identifiability is not None:
            table = identifiability.table(rows)
            columns |= dict(zip(table.column_names, table.columns, strict=True))
        return pa.table({**columns, GEOMETRY: shapely.to_wkb(cells.shapes(rows))})

    step = database.grid.step
    crs = database.crs.to_json_dict()
    facts = {**database_specs(database), "crs": crs, "identifiability": None}
    style = functools.partial(by_amount, geometry=geometry, size=step)
    styles = [style("Ambiguity", "type_group_size", AMBIGUITY)]
    if identifiability is not None:
        facts["identifiability"] = identifiability.facts
        styles.insert(0, style("Identifiability", "chance_found", IDENTIFIABILITY))
    corners = [(axis.min(), axis.max()) for axis in (database.columns, database.rows)]
    (west, south), (east, north) = database.grid.viewpoints(*corners).tolist()
    margin = step / 2 if geometry == "polygon" else 0.0
    return Layer(
        name="cells",
        title="Signature cells",
        description=(
            f"Cells of {step:g} m with the street objects that are seen within "
            f"{database.spec.radius:g} m of their centre, clockwise from north."
        ),
        geometry=geometry,
        crs=database.crs,
        rows=len(database),
        bounds=(west - margin, south - margin, east + margin, north + margin),
        read=read,
        licenses=database.licenses,
        facts=facts,
        styles=tuple(styles),
        taxonomy=database.taxonomy,
        reach=database.reach,
    )
