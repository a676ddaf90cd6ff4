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
from six_cells import six_cells
from worlds import CORNER, lamps, surroundings, worlds

from semsig_gis.core.errors import EmptyResultError
from semsig_gis.database.build import build_database
from semsig_gis.database.properties import database_summary
from semsig_gis.database.views import ViewpointSpec

if TYPE_CHECKING:
    from worlds import World

    from semsig_gis.database.database import SignatureDatabase


@pytest.fixture(scope="module")
def database() -> SignatureDatabase:
    return six_cells()


def test_properties_by_hand(database: SignatureDatabase) -> None:
    facts = database_summary(database, file_bytes=1_500_000)
    assert json.loads(json.dumps(facts, allow_nan=False)) == facts
    assert (facts["signatures"], facts["file_mb"], facts["crs"]) == (6, 1.5, "EPSG:2154")
    assert facts["mean_length"] == pytest.approx(10 / 6)
    assert facts["covered_km2"] == pytest.approx(0.0006)
    assert (facts["radius_m"], facts["step_m"], facts["levels"]) == (30.0, 10.0, 16)
    assert facts["largest_type_group"] == {"types": "DD", "cells": 3}
    assert facts["cell_bits"] == pytest.approx(math.log2(6))
    # An object counts in every signature.
    by_symbol = {one["symbol"]: one for one in facts["occurrences"]}
    assert len(by_symbol) == 12
    assert [by_symbol[symbol]["number"] for symbol in "DBz"] == [7, 3, 0]
    assert by_symbol["D"]["share"] == pytest.approx(0.7)
    assert sum(one["share"] for one in facts["occurrences"]) == pytest.approx(1)
    # Cells by their number of D: three have 2, one has 1, two have none; of B: three, three.
    bits = [by_symbol[symbol]["entropy_bits"] for symbol in "DBz"]
    assert bits == pytest.approx([1 / 2 + math.log2(6) / 6 + math.log2(3) / 3, 1.0, 0.0])


def test_group_statistics_by_hand(database: SignatureDatabase) -> None:
    groups = database_summary(database)["groups"]
    by_type, both = groups["type"], groups["both"]  # sizes 3, 1, 2 and 2, 1, 1, 2
    assert (by_type["count"], by_type["min"], by_type["max"]) == (3, 1, 3)
    assert (by_type["mean"], by_type["std"]) == pytest.approx((2, 1))  # of a sample
    assert (by_type["25%"], by_type["50%"], by_type["75%"]) == (1.5, 2, 2.5)
    assert by_type["alone"] == pytest.approx(1 / 6)
    bits = 1 / 2 + math.log2(6) / 6 + math.log2(3) / 3
    assert by_type["entropy_bits"] == pytest.approx(bits)
    assert groups["angle"]["count"] == 3  # sizes 3, 1, 2
    assert (both["count"], both["max"]) == (4, 2)
    assert both["alone"] == pytest.approx(2 / 6)
    assert both["entropy_bits"] == pytest.approx(2 / 3 * math.log2(3) + math.log2(6) / 3)
    single = database_summary(database.select(slice(1)))["groups"]["both"]
    assert (single["std"], single["entropy_bits"]) == (None, 0)


def test_how_it_was_made_is_told(database: SignatureDatabase) -> None:
    facts = database_summary(database, file_bytes=1_500_000)
    assert facts["viewpoints"] == {"mode": "all", "half_width_m": None, "area_km2": None}
    assert facts["occlusion_m"] is None
    assert facts["mb_per_km2"] == pytest.approx(1.5 / 0.0006)
    other = replace(
        database,
        viewpoints=ViewpointSpec(mode="streets", width=5.0, area=shapely.box(0, 0, 1000, 500)),
        occlusion=0.25,
        taxonomy=database.taxonomy.with_ranges({"street_light": 40.0}),
    )
    told = database_summary(other)
    assert told["viewpoints"] == {"mode": "streets", "half_width_m": 5.0, "area_km2": 0.5}
    assert (told["occlusion_m"], told["mb_per_km2"], told["file_mb"]) == (0.25, None, None)
    ranges = {one["name"]: one["range_m"] for one in told["occurrences"]}
    assert (ranges["street_light"], ranges["bench"]) == (40.0, 30.0)
    # It takes a larger disc to see as many, so there are fewer.
    dense, thin = (
        next(one for one in item["occurrences"] if one["symbol"] == "D") for item in (facts, told)
    )
    assert thin["objects_per_km2"] == pytest.approx(dense["objects_per_km2"] * (30 / 40) ** 2)
    assert json.loads(json.dumps(told, allow_nan=False)) == told


def test_objects_may_be_counted(database: SignatureDatabase) -> None:
    assert database_summary(database)["density_from"] == "occurrences"
    facts = database_summary(database, object_counts={3: 12})
    assert facts["density_from"] == "objects"
    by_symbol = {one["symbol"]: one for one in facts["occurrences"]}
    assert by_symbol["D"]["objects"] == 12
    assert by_symbol["D"]["objects_per_km2"] == pytest.approx(12 / 0.0006)
    assert by_symbol["B"]["objects"] == 0


def test_the_estimate_of_the_density_is_near_the_count() -> None:
    """Every object is in as many signatures as there are cells in its disc, on average."""
    objects = lamps()
    database = build_database(objects)
    code = int(objects.codes[0])
    estimated, counted = (
        next(one for one in facts["occurrences"] if one["code"] == code)["objects_per_km2"]
        for facts in (
            database_summary(database),
            database_summary(database, object_counts={code: len(objects)}),
        )
    )
    assert estimated == pytest.approx(counted, rel=0.03)
    # What buildings hide is missing from the estimate.
    house = surroundings(shapely.box(*CORNER, *(CORNER + 60)))
    hidden = database_summary(build_database(objects, footprints=house))
    assert hidden["occurrences"][code - 1]["objects_per_km2"] < estimated


@given(worlds())
def test_entropies_are_those_of_a_plain_loop(world: World) -> None:
    try:
        database = world.database
    except EmptyResultError:
        assume(condition=False)
    facts = database_summary(database)
    cells = len(database)
    signatures = [database.types(row) for row in range(cells)]

    def entropy(values: list[object]) -> float:
        return sum(n / cells * math.log2(cells / n) for n in Counter(values).values())

    for one in facts["occurrences"]:
        counts: list[object] = [types.count(one["symbol"]) for types in signatures]
        assert one["entropy_bits"] == pytest.approx(entropy(counts), abs=1e-9)
        assert one["entropy_bits"] <= facts["groups"]["type"]["entropy_bits"] + 1e-9
    for kind in ("type", "angle"):
        bits = facts["groups"][kind]["entropy_bits"]
        assert bits <= facts["groups"]["both"]["entropy_bits"] + 1e-9 <= facts["cell_bits"] + 2e-9
    assert facts["groups"]["type"]["entropy_bits"] == pytest.approx(
        entropy([*signatures]), abs=1e-9
    )
    assert np.isclose(sum(one["share"] for one in facts["occurrences"]), 1)
