"""Answers as tables and sentences, in the order in which a terminal prints them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from semsig_gis.core import WILDCARD, Table, figure, percent
from semsig_gis.localization import Location
from semsig_gis.observation import GRID_NORTH, View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from semsig_gis.core import Taxonomy
    from semsig_gis.localization import Answer, ClassQuestion, Explanation, Localization
    from semsig_gis.observation import North

EXPLANATION = (
    *("verdict", "chance", "seen", "at", "object", "at", "off by", "distance", "source", "id"),
)


def answer_summary(answer: Location | Localization) -> Iterator[Table | str]:
    """Yield what a person reads of an answer: the place, and how the query was understood.

    If there are explanations, they are between the two.
    """
    if isinstance(answer, Location):
        yield from place_sentences(answer)
        for rank, explanation in enumerate(answer.explanations, 1):
            yield _explanation_table(rank, explanation, answer.north)
        yield from _known_sentences(answer.known)
    else:
        yield from tie_sentences(answer)
    yield from (*query_sentences(answer), *north_sentences(answer), *note_sentences(answer))


def answer_tables(answer: Location | Localization) -> Iterator[Table]:
    """Yield the table of the candidates of an answer."""
    cells = f"{answer.cells:,} cells"
    number = len(answer.columns["cell"])
    if isinstance(answer, Location):
        title = f"{number} best places in {cells} (noise: {answer.noise})"
        yield _candidate_table(answer, title, "chance", percent)
    else:
        title = f"{number} best of {cells}, by {answer.used}"
        yield _candidate_table(answer, title, "distance", figure)


def cities_summary(locations: Mapping[str, Location], elsewhere: float) -> Iterator[str]:
    """Yield the chance of each of some cities, the likeliest place, and the query."""
    name, best = likeliest_city(locations)
    for area, location in locations.items():
        yield f"{area}: chance {percent(1.0 - location.elsewhere)}."
    yield f"elsewhere: chance {percent(elsewhere)}."
    yield f"In {name}:"
    yield from (
        *place_sentences(best),
        *query_sentences(best),
        *note_sentences(*locations.values()),
    )


def cities_tables(
    locations: Mapping[str, Location], elsewhere: float, *, top: int
) -> Iterator[Table]:
    """Yield the table of the best candidates of some cities."""
    _, best = likeliest_city(locations)
    rows = city_candidates(locations, top)
    cells = sum(location.cells for location in locations.values())
    places = (
        (
            *(f"{row['rank']:,}", row["city"], str(row["cell_id"])),
            *(f"{row['lat']:.6f}", f"{row['lon']:.6f}", percent(row["chance"]), row["types"]),
        )
        for row in rows
    )
    yield Table(
        f"{len(rows)} best places in {cells:,} cells of {len(locations)} cities "
        f"(noise: {best.noise})",
        ("rank", "city", "cell", "lat", "lon", "chance", "types"),
        (*places, ("", "elsewhere", "", "", "", percent(elsewhere), "")),
        minor=MINOR,
    )


def likeliest_city(locations: Mapping[str, Location]) -> tuple[str, Location]:
    """Return the name and the answer of the city with the likeliest place."""
    return max(locations.items(), key=lambda pair: pair[1].answer.mass)


def city_candidates(locations: Mapping[str, Location], top: int) -> list[dict[str, Any]]:
    """Return the likeliest candidates of all cities as plain values, with the name of the city."""
    rows: list[dict[str, Any]] = [
        {"city": name, **candidate}
        for name, location in locations.items()
        for candidate in location.to_dict()["candidates"]
    ]
    rows = sorted(rows, key=lambda row: -row["chance"])[:top]
    return [{**row, "rank": rank} for rank, row in enumerate(rows, 1)]


def route_summary(
    city: str, names: Iterable[object], locations: Sequence[Location]
) -> list[Table | str]:
    """Return the place of each view of a route, the last place in words, and the notes."""
    rows = (
        (
            str(name),
            *_position(location.estimate.x, location.estimate.y, *location.degrees),
            f"{location.estimate.sigma:.1f}",
            percent(location.answer.mass),
            "yes" if location.answer.given else "cannot tell",
        )
        for name, location in zip(names, locations, strict=True)
    )
    heads = ("view", *POSITION, "± m, if there", "chance", "answered")
    table = Table(f"{len(locations)} views of {city}", heads, tuple(rows), minor=MINOR)
    return [table, *place_sentences(locations[-1]), *note_sentences(*locations)]


def suggest_summary(questions: Iterable[ClassQuestion], location: Location) -> list[Table | str]:
    """Return what to look for next, with the place, the query and the notes of the answer."""
    rows = (
        (row.text, row.item.symbol, percent(row.chance), f"{round(row.gain, 4):.3f}")
        for row in questions
    )
    table = Table("What to look for next", ("question", "symbol", "yes", "bits"), tuple(rows))
    sentences = *place_sentences(location), *query_sentences(location), *note_sentences(location)
    return [table, *sentences]


def place_sentences(location: Location) -> list[str]:
    """Return the place of an answer by likelihood, and whether it is certain enough.

    Without an answer, the region comes first, and the position only with "if it is there".
    """
    estimate, sure = location.estimate, location.answer.given
    x, y, lat, lon = _position(estimate.x, estimate.y, *location.degrees)
    best, there = ("", "") if sure else ("Best place: ", "If it is there: ")
    chance = f"within {location.rule.radius:g} m of it: chance {percent(location.answer.mass)}"
    longer, shorter, bearing = estimate.ellipse()
    place = [
        f"{best}{lat}, {lon} (lat, lon), {chance}.",
        (
            f"{there or 'Position: '}x {x}, y {y} ± {estimate.sigma:.1f} m "
            f"(90 %: {longer:.1f} m along {bearing:.0f}°, {shorter:.1f} m across)."
        ),
    ]
    if estimate.heading is not None:
        north = "north of the query" if there else "North of the query:"
        place.append(
            f"{there}{north} {estimate.heading % 360.0:.1f}° ± {estimate.heading_sigma:.1f}° "
            f"from {location.north.name} north."
        )
    doubt = [location.doubt] if location.doubt else []
    region = f"{location.region_text}."
    return [*doubt, *place, region] if sure else [f"Cannot tell. {region}", *doubt, *place]


def query_sentences(answer: Answer) -> Iterator[str]:
    """Yield the query, photo by photo, as it was understood."""
    view = View.of(answer.query)
    for number, photo in enumerate(view.photos):
        rows = [row for row, owner in enumerate(view.photo_rows.tolist()) if owner == number]
        objects = ", ".join(_object_text(view, row, answer.taxonomy) for row in rows) or "nothing"
        sectors = ", ".join(f"{start:.4g}-{end % 360.0:.4g}°" for start, end in photo.sectors)
        looked = f"; looked at {sectors}" if sectors else ""
        north = "" if photo.north_sigma is None else f"; north ± {photo.north_sigma:g}°"
        if photo.north_sigma == math.inf:
            north = "; north unknown"
        of = f" of photo {number + 1}" if len(view.photos) > 1 else ""
        yield f"Seen{of}: {objects}{looked}{north}."
    knowledge = answer.known if isinstance(answer, Location) else {}
    for name, label in (("seen", "Seen somewhere"), ("absent", "Not there")):
        if titles := knowledge.get(name):
            yield f"{label}: {', '.join(titles)}."


def tie_sentences(answer: Localization) -> Iterator[str]:
    """Yield the number of cells that tie with the last candidate, if there are any."""
    if tied := answer.tied_beyond:
        more = "1 further cell ties" if tied == 1 else f"{tied:,} further cells tie"
        yield f"{more} with the last one."


def north_sentences(answer: Answer) -> Iterator[str]:
    """Yield the north of the query, unless it is grid north."""
    if answer.north != GRID_NORTH:
        turn = answer.north.turn % 360.0
        yield f"Bearings are measured from {answer.north}, at {turn:.1f}° from grid north."


def note_sentences(*answers: Answer) -> Iterator[str]:
    """Yield the notes on queries, equal ones once."""
    for note in dict.fromkeys(note for answer in answers for note in answer.notes):
        yield f"Note: {note}"


def _candidate_table(
    answer: Answer, title: str, score: str, score_text: Callable[[float], str]
) -> Table:
    """Return the table of candidates, with a column of scores."""
    rows = []
    for row in answer.candidate_rows():
        low, high = (row.get(name, row.get("rank")) for name in ("rank_low", "rank_high"))
        rank = f"{low:,}" if low == high else f"{low}-{high}"
        position = _position(row["x"], row["y"], row["lon"], row["lat"])
        rows.append((rank, str(row["cell_id"]), *position, score_text(row[score]), row["types"]))
    heads = ("rank", "cell", *POSITION, score, "types")
    return Table(title, heads, tuple(rows), minor=MINOR)


POSITION = ("x", "y", "lat", "lon")
MINOR = ("cell", "x", "y")  # a place for people is in degrees


def _position(x: float, y: float, lon: float, lat: float) -> tuple[str, str, str, str]:
    return f"{x:.1f}", f"{y:.1f}", f"{lat:.6f}", f"{lon:.6f}"


def _known_sentences(knowledge: Mapping[str, Any]) -> Iterator[str]:
    """Yield what was known of the place in addition to the query."""
    if near := knowledge.get("near"):
        yield (
            f"Known: near {near['lat']:.6f}, {near['lon']:.6f} (lat, lon), x {near['x']:.1f}, "
            f"y {near['y']:.1f}, ± {near['sigma']:g} m, read as {near['read_as']}."
        )
    if area := knowledge.get("area"):
        yield f"Known: in the area {area['file']}, which has {area['cells']:,} cells."
    if popularity := knowledge.get("popularity"):
        yield f"Known: places are weighted by {popularity['file']}."
    if require := knowledge.get("require"):
        yield f"Known: {require['text']} is in sight, as in {require['cells']:,} cells."


def _object_text(view: View, row: int, taxonomy: Taxonomy) -> str:
    """Return an object of a query: ``D 80°, 7.3 m ± 56 %``."""
    parts = []
    if view.scores is not None:
        names = {item.code: item.name for item in taxonomy.classes} | {WILDCARD: "unknown"}
        scores = enumerate(view.scores[row].tolist())
        parts.append(" or ".join(f"{names[code]} {score:.2g}" for code, score in scores if score))
    elif view.codes is not None:
        parts.append(taxonomy.decode(view.codes[row : row + 1]))
    if view.bearings is not None:
        parts.append(f"{view.bearings[row]:.4g}°")
    if view.ranges is not None and not math.isnan(view.ranges[row]):
        error = math.nan if view.range_errors is None else view.range_errors[row]
        spread = "" if math.isnan(error) else f" ± {percent(error, 0)}"
        parts.append(f"{view.ranges[row]:.3g} m{spread}")
    return " ".join(parts)


def _explanation_table(rank: int, explanation: Explanation, north: North) -> Table | str:
    """Return the counts of a candidate; for the best one, a table of its objects."""
    rows, counts = explanation.rows, explanation.counts
    outside = len(rows) - sum(counts.values())
    texts = [f"{count} {verdict}" for verdict, count in counts.items()]
    summary = ", ".join(texts) + (f"; {outside} outside the photos" if outside else "")
    x, y = explanation.xy
    title = f"Rank {rank}, at x {x:.1f}, y {y:.1f}: {summary}"
    if rank > 1:
        return title

    def measure(value: float | None, spec: str, unit: str, before: str = "") -> str:
        return "" if value is None else f"{before}{value:{spec}}{unit}"

    def bearing_text(bearing: float | None) -> str:
        return measure(None if bearing is None else north.from_grid(bearing), ".1f", "°")

    shown = sorted(
        (row for row in rows if row["verdict"] in counts),
        key=lambda row: [*counts].index(row["verdict"]),
    )
    return Table(
        title,
        EXPLANATION,
        tuple(
            (
                row["verdict"],
                f"{row['chance']:.2f}",
                row["query_class"] or "",
                bearing_text(row["query_bearing"]) + measure(row["query_range"], ".1f", " m", ", "),
                row["object_class"] or "",
                bearing_text(row["object_bearing"]),
                measure(row["bearing_error"], "+.1f", "°"),
                measure(row["distance"], ".1f", " m"),
                row["source"] or "",
                row["source_id"] or "",
            )
            for row in shown
        ),
    )
