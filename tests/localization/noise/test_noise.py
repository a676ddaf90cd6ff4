"""Noise models and their tables."""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mutations import with_mistakes
from noisy_cells import TAXONOMY, mixtures, noise_specs, random_database
from sentences import assert_sentence, refused

from semsig_gis.core import InputError, Signature, UnknownNameError
from semsig_gis.evaluation import distort, named_distortion
from semsig_gis.localization import (
    NOISES,
    NoiseMixture,
    NoiseSpec,
    cell_noise,
    database_tables,
    mean_table,
    named_noise,
    noise_from_dict,
    noise_tables,
    open_noise,
    place_noise,
    save_noise,
)

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from semsig_gis.localization import Noise, NoiseTable


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        ({"detection": -0.1}, "the noise has detection = -0.1; give a chance from 0 to 1."),
        ({"detection": True}, "the noise has detection = True"),
        ({"misnamed": float("nan")}, "the noise has misnamed = nan"),
        ({"clutter": -1}, "the noise has clutter = -1; give a number from 0"),
        ({"bearing_sigma": 0}, "the noise has bearing_sigma = 0; give degrees above 0"),
        ({"bearing_sigma": 200}, "up to 180"),
        ({"position_sigma": float("inf")}, "the noise has position_sigma = inf"),
        ({"detection_by_class": {"bench": 2}}, "the noise, detection_by_class has bench = 2"),
        ({"detection_by_class": 0.5}, "has detection_by_class = 0.5; give a table"),
        (
            {"confusion": {"bench": {"bench": 0.9}}},
            "the noise, confusion, bench: the shares sum to 0.9",
        ),
        (
            {"confusion": {"bench": {"bench": -1, "bus_stop": 2}}},
            "confusion, bench has bench = -1; give a chance",
        ),
        ({"confusion": {"bench": {}}}, "the noise, confusion, bench: the shares sum to 0;"),
        ({"confusion": {5: {"bench": 1}}}, "the noise, confusion has the key 5; give a string"),
        ({"confusion": {"bench": 1}}, "confusion has bench = 1; give a table"),
        ({"clutter_shares": {"bench": 0.4}}, "clutter_shares: the shares sum to 0.4"),
        ({"detecton": 0.4}, "the key 'detecton', which is unknown; the nearest is 'detection'"),
        ({"name": 3}, "the noise has name = 3; give a string"),
        ({"specs": []}, "the noise lacks the key 'weights'"),
        ({"specs": [], "weights": []}, "give at least one model"),
        (MappingProxyType({"specs": [], "weights": []}), "give at least one model"),
        (
            {"specs": [{}], "weights": [0.5]},
            "weights of the mixture are (0.5,); give chances that sum to 1",
        ),
        ({"specs": [{}, {}], "weights": [1.0, 0.0]}, "weight 2 is 0.0; give a chance above 0"),
        (
            {"specs": [{"specs": [{}], "weights": [1]}], "weights": [1]},
            "spec 1 has the key 'specs', which is unknown",
        ),
        ({"specs": [{"clutter": -1}], "weights": [1]}, "spec 1 has clutter = -1"),
    ],
)
def test_invalid_models_are_refused(values: Mapping[str, object], fault: str) -> None:
    with refused(InputError, fault):
        noise_from_dict(values)


@settings(max_examples=200)
@given(with_mistakes(named_noise("panorama").to_dict(), "specs", "fading", "clutter", "all", "zzz"))
def test_changed_models_are_refused_in_a_sentence_or_read(values: dict[str, Any]) -> None:
    try:
        noise_from_dict(values)
    except InputError as error:
        assert_sentence(error)


@given(
    mixtures() | st.sampled_from(list(NOISES.values())),
    st.text(st.characters(codec="utf-8")),
    st.sampled_from(["json", "toml", "TOML"]),
)
def test_models_are_equal_after_a_file(
    tmp_path_factory: pytest.TempPathFactory, noise: Noise, name: str, suffix: str
) -> None:
    file = tmp_path_factory.mktemp("noise") / f"noise.{suffix}"
    save_noise(replace(noise, name=name), file)
    assert open_noise(file) == replace(noise, name=name)


@pytest.mark.parametrize("sigma", [0.0, 1e-3, 0.7, 30.0])
def test_a_cell_widens_the_noise_of_a_place(sigma: float) -> None:
    noise = NoiseMixture(specs=(NoiseSpec(), NoiseSpec(position_sigma=sigma)), weights=(0.5, 0.5))
    wide = cell_noise(noise, 6.0)
    expected = [math.sqrt(3.0), math.hypot(sigma, math.sqrt(3.0))]
    assert [spec.position_sigma for spec in wide.specs] == pytest.approx(expected)
    assert cell_noise(noise.specs[1], 6.0) == wide.specs[1]
    back = [spec.position_sigma for spec in place_noise(wide, 6.0).specs]
    assert back == pytest.approx([0.0, sigma], abs=2e-3)


