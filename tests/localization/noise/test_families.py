"""Families of classes in noise models."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import noise_specs
from sentences import refused

from semsig_gis.core import InputError, ObjectClass, Taxonomy
from semsig_gis.localization import NoiseSpec, noise_tables, open_noise, save_noise
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.localization import NoiseTable

FAMILIES = {
    **dict.fromkeys(["bench", "bin", "lamp"], "furniture"),
    **dict.fromkeys(["bakery", "butcher", "florist", "kiosk"], "shop"),
    "church": "worship",
    "statue": "",
}
NAMES = [*FAMILIES]
TAXONOMY = Taxonomy(
    tuple(
        ObjectClass(code, "abcdefghi"[code - 1], name, name, family=family)
        for code, (name, family) in enumerate(FAMILIES.items(), start=1)
    )
)


def table_of(
    spec: NoiseSpec, *, names: list[str] = NAMES, taxonomy: Taxonomy = TAXONOMY
) -> NoiseTable:
    codes = np.array(sorted(taxonomy.by_name(name).code for name in names), np.uint8)
    (table,), _ = noise_tables(spec, taxonomy=taxonomy, codes=codes, longest=3, radius=30.0)
    return table


@given(st.lists(st.sampled_from(NAMES), min_size=1, unique=True))
def test_most_misnamed_objects_stay_in_their_family(names: list[str]) -> None:
    table = table_of(NoiseSpec(), names=names)
    present = [TAXONOMY.by_code(code) for code in table.codes.tolist()]
    several = len({item.family for item in present} - {""}) > 1
    for row, item in enumerate(present):
        inside = [other for other in present if other != item and other.family == item.family != ""]
        rest = len(present) - 1 - len(inside)
        for column, other in enumerate(present):
            share = 1 / max(len(present) - 1, 1)
            if several and inside:
                share = 0.7 / len(inside) if other in inside else 0.3 / rest
            expected = 0.0 if row == column else share
            assert table.others[row, column] == pytest.approx(expected)


@given(noise_specs(), st.sampled_from(["", "furniture"]), st.integers(1, 5))
def test_one_family_changes_no_bit(spec: NoiseSpec, family: str, count: int) -> None:
    classes = paper_taxonomy().classes
    taxonomy = Taxonomy(tuple(replace(item, family=family) for item in classes))
    names = [item.name for item in classes[:count]]
    spec = replace(spec, confusion={})
    table = table_of(spec, names=names, taxonomy=taxonomy)
    equal = (1.0 - np.eye(count)) * (1.0 / max(count - 1, 1))
    assert (table.others == equal).all()


def test_an_entry_of_a_family_is_for_its_classes_without_their_own(tmp_path: Path) -> None:
    spec = NoiseSpec(
        detection=0.5,
        detection_by_class={"shop": 0.8, "kiosk": 0.3},
        misnamed_by_class={"furniture": 0.2},
        bearing_sigma_by_class={"lamp": 1.0, "furniture": 2.0},
        range_sigma_by_class={"worship": 0.5},
        fading={"all": [(0, 1.0)], "shop": [(0, 0.5)]},
        clutter=2.0,
        clutter_shares={"shop": 0.6, "kiosk": 0.3, "statue": 0.1},
        confusion={"shop": {"shop": 0.8, "church": 0.2}},
    )
    save_noise(spec, tmp_path / "noise.toml")
    assert open_noise(tmp_path / "noise.toml") == spec
    table = table_of(spec, names=["bench", "lamp", "bakery", "butcher", "kiosk", "church"])
    assert (1.0 - table.missed[0]).tolist() == pytest.approx([0.5, 0.5, 0.8, 0.8, 0.3, 0.5])
    assert table.misnamed[0, :2].tolist() == pytest.approx([0.2, 0.2])
    assert table.sigma[:3].tolist() == [2.0, 1.0, 5.0]
    assert table.range_sigma[-2:].tolist() == [0.25, 0.5]
    assert table.fading[:, 0].tolist() == [1.0, 1.0, 0.5, 0.5, 0.5, 1.0]
    # The florist is not in the city: the others have its share of the shops.
    assert table.clutter[2:5].tolist() == pytest.approx([0.6, 0.6, 0.6])
    assert table.named(0)[2, 2:].tolist() == pytest.approx([0.8 / 3, 0.8 / 3, 0.8 / 3, 0.2])


def test_names_that_are_neither_class_nor_family_are_refused() -> None:
    with refused(InputError, "'shops'", "the nearest is 'shop'", "families furniture, shop"):
        table_of(NoiseSpec(detection_by_class={"shops": 0.5}))
    table = table_of(NoiseSpec(detection_by_class={"shops": 0.5}, general=True))
    assert table.missed == pytest.approx(0.1)
