"""A map of where a query may have been seen: chances, the best place, and what speaks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.colours import CELL_CHANCES, CHANCES, FAILED, SUCCESSFUL, VERDICTS
from semsig_gis.maps.image import level_image
from semsig_gis.maps.legend import location_legend
from semsig_gis.maps.parts import (
    Drawing,
    Legend,
    add_city,
    add_image,
    cell_signature,
    class_titles,
    finished_map,
    free_name,
    prepared_map,
    query_signature,
    to_latlon,
)

if TYPE_CHECKING:
    import folium
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.likelihood.explain import Explanation
    from semsig_gis.likelihood.posterior import Posterior
    from semsig_gis.likelihood.result import Location

PLACE_FIELDS = ("Chance", "Place", "Give or take", "North of the query", "Cell")
CANDIDATE_FIELDS = (
    "Query",
    "Cell sees",
    "Chance",
    "Log-likelihood",
    "North of the query",
    "Cell",
    "Place",
)
OBJECT_FIELDS = (
    "Chance",
    "Seen as",
    "Seen at",
    "Street object",
    "It is at",
    "Off by",
    "Source",
    "Identifier",
)
SURROUNDINGS_M = 45.0  # to see around the answer
CLOSEST_ZOOM = 20
ELLIPSE_STEPS = 72


def location_map(
    location: Location, *, map_: folium.Map | None = None, tiles: str | None = None
) -> folium.Map:
    """Show where a query may have been seen, and why there.

    Parameters
    ----------
    location : Location
        What to show.
    map_ : folium.Map, optional
        Map to add the layers to; a new one by default.
    tiles : str, optional
        Online background of a new map, by a name that folium knows; none by default.

    Returns
    -------
    folium.Map
        The map, with these layers: the cells; their chances, those of the places around them, and
        the fewest cells that hold 50, 90 and 99 % of the chance, as images of which the most
        telling is shown at first; the candidates with their ranks, the best place with its
        ellipse of 90 %, and for each candidate that was explained the rays of the query and the
        street objects; all with popups.

    Raises
    ------
    InputError
        If `tiles` is not known to folium, or both `tiles` and `map_` are given.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.likelihood.index import build_index
    >>> from semsig_gis.likelihood.locate import locate
    >>> from semsig_gis.likelihood.noise.model import named_noise
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> index = build_index(database, named_noise("generic"))
    >>> location_map(locate(index, database.signature(0))).options["maxZoom"]
    20
    """
    drawn = _Drawn(location)
    chosen = prepared_map(map_, tiles, title="Where it was seen")
    add_city(chosen, location.posterior.database)
    _add_chances(chosen, location)
    for number, why in enumerate(location.explanations, start=1):
        name = free_name(chosen, f"Objects from rank {number}")
        Drawing(name, "drawings", drawn.explanation(why), show=number == 1).add_to(chosen)
    candidates = drawn.candidates()
    name = free_name(chosen, f"Candidates ({len(candidates):,})")
    titles = class_titles(location.posterior.database)
    # The best last, so that they lie on top.
    Drawing(name, "points", CANDIDATE_FIELDS, titles, candidates[::-1]).add_to(chosen)
    Drawing(free_name(chosen, "Best place"), "drawings", drawn.place()).add_to(chosen)
    view = drawn.view() if map_ is None else None
    Legend(location_legend(location), view, zoom=CLOSEST_ZOOM).add_to(chosen)
    return finished_map(chosen, location.posterior.database)


def _add_chances(chosen: folium.Map, location: Location) -> None:
    """Add images of the chances: from near those of the cells, from afar those around them."""
    found, radius, near = location.posterior, location.rule.radius, location.answer.given
    for name, image, show in (
        (f"Chance within {radius:g} m", _chances(found, found.mass_within(radius)), not near),
        ("Chance of a cell", _chances(found, found.chances), near),
        ("Regions of 50, 90 and 99 %", _regions(found), False),
    ):
        add_image(chosen, *image, name=name, opacity=0.85, dark="flip", show=show)


def _chances(found: Posterior, chances: NDArray[np.float64]) -> tuple[bytes, list[list[float]]]:
    """Return an image of a chance of each cell."""
    levels = np.digitize(chances, list(CELL_CHANCES))
    return _image(found, levels, list(CELL_CHANCES.values()))


def _regions(found: Posterior) -> tuple[bytes, list[list[float]]]:
    """Return an image of the fewest cells that hold each share of the chance."""
    shares = sorted(CHANCES, reverse=True)
    levels = np.zeros(len(found.database), np.int64)
    for level, share in enumerate(shares, start=1):
        levels[found.credible_cells(share)] = level
    return _image(found, levels, [CHANCES[share] for share in shares])


def _image(
    found: Posterior, levels: NDArray[np.int64], colours: list[str]
) -> tuple[bytes, list[list[float]]]:
    """Return an image of the cells that have a level above 0, and of the likeliest."""
    some = np.union1d(np.flatnonzero(levels), [int(found.chances.argmax())])
    return level_image(found.database.select(some), levels[some].astype(np.uint8), colours)


class _Drawn:
    """What the script of the page draws of a location."""

    def __init__(self, location: Location) -> None:
        self.location = location
        self.database = location.posterior.database
        self.titles = {item.name: item.title for item in self.database.taxonomy.classes}

    def latlon(self, xy: ArrayLike) -> list[list[float]]:
        places = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        found: list[list[float]] = to_latlon(places, self.database.crs, digits=7).tolist()
        return found

    def view(self) -> NDArray[np.float64]:
        """Return the corners of what is shown first."""
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
        turn, angle = np.radians(bearing), np.linspace(0.0, 2.0 * np.pi, ELLIPSE_STEPS + 1)
        along, across = longer * np.cos(angle), shorter * np.sin(angle)
        ring = np.column_stack(
            [
                place.x + along * np.sin(turn) + across * np.cos(turn),
                place.y + along * np.cos(turn) - across * np.sin(turn),
            ]
        )
        (centre,) = self.latlon([place.x, place.y])
        given = location.answer.given
        colour = SUCCESSFUL if given else FAILED
        details = [
            f"{location.answer.mass:.1%} within {location.rule.radius:g} m",
            _position(centre),
            (
                f"{place.sigma:.1f} m each way; 90 %: {longer:.1f} m along {bearing:.0f}°, "
                f"{shorter:.1f} m across"
            ),
            _north(place.heading, place.heading_sigma),
            str(location.cell_id),
        ]
        name = "The answer" if given else "Cannot tell: the best place"
        outline = {"color": colour, "weight": 3, "opacity": 0.9}
        return [
            ["lines", [[outline, [self.latlon(ring)]]]],
            ["points", PLACE_FIELDS, {}, [[centre, colour, 6, None, name, details]]],
        ]

    def candidates(self) -> list[list[Any]]:
        """Return the candidates, likeliest first."""
        rows = self.location.candidates
        asked = query_signature(self.location.query, self.database.taxonomy)
        records = []
        places = self.latlon(rows[["x", "y"]].to_numpy())
        for place, row in zip(places, rows.to_dict("records"), strict=True):
            details = [
                asked,
                cell_signature(self.database, row["cell"]),
                f"{row['chance']:.2%}",
                f"{row['loglik']:.2f}",
                _north(row.get("heading")),
                str(row["cell_id"]),
                _position(place),
            ]
            name = f"Rank {row['rank']:,} of {len(self.database):,}"
            records.append([place, "#ffffff", 8, None, name, details, str(row["rank"])])
        return records

    def explanation(self, why: Explanation) -> list[list[Any]]:
        """Return the rays of the query and the street objects."""
        rays: dict[str, list[list[list[float]]]] = {verdict: [] for verdict in VERDICTS}
        records = []
        for row, shape in zip(why.to_dict()["rows"], why.table.geometry, strict=True):
            verdict = row["verdict"]
            away = self.database.reach if row["distance"] is None else row["distance"]
            seen = row["query_bearing"]
            bearing = np.radians(row["object_bearing"] if seen is None else seen)
            end = np.array(why.xy) + away * np.array([np.sin(bearing), np.cos(bearing)])
            rays[verdict].append(self.latlon(np.stack([np.array(why.xy), end])))
            at = end if shape is None else np.array([shape.x, shape.y])
            details = [
                f"{row['chance']:.2f}",
                self._title(row["query_class"]),
                _degrees(seen),
                self._title(row["object_class"]),
                _degrees(row["object_bearing"], row["distance"]),
                None if row["bearing_error"] is None else f"{row['bearing_error']:+.1f}°",
                row["source"],
                row["source_id"],
            ]
            name = verdict.capitalize()
            records.append([*self.latlon(at), VERDICTS[verdict], 6, None, name, details])
        looks = [
            [
                {
                    "color": "#808080" if verdict == "missed" else colour,
                    "weight": 1 if verdict == "missed" else 2,
                    "opacity": 0.9,
                    "dashArray": {"matched": None, "misnamed": "9 4"}.get(verdict, "3 5"),
                },
                rays[verdict],
            ]
            for verdict, colour in VERDICTS.items()
        ]
        return [["lines", looks], ["points", OBJECT_FIELDS, {}, records]]

    def _title(self, name: str | None) -> str | None:
        """Return the title of a class; "unknown" and nothing stay what they are."""
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
