from __future__ import annotations

import gc
import json
import tempfile
import weakref
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import METHODS, NOTHING, asked, database_of, parts_of, random_cells
from pyproj import Transformer
from sentences import refused
from worlds import random_town

from semsig_gis.core import EmptyResultError, InputError, Signature
from semsig_gis.database import PartitionedDatabase, open_database, save_database
from semsig_gis.localization import DistanceLocator, Method, Requirement, localize, score_cells

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase


CITY = database_of(random_cells(400))
TOWN = random_town().database


@pytest.mark.parametrize("top", [1, 2, 7, 100, 400, 1000])
def test_candidates_are_the_best_cells_with_their_ranks(top: int) -> None:
    query = CITY.signature(11)
    result = localize(CITY, query, top=top, method=Method())
    (scores,) = score_cells(CITY, [query])
    ranked = sorted(range(len(CITY)), key=lambda cell: (scores[cell], cell))[:top]
    table = result.candidates
    assert table["cell"].tolist() == ranked
    for row in table.to_dict(orient="records"):
        cell, distance = row["cell"], row["distance"]
        assert distance == scores[cell]
        assert row["rank_low"] == 1 + (scores < distance).sum()
        assert row["rank_high"] == (scores <= distance).sum()
        assert row["tied"] == (scores == distance).sum()
        assert row["cell_id"] == CITY.cell_ids[cell]
        assert [row["x"], row["y"]] == CITY.xy[cell].tolist()
        assert row["types"] == CITY.types(cell)
        assert row["length"] == CITY.lengths[cell]
    assert result.cells == len(CITY)
    last = table["distance"].iloc[-1]
    assert result.tied_beyond == (scores == last).sum() - (table["distance"] == last).sum()
    points = result.to_geodataframe()
    assert points.crs == CITY.crs
    assert points.get_coordinates().equals(table[["x", "y"]])
    assert "geometry" not in table


@pytest.mark.parametrize(
    ("types", "bearings", "text", "used"),
    [
        ("DB", [10.0, 20.0], "edit+edit:5%", "types+angles"),
        ("DB", None, "edit+edit:5%", "types"),
        (None, [10.0, 20.0], "edit+edit:5%", "angles"),
        ("DB", [10.0, 20.0], "types:jaccard", "types"),
        ("DB", [10.0, 20.0], "angles:jaccard", "angles"),
    ],
)
def test_fusion_uses_parts_of_query(
    types: str | None, bearings: list[float] | None, text: str, used: str
) -> None:
    query, method = asked(types, bearings), Method.parse(text)
    result = localize(CITY, query, method=method, top=100)
    assert result.used == used
    if used != "types+angles":
        single_method = Method.parse(f"{used}:{method.measures[used]}")
        single = localize(CITY, query, method=single_method, top=100)
        assert result.candidates.equals(single.candidates)


def test_too_few_candidates_are_refused() -> None:
    for top in (0, -1):
        with refused(InputError, f"{top} candidates were asked for; give a whole number from 1"):
            localize(CITY, asked("D"), top=top, method=Method())


@pytest.mark.parametrize(("types", "bearings"), [("DB", [10.0, 20.0]), ("DB", None), (None, [5.0])])
def test_answer_is_valid_json(types: str | None, bearings: list[float] | None) -> None:
    result = localize(CITY, asked(types, bearings), method=Method(keep=5), top=3)
    values = result.to_dict()
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    length = len(types or bearings or "")
    expected = {
        "query": {"types": types, "bearings": bearings, "length": length},
        "method": "edit+edit:5%",
        "used": result.used,
        "crs": "EPSG:2154",
        "cells": 400,
        "tied_beyond": result.tied_beyond,
        "licenses": ["trees: the city (CC0)"],
    }
    assert expected.items() <= values.items()
    assert [row["cell"] for row in values["candidates"]] == result.candidates["cell"].tolist()
    back = Transformer.from_crs("EPSG:4326", "EPSG:2154", always_xy=True)
    for row in values["candidates"]:
        place = back.transform(row["lon"], row["lat"])
        assert place == pytest.approx((row["x"], row["y"]), abs=0.02)


def in_parts(database: SignatureDatabase, owner: NDArray[np.int64], folder: str | Path) -> Any:  # noqa: ANN401
    """Save the cells of each owner as a part."""
    files = []
    for number in np.unique(owner).tolist():
        files.append(Path(folder) / f"{number}.parquet")
        save_database(database.select(owner == number), files[-1])
    return PartitionedDatabase(tuple(files), len(database))


