"""Texts of legends, and hostile text from data in them."""

from __future__ import annotations

import dataclasses
import functools
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from html_pages import HtmlPage
from small_city import chances_of, small_city

import semsig_gis
from semsig_gis.core import Signature, Taxonomy
from semsig_gis.database import CellChanges
from semsig_gis.evaluation import MissingClasses, evaluate
from semsig_gis.localization import AnswerRule, Method, build_index, localize, locate, named_noise
from semsig_gis.objects import ClassChange, Licence, ObjectChanges
from semsig_gis.output import (
    ambiguity_legend,
    drift_legend,
    evaluation_legend,
    identifiability_legend,
    localization_legend,
    location_legend,
    objects_legend,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects

HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(1)>\"'`${alert(1)}{{7*7}}&\\é\u202eabc"
CITY, OBJECTS = small_city()
EVALUATION = evaluate(CITY, queries=40, distortion="errors:3, view:200", method=Method())
QUERY = Signature.parse("DB", [10, 359.7], taxonomy=CITY.taxonomy)
TYPES, BEARINGS = Signature(QUERY.codes, None), Signature(None, QUERY.bearings)
SIZES = np.array([1, 1, 2, 2, 9, 10, 12_345, 12_345])
ROWS = np.zeros((6, 2), np.int64)
CELLS = CellChanges(same=ROWS, changed=ROWS[:2], vanished=ROWS[:1, 0], appeared=ROWS[:1, 0])
BENCH = ClassChange(
    class_name="bench", before=3, after=4, added=2, removed=1, moved=5, moved_m=1.0, gained=0,
    lost=0,
)  # fmt: skip
STILL = dataclasses.replace(BENCH, class_name="bus_stop", added=0, removed=0, moved=0)
CHANGES = ObjectChanges(
    same=ROWS, moved=ROWS[:5], changed=ROWS[:0], removed=ROWS[:1, 0], added=ROWS[:2, 0],
    altered=ROWS[:0], classes=(STILL, BENCH),
)  # fmt: skip


def legends(city: SignatureDatabase, objects: StreetObjects, name: str) -> dict[str, str]:
    """Return all legends of a city, with a name for a noise model and a class."""
    noise = dataclasses.replace(named_noise("light"), name=name)
    exact = evaluate(city, queries=5, distortion="none", top=3, method=Method())
    without = (MissingClasses(classes=(name,)),)
    query_spec = dataclasses.replace(EVALUATION.asked, distortions=without)
    by_types, by_both, by_bearings = (
        localize(city, part, top=7, method=Method()) for part in (TYPES, QUERY, BEARINGS)
    )
    index = build_index(city, noise)
    query = city.signature(int(city.lengths.argmax()))
    drift = functools.partial(
        drift_legend, cells=CELLS, taxonomy=city.taxonomy, licenses=city.licenses
    )
    sizes = {"types": SIZES, "both": SIZES[::-1] // 3 + 1}
    return {
        "evaluation": evaluation_legend(EVALUATION, radius=250.0, licenses=city.licenses),
        "evaluation_of_classes": evaluation_legend(
            dataclasses.replace(EVALUATION, asked=query_spec), radius=250.0, licenses=()
        ),
        "evaluation_without_distortion": evaluation_legend(exact, radius=1000.0, licenses=()),
        "localization": localization_legend(by_both),
        "localization_by_types": localization_legend(dataclasses.replace(by_types, tied_beyond=1)),
        "localization_by_bearings": localization_legend(by_bearings),
        "location": location_legend(locate(index, query, explained=1)),
        "location_unsure": location_legend(locate(index, query, rule=AnswerRule(threshold=2.0))),
        "location_doubted": location_legend(locate(index, query).doubted(0.6, 0.002)),
        "identifiability": identifiability_legend(
            dataclasses.replace(chances_of(city), noise=noise)
        ),
        "ambiguity": ambiguity_legend(sizes, licenses=city.licenses),
        "drift": drift(objects=None),
        "drift_of_objects": drift(objects=CHANGES),
        "objects": objects_legend(objects),
    }


LEGENDS = {name: HtmlPage(text) for name, text in legends(CITY, OBJECTS, "light").items()}


@pytest.mark.parametrize("name", LEGENDS)
def test_legend_text_is_as_in_the_snapshot(name: str, snapshot: Callable[[str, str], None]) -> None:
    text = LEGENDS[name].text.replace(semsig_gis.__version__, "VERSION")
    lines = (" ".join(line.split()) for line in text.splitlines())
    snapshot(f"{name}.txt", "\n".join(line for line in lines if line) + "\n")


def test_hostile_text_in_legends_stays_text() -> None:
    classes = [dataclasses.replace(item, title=HOSTILE) for item in CITY.taxonomy.classes]
    taxonomy = Taxonomy(tuple(classes))
    city = dataclasses.replace(CITY, taxonomy=taxonomy, licenses=(HOSTILE,))
    objects = dataclasses.replace(OBJECTS, taxonomy=taxonomy, licenses=(Licence(HOSTILE),))
    for name, legend in legends(city, objects, HOSTILE).items():
        page = HtmlPage(legend)
        assert (HOSTILE in page.text) == (name != "evaluation_without_distortion")
        assert page.tags == LEGENDS[name].tags
        # Its text direction does not change the text around it.
        assert "\u202e" not in re.sub(r"<bdi>.*?</bdi>", "", legend, flags=re.DOTALL)
