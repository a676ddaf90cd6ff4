"""The notebooks run from top to bottom, show pictures and a map, and contain no outputs."""

from __future__ import annotations

import ast
import gc
import json
import re
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

from semsig_gis.output import MapFrame, Picture

if TYPE_CHECKING:
    from collections.abc import Iterator

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
# Installed with the package: itself, its dependencies, and Python.
IMPORTED = {"geopandas", "matplotlib", "numpy", "pandas", "rapidfuzz", "semsig_gis"}
# Methods by which a notebook shows a value, best first.
SHOWN_BY = ("_repr_html_", "_repr_svg_", "_repr_markdown_", "__repr__")

each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def opened(path: Path) -> dict[str, Any]:
    notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return notebook


def code_of(path: Path) -> list[tuple[str, str]]:
    """Return the name and the text of every cell of code."""
    cells = opened(path)["cells"]
    return [(cell["id"], "".join(cell["source"])) for cell in cells if cell["cell_type"] == "code"]


def test_the_folder_lists_its_notebooks() -> None:
    listed = re.findall(r"\]\((\d\d_\w+\.ipynb)\)", (FOLDER / "README.md").read_text("utf-8"))
    assert listed == [path.name for path in NOTEBOOKS]
    assert [name[:2] for name in listed] == [f"{number:02}" for number in range(1, 9)]


@each_notebook
def test_a_notebook_is_saved_without_outputs(path: Path) -> None:
    notebook = opened(path)
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    assert notebook["metadata"] == {"kernelspec": KERNEL, "language_info": {"name": "python"}}
    names = [cell["id"] for cell in notebook["cells"]]
    assert len(set(names)) == len(names)
    for cell in notebook["cells"]:
        assert re.fullmatch(r"[a-z][a-z0-9-]{1,63}", cell["id"])  # a name, not a random number
        assert cell["metadata"] == {}
        if cell["cell_type"] == "code":
            assert (cell["outputs"], cell["execution_count"]) == ([], None)
    title, *_ = notebook["cells"][0]["source"]
    assert title == f"# {int(path.name[:2])}. {title[5:]}"
    # The same bytes, whichever program saved it.
    text = json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"
    assert path.read_text(encoding="utf-8") == text


@each_notebook
def test_a_notebook_imports_only_installed_packages(path: Path) -> None:
    for _, text in code_of(path):
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, ast.Import | ast.ImportFrom):
                continue
            names = [alias.name for alias in node.names]
            modules = names if isinstance(node, ast.Import) else [node.module or ""]
            for module in modules:
                package = module.split(".")[0]
                assert package in IMPORTED | sys.stdlib_module_names
                assert package != "semsig_gis" or module == package  # no inner module
            for name in (*modules, *names):
                assert not any(part.startswith("_") for part in name.split("."))


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Run in an empty folder, with another one for temporary files."""
    (tmp_path / "work").mkdir()
    (tmp_path / "temporary").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    with mpl.rc_context({"backend": "agg"}):
        yield tmp_path
    plt.close("all")


@each_notebook
def test_a_notebook_runs(path: Path, elsewhere: Path) -> None:
    files = sorted(FOLDER.rglob("*"))
    names: dict[str, Any] = {"__name__": "__main__"}
    shown: list[Any] = []
    for cell, text in code_of(path):
        shown.append(run_cell(text, names, where=f"{path.name}:{cell}"))
        figures = [plt.figure(number) for number in plt.get_fignums()]
        for figure in figures:
            figure.canvas.draw()
        shown += figures
        plt.close("all")
    # At least one picture, and at the end an interactive map.
    assert any(isinstance(value, Picture | mpl.figure.Figure) for value in shown)
    assert isinstance(shown[-1], MapFrame)
    names.clear()
    shown.clear()
    gc.collect()
    assert sorted(FOLDER.rglob("*")) == files
    assert [file for file in elsewhere.rglob("*") if file.is_file()] == []


def run_cell(text: str, names: dict[str, Any], *, where: str) -> object:
    """Run a cell, and show the value of its last line, as a notebook does."""
    body = ast.parse(text)
    last = body.body.pop() if isinstance(body.body[-1], ast.Expr) else None
    exec(compile(body, where, "exec"), names)  # noqa: S102
    if last is None:
        return None
    assert isinstance(last, ast.Expr)
    value: object = eval(compile(ast.Expression(last.value), where, "eval"), names)  # noqa: S307
    show = next(getattr(value, name) for name in SHOWN_BY if hasattr(value, name))
    assert value is None or show()
    return value
