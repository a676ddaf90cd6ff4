"""What GDAL says while a file is read: kept for the report instead of reaching the log."""

from __future__ import annotations

import contextlib
import contextvars
import logging
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

# fiona's loggers; a filter acts on the very logger that emits, not on those below it.
LOGGERS = ("fiona._env", "fiona._err", "fiona.collection", "fiona.ogrext")

_heard: contextvars.ContextVar[list[logging.LogRecord] | None] = contextvars.ContextVar(
    "_heard", default=None
)


def _hear(record: logging.LogRecord) -> bool:
    heard = _heard.get()
    if heard is None:
        return True
    heard.append(record)
    return False


# A filter and not a handler: another user of fiona in the process keeps its messages, and two
# threads that read at once do not hear each other.
for _name in LOGGERS:
    logging.getLogger(_name).addFilter(_hear)


@contextlib.contextmanager
def listening() -> Iterator[list[logging.LogRecord]]:
    """Collect the messages of the block in the list that is given."""
    heard: list[logging.LogRecord] = []
    token = _heard.set(heard)
    try:
        yield heard
    finally:
        _heard.reset(token)


def first_error(heard: list[logging.LogRecord]) -> str:
    """Return the first message that is an error, or an empty string."""
    for record in heard:
        if record.levelno >= logging.ERROR:
            return record.getMessage().rstrip(".")
    return ""