def assert_parts_give_same_answer(
    whole: SignatureDatabase, owner: NDArray[np.int64], query: Signature, method: Method, top: int
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        parted = in_parts(whole, owner, folder)
        answer, expected = (
            localize(cells, query, method=method, top=top) for cells in (parted, whole)
        )
    pd.testing.assert_frame_equal(answer.candidates, expected.candidates)
    assert answer.to_dict() == expected.to_dict()


PARTED_METHODS = [
    *METHODS,
    *(f"{text}:{keep}%" for text in METHODS if "+" in text for keep in (0.5, 5, 40, 100)),
]


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 60),
    parts=st.integers(1, 5),
    text=st.sampled_from(PARTED_METHODS),
    top=st.sampled_from([1, 2, 7, 30, 100]),
    part=st.sampled_from(["both", "types", "angles"]),
)
@settings(max_examples=120)
def test_partitioned_database_gives_same_answer(
    *, seed: int, count: int, parts: int, text: str, top: int, part: str
) -> None:
    rng = np.random.default_rng(seed)
    whole = database_of(random_cells(count, seed=seed))
    # The signature of a cell, or random objects of the classes of the city.
    query = whole.signature(int(rng.integers(count)))
    if rng.random() < 0.5:
        codes = rng.choice(whole.present_codes, int(rng.integers(1, 9)))
        query = Signature(codes, np.sort(rng.uniform(0, 360, len(codes))))
    method = Method.parse(text)
    if part in method.measures:  # not both
        codes, bearings = parts_of(query)
        query = Signature(codes, None) if part == "types" else Signature(None, bearings)
    assert_parts_give_same_answer(whole, rng.integers(0, parts, count), query, method, top)


@pytest.mark.parametrize("text", ["edit+edit:2%:raw:weights=40/50/60", "histogram+edit:2%:raw"])
def test_parts_rank_other_cells_as_the_whole_database(text: str) -> None:
    rng = np.random.default_rng(4)
    cells = [
        ("".join(rng.choice(list("DBG"), length)), np.sort(rng.uniform(0, 360, length)).tolist())
        for length in rng.integers(1, 120, 200)
    ]
    whole = database_of(cells)
    owner, method = rng.integers(0, 3, 200), Method.parse(text)
    for cell in (0, 100):
        assert_parts_give_same_answer(whole, owner, whole.signature(cell), method, 200)


def test_only_one_part_is_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parted = in_parts(CITY, np.arange(len(CITY)) % 4, tmp_path)
    opened: list[weakref.ref[SignatureDatabase]] = []

    def watched(path: Path) -> SignatureDatabase:
        gc.collect()
        # The next is opened before the last is freed.
        assert sum(part() is not None for part in opened) <= 2
        database = open_database(path)
        opened.append(weakref.ref(database))
        return database

    monkeypatch.setattr("semsig_gis.database.file.open_database", watched)
    localize(parted, CITY.signature(3), method=Method(keep=5), top=100)
    assert len(opened) == 8  # twice in two stages


def test_rankings_cover_cells_of_all_parts(tmp_path: Path) -> None:
    parted = in_parts(CITY, np.arange(len(CITY)) % 3, tmp_path)
    locators = DistanceLocator(database=parted), DistanceLocator(database=CITY)
    parts, whole = (next(iter(item.rankings([CITY.signature(3)]))) for item in locators)
    assert parts.scores.tolist() == whole.scores.tolist()


@pytest.mark.parametrize("text", METHODS)
def test_absent_class_is_not_used(tmp_path: Path, text: str) -> None:
    parted, method = in_parts(CITY, np.arange(len(CITY)) % 3, tmp_path), Method.parse(text)
    expected = localize(CITY, asked("D", [1.0]), method=method, top=100)
    for database in (parted, CITY):
        result = localize(database, asked("MD", [0.5, 1.0]), method=method, top=100)
        pd.testing.assert_frame_equal(result.candidates, expected.candidates)
        assert len(result.query) == 2
        (note,) = result.notes
        assert note == "the map has no bus stop, so this object was not used."
    assert not expected.notes


@pytest.mark.parametrize("query", [NOTHING, asked("M", [1.0])])
@pytest.mark.parametrize("text", ["edit+edit:5%", "types:jaccard", "angles:histogram"])
def test_all_cells_tie_for_empty_query(query: Signature, text: str) -> None:
    result = localize(CITY, query, method=Method.parse(text), top=3)
    assert result.candidates["tied"].tolist() == [len(CITY)] * 3
    assert result.candidates["distance"].tolist() == [1.0] * 3
    assert len(result.notes) == 1


@given(st.integers(0, 2**32 - 1), st.sampled_from(["D", "2B", "D>=1,?<=6", "B=0", "?>=3"]))
@settings(max_examples=25)
def test_requirement_only_removes_cells(seed: int, text: str) -> None:
    cell = int(np.random.default_rng(seed).integers(len(TOWN)))
    requirement = Requirement.parse(text, TOWN.taxonomy)
    everything = localize(TOWN, TOWN.signature(cell), top=len(TOWN), method=Method()).candidates
    mask = requirement.met(TOWN.type_sequences)
    expected = everything[mask[everything["cell"].to_numpy()]]
    search = partial(localize, TOWN, TOWN.signature(cell), requirement=requirement, top=len(TOWN))
    if expected.empty:
        with pytest.raises(EmptyResultError):
            search(method=Method())
        return
    result = search(method=Method())
    assert result.candidates["cell"].tolist() == expected["cell"].tolist()
    assert result.candidates["distance"].tolist() == expected["distance"].tolist()
    assert result.cells == int(mask.sum())


def test_unknown_class_matches_any_class() -> None:
    cell = int(TOWN.lengths.argmax())
    types = TOWN.types(cell)
    query = Signature.parse("?" + types[1:], None, taxonomy=TOWN.taxonomy)
    best = localize(TOWN, query, method=Method.parse("types:edit"), top=1).candidates
    assert best["distance"].tolist() == [0.0]
    with refused(InputError, "unknown class", "jaccard"):
        localize(TOWN, query, method=Method.parse("types:jaccard"), top=100)
