from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core import errors

NAMES = st.text(st.characters(codec="utf-8"), max_size=12)


@pytest.mark.parametrize("name", [name for name in vars(errors) if name.endswith("Error")])
def test_one_root_catches_every_error_and_so_does_a_builtin(name: str) -> None:
    kind = getattr(errors, name)
    assert issubclass(kind, errors.SemsigError)
    if kind is not errors.SemsigError:
        assert issubclass(kind, ValueError | LookupError | RuntimeError)


@pytest.mark.parametrize(
    ("name", "known", "nearest"),
    [
        ("layrs", ["layer", "layers", "license"], "layers"),
        ("Tree", ["tree", "street"], "tree"),
        ("street_ligth", ["street_light", "traffic_light"], "street_light"),
        ("d", ["B", "C", "D"], "D"),
    ],
)
def test_a_misspelt_name_is_offered_its_nearest(name: str, known: list[str], nearest: str) -> None:
    assert errors.nearest_name(name, known) == f"; the nearest is {nearest!r}"


def test_nothing_is_offered_when_nothing_is_near() -> None:
    assert not errors.nearest_name("zebra", ["layer", "class"])
    assert not errors.nearest_name("zebra", [])
    assert not errors.nearest_name("", ["layer"])


@given(NAMES, st.lists(NAMES, max_size=5))
def test_what_is_offered_is_a_known_name(name: str, known: list[str]) -> None:
    offered = errors.nearest_name(name, known)
    assert not offered or offered in {f"; the nearest is {item!r}" for item in known}


@given(st.lists(NAMES.filter(bool), min_size=1, unique_by=str.lower))
def test_a_known_name_is_nearest_to_itself(known: list[str]) -> None:
    assert errors.nearest_name(known[0], known) == f"; the nearest is {known[0]!r}"
