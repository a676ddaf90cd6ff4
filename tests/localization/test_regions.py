"""Regions to search: they hold exactly the cells they should, and tell what they cost."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st
from noisy_cells import cells_at
from sentences import refused
from small_city import small_city, small_localization, small_location

from semsig_gis.core import GridSpec, InputError
from semsig_gis.localization import Posterior, search_regions

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Localization, Location

Cell = tuple[int, int]
PLACES = st.tuples(st.integers(-3, 3), st.integers(-3, 3))
GRID = GridSpec(2.5, (0.1, -7.3))


def located(database: SignatureDatabase, chances: np.ndarray) -> Location:
    """Return an answer with these chances; nothing else of it matters here."""
    return dataclasses.replace(
        small_location(), posterior=Posterior(database=database, chances=chances)
    )


def flooded(cells: set[Cell]) -> set[frozenset[Cell]]:
    """Return the groups of cells that share sides, one step at a time."""
    groups = set()
    left = set(cells)
    while left:
        group, edge = set(), [left.pop()]
        while edge:
            column, row = cell = edge.pop()
            group.add(cell)
            sides = {(column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)}
            edge += sides & left
            left -= sides
        groups.add(frozenset(group))
    return groups


@given(st.lists(st.tuples(PLACES, st.integers(0, 9)), min_size=1, unique_by=lambda one: one[0]))
@example([((0, 0), 1), ((1, 1), 1)])  # they touch in a corner alone
@example([((x, y), int((x, y) != (1, 1))) for x in range(3) for y in range(3)])  # a hole
def test_regions_are_the_cells_that_share_sides(weighted: list[tuple[Cell, int]]) -> None:
    weights = np.array([weight for _, weight in sorted(weighted)], float)
    weights[0] += not weights.any()
    database = cells_at(*np.array([cell for cell, _ in weighted]).T, grid=GRID)
    chances = weights / weights.sum()
    found = search_regions(located(database, chances), database, share=0.8)
    chosen = Posterior(database=database, chances=chances).credible_cells(0.8)
    places = np.stack([database.columns, database.rows], axis=1)
    expected = flooded({(int(x), int(y)) for x, y in places[chosen]})
    table = found.table
    assert table.is_valid.all()
    assert set(table.geom_type) == {"Polygon"}
    points = shapely.points(database.xy)
    got = set()
    for row in table.itertuples():
        inside = shapely.contains(row.geometry, points)
        got.add(frozenset((int(x), int(y)) for x, y in places[inside]))
        assert row.cells == inside.sum()
        assert np.isclose(row.geometry.area, row.cells * 2.5**2)
        assert np.isclose(row.km2, row.cells * 2.5**2 / 1e6)
        assert np.isclose(row.chance, chances[inside].sum())
        best = int(np.flatnonzero(database.cell_ids == row.best_cell_id)[0])
        assert inside[best]
        assert chances[best] == chances[inside].max()
        assert (row.best_x, row.best_y) == tuple(database.xy[best])
    assert got == expected
    assert (np.diff(table["chance"]) <= 1e-12).all()
    assert np.allclose(table["searched_chance"], table["chance"].cumsum())
    assert np.allclose(table["searched_percent"], table["cells"].cumsum() / len(database) * 100)
    told = found.to_dict()
    assert (told["regions"], told["cells"]) == (len(expected), len(chosen))
    assert told["chance"] >= 0.8 - 1e-9
    assert np.isclose(told["percent"], 100 * len(chosen) / len(database))


@given(
    st.lists(PLACES, min_size=1, unique=True),
    st.integers(0, 48),
    st.sampled_from([0.0, 1.0, 2.5, 3.6, 100.0]),
)
def test_cells_within_are_searched_too(cells: list[Cell], best: int, within: float) -> None:
    database = cells_at(*np.array(cells).T, grid=GRID)
    chances = np.zeros(len(cells))
    chances[best % len(cells)] = 1.0
    found = search_regions(located(database, chances), database, within=within)
    off = np.hypot(*(database.xy - database.xy[best % len(cells)]).T)
    assert found.to_dict()["cells"] == (off <= within + 1e-6).sum()


def test_candidates_of_other_methods() -> None:
    database, answer = small_city()[0], small_localization()
    found = search_regions(answer, database)
    assert "chance" not in found.table.columns
    assert "chance" not in found.to_dict()
    assert found.to_dict()["cells"] == len(answer.candidates)
    assert found.table["best_cell_id"].iloc[0] == answer.candidates["cell_id"].iloc[0]
    order = answer.candidates["cell_id"].tolist()
    firsts = [order.index(cell) for cell in found.table["best_cell_id"]]
    assert firsts == sorted(firsts)


@pytest.mark.parametrize(
    ("rows", "options", "words"),
    [
        (slice(None), {"within": -1.0}, "metres, 0 or more"),
        (slice(None), {"within": float("nan")}, "metres, 0 or more"),
        (slice(None), {"within": float("inf")}, "metres, 0 or more"),
        (slice(None), {"share": 1.5}, "1.5"),
        (slice(1, None), {}, "give the database that"),
    ],
)
@pytest.mark.parametrize("answer", [small_location, small_localization])
def test_other_numbers_and_databases_are_refused(
    answer: Callable[[], Location | Localization],
    rows: slice,
    options: dict[str, float],
    words: str,
) -> None:
    with refused(InputError, words):
        search_regions(answer(), small_city()[0].select(rows), **options)
