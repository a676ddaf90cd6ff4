"""Checks that messages to the user are one plain sentence."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator


def assert_sentence(error: BaseException, *words: str) -> None:
    """Check that a message is one plain sentence with some words."""
    message = str(error)
    assert message.endswith("."), message
    assert "\n" not in message, message
    assert not re.search(r"\.\s+[A-Z]", message), message
    assert "Traceback" not in message, message
    for word in words:
        assert word in message, f"{word!r} is not in: {message}"


@contextmanager
def refused(
    kind: type[BaseException] | tuple[type[BaseException], ...], *words: str
) -> Iterator[None]:
    """Expect an error with a message that is one plain sentence with some words."""
    with pytest.raises(kind) as caught:
        yield
    assert_sentence(caught.value, *words)


def sentence(outcome: tuple[int, str, str], *words: str) -> None:
    """Check that a command refused its input with one plain sentence with some words."""
    code, out, err = outcome
    assert code == 2, err
    assert out == ""
    assert "Traceback" not in err
    last = err.strip().splitlines()[-1]
    assert last.startswith("semsig: ")
    assert last.endswith(".")
    for word in words:
        assert word in last, f"{word!r} is not in: {last}"
