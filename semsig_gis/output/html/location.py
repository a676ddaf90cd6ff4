"""Maps of one answer: by likelihood, by chances only, and by distance."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import ANSWERS, CANDIDATE_RAMP, CELL_CHANCES, CHANCES, VERDICTS, mixed, percent
from semsig_gis.database import rows_of_result
from semsig_gis.localization import DEFAULT_RULE
from semsig_gis.localization import VERDICTS as COUNTED
from semsig_gis.observation import GRID_NORTH, View
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
    import folium
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Answer, Explanation, Localization, Location, Posterior


Image = tuple[bytes, list[list[float]]]  # a PNG, and latitudes and longitudes of its corners
PLACE_FIELDS = ("Chance", "Place", "Standard deviation", "North of the query", "Cell")
BEST_FIELDS = ("Chance", "Cell sees", "Cell", "Place")
CANDIDATE_FIELDS = (
    *("Query", "Cell sees", "Chance", "Chance of the cell", "Log-likelihood"),
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
REGION_COLOURS = [CHANCES[share] for share in sorted(CHANCES, reverse=True)]
SURROUNDINGS_M = 45.0  # smallest distance that is shown around the answer
CLOSEST_ZOOM = 20
ARC_POINTS = 72  # of the outline of a sector


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
    database = location.posterior.database
    layers = _LocationLayers(location)
    page = start_map(map_, tiles, title="Where it was seen")
    near = location.answer.given
    _colour_chances(page, location.posterior, radius=location.rule.radius, near=near)
    for number, explanation in enumerate(location.explanations, start=1):
        name, parts = f"Objects from rank {number}", layers.explanation(explanation)
        add_layer(page, name, "drawings", parts, group="answer", show=number == 1)
    candidates = layers.candidates()
    name = f"Candidates ({len(candidates):,})"
    # The best last, so that they lie on top.
    signs = panel_signs(database)
    add_layer(page, name, "points", CANDIDATE_FIELDS, signs, candidates[::-1], group="answer")
    add_layer(page, "Best place", "drawings", layers.place(), group="answer")
    legend, view = location_legend(location), layers.view() if map_ is None else None
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


def region_levels(posterior: Posterior) -> NDArray[np.uint8]:
    """Return the level of the smallest region that contains each cell, or 0.

    Level 1 is the region of the largest share of `CHANCES`: the fewest cells that contain it.
    """
    levels = np.zeros(len(posterior.database), np.uint8)
    for level, share in enumerate(sorted(CHANCES, reverse=True), start=1):
        levels[posterior.credible_cells(share)] = level
    return levels


def _image(posterior: Posterior, levels: NDArray[np.integer], colours: list[str]) -> Image:
    """Return an image of the cells with a level above 0 and of the likeliest cell."""
    cells = np.union1d(np.flatnonzero(levels), [int(posterior.chances.argmax())])
    return level_image(posterior.database.select(cells), levels[cells].astype(np.uint8), colours)


class _LocationLayers:
    """Layers of the map of a location, as plain values for the script of the page."""

    def __init__(self, location: Location) -> None:
        self.location = location
        self.database = location.posterior.database
        self.titles = {item.name: item.title for item in self.database.taxonomy.classes}

    def latlon(self, xy: ArrayLike) -> list[list[float]]:
        return exact_latlon(xy, self.database.crs)

    def view(self) -> NDArray[np.float64]:
        """Return the corners of the first view."""
        place = self.location.estimate
        middle = np.array([[place.x, place.y]])
        if self.location.answer.given:
            around = max(SURROUNDINGS_M, 1.5 * place.ellipse()[0])
            corners = np.concatenate([middle - around, middle + around])
        else:
            corners = np.concatenate([middle, self.location.candidates[["x", "y"]].to_numpy()])
        return to_latlon(corners, self.database.crs)

    def place(self) -> list[list[Any]]:
        """Return the best place and its ellipse."""
        location, place = self.location, self.location.estimate
        longer, shorter, bearing = place.ellipse()
        (centre,) = self.latlon([place.x, place.y])
        name, mark = (
            ("The answer", ANSWERS["given"])
            if location.answer.given
            else ("Cannot tell: the best place", ANSWERS["withheld"])
        )
        ellipse = f"{longer:.1f} m along {bearing:.0f}°, {shorter:.1f} m across"
        details = [
            f"{percent(location.answer.mass)} within {location.rule.radius:g} m",
            _position(centre),
            f"if there, {place.sigma:.1f} m each way; 90 %: {ellipse}",
            _north(place.heading, place.heading_sigma),
            str(location.cell_id),
        ]
        record = [centre, mark.colour, 6, name, details]
        outline = {"color": mark.colour, "weight": 3, "opacity": 0.9}
        return [
            ["lines", [[outline, [self.latlon(place.outline())]]]],
            ["points", PLACE_FIELDS, {}, [record], OUTLINES[mark.shape]],
        ]

    def candidates(self) -> list[list[Any]]:
        """Return the candidates, likeliest first."""
        rows = self.location.candidates
        query = self.location.grid_query
        taxonomy, radius = self.database.taxonomy, self.database.spec.radius
        records = []
        places = self.latlon(rows[["x", "y"]].to_numpy())
        for place, row in zip(places, rows.to_dict("records"), strict=True):
            turn = row.get("heading") or 0.0
            details = [
                query_signature(query, taxonomy, radius=radius, place=place, turn=turn),
                cell_signature(self.database, row["cell"], query, turn, place=place),
                percent(row["chance"]),
                percent(row["cell_chance"]),
                f"{row['loglik']:.2f}",
                _north(row.get("heading")),
                str(row["cell_id"]),
                _position(place),
            ]
            name = f"Rank {row['rank']:,}"
            records.append([place, CANDIDATE, 8, name, details, str(row["rank"])])
        return records

    def explanation(self, explanation: Explanation) -> list[list[Any]]:
        """Return the rays of the query and the street objects."""
        here = np.array(explanation.xy)
        rays: dict[str, list[list[list[float]]]] = {verdict: [] for verdict in VERDICTS}
        records = []
        shapes = explanation.table.geometry
        ends = explanation.ends(self.database.reach)
        for row, shape, end in zip(explanation.to_dict()["rows"], shapes, ends, strict=True):
            verdict = row["verdict"]
            rays[verdict].append(self.latlon(np.stack([here, end])))
            # Without a street object, the sign is at the end of the ray.
            place = end if shape is None else np.array([shape.x, shape.y])
            details = [
                f"{row['chance']:.2f}",
                self._title(row["query_class"]),
                _degrees(row["query_bearing"], row["query_range"]),
                self._title(row["object_class"]),
                _degrees(row["object_bearing"], row["distance"]),
                None if row["bearing_error"] is None else f"{row['bearing_error']:+.1f}°",
                row["source"],
                row["source_id"],
            ]
            name = verdict.capitalize()
            records.append([*self.latlon(place), VERDICTS[verdict], 6, name, details])
        lines: list[list[Any]] = [
            [{"color": VERDICTS[verdict], **look}, rays[verdict]]
            for verdict, (_, look) in RAYS.items()
            if rays[verdict] or verdict in explanation.counts
        ]
        lines += [[SECTOR, sectors] for sectors in [self._sectors(explanation)] if sectors]
        return [["lines", lines], ["points", OBJECT_FIELDS, {}, records]]

    def _sectors(self, explanation: Explanation) -> list[list[list[float]]]:
        """Return the outlines of the photo sectors at a place, out to the visibility range."""
        photos = View.of(self.location.grid_query).photos
        outlines = []
        for photo, turn in zip(photos, explanation.headings, strict=True):
            for low, high in photo.turned(turn).sectors:
                bearings = np.radians(np.linspace(low, high, ARC_POINTS))
                arc = np.stack([np.sin(bearings), np.cos(bearings)], axis=1)
                corners = np.concatenate([[[0.0, 0.0]], arc, [[0.0, 0.0]]])
                away = self.database.spec.radius * corners
                outlines.append(self.latlon(np.array(explanation.xy) + away))
        return outlines

    def _title(self, name: str | None) -> str | None:
        """Return the title of a class; "unknown" and None are returned unchanged."""
        return self.titles.get(name, name) if name is not None else None


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


RANK_FIELDS = ("Query", "Signature", "Rank", "Distance", "Cell", "Position")


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
    xy = localization.candidates[["x", "y"]].to_numpy(np.float64)
    places = to_latlon(xy, database.crs)
    records = _candidate_records(localization, database, places)
    page = start_map(map_, tiles, title="Candidate places")
    add_city(page, database)
    name = f"Candidates ({len(records):,})"
    # The best last, so that they lie on top.
    signs = panel_signs(database)
    add_layer(page, name, "points", RANK_FIELDS, signs, records[::-1], group="answer")
    legend = localization_legend(localization)
    return finish_map(page, database, legend=legend, view=places if map_ is None else None)


def _candidate_records(
    localization: Localization, database: SignatureDatabase, places: NDArray[np.float64]
) -> list[list[Any]]:
    """Return a record for the script of each candidate, best first."""
    candidates = localization.candidates
    rows = rows_of_result(database, candidates["cell_id"], candidates["types"], what="localization")
    distances = candidates["distance"].to_numpy(np.float64)
    # Colours are scaled to the range of distances, which is 0 for equal candidates.
    spread = np.ptp(distances) or 1.0
    colours = mixed((distances - distances.min()) / spread, CANDIDATE_RAMP)
    query = localization.grid_query
    taxonomy, radius_m = database.taxonomy, database.spec.radius
    records = []
    for number, candidate in enumerate(candidates.to_dict("records")):
        rank = ranks_text(candidate["rank_low"], candidate["rank_high"])
        place = places[number].tolist()
        details = [
            query_signature(query, taxonomy, radius=radius_m, place=place),
            cell_signature(database, int(rows[number]), query, place=place),
            f"{rank} of {len(database):,}{ties_text(candidate['tied'])}",
            f"{candidate['distance']:.4f}",
            str(candidate["cell_id"]),
            _position(place),
        ]
        radius = 9 if candidate["rank_low"] == 1 else 6
        records.append([place, colours[number], radius, f"Rank {rank}", details])
    return records


def localization_legend(localization: Localization) -> str:
    """Return the legend of `localization_map` as HTML with data escaped."""
    candidates = localization.candidates
    more = localization.tied_beyond
    cells = "1 more cell is" if more == 1 else f"{more:,} more cells are"
    beyond = f"<br>{cells} as good as the last one" if more else ""
    distances = candidates["distance"]
    method = f"{escape(str(localization.method))}, by {escape(localization.used)}"
    query = f"<p>{query_text(localization.query, localization.taxonomy)}</p>"
    ramp = ramp_bar(CANDIDATE_RAMP, f"{distances.min():.3f}", f"{distances.max():.3f}")
    return (
        "<summary>Candidate places</summary>"
        f"<p>The best <b>{len(candidates):,}</b> of {localization.cells:,} cells{beyond}<br>"
        f"{method_text(method)}</p>{_notes(localization)}"
        f"{layer_part('Candidates', f'<p>Distance to the query (large sign: rank 1){ramp}</p>')}"
        f"{shades_part()}{folded_part('The query', query)}{credits_part(localization.licenses)}"
    )
