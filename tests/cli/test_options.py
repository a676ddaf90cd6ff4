"""Options with numbers: the range of each is in its help and accepted by the library."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest
import typer
from sentences import refused, sentence

from semsig_gis.cli.app import app
from semsig_gis.core import (
    MOST_METRES,
    MOST_SEED,
    GridSpec,
    InputError,
    SignatureSpec,
    check_workers,
)
from semsig_gis.database import TileSpec, ViewpointSpec
from semsig_gis.evaluation import QuerySpec, check_radius, parse_chain
from semsig_gis.localization import LikelihoodMethod, NoiseSpec, named_noise
from semsig_gis.observation import Leg, check_north
from semsig_gis.sources import CitySpec

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Run

COMMANDS: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
NUMBERS = [
    (command, option)
    for command, parsed in COMMANDS.items()
    for option in parsed.params
    if option.type_descriptor.annotation in {int, float}
]
IDS = [f"{command}-{option.name}" for command, option in NUMBERS]


@pytest.mark.parametrize(("command", "option"), NUMBERS, ids=IDS)
def test_every_number_has_a_range(command: str, option: Any, run: Run) -> None:  # noqa: ANN401
    assert math.isfinite(option.min)
    assert math.isfinite(option.max)
    name = option.opts[-1]
    for value in ("nan", "1e999", "-1e308", "x"):
        words = f"{name} was given as ", value, f"from {option.min:,} to {option.max:,}."
        sentence(run(f"{command} {name}={value}"), *words)


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help_fits_a_terminal(command: str, run: Run) -> None:
    code, out, _ = run(f"{command} --help")
    assert code == 0
    assert [line for line in out.splitlines() if len(line) > 80] == []


ACCEPTED: dict[str, Callable[[Any], object]] = {
    "build-step": GridSpec,
    "build-radius": SignatureSpec,
    "build-levels": lambda levels: SignatureSpec(levels=levels),
    "build-street_width": lambda width: ViewpointSpec(width=width / 2),
    "build-tile": TileSpec,
    "build-workers": lambda workers: check_workers(workers, None),
    "synthesize-size": lambda size: CitySpec(size=size),
    "synthesize-seed": lambda seed: CitySpec(seed=seed),
    "evaluate-seed": lambda seed: QuerySpec(seeds=(seed,)),
    "identify-radius": check_radius,
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_limits_of_options_are_accepted_by_the_library(name: str) -> None:
    _, option = NUMBERS[IDS.index(name)]
    ACCEPTED[name](option.min)
    ACCEPTED[name](option.max)


NOISE = named_noise("light")
REFUSED: list[tuple[Callable[[Any], object], list[Any]]] = [
    (GridSpec, [0.0, 1e-300, 1e300, math.nan, math.inf]),
    (TileSpec, [0.0, 1e-300, 1e300, math.nan]),
    (lambda width: ViewpointSpec(width=width), [0.0, 1e308, math.nan]),
    (lambda workers: check_workers(workers, None), [-1, 10**9]),
    (lambda seed: QuerySpec(seeds=(0, seed)), [-1, MOST_SEED + 1, 10**30]),
    (lambda seed: CitySpec(seed=seed), [-1, 10**30]),
    (lambda x: CitySpec(centre=(x, 0.0)), [1e308, math.nan]),
    (check_radius, [-1.0, 1e308, math.nan]),
    (check_north, [-1.0, 1e-300, 361.0, 1e308, math.nan]),
    (lambda north: LikelihoodMethod(noise=NOISE, north_sigma=north), [-1.0, 1e308]),
    (lambda x: Leg(dx=x, dy=0.0), [2.0 * MOST_METRES, 1e308, math.nan]),
    (lambda sigma: Leg(dx=0.0, dy=0.0, sigma=sigma), [-1.0, 1e308, math.nan]),
    (lambda clutter: NoiseSpec(clutter=clutter), [-1.0, 1e308, math.nan]),
    (parse_chain, ["compass:1e308", "compass:-1", "obstacles:1e308", "view:1e308"]),
]


@pytest.mark.parametrize(
    ("make", "value"), [(make, value) for make, values in REFUSED for value in values]
)
def test_numbers_out_of_range_are_refused(make: Callable[[Any], object], value: object) -> None:
    with refused(InputError, "give"):
        make(value)
