from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import mixtures

from semsig_gis.core.errors import InputError
from semsig_gis.likelihood.noise.model import NOISES, NoiseSpec, named_noise, open_noise, save_noise

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.likelihood.noise.model import Noise


@pytest.mark.parametrize("suffix", ["json", "toml", "TOML"])
@pytest.mark.parametrize("name", list(NOISES))
def test_a_model_survives_a_file(name: str, suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"noise.{suffix}"
    save_noise(named_noise(name), file)
    assert open_noise(file) == named_noise(name)


@given(mixtures(), st.text(st.characters(codec="utf-8")))
def test_any_model_survives_a_toml_file(
    tmp_path_factory: pytest.TempPathFactory, noise: Noise, name: str
) -> None:
    file = tmp_path_factory.mktemp("noise") / "noise.toml"
    save_noise(replace(noise, name=name), file)
    assert open_noise(file) == replace(noise, name=name)


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
    with pytest.raises(InputError, match=r"noise\.json cannot be read"):
        open_noise(file)
    file.write_text("[1]")
    with pytest.raises(InputError, match="a table of its fields"):
        open_noise(file)
