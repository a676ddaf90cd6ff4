"""Tables of a survey of what a place's data can carry."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.core import Table, family_named, percent
from semsig_gis.database import SEEN

if TYPE_CHECKING:
    from collections.abc import Iterable

    from semsig_gis.database import Survey


def survey_sentence(survey: Survey) -> str:
    """Return how many objects are on the map, and the shares of places that see few or many.

    Parameters
    ----------
    survey : Survey
        Result of `survey`.

    Returns
    -------
    str
        Two sentences.

    Examples
    --------
    >>> from semsig_gis.core import Town
    >>> from semsig_gis.database import FamilySurvey, Survey
    >>> trees = FamilySurvey(
    ...     family="furniture",
    ...     classes=1,
    ...     objects=20,
    ...     per_km=10.0,
    ...     added=(0.5, 0.25, 0.25, 0.0),
    ...     own=(0.5, 0.25, 0.25, 0.0),
    ... )
    >>> result = Survey(
    ...     places=200,
    ...     along_streets=True,
    ...     occlusion=False,
    ...     street_km=2.0,
    ...     radius=30.0,
    ...     town=Town("Lyon", "France", 2.1),
    ...     families=(trees,),
    ... )
    >>> survey_sentence(result)  # doctest: +NORMALIZE_WHITESPACE
    '20 objects along 2.0 km of street near Lyon, France. Of 200 places there, 50 % see none of
    them, and 25 % see five or more.'
    """
    where = f" along {survey.street_km:,.1f} km of street" if survey.along_streets else ""
    some = "there" if survey.along_streets else "outdoors"
    none, _, *many = survey.seen
    return (
        f"{survey.objects:,} objects{where} {survey.town}. Of {survey.places:,} places {some}, "
        f"{percent(none, 0)} see none of them, and {percent(sum(many), 0)} see five or more."
    )


def survey_tables(survey: Survey) -> tuple[Table, Table, Table]:
    """Return the tables of a survey: each family added, each on its own, and the objects.

    Parameters
    ----------
    survey : Survey
        Result of `survey`.

    Returns
    -------
    tuple of Table
        The three tables.

    Examples
    --------
    >>> from semsig_gis import CitySpec, assemble, load_catalog, synthetic_city
    >>> from semsig_gis.database import survey
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> result = survey(assemble(layers, load_catalog("openstreetmap")))
    >>> [table.title for table in survey_tables(result)]
    ['Places by number of objects seen', 'The same, each on its own', 'Objects by family']
    """
    titles = [
        family_named(item.family).title + (" (optional)" if item.optional else "")
        for item in survey.families
    ]
    families = survey.families
    optional = ""
    if any(item.optional for item in families):
        optional = " 'semsig load' reads what is optional only with --layer +NAME."
    hidden = "hide what is behind them" if survey.occlusion else "are not on the map"
    return (
        _seen_table(
            "Places by number of objects seen",
            [f"{'+ ' if row else ''}{title}" for row, title in enumerate(titles)],
            [item.added for item in families],
            note=f"Each line has the families above it as well. Buildings {hidden}.{optional}",
        ),
        _seen_table("The same, each on its own", titles, [item.own for item in families]),
        Table.of(
            "Objects by family",
            ("family", "classes", "objects", "per km of street"),
            (
                (
                    *(title, item.classes, item.objects),
                    "" if item.per_km is None else f"{item.per_km:,.1f}",
                )
                for title, item in zip(titles, families, strict=True)
            ),
        ),
    )


def _seen_table(
    title: str, families: list[str], shares: Iterable[tuple[float, ...]], note: str = ""
) -> Table:
    rows = zip(*shares, strict=True)
    columns = {
        f"{label}": [percent(share, 0) for share in column]
        for label, column in zip(SEEN, rows, strict=True)
    }
    return Table.of_columns(title, {"with": families, **columns}, note)
