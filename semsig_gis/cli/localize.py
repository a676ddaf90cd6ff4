"""`semsig localize`: queries, and where they were seen from."""

from __future__ import annotations

import sys
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli.console import (
    MOST_METRES,
    AsJson,
    MethodText,
    Paper,
    chosen_method,
    keep_inputs,
    print_json,
    print_rows,
    progress,
    remark,
    require_suffix,
    say,
    warn_if_online,
)
from semsig_gis.cli.maps import draw_ground
from semsig_gis.cli.options import (
    Explain,
    QueryOptions,
    SearchOptions,
    Top,
    command,
    seen_north,
)
from semsig_gis.core import LIKELIHOOD, EmptyResultError, InputError, UnknownNameError, percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.database import City, PartitionedDatabase, SignatureDatabase
    from semsig_gis.localization import Answer, Locator, Method
    from semsig_gis.observation import North, QueryLine, View


@dataclass(frozen=True, kw_only=True)
class RankedOptions(QueryOptions):
    """One query or many, and what ranks the cells."""

    queries: Annotated[
        str | None,
        typer.Option(
            help="File of many queries, as CSV or JSON lines, or - for JSON lines from "
            "standard input. Prints a line of JSON for each: an answer or an error."
        ),
    ] = None
    method: MethodText = None
    paper: Paper = False

    @property
    def ranking(self) -> str:
        """The text of the method."""
        return chosen_method(self.method, paper=self.paper)

    @property
    def source(self) -> str:
        """What messages call the file of the queries."""
        return "standard input" if self.queries == "-" else str(self.queries)

    def read_queries(self, dataset: SignatureDatabase | PartitionedDatabase) -> Iterator[QueryLine]:
        """Return the queries of --queries, each when it is needed."""
        from semsig_gis.observation import parse_queries, read_queries

        city: dict[str, Any] = {"taxonomy": dataset.taxonomy, "radius": dataset.spec.radius}
        if self.queries == "-":
            return parse_queries(sys.stdin.buffer, self.source, **city)
        return read_queries(self.source, **city)


@dataclass(frozen=True, kw_only=True)
class LocalizeOptions(SearchOptions, RankedOptions):
    """The options of `semsig localize`."""

    top: Top = 10
    explain: Explain = False
    map_: Annotated[Path | None, typer.Option("--map", help="Map to write (.html).")] = None
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write: search regions and candidates for QGIS (.gpkg) or in degrees "
            "(.geojson, .kml), only the regions (.parquet, .fgb, .csv), or the chance of every "
            "cell (.tif)."
        ),
    ] = None
    share: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=1,
            help="Total chance of the regions of --out.  [default: 0.9]",
        ),
    ] = None
    within: Annotated[
        float,
        typer.Option(min=0, max=MOST_METRES, help="Metres to add around the cells of --out."),
    ] = 0.0
    as_json: AsJson = False

    def __post_init__(self) -> None:
        """Refuse options that do not go together."""
        single = ("types", "bearings", "ranges", "fov", "look", "sectors", "map_", "out")
        given = [f"--{name.strip('_')}" for name in single if getattr(self, name) is not None]
        given = ([] if self.seen is None else [repr(self.seen)]) + given
        if self.queries is not None and given:
            raise InputError(
                f"--queries was given with {' and '.join(given)}; give a file or one query."
            )
        if self.out is None and (self.share is not None or self.within):
            raise InputError(
                "--share and --within apply to the regions of --out; give --out as well."
            )
        read = (self.database, self.objects, self.area, self.popularity, self.rule, self.noise)
        keep_inputs(self.map_, self.out, read=(*read, self.drift_report))
        require_suffix(".html", self.map_)
        if self.writes_chances and (self.share is not None or self.within):
            raise InputError(
                f"{self.out} would contain the chance of every cell, but --share and --within "
                "apply to regions; leave them out, or write a GeoPackage."
            )
        if self.ranking != LIKELIHOOD:
            self._refuse_likelihood()

    @property
    def writes_chances(self) -> bool:
        """Whether the file holds the chances of all cells, and no regions."""
        return self.out is not None and self.out.suffix.lower() in {".tif", ".tiff"}

    def _refuse_likelihood(self) -> None:
        """Refuse options that only the likelihood has."""
        names = [field.name for field in fields(SearchOptions) if field.name != "require"]
        options = [
            f"--{name.replace('_', '-')}"
            for name in (*names, "explain", "share")
            if getattr(self, name) != getattr(LocalizeOptions, name)  # the default
        ]
        if options:
            raise InputError(
                f"{' and '.join(options)} {'works' if len(options) == 1 else 'work'} only with the "
                f"likelihood method, not with {self.ranking!r}; leave out one or the other."
            )


