"""Legends: what they say, and that text from data stays text."""

from __future__ import annotations

import dataclasses
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import numpy as np
import pytest
from cells_told import told_of

from semsig_gis.core.colours import SHADES
from semsig_gis.core.signature import Signature
from semsig_gis.database.build import build_database
from semsig_gis.database.update import CellChanges
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.likelihood.answer_rule import AnswerRule
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.maps.cells import ambiguity_legend, identifiability_legend
from semsig_gis.maps.drift import drift_legend
from semsig_gis.maps.evaluation import evaluation_legend
from semsig_gis.maps.localization import localization_legend
from semsig_gis.maps.location import location_legend
from semsig_gis.matching.search import localize
from semsig_gis.objects.changes import ClassChange, ObjectChanges
from semsig_gis.objects.clean import build_objects
from semsig_gis.queries.distortions import MissingClasses
from semsig_gis.queries.draw import QuerySpec
from semsig_gis.sources.catalog import paper_taxonomy
from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation

HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(1)> \"'`${alert(1)} {{7*7}} & \\ é"


class Text(HTMLParser):
    """The text of HTML, and the elements in it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.shown = ""
        self.tags: set[str] = set()
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002
        self.tags.add(tag)
        if tag != "bdi":
            self.shown += "\n" if tag in {"p", "br", "tr"} else " "

    def handle_data(self, data: str) -> None:
        self.shown += data


@pytest.fixture(scope="module")
def database() -> SignatureDatabase:
    layers = synthetic_city(CitySpec(size=300.0))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    return dataclasses.replace(build_database(objects), licenses=("Town (CC0): trees, lamps",))


@pytest.fixture(scope="module")
def evaluation(database: SignatureDatabase) -> Evaluation:
    return evaluate(database, queries=40, distortion="errors:3, view:200")


def test_what_an_evaluation_says(evaluation: Evaluation, database: SignatureDatabase) -> None:
    text = Text(
        evaluation_legend(evaluation, error_limit="150 m", licenses=database.licenses)
    ).shown
    successful = int(evaluation.successful.sum())
    for said in (
        f"40 queries among {len(database):,} cells",
        "Method: edit+edit, the best candidate",
        "Distortion: errors:3, view:200",
        f"P(error ≤ 50 m) {evaluation.cdf([50])[0]:.1%}",
        f"{successful} successful: within 50 m with probability 0.5 or more",
        f"{40 - successful} failed",
        "150 m, as bad as a guess",
        "1-4",
        "20+",
        "Data: Town (CC0): trees, lamps",
        "Made with semsig_gis",
    ):
        assert said in text


def test_variants_of_an_evaluation(database: SignatureDatabase) -> None:
    exact = evaluate(database, queries=5, distortion="none", top=3)
    text = Text(evaluation_legend(exact, error_limit="1 m", licenses=())).shown
    assert "the best of 3" in text
    assert "Distortion: none" in text
    assert "Data" not in text


@pytest.mark.parametrize(
    ("query", "said", "unsaid"),
    [
        (Signature.parse("DB", [10, 359.7], taxonomy=paper_taxonomy()), "Types: DB", "Types: D\n"),
        (Signature.parse("DB", None, taxonomy=paper_taxonomy()), "by types", "Bearings"),
        (Signature.parse(None, [10, 359.7], taxonomy=paper_taxonomy()), "10° 0°", "Types:"),
    ],
)
def test_what_a_localization_says(
    query: Signature, said: str, unsaid: str, database: SignatureDatabase
) -> None:
    localization = localize(database, query, top=7)
    text = Text(localization_legend(localization)).shown
    assert said in text
    assert unsaid not in text
    assert f"The best 7 of {len(database):,} cells" in text
    assert ("more cells are as good" in text) == (localization.tied_beyond > 0)
    assert f"{localization.candidates['distance'].max():.3f}" in text
    assert "Data: Town (CC0): trees, lamps" in text
    tied = dataclasses.replace(localization, tied_beyond=1)
    assert "1 more cell is as good as the last one" in Text(localization_legend(tied)).shown


def test_text_from_data_stays_text(evaluation: Evaluation, database: SignatureDatabase) -> None:
    plain = evaluation_legend(evaluation, error_limit="1 m", licenses=["x"])
    asked = QuerySpec(distortions=(MissingClasses(classes=(HOSTILE,)),))
    hostile = dataclasses.replace(evaluation, asked=asked)
    shown = Text(evaluation_legend(hostile, error_limit="1 m", licenses=[HOSTILE]))
    assert shown.shown.count(HOSTILE) == 2
    assert shown.tags == Text(plain).tags
    localization = localize(database, database.signature(0), top=2)
    hostile_place = dataclasses.replace(localization, licenses=(HOSTILE,))
    assert HOSTILE in Text(localization_legend(hostile_place)).shown


def test_what_a_location_says(database: SignatureDatabase) -> None:
    cell = int(database.lengths.argmax())
    index = build_index(database, named_noise("light"))
    location = locate(index, database.signature(cell), explained=1)
    shown = Text(location_legend(location))
    for said in ("The answer", f"Types: {database.types(cell)}", "light noise", "50% in 1 cell"):
        assert said in shown.shown
    assert "misnamed" in shown.shown
    unsure = locate(index, database.signature(cell), rule=AnswerRule(threshold=2.0))
    assert "Cannot tell; the best place" in Text(location_legend(unsure)).shown
    assert "misnamed" not in Text(location_legend(unsure)).shown
    hostile = Text(location_legend(dataclasses.replace(location, noise=HOSTILE)))
    assert hostile.shown.count(HOSTILE) == 1
    assert hostile.tags == shown.tags


def test_shades_begin_with_one_object() -> None:
    assert min(SHADES) == 1
    assert list(SHADES) == sorted(SHADES)


def test_what_identifiability_says(database: SignatureDatabase) -> None:
    told = told_of(database)
    facts = told.summary()
    text = Text(identifiability_legend(told)).shown
    best = facts["classes"][0]
    for said in (
        f"{len(database):,} cells, medium noise",
        f"within 30 m; {facts['chance_found']:.1%} for the mean cell",
        f"90% to 100%: {facts['bands'][-1]['share']:.1%} of the cells",
        f"{best['title']} {100 * best['chance_near']:+.1f} %",
        "Data: Town (CC0): trees, lamps",
    ):
        assert said in text
    assert text.count("+") <= 6  # classes that are named


def test_identifiability_lets_no_data_run(database: SignatureDatabase) -> None:
    noise = dataclasses.replace(named_noise("medium"), name=HOSTILE)
    told = dataclasses.replace(told_of(database), noise=noise)
    read = Text(identifiability_legend(told))
    assert HOSTILE in read.shown
    assert not {"script", "img"} & read.tags


def test_what_groups_of_cells_say() -> None:
    sizes = np.array([1, 1, 2, 2, 9, 10, 12_345, 12_345])
    text = Text(
        ambiguity_legend({"types": sizes, "both": sizes[::-1] // 3 + 1}, licenses=[HOSTILE])
    )
    for said in (
        "8 cells",
        "no other 25.0% 50.0%",
        "2 to 9 37.5% 25.0%",
        "10 to 99 12.5% 0.0%",
        "1,000 to 9,999 0.0% 25.0%",
        "10,000 or more 25.0% 0.0%",
        HOSTILE,
    ):
        assert said in text.shown
    assert not {"script", "img"} & text.tags


def test_what_drift_says() -> None:
    pairs = np.zeros((6, 2), np.int64)
    cells = CellChanges(same=pairs, changed=pairs[:2], vanished=pairs[:1, 0], appeared=pairs[:1, 0])
    text = Text(drift_legend(cells, None, taxonomy=paper_taxonomy(), licenses=[HOSTILE])).shown
    for said in (
        "of 10 before or after",
        "see what they saw 6 60.0%",
        "see nothing now 1 10.0%",
        HOSTILE,
    ):
        assert said in text
    assert "Street objects" not in text
    change = ClassChange(
        class_name="bench", before=3, after=4, added=2, removed=1, moved=5, moved_m=1.0, gained=0,
        lost=0,
    )  # fmt: skip
    still = dataclasses.replace(change, class_name="bus_stop", added=0, removed=0, moved=0)
    objects = ObjectChanges(
        same=pairs, moved=pairs[:5], changed=pairs[:0], removed=pairs[:1, 0], added=pairs[:2, 0],
        classes=(still, change),
    )  # fmt: skip
    text = Text(drift_legend(cells, objects, taxonomy=paper_taxonomy(), licenses=())).shown
    for said in ("2 added", "1 removed", "5 moved", "0 of another class", "Public bench 2 1 5"):
        assert said in text
    assert "Bus stop" not in text


def test_signs_of_direction_turn_no_other_text(
    evaluation: Evaluation, database: SignatureDatabase
) -> None:
    turned = "\u202eno ecnecil"
    for legend in (
        evaluation_legend(evaluation, error_limit="1 m", licenses=[turned]),
        localization_legend(
            dataclasses.replace(
                localize(database, database.signature(0), top=2), licenses=(turned,)
            )
        ),
    ):
        assert f"<bdi>{turned}</bdi>" in legend
