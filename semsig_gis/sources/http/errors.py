"""Error messages of services, in JSON or XML, as part of a sentence."""

from __future__ import annotations

import html
import re
from typing import Any

from semsig_gis.storage import parse_json

LONGEST = 200
# OGC services send an OWS ExceptionReport, older ones a ServiceExceptionReport.
EXCEPTION = re.compile(
    r"<(?:\w+:)?(?:ExceptionText|ServiceException)\b[^>]*>(.*?)</", re.DOTALL | re.IGNORECASE
)
EXCEPTION_CODE = re.compile(r"\bexceptionCode=\"([^\"]*)\"")
MESSAGES = ("message", "description", "detail", "error", "title")


def error_text(body: bytes | bytearray) -> str:
    """Return the error message in the body of an answer, or "" if it is not an error."""
    text = body.decode("utf-8", errors="replace").strip("\ufeff \r\n\t")
    if text.startswith("<"):
        match = EXCEPTION.search(text) or EXCEPTION_CODE.search(text)
        message = html.unescape(re.sub(r"<!\[CDATA\[|\]\]>", "", match[1])) if match else ""
    else:
        try:
            message = _json_message(parse_json(text))
        except ValueError:
            message = ""
    message = " ".join(message.split())[:LONGEST].rstrip(".")
    # Several sentences become one, joined with commas.
    return re.sub(r"\.(?=\s)", ",", message)


def _json_message(reply: Any) -> str:  # noqa: ANN401 - any JSON
    """Return the first message in a JSON object and its details."""
    if isinstance(reply, str):
        return reply
    if not isinstance(reply, dict):
        return ""
    message = next(filter(None, (_json_message(reply.get(name)) for name in MESSAGES)), "")
    details = reply.get("details")
    texts = details if isinstance(details, list) else []
    parts = (text.strip().rstrip(".") for text in [message, *map(_json_message, texts)])
    return ", ".join(dict.fromkeys(filter(None, parts)))
