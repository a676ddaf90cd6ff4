"""System calls that fail late: files and folders are old or new, as the message says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from late_failures import assert_true, failures

from semsig_gis.storage import move_folder, whole_file, whole_files, whole_folder, write_whole

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("calls", [1, 2, 1000])
def test_a_file_is_old_or_new_as_the_message_says(
    calls: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.txt"
    for run in failures(monkeypatch, exchange=True, calls=calls):
        path.write_text("old")
        error = run(lambda: write_whole(path, "new"))
        assert_true(error, tmp_path, path.read_text, names={"a.txt"})
    assert error is None


@pytest.mark.parametrize("calls", [1, 2, 1000])
@pytest.mark.parametrize("exchange", [True, False])
@pytest.mark.parametrize("way", ["whole", "move"])
def test_a_folder_is_old_or_new_as_the_message_says(
    *, way: str, exchange: bool, calls: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parent = tmp_path / "city"
    target, waiting = parent / "tiles", tmp_path / "waiting"
    names = ("a.txt", "deep/b.txt")

    def fill(folder: Path, text: str) -> None:
        for name in names:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)

    def write() -> None:
        if way == "move":
            move_folder(waiting, target)
            return
        with whole_folder(target) as partial:
            fill(partial, "new")

    def state() -> str:
        (text,) = {(target / name).read_text() for name in names}
        return text

    for run in failures(monkeypatch, exchange=exchange, calls=calls):
        fill(target, "old")
        fill(waiting, "new")
        assert_true(run(write), parent, state, names={"tiles"})
    assert state() == "new"


def test_files_that_belong_together_are_replaced_after_all_are_written(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.txt", "b.txt")]
    for path in paths:
        path.write_text("old")
    with pytest.raises(RuntimeError), whole_files(*paths) as partials:  # noqa: PT012
        partials[0].write_text("new")
        raise RuntimeError
    assert [path.read_text() for path in paths] == ["old", "old"]
    with whole_files(*paths) as partials:
        for partial in partials:
            partial.write_text("new")
    assert [path.read_text() for path in paths] == ["new", "new"]
    assert len([*tmp_path.iterdir()]) == 2


def test_permissions_of_what_is_replaced_are_kept(tmp_path: Path) -> None:
    file, folder = tmp_path / "a.txt", tmp_path / "city"
    write_whole(file, "old")
    usual = file.stat().st_mode
    file.chmod(0o600)
    write_whole(file, "new")
    assert file.stat().st_mode & 0o777 == 0o600
    with whole_folder(folder) as partial:
        (partial / "a.txt").write_text("old")
    folder.chmod(0o700)
    (folder / "a.txt").chmod(0o640)
    with whole_folder(folder) as partial:
        (partial / "a.txt").write_text("new")
        (partial / "b.txt").write_text("new")
    modes = [path.stat().st_mode & 0o777 for path in (folder, folder / "a.txt")]
    assert modes == [0o700, 0o640]
    assert (folder / "b.txt").stat().st_mode == usual
    link = tmp_path / "link.txt"
    link.symlink_to(file)
    with whole_file(link) as partial:
        partial.write_text("newer")
    assert file.stat().st_mode & 0o777 == 0o600
