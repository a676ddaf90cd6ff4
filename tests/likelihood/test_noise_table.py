from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import TAXONOMY, noise_specs, random_database

from semsig_gis.core.signature import Signature
from semsig_gis.likelihood.noise.model import NoiseMixture, NoiseSpec, named_noise
from semsig_gis.likelihood.noise.table import database_tables, mean_table, noise_tables
from semsig_gis.queries.distortions import distort, named_distortion

CODES = np.array([1, 3, 4], np.uint8)
NAMES = ["alignment_tree", "street_light", "indicator"]


def slow_named(spec: NoiseSpec, kind: int, name: int, length: int) -> float:
    """Return the chance of a name, one number at a time."""
    misnamed = spec.misnamed_by_class.get(NAMES[kind], spec.misnamed)
    alike = dict.fromkeys(NAMES, misnamed / 2) | {NAMES[kind]: 1 - misnamed}
    row = spec.confusion.get(NAMES[kind], alike)
    shares = [row.get(one, 0.0) for one in NAMES]
    wrong = sum(share for one, share in enumerate(shares) if one != kind)
    right = shares[kind] * (1 - 1 / length) ** spec.misnamed_each
    right = 1 - min(max(1 - right, 1e-3), 0.95)
    if name == kind:
        return float(right)
    part = shares[name] / wrong if wrong else 1 / (len(NAMES) - 1)
    return float((1 - right) * part)


@given(noise_specs(), st.integers(1, 30))
def test_a_table_says_what_the_model_says(spec: NoiseSpec, length: int) -> None:
    (table,), weights = noise_tables(spec, taxonomy=TAXONOMY, codes=CODES, longest=30)
    assert weights.tolist() == [1.0]
    for kind, name in enumerate(NAMES):
        detected = spec.detection_by_class.get(name, spec.detection)
        detected *= (1 - 1 / length) ** spec.missed_each
        assert table.missed[length, kind] == pytest.approx(min(max(1 - detected, 1e-3), 0.95))
        assert table.sigma[kind] == spec.bearing_sigma_by_class.get(name, spec.bearing_sigma)
        share = spec.clutter_shares.get(name, 0.0) if spec.clutter_shares else 1 / 3
        assert table.clutter[kind] == pytest.approx(max(spec.clutter * share, 1e-3 / 3))
        for other in range(len(NAMES)):
            expected = slow_named(spec, kind, other, length)
            assert table.named[length, kind, other] == pytest.approx(expected)
    assert np.allclose(table.named.sum(axis=2), 1.0)
    assert table.density[-1] * 360 == pytest.approx(table.clutter.sum())


@pytest.mark.parametrize("level", ["light", "medium", "strong"])
def test_the_levels_predict_what_the_distortion_does(level: str) -> None:
    length, draws = 20, 3000
    rng = np.random.default_rng(3)
    true = Signature(np.full(length, 1, np.uint8), np.arange(0.0, 360.0, 18.0))
    seen = [distort(true, named_distortion(level), classes=CODES, rng=rng) for _ in range(draws)]
    (table,), _ = noise_tables(named_noise(level), taxonomy=TAXONOMY, codes=CODES, longest=length)
    detected = (1 - table.missed[length, 0]) * length
    expected = detected + table.clutter.sum()
    # A false object may itself be missed again, which the model does not tell.
    assert np.mean([len(one) for one in seen]) == pytest.approx(expected, abs=0.6)
    wrong = np.mean([np.count_nonzero(one.codes != 1) for one in seen])
    modelled = detected * table.misnamed[length, 0] + table.clutter.sum() * 2 / 3
    assert wrong == pytest.approx(modelled, rel=0.25)


@given(noise_specs(), noise_specs())
def test_a_mean_lies_between_its_models(one: NoiseSpec, other: NoiseSpec) -> None:
    mixture = NoiseMixture(specs=(one, other), weights=(0.25, 0.75))
    both, weights = noise_tables(mixture, taxonomy=TAXONOMY, codes=CODES, longest=9)
    mean = mean_table(both, weights)
    for name in ("missed", "misnamed", "clutter", "sigma", "others"):
        values = [getattr(table, name) for table in both]
        found = getattr(mean, name)
        assert (found >= np.minimum(*values) - 1e-12).all()
        assert (found <= np.maximum(*values) + 1e-12).all()
    assert np.allclose(mean.named.sum(axis=2), 1.0)
    assert np.allclose(mean.missed, 0.25 * both[0].missed + 0.75 * both[1].missed)


def test_a_position_that_is_not_known_turns_near_objects_most() -> None:
    spec = NoiseSpec(bearing_sigma=5.0, position_sigma=3.0)
    (table,), _ = noise_tables(spec, taxonomy=TAXONOMY, codes=CODES, longest=9)
    sigmas = table.sigmas(30.0)
    assert (np.diff(sigmas, axis=1) <= 0).all()
    assert sigmas[0, 255] == pytest.approx(math.hypot(5.0, math.degrees(3.0 / 30.0)))
    assert sigmas[0, 0] == 180.0


def test_nothing_seen_is_that_all_are_missed_and_nothing_is_false() -> None:
    database = random_database(4)
    (table,), _ = database_tables(database, named_noise("medium"))
    every = table.nothing_seen(database.offsets, table.row_of[database.codes])
    length = int(database.lengths[7])
    rows = table.row_of[database.signature(7).codes]
    slow = sum(math.log(table.missed[length, row]) for row in rows) - table.clutter.sum()
    assert every[7] == pytest.approx(slow)


def test_a_single_class_is_never_misnamed() -> None:
    database = random_database(1, classes=1)
    (table,), _ = database_tables(database, named_noise("strong"))
    assert (table.named == 1.0).all()


def test_queries_are_checked_for_their_classes() -> None:
    (table,), _ = noise_tables(NoiseSpec(), taxonomy=TAXONOMY, codes=CODES, longest=9)
    assert table.query_rows(Signature(np.array([4, 0, 1], np.uint8), None)).tolist() == [2, 3, 0]
    assert table.query_rows(Signature(None, np.array([4.0]))).tolist() == [3]
