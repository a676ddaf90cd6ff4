from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING, Any

import pytest
from sentences import refused

from semsig_gis.core import MACHINE_PREFIX, InputError
from semsig_gis.storage import RunKind, finish, partial_folder, read_json, write_json

if TYPE_CHECKING:
    from pathlib import Path

RUN = RunKind(
    content="results of a trial",
    another="{folder} differs in {difference}; choose another folder.",
    read=lambda folder: read_json(folder / "recipe.json"),
    write=lambda folder, recipe: write_json(folder / "recipe.json", recipe),
    names={"recipe.json", "inputs"},
    results="part_*",
)
RECIPE: dict[str, Any] = {"step": 10.0, "inputs": {"trees": "ab"}, "seeds": (1, 2)}
OTHERS: list[tuple[dict[str, Any], str]] = [
    ({**RECIPE, "step": 5.0}, "step"),
    ({**RECIPE, "inputs": {"trees": "cd"}}, "inputs, trees"),
    ({**RECIPE, "inputs": {"trees": "ab", "lamps": None}}, "inputs, lamps"),
    ({**RECIPE, "inputs": None}, "inputs"),
    ({**RECIPE, "version": "9"}, "version"),
    ({"step": 10.0, "inputs": {"trees": "ab"}}, "seeds"),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a run with a result."""
    out_folder = partial_folder(tmp_path / "new" / "out")
    RUN.begin(out_folder, RECIPE)
    (out_folder / "part_1").touch()
    return out_folder


def test_run_is_resumed_with_the_same_recipe(folder: Path) -> None:
    (folder / "deep" / f"{MACHINE_PREFIX}x").mkdir(parents=True)  # as a killed process leaves
    RUN.begin(folder, RECIPE)
    assert sorted(path.name for path in folder.iterdir()) == ["deep", "part_1", "recipe.json"]
    assert list((folder / "deep").iterdir()) == []


@pytest.mark.parametrize(("other", "difference"), OTHERS)
def test_another_recipe_is_refused_or_replaces_a_run_without_results(
    folder: Path, other: dict[str, Any], difference: str
) -> None:
    for refuse in (RUN.begin, RUN.require_same):
        with refused(InputError, str(folder), f"differs in {difference};"):
            refuse(folder, other)
    (folder / "part_1").unlink()
    (folder / "letter.txt").touch()  # must not be removed
    with pytest.raises(InputError):
        RUN.begin(folder, other)
    (folder / "letter.txt").unlink()
    RUN.begin(folder, other)
    assert RUN.read(folder) == json.loads(json.dumps(other))


@pytest.mark.parametrize("text", ["{", "[]", "\0", None])
def test_folder_without_a_recipe_is_refused(folder: Path, text: str | None) -> None:
    recipe = folder / "recipe.json"
    recipe.unlink() if text is None else recipe.write_text(text, encoding="utf-8")
    with refused(InputError, str(folder), "'part_1'", "no results of a trial"):
        RUN.begin(folder, RECIPE)


def test_unwritable_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for out_folder in (tmp_path / "file", tmp_path / "file" / "out"):
        with refused(InputError, str(out_folder), "Not a directory", "choose a"):
            RUN.begin(out_folder, RECIPE)


def test_only_runs_without_results_are_removed(folder: Path) -> None:
    assert not RUN.abandon(folder)
    (folder / "part_1").unlink()
    assert RUN.abandon(folder)
    assert not folder.exists()


def test_finished_run_is_renamed(folder: Path) -> None:
    out = finish(folder)
    assert not folder.exists()
    assert {path.name for path in out.iterdir()} == {"recipe.json", "part_1"}
    shutil.copytree(out, folder)
    with refused(InputError, str(folder), "run the same command again"):
        finish(folder)
    assert finish(folder, keep={"part_1"}) == out
    assert [path.name for path in out.iterdir()] == ["part_1"]
    assert [path.name for path in out.parent.iterdir()] == ["out"]


def test_files_removed_meanwhile_by_another_process_are_ignored(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "late" / "half").mkdir(parents=True)
    remove = shutil.rmtree

    def remove_twice(path: Path, **options: Any) -> None:  # noqa: ANN401
        monkeypatch.setattr(shutil, "rmtree", remove)
        (path / "half").rmdir()
        raise FileNotFoundError(path, options)

    monkeypatch.setattr(shutil, "rmtree", remove_twice)
    out = finish(folder, keep={"part_1"})
    assert [path.name for path in out.iterdir()] == ["part_1"]
