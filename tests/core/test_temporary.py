"""Hidden folders: they go with their process, and stay as long as it lives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from semsig_gis.core import ASIDE, HALF_DONE, MACHINE, OWNER, own_folder, remove_abandoned
from semsig_gis.core import temporary as scratch

if TYPE_CHECKING:
    from pathlib import Path


def killed(parent: Path, name: str = MACHINE) -> Path:
    """Return the folder of a process that was killed while it worked there."""
    folder = parent / f"{name}killed"
    (folder / "deep").mkdir(parents=True)
    (folder / "deep" / "half.txt").write_text("half")
    (folder / OWNER).touch()
    return folder


def test_a_folder_is_there_for_a_block(tmp_path: Path) -> None:
    with own_folder(tmp_path) as folder:
        assert folder.parent == tmp_path
        (folder / "deep").mkdir()
        (folder / "deep" / "a.txt").touch()
        (folder / "link").symlink_to(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_while_a_folder_is_made_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: int, **_options: bool) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr(scratch, "locked", interrupted)
    with pytest.raises(KeyboardInterrupt), own_folder(tmp_path):
        pytest.fail("there is no folder to work in")
    assert list(tmp_path.iterdir()) == []


def test_the_next_one_removes_those_of_killed_processes_alone(tmp_path: Path) -> None:
    elsewhere = killed(tmp_path, f"{HALF_DONE}0a1b2c3d-")  # another machine may hold it
    unknown = tmp_path / f"{MACHINE}unknown"
    (unknown / "deep").mkdir(parents=True)
    killed(tmp_path)
    (tmp_path / f"{MACHINE}empty").mkdir()  # killed at once
    with own_folder(tmp_path) as one, own_folder(tmp_path) as two:
        assert {*tmp_path.iterdir()} == {one, two, elsewhere, unknown}
    assert {*tmp_path.iterdir()} == {elsewhere, unknown}


def test_what_was_put_aside_is_put_back_where_its_place_is_empty(tmp_path: Path) -> None:
    for number, expected in enumerate(["old", "old"]):
        aside = killed(tmp_path) / ASIDE
        aside.mkdir()
        (aside / "city").write_text("old" if number == 0 else "older")
        remove_abandoned(tmp_path)
        assert (tmp_path / "city").read_text() == expected
        assert [path.name for path in tmp_path.iterdir()] == ["city"]


@pytest.mark.parametrize("name", ["nowhere", "n" * 5000])
def test_a_folder_that_cannot_be_made_is_an_error(tmp_path: Path, name: str) -> None:
    remove_abandoned(tmp_path / name)
    with pytest.raises(OSError, match=name), own_folder(tmp_path / name):
        pytest.fail("the block must not run")
