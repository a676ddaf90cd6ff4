"""What the plain installation takes: ``python -m benchmarks.installed``, with nothing but Python.

A fresh environment is made, the checkout is installed there with the versions of
``constraints.txt``, and the packages are listed by the room that they take with their compiled
modules. Archives that pip has fetched before come from its cache.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

HERE = Path(__file__).parents[1]
MEGABYTE = 2**20
LEAST_SHOWN_MB = 10.0
OF_PIP = ("pip", "setuptools", "pkg_resources", "_distutils_hack")


def main() -> None:
    """Install, and print megabytes and seconds."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        venv.create(folder, with_pip=True)
        python = Path(folder, "Scripts" if sys.platform == "win32" else "bin", "python")
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, "-c", "constraints.txt", "."], check=True, cwd=HERE)  # noqa: S603
        seconds = time.perf_counter() - start
        (packages,) = Path(folder).rglob("site-packages")
        sizes: dict[str, float] = {}
        for file in packages.rglob("*"):
            top = file.relative_to(packages).parts[0].removesuffix(".libs")
            if file.is_file() and not top.startswith(OF_PIP):
                sizes[top] = sizes.get(top, 0.0) + file.stat().st_size / MEGABYTE
    for name, size in sorted(sizes.items(), key=lambda item: -item[1]):
        if size >= LEAST_SHOWN_MB:
            print(f"{size:8.0f} MB  {name}")
    print(f"{sum(sizes.values()):8.0f} MB  in all, in {seconds:.0f} s")


if __name__ == "__main__":
    main()
