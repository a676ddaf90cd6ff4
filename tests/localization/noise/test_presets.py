"""Noise of photographs and panoramas, its levels, and what is seen from beyond the range."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import TAXONOMY, noise_specs, random_database

from semsig_gis.localization import (
    Level,
    NoiseMixture,
    NoiseSpec,
    build_index,
    database_tables,
    level_mixture,
    named_noise,
)

DATABASE = random_database(2, cells=60)
NAMES = [TAXONOMY.by_code(code).name for code in DATABASE.present_codes.tolist()]


@pytest.mark.parametrize("name", ["photo", "panorama"])
def test_noise_of_pictures_fits_any_database(name: str) -> None:
    noise = named_noise(name)
    assert isinstance(noise, NoiseMixture)
    assert noise.repeat == pytest.approx(0.5)
    tables, weights = database_tables(DATABASE, noise)
    assert len(tables) == len(weights)


def test_only_a_general_model_may_name_unknown_classes() -> None:
    spec = NoiseSpec(detection_by_class={"unicorn": 0.5}, general=True)
    database_tables(DATABASE, spec)
    with pytest.raises(ValueError, match="unicorn"):
        database_tables(DATABASE, replace(spec, general=False))


def test_objects_beyond_the_range_become_clutter() -> None:
    radius = DATABASE.spec.radius
    spec = NoiseSpec(
        detection=0.5, clutter=1.0, fading={"all": [(radius, 1.0), (2.0 * radius, 1.0)]}
    )
    noise = build_index(DATABASE, spec).noise
    # Three times as many objects are in the ring up to twice the range as within the range.
    ranges = TAXONOMY.ranges(radius)[DATABASE.present_codes]
    assert (ranges == radius).all()
    mean = len(DATABASE.codes) / len(DATABASE)
    (result,) = noise.specs
    assert result.clutter == pytest.approx(1.0 + 0.5 * 3.0 * mean, rel=1e-3)
    counts = np.bincount(DATABASE.codes, minlength=256)[DATABASE.present_codes] / len(DATABASE)
    for name, count in zip(NAMES, counts.tolist(), strict=True):
        expected = (1.0 / len(NAMES) + 1.5 * count) / result.clutter
        assert result.clutter_shares[name] == pytest.approx(expected, rel=1e-3)
    assert build_index(DATABASE, noise).noise == noise


@given(noise_specs())
def test_noise_that_ends_at_the_range_is_unchanged(spec: NoiseSpec) -> None:
    plain = replace(spec, fading={})
    assert build_index(DATABASE, plain).noise == plain


@given(
    noise_specs(),
    st.lists(st.tuples(*[st.floats(0.1, 3.0)] * 3), min_size=1, max_size=4),
)
def test_levels_scale_detection_and_reach(
    spec: NoiseSpec, factors: list[tuple[float, float, float]]
) -> None:
    levels = [Level(weight=w, detection=d, reach=r) for w, d, r in factors]
    noise = level_mixture(spec, levels)
    assert math.fsum(noise.weights) == pytest.approx(1.0)
    for model, level in zip(noise.specs, levels, strict=True):
        most = max(spec.detection, 0.95)
        assert model.detection == pytest.approx(min(spec.detection * level.detection, most))
        assert model.clutter == pytest.approx(spec.clutter * level.detection)


def test_a_single_plain_level_is_the_model_itself() -> None:
    spec = NoiseSpec(detection=0.4, clutter=2.0)
    assert level_mixture(spec, [Level(weight=3.0)]) == spec
