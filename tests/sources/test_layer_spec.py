"""What a catalogue says of one layer."""

from __future__ import annotations

import dataclasses

import pytest

from semsig_gis.sources.layers import ClassBy, LayerSpec


def test_a_layer_is_a_value() -> None:
    spec = LayerSpec(
        name="lamps", class_name="street_light", tags=((("highway", ("street_lamp",)),),)
    )
    assert spec == dataclasses.replace(spec)
    assert len({spec, dataclasses.replace(spec), dataclasses.replace(spec, optional=True)}) == 2
    with pytest.raises(dataclasses.FrozenInstanceError):
        spec.name = "other"  # type: ignore[misc]


def test_a_layer_asks_for_nothing_unless_it_is_told_to() -> None:
    spec = LayerSpec(name="a", class_name="bench")
    assert spec.role == "objects"
    assert spec.elements == ("node", "way", "relation")
    assert not spec.optional
    assert not spec.unique_id
    assert (spec.where, spec.class_by, spec.rows, spec.crs) == ((), None, None, None)


def test_classes_by_field_are_a_value() -> None:
    by = ClassBy("kind", (("Taxi", "taxi_station"), (2, "bench")))
    assert {by: 1}[ClassBy("kind", (("Taxi", "taxi_station"), (2, "bench")))] == 1
