"""Maps of one answer: by likelihood, by chances only, by distance, and from an exported file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyogrio
import shapely

from semsig_gis.core import (
    ANSWERS,
    CANDIDATE_RAMP,
    CELL_CHANCES,
    CHANCES,
    VERDICTS,
    InputError,
    mixed,
    percent,
)
from semsig_gis.database import require_same_place, rows_of_result
from semsig_gis.localization import DEFAULT_RULE
from semsig_gis.localization import VERDICTS as COUNTED
from semsig_gis.observation import View
from semsig_gis.output.html.drawing import (
    REGION_COLOURS,
    answer_drawing,
    described_points,
    region_levels,
    sector_outlines,
)
from semsig_gis.output.html.image import level_image
from semsig_gis.output.html.page_elements import (
    FLIPPING,
    OUTLINES,
    add_city,
    add_layer,
    cell_image,
    cell_signature,
    colour_cells,
    corners_of,
    credits_part,
    escaped_text,
    exact_latlon,
    finish_map,
    folded_part,
    layer_part,
    mark_svg,
    panel_signs,
    query_signature,
    ramp_bar,
    ranks_text,
    shades_part,
    start_map,
    subtitle_part,
    swatch,
    ties_text,
    to_latlon,
)
from semsig_gis.output.layers.answer import (
    CANDIDATE_FORM,
    PLACE_FORM,
    REGION_FORM,
    place_row,
)
from semsig_gis.output.layers.columns import described
from semsig_gis.output.tables.answer import (
    north_sentences,
    note_sentences,
    place_sentences,
    position_sentences,
    query_sentences,
    tie_sentences,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Answer, Localization, Location, Posterior
    from semsig_gis.output.layers.columns import Form

RASTER_SUFFIXES = frozenset({".tif", ".tiff"})
"""Suffixes of files with the chance of every cell, which `open_posterior` reads instead."""

POLYGONAL = 2
Image = tuple[bytes, list[list[float]]]  # a PNG, and latitudes and longitudes of its corners
# Columns that the panel shows.
PLACE_NAMES = (
    *("chance", "within_m", "elsewhere", "fit", "sigma", "longer_m", "shorter_m", "bearing"),
    *("heading", "heading_sigma", "cell_id"),
)
CANDIDATE_NAMES = ("chance", "cell_chance", "distance", "loglik", "heading", "cell_id")
REGION_NAMES = ("chance", "cells", "km2", "best_cell_id")
LISTED_NAMES = ("chance", "distance", "types", "cell_id")
SAID_COLUMNS = "seen_class", "seen_title", "seen_text", "seen_bearing", "seen_range"
THERE_COLUMNS = "object_class", "object_title", "object_text", "bearing", "distance"
SAID = {
    "matched": "said, and there",
    "misnamed": "said, but of another class",
    "missed": "there, but not said",
    "false": "said, but not there",
    "outside": "there, but outside the photos",
}
"""Meaning of each verdict for people."""
ORDER = ("matched", "misnamed", "false", "missed")  # of the objects in the panel
REGION = {"color": CHANCES[0.9], "weight": 3, "opacity": 0.9, "fill": True, "fillOpacity": 0.25}
CANDIDATE = "#ffffff"
SECTOR = {"color": "#404040", "weight": 1.5, "opacity": 0.9, "dashArray": None}
SURROUNDINGS_M = 15.0  # smallest distance that is shown around the answer
CLOSEST_ZOOM = 20


def location_map(
    location: Location, *, map_: folium.Map | None = None, tiles: str | None = None
) -> folium.Map:
    """Show where a query may have been seen, and what supports each place.

    Parameters
    ----------
    location : Location
        What to show.
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map, with these layers: images of the cells, of their chances, of the chances within
        a radius, and of the fewest cells that contain 50, 90 and 99 % of the chance (the most
        informative one is shown first); the candidates with their ranks, the best place with its
        ellipse of 90 %, and for each explained candidate the rays of the query and the street
        objects. A click shows the facts of each in the panel.

    Examples
    --------
    >>> from semsig_gis import build_index, locate, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> location_map(locate(index, demo_database.signature(0))).options["maxZoom"]
    20
    """
    database, drawing = location.posterior.database, answer_drawing(location)
    page = start_map(map_, tiles, title="Where it was seen")
    sure = location.answer.given
    _colour_chances(page, location.posterior, radius=location.rule.radius, near=sure)
    cells = location.columns["cell"].tolist()
    looks = [(CANDIDATE, 8, f"Rank {rank:,}", str(rank)) for rank in range(1, len(cells) + 1)]
    # Around an answer they would hide its objects.
    _add_candidates(page, location, database, cells, looks, show=not sure)
    signs = panel_signs(database)
    explained = max(1, len(location.explanations))
    for rank, candidate in enumerate(drawing["candidates"][:explained], start=1):
        about = _compared(location, candidate, rank)
        parts: list[list[Any]] = [["answerObjects", about, signs]]
        if rank <= len(location.explanations):
            sectors = sector_outlines(location, location.explanations[rank - 1])
            parts.append(["lines", [[SECTOR, sectors]]])
        name = f"Objects from rank {rank}"
        add_layer(page, name, "drawings", parts, group="answer", show=rank == 1)
    mark = ANSWERS["given" if sure else "withheld"]
    outline = {"color": mark.colour, "weight": 3, "opacity": 0.9}
    place = [
        ["lines", [[outline, [drawing["estimate"]["ellipse"]]]]],
        ["answerMark", drawing["estimate"]["place"], OUTLINES[mark.shape], mark.colour],
    ]
    add_layer(page, "Best place", "drawings", place, group="answer")
    return finish_map(
        page,
        database,
        legend=location_legend(location),
        view=_corners(location) if map_ is None else None,
        zoom=CLOSEST_ZOOM,
        first="answer:1" if map_ is None else None,
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _compared(location: Location, candidate: Mapping[str, Any], rank: int) -> dict[str, Any]:
    """Return what was said and what is there at a candidate, for the script."""
    symbols = {item.name: item.symbol for item in location.taxonomy.classes}
    north, query = location.north, View.of(location.query)

    def part(
        name: str | None, title: str, read: str | None, bearing: float | None, metres: float | None
    ) -> Any:  # noqa: ANN401 - as JSON has it
        """Return the class of an object, and its text, bearing and distance as a text."""
        if name is None:
            return None
        turn = "" if bearing is None else f"{north.from_grid(bearing):.0f}°"
        away = "" if metres is None else f"{metres:.0f} m"
        quoted = f"“{read}”" if read else ""
        text = ", ".join(filter(None, (quoted, turn, away)))
        return {"symbol": symbols.get(name, "?"), "title": title, "text": text}

    undirected, others = set[int](), list[tuple[str, str]]()
    if rank <= len(location.explanations):
        undirected, others = location.without_direction(location.explanations[rank - 1])
    rays = [
        {
            **{name: row[name] for name in ("verdict", "to", "sign")},
            "said": part(*(row[name] for name in SAID_COLUMNS))
            if number not in undirected
            else {**part(*(row[name] for name in THERE_COLUMNS)), "text": "no direction"},
            "there": part(*(row[name] for name in THERE_COLUMNS)),
        }
        for number, row in enumerate(candidate["rays"])
        if row["verdict"] in COUNTED
    ]
    # Objects of classes that the map does not have are no part of an explanation.
    compared = {row["query"] for row in candidate["rays"]}
    codes = [] if query.codes is None else query.codes.tolist()
    rest = [code for number, code in enumerate(codes) if number not in compared]
    words, database = location.taxonomy.words, location.posterior.database
    visible = database.codes[slice(*database.offsets[candidate["cell"] :][:2])]
    there = "none on this map" if rays else words(visible)
    more = [[words(rest), there]] if rest else []
    more += [[phrase, place or "none in sight"] for phrase, place in others]
    lat, lon = candidate["rays"][0]["from"] if candidate["rays"] else candidate["place"]
    best = exact_latlon(location.xy, location.crs)[0] if rank == 1 else [lat, lon]
    sure = location.answer.given
    title = ("Found" if sure else "Cannot tell: the best guess") if rank == 1 else f"Rank {rank}"
    chance = location.answer.mass if rank == 1 else candidate["chance"]
    xy = location.xy if rank == 1 else (candidate["x"], candidate["y"])
    where = "" if location.city is None else location.city.place_name(*xy)
    radius = f"within {location.rule.radius:g} m of this place"
    lines = [
        *([_capital(where)] if where else []),
        f"Chance {percent(chance)} {radius}",
        f"{best[0]:.6f}, {best[1]:.6f} (latitude, longitude)",
        *([location.doubt] if location.doubt and rank == 1 else []),
    ]
    form, names, row = (
        (PLACE_FORM, PLACE_NAMES, place_row(location))
        if rank == 1
        else (CANDIDATE_FORM, CANDIDATE_NAMES, candidate)
    )
    columns = described(names, form, {})
    facts = [[column.title, column.text(row.get(column.name))] for column in columns]
    return {
        "rank": rank,
        "place": [lat, lon],
        "best": best,
        "title": title,
        "where": bool(where),
        "lines": lines,
        "rays": sorted(rays, key=lambda ray: ORDER.index(ray["verdict"])),
        "more": more,
        "facts": [fact for fact in facts if fact[1] is not None],
    }


def posterior_map(
    posterior: Posterior,
    *,
    radius: float = DEFAULT_RULE.radius,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show the chance of every cell, for an answer that was exported to a raster.

    Parameters
    ----------
    posterior : Posterior
        What to show (see `open_posterior`).
    radius : float, default 50
        Radius in metres around a cell in which chances are summed for a second image.
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map: the cells coloured as in `location_map`, and the cell with the largest chance
        within the radius.

    Examples
    --------
    >>> from semsig_gis import build_index, locate, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> location = locate(index, demo_database.signature(0))
    >>> posterior_map(location.posterior).options["maxZoom"]
    20
    """
    database = posterior.database
    page = start_map(map_, tiles, title="Where it was seen")
    _colour_chances(page, posterior, radius=radius, near=False)
    cell, mass = posterior.best_place(radius)
    (place,) = exact_latlon(database.xy[cell], database.crs)
    row = {"place": place, "chance": mass, "within_m": radius, "cell_id": database.cell_ids[cell]}
    name, signs = "Best place", panel_signs(database)
    point = described_points(
        [row],
        PLACE_FORM,
        tuple(row)[1:],
        [(CANDIDATE, 8, name, "1")],
        wheels=[("Cell sees", [cell_signature(database, cell, place=place)])],
        signs=signs,
    )
    add_layer(page, name, *point, group="answer")
    legend = (
        "<summary>Where it was seen</summary>"
        f"<p>{len(database):,} cells; the largest chance around one: {percent(mass)} within "
        f"{radius:g} m</p>{_chances_legend(posterior)}{shades_part()}"
        f"{credits_part(database.licenses)}"
    )
    view = corners_of(database) if map_ is None else None
    return finish_map(page, database, legend=legend, view=view)


