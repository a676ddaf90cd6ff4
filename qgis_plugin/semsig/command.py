"""The `semsig` command as a process of its own: where it is, how it is run, what it tells.

QGIS has its own Python with its own GDAL and PROJ, which must not meet those of `semsig`. Hence a
process, in an environment from which everything of QGIS is taken out.

Nothing here imports QGIS.
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
    "run_command",
    "run_program",
]

# What belongs to QGIS, by how the names of variables begin.
FOREIGN = (
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
# Where installers put commands; a program that was started from a desktop menu has a short PATH.
PLACES = (
    "~/semsig/bin",  # where docs/qgis.md has it
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
"""Where in QGIS the command is chosen."""

ENGINE = "Plugins > Semantic signatures > Engine..."
"""Where in QGIS the command is installed."""

PROGRESS = re.compile(r"semsig progress (\d+)% (.*)")
# How its sentences begin.
SENTENCE = "semsig: "
# How often a cancel is looked for, and how long the command may take to clean up.
BLINK_S = 0.1
PATIENCE_S = 20.0


class CommandError(Exception):
    """The command could not do it; the message is a sentence for people."""


class Cancelled(Exception):  # noqa: N818 - nothing went wrong
    """The work was stopped on request."""


class Watcher(NamedTuple):
    """What hears from a running command, and may stop it."""

    progress: Callable[[int, str], None]
    """Called with the percent that is done, and of what."""
    remark: Callable[[str], None]
    """Called with every other line that the command says beside its results."""
    cancelled: Callable[[], bool]
    """Tells whether the work shall end."""


def clean_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment for the command: nothing of QGIS, texts in UTF-8, progress as lines.

    Parameters
    ----------
    environment : mapping of str to str
        That of QGIS.

    Returns
    -------
    dict
        That of the command.
    """
    kept = {
        name: value for name, value in environment.items() if not name.upper().startswith(FOREIGN)
    }
    return {**kept, "PYTHONUTF8": "1", "SEMSIG_SUPERVISED": "1"}


def find_command(
    chosen: str, environment: Mapping[str, str], places: Sequence[str] = PLACES, *, own: str = ""
) -> str:
    """Return the path of the `semsig` command.

    Parameters
    ----------
    chosen : str
        What the settings say; empty where nothing was chosen.
    environment : mapping of str to str
        Its ``PATH`` is searched first.
    places : sequence of str, optional
        Folders to look in after that; may have wildcards and begin with ``~``.
    own : str, optional
        The command that the plugin installed, which comes before the search.

    Returns
    -------
    str
        The path.

    Raises
    ------
    CommandError
        If it is not there.
    """
    if chosen:
        found = shutil.which(os.path.expanduser(chosen))  # noqa: PTH111 - a Path adds nothing
        if found is None:
            message = (
                f"{chosen} is not a program that can be run; choose the semsig command in "
                f"{SETTINGS}."
            )
            raise CommandError(message)
        return found
    if own:
        return own
    folders = [str(folder) for place in places for folder in _folders(place)]
    path = os.pathsep.join([environment.get("PATH", ""), *folders])
    found = shutil.which("semsig", path=path)
    if found is None:
        message = (
            "The semsig command is not on this computer, or not where it is looked for; install "
            f"it with {ENGINE}, or choose the command in {SETTINGS}."
        )
        raise CommandError(message)
    return found


def _folders(place: str) -> Iterator[Path]:
    """Yield the folders that a place stands for."""
    path = Path(place).expanduser()
    root = Path(path.anchor)
    return root.glob(str(path.relative_to(root)))


