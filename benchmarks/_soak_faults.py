"""Kill commands, fill their disks or run several at once, and check the files afterwards."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import json
import os
import random
import signal
import subprocess
import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks._soak_city import digests, files_in
from benchmarks._soak_runs import LIMIT_S, Ending, Stop, forked, run

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from benchmarks._soak_city import Command, World

# Number of trials of each part, per kill.
PARTS = {
    "kills": 1.0,
    "Ctrl-C": 0.15,
    "full disks": 0.15,
    "read-only disks": 0.05,
    "closed pipes": 0.05,
    "odd environments": 0.05,
    "eight processes": 0.01,
}
_PROCESSES = 8
_PIPE = 128 + signal.SIGPIPE  # the exit code of `yes | head`, for its first part
_START = "from benchmarks._soak_runs import main; main()"
_ENVIRONMENTS: tuple[dict[str, str | None], ...] = (
    {"HOME": None},
    {"HOME": "/nowhere", "XDG_CACHE_HOME": None},
    {"TMPDIR": "/nowhere"},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"PYTHONIOENCODING": "ascii"},
    {"LC_ALL": "tr_TR.UTF-8", "LANG": "tr_TR.UTF-8"},
    {"COLUMNS": "20", "TERM": "dumb"},
    {"PYTHONHASHSEED": "1", "TZ": "Pacific/Kiritimati"},
    {"PYTHONOPTIMIZE": "2"},
    {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "ARROW_NUM_THREADS": "1"},
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One trial; `moment` is the share of the time, of the changes or of the free space."""

    part: str
    number: int
    moment: float


def cases(kills: int, *, seed: int) -> Iterator[Case]:
    """Yield the given number of kills, and other trials in proportion."""
    generator = random.Random(seed)  # noqa: S311 - no secrets
    parts = [part for part, share in PARTS.items() for _ in range(max(1, round(kills * share)))]
    for number, part in enumerate(parts):
        yield Case(part=part, number=number, moment=generator.random())


def faults(world: World, case: Case, folder: Path) -> list[str]:
    """Run a trial and return its faults, each as ``kind: details``."""
    command = world.command(case.number)
    place = folder / "city"
    if case.part.endswith("disks"):
        _mount_own(folder)
    if case.part == "eight processes":
        command = next(item for item in world.commands if "cold" in item.text)
    world.copy(command, place)
    if case.part == "odd environments":
        environment = _ENVIRONMENTS[case.number % len(_ENVIRONMENTS)]
        return _after(world, command, place, [_started(command.text, place, environment)])
    if case.part == "eight processes":
        return _after(world, command, place, _together(command.text, place))
    if case.part == "full disks":
        sizes = (state[1] for name, state in files_in(world.folder).items() if name in command.new)
        _resize(folder, room=int(case.moment * sum(sizes)))
    elif case.part == "read-only disks":
        _remount(folder, _READ_ONLY, "")
    pipe = case.part == "closed pipes"
    ending = run(command.text, place, stop=_stop(case, command), pipe=pipe)
    if pipe and ending.code == _PIPE:
        ending = dataclasses.replace(ending, code=0)
    if case.part.endswith("disks"):
        _remount(folder, 0, f"size={_LARGEST}")
    return _after(world, command, place, [ending], killed=case.part == "kills")


def _stop(case: Case, command: Command) -> Stop | None:
    if case.part == "Ctrl-C":
        return Stop(after_s=case.moment * command.ending.seconds, signal=signal.SIGINT)
    if case.part != "kills":
        return None
    if case.number // 7 % 2:
        return Stop(after_s=case.moment * command.ending.seconds)
    return Stop(change=1 + int(case.moment * len(command.ending.changes)))


def _after(
    world: World, command: Command, place: Path, endings: list[Ending], *, killed: bool = False
) -> list[str]:
    """Return the faults after a trial, and after another run of the command."""
    faults = [
        f"{ending.fault}: {ending.code} {ending.err[-2000:]}"
        for ending in endings
        if ending.fault and not (killed and ending.code == -signal.SIGKILL)
    ]
    # A run that was not killed leaves only files with which the next run continues.
    leftovers = [] if killed else _leftovers(world, place)
    faults += [f"leftovers: {name}" for name in leftovers if _top(name) not in command.names]
    faults += [f"lost or half-written: {name}" for name in _broken(command, place)]
    again = run(command.text, place)
    if again.code or again.fault:
        faults.append(f"next run: {again.code} {again.err[-2000:]}")
    elif (state := digests(place, command.names)) != command.new:
        wrong = [
            name for name in {**state, **command.new} if state.get(name) != command.new.get(name)
        ]
        faults.append(f"next run: other results: {' '.join(wrong)}")
    again_left = [f"leftovers: {name}" for name in _leftovers(world, place)]
    return faults + [fault for fault in again_left if fault not in faults]