def _colour_chances(map_: folium.Map, posterior: Posterior, *, radius: float, near: bool) -> None:
    """Add images of chances and regions; show chances of cells if `near`, else within a radius."""
    add_city(map_, posterior.database)
    around, cell = posterior.mass_within(radius), posterior.chances
    regions = _image(posterior, region_levels(posterior), REGION_COLOURS)
    for name, picture, show in (
        (f"Chance within {radius:g} m", _chances(posterior, around), not near),
        ("Chance of a cell", _chances(posterior, cell), near),
        ("Regions of 50, 90 and 99 %", regions, False),
    ):
        image = cell_image(map_, *picture, dark="flip", opacity=0.45)
        colour_cells(map_, name, image, show=show)


def _chances(posterior: Posterior, chances: NDArray[np.float64]) -> Image:
    """Return an image of one chance per cell."""
    levels = np.digitize(chances, list(CELL_CHANCES))
    return _image(posterior, levels, list(CELL_CHANCES.values()))


def _image(posterior: Posterior, levels: NDArray[np.integer], colours: list[str]) -> Image:
    """Return an image of the cells with a level above 0 and of the likeliest cell."""
    cells = np.union1d(np.flatnonzero(levels), [int(posterior.chances.argmax())])
    return level_image(posterior.database.select(cells), levels[cells].astype(np.uint8), colours)


