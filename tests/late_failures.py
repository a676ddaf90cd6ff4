"""System calls that fail at any time: what a writer leaves, and whether its message is true."""

from __future__ import annotations

import errno
import os
import re
from typing import TYPE_CHECKING, Any

from sentences import assert_sentence

from semsig_gis.core import TEMPORARY_PREFIX, InputError, remove_abandoned
from semsig_gis.storage import whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    import pytest

CALLS = ("chmod", "close", "mkdir", "open", "rename", "replace", "rmdir", "truncate", "unlink")
MOST_CALLS = 400


def failures(
    patch: pytest.MonkeyPatch, *, exchange: bool, calls: int = 1, every: int = 1
) -> Iterator[Callable[[Callable[[], Any]], InputError | None]]:
    """Yield functions that run a block while some of its system calls from the n-th on fail.

    n goes from the first call to the last in steps of `every`, and `calls` fail. Each function
    returns the error of the block, if it is an `InputError`. The last block runs without a failure.
    """
    for number in range(0, MOST_CALLS, every):
        system = _FailingSystem(number, calls)

        def run(block: Callable[[], Any], system: _FailingSystem = system) -> InputError | None:
            with patch.context() as inner:
                for name in CALLS:
                    inner.setattr(os, name, system.failing(getattr(os, name)))
                if not exchange:
                    inner.setattr(whole, "exchange", lambda *_: False)
                try:
                    block()
                except InputError as error:
                    return error
            return None

        yield run
        if system.made <= number:
            return
    raise AssertionError(f"the block makes more than {MOST_CALLS} calls")


class _FailingSystem:
    """System calls; those from `first` to `first + number` fail."""

    def __init__(self, first: int, number: int) -> None:
        self.made, self.failed = 0, range(first + 1, first + 1 + number)

    def failing(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return a system call that may fail."""

        def counted(*arguments: Any, **options: Any) -> Any:  # noqa: ANN401 - as in `os`
            self.made += 1
            fails = self.made in self.failed
            # Linux closes a file even if that fails.
            result = None if fails and call.__name__ != "close" else call(*arguments, **options)
            if fails:
                raise OSError(errno.EIO, os.strerror(errno.EIO), str(arguments[0]))
            return result

        return counted


def assert_true(
    error: InputError | None, folder: Path, state: Callable[[], str], *, names: set[str]
) -> None:
    """Check the message of an error against the state of the files, "old" or "new".

    `names` are those that the folder has without an error. Hidden folders are left only until the
    next writer, and other leftovers are named in the message.
    """
    message = "" if error is None else str(error)
    backup = re.search(rf" is in (\S*{re.escape(TEMPORARY_PREFIX)}\S*);", message)
    if backup:
        assert os.path.lexists(backup[1]), message
    remove_abandoned(folder)
    left = {path.name for path in folder.iterdir()} - names
    assert all(name in message for name in left), (left, message)
    if error is not None:
        assert_sentence(error, os.strerror(errno.EIO))
    content = state()
    if error is None or " is written" in message:
        assert content == "new", message
    elif "unchanged" in message or "cannot be written" in message or backup:
        assert content == "old", message
    else:
        raise AssertionError(message)