def _leftovers(world: World, place: Path) -> list[str]:
    """Return the files of a command that are not results, also in the temporary folder."""
    names = sorted(files_in(place).keys() - files_in(world.folder).keys())
    return names + [f"TMPDIR/{name}" for name in files_in(Path(f"{place}.tmp"))]


def _top(name: str) -> str:
    """Return the first part of a path; for an unfinished run, the name of its result."""
    return Path(name).parts[0].removesuffix(".partial")


def _broken(command: Command, place: Path) -> list[str]:
    """Return results that are neither old nor new; an interrupted replacement is undone first."""
    wrong = _neither(command, place)
    for name in wrong:
        if (place / f"{name}.parquet").exists():
            run(f"info {name}.parquet --json", place)
    return _neither(command, place) if wrong else []


def _neither(command: Command, place: Path) -> list[str]:
    states: dict[str, list[dict[str, str]]] = defaultdict(lambda: [{}, {}, {}])
    for which, files in enumerate((command.old, command.new, digests(place, command.names))):
        for name, digest in files.items():
            top = Path(name).parts[0]
            states[top.removesuffix(".parquet").removesuffix(".objects")][which][name] = digest
    wrong = []
    for name, (old, new, now) in states.items():
        # A run that can be continued has whole new files.
        begun = not old and all(new[file] == digest for file, digest in now.items() if file in new)
        if now not in (old, new) and not begun:
            wrong.append(name)
    return wrong


def _started(command: str, folder: Path, environment: Mapping[str, str | None]) -> Ending:
    """Run a command in a new Python, because some variables are read only at its start."""
    own = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1]), **environment}
    run = subprocess.run(  # noqa: S603 - a command of the table
        [sys.executable, "-c", _START, *command.split()],
        cwd=folder,
        env={name: value for name, value in own.items() if value is not None},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
        timeout=LIMIT_S,
    )
    out, err = (text.decode(errors="backslashreplace") for text in (run.stdout, run.stderr))
    Path(f"{folder}.tmp").mkdir(exist_ok=True)
    return Ending(run.returncode, out, err, (), 0.0)


def _together(command: str, folder: Path) -> list[Ending]:
    """Run a command in several processes at once."""
    children = []
    for number in range(_PROCESSES):
        child = os.fork()
        if child == 0:
            with contextlib.suppress(BaseException):
                ending = dataclasses.asdict(run(command, folder))
                Path(f"{folder}.ending{number}").write_text(json.dumps(ending), encoding="utf-8")
            os._exit(0)
        children.append(child)
    for child in children:
        os.waitpid(child, 0)
    texts = [Path(f"{folder}.ending{number}").read_text() for number in range(_PROCESSES)]
    return [Ending(**json.loads(text)) for text in texts]


# --- Disks ------------------------------------------------------------------------------------

_NEW_MOUNTS, _NEW_USER = 0x00020000, 0x10000000
_READ_ONLY, _REMOUNT, _PRIVATE, _RECURSIVE = 1, 32, 1 << 18, 1 << 14
_LARGEST = 256 * 2**20  # bytes


def disks_possible(folder: Path) -> bool:
    """Whether the soak can mount disks on this machine."""
    try:
        forked(lambda: _mount_own(folder))
    except RuntimeError:
        return False
    return True


def _mount_own(folder: Path) -> None:
    """Mount an empty disk on a folder, visible only to this process and its children."""
    user, group = os.getuid(), os.getgid()
    _call("unshare", ctypes.c_int(_NEW_MOUNTS if user == 0 else _NEW_MOUNTS | _NEW_USER))
    if user:
        Path("/proc/self/setgroups").write_text("deny", encoding="ascii")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1", encoding="ascii")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1", encoding="ascii")
    _mount(b"none", Path("/"), None, _RECURSIVE | _PRIVATE, None)
    _mount(b"soak", folder, b"tmpfs", 0, f"size={_LARGEST}".encode())


def _remount(folder: Path, flags: int, options: str) -> None:
    _mount(b"soak", folder, b"tmpfs", _REMOUNT | flags, options.encode())


def _resize(folder: Path, *, room: int) -> None:
    """Change the size of a disk so that `room` bytes are free."""
    disk = os.statvfs(folder)
    used = (disk.f_blocks - disk.f_bfree) * disk.f_frsize
    _remount(folder, 0, f"size={used + room}")


def _mount(
    source: bytes, folder: Path, kind: bytes | None, flags: int, options: bytes | None
) -> None:
    _call("mount", source, bytes(folder), kind, ctypes.c_ulong(flags), options)


def _call(name: str, *arguments: object) -> None:
    if getattr(ctypes.CDLL(None, use_errno=True), name)(*arguments):
        number = ctypes.get_errno()
        raise OSError(number, f"{name}: {os.strerror(number)}")
