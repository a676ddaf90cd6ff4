from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from noisy_cells import six_cells
from worlds import CORNER, lamps, surroundings, worlds

from semsig_gis.core import EmptyResultError
from semsig_gis.database import ViewpointSpec, build_database, database_summary

if TYPE_CHECKING:
    from collections.abc import Callable

    from worlds import World

    from semsig_gis.database import SignatureDatabase


@pytest.fixture(scope="module")
def database() -> SignatureDatabase:
    return six_cells()


def test_summary_of_six_cells(
    database: SignatureDatabase, snapshot: Callable[[str, str], None]
) -> None:
    other = replace(
        database,
        viewpoints=ViewpointSpec(mode="streets", width=5.0, area=shapely.box(0, 0, 1000, 500)),
        occlusion=0.25,
        taxonomy=database.taxonomy.with_ranges({"street_light": 40.0}),
    )
    for name, facts in (
        ("six_cells", database_summary(database, file_bytes=1_500_000)),
        ("six_cells_in_streets", database_summary(other)),
        ("one_cell", database_summary(database.select(slice(1)), object_counts={3: 12})),
    ):
        assert facts.pop("town")["name"] == "São Tomé"
        # To nine digits, since the last ones of a logarithm depend on the processor.
        text = json.dumps(facts, allow_nan=False)
        rounded = json.loads(text, parse_float=lambda number: float(f"{float(number):.9g}"))
        snapshot(f"{name}.json", json.dumps(rounded, indent=1) + "\n")


def test_estimated_density_is_near_the_counted_one() -> None:
    """Every object is in as many signatures as there are cells in its disc, on average."""
    objects = lamps()
    database = build_database(objects)
    code = int(objects.codes[0])
    estimated, counted = (
        next(row for row in facts["occurrences"] if row["code"] == code)["objects_per_km2"]
        for facts in (
            database_summary(database),
            database_summary(database, object_counts={code: len(objects)}),
        )
    )
    assert estimated == pytest.approx(counted, rel=0.03)
    # The estimate lacks objects that buildings hide.
    house = surroundings(shapely.box(*CORNER, *(CORNER + 60)))
    hidden = database_summary(build_database(objects, footprints=house))
    assert hidden["occurrences"][code - 1]["objects_per_km2"] < estimated


@given(worlds())
def test_entropies_equal_a_plain_loop(world: World) -> None:
    try:
        database = world.database
    except EmptyResultError:
        assume(condition=False)
    facts = database_summary(database)
    cells = len(database)
    signatures = [database.types(row) for row in range(cells)]

    def entropy(values: list[object]) -> float:
        return sum(n / cells * math.log2(cells / n) for n in Counter(values).values())

    for row in facts["occurrences"]:
        counts: list[object] = [types.count(row["symbol"]) for types in signatures]
        assert row["entropy_bits"] == pytest.approx(entropy(counts), abs=1e-9)
        assert row["entropy_bits"] <= facts["groups"]["type"]["entropy_bits"] + 1e-9
    for kind in ("type", "angle"):
        bits = facts["groups"][kind]["entropy_bits"]
        assert bits <= facts["groups"]["both"]["entropy_bits"] + 1e-9 <= facts["cell_bits"] + 2e-9
    assert facts["groups"]["type"]["entropy_bits"] == pytest.approx(
        entropy([*signatures]), abs=1e-9
    )
    assert np.isclose(sum(row["share"] for row in facts["occurrences"]), 1)
