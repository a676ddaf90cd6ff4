from __future__ import annotations

import pytest

from semsig_gis.evaluation import published as paris
from semsig_gis.localization import Method
from semsig_gis.sources import paper_taxonomy

SIGNATURES = 312_134


def test_occurrences_of_all_classes_agree_with_the_mean_length() -> None:
    assert list(paris.OCCURRENCES) == [item.name for item in paper_taxonomy().classes]
    assert sum(paris.OCCURRENCES.values()) / SIGNATURES == pytest.approx(14.08, abs=0.005)


def test_groups_agree_with_the_number_of_signatures() -> None:
    for kind in range(2):
        count = int(paris.GROUPS["count"][kind].replace(",", ""))
        assert SIGNATURES / count == pytest.approx(float(paris.GROUPS["mean"][kind]), abs=0.05)


def test_accuracy_increases_with_the_range() -> None:
    p50, recall10 = zip(*(paris.ACCURACY[radius, 16] for radius in (20.0, 30.0, 40.0)), strict=True)
    assert list(p50) == sorted(p50)
    assert list(recall10) == sorted(recall10)
    assert paris.STEP_M == 10.0


def test_times_of_two_stages_are_between_types_and_angles() -> None:
    assert [str(Method.parse(name)) for name in paris.QUERY_MS] == list(paris.QUERY_MS)
    for name in ("jaccard", "histogram", "edit"):
        types, angles = (paris.QUERY_MS[f"{part}:{name}"] for part in ("types", "angles"))
        assert types < paris.QUERY_MS[f"{name}+{name}:5%"] < angles
