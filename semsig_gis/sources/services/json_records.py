"""Find the records in JSON, however it wraps them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

KEYS = ("features", "results", "records")
"""Keys of the records in the answers of portals, which go first."""
DEEPEST = 5
LEAST_RECORDS = 2  # of a mapping, which otherwise may be a record itself


def find_records(
    content: Any,  # noqa: ANN401 - any JSON
) -> tuple[list[Any] | None, tuple[str, ...]]:
    """Return the list of records in parsed JSON, None if there is none, and notes.

    Records are a list of mappings, a mapping of mappings, columns, or rows with the names of their
    columns; of several lists, the one with most records that have more than texts and whole
    numbers, as positions are. Values of SPARQL are taken out of their mappings.
    """
    if not isinstance(content, dict):
        return (content if isinstance(content, list) else None), ()
    for key in KEYS:
        rows = content.get(key)
        if isinstance(rows, list):
            return rows, ()
    lists = sorted(_candidates(content, DEEPEST), key=_rank, reverse=True)
    if not lists:
        return None, ()
    longest, *others = lists
    if "head" in content:
        return [
            {name: value.get("value") for name, value in row.items() if isinstance(value, dict)}
            for row in longest
        ], ()
    count = sum(rank for rank, _ in map(_rank, others))
    if not count:
        return longest, ()
    return longest, (
        f"{count:,} records in other lists of the file were not read; save each list as a file",
    )


def _rank(rows: list[Any]) -> tuple[int, int]:
    """Return the number of records that may have a position, and of all records."""
    parts = (float, list, dict)
    return sum(any(isinstance(value, parts) for value in row.values()) for row in rows), len(rows)


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
