"""The `semsig` command: parse the arguments of a command, run it and print its result.

Results go to standard output, progress and remarks to standard error. Exit codes: 0 for success,
2 for input or a machine that cannot be used (with one plain sentence), 1 for a bug of this
package, 130 after an interrupt, 141 when the reader of the output has closed it. Slow modules are
imported inside the commands that need them, so that the help appears at once.
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
# As shells report programs that were ended by SIGINT and SIGPIPE.
INTERRUPTED, OUTPUT_CLOSED = 130, 141
INTERRUPT_DELAY_S = 0.05
FIRST_COLLECTION = 300_000  # new objects before the first garbage collection; usually 700
LONGEST_MESSAGE = 300  # characters of an unexpected error's message


def main() -> None:
    """Run the command and exit with its code; print one sentence if it fails."""
    message = ""
    # Arrow's own pool keeps 50 MB of what it read to the end.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    _delay_garbage_collection()
    previous_hook = sys.unraisablehook
    sys.unraisablehook = _report_unraisable
    try:
        code = _run()
    except KeyboardInterrupt:
        code, message = INTERRUPTED, "interrupted"
    except BrokenPipeError:
        code = OUTPUT_CLOSED
    except SemsigError as error:
        code, message = UNUSABLE, str(error)
    except MemoryError as error:
        code = UNUSABLE
        message = (
            f"this machine is short of memory ({_brief(error)}); close other programs, or process "
            "less at once."
        )
    except OSError as error:
        code, message = (UNUSABLE, _system_error(error)) if error.errno else (FAULT, _fault(error))
    except Exception as error:  # noqa: BLE001 - the outermost handler
        code, message = FAULT, _fault(error)
    finally:
        sys.unraisablehook = previous_hook
    if message:
        from semsig_gis.cli.console import complain

        with contextlib.suppress(OSError):
            complain(message)
    for stream in _streams():
        _flush_or_discard(stream)
    if threading.current_thread() is threading.main_thread():
        # The work is done; an interrupt during Python's clean-up would only print a traceback.
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
        # No garbage collection at exit, which saves 0.28 s of `semsig localize` in a small city.
        atexit.register(gc.freeze)
    sys.exit(code)


def _delay_garbage_collection() -> None:
    """Delay the first garbage collection, and leave out of others what exists after it.

    Imported modules stay to the end. It saves 0.12 s of 1.1 s of a `semsig localize` in a small
    city, and 0.6 s of 4 s of a `semsig build`.
    """

    def restore(phase: str, _: object) -> None:
        if phase == "stop":
            gc.set_threshold(*usual)
            gc.callbacks.remove(restore)
            gc.freeze()

    usual = gc.get_threshold()
    if usual[0] < FIRST_COLLECTION:
        gc.callbacks.append(restore)
        gc.set_threshold(FIRST_COLLECTION, *usual[1:])


def _run() -> int:
    """Run the command and return its exit code."""
    for stream in _streams():
        with contextlib.suppress(AttributeError):  # a stream replaced by another program
            stream.reconfigure(errors="backslashreplace")  # type: ignore[attr-defined]
    _check_surroundings()
    from semsig_gis.cli.app import run
    from semsig_gis.cli.console import stop_with_supervisor, supervised

    if supervised():
        stop_with_supervisor()
    with warnings.catch_warnings():
        # One sentence, without its line of code.
        warnings.showwarning = lambda message, category, *_, **__: _warn(str(message), category)
        code = run()
    if sys.stdout is not None:
        sys.stdout.flush()
    return code


def _streams() -> list[TextIO]:
    """Return the standard output and standard error that exist."""
    return [stream for stream in (sys.stdout, sys.stderr) if stream is not None]


def _flush_or_discard(stream: TextIO) -> None:
    """Flush a stream; if that fails, discard the rest, or Python would fail again at exit."""
    try:
        stream.flush()
    except OSError:
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _check_surroundings() -> None:
    """Raise InputError if the working folder is gone or an argument cannot be a file name."""
    try:
        os.getcwd()  # noqa: PTH109 - only to see if it exists
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


def _report_unraisable(unraisable: sys.UnraisableHookArgs) -> None:
    """Report an error that Python cannot raise, as in a callback; repeat an interrupt later."""
    if unraisable.exc_type is KeyboardInterrupt:
        hook_ended = threading.Event()
        threading.Thread(target=_interrupt_again, args=(hook_ended,), daemon=True).start()
        hook_ended.set()  # an interrupt before this line would be ignored as well
    elif isinstance(unraisable.exc_value, Exception):
        _remark(f"a library ignored an error ({_brief(unraisable.exc_value)})")


def _interrupt_again(hook_ended: threading.Event) -> None:
    """Send the main thread another interrupt, because Python ignored the first in a callback."""
    hook_ended.wait()
    time.sleep(INTERRUPT_DELAY_S)
    main_thread = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main_thread is not None:
        signal.pthread_kill(main_thread, signal.SIGINT)  # also ends system calls that wait
    else:
        _thread.interrupt_main()


def _remark(text: str) -> None:
    from semsig_gis.cli.console import remark

    remark(text)


def _warn(text: str, category: type[Warning]) -> None:
    from semsig_gis.cli import console
    from semsig_gis.core import LongWorkWarning

    if issubclass(category, LongWorkWarning):
        console.duration_said.set()
    console.remark(text)


def _system_error(error: OSError) -> str:
    """Return a sentence for an error of the operating system."""
    what = "this" if error.filename is None else repr(error.filename)
    return f"the system refuses {what} ({error.strerror}); give another file, or make room."


def _fault(error: Exception) -> str:
    """Write a bug of this package to a log file and return a sentence with its path."""
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="semsig-fault-", suffix=".log", delete=False, encoding="utf-8"
        ) as log:
            print(f"semsig {__version__}, Python {sys.version}", file=log)
            print(f"{platform.platform()}\n{sys.argv!r}\n", file=log)
            traceback.print_exception(error, file=log)
        report = log.name
    except OSError:  # a full or read-only disk
        report = "this line"
    return (
        f"a fault in semsig, not in your input ({_brief(error)}); please report it to the "
        f"authors of semsig_gis, with {report}."
    )


def _brief(error: Exception) -> str:
    """Return the type and the message of an error on one line."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return text.rstrip(".: ")[:LONGEST_MESSAGE]
