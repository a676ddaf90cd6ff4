"""Find the records in JSON, however it wraps them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

KEYS = ("features", "results", "records")
"""Keys of the records in the answers of portals, which go first."""
DEEPEST = 5
LEAST_RECORDS = 2  # of a mapping, which otherwise may be a record itself


def find_records(content: Any) -> list[Any] | None:  # noqa: ANN401 - any JSON
    """Return the list of records in parsed JSON, None if there is none.

    Records are a list of mappings, a mapping of mappings, columns, or rows with the names of their
    columns; of several lists, the longest. Values of SPARQL are taken out of their mappings.
    """
    if isinstance(content, list):
        return content
    if not isinstance(content, dict):
        return None
    for key in KEYS:
        rows = content.get(key)
        if isinstance(rows, list):
            return rows
    longest = max(_candidates(content, DEEPEST), key=len, default=None)
    if longest is not None and "head" in content:
        return [
            {name: value.get("value") for name, value in row.items() if isinstance(value, dict)}
            for row in longest
        ]
    return longest


def _candidates(content: dict[str, Any], depth: int) -> Iterator[list[Any]]:
    """Yield the lists of records in a mapping and in the mappings inside it."""
    values, rows = [*content.values()], content.get("data")
    names = _column_names(content)
    if names and isinstance(rows, list) and all(isinstance(row, list) for row in rows):
        yield [dict(zip(names, row, strict=False)) for row in rows]
        return
    lists = [value for value in values if isinstance(value, list)]
    if (
        len(lists) == len(values) >= LEAST_RECORDS
        and len({*map(len, lists)}) == 1
        and not any(isinstance(item, list | dict) for column in lists for item in column)
    ):
        yield [dict(zip(content, row, strict=True)) for row in zip(*lists, strict=True)]
        return
    for value in lists:
        if value and all(isinstance(item, dict) for item in value):
            yield value
    mappings = [value for value in values if isinstance(value, dict)]
    fields = {frozenset(value) for value in mappings}
    if len(mappings) == len(values) >= LEAST_RECORDS and len(fields) == 1 and all(fields):
        yield [{"key": key, **value} for key, value in content.items()]
        return
    for mapping in mappings if depth else ():
        yield from _candidates(mapping, depth - 1)


def _column_names(content: dict[str, Any]) -> list[str]:
    """Return the names of the columns of rows, as pandas and Socrata write them."""
    columns = content.get("columns")
    meta = content.get("meta")
    if isinstance(meta, dict) and isinstance(meta.get("view"), dict):
        columns = meta["view"].get("columns")
    if not isinstance(columns, list):
        return []
    names = [item.get("name") if isinstance(item, dict) else item for item in columns]
    return [*map(str, names)]
