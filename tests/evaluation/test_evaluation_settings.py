from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import noise_specs
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.evaluation.file import settings_from_dict, settings_to_dict, used_noises
from semsig_gis.evaluation.result import machine
from semsig_gis.likelihood.method import LikelihoodMethod
from semsig_gis.likelihood.noise.model import NOISES, NoiseSpec, named_noise
from semsig_gis.matching.method import Method
from semsig_gis.queries.chain import NAMED_DISTORTIONS
from semsig_gis.queries.distortions import Detector
from semsig_gis.queries.draw import QuerySpec


@given(
    noise=noise_specs(),
    kind=st.sampled_from(["distance", "likelihood"]),
    others=st.lists(st.sampled_from(list(NAMED_DISTORTIONS.values())), max_size=3),
    number=st.integers(1, 99),
)
def test_settings_survive_json(
    noise: NoiseSpec, kind: str, others: list[Detector], number: int
) -> None:
    asked = QuerySpec(number=number, seeds=(3, 0), distortions=(*others, Detector(noise=noise)))
    by_chance = LikelihoodMethod(noise=noise, refined=True)
    method = by_chance if kind == "likelihood" else Method(keep=5)
    values = json.loads(json.dumps(settings_to_dict(method, asked), allow_nan=False))
    assert settings_from_dict(values) == (method, asked)


def test_noise_models_of_methods_and_detectors() -> None:
    methods: list[Method | LikelihoodMethod] = [
        Method(),
        LikelihoodMethod(noise=NOISES["light"]),
    ]
    found = used_noises(methods, [Detector(noise=NOISES["strong"]), NAMED_DISTORTIONS["view"]])
    assert found == {"light": named_noise("light"), "strong": named_noise("strong")}


@pytest.mark.parametrize("name", ["a:b", "a/b", "a,b", "a=b"])
def test_names_that_mean_something_else_are_refused(name: str) -> None:
    with pytest.raises(InputError) as caught:
        used_noises([LikelihoodMethod(noise=NoiseSpec(name=name))], [])
    assert_sentence(caught.value, repr(name), "without")


def test_the_machine_is_told() -> None:
    told = machine()
    assert told["processors"] >= 1
    assert told["system"]
    assert json.loads(json.dumps(told)) == told
