"""Old public names keep working with a warning until a stated version."""

from __future__ import annotations

import importlib
import re

import pytest
from packaging.version import Version

import semsig_gis

RENAMED: dict[str, tuple[str, str]] = vars(semsig_gis)["_RENAMED"]
MOVED: dict[str, str] = vars(semsig_gis)["_MOVED"]
MOVED_END: str = vars(semsig_gis)["_MOVED_END"]
MESSAGES = {
    **{old: f"is called {new} now; version {end}" for old, (new, end) in RENAMED.items()},
    **{
        name: f"is imported from semsig_gis.{package} now; version {MOVED_END}"
        for name, package in MOVED.items()
    },
}


@pytest.mark.parametrize("old", MESSAGES)
def test_old_name_returns_the_same_object_with_a_warning(old: str) -> None:
    message = f"semsig_gis.{old} {MESSAGES[old]} removes the old name."
    with pytest.warns(DeprecationWarning, match=f"^{re.escape(message)}$") as warnings:
        value = getattr(semsig_gis, old)
    assert warnings[0].filename == __file__
    if old in RENAMED:
        assert value is getattr(semsig_gis, RENAMED[old][0])
    else:
        assert value is getattr(importlib.import_module(f"semsig_gis.{MOVED[old]}"), old)


def test_warning_points_at_the_line_of_the_import() -> None:
    with pytest.warns(DeprecationWarning, match="draft_catalog") as warnings:
        exec("from semsig_gis import suggest_catalog", {"__name__": "theirs"})  # noqa: S102
    assert warnings[0].filename == "<string>"


def test_old_names_are_not_listed() -> None:
    assert set(MESSAGES).isdisjoint(dir(semsig_gis))


@pytest.mark.parametrize("end", [MOVED_END, *(end for _, end in RENAMED.values())])
def test_old_names_are_removed_in_their_version(end: str) -> None:
    assert Version(semsig_gis.__version__) < Version(end)


def test_a_wrong_name_is_refused_with_the_nearest_or_its_package() -> None:
    for wrong, right in (("localise", "localize"), ("optn_city", "open_city")):
        with pytest.raises(AttributeError, match=f"no name '{wrong}'; the nearest is '{right}'"):
            getattr(semsig_gis, wrong)
    with pytest.raises(AttributeError, match=r"import it from semsig_gis\.database\."):
        getattr(semsig_gis, "TilePlan")  # noqa: B009 - mypy knows that there is none
    assert not hasattr(semsig_gis, "_ipython_display_")
    assert semsig_gis.localization is importlib.import_module("semsig_gis.localization")
