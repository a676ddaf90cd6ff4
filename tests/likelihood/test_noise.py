from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from noisy_cells import mixtures

from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.likelihood.noise.model import NoiseMixture, named_noise, noise_from_dict

if TYPE_CHECKING:
    from semsig_gis.likelihood.noise.model import Noise


@given(mixtures())
def test_a_model_survives_being_plain_values(noise: Noise) -> None:
    assert noise_from_dict(noise.to_dict()) == noise


@pytest.mark.parametrize(
    ("values", "said"),
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
    values: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError, match=r"\.$") as caught:
        noise_from_dict(values)
    assert said in str(caught.value)


def test_an_unknown_name_is_told_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="the nearest is 'generic'"):
        named_noise("genric")


def test_the_generic_model_is_told_nothing_of_the_level() -> None:
    generic = named_noise("generic")
    assert isinstance(generic, NoiseMixture)
    assert len(set(generic.weights)) == 1
