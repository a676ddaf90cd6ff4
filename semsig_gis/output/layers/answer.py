"""The layers of an answer."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.core import VERDICTS, place_links
from semsig_gis.database import CellTable
from semsig_gis.localization import Location
from semsig_gis.output.layers.buildings import buildings_layer
from semsig_gis.output.layers.columns import form_of
from semsig_gis.output.layers.model import Display, table_layer
from semsig_gis.output.layers.streets import streets_layer
from semsig_gis.output.layers.styles import Style, StyleClass, Symbol, by_answer, by_rank

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Answer, Explanation, SearchRegions
    from semsig_gis.output.layers.model import Layer

LINKS = """
[Links]
openstreetmap = ["OpenStreetMap", "Address of a map of the place."]
google_street_view = ["Google Street View", "Address of photographs near the place."]
mapillary = ["Mapillary", "Address of photographs near the place."]
panoramax = ["Panoramax", "Address of photographs near the place."]
kartaview = ["KartaView", "Address of photographs near the place."]
"""
PLACE_FORM = form_of(
    """
[Place]
address = ["Place", "In words, by the streets and buildings around it."]
answer = ["Answer", "Given, or withheld where the chance is too small."]
chance = ["Chance", "Of the place being right, from 0 to 1.", "1", 2]
elsewhere = ["Chance of elsewhere", "Of the view not being from the area of the cells, from 0 to 1.", "1", 2]
fit = ["Fit", "Share of simulated views from the place that fit it worse, from 0 to 1; below 0.01, the query fits badly.", "1", 3]
within_m = ["Right within", "How near a right place is.", "m", 0]
x = ["East", "In the coordinate system of the layer.", "m", 2]
y = ["North", "In the coordinate system of the layer.", "m", 2]
lat = ["Latitude", "WGS 84.", "°", 7]
lon = ["Longitude", "WGS 84.", "°", 7]
sigma = ["Standard deviation", "Of the place in either direction, if it is right.", "m", 1]
longer_m = ["Ellipse, longer", "Half axis of the ellipse of 90 %, if the place is right.", "m", 1]
shorter_m = ["Ellipse, shorter", "The other half axis.", "m", 1]
bearing = ["Bearing of the ellipse", "Of its longer axis, clockwise from grid north.", "°", 0]
heading = ["Heading", "What is added to the bearings of the query to have them from north.", "°", 1]
heading_sigma = ["Standard deviation of the heading", "Of the heading.", "°", 1]
cell_id = ["Cell", "Number of the cell in the grid."]
refined = ["Off the grid", "Whether the place was looked for between the viewpoints, too."]
"""  # noqa: E501
    + LINKS
)
CANDIDATE_FORM = form_of(
    """
