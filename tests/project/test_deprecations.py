"""Old public names still work until a given version, with a warning."""

from __future__ import annotations

import re

import pytest
from packaging.version import Version

import semsig_gis

RENAMED: dict[str, tuple[str, str]] = vars(semsig_gis)["_RENAMED"]


@pytest.mark.parametrize("old", RENAMED)
def test_an_old_name_returns_the_new_object_with_a_warning(old: str) -> None:
    new, end = RENAMED[old]
    message = f"semsig_gis.{old} is called {new} now; version {end} removes the old name."
    with pytest.warns(DeprecationWarning, match=f"^{re.escape(message)}$") as warned:
        value = getattr(semsig_gis, old)
    assert warned[0].filename == __file__
    assert value is getattr(semsig_gis, new)


def test_the_warning_names_the_file_that_imports_an_old_name() -> None:
    with pytest.warns(DeprecationWarning, match="draft_catalog") as warned:
        exec("from semsig_gis import suggest_catalog", {"__name__": "theirs"})  # noqa: S102
    assert warned[0].filename == "<string>"


def test_old_names_are_not_listed() -> None:
    assert set(RENAMED).isdisjoint(dir(semsig_gis))


@pytest.mark.parametrize("old", RENAMED)
def test_no_old_name_outlives_its_version(old: str) -> None:
    assert Version(semsig_gis.__version__) < Version(RENAMED[old][1])
