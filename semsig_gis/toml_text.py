"""Values as TOML that people can read and change."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

__all__ = ["toml_text"]


def toml_text(values: Mapping[str, Any]) -> str:
    """Write values as TOML: numbers, texts and lists first, then a section for each table.

    There is no None, NaN or infinity among them. A parser reads back the same values, but for
    tables that are empty.
    """
    return _section(values).lstrip("\n")


def _section(values: Mapping[str, Any], *above: str) -> str:
    tables = {name: part for name, part in values.items() if isinstance(part, Mapping)}
    lines = [
        f"{_key(name)} = {_inline(part)}\n" for name, part in values.items() if name not in tables
    ]
    for name, part in tables.items():
        path = (*above, _key(name))
        own = any(not isinstance(one, Mapping) for one in part.values())
        lines += [f"\n[{'.'.join(path)}]\n"] if own else []
        lines.append(_section(part, *path))
    return "".join(lines)


def _inline(value: Any) -> str:  # noqa: ANN401 - any value of JSON
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(n)} = {_inline(one)}' for n, one in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    return _text(value) if isinstance(value, str) else json.dumps(value, allow_nan=False)


def _key(name: str) -> str:
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else _text(name)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