def _corners(location: Location) -> NDArray[np.float64]:
    """Return the corners of the first view: around the answer, or all candidates without one."""
    place = location.estimate
    middle = np.array([[place.x, place.y]])
    if not location.answer.given:
        return to_latlon(np.concatenate([middle, _viewpoints(location)]), location.crs)
    reach = location.posterior.database.near_reach
    signs = [
        row["place"] or end
        for explanation in location.explanations[:1]
        for row, end in zip(explanation.rows, explanation.ends(reach).tolist(), strict=True)
    ]
    # Landmarks far away would make what is near tiny.
    shown = [sign for sign in signs if math.dist(sign, (place.x, place.y)) <= 2.0 * reach]
    around = max(SURROUNDINGS_M, 1.5 * place.ellipse()[0])
    corners = np.concatenate([middle - around, middle + around, np.array(shown).reshape(-1, 2)])
    margin = 0.1 * np.ptp(corners, axis=0)
    ends = np.stack([corners.min(axis=0) - margin, corners.max(axis=0) + margin])
    return to_latlon(ends, location.crs)


def _viewpoints(answer: Answer) -> NDArray[np.float64]:
    """Return the viewpoints of the candidates in metres, shape (n, 2)."""
    return np.stack([answer.columns["x"], answer.columns["y"]], axis=1)