def run_command(
    command: Sequence[str],
    environment: Mapping[str, str],
    watcher: Watcher,
    *,
    written: str | None = None,
) -> str:
    """Run the command and return its results, which it prints on standard output.

    Parameters
    ----------
    command : sequence of str
        The program and its arguments.
    environment : mapping of str to str
        See `clean_environment`.
    watcher : Watcher
        Who hears of it.
    written : str, optional
        A file that the command writes.

    Returns
    -------
    str
        The standard output.

    Raises
    ------
    CommandError
        If the command cannot be run or fails, where the message is what it says last; or if it
        is not `semsig`, since it fails without a word of that or leaves the file as it was.
    Cancelled
        If the watcher wished so. The command has ended and cleaned up.
    """
    before = _state(written)
    try:
        process = _start(command, environment)
    except OSError as error:
        raise CommandError(_unusable(command[0], error)) from error
    said: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    results: list[str] = []
    readers = [
        threading.Thread(target=_hand_on, args=(process.stderr, said), daemon=True),
        threading.Thread(target=_collect, args=(process, results), daemon=True),
    ]
    with process:
        for reader in readers:
            reader.start()
        try:
            last, known = _hand_out(said, watcher)
            code = process.wait()
        except BaseException:  # whoever ends the watching, ends the command
            _stop(process)
            raise
        finally:
            for reader in readers:
                reader.join(PATIENCE_S)
    if code != 0:
        raise CommandError(_reason(command[0], last, code, known=known))
    if last:
        watcher.remark(last.removeprefix(SENTENCE))
    if written is not None and _state(written) == before:
        raise CommandError(_foreign(command[0], f"it did not write {written}"))
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
        Takes each line that the program prints, be it a result or an error.
    cancelled : callable
        Tells whether the program shall end; asked ten times a second.

    Returns
    -------
    int
        The exit code.

    Raises
    ------
    CommandError
        If it cannot be run.
    Cancelled
        If that was wished. The program has ended, with all that it started.
    """
    try:
        process = _start(command, environment, errors=subprocess.STDOUT)
    except OSError as error:
        raise CommandError(_unusable(command[0], error)) from error
    said: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    reader = threading.Thread(target=_hand_on, args=(process.stdout, said), daemon=True)
    with process:
        reader.start()
        try:
            for line in _listen(said, cancelled):
                hear(line)
            code = process.wait()
        except BaseException:
            _kill(process)
            raise
        finally:
            reader.join(PATIENCE_S)
    return code


def _state(path: str | None) -> tuple[int, int] | None:
    """Return what differs once a file is written anew."""
    try:
        found = os.stat(path or "")  # noqa: PTH116 - a Path adds nothing
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns


def _start(
    command: Sequence[str], environment: Mapping[str, str], errors: int = subprocess.PIPE
) -> subprocess.Popen[str]:
    # The program is what the user installed or chose.
    return subprocess.Popen(  # noqa: S603  # nosec B603
        command,
        env=dict(environment),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        text=True,
        encoding="utf-8",
        errors="replace",
        # A session of its own, so that it can be ended with all that it started.
        start_new_session=True,
        # No console window pops up on Windows.
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )


def _unusable(program: str, error: OSError) -> str:
    return f"{program} cannot be run ({error.strerror or error}); choose another program."


def _hand_on(lines: Iterable[str] | None, said: queue.SimpleQueue[str | None]) -> None:
    for line in lines or ():
        said.put(line.rstrip())
    said.put(None)


def _collect(process: subprocess.Popen[str], results: list[str]) -> None:
    results.extend(process.stdout or ())


def _hand_out(said: queue.SimpleQueue[str | None], watcher: Watcher) -> tuple[str, bool]:
    """Tell what is said, and return the last remark and whether it was `semsig` that spoke."""
    last, known = "", False
    for line in _listen(said, watcher.cancelled):
        # The last remark is held back: it says why the command fails, if it does.
        if last:
            watcher.remark(last.removeprefix(SENTENCE))
        told = PROGRESS.fullmatch(line)
        if told is not None:
            watcher.progress(int(told[1]), told[2])
        last = "" if told else line
        known = known or told is not None or line.startswith(SENTENCE)
    return last, known


def _listen(said: queue.SimpleQueue[str | None], cancelled: Callable[[], bool]) -> Iterator[str]:
    """Yield the lines until the command has no more to say."""
    while not cancelled():
        try:
            line = said.get(timeout=BLINK_S)
        except queue.Empty:
            continue
        if line is None:
            return
        if line:
            yield line
    raise Cancelled


def _stop(process: subprocess.Popen[str]) -> None:
    """End the command: by the end of its input, which lets it clean up, or in the end by force."""
    process.stdin.close()  # type: ignore[union-attr] # it is a pipe
    try:
        process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        _kill(process)


def _kill(process: subprocess.Popen[str]) -> None:
    """End a program with all that it started, by force."""
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


def _reason(program: str, last: str, code: int, *, known: bool) -> str:
    """Return why the command failed: its last words, which are a sentence where it is the input."""
    if code == 2 and last.startswith(SENTENCE):  # noqa: PLR2004 - unusable input
        return last.removeprefix(SENTENCE)
    if known:
        why = f": {last.removeprefix(SENTENCE)}" if last else " and did not say why."
        return f"The semsig command failed with exit code {code}{why}"
    return _foreign(program, f"exit code {code}: {last}" if last else f"exit code {code}")


def _foreign(program: str, why: str) -> str:
    return (
        f"{program} is not the semsig command, or not one that fits this plugin ({why}); choose "
        f"the semsig command in {SETTINGS}."
    )
