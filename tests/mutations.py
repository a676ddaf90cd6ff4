"""Files of users with any value at any place."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any

from hypothesis import strategies as st

if TYPE_CHECKING:
    from collections.abc import Mapping

PLAIN = st.one_of(
    st.sampled_from(["", "bench", "streets", "class", "EPSG:4326", "<0", "<x", "/[/", "*"]),
    st.sampled_from([0, 1, 7.5, -1, 10**400, float("nan"), float("inf"), True, False]),
    st.text(max_size=3),
    st.dates(),
)


@st.composite
def with_mistakes(draw: st.DrawFn, document: Mapping[str, object], *names: str) -> dict[str, Any]:
    """Return a document in which a few keys and items are changed, removed or added.

    Keys that are added have one of the names.
    """
    values = st.recursive(
        PLAIN,
        lambda inner: st.one_of(
            st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(names), inner, max_size=3)
        ),
        max_leaves=6,
    )
    changed: dict[str, Any] = copy.deepcopy(dict(document))
    for _ in range(draw(st.integers(1, 3))):
        parts: list[Any] = [changed]
        for part in parts:  # which grows
            inner = part.values() if isinstance(part, dict) else part
            parts += [item for item in inner if isinstance(item, dict | list) and item]
        part = draw(st.sampled_from(parts))
        keys = list(part) if isinstance(part, dict) else list(range(len(part)))
        if isinstance(part, dict) and (not keys or draw(st.booleans())):
            keys.append(draw(st.sampled_from(names)))
        key = draw(st.sampled_from(keys))
        if isinstance(part, dict) and key in part and not draw(st.integers(0, 3)):
            del part[key]
        else:
            part[key] = draw(values)
    return changed
