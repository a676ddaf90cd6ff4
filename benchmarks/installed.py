"""Size and time of the plain installation: ``python -m benchmarks.installed``, only with Python.

The checkout is installed into a new environment with the versions of ``constraints.txt``. For
comparison, so are the seven libraries that were chosen for it at the start, and these with numba
and pyarrow. The sizes of packages include their compiled modules; they are printed and written as a
table to ``docs/install.md``. pip takes archives from its cache if they are there.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

HERE = Path(__file__).parents[1]
PAGE = HERE / "docs" / "install.md"
MARKS = ("<!-- make size -->\n", "<!-- end -->")
MEGABYTE = 2**20
LEAST_SHOWN_MB = 10.0
CHOSEN = ("geopandas", "shapely", "pyproj", "rtree", "fiona", "folium", "rapidfuzz")
INSTALLED = {
    "the seven": CHOSEN,
    "with numba and pyarrow": (*CHOSEN, "numba", "pyarrow"),
    "semsig_gis": (".",),
}
SIZES = """
import importlib.metadata, json
sizes = {}
for package in importlib.metadata.distributions():
    files = [package.locate_file(file) for file in package.files or ()]
    sizes[package.name] = sum(file.stat().st_size for file in files if file.is_file())
print(json.dumps(sizes))
"""
OF_PIP = {"pip", "setuptools"}


def main() -> None:
    """Install, print megabytes and seconds, and write the table."""
    sizes, seconds = {}, {}
    for name, packages in INSTALLED.items():
        sizes[name], seconds[name] = install(packages)
        print(f"{sum(sizes[name].values()):8.0f} MB  in {seconds[name]:.0f} s  {name}")
    ours = sizes["semsig_gis"]
    large = sorted((name for name in ours if ours[name] >= LEAST_SHOWN_MB), key=lambda n: -ours[n])
    rows = [[name, *(f"{part.get(name, 0):.0f}" for part in sizes.values())] for name in large]
    others = [sum(mb for name, mb in part.items() if name not in large) for part in sizes.values()]
    rows += [
        ["all others", *(f"{size:.0f}" for size in others)],
        ["MB in all", *(f"{sum(part.values()):.0f}" for part in sizes.values())],
        ["seconds", *(f"{value:.0f}" for value in seconds.values())],
    ]
    head = [["package", *INSTALLED], ["---", *("---:" for _ in INSTALLED)]]
    table = "".join(
        f"| {' | '.join('' if cell == '0' else cell for cell in row)} |\n" for row in head + rows
    )
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(MARKS[0])
    after = rest.partition(MARKS[1])[2]
    PAGE.write_text(f"{before}{MARKS[0]}\n{table}\n{MARKS[1]}{after}", encoding="utf-8")
    print(table, end="")


def install(packages: tuple[str, ...]) -> tuple[dict[str, float], float]:
    """Install packages into a new environment; return the MB of each, and the seconds."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        venv.create(folder, with_pip=True)
        python = str(Path(folder, "Scripts" if sys.platform == "win32" else "bin", "python"))
        pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, "-c", "constraints.txt", *packages], check=True, cwd=HERE)  # noqa: S603
        seconds = time.perf_counter() - start
        listed = subprocess.check_output([python, "-c", SIZES], cwd=folder)  # noqa: S603
    sizes = json.loads(listed)
    return {name: sizes[name] / MEGABYTE for name in sizes if name not in OF_PIP}, seconds


if __name__ == "__main__":
    main()