def _add_candidates(
    map_: folium.Map,
    answer: Answer,
    database: SignatureDatabase,
    cells: Sequence[int],
    looks: Sequence[Sequence[Any]],
    *,
    show: bool = True,
) -> None:
    """Add the candidates; `cells` are their rows in the database."""
    query = answer.grid_query
    places = exact_latlon(_viewpoints(answer), database.crs)
    rows = [
        {**row, "place": place} for row, place in zip(answer.candidate_rows(), places, strict=True)
    ]
    turns, reach = [row.get("heading") or 0.0 for row in rows], database.near_reach
    queries = [
        query_signature(query, database.taxonomy, radius=reach, place=place, turn=turn)
        for place, turn in zip(places, turns, strict=True)
    ]
    cell_views = [
        cell_signature(database, cell, query, turn, place=place)
        for cell, place, turn in zip(cells, places, turns, strict=True)
    ]
    points = described_points(
        rows,
        CANDIDATE_FORM,
        [name for name in CANDIDATE_NAMES if name in rows[0]],
        looks,
        wheels=[("Query", queries), ("Cell sees", cell_views)],
        signs=panel_signs(database),
    )
    add_layer(map_, f"Candidates ({len(rows):,})", *points, group="answer", show=show)


def location_legend(location: Location) -> str:
    """Return the legend of `location_map` as HTML with data escaped."""
    posterior = location.posterior
    mark = ANSWERS["given" if location.answer.given else "withheld"]
    # The counted verdicts always, others only where they occur.
    verdicts = {row["verdict"] for item in location.explanations for row in item.rows}
    kinds = "".join(
        f"<br>{swatch(VERDICTS[kind])}{kind}: {text}"
        for kind, text in SAID.items()
        if kind in verdicts or kind in COUNTED
    )
    rays = f"<p>Objects, and in which direction they were seen{kinds}</p>"
    name = "The answer" if location.answer.given else "The best place"
    method = f"Likelihood, {escaped_text(location.noise)} noise, {len(posterior.database):,} cells"
    where = subtitle_part(escaped_text(_capital(location.place))) if location.place else ""
    return _answer_legend(
        location,
        "Where it was seen",
        f"<p>{mark_svg(mark)} <b>{name}</b>, ellipse: 90 %<br>{where}</p>",
        (*place_sentences(location), *position_sentences(location)),
        f"{_chances_legend(posterior)}"
        f"{layer_part('Candidates', f'<p>{swatch(CANDIDATE)}Candidates by rank</p>')}"
        f"{layer_part('Objects from rank ', rays) if location.explanations else ''}",
        method=method,
    )


