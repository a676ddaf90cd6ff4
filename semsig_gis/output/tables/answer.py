"""Answers as tables and sentences, in the order in which a terminal prints them."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import Table, figure, percent, signed_degrees, to_degrees
from semsig_gis.localization import VERDICTS, Location
from semsig_gis.observation import ANY_ERROR, GRID_NORTH, View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from semsig_gis.core import Taxonomy
    from semsig_gis.localization import Answer, ClassQuestion, Explanation, Localization
    from semsig_gis.observation import Photo

NO_DIRECTION = "said without direction"
"""The verdict on an object of a class that was said without a direction."""
LINKS = 2  # addresses below an answer; the details have all
QUESTIONS = 5  # best ones of those to ask next; the details have all
EXPLANATION = (
    *("verdict", "chance", "seen", "at", "object", "at", "off by", "distance", "source", "id"),
)


def answer_summary(answer: Location | Localization) -> Iterator[Table | str]:
    """Yield what a person reads of an answer: the place, links, and what was understood.

    If there are explanations, they are between the two.
    """
    if isinstance(answer, Location):
        yield from place_sentences(answer)
    else:
        (lon, lat), place = to_degrees(answer.crs).transform(*answer.xy), _place(answer)
        yield f"Most similar: {lat:.6f}, {lon:.6f} (lat, lon){place}, by {answer.used}."
        yield from tie_sentences(answer)
    for title, address in itertools.islice(answer.links.items(), LINKS):
        yield f"{title}: {address}"
    if isinstance(answer, Location):
        for rank, explanation in enumerate(answer.explanations, 1):
            yield _explanation_table(rank, explanation, answer)
        yield from _known_sentences(answer.known)
    yield from (*query_sentences(answer), *north_sentences(answer), *note_sentences(answer))


def answer_tables(
    answer: Location | Localization, *, symbols: bool = False
) -> Iterator[Table | str]:
    """Yield the details of an answer: the position in metres, the candidates and all links.

    With `symbols`, the classes of the candidates are letters instead of words.
    """
    cells = f"{answer.cells:,} cells"
    number = len(answer.columns["cell"])
    if isinstance(answer, Location):
        yield from position_sentences(answer)
        title = f"{number} best places in {cells} (noise: {answer.noise})"
        yield _candidate_table(answer, title, "chance", percent, symbols=symbols)
    else:
        title = f"{number} best of {cells}, by {answer.used}"
        yield _candidate_table(answer, title, "distance", figure, symbols=symbols)
    for title, address in itertools.islice(answer.links.items(), LINKS, None):
        yield f"{title}: {address}"


def cities_summary(locations: Mapping[str, Location], elsewhere: float) -> list[str]:
    """Return the chance of each of some cities, the likeliest place, and the query."""
    name, best = likeliest_city(locations)
    chances = (
        f"{area}: chance {percent(1.0 - location.elsewhere)}."
        for area, location in locations.items()
    )
    return [
        *chances,
        f"elsewhere: chance {percent(elsewhere)}.",
        f"In {name}:",
        *place_sentences(best),
        *query_sentences(best),
        *note_sentences(*locations.values()),
    ]


def cities_tables(
    locations: Mapping[str, Location], elsewhere: float, *, top: int, symbols: bool = False
) -> list[Table]:
    """Return the table of the best candidates of some cities."""
    _, best = likeliest_city(locations)
    rows = city_candidates(locations, top)
    cells = sum(location.cells for location in locations.values())
    places = (
        (
            *(f"{row['rank']:,}", row["city"], str(row["cell_id"])),
            *(f"{row['lat']:.6f}", f"{row['lon']:.6f}", percent(row["chance"])),
            _classes_text(row["types"], locations[row["city"]].taxonomy, symbols=symbols),
        )
        for row in rows
    )
    title = f"{len(rows)} best places in {cells:,} cells of {len(locations)} cities"
    table = Table(
        f"{title} (noise: {best.noise})",
        ("rank", "city", "cell", "lat", "lon", "chance", SEEN_THERE),
        (*places, ("", "elsewhere", "", "", "", percent(elsewhere), "")),
        minor=MINOR,
    )
    return [table]


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
            *_position(*location.xy, *location.latlon[::-1]),
            f"{location.estimate.sigma:.1f}",
            percent(location.answer.mass),
            "yes" if location.answer.given else "cannot tell",
            location.place,
        )
        for name, location in zip(names, locations, strict=True)
    )
    heads = ("view", *POSITION, "± m, if there", "chance", "answered", "place")
    table = Table(f"{len(locations)} views of {city}", heads, tuple(rows), minor=MINOR)
    return [table, *place_sentences(locations[-1]), *note_sentences(*locations)]


def suggest_summary(questions: Sequence[ClassQuestion], location: Location) -> Iterator[str]:
    """Yield the best questions to ask next, with the place, the query and notes of the answer."""
    yield from place_sentences(location)
    for number, question in enumerate(questions[:QUESTIONS], start=1):
        yield f"{number}. {question.text} (yes: chance {percent(question.chance)})"
    yield from (*query_sentences(location), *note_sentences(location))


def suggest_tables(questions: Iterable[ClassQuestion]) -> list[Table]:
    """Return a table of all questions, most useful first."""
    rows = (
        (question.text, percent(question.chance), f"{round(question.gain, 4):.3f}")
        for question in questions
    )
    return [Table("What to look for next", ("question", "yes", "bits"), tuple(rows))]


def place_sentences(location: Location) -> list[str]:
    """Return the place of an answer by likelihood, and whether it is certain enough.

    Without an answer, the region comes first.
    """
    sure, (lat, lon) = location.answer.given, location.latlon
    place = (
        f"{'' if sure else 'Best place: '}{lat:.6f}, {lon:.6f} (lat, lon){_place(location)}: "
        f"within {location.rule.radius:g} m with a chance of {percent(location.answer.mass)}."
    )
    doubt = [location.doubt] if location.doubt else []
    region = [] if sure else [f"Cannot tell. {location.region_text}."]
    return [*region, *doubt, place]


def _place(answer: Answer) -> str:
    return f", {answer.place}" if answer.place else ""


def position_sentences(location: Location) -> list[str]:
    """Return the position in metres and the heading of an answer by likelihood, and its region.

    Without an answer, they begin with "if it is there", and the region is elsewhere.
    """
    estimate, sure = location.estimate, location.answer.given
    x, y, *_ = _position(*location.xy, *location.latlon[::-1])
    there = "" if sure else "If it is there: "
    longer, shorter, bearing = estimate.ellipse()
    sentences = [
        (
            f"{there or 'Position: '}x {x}, y {y} ± {estimate.sigma:.1f} m "
            f"(90 %: {longer:.1f} m along {bearing:.0f}°, {shorter:.1f} m across)."
        )
    ]
    if estimate.heading is not None:
        north = "north of the query" if there else "North of the query:"
        sentences.append(
            f"{there}{north} {estimate.heading % 360.0:.1f}° ± {estimate.heading_sigma:.1f}° "
            f"from {location.north.name} north."
        )
    return [*sentences, f"{location.region_text}."] if sure else sentences


def query_sentences(answer: Answer) -> Iterator[str]:
    """Yield the query, photo by photo, as it was understood, and what is not there."""
    view = View.of(answer.query)
    for number, photo in enumerate(view.photos):
        rows = [row for row, owner in enumerate(view.photo_rows.tolist()) if owner == number]
        objects = ", ".join(_object_text(view, row, answer.taxonomy) for row in rows) or "nothing"
        sectors = ", ".join(f"{start:.4g} to {end % 360.0:.4g}°" for start, end in photo.sectors)
        looked = f"; looked at {sectors}" if sectors else ""
        north = "" if photo.north_sigma is None else f"; north ± {photo.north_sigma:g}°"
        if photo.north_sigma == math.inf:
            north = "; north unknown"
        of = f" of photo {number + 1}" if len(view.photos) > 1 else ""
        yield f"Seen{of}: {objects}{looked}{north}."
    if view.signs:
        yield f"Read somewhere: {', '.join(map(repr, view.signs))}."
    if isinstance(answer, Location):
        yield from _fit_sentences(answer)
    knowledge = answer.known if isinstance(answer, Location) else {}
    for name, label in (("seen", "Seen somewhere"), ("absent", "Not there")):
        if titles := knowledge.get(name):
            yield f"{label}: {', '.join(titles).lower()}."


def _fit_sentences(location: Location) -> Iterator[str]:
    """Yield the names of the map that each text fits."""
    for record in location.texts:
        if names := record["names"]:
            count, street = record["count"], record["kind"] == "street"
            objects = "1 object" if count == 1 else f"{count:,} objects"
            if record["fit"] == "exact":
                place = "the name of a street" if street else f"written on {objects} of the map"
                yield f"{record['text']!r} is {place}."
                continue
            fit = "fits" if record["fit"] == "part" else "is nearly"
            place = "the name of a street" if street else f"on {objects}"
            verb = "is" if len(names) == 1 or street else "are"
            yield f"{record['text']!r} {fit} {' or '.join(map(repr, names))}, which {verb} {place}."


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
    answer: Answer, title: str, score: str, score_text: Callable[[float], str], *, symbols: bool
) -> Table:
    """Return the table of candidates, with a column of scores."""
    rows = []
    for row in answer.candidate_rows():
        low, high = (row.get(name, row.get("rank")) for name in ("rank_low", "rank_high"))
        rank = f"{low:,}" if low == high else f"{low}-{high}"
        position = _position(row["x"], row["y"], row["lon"], row["lat"])
        classes = _classes_text(row["types"], answer.taxonomy, symbols=symbols)
        rows.append((rank, str(row["cell_id"]), *position, score_text(row[score]), classes))
    heads = ("rank", "cell", *POSITION, score, SEEN_THERE)
    return Table(title, heads, tuple(rows), minor=MINOR)


def _classes_text(types: str, taxonomy: Taxonomy, *, symbols: bool) -> str:
    return types if symbols else taxonomy.words(taxonomy.encode(types))


SEEN_THERE = "seen from there"
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
    """Return an object of a query: ``street light at 80° ± 13° 7.3 m away``."""
    parts = []
    item = view.select(np.array([row]))
    scores = item.class_scores()[0].tolist()
    if len({*scores} - {0.0}) > 1:
        listed = ((taxonomy.words([code]), score) for code, score in enumerate(scores) if score)
        parts.append(" or ".join(f"{words} {score:.2g}" for words, score in listed))
    else:
        parts += [taxonomy.title_of(name).lower() for name in item.class_names(taxonomy)]
    if view.bearings is not None:
        error = math.nan if view.bearing_errors is None else view.bearing_errors[row]
        spread = "" if math.isnan(error) else f" ± {error:.2g}°"
        photo = view.photos[int(view.photo_rows[row])]
        direction = f"{_direction(float(view.bearings[row]), photo)}{spread}"
        parts.append("somewhere" if error >= ANY_ERROR else direction)
    if view.ranges is not None and not math.isnan(view.ranges[row]):
        parts.append(f"{view.ranges[row]:.2g} m away")
    if text := view.text_rows[row]:
        parts.append(f"that reads {text!r}")
    return " ".join(parts)


def _direction(bearing: float, photo: Photo) -> str:
    """Return the direction of an object: from north, or from the direction of sight.

    The latter if north is not known and the photo, if it is no full turn, looks at 0.
    """
    middles = {(start + end) / 2.0 % 360.0 for start, end in photo.sectors}
    if photo.north_sigma != math.inf or middles - {0.0}:
        return f"at {bearing:.4g}°"
    away = float(signed_degrees(bearing))
    if away in {0.0, -180.0}:
        return "behind" if away else "ahead"
    return f"{abs(away):.4g}° {'right' if away > 0 else 'left'}"


def _explanation_table(rank: int, explanation: Explanation, answer: Location) -> Table | str:
    """Return the counts of a candidate; for the best one, a table of its objects."""
    rows: list[Any] = [dict(row) for row in explanation.rows]
    undirected, _ = answer.without_direction(explanation)
    for number in undirected:
        rows[number] |= {"verdict": NO_DIRECTION, "query_class": rows[number]["object_class"]}
    verdicts = [*VERDICTS, *([NO_DIRECTION] if undirected else [])]
    counts = Counter(row["verdict"] for row in rows)
    outside = len(rows) - sum(counts[verdict] for verdict in verdicts)
    texts = [f"{counts[verdict]} {verdict}" for verdict in verdicts]
    summary = ", ".join(texts) + (f"; {outside} outside the photos" if outside else "")
    lon, lat = to_degrees(answer.crs).transform(*explanation.xy)
    title = f"Place {rank}, {lat:.6f}, {lon:.6f} (lat, lon): {summary}."
    if rank > 1:
        return title

    def said(name: str | None, text: str | None = None) -> str:
        title = "" if name is None else answer.taxonomy.title_of(name).lower()
        return f"{title} {text!r}" if text else title

    def measure(value: float | None, spec: str, unit: str, before: str = "") -> str:
        return "" if value is None else f"{before}{value:{spec}}{unit}"

    def bearing_text(bearing: float | None) -> str:
        return measure(None if bearing is None else answer.north.from_grid(bearing), ".1f", "°")

    shown = sorted(
        (row for row in rows if row["verdict"] in verdicts),
        key=lambda row: verdicts.index(row["verdict"]),
    )
    return Table(
        title,
        EXPLANATION,
        tuple(
            (
                row["verdict"],
                f"{row['chance']:.2f}",
                said(row["query_class"], row["query_text"]),
                bearing_text(row["query_bearing"]) + measure(row["query_range"], ".1f", " m", ", "),
                said(row["object_class"], row["query_text"] and row["object_text"]),
                bearing_text(row["object_bearing"]),
                measure(row["bearing_error"], "+.1f", "°"),
                measure(row["distance"], ".1f", " m"),
                row["source"] or "",
                row["source_id"] or "",
            )
            for row in shown
        ),
        minor=("source", "id"),
    )
