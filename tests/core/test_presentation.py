import re
from pathlib import Path

import semsig_gis

ROOT_IMPORT = re.compile(
    r"^ *(import semsig_gis\b(?!\.)|from semsig_gis import (?!__version__$))", re.MULTILINE
)


def test_no_package_calls_upwards_through_the_root() -> None:
    root = Path(semsig_gis.__file__).parent
    modules = [path for path in root.rglob("*.py") if ROOT_IMPORT.search(path.read_text("utf-8"))]
    assert modules == []
