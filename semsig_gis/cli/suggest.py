"""`semsig suggest`: what to look for next."""

from __future__ import annotations

from dataclasses import dataclass

from semsig_gis.cli.console import AsJson, print_json, print_tables, progress
from semsig_gis.cli.options import QueryOptions, SearchOptions, command, query_north


@dataclass(frozen=True, kw_only=True)
class SuggestOptions(SearchOptions, QueryOptions):
    """The options of `semsig suggest`."""

    as_json: AsJson = False


@command(SuggestOptions)
def suggest(options: SuggestOptions) -> None:
    """Suggest what to look for next, most useful first."""
    from semsig_gis.database import open_city
    from semsig_gis.localization import next_questions, with_unplaced
    from semsig_gis.output import question_tables

    city = open_city(options.database)
    north = query_north(city, options.north, options.date)
    query = options.query(city.dataset)
    unplaced, absent = options.unplaced(city.dataset)
    locator = with_unplaced(
        options.locator(city, north, usual_noise=options.usual_noise(query, city.dataset.taxonomy)),
        query,
        unplaced,
        absent=absent,
    )
    with progress("answering"):
        location = locator.locate(query)
    questions = next_questions(locator.index, location, unplaced=unplaced, absent=absent)
    if options.as_json:
        answer = location.to_dict()
        shared = (
            "query",
            "prior",
            "answered",
            "elsewhere",
            "fit",
            "doubt",
            "place",
            "region",
            "notes",
        )
        rows = [question.to_dict() for question in questions]
        print_json({**{name: answer[name] for name in shared}, "questions": rows})
        return
    print_tables(question_tables(questions, location))
