"""What every message to a user keeps to."""

from __future__ import annotations

import re


def assert_sentence(error: BaseException, *words: str) -> None:
    """Check that a message is one plain sentence and names the things it should."""
    message = str(error)
    assert message.endswith("."), message
    assert "\n" not in message, message
    assert not re.search(r"\.\s+[A-Z]", message), message
    assert "Traceback" not in message, message
    for word in words:
        assert word in message, f"{word!r} is not in: {message}"
