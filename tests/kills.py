"""Run commands that are killed just before their n-th change to files.

A server process has imported all modules and forks a child for each command, so that one run takes
a tenth of a second. Only changes by Python code are counted: libraries write into temporary files
that Python code creates before and renames afterwards.
"""

from __future__ import annotations

import atexit
import dataclasses
import functools
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from benchmarks._soak_runs import Ending

ROOT = Path(__file__).parents[1]


def killed_at(
    number: int, command: str, *, cwd: Path, env: Mapping[str, str] | None = None
) -> Ending:
    """Run a command that is killed just before a change to files, numbered from 1.

    With 0, or if there are fewer changes, it runs to its end. `command` contains the arguments of
    ``semsig``; `env` is added to the environment.
    """
    from benchmarks._soak_runs import Ending

    server = _server()
    assert server.stdin is not None
    assert server.stdout is not None
    order = {"number": number, "command": command, "cwd": str(cwd), "env": dict(env or {})}
    server.stdin.write(json.dumps(order) + "\n")
    server.stdin.flush()
    answer = json.loads(server.stdout.readline())
    return Ending(**{**answer, "changes": tuple(answer["changes"])})


@functools.cache
def _server() -> subprocess.Popen[str]:
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    server = subprocess.Popen(
        [sys.executable, "-B", __file__],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    atexit.register(_stop, server)
    return server


def _stop(server: subprocess.Popen[str]) -> None:
    with server:  # closes its pipes and waits for it
        server.kill()


def _serve() -> None:
    """Run each command from the standard input, and print how it ended."""
    from benchmarks._soak_runs import Stop, load_all, run

    load_all()
    for line in sys.stdin:
        order = json.loads(line)
        stop = Stop(change=order["number"]) if order["number"] else None
        ending = run(order["command"], Path(order["cwd"]), environment=order["env"], stop=stop)
        sys.stdout.write(json.dumps(dataclasses.asdict(ending)) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    _serve()
