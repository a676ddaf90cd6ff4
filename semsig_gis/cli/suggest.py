"""`semsig suggest`: what to look for next."""

from __future__ import annotations

from dataclasses import dataclass

from semsig_gis.cli.console import AsJson, print_json, print_rows, progress, say
from semsig_gis.cli.localize import print_place, print_query
from semsig_gis.cli.options import QueryOptions, SearchOptions, command, seen_north
from semsig_gis.core import percent


@dataclass(frozen=True, kw_only=True)
class SuggestOptions(SearchOptions, QueryOptions):
    """The options of `semsig suggest`."""

    as_json: AsJson = False


@command(SuggestOptions)
def suggest(options: SuggestOptions) -> None:
    """Suggest what to look for next, most useful first."""
    from semsig_gis.database import open_city
    from semsig_gis.localization import next_questions, with_unplaced

    city = open_city(options.database)
    north = seen_north(city, options.north, options.date)
    query = options.query(city.dataset)
    unplaced, absent = options.unplaced(city.dataset)
    locator = with_unplaced(
        options.locator(city, north, usual_noise=options.usual_noise(city.dataset.taxonomy)),
        query,
        unplaced,
        absent=absent,
    )
    with progress("answering"):
        location = locator.locate(query)
    answer = location.to_dict()
    questions = [
        one.to_dict()
        for one in next_questions(locator.index, location, unplaced=unplaced, absent=absent)
    ]
    if options.as_json:
        shared = ("query", "prior", "answered", "place", "region", "notes")
        print_json({**{name: answer[name] for name in shared}, "questions": questions})
        return
    print_rows(
        "What to look for next",
        ("question", "symbol", "yes", "bits"),
        [
            [one["question"], one["symbol"], percent(one["chance"]), f"{one['gain']:.3f}"]
            for one in questions
        ],
    )
    print_place(answer)
    print_query(answer)
    for note in answer["notes"]:
        say(f"Note: {note}")
