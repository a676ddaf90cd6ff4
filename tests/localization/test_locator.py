"""Locate queries by both kinds of methods, and by the default method."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from sentences import refused
from worlds import random_town, save_town

import semsig_gis
from semsig_gis.core import DEFAULT_METHOD, PAPER_METHOD, InputError, UnknownNameError, percent
from semsig_gis.database import open_city
from semsig_gis.evaluation import evaluate
from semsig_gis.localization import (
    NOISES,
    LikelihoodMethod,
    Method,
    Requirement,
    build_index,
    cell_noise,
    localize,
    localize_many,
    locate,
    method_index,
    named_noise,
    parse_method,
)
from semsig_gis.observation import parse_view

if TYPE_CHECKING:
    from pathlib import Path

TOWN = random_town()
CITY = TOWN.database
LONGEST = int(CITY.lengths.argmax())
QUERY = CITY.signature(LONGEST)
INDEX = build_index(CITY, cell_noise(named_noise("generic"), CITY.grid.step))


def test_default_method_is_likelihood() -> None:
    assert isinstance(parse_method(DEFAULT_METHOD), LikelihoodMethod)
    assert isinstance(parse_method(PAPER_METHOD), Method)
    for function in (semsig_gis.localize, semsig_gis.evaluate):
        assert inspect.signature(function).parameters["method"].default is DEFAULT_METHOD


def test_database_is_searched_by_likelihood() -> None:
    assert localize(CITY, QUERY).to_dict() == locate(INDEX, QUERY, explained=1).to_dict()
    limited = localize(CITY, QUERY, requirement=Requirement.parse("?<=3", CITY.taxonomy))
    assert limited.candidates["length"].max() <= 3
    with refused(InputError, "store"):
        localize(CITY, QUERY, method="likelihood:generic:refined")


def test_place_is_refined_between_cells_of_city(tmp_path: Path) -> None:
    city = open_city(save_town(tmp_path, TOWN))
    refined = locate(INDEX, QUERY, store=city.store, refined=True, explained=1)
    assert localize(city, QUERY).to_dict() == refined.to_dict()
    on_grid = localize(city, QUERY, method=LikelihoodMethod.parse("likelihood:generic:on_grid"))
    assert on_grid.answer.cell == LONGEST
    assert localize(city, QUERY, method=PAPER_METHOD).to_dict() == (
        localize(CITY, QUERY, method=Method.parse(PAPER_METHOD)).to_dict()
    )


SENTENCE = "bench at 40, street light at 120, tree at 200"
PAIRS = [("bench", 40), ("street light", 120), ("tree", 200)]
DETECTIONS = [{"class": name, "bearing": bearing} for name, bearing in PAIRS]


def test_every_form_of_a_view_gives_the_same_answer(tmp_path: Path) -> None:
    path = save_town(tmp_path, TOWN)
    parsed = parse_view({"see": SENTENCE}, taxonomy=CITY.taxonomy)
    by_hand = localize(open_city(path), parsed, method="likelihood:by-hand").to_dict()
    for where in (path, str(path), open_city(path)):
        for view in (SENTENCE, PAIRS, {"see": SENTENCE}, SENTENCE.split(", ")):
            assert localize(where, view).to_dict() == by_hand
    # Rows are those of a detector.
    generic = localize(path, parsed).to_dict()
    assert generic["noise"] == "generic"
    for rows in (DETECTIONS, {"detections": DETECTIONS}):
        assert localize(path, rows).to_dict() == generic


def test_class_names_and_ranges_need_no_bearings() -> None:
    answer = localize(CITY, ["bench", "tree"])
    assert answer.query.bearings is None
    with refused(InputError, "no explanation"):
        answer.explain()
    pairs = [("bench", np.float64(45), 12.5), ("tree", -90), ("street light", "NE", "near")]
    sentence = "bench at 45 12.5 m, tree at 270, street light NE near"
    assert localize(CITY, pairs).to_dict() == localize(CITY, sentence).to_dict()
    assert len(localize(CITY, []).query) == 0


def test_absent_and_undirected_objects_are_used() -> None:
    prior = localize(CITY, f"{SENTENCE}, bus stop, no fountain").to_dict()["prior"]
    assert prior is not None
    assert prior["seen"] == ["bus stop"]
    assert len(prior["absent"]) == 1
    assert "ratio" not in prior
    # They belong to the view: only a prior that was given can contradict it.
    flat = np.zeros(len(CITY))
    both = localize(CITY, f"{SENTENCE}, bus stop, no fountain", log_prior=flat)
    assert both.prior_ratio == pytest.approx(1.0)
    assert (
        both.to_dict()["candidates"]
        == localize(CITY, f"{SENTENCE}, bus stop, no fountain").to_dict()["candidates"]
    )
    with refused(InputError, "edit", "directions"):
        localize(CITY, f"{SENTENCE}, bus stop", method=PAPER_METHOD)


def test_objects_without_direction_are_explained() -> None:
    assert QUERY.codes is not None
    assert QUERY.bearings is not None
    codes = QUERY.codes.tolist()
    # The objects of the last class have no direction, and one more of it is said than is there.
    *_, last = codes
    others = [number for number, code in enumerate(codes) if code != last]
    title = CITY.taxonomy.words([last])
    pairs = [
        (CITY.taxonomy.by_code(codes[number]).name, float(QUERY.bearings[number]))
        for number in others
    ]
    count = codes.count(last)
    absent = next(code for code in CITY.present_codes.tolist() if code not in codes)
    none = f"no {CITY.taxonomy.words([absent])}"
    sentence = ", ".join(
        [*(f"{name} at {at:.0f}" for name, at in pairs), *[title] * (count + 1), none]
    )
    answer = localize(CITY, sentence)
    assert answer.unplaced == (last,) * (count + 1)
    table = answer.explain().set_index("you said")
    here = answer.posterior.database.select(answer.columns["cell"][:1])
    standing = here.codes.tolist().count(last)
    there = table.loc[[title], "verdict"].tolist()
    assert there.count("is there") == min(standing, count + 1)
    assert table.loc[none, "verdict"] in {"is not there", "is there"}
    undirected, _ = answer.without_direction(answer.explanations[0])
    assert len(undirected) == min(standing, count + 1)
    page = semsig_gis.location_map(answer).get_root().render()
    assert page.count('"no direction"') == len(undirected)
    assert none in page


def test_answer_says_where_and_why(tmp_path: Path) -> None:
    answer = localize(open_city(save_town(tmp_path, TOWN)), QUERY)
    place = answer.to_dict()["place"]
    assert answer.latlon == (place["lat"], place["lon"])
    assert answer.chance == place["chance"]
    for text in (f"{answer.latlon[0]:.5f}", percent(answer.chance)):
        assert text in repr(answer)
        assert text in answer._repr_html_()
    table = answer.explain()
    assert list(table) == ["you said", "is there", "verdict", "chance"]
    assert (table["verdict"][: len(QUERY)] == "is there").all()
    assert QUERY.codes is not None
    assert QUERY.bearings is not None
    first = CITY.taxonomy.by_code(int(QUERY.codes[0])).title.lower()
    assert table["you said"][0] == f"{first} at {QUERY.bearings[0]:.0f}°"
    assert table["is there"][0].startswith(first)
    distances = localize(CITY, QUERY, method=PAPER_METHOD)
    assert distances.chance is None
    assert distances.latlon == pytest.approx(answer.latlon, abs=1e-3)


def test_database_keeps_the_last_indexes() -> None:
    database = random_town().database
    methods = [
        LikelihoodMethod.parse(f"likelihood:{name}") for name in ("generic", "light", "medium")
    ]
    indexes = [method_index(database, method) for method in methods]
    assert [method_index(database, method) for method in methods] == indexes
    for name in ("strong", "by-hand", "photo"):
        method_index(database, LikelihoodMethod.parse(f"likelihood:{name}"))
    assert method_index(database, methods[2]) is indexes[2]
    assert method_index(database, methods[0]) is not indexes[0]


@pytest.mark.parametrize("name", sorted(NOISES))
def test_index_of_every_noise_is_used_again(name: str) -> None:
    database = random_town().database
    method = LikelihoodMethod.parse(f"likelihood:{name}")
    assert method_index(database, method) is method_index(database, method)
    assert len(database.memo) == 1


def test_many_questions_are_answered_in_order() -> None:
    views: list[Any] = [SENTENCE, PAIRS[:2], QUERY]
    answers = localize_many(CITY, iter(views), top=3)
    assert [answer.to_dict() for answer in answers] == [
        localize(CITY, view, top=3).to_dict() for view in views
    ]
    answers = localize_many(CITY, [SENTENCE, "dragon at 40", SENTENCE])
    next(answers)
    with refused(UnknownNameError, "dragon"):
        next(answers)


@pytest.mark.parametrize(
    ("view", "parts"),
    [
        ("  ", ("empty", "sentence")),
        (7, ("type int", "sentence")),
        ([("bench", 40, 12, 3)], ("('bench', 40, 12, 3)", "bearing")),
        ([8], ("8 is not", "bearing")),
        ({"seen": "bench at 40"}, ("keys seen", "nearest is 'see'")),
    ],
)
def test_other_forms_of_a_view_are_refused(view: Any, parts: tuple[str, ...]) -> None:  # noqa: ANN401 - any value of a user
    with refused(InputError, *parts):
        localize(CITY, view)


@pytest.mark.parametrize(
    ("where", "words"), [(7, "a int"), (TOWN.street_objects, "street objects")]
)
def test_other_places_to_search_are_refused(where: Any, words: str) -> None:  # noqa: ANN401 - any value of a user
    with refused(InputError, words, "build", "open_city"):
        localize(where, SENTENCE)


def test_options_of_the_likelihood_are_refused_for_a_distance() -> None:
    with refused(InputError, "north_sigma", "likelihood"):
        localize(CITY, QUERY, method=PAPER_METHOD, north_sigma=10.0)


@pytest.mark.parametrize("method", [DEFAULT_METHOD, PAPER_METHOD])
def test_evaluation_accepts_text_of_method(method: str) -> None:
    settings: dict[str, Any] = {"queries": 12, "seed": 3}
    evaluation = evaluate(CITY, method=method, **settings)
    grid = build_index(CITY, named_noise("generic"))
    used = grid if method == DEFAULT_METHOD else Method.parse(method)
    same = evaluate(CITY, method=used, **settings)
    assert evaluation.queries.equals(same.queries)
    assert str(evaluation.method) == str(same.method)
    with refused(InputError, "refined"):
        evaluate(CITY, method="likelihood:generic:refined", **settings)


def test_path_of_street_objects_is_no_table() -> None:
    with refused(InputError, "objects.parquet", "open_objects"):
        semsig_gis.build("objects.parquet")