@command(LocalizeOptions)
def localize(options: LocalizeOptions) -> None:
    """Find where a view was seen from, or many views.

    --explain, --share and the options from --noise to --objects work only with the likelihood
    method.
    """
    from semsig_gis.database import open_city

    method = None
    if options.ranking != LIKELIHOOD:
        from semsig_gis.localization import Method

        method = Method.parse(options.ranking)
    city = open_city(options.database)

    # Queries are read before the index, which takes much longer than to find a slip in a query.
    north = seen_north(city, options.north, options.date)

    if options.queries is None:
        query = options.query(city.dataset, others=", or --queries")
        others = options.unplaced(city.dataset)
        locator = _locator(options, city, method, north)
        _answer(options, city, _beside(locator, query, *others, ranking=options.ranking), query)
        return
    queries = options.read_queries(city.dataset)
    _answer_lines(queries, _locator(options, city, method, north), options)


def _beside(
    locator: Locator[Any],
    query: View,
    unplaced: Sequence[int],
    absent: Sequence[int],
    *,
    ranking: str,
) -> Locator[Any]:
    """Return what answers a query given what else was seen, and was not."""
    if not unplaced and not absent:
        return locator
    if ranking != LIKELIHOOD:
        what = "objects without a direction beside others" if unplaced else "what is not there"
        raise InputError(
            f"the query has {what}, which the method {ranking!r} cannot take; give directions to "
            "all objects or to none, or leave out the method."
        )
    from semsig_gis.localization import with_unplaced

    likelihood: Any = locator
    return with_unplaced(likelihood, query, unplaced, absent=absent)


def _locator(
    options: LocalizeOptions, city: City, method: Method | None, north: North
) -> Locator[Any]:
    """Return what answers the queries."""
    taxonomy, top = city.dataset.taxonomy, options.top
    if method is None:
        usual = options.usual_noise(taxonomy)
        return options.locator(city, north, usual_noise=usual, top=top, explain=options.explain)
    from semsig_gis.localization import Requirement, make_locator

    require = options.require
    requirement = None if require is None else Requirement.parse(require, taxonomy)
    return make_locator(city, method, requirement=requirement, top=top, north=north)


def _answer_lines(
    queries: Iterable[QueryLine], locator: Locator[Any], options: LocalizeOptions
) -> None:
    """Print an answer for each line, or its error, as soon as there is one.

    Lines of a file are answered side by side, those of standard input one by one as they come.
    """
    from semsig_gis.core import each_in_order

    source, first_error, answered, failed = options.source, "", 0, 0

    def answer(one: QueryLine) -> tuple[QueryLine, dict[str, Any]]:
        try:
            if isinstance(one.query, InputError):
                raise one.query
            others = one.unplaced, one.absent
            beside = _beside(locator, one.query, *others, ranking=options.ranking)
            return one, beside.locate(one.query).to_dict()
        except (EmptyResultError, InputError, UnknownNameError) as error:
            return one, {"error": str(error)}

    side_by_side = options.queries != "-"
    for one, result in each_in_order(answer, queries) if side_by_side else map(answer, queries):
        if error := result.get("error"):
            first_error = first_error or error
            failed += 1
        else:
            answered += 1
        print_json({"id": one.name, "line": one.line, **result}, indent=None)
    if not answered:
        what = f"is answered: {first_error}" if failed else "was found; give one on each line."
        raise InputError(f"no query of {source} {what}")
    if failed:
        of = f"{failed:,} of {answered + failed:,} queries of {source}"
        remark(f"{of} could not be answered; the field 'error' of each says why.")