[Place]
address = ["Place", "In words, by the streets and buildings around it."]
rank = ["Rank", "1 is the best place for the query."]
rank_low = ["Rank from", "First rank that ties allow; 1 is the best."]
rank_high = ["Rank to", "Last rank that ties allow."]
tied = ["Tied cells", "How many cells are as good."]
chance = ["Chance", "Of the view being from this place, from 0 to 1.", "1", 2]
cell_chance = ["Chance of the cell", "Of the view being from its likeliest cell, from 0 to 1.", "1", 4]
distance = ["Distance of signatures", "Between the query and what is seen from the cell; 0 is equal.", "", 4]
loglik = ["Log-likelihood", "Of the query, were it seen from the cell; the higher the better.", "", 2]
heading = ["Heading", "What is added to the bearings of the query to have them from north.", "°", 1]
cell_id = ["Cell", "Number of the cell in the grid."]
cell = ["Row", "Number of the row in the database, from 0."]
x = ["Viewpoint, east", "In the coordinate system of the layer.", "m", 2]
y = ["Viewpoint, north", "In the coordinate system of the layer.", "m", 2]
["What is seen"]
length = ["Objects seen", "How many street objects are seen from the cell."]
types = ["Types", "Symbols of the objects, clockwise from north."]
bearings = ["Bearings", "Of the same objects, clockwise from grid north.", "°"]
distances = ["Distances", "Of the same objects.", "m"]
"""  # noqa: E501
    + LINKS
)
REGION_FORM = form_of("""
[Region]
rank = ["Rank", "1 is the region to be searched first."]
chance = ["Chance", "Of the place being in the region, if it is in the city, from 0 to 1.", "1", 2]
cells = ["Cells", "How many cells the region has."]
km2 = ["Area", "Of all its cells.", "km²", 4]
best_cell_id = ["Best cell", "Number of its best cell in the grid."]
best_x = ["Best cell, east", "In the coordinate system of the layer.", "m", 2]
best_y = ["Best cell, north", "In the coordinate system of the layer.", "m", 2]
["Searched up to here"]
searched_chance = ["Chance up to here", "Of the place being in this region or an earlier one, if it is in the city.", "1", 2]
searched_km2 = ["Area up to here", "Of this region and all before it.", "km²", 4]
searched_percent = ["Share of the city up to here", "Of the area of all cells.", "%", 3]
""")  # noqa: E501

OBJECT_FORM = form_of("""
[Object]
verdict = ["Verdict", "Whether the object of the query is a street object, and which."]
candidate = ["Candidate", "Rank of the place from which the objects are compared."]
chance = ["Chance", "Of the verdict being right, from 0 to 1.", "1", 2]
seen_title = ["Seen as", "Class of the object of the query."]
seen_text = ["Read", "Text that was read on the object of the query."]
seen_bearing = ["Bearing seen", "From the candidate, clockwise from grid north.", "°", 1]
seen_range = ["Distance seen", "From the candidate.", "m", 1]
object_title = ["Street object", "Class of the street object."]
object_text = ["Text there", "Text of the street object that is most like it."]
bearing = ["Bearing", "Of the street object.", "°", 1]
distance = ["Distance", "Of the street object.", "m", 1]
bearing_error = ["Off by", "From the bearing of the street object to that seen, clockwise.", "°", 1]
source = ["Source", "Of the street object."]
source_id = ["Identifier", "Of the street object in its source."]
""")

# Columns of a query with texts.
TEXTS_READ = ("seen_text", "object_text")
# Meaning of each verdict on an object, and the style of its ray; the default colour is that of
# `VERDICTS`.
RAYS: dict[str, tuple[str, dict[str, object]]] = {
    "matched": ("a street object", {"weight": 2, "opacity": 0.9, "dashArray": None}),
    "misnamed": ("one of another class", {"weight": 2, "opacity": 0.9, "dashArray": "9 4"}),
    "missed": (
        "a street object not in the query",
        {"color": "#808080", "weight": 1, "opacity": 0.9, "dashArray": "3 5"},
    ),
    "false": ("no street object", {"weight": 2, "opacity": 0.9, "dashArray": "3 5"}),
    "outside": (
        "a street object outside the photos",
        {"weight": 1, "opacity": 0.5, "dashArray": "1 5"},
    ),
}
RAY_STYLE = Style(
    name="Verdict",
    column="verdict",
    classes=tuple(
        StyleClass(
            label=f"{verdict}: {meaning}",
            symbol=Symbol(colour=str(look.get("color", VERDICTS[verdict]))),
            value=verdict,
        )
        for verdict, (meaning, look) in RAYS.items()
    ),
)

GROUP = "Answer"
# A candidate of the likelihood method has one rank, others may be tied.
RANK = "coalesce(attribute('rank'), attribute('rank_low'))"
CANDIDATE_LABEL = (
    f"with_variable('rank', {RANK}, case when @rank <= 10 or @map_scale < 5000 then @rank end)"
)
LEAST_CHANCE = 0.01
"""A candidate is drawn from this chance on, and the best in any case."""


def answer_layers(
    answer: Answer,
    database: SignatureDatabase,
    regions: SearchRegions,
    *,
    buildings: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
) -> list[Layer]:
    """Return layers of the regions to search and the candidates.

    By likelihood, there are also the place, its ellipse and, of explained candidates, the rays. The
    last are streets and buildings around what is drawn, where given.
    """
    candidates = answer.to_geodataframe()
    cells = CellTable(database.select(candidates["cell"].to_numpy()))
    columns = cells.columns(slice(0, len(candidates)))
    viewpoints = zip(candidates["x"].tolist(), candidates["y"].tolist(), strict=True)
    candidates = candidates.assign(
        bearings=columns["bearings"],
        distances=columns["distances"],
        address=["" if answer.city is None else answer.city.place_name(*xy) for xy in viewpoints],
        **link_columns([place_links(row["lat"], row["lon"]) for row in answer.candidate_rows()]),
    )
    values: Mapping[str, Any] = answer.to_dict()
    licenses = tuple(values["licenses"])
    facts = {name: values[name] for name in values if name not in {"candidates", "crs", "licenses"}}
    facts["searched"] = regions.to_dict()
    layer = functools.partial(
        table_layer,
        licenses=licenses,
        facts=facts,
        taxonomy=answer.taxonomy,
        reach=database.near_reach,
    )
    chances = answer.candidates.get("chance")
    rank = answer.candidates.columns[0]
    last = len(candidates) if chances is None else max(int((chances >= LEAST_CHANCE).sum()), 1)
    layers = [
        layer(
            regions.table,
            name="regions",
            title="Regions to search",
            description="Where the query may have been seen from, the best first.",
            geometry="polygon",
            form=REGION_FORM,
            display=Display(
                level=6,
                group=GROUP,
                name="""'region ' || "rank" """,
                tip=("chance", "km2", "searched_percent"),
            ),
            styles=(by_rank("rank", geometry="polygon"),),
        ),
        layer(
            candidates,
            name="candidates",
            title="Candidates",
            description="The best places or cells for the query.",
            geometry="point",
            form=CANDIDATE_FORM,
            display=Display(
                level=7,
                group=GROUP,
                name=f"'candidate ' || {RANK}",
                signature=("types", "bearings", "distances", " "),
                tip=("address", "chance", "distance"),
                label=CANDIDATE_LABEL,
                shown=f'"{rank}" <= {last}',
            ),
            styles=(by_rank(str(rank), geometry="point"),),
        ),
    ]
    # A method by distance has its first candidate as the best place.
    places = [*candidates.geometry[:last], shapely.Point(answer.xy)]
    below = ((streets_layer, streets), (buildings_layer, buildings))
    ground = [make(database, table, np.array(places)) for make, table in below if table is not None]
    ground = [layer for layer in ground if layer.rows]
    if not isinstance(answer, Location):
        return layers + ground
    table = pd.DataFrame([place_row(answer)]).assign(**link_columns([answer.links]))
    ellipse = [shapely.Polygon(answer.estimate.outline())]

    def place_layer(shapes: Any, *, name: str, level: int, **about: Any) -> Layer:  # noqa: ANN401 - as `layer` takes
        names = f"""'{name}, answer ' || "answer" """
        tip = ("address", "chance", "elsewhere", "sigma")
        return layer(
            gpd.GeoDataFrame(table, geometry=shapes, crs=answer.crs),
            name=name,
            form=PLACE_FORM,
            display=Display(level=level, group=GROUP, name=names, tip=tip),
            styles=(by_answer(geometry=about["geometry"]),),
            **about,
        )

    layers += [
        place_layer(
            gpd.points_from_xy(table["x"], table["y"]),
            name="place",
            level=8,
            title="Place",
            description="Where the query was most probably seen from, and how sure that is.",
            geometry="point",
        ),
        place_layer(
            ellipse,
            name="ellipse",
            level=9,
            title="Ellipse of the place",
            description="Contains the place with a chance of 90 %, if the answer is right.",
            geometry="polygon",
        ),
    ]
    if answer.explanations:
        rays = [
            {"candidate": rank, **row}
            for rank, explanation in enumerate(answer.explanations, start=1)
            for row in explanation_rows(answer, explanation)
        ]
        read = any(row["seen_text"] for row in rays)
        fields = [field for field in OBJECT_FORM["Object"] if read or field.name not in TEXTS_READ]
        ray_table = pd.DataFrame(rays, columns=[field.name for field in fields])
        # A column of numbers is one even without any number.
        ray_table = ray_table.astype({field.name: float for field in fields if field.decimals})
        lines = [shapely.LineString([row["from"], row["to"]]) for row in rays]
        layers.append(
            layer(
                gpd.GeoDataFrame(ray_table, geometry=lines, crs=answer.crs),
                name="rays",
                title="Objects of the query",
                description="From a candidate to where an object was seen or, if missed, is.",
                geometry="line",
                form=OBJECT_FORM,
                display=Display(
                    level=10,
                    group=GROUP,
                    name='"verdict"',
                    tip=("chance", "object_title"),
                    shown=f'"candidate" <= {last}',
                ),
                styles=(RAY_STYLE,),
            )
        )
    return layers + ground


def link_columns(links: Sequence[Mapping[str, str]]) -> dict[str, list[str]]:
    """Return the links of places as columns of a layer."""
    return {
        title.lower().replace(" ", "_"): [of_place[title] for of_place in links]
        for title in links[0]
    }


def explanation_rows(location: Location, explanation: Explanation) -> list[dict[str, Any]]:
    """Return the objects of the query and of the map at a candidate, with ends of lines in metres.

    A line goes ``from`` the candidate ``to`` where the object was seen or is; ``sign`` is the place
    of the street object or, without one, that end. Bearings are from grid north.
    """
    database = location.posterior.database

    def title(name: str | None) -> str | None:
        return None if name is None else database.taxonomy.title_of(name)

    ends = explanation.ends(database.near_reach).tolist()
    return [
        {
            "verdict": row["verdict"],
            "chance": row["chance"],
            "class": row["object_class"] or row["query_class"],
            "title": title(row["object_class"] or row["query_class"]),
            "seen_class": row["query_class"],
            "seen_title": title(row["query_class"]),
            "seen_text": row.get("query_text"),
            "seen_bearing": row["query_bearing"],
            "seen_range": row["query_range"],
            "object_class": row["object_class"],
            "object_title": title(row["object_class"]),
            "object_text": row.get("object_text"),
            "bearing": row["object_bearing"],
            "distance": row["distance"],
            "bearing_error": row["bearing_error"],
            "source": row["source"],
            "source_id": row["source_id"],
            "query": row["query"],
            "from": explanation.xy,
            "to": end,
            "sign": row["place"] or end,
        }
        for row, end in zip(explanation.rows, ends, strict=True)
    ]


def place_row(location: Location) -> dict[str, Any]:
    """Return the columns of the place of an answer by likelihood; missing numbers are NaN."""
    facts = location.to_dict()
    place: dict[str, Any] = {**facts["place"]}
    ellipse = place.pop("ellipse_90")
    del place["covariance"], place["links"]
    row = {
        "address": place.pop("name"),
        "answer": "given" if facts["answered"] else "withheld",
        **place,
        "longer_m": ellipse["longer"],
        "shorter_m": ellipse["shorter"],
        "bearing": ellipse["bearing"],
        "elsewhere": facts["elsewhere"],
        "fit": facts["fit"],
    }
    return {name: np.nan if value is None else value for name, value in row.items()}
