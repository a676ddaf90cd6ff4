"""The command as a part of another program, such as the QGIS plugin.

That program sets the environment variable SEMSIG_SUPERVISED and keeps the standard input of the
command open. Progress then comes as lines on standard error, and the end of the standard input
stops the command as Ctrl+C does, so that it cleans up. That works on every system, and also when
the other program crashes.
"""

from __future__ import annotations

import os
import signal
import sys
import threading

__all__ = ["progress_line", "stop_with_supervisor", "supervised"]

VARIABLE = "SEMSIG_SUPERVISED"


def supervised() -> bool:
    """Tell whether another program watches this one."""
    return bool(os.environ.get(VARIABLE))


def progress_line(label: str, percent: int) -> str:
    """Return what a supervisor reads of the progress: ``semsig progress 40% building``."""
    return f"semsig progress {percent}% {label}"


def stop_with_supervisor() -> None:
    """From now on, be interrupted when the standard input ends."""
    # A program that was itself started in the background hands on that interrupts be ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # A copy, with nothing in the place of the original: on Windows, a library that asks for the
    # kind of the standard input while it is loaded would wait for the read to end.
    watched, nothing = os.dup(0), os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    threading.Thread(target=_interrupt_at_end_of, args=(watched,), daemon=True).start()


def _interrupt_at_end_of(watched: int) -> None:
    # Not a file object, whose lock would be held when the interpreter ends.
    while os.read(watched, 1):
        pass
    if sys.platform == "win32":
        signal.raise_signal(signal.SIGINT)
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
