"""Read what was seen from any form: a sentence, pairs of class and bearing, a row, or a view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, SupportsFloat, TypeAlias

from semsig_gis.core import InputError, Signature, nearest_name
from semsig_gis.observation.sentences import (
    RADIUS_M,
    SEEN,
    parse_seen,
    text_row,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from semsig_gis.core import Taxonomy
    from semsig_gis.storage import Row

AnyView: TypeAlias = "str | Signature | Row | Iterable[str | Row | tuple[object, ...]]"
"""What was seen, in a form that `read_description` takes."""

FORMS = (
    "give a sentence such as 'bench at 40, tree at 120', a list of pairs such as [('bench', 40), "
    "('tree', 120)], a dict as parse_view takes it, or a View"
)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Description:
    """A view, and what else is known of it.

    `unplaced` and `absent` are the class codes of objects that were seen in an unknown direction,
    and that are not in sight; `in_words` is whether a person named the objects.
    """

    view: Signature
    unplaced: tuple[int, ...] = ()
    absent: tuple[int, ...] = ()
    in_words: bool = False


def read_description(view: AnyView, *, taxonomy: Taxonomy, radius: float = RADIUS_M) -> Description:
    """Read what was seen; InputError if it has another form, UnknownNameError for other classes.

    Parameters
    ----------
    view : str, iterable, dict or Signature
        A sentence; a list of parts of one, or of pairs of a name and a bearing in degrees, perhaps
        with a distance in metres; a row as `parse_view` takes it; detections; or a view.
    taxonomy : Taxonomy
        The classes.
    radius : float, default 30
        As in `parse_view`.

    Returns
    -------
    Description
        The view, and what else is known of it.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> from semsig_gis.observation import read_description
    >>> sentence = "bench at 40, lamp at 80, no bus stop"
    >>> description = read_description(sentence, taxonomy=paper_taxonomy())
    >>> description.view.bearings.tolist(), description.absent
    ([40.0, 80.0], (11,))
    >>> pairs = [("bench", 40), ("lamp", 80)]
    >>> read_description(pairs, taxonomy=paper_taxonomy()).view.codes.tolist()
    [10, 3]
    """
    if isinstance(view, Signature):
        return Description(view=view)
    if isinstance(view, str):
        if not view.strip():
            raise InputError(f"the text of what was seen is empty; {FORMS}.")
        row, in_words = text_row(view, taxonomy), True
    elif isinstance(view, Mapping):
        row, in_words = dict(view), "see" in view
        if isinstance(text := row.get("see"), str) and not text.strip():
            raise InputError(f"the text of what was seen is empty; {FORMS}.")
        if all(row.get(name) is None for name in SEEN):
            near = nearest_name(next((str(key) for key in row if key not in SEEN), ""), SEEN)
            raise InputError(
                f"the keys {', '.join(map(str, row)) or 'of an empty dict'} do not say what was "
                f"seen{near}; give {', '.join(SEEN[:-1])} or {SEEN[-1]}."
            )
    else:
        items = _items(view)
        in_words = bool(items) and not any(isinstance(item, Mapping) for item in items)
        row = {"see": ", ".join(map(_phrase, items))} if in_words else {"detections": items}
    parsed, unplaced, absent = parse_seen(row, taxonomy=taxonomy, radius=radius)
    return Description(view=parsed, unplaced=unplaced, absent=absent, in_words=in_words)


def _items(view: Any) -> list[Any]:  # noqa: ANN401 - any value of a user
    try:
        return list(view)
    except TypeError as error:
        raise InputError(f"what was seen is of type {type(view).__name__}; {FORMS}.") from error


def _phrase(item: Any) -> str:  # noqa: ANN401 - any value of a user
    """Return a name, perhaps with a bearing and a distance, as a part of a sentence."""
    match item:
        case str(name) | (str(name),):
            return name
        case (str(name), bearing):
            return f"{name} {_direction(bearing)}"
        case (str(name), bearing, metres):
            return f"{name} {_direction(bearing)} {metres}" + (
                " m" if isinstance(metres, SupportsFloat) else ""
            )
    raise InputError(
        f"{item!r} is not something that was seen; give a name and a bearing, such as "
        "('bench', 40), or a distance in metres as well, such as ('bench', 40, 12)."
    )


def _direction(bearing: object) -> str:
    return f"at {float(bearing):.9f}" if isinstance(bearing, SupportsFloat) else str(bearing)
