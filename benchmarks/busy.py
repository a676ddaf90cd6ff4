"""Run a command on a busy machine: ``python -m benchmarks.busy make test``.

Six processes compute beside it until it ends. What passes on an idle machine must pass here, too.
"""

from __future__ import annotations

import subprocess
import sys

BUSY = 6
# Each ends with whoever started it, even if that is killed.
_COMPUTE = "import os\nparent = os.getppid()\nwhile os.getppid() == parent: pass"


def main() -> None:
    """Start them, run the command, and end them; the exit code is the command's."""
    beside = [subprocess.Popen([sys.executable, "-c", _COMPUTE]) for _ in range(BUSY)]  # noqa: S603 - our own text
    try:
        code = subprocess.run(sys.argv[1:], check=False).returncode  # noqa: S603 - what the user types
    finally:
        for one in beside:
            one.kill()
            one.wait()
    sys.exit(code)


if __name__ == "__main__":
    main()
