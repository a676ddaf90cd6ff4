"""Parse, call, print: a module a command.

Results go to standard output, progress and remarks to standard error. The exit code is 0 when the
work is done, 2 when it cannot be done with this input or on this machine (with one plain sentence),
1 when the fault is ours, 130 after an interrupt and 141 when nobody reads the output any more.
Heavy modules are imported by the commands that need them, so that the help appears at once.
"""

from __future__ import annotations

import _thread
import atexit
import contextlib
import gc
import os
import platform
import signal
import sys
import tempfile
import threading
import time
import traceback
import warnings
from typing import TextIO

from semsig_gis import __version__
from semsig_gis.core import InputError, SemsigError

FAULT, UNUSABLE = 1, 2
# As a shell counts programs that SIGINT and SIGPIPE end.
INTERRUPTED, UNREAD = 130, 141
AGAIN_S = 0.05
LOADED = 300_000  # objects that are made before garbage is looked for: modules, mostly
LONGEST = 300  # characters of what an error says that nobody wrote for a user


def main() -> None:
    """Run the command, and end with its exit code; what goes wrong is told in one sentence."""
    said = ""
    _spare_what_is_loaded()
    passing = sys.unraisablehook
    sys.unraisablehook = _pass_over
    try:
        code = _run()
    except KeyboardInterrupt:
        code, said = INTERRUPTED, "interrupted"
    except BrokenPipeError:
        code = UNREAD
    except SemsigError as error:
        code, said = UNUSABLE, str(error)
    except MemoryError as error:
        code, said = UNUSABLE, _short_of_memory(error)
    except OSError as error:
        code, said = (UNUSABLE, _refusal(error)) if error.errno else (FAULT, _fault(error))
    except Exception as error:  # noqa: BLE001 - nothing passes the door
        code, said = FAULT, _fault(error)
    finally:
        sys.unraisablehook = passing
    if said:
        from semsig_gis.cli.console import complain

        with contextlib.suppress(OSError):
            complain(said)
    for stream in _streams():
        _settle(stream)
    if threading.current_thread() is threading.main_thread():
        # The work is done; an interrupt of what Python tidies up now would only show its lines.
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
        # Nor is what lives to the end looked through for garbage, time and again.
        atexit.register(gc.freeze)
    sys.exit(code)


def _spare_what_is_loaded() -> None:
    """Look for garbage later for once: what a short command loads stays to its end."""

    def go_on(*_: object) -> None:
        gc.set_threshold(*usual)
        gc.callbacks.remove(go_on)

    usual = gc.get_threshold()
    if usual[0] < LOADED:
        gc.callbacks.append(go_on)
        gc.set_threshold(LOADED, *usual[1:])


def _run() -> int:
    """Run the command and return its exit code."""
    for stream in _streams():
        with contextlib.suppress(AttributeError):  # one that another program has put there
            stream.reconfigure(errors="backslashreplace")  # type: ignore[attr-defined]
    _require_place()
    from semsig_gis.cli.console import stop_with_supervisor, supervised
    from semsig_gis.cli.run import run

    if supervised():
        stop_with_supervisor()
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        code = run()
    if sys.stdout is not None:
        sys.stdout.flush()
    return code


def _streams() -> list[TextIO]:
    return [stream for stream in (sys.stdout, sys.stderr) if stream is not None]


def _settle(stream: TextIO) -> None:
    """Write what is left; where that fails, give it up, or Python would try again and complain."""
    try:
        stream.flush()
    except OSError:
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _require_place() -> None:
    """Refuse a working folder that is gone, and names that cannot be told."""
    try:
        os.getcwd()  # noqa: PTH109 - only whether there is one
    except OSError as error:
        raise InputError(
            "the working folder no longer exists; change to another folder."
        ) from error
    for argument in sys.argv[1:]:
        try:
            argument.encode()
        except UnicodeEncodeError as error:
            raise InputError(f"{argument!r} is not valid UTF-8; rename the file.") from error
        if "\0" in argument:
            raise InputError(
                f"{argument!r} contains a null byte, which a file name cannot have; leave it out."
            )


def _pass_over(unraisable: sys.UnraisableHookArgs) -> None:
    """Tell of an error where Python cannot stop, as in a callback; let an interrupt come again."""
    if unraisable.exc_type is KeyboardInterrupt:
        passed = threading.Event()
        threading.Thread(target=_interrupt_again, args=(passed,), daemon=True).start()
        passed.set()  # here it would be passed over again
    elif isinstance(unraisable.exc_value, Exception):
        _remark(f"a library ignored an error ({_brief(unraisable.exc_value)})")


def _interrupt_again(passed: threading.Event) -> None:
    """Interrupt the main thread a moment after it has passed over an interrupt."""
    passed.wait()
    time.sleep(AGAIN_S)
    main_thread = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main_thread is not None:
        signal.pthread_kill(main_thread, signal.SIGINT)  # wakes what waits for the system, too
    else:
        _thread.interrupt_main()


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Show a warning as one sentence, without the line of code that it comes from."""
    _remark(str(message))


def _remark(text: str) -> None:
    from semsig_gis.cli.console import remark

    remark(text)


def _short_of_memory(error: MemoryError) -> str:
    return (
        f"this machine is short of memory ({_brief(error)}); close other programs, "
        "or process less at once."
    )


def _refusal(error: OSError) -> str:
    """Return what the system says of a file, or of the machine."""
    what = "this" if error.filename is None else repr(error.filename)
    return f"the system refuses {what} ({error.strerror}); give another file, or make room."


def _fault(error: Exception) -> str:
    """Write down a fault of ours, and return where."""
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="semsig-fault-", suffix=".log", delete=False, encoding="utf-8"
        ) as log:
            print(f"semsig {__version__}, Python {sys.version}", file=log)
            print(f"{platform.platform()}\n{sys.argv!r}\n", file=log)
            traceback.print_exception(error, file=log)
        proof = log.name
    except OSError:  # a full or read-only disk
        proof = "this line"
    return (
        f"a fault in semsig, not in your input ({_brief(error)}); please report it to the "
        f"authors of semsig_gis, with {proof}."
    )


def _brief(error: Exception) -> str:
    """Return the kind of an error and what it says, on one line."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return text.rstrip(".: ")[:LONGEST]
