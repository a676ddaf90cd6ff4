"""Access token of a service: sent to that service, and hidden in messages."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from urllib.parse import quote

from semsig_gis.core import InputError


@dataclass(frozen=True, slots=True)
class AccessToken:
    """An access token, sent in a header of every request and hidden in messages."""

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
        """Headers that authorize a request."""
        return {"Authorization": f"OAuth {self.value}"}

    def redact(self, text: str) -> str:
        """Return a text without the token, as it is or as in an address."""
        in_address = re.escape(quote(self.value, safe=""))
        return re.sub(f"{re.escape(self.value)}|(?i:{in_address})", "(token)", text)
