"""What services say about their errors, in JSON or in XML, as part of a sentence of ours."""

from __future__ import annotations

import html
import re
from typing import Any

from semsig_gis.storage import parse_json

LONGEST = 200
# Of OGC services: an ExceptionReport of OWS, or a ServiceExceptionReport of older ones.
EXCEPTION = re.compile(
    r"<(?:\w+:)?(?:ExceptionText|ServiceException)\b[^>]*>(.*?)</", re.DOTALL | re.IGNORECASE
)
EXCEPTION_CODE = re.compile(r"\bexceptionCode=\"([^\"]*)\"")
MESSAGES = ("message", "description", "detail", "error", "title")


def error_text(body: bytes) -> str:
    """Return what a service says in the body of an answer, or nothing where that is no error."""
    text = body.decode("utf-8", errors="replace").strip("\ufeff \r\n\t")
    if text.startswith("<"):
        found = EXCEPTION.search(text) or EXCEPTION_CODE.search(text)
        said = html.unescape(re.sub(r"<!\[CDATA\[|\]\]>", "", found[1])) if found else ""
    else:
        try:
            said = _said(parse_json(text))
        except ValueError:
            said = ""
    said = " ".join(said.split())[:LONGEST].rstrip(".")
    return re.sub(r"\.(?=\s)", ",", said)


def _said(reply: Any) -> str:  # noqa: ANN401 - any JSON
    """Return the first message in an object, with the details that stand beside it."""
    if isinstance(reply, str):
        return reply
    if not isinstance(reply, dict):
        return ""
    said = next(filter(None, (_said(reply.get(name)) for name in MESSAGES)), "")
    details = reply.get("details")
    texts = details if isinstance(details, list) else []
    parts = (text.strip().rstrip(".") for text in [said, *map(_said, texts)])
    return ", ".join(dict.fromkeys(filter(None, parts)))
