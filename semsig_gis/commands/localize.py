"""`semsig localize`: find the places of queries."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from semsig_gis.commands.cities import locate_in_cities, split_databases
from semsig_gis.commands.model import OUTPUT, SAW, SEARCH, Option, Reporter, Result, command
from semsig_gis.commands.options import (
    MOST_METRES,
    Explain,
    MethodText,
    Paper,
    QueryOptions,
    SearchOptions,
    Symbols,
    Top,
    adapted_noise,
    chosen_method,
    draw_ground,
    ground_of,
    online_notes,
    query_north,
)
from semsig_gis.core import LIKELIHOOD, EmptyResultError, InputError, Table, UnknownNameError

if TYPE_CHECKING:
    from semsig_gis.database import City, PartitionedDatabase, SignatureDatabase
    from semsig_gis.localization import Answer, LikelihoodLocator, Locator, RegionsRecord
    from semsig_gis.observation import North, QueryLine, View


PLACES = ("near", "area", "popularity", "objects")
"""Options for the places of a single city."""


@command(
    "localize",
    title="Localize",
    group="Ask",
    order=1,
    returns="semsig_gis.output:LocalizeRecord",
    examples=(
        "semsig localize city.parquet 'bench at 40, lamp at 80, no bus stop'",
        "semsig localize city.parquet --queries views.jsonl",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Localize(SearchOptions, QueryOptions):
    """Find where a view was seen from, or many views.

    By likelihood, every place gets a chance. A method by distance takes only what was seen and
    --require of what is known, and cannot explain.
    """

    more: Annotated[
        list[str] | None,
        Option(
            "More databases before what was seen: the view may be from any of these cities.",
            title="More databases",
            metavar="[DATABASE]... [SEEN]",
            positional=True,
        ),
    ] = None
    queries: Annotated[
        str | None,
        Option(
            "File of many queries, as CSV or JSON lines, or - for JSON lines from "
            "standard input. Prints a line of JSON for each: an answer or an error.",
            title="File of queries",
            metavar="FILE|-",
            reads=True,
            panel=SAW,
        ),
    ] = None
    adapt: Annotated[
        bool,
        Option(
            "Adapt the noise to all --queries first, which are views of one camera and detector.",
            title="Adapt the errors to the queries",
            advanced=True,
            panel=SEARCH,
        ),
    ] = False
    method: MethodText = None
    paper: Paper = False
    top: Top = 10
    explain: Explain = False
    symbols: Symbols = False
    map: Annotated[
        Path | None, Option("Map to write (.html).", title="Map page", writes=".html")
    ] = None
    out: Annotated[
        Path | None,
        Option(
            "File to write: search regions and candidates for QGIS (.gpkg) or in degrees "
            "(.geojson, .kml), only the regions (.parquet, .fgb, .csv), or the chance of every "
            "cell (.tif).",
            title="Answer",
            writes=(".gpkg", ""),
        ),
    ] = None
    share: Annotated[
        float | None,
        Option(
            "Total chance of the regions of --out.",
            title="Chance of the regions",
            default="0.9",
            low=0.001,
            high=1,
            advanced=True,
            panel=OUTPUT,
        ),
    ] = None
    within: Annotated[
        float,
        Option(
            "Distance to add around the cells of --out.",
            title="Margin of the regions",
            unit="m",
            low=0,
            high=MOST_METRES,
            advanced=True,
            panel=OUTPUT,
        ),
    ] = 0.0

    @property
    def ranking(self) -> str:
        """The name of the method."""
        return chosen_method(self.method, paper=self.paper)

    def run(self, reporter: Reporter) -> Result:
        """Answer the query or the queries; write the map and the regions."""
        self._check()
        more, view_text = split_databases(
            [text for text in (self.seen, *(self.more or ())) if text is not None]
        )
        if more:
            self._require_one_city()
            return locate_in_cities(
                {
                    str(path): replace(self, database=path, seen=view_text, more=None).in_city(
                        reporter
                    )
                    for path in (self.database, *more)
                },
                surely_here=self.surely_here,
                top=self.top,
                symbols=self.symbols,
                reporter=reporter,
            )
        from semsig_gis.database import open_city

        city = open_city(self.database)
        north = query_north(city, self.north, self.date)
        if self.queries is None:
            # The query is read before the index, so that an error in it is found early.
            query = self.query(city.dataset, others=", or --queries")
            locator = self.query_locator(city, reporter, north, query)
            locator = self.with_unplaced(locator, query, *self.unplaced(city.dataset))
            return self._answer(city, locator, query, reporter)
        queries: Iterable[QueryLine] = self._read_queries(city.dataset)
        if self.adapt:
            queries = list(queries)
            locator = self._adapted(city, queries, north, reporter)
        else:
            locator = self.query_locator(city, reporter, north)
        return Result(values=lambda: self._answers(queries, locator, reporter), stream=True)

    def _check(self) -> None:
        """Raise InputError for options that exclude each other."""
        single = ("types", "bearings", "ranges", "fov", "look", "sectors", "map", "out")
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
        if self._writes_chances and (self.share is not None or self.within):
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

    def _require_one_city(self) -> None:
        """Raise InputError for options that need a single database."""
        names = (*("queries", "explain", "map", "out"), *PLACES)
        single = [f"--{name.strip('_')}" for name in names if getattr(self, name)]
        if single or self.ranking != LIKELIHOOD:
            raise InputError(
                f"several databases were given with {' and '.join(single or ['--method'])}, which "
                "needs a single one; leave out one or the other."
            )

    def in_city(self, reporter: Reporter) -> tuple[Any, View]:
        """Return the locator in one of several cities, and the query as it is read there."""
        from semsig_gis.database import open_city

        city = open_city(self.database)
        query = self.query(city.dataset)
        north = query_north(city, self.north, self.date)
        locator = self.query_locator(city, reporter, north, query)
        return self.with_unplaced(locator, query, *self.unplaced(city.dataset)), query

    def _refuse_likelihood(self) -> None:
        """Raise InputError for options that work only with the likelihood method."""
        names = [field.name for field in fields(SearchOptions) if field.name != "require"]
        options = [
            f"--{name.replace('_', '-')}"
            for name in (*names, "explain", "share", "adapt")
            if getattr(self, name) != getattr(Localize, name)  # the default
        ]
        if options:
            raise InputError(
                f"{' and '.join(options)} {'works' if len(options) == 1 else 'work'} only with the "
                f"likelihood method, not with {self.ranking!r}; leave out one or the other."
            )

    @property
    def _writes_chances(self) -> bool:
        """Whether --out is a raster with the chances of all cells, without regions."""
        return self.out is not None and self.out.suffix.lower() in {".tif", ".tiff"}

    @property
    def _source(self) -> str:
        """The name of the file of queries in messages."""
        return "standard input" if self.queries == "-" else str(self.queries)

    def _read_queries(
        self, dataset: SignatureDatabase | PartitionedDatabase
    ) -> Iterator[QueryLine]:
        """Return the queries of --queries, read line by line."""
        from semsig_gis.observation import parse_queries, read_queries

        city: dict[str, Any] = {"taxonomy": dataset.taxonomy, "radius": dataset.spec.radius}
        if self.queries == "-":
            return parse_queries(sys.stdin.buffer, self._source, **city)
        return read_queries(self._source, **city)

    def query_locator(
        self, city: City, reporter: Reporter, north: North, query: View | None = None
    ) -> Locator[Any]:
        """Return the locator for a method by distance or by likelihood.

        The default noise is that of the query or, without a query, that of each query to come.
        """
        taxonomy = city.dataset.taxonomy
        if self.ranking != LIKELIHOOD:
            from semsig_gis.localization import Method, Requirement, make_locator

            require = self.require
            return make_locator(
                city,
                Method.parse(self.ranking),
                requirement=None if require is None else Requirement.parse(require, taxonomy),
                top=self.top,
                north=north,
            )

        # The map shows the objects of the best place too, if they have bearings.
        placed = query is not None and query.bearings is not None
        explain = self.explain or (self.map is not None and placed)

        def make(noise: str) -> LikelihoodLocator:
            return self.locator(
                city, reporter, north, usual_noise=noise, top=self.top, explain=explain
            )

        if query is not None:
            return make(self.usual_noise(query, taxonomy))
        if self.noise is not None:
            return make(self.noise)
        from semsig_gis.localization import UsualLocator

        return UsualLocator(make=make)

    def with_unplaced(
        self,
        locator: Locator[Any],
        query: View,
        unplaced: tuple[int, ...],
        absent: tuple[int, ...],
    ) -> Locator[Any]:
        """Return a locator that also uses classes seen without a direction and absent classes."""
        if not unplaced and not absent:
            return locator
        from semsig_gis.localization import with_unplaced

        any_locator: Any = locator
        return cast("Locator[Any]", with_unplaced(any_locator, query, unplaced, absent=absent))

    def _adapted(
        self, city: City, lines: Iterable[QueryLine], north: North, reporter: Reporter
    ) -> LikelihoodLocator:
        """Return the locator with noise that is adapted to all queries."""
        views = [
            north.to_grid(line.query) for line in lines if not isinstance(line.query, InputError)
        ]
        with reporter.progress("adapting"):
            noise = adapted_noise(
                city,
                views,
                self.noise or "photo",
                objects=self.objects,
                heading=self.heading,
                reporter=reporter,
            )
        return self.locator(
            city, reporter, north, usual_noise=noise, top=self.top, explain=self.explain
        )

    def _answers(
        self, queries: Iterable[QueryLine], locator: Locator[Any], reporter: Reporter
    ) -> Iterator[dict[str, Any]]:
        """Yield an answer or an error for each query, as soon as it is there.

        Queries of a file are answered in parallel, queries of standard input one by one.
        """
        from semsig_gis.core import each_in_order
        from semsig_gis.localization import UsualLocator

        first_error, answered, failed = "", 0, 0

        def answer(line: QueryLine) -> tuple[QueryLine, dict[str, Any]]:
            try:
                if isinstance(line.query, InputError):
                    raise line.query
                own = locator
                if isinstance(locator, UsualLocator):
                    own = locator.of(line.query, in_words=line.in_words)
                own = self.with_unplaced(own, line.query, line.unplaced, line.absent)
                return line, {**own.locate(line.query).to_dict()}
            except (EmptyResultError, InputError, UnknownNameError) as error:
                return line, {"error": str(error)}

        in_parallel = self.queries != "-"
        for line, result in each_in_order(answer, queries) if in_parallel else map(answer, queries):
            if error := result.get("error"):
                first_error = first_error or error
                failed += 1
            else:
                answered += 1
            yield {"id": line.name, "line": line.line, **result}
        if not answered:
            what = f"is answered: {first_error}" if failed else "was found; give one on each line."
            raise InputError(f"no query of {self._source} {what}")
        if failed:
            of = f"{failed:,} of {answered + failed:,} queries of {self._source}"
            reporter.remark(f"{of} could not be answered; the field 'error' of each says why.")

    def _answer(self, city: City, locator: Locator[Any], query: View, reporter: Reporter) -> Result:
        """Answer a query, and draw and write the answer."""
        with reporter.progress("answering"):
            answer = locator.locate(query)
        notes: list[str] = []
        if self.map is not None:
            from semsig_gis.localization import Location
            from semsig_gis.output import localization_map, location_map, save_map

            with reporter.progress("drawing the map"):
                if isinstance(answer, Location):
                    map_ = location_map(answer)
                    answer = answer if self.explain else replace(answer, explanations=())
                else:
                    map_ = localization_map(answer, city.database)
                draw_ground(map_, city)
                notes = online_notes(save_map(map_, self.map))
        regions = None if self.out is None else self._write(self.out, city, answer, locator)

        def values() -> dict[str, Any]:
            with_regions = regions is not None and not self._writes_chances
            return {**answer.to_dict(), **({"searched": regions} if with_regions else {})}

        files = {"map": self.map, "chances" if self._writes_chances else "regions": self.out}
        return Result(
            values=values,
            summary=self._summary(answer, regions),
            tables=self._tables(answer),
            files={what: path for what, path in files.items() if path is not None},
            notes=notes,
        )

    def _write(
        self, out: Path, city: City, answer: Answer, locator: Locator[Answer]
    ) -> RegionsRecord:
        """Write the regions to search, or all chances; return the totals of the regions."""
        from semsig_gis.localization import REGION_SHARE
        from semsig_gis.output import export_answer

        if answer.tied_beyond:
            # Cells that tie with the last candidate are searched as well.
            answer = locator.locate(answer.query, top=self.top + answer.tied_beyond)
        share = REGION_SHARE if self.share is None else self.share
        extent = {"share": share, "within": self.within}
        return export_answer(answer, city.database, out, **extent, **ground_of(city)).to_dict()

    def _summary(self, answer: Any, regions: RegionsRecord | None) -> Iterator[str | Table]:  # noqa: ANN401 - an answer of any method
        from semsig_gis.output import answer_summary

        yield from answer_summary(answer)
        if regions is not None and not self._writes_chances:
            count = regions["regions"]
            noun = "region" if count == 1 else "regions"
            yield (
                f"To search: {count:,} {noun}, {regions['km2']:.4g} km², "
                f"{regions['percent']:.3g} % of the city."
            )

    def _tables(self, answer: Any) -> Iterator[str | Table]:  # noqa: ANN401 - an answer of any method
        from semsig_gis.output import answer_tables

        yield from answer_tables(answer, symbols=self.symbols)
