"""Run a command on a busy machine: ``python -m benchmarks.busy make test``.

Six other processes compute until it ends. Tests that pass on an idle machine must pass here, too.
"""

from __future__ import annotations

import subprocess
import sys

BUSY = 6
# Each ends when its parent ends, even if the parent is killed.
_COMPUTE = "import os\nparent = os.getppid()\nwhile os.getppid() == parent: pass"


def main() -> None:
    """Run the command while the processes compute; exit with its exit code."""
    busy = [subprocess.Popen([sys.executable, "-c", _COMPUTE]) for _ in range(BUSY)]  # noqa: S603 - our own text
    try:
        code = subprocess.run(sys.argv[1:], check=False).returncode  # noqa: S603 - what the user types
    finally:
        for process in busy:
            process.kill()
            process.wait()
    sys.exit(code)


if __name__ == "__main__":
    main()
