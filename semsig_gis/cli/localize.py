"""`semsig localize`: find the places of queries."""

from __future__ import annotations

import sys
from dataclasses import dataclass, fields, replace
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
    print_tables,
    progress,
    remark,
    require_suffix,
    say,
    warn_if_online,
)
from semsig_gis.cli.options import (
    Explain,
    QueryOptions,
    SearchOptions,
    Top,
    adapted_noise,
    command,
    query_north,
)
from semsig_gis.commands import draw_ground
from semsig_gis.core import LIKELIHOOD, EmptyResultError, InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.database import City, PartitionedDatabase, SignatureDatabase
    from semsig_gis.localization import (
        Answer,
        LikelihoodLocator,
        Locator,
        Method,
    )
    from semsig_gis.observation import North, QueryLine, View

PLACES = ("near", "area", "popularity", "objects")
"""Options for the places of a single city."""


@dataclass(frozen=True, kw_only=True)
class RankedOptions(QueryOptions):
    """Options for one query or many, and for the method."""

    queries: Annotated[
        str | None,
        typer.Option(
            help="File of many queries, as CSV or JSON lines, or - for JSON lines from "
            "standard input. Prints a line of JSON for each: an answer or an error."
        ),
    ] = None
    adapt: Annotated[
        bool,
        typer.Option(
            "--adapt",
            help="Adapt the noise to all --queries first, which are views of one camera and "
            "detector.",
        ),
    ] = False
    method: MethodText = None
    paper: Paper = False

    @property
    def ranking(self) -> str:
        """The name of the method."""
        return chosen_method(self.method, paper=self.paper)

    @property
    def source(self) -> str:
        """The name of the file of queries in messages."""
        return "standard input" if self.queries == "-" else str(self.queries)

    def read_queries(self, dataset: SignatureDatabase | PartitionedDatabase) -> Iterator[QueryLine]:
        """Return the queries of --queries, read one by one."""
        from semsig_gis.observation import parse_queries, read_queries

        city: dict[str, Any] = {"taxonomy": dataset.taxonomy, "radius": dataset.spec.radius}
        if self.queries == "-":
            return parse_queries(sys.stdin.buffer, self.source, **city)
        return read_queries(self.source, **city)


