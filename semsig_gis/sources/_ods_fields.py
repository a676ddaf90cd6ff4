"""Names of fields: one dataset of a portal has labels, field names and older names for the same."""

from __future__ import annotations

import dataclasses
import unicodedata
from typing import TYPE_CHECKING

from semsig_gis.layer_spec import ClassBy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.layer_spec import LayerSpec


def fold(name: str) -> str:
    """Return what the styles of a name share: `TYPE EMPLACEMENT` is `typeemplacement`."""
    plain = unicodedata.normalize("NFKD", name).casefold()
    return "".join(letter for letter in plain if letter.isalnum())


def find_field(name: str, spec: LayerSpec, fields: Sequence[str]) -> str | None:
    """Return the field that a catalogue means, or None where there is none.

    A field of exactly that name goes first, then an alias, then one that differs in capitals,
    accents, spaces and signs only.
    """
    names = (name, *dict(spec.aliases).get(name, ()))
    folded = {fold(field): field for field in reversed(fields) if fold(field)}
    exact = (candidate for candidate in names if candidate in fields)
    alike = (folded[fold(candidate)] for candidate in names if fold(candidate) in folded)
    return next(exact, None) or next(alike, None)


def settle_fields(spec: LayerSpec, fields: Sequence[str]) -> LayerSpec:
    """Return a specification that calls every field as the file does.

    A field that the file lacks keeps its name, for the error that names it.
    """

    def own(name: str) -> str:
        return find_field(name, spec, fields) or name

    class_by, width_by = spec.class_by, spec.width_by
    return dataclasses.replace(
        spec,
        id_field=spec.id_field and own(spec.id_field),
        width_field=spec.width_field and own(spec.width_field),
        width_by=width_by and dataclasses.replace(width_by, field=own(width_by.field)),
        where=tuple((own(field), accepted) for field, accepted in spec.where),
        class_by=class_by and ClassBy(own(class_by.field), class_by.classes),
        select=tuple(own(field) for field in spec.select),
    )