def _answer(options: LocalizeOptions, city: City, locator: Locator[Any], query: View) -> None:
    """Answer a query, draw and write what is asked for, and print it."""
    with progress("answering"):
        answer = locator.locate(query)
    if options.map_ is not None:
        from semsig_gis.maps import localization_map, location_map, save_map

        with progress("drawing the map"):
            if options.ranking == LIKELIHOOD:
                map_ = location_map(answer)
            else:
                map_ = localization_map(answer, city.database)
            draw_ground(map_, city)
            warn_if_online(save_map(map_, options.map_))
    result = answer.to_dict()
    if options.out is not None:
        searched = _write(options, options.out, city, answer, locator)
        result |= {} if options.writes_chances else {"searched": searched}
    if options.as_json:
        print_json(result)
        return
    print_answer(result)
    if options.map_ is not None:
        say(f"map: {options.map_}")
    if options.writes_chances:
        say(f"chances: {options.out}")
    elif options.out is not None:
        count = searched["regions"]
        say(
            f"to search: {count:,} region{'' if count == 1 else 's'}, {searched['km2']:.4g} km2, "
            f"{searched['percent']:.3g} % of the city: {options.out}"
        )


def _write(
    options: LocalizeOptions, out: Path, city: City, answer: Answer, locator: Locator[Answer]
) -> dict[str, Any]:
    """Write the regions to search, or all chances, and return what there is to say of regions."""
    from semsig_gis.exports import export_answer
    from semsig_gis.localization import REGION_SHARE

    if answer.tied_beyond:
        # No cell is left out of the search that is as good as the last candidate.
        answer = locator.locate(answer.query, top=options.top + answer.tied_beyond)
    share = REGION_SHARE if options.share is None else options.share
    regions = export_answer(answer, city.database, out, share=share, within=options.within)
    return regions.to_dict()


VERDICTS = ("matched", "misnamed", "missed", "false")
EXPLANATION = (
    *("verdict", "chance", "seen", "at", "object", "at", "off by", "distance", "source", "id"),
)


def print_answer(result: dict[str, Any]) -> None:
    """Print an answer, as its `to_dict` gives it."""
    by_chance = "noise" in result
    said = f"likelihood ({result['noise']} noise)" if by_chance else result["used"]
    score = "chance" if by_chance else "distance"
    candidates = result["candidates"]
    print_rows(
        f"{len(candidates)} best of {result['cells']:,} cells, by {said}",
        ("rank", "cell", "x", "y", "lon", "lat", score, "types"),
        [
            [
                row["rank"] if by_chance else _rank_text(row["rank_low"], row["rank_high"]),
                row["cell_id"],
                *(f"{row[axis]:.1f}" for axis in ("x", "y")),
                *(f"{row[axis]:.6f}" for axis in ("lon", "lat")),
                f"{row[score]:.4f}",
                row["types"],
            ]
            for row in candidates
        ],
    )
    if by_chance:
        _print_known(result["prior"] or {})
        _print_explanations(candidates)
        print_place(result)
    elif result["tied_beyond"]:
        tied = result["tied_beyond"]
        more = "1 further cell ties" if tied == 1 else f"{tied:,} further cells tie"
        say(f"{more} with the last one.")
    print_query(result)
    north = result["north"]
    if north["name"] != "grid":
        day = f" of {north['date']}" if north["date"] else ""
        say(
            f"Bearings are measured from {north['name']} north{day}, at "
            f"{north['turn'] % 360.0:.1f}° from grid north."
        )
    for note in result["notes"]:
        say(f"Note: {note}")


def print_query(result: dict[str, Any]) -> None:
    """Say again what was seen, photo by photo, as it was understood."""
    query = result["query"]
    photos = query.get("photos", [query])
    owners = query.get("photo", [0] * query["length"])
    for number, photo in enumerate(photos):
        rows = [row for row, owner in enumerate(owners) if owner == number]
        seen = ", ".join(_object_text(query, row) for row in rows) or "nothing"
        sectors = ", ".join(f"{start:.4g}-{end:.4g}°" for start, end in photo.get("sectors", ()))
        looked = f"; looked at {sectors}" if sectors else ""
        error = photo.get("heading_error")
        north = (
            "" if error is None else f"; north {error if error == 'unknown' else f'± {error:g}°'}"
        )
        of = f" of photo {number + 1}" if len(photos) > 1 else ""
        say(f"Seen{of}: {seen}{looked}{north}.")
    known = result.get("prior") or {}
    for name, said in (("seen", "Seen somewhere"), ("absent", "Not there")):
        if titles := known.get(name):
            say(f"{said}: {', '.join(titles)}.")