def test_a_file_and_a_name_without_a_model_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "noise.json"
    for text, word in (
        ("{", "noise.json cannot be read"),
        ("[1]", "noise.json is [1]; give a table"),
    ):
        file.write_text(text)
        with refused(InputError, word):
            open_noise(file)
    with refused(UnknownNameError, "'genric'", "the nearest is 'generic'"):
        named_noise("genric")


# --- Tables -------------------------------------------------------------------------------

CODES = np.array([1, 3, 4], np.uint8)
NAMES = ["alignment_tree", "street_light", "indicator"]


def tables_of(noise: Noise, longest: int) -> tuple[tuple[NoiseTable, ...], np.ndarray]:
    return noise_tables(noise, taxonomy=TAXONOMY, codes=CODES, longest=longest, radius=30.0)


def slow_named(spec: NoiseSpec, kind: int, name: int, length: int) -> float:
    """Return the chance of a name, one number at a time."""
    misnamed = spec.misnamed_by_class.get(NAMES[kind], spec.misnamed)
    equal = dict.fromkeys(NAMES, misnamed / 2) | {NAMES[kind]: 1 - misnamed}
    row = spec.confusion.get(NAMES[kind], equal)
    shares = [row.get(other, 0.0) for other in NAMES]
    wrong = sum(share for other, share in enumerate(shares) if other != kind)
    right = shares[kind] * (1 - 1 / length) ** spec.misnamed_each
    right = 1 - min(max(1 - right, 1e-3), 0.95)
    if name == kind:
        return float(right)
    part = shares[name] / wrong if wrong else 1 / (len(NAMES) - 1)
    return float((1 - right) * part)


@given(noise_specs(), st.integers(1, 30))
def test_tables_have_the_values_of_the_model(spec: NoiseSpec, length: int) -> None:
    (table,), weights = tables_of(spec, 30)
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
            assert table.named(length)[kind, other] == pytest.approx(expected)
    assert np.allclose(table.named(length).sum(axis=1), 1.0)
    assert table.density[-1] * 360 == pytest.approx(table.clutter.sum())


@pytest.mark.parametrize("level", ["light", "medium", "strong"])
def test_levels_predict_the_distortion(level: str) -> None:
    length, draws = 20, 3000
    rng = np.random.default_rng(3)
    true = Signature(np.full(length, 1, np.uint8), np.arange(0.0, 360.0, 18.0))
    queries = [distort(true, named_distortion(level), classes=CODES, rng=rng) for _ in range(draws)]
    (table,), _ = tables_of(named_noise(level), length)
    detected = (1 - table.missed[length, 0]) * length
    expected = detected + table.clutter.sum()
    # A false object may itself be missed again, which the model does not include.
    assert np.mean([len(query) for query in queries]) == pytest.approx(expected, abs=0.6)
    wrong = np.mean([np.count_nonzero(query.codes != 1) for query in queries])
    modelled = detected * table.misnamed[length, 0] + table.clutter.sum() * 2 / 3
    assert wrong == pytest.approx(modelled, rel=0.25)


@given(noise_specs(), noise_specs())
def test_a_mean_lies_between_its_models(first: NoiseSpec, second: NoiseSpec) -> None:
    mixture = NoiseMixture(specs=(first, second), weights=(0.25, 0.75))
    both, weights = tables_of(mixture, 9)
    mean = mean_table(both, weights)
    for name in ("missed", "misnamed", "clutter", "sigma", "others"):
        values = [getattr(table, name) for table in both]
        value = getattr(mean, name)
        assert (value >= np.minimum(*values) - 1e-12).all()
        assert (value <= np.maximum(*values) + 1e-12).all()
    assert np.allclose([mean.named(length).sum(axis=1) for length in range(10)], 1.0)
    assert np.allclose(mean.missed, 0.25 * both[0].missed + 0.75 * both[1].missed)


def test_position_uncertainty_turns_near_objects_most() -> None:
    spec = NoiseSpec(bearing_sigma=5.0, position_sigma=3.0)
    (table,), _ = tables_of(spec, 9)
    sigmas = table.sigmas
    assert (np.diff(sigmas, axis=1) <= 0).all()
    assert sigmas[0, 255] == pytest.approx(math.hypot(5.0, math.degrees(3.0 / 30.0)))
    assert sigmas[0, 0] == 180.0


def test_a_single_class_is_never_misnamed() -> None:
    database = random_database(1, classes=1)
    (table,), _ = database_tables(database, named_noise("strong"))
    assert (table.named(1) == 1.0).all()


def test_query_rows_are_class_rows() -> None:
    (table,), _ = tables_of(NoiseSpec(), 9)
    assert table.query_rows(Signature(np.array([4, 0, 1], np.uint8), None)).tolist() == [2, 3, 0]
    assert table.query_rows(Signature(None, np.array([4.0]))).tolist() == [3]
