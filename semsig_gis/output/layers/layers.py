"""Cells, objects, evaluations and answers as export layers that are read in blocks."""

from __future__ import annotations

import functools
import json
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow as pa
import shapely

from semsig_gis import __version__
from semsig_gis.core import (
    CLASS_CODE,
    CLASS_NAME,
    COUNT,
    GEOMETRY,
    MERGED,
    OUTCOMES,
    SOURCE,
    SOURCE_ID,
)
from semsig_gis.database import CellTable, database_specs
from semsig_gis.objects import objects_specs
from semsig_gis.output.styles import (
    AMBIGUITY,
    IDENTIFIABILITY,
    by_amount,
    by_answer,
    by_class,
    by_outcome,
    by_rank,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.core import Taxonomy
    from semsig_gis.database import CellGeometry, SignatureDatabase
    from semsig_gis.evaluation import Evaluation, Identifiability
    from semsig_gis.localization import Answer, SearchRegions
    from semsig_gis.objects import StreetObjects
    from semsig_gis.output.styles import Style

    Progress = Callable[[int, int], None] | None  # called with the numbers of rows: done, all


ROWS_A_BLOCK = 1 << 16
GEOMETRY_TYPES = {"polygon": "Polygon", "line": "LineString", "point": "Point"}
# Columns of queries that a GeoPackage moves to a separate table, because there are many of them.
FIGURE = re.compile(r"(p|near)\d+")


@dataclass(frozen=True, eq=False, kw_only=True)
class Layer:
    """A table, usually with geometry, that is read in blocks of rows to limit the memory."""

    name: str
    title: str
    description: str
    geometry: str  # polygon, line, point or none
    crs: CRS
    rows: int
    bounds: tuple[float, float, float, float]
    read: Callable[[slice], pa.Table]  # the geometry, as WKB, is the last column
    licenses: tuple[str, ...]
    facts: Mapping[str, Any]  # plain values for JSON
    styles: tuple[Style, ...] = ()  # the first is the default
    taxonomy: Taxonomy | None = None  # of the symbols in its texts
    reach: float = 1.0  # longest visibility range, metres

    @property
    def credits(self) -> dict[str, Any]:
        """Licences and program version, for the metadata of a file."""
        return {"licenses": list(self.licenses), "written_by": f"semsig_gis {__version__}"}

    @property
    def metadata(self) -> dict[str, Any]:
        """Facts and credits, for the metadata of a file."""
        return {**self.facts, **self.credits}

    @property
    def metadata_texts(self) -> dict[str, str]:
        """The metadata with each value as JSON text."""
        return {key: json.dumps(value, allow_nan=False) for key, value in self.metadata.items()}

    @property
    def abstract(self) -> str:
        """The description with the licences, a line each."""
        return "\n".join([self.description, *self.licenses])

    def blocks(self, progress: Progress = None) -> Iterator[pa.Table]:
        """Yield the rows in blocks; a layer without rows yields one empty block."""
        for low in range(0, max(self.rows, 1), ROWS_A_BLOCK):
            high = min(low + ROWS_A_BLOCK, self.rows)
            yield self.read(slice(low, high))
            if progress is not None:
                progress(high, self.rows)


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


def objects_layer(objects: StreetObjects) -> Layer:
    """Return the layer of the street objects."""
    classes = {item.code: item for item in objects.taxonomy.classes}
    texts = [SOURCE, SOURCE_ID, *([MERGED] if MERGED in objects.table.columns else [])]

    def read(rows: slice) -> pa.Table:
        table = objects.table.iloc[rows]
        row_classes = [classes[code] for code in objects.codes[rows].tolist()]
        return pa.table(
            {
                CLASS_CODE: objects.codes[rows],
                "symbol": [item.symbol for item in row_classes],
                CLASS_NAME: [item.name for item in row_classes],
                "title": [item.title for item in row_classes],
                **{name: pa.array(table[name].tolist(), pa.string()) for name in texts},
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
        facts={**objects_specs(objects), "crs": objects.crs.to_json_dict()},
        styles=(by_class(objects.taxonomy, objects.class_counts),),
        taxonomy=objects.taxonomy,
    )


def evaluation_layers(evaluation: Evaluation, database: SignatureDatabase) -> list[Layer]:
    """Return two layers: queries at their true places, and lines to their best places."""
    successful, failed = OUTCOMES
    outcomes = np.where(evaluation.successful, successful, failed)
    queries = evaluation.queries.assign(outcome=outcomes)
    # Lines need a best place that differs from the true place.
    placed = queries[queries["best_x"].notna().to_numpy()]
    truth = shapely.get_coordinates(placed.geometry.array)
    best = placed[["best_x", "best_y"]].to_numpy(np.float64)
    lines = placed[["seed", "number", "cell_id", "best_cell_id", "outcome", "error_m"]].assign(
        off_m=np.hypot(*(best - truth).T)
    )
    segments = shapely.linestrings(np.stack([truth, best], axis=1))
    lines = lines.set_geometry(segments, crs=queries.crs)
    lines = lines[lines["off_m"] > 0]
    summary = evaluation.summary()
    facts = {name: summary[name] for name in ("settings", "database", "versions")}
    layer = functools.partial(
        table_layer,
        licenses=database.licenses,
        facts=facts,
        taxonomy=database.taxonomy,
        reach=database.reach,
    )
    return [
        layer(
            queries,
            name="evaluation",
            title="Queries",
            description=(
                f"{len(queries)} queries at their true places; successful: the best place is "
                f"within {evaluation.success_metres} m with a probability of "
                f"{evaluation.success_probability:g} or more."
            ),
            geometry="point",
            styles=(by_outcome(geometry="point"),),
        ),
        layer(
            lines,
            name="evaluation_lines",
            title="From the true to the best place",
            description="Each query's true place, joined to the best place that was found for it.",
            geometry="line",
            styles=(by_outcome(geometry="line"),),
        ),
    ]


def split_figures(queries: Layer) -> list[Layer]:
    """Split the layer of queries: its other columns, and a table of figures by seed and number."""
    names = queries.read(slice(0, 0)).column_names
    figures = [name for name in names if FIGURE.fullmatch(name)]
    return [
        replace(queries, read=lambda rows: queries.read(rows).drop_columns(figures)),
        replace(
            queries,
            name="evaluation_figures",
            title="Figures of the queries",
            description="The chances of each query, of errors up to so many metres, and more.",
            geometry="none",
            styles=(),
            read=lambda rows: queries.read(rows).select(["seed", "number", *figures]),
        ),
    ]


def answer_layers(
    answer: Answer, database: SignatureDatabase, regions: SearchRegions
) -> list[Layer]:
    """Return layers of the regions to search, the candidates and, if estimated, the place."""
    candidates = answer.to_geodataframe()
    cells = CellTable(database.select(candidates["cell"].to_numpy()))
    columns = cells.columns(slice(0, len(candidates)))
    candidates = candidates.assign(bearings=columns["bearings"], distances=columns["distances"])
    facts = answer.to_dict()
    licenses, place = tuple(facts["licenses"]), facts.get("place")
    facts = {name: facts[name] for name in facts if name not in {"candidates", "crs", "licenses"}}
    facts["searched"] = regions.to_dict()
    layer = functools.partial(
        table_layer,
        licenses=licenses,
        facts=facts,
        taxonomy=answer.taxonomy,
        reach=database.reach,
    )
    layers = [
        layer(
            regions.table,
            name="regions",
            title="Regions to search",
            description="Where the query may have been seen from, the best first.",
            geometry="polygon",
            styles=(by_rank("rank", geometry="polygon"),),
        ),
        layer(
            candidates,
            name="candidates",
            title="Candidates",
            description="The best places or cells for the query.",
            geometry="point",
            styles=(by_rank(str(answer.candidates.columns[0]), geometry="point"),),
        ),
    ]
    if place is None:
        return layers
    row: dict[str, Any] = {"answer": "given" if facts["answered"] else "withheld"}
    row |= {name: value for name, value in place.items() if isinstance(value, (bool, int, float))}
    row |= {name: np.nan if facts[name] is None else facts[name] for name in ("elsewhere", "fit")}
    points = gpd.points_from_xy([place["x"]], [place["y"]])
    estimate = layer(
        gpd.GeoDataFrame(pd.DataFrame([row]), geometry=points, crs=answer.crs),
        name="place",
        title="Place",
        description="Where the query was most probably seen from, and how sure that is.",
        geometry="point",
        styles=(by_answer(),),
    )
    return [*layers, estimate]


def table_layer(frame: gpd.GeoDataFrame, **about: Any) -> Layer:  # noqa: ANN401 - as `Layer` has
    """Return a layer of a table in memory; numbers that are not finite become null."""
    shapes = frame.geometry
    columns = {}
    for column in frame.columns.drop(shapes.name):
        values = frame[column]
        if pd.api.types.is_float_dtype(values.dtype):
            numbers = values.to_numpy(np.float64)
            columns[column] = pa.array(numbers, mask=~np.isfinite(numbers))
        else:
            texts = pd.api.types.is_string_dtype(values.dtype)
            columns[column] = pa.Array.from_pandas(values, type=pa.string() if texts else None)
    table = pa.table({**columns, GEOMETRY: pa.array(shapely.to_wkb(shapes.array), pa.binary())})
    return Layer(
        **about,
        crs=shapes.crs,
        rows=len(table),
        bounds=tuple(shapes.total_bounds.tolist()),
        read=lambda rows: table.slice(rows.start, rows.stop - rows.start),
    )


def group_means(groups: NDArray[np.int64], values: NDArray[Any], count: int) -> NDArray[np.float64]:
    """Return the mean of the values in each group (float64, `count`); NaN in an empty group."""
    numbers = np.bincount(groups, minlength=count)
    means = np.full(count, np.nan)
    np.divide(np.bincount(groups, values, count), numbers, out=means, where=numbers > 0)
    return means