def _answer_legend(
    answer: Answer, title: str, head: str, sentences: Sequence[str], parts: str, *, method: str
) -> str:
    """Return a legend as HTML: sentences on the answer, parts for its layers, and its query."""
    notes = (*north_sentences(answer), *note_sentences(answer))
    texts = "".join(
        f"<p>{'<br>'.join(map(escaped_text, part))}</p>" for part in (sentences, notes) if part
    )
    query = "<br>".join(map(escaped_text, query_sentences(answer)))
    return (
        f"<summary>{title}</summary>{head}{texts}{parts}{shades_part()}"
        f"{folded_part('The query', f'<p>{query}<br>Method: {method}</p>')}"
        f"{credits_part(answer.licenses)}"
    )


def _chances_legend(posterior: Posterior) -> str:
    """Return the legend of the images of chances and of regions, as HTML."""
    counts = {share: len(posterior.credible_cells(share)) for share in CHANCES}
    regions = "<br>".join(
        f"{swatch(CHANCES[share], FLIPPING)}{percent(share, 0)} in {count:,} "
        f"cell{'s' * (count != 1)}"
        for share, count in counts.items()
    )
    chances = " ".join(
        f"<span style='white-space:nowrap'>{swatch(shade, FLIPPING)}{100.0 * least:g}+</span>"
        for least, shade in sorted(CELL_CHANCES.items(), reverse=True)
    )
    return layer_part("Chance ", f"<p>Chance in percent<br>{chances}</p>") + layer_part(
        "Regions ", f"<p>Regions, the fewest cells that contain<br>{regions}</p>"
    )


