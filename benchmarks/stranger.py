"""Run and time the commands of the README as a new user would: ``make stranger``.

The machine is as bare as possible: a new clone, an empty home folder without caches, no
environment. The commands are in the code blocks of the README, from its top to the first map of a
real city; the extract of OpenStreetMap to download is taken from `SEMSIG_GEODATA`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
EXTRACT = Path("osm", "monaco_2022.osm.pbf")
BLOCK = re.compile(r"^```\w*\n(.*?)^```", re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"^(?:\$ )?((?:\.|make|pip|semsig) .*)", re.MULTILINE)
LAST = "semsig map "
BARE = ("HOME", "NPM_CONFIG_CACHE", "PIP_CACHE_DIR", "PYTHON", "SEMSIG_", "VIRTUAL_ENV", "XDG_")
"""Prefixes of environment variables that are removed."""


def main() -> None:
    """Run the commands, and print and write their times."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stranger", description=__doc__)
    parser.add_argument("--repository", default=str(ROOT), help="what is cloned; this checkout")
    parser.add_argument(
        "--out", type=Path, default=Path(__file__).with_name("stranger.json"), metavar="FILE"
    )
    options = parser.parse_args()
    data = os.environ.get("SEMSIG_GEODATA")
    if not data or not (Path(data) / EXTRACT).is_file():
        sys.exit(f"Set SEMSIG_GEODATA to the folder that holds {EXTRACT}.")
    with tempfile.TemporaryDirectory(prefix="stranger-") as folder:
        steps = walk(Path(folder), options.repository, Path(data) / EXTRACT)
    rows = [{"command": command, "seconds": round(seconds, 1)} for command, seconds in steps]
    options.out.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    total = sum(seconds for _, seconds in steps)
    print(f"{len(steps)} commands, {total:.0f} s; wrote {options.out}")


def commands(readme: str) -> list[str]:
    """Return the commands of a README up to the first map, without ``make test``."""
    lines: list[str] = []
    for block in BLOCK.findall(readme):
        for command in COMMAND.findall(block):
            plain = shlex.join(shlex.split(command, comments=True))
            if plain != "make test":
                lines.append(plain)
            if plain.startswith(LAST):
                return lines
    sys.exit(f"The README has no command that starts with {LAST!r}.")


def walk(folder: Path, repository: str, extract: Path) -> list[tuple[str, float]]:
    """Run the commands in a new clone and return each with its seconds.

    The commands run in one shell, as a user's do, and must write the map.
    """
    home, temporary, clone = (folder / name for name in ("home", "tmp", "semsig_gis"))
    home.mkdir()
    temporary.mkdir()
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(BARE)}
    environment = {**inherited, "HOME": str(home), "TMPDIR": str(temporary)}
    # The path of the checkout must not appear in the results.
    environment["REPOSITORY"] = repository
    steps = run([f'git clone --quiet "$REPOSITORY" {clone.name}'], folder, environment)
    rest = commands((clone / "README.md").read_text(encoding="utf-8"))
    words = [word for command in rest for word in shlex.split(command)]
    for name in {word for word in words if word.endswith(".osm.pbf")}:
        shutil.copyfile(extract, clone / name)
    steps += run(rest, clone, environment)
    last = shlex.split(rest[-1])
    page = clone / last[last.index("--out") + 1]
    print(f"{page.name}: {page.stat().st_size:,} bytes")
    return steps


def run(lines: list[str], folder: Path, environment: dict[str, str]) -> list[tuple[str, float]]:
    """Run commands in one shell, which writes the time after each, and stop at a failure."""
    clock = 'echo "$EPOCHREALTIME" >&3'
    script = "\n".join(["set -e", "exec 3>times", clock, *(f"{line}\n{clock}" for line in lines)])
    subprocess.run(["bash", "-c", script], cwd=folder, env=environment, check=True)  # noqa: S603, S607 - commands of the README
    times = [float(line) for line in (folder / "times").read_text(encoding="utf-8").split()]
    seconds = [end - start for start, end in itertools.pairwise(times)]
    steps = list(zip(lines, seconds, strict=True))
    for line, duration in steps:
        print(f"{duration:8.1f} s  {line}", flush=True)
    return steps


if __name__ == "__main__":
    main()