def _object_text(query: dict[str, Any], row: int) -> str:
    """Return an object of a query: ``D 80°, 7.3 m ± 56 %``."""
    parts = []
    if scores := query.get("scores"):
        parts.append(" or ".join(f"{name} {chance:.2g}" for name, chance in scores[row].items()))
    elif query["types"] is not None:
        parts.append(query["types"][row])
    if query["bearings"] is not None:
        parts.append(f"{query['bearings'][row]:.4g}°")
    metres, error = ((query.get(name) or {row: None})[row] for name in ("ranges", "range_errors"))
    if metres is not None:
        parts.append(f"{metres:.3g} m" + (f" ± {percent(error, 0)}" if error is not None else ""))
    return " ".join(parts)


def _print_known(prior: dict[str, Any]) -> None:
    """Say again what was known of the place, as it was understood."""
    if near := prior.get("near"):
        say(
            f"Known: near {near['lat']:.6f}, {near['lon']:.6f} (lat, lon), x {near['x']:.1f}, "
            f"y {near['y']:.1f}, ± {near['sigma']:g} m, read as {near['read_as']}."
        )
    if area := prior.get("area"):
        say(f"Known: in the area {area['file']}, which has {area['cells']:,} cells.")
    if popularity := prior.get("popularity"):
        say(f"Known: places are weighted by {popularity['file']}.")
    if require := prior.get("require"):
        say(f"Known: {require['text']} is in sight, as in {require['cells']:,} cells.")


def print_place(result: dict[str, Any]) -> None:
    """Print the place of an answer by likelihood, or that it cannot be told."""
    place, region = result["place"], result["region"]
    where = f"{place['lat']:.6f}, {place['lon']:.6f} (lat, lon)"
    chance = f"within {place['within_m']:g} m of it with a chance of {percent(place['chance'])}"
    if result["answered"]:
        say(f"{where}, {chance}.")
    else:
        say(f"Cannot tell: the best place is {where}, {chance}.")
    ellipse = place["ellipse_90"]
    say(
        f"Estimated position: x {place['x']:.1f}, y {place['y']:.1f} ± {place['sigma']:.1f} m "
        f"(90 %: {ellipse['longer']:.1f} m along {ellipse['bearing']:.0f}°, "
        f"{ellipse['shorter']:.1f} m across)."
    )
    if place["heading"] is not None:
        say(
            f"North of the query: {place['heading'] % 360.0:.1f}° ± {place['heading_sigma']:.1f}° "
            f"from {result['north']['name']} north."
        )
    say(
        f"{percent(region['share'], 0)} of the chance is in {region['cells']:,} "
        f"cell{'' if region['cells'] == 1 else 's'} "
        f"({_area_text(region['km2'])})."
    )


def _area_text(km2: float) -> str:
    return f"{km2:.3f} km²" if km2 >= 0.1 else f"{km2 * 1e6:,.0f} m²"  # noqa: PLR2004 - 10 ha


def _print_explanations(candidates: list[dict[str, Any]]) -> None:
    """Print the objects of the best candidate, and the counts of the others."""
    for row in candidates:
        if "explanation" not in row:
            break
        why = row["explanation"]
        outside = sum(one["verdict"] not in VERDICTS for one in why["rows"])
        counts = ", ".join(f"{why['counts'][verdict]} {verdict}" for verdict in VERDICTS)
        counts += f"; {outside} outside the photos" if outside else ""
        title = f"Rank {row['rank']}, at x {why['x']:.1f}, y {why['y']:.1f}: {counts}"
        if row["rank"] > 1:
            say(title)
            continue
        print_rows(
            title,
            EXPLANATION,
            [
                [
                    one["verdict"],
                    f"{one['chance']:.2f}",
                    one["query_class"] or "",
                    _seen_at(one["query_bearing"], one["query_range"]),
                    one["object_class"] or "",
                    _measure(one["object_bearing"], "°"),
                    _measure(one["bearing_error"], "°", sign="+"),
                    _measure(one["distance"], " m"),
                    one["source"] or "",
                    one["source_id"] or "",
                ]
                for verdict in VERDICTS
                for one in why["rows"]
                if one["verdict"] == verdict
            ],
        )


def _seen_at(bearing: float | None, metres: float | None) -> str:
    told = "" if metres is None else f", {metres:.1f} m"
    return _measure(bearing, "°") + told


def _measure(value: float | None, unit: str, *, sign: str = "") -> str:
    return "" if value is None else f"{value:{sign}.1f}{unit}"


def _rank_text(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}-{high}"
