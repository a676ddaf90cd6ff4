from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import mixtures
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.likelihood.noise.model import (
    NOISES,
    NoiseMixture,
    NoiseSpec,
    cell_noise,
    named_noise,
    noise_from_dict,
    open_noise,
    place_noise,
    save_noise,
)

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.likelihood.noise.model import Noise


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        ({"detection": -0.1}, "detection of the noise is -0.1; give a chance from 0 to 1."),
        ({"detection": True}, "detection of the noise is True"),
        ({"misnamed": float("nan")}, "misnamed of the noise is nan"),
        ({"clutter": -1}, "clutter of the noise is -1; give a number, 0 or more."),
        ({"bearing_sigma": 0}, "bearing_sigma of the noise is 0; give degrees above 0"),
        ({"bearing_sigma": 200}, "up to 180"),
        ({"position_sigma": float("inf")}, "position_sigma of the noise is inf"),
        ({"detection_by_class": {"bench": 2}}, "detection_by_class 'bench' of the noise is 2"),
        ({"detection_by_class": 0.5}, "give a table by the names of the classes"),
        (
            {"confusion": {"bench": {"bench": 0.9}}},
            "confusion row 'bench' of the noise sums to 0.9",
        ),
        ({"confusion": {"bench": {"bench": -1, "bus_stop": 2}}}, "is -1; give a chance"),
        ({"confusion": {"bench": 1}}, "give a table by the names of the classes"),
        ({"clutter_shares": {"bench": 0.4}}, "clutter_shares of the noise sums to 0.4"),
        ({"detecton": 0.4}, "no field 'detecton'; the nearest is 'detection'"),
        ({"name": 3}, "give a text"),
        ({"specs": []}, "a mixture of noise models is not usable"),
        ({"specs": [], "weights": []}, "give at least one model"),
        ({"specs": [{}], "weights": [0.5]}, "weights of the mixture of the noise sums to 0.5"),
        ({"specs": [{}, {}], "weights": [1.0, 0.0]}, "leave models of no weight out"),
        ({"specs": [{"specs": [{}], "weights": [1]}], "weights": [1]}, "another mixture"),
        ({"specs": [{"clutter": -1}], "weights": [1]}, "clutter of the noise is -1"),
    ],
)
def test_what_cannot_be_a_model_is_refused_in_a_sentence(
    values: dict[str, object], fault: str
) -> None:
    with refused(InputError, fault):
        noise_from_dict(values)


def test_the_generic_model_is_told_nothing_of_the_level() -> None:
    generic = named_noise("generic")
    assert isinstance(generic, NoiseMixture)
    assert len(set(generic.weights)) == 1


@given(
    mixtures() | st.sampled_from(list(NOISES.values())),
    st.text(st.characters(codec="utf-8")),
    st.sampled_from(["json", "toml", "TOML"]),
)
def test_any_model_survives_a_file(
    tmp_path_factory: pytest.TempPathFactory, noise: Noise, name: str, suffix: str
) -> None:
    file = tmp_path_factory.mktemp("noise") / f"noise.{suffix}"
    save_noise(replace(noise, name=name), file)
    assert open_noise(file) == replace(noise, name=name)


def test_a_mixture_of_noise_is_widened() -> None:
    wide = cell_noise(named_noise("generic"), 6.0)
    assert isinstance(wide, NoiseMixture)
    assert [spec.position_sigma for spec in wide.specs] == pytest.approx([math.sqrt(3.0)] * 3)
    twice = cell_noise(cell_noise(NoiseSpec(), 3.0), 4.0)
    assert isinstance(twice, NoiseSpec)
    assert twice.position_sigma == pytest.approx(5.0 / math.sqrt(12.0))


@pytest.mark.parametrize("sigma", [0.0, 1e-3, 0.7, 30.0])
def test_the_noise_of_a_known_place_comes_back(sigma: float) -> None:
    for noise in (NoiseSpec(position_sigma=sigma), named_noise("generic")):
        back = place_noise(cell_noise(noise, 10.0), 10.0)
        for one, other in zip(noise.specs, back.specs, strict=True):
            assert one.position_sigma == pytest.approx(other.position_sigma, abs=2e-3)


def test_a_toml_file_is_read(tmp_path: Path) -> None:
    file = tmp_path / "noise.toml"
    file.write_text(
        "detection = 0.7\n[confusion.bench]\nbench = 0.9\nbus_stop = 0.1\n"
        "[detection_by_class]\nbench = 0.5\n"
    )
    noise = open_noise(file)
    assert noise == NoiseSpec(
        detection=0.7,
        confusion={"bench": {"bench": 0.9, "bus_stop": 0.1}},
        detection_by_class={"bench": 0.5},
    )


def test_a_file_that_holds_no_model_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "noise.json"
    file.write_text("{")
    with refused(InputError, "noise.json cannot be read", "JSON or TOML"):
        open_noise(file)
    file.write_text("[1]")
    with refused(InputError, "a table of its fields"):
        open_noise(file)
