"""Regions to search: their cells and their areas."""

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
    """Return an answer with these probabilities."""
    return dataclasses.replace(
        small_location(), posterior=Posterior(database=database, chances=chances)
    )


def connected_groups(cells: set[Cell]) -> set[frozenset[Cell]]:
    """Return the groups of cells that share sides, by flood fill."""
    groups = set()
    others = set(cells)
    while others:
        group, edge = set(), [others.pop()]
        while edge:
            column, row = cell = edge.pop()
            group.add(cell)
            sides = {(column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)}
            edge += sides & others
            others -= sides
        groups.add(frozenset(group))
    return groups


@given(st.lists(st.tuples(PLACES, st.integers(0, 9)), min_size=1, unique_by=lambda item: item[0]))
@example([((0, 0), 1), ((1, 1), 1)])  # they share only a corner
@example([((x, y), int((x, y) != (1, 1))) for x in range(3) for y in range(3)])  # a hole
def test_regions_consist_of_cells_that_share_sides(weighted: list[tuple[Cell, int]]) -> None:
    weights = np.array([weight for _, weight in sorted(weighted)], float)
    weights[0] += not weights.any()
    database = cells_at(*np.array([cell for cell, _ in weighted]).T, grid=GRID)
    chances = weights / weights.sum()
    result = search_regions(located(database, chances), database, share=0.8)
    cells = Posterior(database=database, chances=chances).credible_cells(0.8)
    places = np.stack([database.columns, database.rows], axis=1)
    expected = connected_groups({(int(x), int(y)) for x, y in places[cells]})
    table = result.table
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
    total = result.to_dict()
    assert (total["regions"], total["cells"]) == (len(expected), len(cells))
    assert total["chance"] >= 0.8 - 1e-9
    assert np.isclose(total["percent"], 100 * len(cells) / len(database))


@given(
    st.lists(PLACES, min_size=1, unique=True),
    st.integers(0, 48),
    st.sampled_from([0.0, 1.0, 2.5, 3.6, 100.0]),
)
def test_cells_within_margin_are_added(cells: list[Cell], best: int, within: float) -> None:
    database = cells_at(*np.array(cells).T, grid=GRID)
    chances = np.zeros(len(cells))
    chances[best % len(cells)] = 1.0
    result = search_regions(located(database, chances), database, within=within)
    off = np.hypot(*(database.xy - database.xy[best % len(cells)]).T)
    assert result.to_dict()["cells"] == (off <= within + 1e-6).sum()


def test_candidates_of_distance_are_regions() -> None:
    database, answer = small_city()[0], small_localization()
    result = search_regions(answer, database)
    assert "chance" not in result.table.columns
    assert "chance" not in result.to_dict()
    assert result.to_dict()["cells"] == len(answer.candidates)
    assert result.table["best_cell_id"].iloc[0] == answer.candidates["cell_id"].iloc[0]
    order = answer.candidates["cell_id"].tolist()
    firsts = [order.index(cell) for cell in result.table["best_cell_id"]]
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
def test_invalid_numbers_and_other_databases_are_refused(
    answer: Callable[[], Location | Localization],
    rows: slice,
    options: dict[str, float],
    words: str,
) -> None:
    with refused(InputError, words):
        search_regions(answer(), small_city()[0].select(rows), **options)