def localization_map(
    localization: Localization,
    database: SignatureDatabase,
    *,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show the candidate cells of a query, the best ones first.

    Parameters
    ----------
    localization : Localization
        What to show.
    database : SignatureDatabase
        The database that was searched.
    map_, tiles : optional
        As in `evaluation_map`.

    Returns
    -------
    folium.Map
        The map: the cells as an image, and the candidates, coloured by their distance to the
        query and described by a click. The best candidates are larger.

    Raises
    ------
    InputError
        If the localization is from another database, or as in `evaluation_map`.

    Examples
    --------
    >>> from semsig_gis import localize
    >>> localization = localize(demo_database, demo_database.signature(0), method="edit+edit")
    >>> localization_map(localization, demo_database).options["maxZoom"]
    20
    """
    columns = localization.columns
    ids, types = columns["cell_id"], columns["types"]
    cells = rows_of_result(database, ids, types, what="localization")
    # Colours are scaled to the range of distances, which is 0 for equal candidates.
    away = columns["distance"] - columns["distance"].min()
    colours = mixed(away / (away.max() or 1.0), CANDIDATE_RAMP)
    low, high, tied = (columns[name].tolist() for name in ("rank_low", "rank_high", "tied"))
    looks = [
        (colour, 9 if first == 1 else 6, f"Rank {ranks_text(first, last)}{ties_text(ties)}")
        for colour, first, last, ties in zip(colours, low, high, tied, strict=True)
    ]
    page = start_map(map_, tiles, title="Candidate places")
    add_city(page, database)
    _add_candidates(page, localization, database, cells.tolist(), looks)
    legend = localization_legend(localization)
    view = to_latlon(_viewpoints(localization), database.crs) if map_ is None else None
    return finish_map(page, database, legend=legend, view=view)


def localization_legend(localization: Localization) -> str:
    """Return the legend of `localization_map` as HTML with data escaped."""
    distances = localization.columns["distance"]
    method = f"{escaped_text(str(localization.method))}, by {escaped_text(localization.used)}"
    ramp = ramp_bar(CANDIDATE_RAMP, f"{distances.min():.3f}", f"{distances.max():.3f}")
    return _answer_legend(
        localization,
        "Candidate places",
        f"<p>The best <b>{len(distances):,}</b> of {localization.cells:,} cells</p>",
        tuple(tie_sentences(localization)),
        layer_part("Candidates", f"<p>Distance to the query (large sign: rank 1){ramp}</p>"),
        method=method,
    )


def answer_map(
    path: str | Path,
    database: SignatureDatabase,
    *,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show the regions to search and the candidates of an exported answer.

    `path` is a file of `export_answer` in any of its formats except a raster; `map_` and `tiles`
    are as in `evaluation_map`. InputError if it contains no answer from this database.
    """
    shapes = _shapes(Path(path), database)
    polygons = shapely.get_dimensions(shapes.geometry.array) == POLYGONAL
    page = start_map(map_, tiles, title="Where it was seen")
    add_city(page, database)
    regions, candidates = shapes[polygons], shapes[~polygons]
    rings = shapely.get_rings(regions.geometry.array)
    lines = [exact_latlon(shapely.get_coordinates(ring), database.crs) for ring in rings]
    middles = regions.set_geometry(regions.geometry.representative_point())
    signs = _ranked_points("Region", middles, REGION_FORM, REGION_NAMES, CHANCES[0.9])
    parts = [["lines", [[REGION, lines]]], signs]
    add_layer(page, f"Regions to search ({len(regions):,})", "drawings", parts, group="answer")
    if "types" in candidates:
        classes = database.taxonomy
        words = [classes.words(classes.encode(types or "")) for types in candidates["types"]]
        candidates = candidates.assign(types=words)
    if len(candidates):
        points = _ranked_points("Rank", candidates, CANDIDATE_FORM, LISTED_NAMES, CANDIDATE)
        add_layer(page, f"Candidates ({len(candidates):,})", *points, group="answer")
    legend = (
        "<summary>Where it was seen</summary>"
        f"<p>{swatch(CHANCES[0.9])}Regions to search: {len(regions):,}"
        f"<br>{swatch(CANDIDATE)}Candidates by rank: {len(candidates):,}</p>"
        f"{shades_part()}{credits_part(database.licenses)}"
    )
    view = corners_of(database) if map_ is None else None
    return finish_map(page, database, legend=legend, view=view)


def _shapes(path: Path, database: SignatureDatabase) -> gpd.GeoDataFrame:
    """Return the rows of a file that have a rank, in the coordinate system of the database."""
    try:
        if path.suffix.lower() == ".parquet":
            tables = [gpd.read_parquet(path)]
        else:
            layers = [name for name, kind in pyogrio.list_layers(path) if kind is not None]
            tables = [pyogrio.read_dataframe(path, layer=name) for name in layers]
    except (OSError, ValueError, pyogrio.errors.DataSourceError) as error:
        raise InputError(
            f"{path} cannot be read ({error}); give a file that semsig localize --out wrote."
        ) from error
    ranked = [table for table in tables if "rank" in table]
    if not any("best_cell_id" in table for table in ranked):
        raise InputError(
            f"{path} contains no answer; give a file that semsig localize --out wrote."
        )
    projected = [
        table.set_crs(database.crs) if table.crs is None else table.to_crs(database.crs)
        for table in ranked
    ]
    shapes = pd.concat(projected, ignore_index=True)
    shapes = shapes[shapes["rank"].notna()].sort_values("rank", kind="stable")
    places = shapely.get_coordinates(shapes.geometry.array)
    require_same_place(database, places, "corners and places of the answer")
    return shapes


def _ranked_points(
    kind: str, frame: gpd.GeoDataFrame, form: Form, names: Sequence[str], colour: str
) -> list[Any]:
    """Return the drawing of the rows of a file as signs with their ranks."""
    places = exact_latlon(shapely.get_coordinates(frame.geometry.array), frame.crs)
    # KML contains numbers as text.
    numeric = [name for name in names if name in frame and name != "types"]
    table = frame.assign(**{name: pd.to_numeric(frame[name]) for name in numeric})
    rows = [
        {**row, "place": place} for row, place in zip(table.to_dict("records"), places, strict=True)
    ]
    ranks = [int(row["rank"]) for row in rows]
    looks = [(colour, 8, f"{kind} {rank:,}", str(rank)) for rank in ranks]
    return described_points(rows, form, [name for name in names if name in frame], looks)
