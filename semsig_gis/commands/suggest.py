"""`semsig suggest`: what to look for next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis.commands.model import Reporter, Result, command
from semsig_gis.commands.options import QueryOptions, SearchOptions, query_north

if TYPE_CHECKING:
    from semsig_gis.output import SuggestRecord


@command(
    "suggest",
    title="Suggest what to look for",
    group="Ask",
    order=3,
    returns="semsig_gis.output:SuggestRecord",
    examples=(
        "semsig suggest city.parquet 'bench at 40, lamp at 80'",
        "semsig suggest city.parquet 'bus stop, bench' --near 43.73,7.42,200",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Suggest(SearchOptions, QueryOptions):
    """Suggest what to look for next, most useful first."""

    def run(self, reporter: Reporter) -> Result:
        """Return the questions and the present answer."""
        from semsig_gis.database import open_city
        from semsig_gis.localization import next_questions, with_unplaced
        from semsig_gis.output import suggest_summary, suggest_tables

        city = open_city(self.database)
        north = query_north(city, self.north, self.date)
        query = self.query(city.dataset)
        unplaced, absent = self.unplaced(city.dataset)
        noise = self.usual_noise(query, city.dataset.taxonomy)
        locator = self.locator(city, reporter, north, usual_noise=noise)
        locator = with_unplaced(locator, query, unplaced, absent=absent)
        with reporter.progress("answering"):
            location = locator.locate(query)
        questions = next_questions(locator.index, location, unplaced=unplaced, absent=absent)

        def values() -> SuggestRecord:
            answer = location.to_dict()
            return {
                "query": answer["query"],
                "prior": answer["prior"],
                "answered": answer["answered"],
                "elsewhere": answer["elsewhere"],
                "fit": answer["fit"],
                "doubt": answer["doubt"],
                "place": answer["place"],
                "region": answer["region"],
                "notes": answer["notes"],
                "questions": [question.to_dict() for question in questions],
            }

        return Result(
            values=values,
            summary=suggest_summary(questions, location),
            tables=suggest_tables(questions),
        )
