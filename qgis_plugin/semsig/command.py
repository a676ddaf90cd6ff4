"""Find the `semsig` command and run it as a separate process.

QGIS has its own Python with its own GDAL and PROJ, which must not be mixed with the libraries of
`semsig`. Therefore the command runs in a process without the environment variables of QGIS.

This module does not import QGIS.
"""

from __future__ import annotations

import contextlib
import os
import queue
import re
import shutil
import signal
import subprocess  # nosec B404
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

__all__ = [
    "ENGINE",
    "SETTINGS",
    "Cancelled",
    "CommandError",
    "Watcher",
    "clean_environment",
    "find_command",
    "matching_folders",
    "run_command",
    "run_program",
]

# Prefixes of environment variables that belong to QGIS.
QGIS_PREFIXES = (
    "CPL_",
    "DYLD_",
    "GDAL_",
    "GISBASE",
    "GRASS_",
    "LD_",
    "OGR_",
    "OSGEO4W_",
    "PROJ_",
    "PYTHON",
    "QGIS_",
    "QT_",
    "__PYVENV_LAUNCHER__",
)
# Folders of installers; a program that was started from a desktop menu has a short PATH.
PLACES = (
    "~/semsig/bin",  # as in docs/qgis.md
    "~/semsig/Scripts",
    "~/.local/bin",
    "/usr/local/bin",
    "/opt/*/bin",
    "~/Library/Python/3.*/bin",
    "/Library/Frameworks/Python.framework/Versions/3.*/bin",
    "~/AppData/Roaming/Python/Python3*/Scripts",
    "~/AppData/Local/Programs/Python/Python3*/Scripts",
    "~/mini*3/bin",
    "~/anaconda3/bin",
)
SETTINGS = "Settings > Options > Processing > Providers > Semantic signatures"
"""The setting of QGIS with the path of the command."""

ENGINE = "Plugins > Semantic signatures > Engine..."
"""The menu of QGIS that installs the command."""

PROGRESS = re.compile(r"semsig progress (\d+)% (.*)")
SENTENCE = "semsig: "  # prefix of the sentences of the command
POLL_S = 0.1  # between two checks whether the user cancelled
PATIENCE_S = 20.0  # time for the command to clean up


class CommandError(Exception):
    """The command failed; the message is a sentence for the user."""


class Cancelled(Exception):  # noqa: N818 - not an error
    """The work was stopped on request."""


class Watcher(NamedTuple):
    """Callbacks of a running command."""

    progress: Callable[[int, str], None]
    """Called with the finished percentage and the name of the step."""
    remark: Callable[[str], None]
    """Called with every other line on standard error."""
    cancelled: Callable[[], bool]
    """Returns whether to end the work."""


