"""Values of a noise model that are for a whole family of classes."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeVar

from semsig_gis.core import InputError, nearest_name
from semsig_gis.localization.noise.model import ALL, BY_CLASS

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from semsig_gis.core import Taxonomy
    from semsig_gis.localization.noise.model import Noise, NoiseSpec

_Value = TypeVar("_Value")
_Families = dict[str, list[str]]


def noise_by_class(noise: Noise, taxonomy: Taxonomy, present: Collection[int]) -> Noise:
    """Return a noise model with tables that name only classes of a taxonomy, and no families.

    The value of a family goes to each of its classes that has no entry of its own. A share of a
    family is divided equally among these classes, those with a code in `present` if there are any.
    Raises InputError if a model that is not general has another name.
    """
    names = {item.name for item in taxonomy.classes}
    families: _Families = {}
    for item in taxonomy.classes:
        if item.family:
            families.setdefault(item.family, []).append(item.name)
    visible = {item.name for item in taxonomy.classes if item.code in present}

    def change(spec: NoiseSpec) -> NoiseSpec:
        tables = [getattr(spec, name) for name in (*BY_CLASS, "confusion", "fading")]
        keys = {*chain(*tables, spec.clutter_shares, *spec.confusion.values())} - {ALL}
        if not spec.general and (unknown := sorted(keys - names - families.keys())):
            raise _unknown(unknown[0], [item.name for item in taxonomy.classes], families)
        if keys.isdisjoint(families):
            return spec
        values: dict[str, Any] = {
            name: _for_each(getattr(spec, name), families) for name in BY_CLASS
        }
        return replace(
            spec,
            **values,
            fading=_for_each(spec.fading, families),
            clutter_shares=_divided(spec.clutter_shares, families, visible),
            confusion={
                name: _divided(row, families, visible)
                for name, row in _for_each(spec.confusion, families).items()
            },
        )

    return noise.changed(change)


def _for_each(values: Mapping[str, _Value], families: _Families) -> dict[str, _Value]:
    """Return values with those of families given to each of their classes."""
    by_class = {name: value for name, value in values.items() if name not in families}
    for name, value in values.items():
        for item in families.get(name, []):
            by_class.setdefault(item, value)
    return by_class


def _divided(
    shares: Mapping[str, float], families: _Families, visible: set[str]
) -> dict[str, float]:
    """Return shares with those of families divided among their classes."""
    by_class = {name: share for name, share in shares.items() if name not in families}
    for name, share in shares.items():
        all_classes = families.get(name, [])
        rest = [item for item in all_classes if item not in shares]
        parts = [item for item in rest if item in visible] or rest or all_classes
        for item in parts:
            by_class[item] = by_class.get(item, 0.0) + share / len(parts)
    return by_class


def _unknown(name: str, names: list[str], families: _Families) -> InputError:
    """Return the error for a name that is neither a class nor a family."""
    more = f" and its families {', '.join(families)}" if families else ""
    return InputError(
        f"the noise model names a class {name!r} that the database does not "
        f"have{nearest_name(name, [*names, *families])}; its classes are {', '.join(names)}{more}."
    )
