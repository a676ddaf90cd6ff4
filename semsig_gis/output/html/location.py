"""Maps of one answer: by likelihood, by chances only, and by distance."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import ANSWERS, CANDIDATE_RAMP, CELL_CHANCES, CHANCES, VERDICTS, mixed, percent
from semsig_gis.database import rows_of_result
from semsig_gis.localization import DEFAULT_RULE
from semsig_gis.localization import VERDICTS as COUNTED
from semsig_gis.observation import GRID_NORTH
from semsig_gis.output.html.drawing import (
    REGION_COLOURS,
    answer_drawing,
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
    method_text,
    panel_signs,
    query_signature,
    query_text,
    ramp_bar,
    ranks_text,
    shades_part,
    start_map,
    swatch,
    ties_text,
    to_latlon,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    import folium
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Answer, Localization, Location, Posterior


Image = tuple[bytes, list[list[float]]]  # a PNG, and latitudes and longitudes of its corners
PLACE_FIELDS = ("Chance", "Place", "Standard deviation", "North of the query", "Cell")
BEST_FIELDS = ("Chance", "Cell sees", "Cell", "Place")
# Facts that an answer or an object lacks are not shown.
CANDIDATE_FIELDS = (
    *("Query", "Cell sees", "Rank", "Chance", "Chance of the cell", "Log-likelihood", "Distance"),
    *("North of the query", "Cell", "Place"),
)
OBJECT_FIELDS = (
    *("Chance", "Seen as", "Seen at", "Street object", "It is at", "Off by"),
    *("Source", "Identifier"),
)
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
CANDIDATE = "#ffffff"
SECTOR = {"color": "#404040", "weight": 1.5, "opacity": 0.9, "dashArray": None}
SURROUNDINGS_M = 45.0  # smallest distance that is shown around the answer
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
    near = location.answer.given
    _colour_chances(page, location.posterior, radius=location.rule.radius, near=near)
    explained = zip(location.explanations, drawing["candidates"], strict=False)
    for number, (explanation, candidate) in enumerate(explained, start=1):
        sectors = sector_outlines(location, explanation)
        parts = _object_parts(candidate["rays"], {*explanation.counts}, sectors)
        name = f"Objects from rank {number}"
        add_layer(page, name, "drawings", parts, group="answer", show=number == 1)
    cells = location.columns["cell"].tolist()
    _add_candidates(page, location, database, cells, colours=[CANDIDATE] * len(cells))
    add_layer(page, "Best place", "drawings", _place_parts(location, drawing), group="answer")
    legend, view = location_legend(location), _corners(location) if map_ is None else None
    return finish_map(page, database, legend=legend, view=view, zoom=CLOSEST_ZOOM)


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
    chance_text = f"{percent(mass)} within {radius:g} m"
    signature = cell_signature(database, cell, place=place)
    details = [chance_text, signature, str(database.cell_ids[cell]), _position(place)]
    record = [place, CANDIDATE, 8, "Best place", details, "1"]
    signs = panel_signs(database)
    add_layer(page, "Best place", "points", BEST_FIELDS, signs, [record], group="answer")
    legend = (
        "<summary>Where it was seen</summary>"
        f"<p>{len(database):,} cells; the largest chance around one: {chance_text}</p>"
        f"{_chances_legend(posterior)}{shades_part()}{credits_part(database.licenses)}"
    )
    view = corners_of(database) if map_ is None else None
    return finish_map(page, database, legend=legend, view=view)


def _colour_chances(map_: folium.Map, posterior: Posterior, *, radius: float, near: bool) -> None:
    """Add images of chances and regions; show chances of cells if `near`, else within a radius."""
    city = add_city(map_, posterior.database)
    around, cell = posterior.mass_within(radius), posterior.chances
    regions = _image(posterior, region_levels(posterior), REGION_COLOURS)
    for name, picture, show in (
        (f"Chance within {radius:g} m", _chances(posterior, around), not near),
        ("Chance of a cell", _chances(posterior, cell), near),
        ("Regions of 50, 90 and 99 %", regions, False),
    ):
        image = cell_image(map_, *picture, dark="flip", opacity=0.85)
        colour_cells(map_, name, city, image, show=show)


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
    if location.answer.given:
        around = max(SURROUNDINGS_M, 1.5 * place.ellipse()[0])
        corners = np.concatenate([middle - around, middle + around])
    else:
        corners = np.concatenate([middle, _viewpoints(location)])
    return to_latlon(corners, location.crs)


def _viewpoints(answer: Answer) -> NDArray[np.float64]:
    """Return the viewpoints of the candidates in metres, shape (n, 2)."""
    return np.stack([answer.columns["x"], answer.columns["y"]], axis=1)


def _place_parts(location: Location, drawing: Mapping[str, Any]) -> list[list[Any]]:
    """Return the drawing of the best place and its ellipse."""
    place, estimate = location.estimate, drawing["estimate"]
    longer, shorter, bearing = place.ellipse()
    name, mark = (
        ("The answer", ANSWERS["given"])
        if drawing["given"]
        else ("Cannot tell: the best place", ANSWERS["withheld"])
    )
    ellipse = f"{longer:.1f} m along {bearing:.0f}°, {shorter:.1f} m across"
    details = [
        f"{percent(drawing['mass'])} within {drawing['radius']:g} m",
        _position(estimate["place"]),
        f"if there, {place.sigma:.1f} m each way; 90 %: {ellipse}",
        _north(place.heading, place.heading_sigma),
        str(location.cell_id),
    ]
    outline = {"color": mark.colour, "weight": 3, "opacity": 0.9}
    record = [estimate["place"], mark.colour, 6, name, details]
    return [
        ["lines", [[outline, [estimate["ellipse"]]]]],
        ["points", PLACE_FIELDS, {}, [record], OUTLINES[mark.shape]],
    ]


def _object_parts(
    rays: Sequence[Mapping[str, Any]], counted: Collection[str], sectors: list[list[list[float]]]
) -> list[list[Any]]:
    """Return the drawing of the rays of a candidate, the street objects and the photo sectors."""
    lines: list[list[Any]] = []
    for verdict, (_, look) in RAYS.items():
        ends = [[ray["from"], ray["to"]] for ray in rays if ray["verdict"] == verdict]
        if ends or verdict in counted:
            lines.append([{"color": VERDICTS[verdict], **look}, ends])
    if sectors:
        lines.append([SECTOR, sectors])
    records = []
    for ray in rays:
        error = ray["bearing_error"]
        details = [
            f"{ray['chance']:.2f}",
            ray["seen_title"],
            _degrees(ray["seen_bearing"], ray["seen_range"]),
            ray["object_title"],
            _degrees(ray["bearing"], ray["distance"]),
            None if error is None else f"{error:+.1f}°",
            ray["source"],
            ray["source_id"],
        ]
        verdict = ray["verdict"]
        records.append([ray["sign"], VERDICTS[verdict], 6, verdict.capitalize(), details])
    return [["lines", lines], ["points", OBJECT_FIELDS, {}, records]]


def _add_candidates(
    map_: folium.Map,
    answer: Answer,
    database: SignatureDatabase,
    cells: Sequence[int],
    *,
    colours: Sequence[str],
) -> None:
    """Add the candidates in some colours; `cells` are their rows in the database."""
    query, taxonomy, radius = answer.grid_query, database.taxonomy, database.spec.radius
    texts: dict[str, Callable[[Any], str | None]] = {
        "chance": percent,
        "cell_chance": percent,
        "loglik": "{:.2f}".format,
        "distance": "{:.4f}".format,
        "heading": _north,
        "cell_id": str,
    }
    records = []
    rows = zip(
        answer.candidate_rows(),
        cells,
        exact_latlon(_viewpoints(answer), database.crs),
        colours,
        strict=True,
    )
    for row, cell, place, colour in rows:
        turn = row.get("heading") or 0.0
        # A rank of its own is the label of the sign, a range of ranks is a fact.
        tied = "rank" not in row
        ranks = ranks_text(row["rank_low"], row["rank_high"]) if tied else f"{row['rank']:,}"
        details = [
            query_signature(query, taxonomy, radius=radius, place=place, turn=turn),
            cell_signature(database, cell, query, turn, place=place),
            f"{ranks} of {answer.cells:,}{ties_text(row['tied'])}" if tied else None,
            *(None if row.get(name) is None else text(row[name]) for name, text in texts.items()),
            _position(place),
        ]
        size = 8 if not tied else 9 if row["rank_low"] == 1 else 6
        label = [] if tied else [str(row["rank"])]
        records.append([place, colour, size, f"Rank {ranks}", details, *label])
    name, signs = f"Candidates ({len(records):,})", panel_signs(database)
    # The best last, so that they lie on top.
    add_layer(map_, name, "points", CANDIDATE_FIELDS, signs, records[::-1], group="answer")


def _position(place: list[float]) -> str:
    return f"{place[0]:.6f}, {place[1]:.6f}"


def _degrees(bearing: float | None, distance: float | None = None) -> str | None:
    if bearing is None:
        return None
    return f"{bearing:.1f}°" if distance is None else f"{bearing:.1f}°, {distance:.1f} m"


def _north(heading: float | None, sigma: float | None = None) -> str | None:
    if heading is None:
        return None
    return f"{heading % 360.0:.1f}°" + (f" ± {sigma:.1f}°" if sigma is not None else "")


def _notes(answer: Answer) -> str:
    """Return the notes of an answer as HTML, and the north of the query unless it is grid north."""
    notes = [f"Note: {note}" for note in answer.notes]
    if answer.north != GRID_NORTH:
        notes.insert(0, f"Bearings of the query are measured from {answer.north}.")
    return "".join(f"<p>{escape(note)}</p>" for note in notes)


def location_legend(location: Location) -> str:
    """Return the legend of `location_map` as HTML with data escaped."""
    posterior, answer, estimate = location.posterior, location.answer, location.estimate
    mark = ANSWERS["given" if answer.given else "withheld"]
    verdict = (
        "The answer"
        if answer.given
        else f"Cannot tell</b><br>{location.region_text}<br><b>The best place"
    )
    doubt = f"<p>{location.doubt}</p>" if location.doubt else ""
    # The counted verdicts always, others only where they occur.
    verdicts = {row["verdict"] for item in location.explanations for row in item.rows}
    kinds = "".join(
        f"<br>{swatch(VERDICTS[kind])}{kind}: {text}"
        for kind, (text, _) in RAYS.items()
        if kind in verdicts or kind in COUNTED
    )
    rays = f"<p>Objects of the query, as rays where they were seen{kinds}</p>"
    credit = credits_part(posterior.database.licenses)
    method = f"Likelihood, {escaped_text(location.noise)} noise, {len(posterior.database):,} cells"
    query = f"<p>{query_text(location.query, posterior.database.taxonomy)}</p>"
    return (
        "<summary>Where it was seen</summary>"
        f"<p>{mark_svg(mark)} <b>{verdict}</b>: {percent(answer.mass)} within "
        f"{location.rule.radius:g} m<br>If there, ±&nbsp;{estimate.sigma:.1f}&nbsp;m each way "
        f"(ellipse: 90 %)<br>{method_text(method)}</p>{doubt}{_notes(location)}"
        f"{_chances_legend(posterior)}"
        f"{layer_part('Candidates', f'<p>{swatch(CANDIDATE)}Candidates by rank</p>')}"
        f"{layer_part('Objects from rank ', rays) if location.explanations else ''}"
        f"{shades_part()}{folded_part('The query', query)}{credit}"
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
    page = start_map(map_, tiles, title="Candidate places")
    add_city(page, database)
    _add_candidates(page, localization, database, cells.tolist(), colours=colours)
    legend = localization_legend(localization)
    view = to_latlon(_viewpoints(localization), database.crs) if map_ is None else None
    return finish_map(page, database, legend=legend, view=view)


def localization_legend(localization: Localization) -> str:
    """Return the legend of `localization_map` as HTML with data escaped."""
    distances, more = localization.columns["distance"], localization.tied_beyond
    cells = "1 more cell is" if more == 1 else f"{more:,} more cells are"
    beyond = f"<br>{cells} as good as the last one" if more else ""
    method = f"{escape(str(localization.method))}, by {escape(localization.used)}"
    query = f"<p>{query_text(localization.query, localization.taxonomy)}</p>"
    ramp = ramp_bar(CANDIDATE_RAMP, f"{distances.min():.3f}", f"{distances.max():.3f}")
    return (
        "<summary>Candidate places</summary>"
        f"<p>The best <b>{len(distances):,}</b> of {localization.cells:,} cells{beyond}<br>"
        f"{method_text(method)}</p>{_notes(localization)}"
        f"{layer_part('Candidates', f'<p>Distance to the query (large sign: rank 1){ramp}</p>')}"
        f"{shades_part()}{folded_part('The query', query)}{credits_part(localization.licenses)}"
    )
