from __future__ import annotations

import importlib
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core import errors, extra

NAMES = st.text(st.characters(codec="utf-8"), max_size=12)


@pytest.mark.parametrize("name", [name for name in vars(errors) if name.endswith("Error")])
def test_errors_have_the_base_class_and_a_builtin_class(name: str) -> None:
    kind = getattr(errors, name)
    assert issubclass(kind, errors.SemsigError)
    if kind is not errors.SemsigError:
        assert issubclass(kind, ValueError | LookupError | RuntimeError)


@pytest.mark.parametrize(
    ("name", "names", "nearest"),
    [
        ("layrs", ["layer", "layers", "license"], "layers"),
        ("Tree", ["tree", "street"], "tree"),
        ("street_ligth", ["street_light", "traffic_light"], "street_light"),
        ("d", ["B", "C", "D"], "D"),
        ("zebra", ["layer", "class"], None),
        ("zebra", [], None),
        ("", ["layer"], None),
    ],
)
def test_misspelt_name_gets_the_nearest_name(
    name: str, names: list[str], nearest: str | None
) -> None:
    offer = f"; the nearest is {nearest!r}" if nearest else ""
    assert errors.nearest_name(name, names) == offer


@given(NAMES, st.lists(NAMES, max_size=5))
def test_nearest_name_is_one_of_the_names(name: str, names: list[str]) -> None:
    offer = errors.nearest_name(name, names)
    assert not offer or offer in {f"; the nearest is {item!r}" for item in names}
    if name:  # which is nearest to itself
        assert errors.nearest_name(name, [*names, name]) == f"; the nearest is {name!r}"


@pytest.mark.parametrize(
    ("name", "package", "use"),
    [
        ("cluster", "distributed", "list(parallel.run_tasks(abs, [1], workers=2))"),
        ("plot", "matplotlib", "import semsig_gis.output.figures.axes"),
        ("raster", "rasterio", "import semsig_gis.storage.raster"),
    ],
)
def test_error_names_a_missing_extra(name: str, package: str, use: str) -> None:
    script = (
        f"import sys\nsys.modules[{package!r}] = None\n"
        "from semsig_gis.core import parallel\n"
        "from semsig_gis.core.errors import InputError\n"
        f"try:\n    {use}\n"
        "except InputError as error:\n    print(error)\n"
    )
    output = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, check=True, text=True
    ).stdout
    assert f"needs {package}, which is not installed" in output
    assert f"pip install 'semsig_gis[{name}]'." in output


def test_missing_module_of_the_package_is_no_missing_extra() -> None:
    with pytest.raises(ModuleNotFoundError), extra("serve", "the workbench"):
        importlib.import_module("semsig_gis.nowhere")
