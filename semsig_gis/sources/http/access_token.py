"""Access token of a service: sent to that service, and removed from everything it returns."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from semsig_gis.core import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

REDACTED = "(token)"
LONGEST_SPELLING = len(r"\u007c")


@dataclass(frozen=True, slots=True)
class AccessToken:
    """An access token, sent in a header of every request and never logged or cached."""

    value: str = field(repr=False)

    @classmethod
    def from_environment(cls, variable: str) -> AccessToken:
        """Return the token in an environment variable; InputError if it is not a token."""
        value = os.environ.get(variable, "").strip()
        if not re.fullmatch(r"[!-~]+", value):
            what = (
                "contains blanks or other characters that a token cannot have"
                if value
                else "is not set"
            )
            raise InputError(
                f"the environment variable {variable} {what}; set it to the access token that the "
                "service gave you."
            )
        return cls(value)

    @property
    def headers(self) -> dict[str, str]:
        """Headers that authorize a request and ask for an uncompressed answer."""
        return {"Authorization": f"OAuth {self.value}", "Accept-Encoding": "identity"}

    def redact(self, text: str) -> str:
        """Return a text without the token, however its letters are escaped."""
        # Each letter may be as it is, in an address (%7c) or in JSON (\u007c).
        pattern = "".join(
            rf"(?:\\?{re.escape(letter)}|(?:%|\\u00)(?i:{ord(letter):02x}))"
            for letter in self.value
        )
        return re.sub(pattern, REDACTED, text)

    def redact_blocks(self, blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Remove the token from a body; it may start in one block and end in another.

        Yields
        ------
        bytes
            The next part of the body.
        """
        longest = LONGEST_SPELLING * len(self.value)
        rest = ""
        for block in blocks:
            text = self.redact(rest + block.decode("latin-1"))
            # The end may be the start of the token, so it waits for the next block.
            ready = max(0, len(text) - longest)
            rest = text[ready:]
            yield text[:ready].encode("latin-1")
        yield rest.encode("latin-1")
