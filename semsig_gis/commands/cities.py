"""Several databases in one `semsig localize`: a view that may be from any of some cities."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.commands.model import Reporter, Result
from semsig_gis.core import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.localization import LikelihoodLocator
    from semsig_gis.observation import View


def split_databases(texts: Sequence[str]) -> tuple[list[Path], str | None]:
    """Return the databases at the beginning of some texts, and what was seen, if it follows."""
    databases = [text for text in texts if text.endswith(".parquet") or Path(text).is_dir()]
    if databases != texts[: len(databases)] or len(texts) > len(databases) + 1:
        raise InputError(
            f"{' and '.join(map(repr, texts))} were given after the first database; give more "
            "databases, and then what was seen as one text."
        )
    return [*map(Path, databases)], texts[-1] if len(texts) > len(databases) else None


def locate_in_cities(
    cities: Mapping[str, tuple[LikelihoodLocator, View]],
    *,
    surely_here: bool,
    top: int,
    symbols: bool,
    reporter: Reporter,
) -> Result:
    """Answer a query that may be from any of some cities, from its locator in each."""
    from semsig_gis.localization import locate_in_areas
    from semsig_gis.output import (
        cities_summary,
        cities_tables,
        city_candidates,
        likeliest_city,
    )

    locators, queries = zip(*cities.values(), strict=True)
    with reporter.progress("answering"):
        answers, elsewhere = locate_in_areas(locators, queries, surely_here=surely_here)
    locations = dict(zip(cities, answers, strict=True))

    def values() -> dict[str, Any]:
        name, best = likeliest_city(locations)
        return {
            **best.to_dict(),
            "city": name,
            "cities": {name: 1.0 - location.elsewhere for name, location in locations.items()},
            "elsewhere": elsewhere,
            "candidates": city_candidates(locations, top),
        }

    return Result(
        values=values,
        summary=cities_summary(locations, elsewhere),
        tables=cities_tables(locations, elsewhere, top=top, symbols=symbols),
    )