@dataclass(frozen=True, kw_only=True)
class LocalizeOptions(SearchOptions, RankedOptions):
    """The options of `semsig localize`."""

    more: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[DATABASE]... [SEEN]",
            help="More databases before what was seen: the view may be from any of these cities.",
        ),
    ] = None
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
        """Raise InputError for options that exclude each other."""
        single = ("types", "bearings", "ranges", "fov", "look", "sectors", "map_", "out")
        others = [f"--{name.strip('_')}" for name in single if getattr(self, name) is not None]
        others = ([] if self.seen is None else [repr(self.seen)]) + others
        if self.queries is not None and others:
            raise InputError(
                f"--queries was given with {' and '.join(others)}; give a file or one query."
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
        if self.adapt and self.queries is None:
            raise InputError(
                "--adapt learns from many views; give their file with --queries, or leave it out."
            )

    @property
    def writes_chances(self) -> bool:
        """Whether --out is a raster with the chances of all cells, without regions."""
        return self.out is not None and self.out.suffix.lower() in {".tif", ".tiff"}

    def by_city(self) -> tuple[LocalizeOptions, ...]:
        """Return the options for each database if there are several, else none."""
        texts = [text for text in (self.seen, *(self.more or ())) if text is not None]
        databases = [text for text in texts if text.endswith(".parquet") or Path(text).is_dir()]
        if databases != texts[: len(databases)] or len(texts) > len(databases) + 1:
            raise InputError(
                f"{' and '.join(map(repr, texts))} were given after the first database; give more "
                "databases, and then what was seen as one text."
            )
        if not databases:
            return ()
        view_text = texts[-1] if len(texts) > len(databases) else None
        names = ("queries", "explain", "map_", "out", *PLACES)
        extra = [f"--{name.strip('_')}" for name in names if getattr(self, name)]
        if extra or self.ranking != LIKELIHOOD:
            raise InputError(
                f"several databases were given with {' and '.join(extra or ['--method'])}, which "
                "needs a single one; leave out one or the other."
            )
        paths = (self.database, *map(Path, databases))
        return tuple(replace(self, database=path, seen=view_text, more=None) for path in paths)

    def _refuse_likelihood(self) -> None:
        """Raise InputError for options that work only with the likelihood method."""
        names = [field.name for field in fields(SearchOptions) if field.name != "require"]
        options = [
            f"--{name.replace('_', '-')}"
            for name in (*names, "explain", "share", "adapt")
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

    if several := options.by_city():
        _answer_by_city(several)
        return
    method, ranking = None, options.ranking
    if ranking != LIKELIHOOD:
        from semsig_gis.localization import Method

        method = Method.parse(ranking)
    city = open_city(options.database)
    north = query_north(city, options.north, options.date)
    # The query is read before the index, so that an error in it is found early.
    if options.queries is None:
        query = options.query(city.dataset, others=", or --queries")
        others = options.unplaced(city.dataset)
        locator = query_locator(options, city, method, north, query)
        locator = _with_unplaced(locator, query, *others, ranking=ranking)
        _answer(options, city, locator, query)
        return
    queries = options.read_queries(city.dataset)
    if not options.adapt:
        _answer_lines(queries, query_locator(options, city, method, north), options)
        return
    lines = list(queries)
    views = [north.to_grid(line.query) for line in lines if not isinstance(line.query, InputError)]
    with progress("adapting"):
        noise = adapted_noise(
            city, views, options.noise or "photo", options.objects, options.heading
        )
    locator = options.locator(
        city, north, usual_noise=noise, top=options.top, explain=options.explain
    )
    _answer_lines(lines, locator, options)


def _answer_by_city(several: Sequence[LocalizeOptions]) -> None:
    """Answer a query that may be from any of some cities, and print the answer."""
    from semsig_gis.database import open_city
    from semsig_gis.localization import locate_in_areas

    locators: list[LikelihoodLocator] = []
    queries: list[View] = []
    for options in several:
        city = open_city(options.database)
        queries.append(options.query(city.dataset))
        north = query_north(city, options.north, options.date)
        locator: Locator[Any] = query_locator(options, city, None, north, queries[-1])
        others = options.unplaced(city.dataset)
        own: Any = _with_unplaced(locator, queries[-1], *others, ranking=LIKELIHOOD)
        locators.append(own)
    first = several[0]
    with progress("answering"):
        locations, elsewhere = locate_in_areas(locators, queries, surely_here=first.surely_here)
    from semsig_gis.output import cities_tables, city_candidates, likeliest_city

    names = [str(options.database) for options in several]
    cities = dict(zip(names, locations, strict=True))
    if not first.as_json:
        print_tables(cities_tables(cities, elsewhere, top=first.top))
        return
    name, best = likeliest_city(cities)
    shared = {
        "city": name,
        "cities": {name: 1.0 - location.elsewhere for name, location in cities.items()},
        "elsewhere": elsewhere,
        "candidates": city_candidates(cities, first.top),
    }
    print_json(best.to_dict() | shared)


def _with_unplaced(
    locator: Locator[Any],
    query: View,
    unplaced: Sequence[int],
    absent: Sequence[int],
    *,
    ranking: str,
) -> Locator[Any]:
    """Return a locator that also uses classes seen without a direction and absent classes."""
    if not unplaced and not absent:
        return locator
    if ranking != LIKELIHOOD:
        what = "objects with and without a direction" if unplaced else "absent objects"
        raise InputError(
            f"the query has {what}, which the method {ranking!r} cannot take; give directions to "
            "all objects or to none, or leave out the method."
        )
    from semsig_gis.localization import with_unplaced

    likelihood: Any = locator
    return with_unplaced(likelihood, query, unplaced, absent=absent)


def query_locator(
    options: LocalizeOptions,
    city: City,
    method: Method | None,
    north: North,
    query: View | None = None,
) -> Locator[Any]:
    """Return the locator of the options, for a method by distance or by likelihood.

    The default noise is that of the query or, without a query, that of each query to come.
    """
    taxonomy, top = city.dataset.taxonomy, options.top
    if method is None:

        def make(noise: str) -> LikelihoodLocator:
            return options.locator(city, north, usual_noise=noise, top=top, explain=options.explain)

        if query is not None:
            return make(options.usual_noise(query, taxonomy))
        if options.noise is not None:
            return make(options.noise)
        from semsig_gis.localization import UsualLocator

        return UsualLocator(make=make)
    from semsig_gis.localization import Requirement, make_locator

    require = options.require
    requirement = None if require is None else Requirement.parse(require, taxonomy)
    return make_locator(city, method, requirement=requirement, top=top, north=north)


def _answer_lines(
    queries: Iterable[QueryLine], locator: Locator[Any], options: LocalizeOptions
) -> None:
    """Print an answer or an error for each query, as soon as it is there.

    Queries of a file are answered in parallel, queries of standard input one by one.
    """
    from semsig_gis.core import each_in_order
    from semsig_gis.localization import UsualLocator

    source, first_error, answered, failed = options.source, "", 0, 0

    def answer(line: QueryLine) -> tuple[QueryLine, dict[str, Any]]:
        try:
            if isinstance(line.query, InputError):
                raise line.query
            others = line.unplaced, line.absent
            own = locator.of(line.query) if isinstance(locator, UsualLocator) else locator
            line_locator = _with_unplaced(own, line.query, *others, ranking=options.ranking)
            return line, line_locator.locate(line.query).to_dict()
        except (EmptyResultError, InputError, UnknownNameError) as error:
            return line, {"error": str(error)}

    in_parallel = options.queries != "-"
    for line, result in each_in_order(answer, queries) if in_parallel else map(answer, queries):
        if error := result.get("error"):
            first_error = first_error or error
            failed += 1
        else:
            answered += 1
        print_json({"id": line.name, "line": line.line, **result}, indent=None)
    if not answered:
        what = f"is answered: {first_error}" if failed else "was found; give one on each line."
        raise InputError(f"no query of {source} {what}")
    if failed:
        of = f"{failed:,} of {answered + failed:,} queries of {source}"
        remark(f"{of} could not be answered; the field 'error' of each says why.")


def _answer(options: LocalizeOptions, city: City, locator: Locator[Any], query: View) -> None:
    """Answer a query; draw, write and print the answer."""
    with progress("answering"):
        answer = locator.locate(query)
    if options.map_ is not None:
        from semsig_gis.output import localization_map, location_map, save_map

        with progress("drawing the map"):
            if options.ranking == LIKELIHOOD:
                map_ = location_map(answer)
            else:
                map_ = localization_map(answer, city.database)
            draw_ground(map_, city)
            warn_if_online(save_map(map_, options.map_))
    searched: dict[str, Any] = {}
    if options.out is not None:
        searched = _write(options, options.out, city, answer, locator)
    if options.as_json:
        regions = {"searched": searched} if searched and not options.writes_chances else {}
        print_json(answer.to_dict() | regions)
        return
    from semsig_gis.output import answer_tables

    print_tables(answer_tables(answer))
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
    """Write the regions to search, or all chances; return the totals of the regions."""
    from semsig_gis.localization import REGION_SHARE
    from semsig_gis.output import export_answer

    if answer.tied_beyond:
        # Cells that tie with the last candidate are searched as well.
        answer = locator.locate(answer.query, top=options.top + answer.tied_beyond)
    share = REGION_SHARE if options.share is None else options.share
    regions = export_answer(answer, city.database, out, share=share, within=options.within)
    return regions.to_dict()
