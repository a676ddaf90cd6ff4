"""A password of a service, which goes to that service and nowhere else."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from semsig_gis.core import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

HIDDEN = "(token)"
LONGEST_SPELLING = len(r"\u007c")


@dataclass(frozen=True, slots=True)
class Secret:
    """An access token, sent in a header of every request, and hidden in all that comes back.

    The address of a request, which is told and kept, never has it.
    """

    value: str = field(repr=False)

    @classmethod
    def of_environment(cls, variable: str) -> Secret:
        """Return what an environment variable holds; InputError if that is no token."""
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
        """Return what authorizes a request, and asks for an answer that can be looked through."""
        return {"Authorization": f"OAuth {self.value}", "Accept-Encoding": "identity"}

    @property
    def _spellings(self) -> re.Pattern[str]:
        """The token as it is, and as it stands in an address or in JSON, also mixed."""
        return re.compile("".join(map(_spellings_of, self.value)))

    def hide(self, text: str) -> str:
        """Return a text without the token."""
        return self._spellings.sub(HIDDEN, text)

    def strained(self, blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Return a body without the token, which may begin in one block and end in another."""
        return _strained(self, blocks)


def _strained(secret: Secret, blocks: Iterable[bytes]) -> Iterator[bytes]:
    longest = LONGEST_SPELLING * len(secret.value)
    kept = ""
    for block in blocks:
        text = secret.hide(kept + block.decode("latin-1"))
        ready = max(0, len(text) - longest)
        kept = text[ready:]
        yield text[:ready].encode("latin-1")
    yield kept.encode("latin-1")


def _spellings_of(letter: str) -> str:
    """Return a pattern for the spellings of a letter."""
    code = f"(?i:{ord(letter):02x})"
    return rf"(?:\\?{re.escape(letter)}|%{code}|\\u00{code})"