def clean_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment for the command: without QGIS, with UTF-8 and progress as lines.

    Parameters
    ----------
    environment : mapping of str to str
        Environment variables of QGIS.

    Returns
    -------
    dict
        Environment variables of the command.
    """
    variables = {
        name: value
        for name, value in environment.items()
        if not name.upper().startswith(QGIS_PREFIXES)
    }
    return {**variables, "PYTHONUTF8": "1", "SEMSIG_SUPERVISED": "1"}


def find_command(
    setting: str, environment: Mapping[str, str], places: Sequence[str] = PLACES, *, own: str = ""
) -> str:
    """Return the path of the `semsig` command.

    Parameters
    ----------
    setting : str
        The command from the settings; empty if not set.
    environment : mapping of str to str
        Its ``PATH`` is searched first.
    places : sequence of str, optional
        Folders to search after that; may contain wildcards and begin with ``~``.
    own : str, optional
        The command that the plugin installed, which is used before the search.

    Returns
    -------
    str
        The path.

    Raises
    ------
    CommandError
        If it does not exist.
    """
    if setting:
        program = shutil.which(os.path.expanduser(setting))  # noqa: PTH111 - a Path adds nothing
        if program is None:
            message = (
                f"{setting} is not a program that can be run; choose the semsig command in "
                f"{SETTINGS}."
            )
            raise CommandError(message)
        return program
    if own:
        return own
    folders = [str(folder) for place in places for folder in matching_folders(place)]
    path = os.pathsep.join([environment.get("PATH", ""), *folders])
    program = shutil.which("semsig", path=path)
    if program is None:
        message = (
            "The semsig command was not found on this computer; install it with "
            f"{ENGINE}, or choose the command in {SETTINGS}."
        )
        raise CommandError(message)
    return program


def matching_folders(pattern: str) -> list[Path]:
    """Return the folders that match an absolute path with wildcards or ``~``, sorted.

    Parameters
    ----------
    pattern : str
        The path.

    Returns
    -------
    list of Path
        The folders; empty for a relative path, such as a path of another system.
    """
    path = Path(pattern).expanduser()
    if not path.is_absolute():
        return []
    return sorted(Path(path.anchor).glob(str(path.relative_to(path.anchor))))


def run_command(
    command: Sequence[str],
    environment: Mapping[str, str],
    watcher: Watcher,
    *,
    written: str | None = None,
) -> str:
    """Run the command and return its standard output, which contains its results.

    Parameters
    ----------
    command : sequence of str
        The program and its arguments.
    environment : mapping of str to str
        See `clean_environment`.
    watcher : Watcher
        Callbacks for progress, remarks and cancelling.
    written : str, optional
        A file that the command must write.

    Returns
    -------
    str
        The standard output.

    Raises
    ------
    CommandError
        If the command cannot be run or fails, with its last sentence as message; or if it is not
        `semsig`, since it prints no sentence of `semsig` or does not write the file.
    Cancelled
        If the watcher cancelled the work. The command has ended and cleaned up.
    """
    before = _state(written)
    try:
        process = _start(command, environment)
    except OSError as error:
        raise CommandError(_unusable(command[0], error)) from error
    # Two threads read the two streams, so that neither of them fills up and blocks the command.
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    results: list[str] = []
    readers = [
        threading.Thread(target=_queue_lines, args=(process.stderr, lines), daemon=True),
        threading.Thread(target=lambda: results.extend(process.stdout or ()), daemon=True),
    ]
    with process:
        for reader in readers:
            reader.start()
        try:
            last, is_semsig = _report_lines(lines, watcher)
            code = process.wait()
        except BaseException:  # also if a callback fails, the command must end
            _stop(process)
            raise
        finally:
            for reader in readers:
                reader.join(PATIENCE_S)
    if code != 0:
        raise CommandError(_reason(command[0], last, code, is_semsig=is_semsig))
    if last:
        watcher.remark(last.removeprefix(SENTENCE))
    if written is not None and _state(written) == before:
        raise CommandError(_not_semsig(command[0], f"it did not write {written}"))
    return "".join(results)


def run_program(
    command: Sequence[str],
    environment: Mapping[str, str],
    hear: Callable[[str], None],
    cancelled: Callable[[], bool],
) -> int:
    """Run any program and return its exit code.

    Parameters
    ----------
    command : sequence of str
        The program and its arguments.
    environment : mapping of str to str
        See `clean_environment`.
    hear : callable
        Called with each line that the program prints on either stream.
    cancelled : callable
        Returns whether to end the program; called ten times a second.

    Returns
    -------
    int
        The exit code.

    Raises
    ------
    CommandError
        If it cannot be run.
    Cancelled
        If `cancelled` returned True. The program has ended, with all processes that it started.
    """
    try:
        process = _start(command, environment, errors=subprocess.STDOUT)
    except OSError as error:
        raise CommandError(_unusable(command[0], error)) from error
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    reader = threading.Thread(target=_queue_lines, args=(process.stdout, lines), daemon=True)
    with process:
        reader.start()
        try:
            for line in _listen(lines, cancelled):
                hear(line)
            code = process.wait()
        except BaseException:
            _kill(process)
            raise
        finally:
            reader.join(PATIENCE_S)
    return code


def _state(path: str | None) -> tuple[int, int] | None:
    """Return inode and time of a file, which change if it is written again; None if missing."""
    try:
        status = os.stat(path or "")  # noqa: PTH116 - a Path adds nothing
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def _start(
    command: Sequence[str], environment: Mapping[str, str], errors: int = subprocess.PIPE
) -> subprocess.Popen[str]:
    # The program was installed or chosen by the user.
    return subprocess.Popen(  # noqa: S603  # nosec B603
        command,
        env=dict(environment),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        text=True,
        encoding="utf-8",
        errors="replace",
        # A separate session, so that all processes of the program can be ended together.
        start_new_session=True,
        # Without a console window on Windows.
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )


def _unusable(program: str, error: OSError) -> str:
    return f"{program} cannot be run ({error.strerror or error}); choose another program."


def _queue_lines(stream: Iterable[str] | None, lines: queue.SimpleQueue[str | None]) -> None:
    """Put the lines of a stream into a queue, and None at the end."""
    for line in stream or ():
        lines.put(line.rstrip())
    lines.put(None)


def _report_lines(lines: queue.SimpleQueue[str | None], watcher: Watcher) -> tuple[str, bool]:
    """Pass lines to the watcher; return the last remark and whether `semsig` printed them."""
    last, is_semsig = "", False
    for line in _listen(lines, watcher.cancelled):
        # Wait with each remark: the last one is the reason if the command fails.
        if last:
            watcher.remark(last.removeprefix(SENTENCE))
        progress = PROGRESS.fullmatch(line)
        if progress is not None:
            watcher.progress(int(progress[1]), progress[2])
        last = "" if progress else line
        is_semsig = is_semsig or progress is not None or line.startswith(SENTENCE)
    return last, is_semsig


def _listen(lines: queue.SimpleQueue[str | None], cancelled: Callable[[], bool]) -> Iterator[str]:
    """Yield the lines of a queue until None; raise Cancelled on request."""
    while not cancelled():
        try:
            line = lines.get(timeout=POLL_S)
        except queue.Empty:
            continue
        if line is None:
            return
        if line:
            yield line
    raise Cancelled


def _stop(process: subprocess.Popen[str]) -> None:
    """End the command by closing its input, which lets it clean up; kill it if it does not end."""
    process.stdin.close()  # type: ignore[union-attr] # it is a pipe
    try:
        process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        _kill(process)


def _kill(process: subprocess.Popen[str]) -> None:
    """Kill a program and all processes that it started."""
    if sys.platform == "win32":
        subprocess.run(  # noqa: S603  # nosec B603 B607
            ["taskkill", "/F", "/T", "/PID", str(process.pid)],  # noqa: S607 - of the system
            check=False,
            capture_output=True,
        )
        process.kill()
    else:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _reason(program: str, last: str, code: int, *, is_semsig: bool) -> str:
    """Return why the command failed, from its exit code and its last line."""
    if code == 2 and last.startswith(SENTENCE):  # noqa: PLR2004 - unusable input
        return last.removeprefix(SENTENCE)
    if is_semsig:
        why = f": {last.removeprefix(SENTENCE)}" if last else " and did not say why."
        return f"The semsig command failed with exit code {code}{why}"
    return _not_semsig(program, f"exit code {code}: {last}" if last else f"exit code {code}")


def _not_semsig(program: str, why: str) -> str:
    return (
        f"{program} is not the semsig command, or not one that fits this plugin ({why}); choose "
        f"the semsig command in {SETTINGS}."
    )
