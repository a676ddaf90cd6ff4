"""Chains of distortions: parse and write ``medium, compass:10, view:90``, and apply them."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from semsig_gis.core import InputError, UnknownNameError, nearest_name
from semsig_gis.evaluation.queries.distortions import (
    DISTORTIONS,
    BlockedSectors,
    ClassScores,
    CompassBias,
    Distortion,
    FieldOfView,
    HiddenBehind,
    MissingClasses,
    Obstacles,
    RoughRanges,
    SimulatedDetector,
    distortion_of,
)
from semsig_gis.localization import NOISES, NoiseMixture, NoiseSpec, named_noise

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from semsig_gis.evaluation.queries.true_view import CitySights, DistortFunction, Sight
    from semsig_gis.localization import Noise


@runtime_checkable
class QueryDistortion(Protocol):
    """A change of a query between the street and the search; a frozen dataclass.

    `stream` is the key of its random numbers. Never change the number of a kind of distortion: it
    would change all seeded results.
    """

    stream: ClassVar[int]
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def prepare(self, city: CitySights) -> DistortFunction:
        """Return the function that distorts a query of a city."""


NAMED_DISTORTIONS: Mapping[str, QueryDistortion] = MappingProxyType(
    {
        **DISTORTIONS,
        "errors": Distortion(),
        "compass": CompassBias(),
        "missing": MissingClasses(),
        "known": MissingClasses(others=True),
        "view": FieldOfView(),
        "behind": HiddenBehind(),
        "obstacles": Obstacles(),
        "blocked": BlockedSectors(),
        "detector": SimulatedDetector(noise=named_noise("generic")),
        "ranges": RoughRanges(),
        "scores": ClassScores(),
    }
)
"""Distortion of each name, with its default settings."""

WORDS = {"true": True, "false": False}
KINDS: Mapping[type, str] = {bool: "true or false", int: "a whole number", float: "a number"}


def parse_chain(
    text: str | Iterable[str], *, noises: Mapping[str, Noise] = NOISES
) -> tuple[QueryDistortion, ...]:
    """Read distortions from text such as ``medium, compass:10, view:90``.

    Separate distortions with commas, or give an iterable with one each. A distortion is a name of
    `NAMED_DISTORTIONS`; then, for all but the paper's levels, ``:VALUE`` for its first setting;
    then any number of ``:SETTING=VALUE``. Lists are written ``bench/bus_stop``, switches ``true``
    and ``false``; a detector takes the name of one of `noises`. Blank text is an empty chain.
    Raises UnknownNameError for an unknown distortion, setting or noise model, and InputError for a
    value of the wrong kind or out of range and for a setting given twice.
    """
    parts = text.split(",") if isinstance(text, str) else list(text)
    if isinstance(text, str) and not text.strip():
        return ()
    return tuple(_parsed(part.strip(), noises) for part in parts)


def chain_text(distortions: Sequence[QueryDistortion]) -> str:
    """Write distortions as the shortest text that `parse_chain` reads.

    Noise models are written only by name: give `parse_chain` the models that the package does not
    have.
    """
    return ", ".join(min(_texts(distortion), key=len) for distortion in distortions)


def prepare_chain(
    distortions: Sequence[QueryDistortion], city: CitySights
) -> Callable[[Sight, int, int], Sight]:
    """Return the function that applies distortions to a query.

    It takes a sight, a seed and the number of the query. The random numbers of a distortion depend
    on the seed, the number, the kind of distortion and how many of that kind come before it. So a
    query has the same compass error whatever other distortions there are, and experiments that
    differ in one distortion differ in nothing else. Objects outside a stated view are dropped at
    the end. Raises SemsigError if a distortion does not fit the city.
    """
    repeats: Counter[int] = Counter()
    steps = []
    for distortion in distortions:
        stream = distortion.stream
        steps.append(((stream, repeats[stream]), distortion.prepare(city)))
        repeats[stream] += 1

    def distort(sight: Sight, seed: int, number: int) -> Sight:
        for key, step in steps:
            entropy = np.random.SeedSequence(seed, spawn_key=(number, *key))
            sight = step(sight, np.random.default_rng(entropy))
        return sight.in_view()

    return distort


def _parsed(text: str, noises: Mapping[str, Noise]) -> QueryDistortion:
    """Parse one distortion."""
    name, *settings = text.split(":")
    base = distortion_of(name, NAMED_DISTORTIONS)
    keys = [item.name for item in fields(base)]
    values: dict[str, Any] = {}
    for place, setting in enumerate(settings):
        key, equals, value = setting.partition("=")
        # The first setting needs no name, but a level of the paper is one number of errors.
        if not equals and place == 0 and name not in DISTORTIONS:
            key, value = keys[0], setting
        if key not in keys:
            raise UnknownNameError(
                f"distortion {text!r} cannot be read: {key!r} is not a "
                f"setting{nearest_name(key, keys)}; the settings of {name} are {', '.join(keys)}."
            )
        if key in values:
            raise InputError(
                f"distortion {text!r} cannot be read: {key!r} is given twice; give it once."
            )
        values[key] = _value(value, getattr(base, key), noises, text)
    return replace(base, **values)


def _value(word: str, default: object, noises: Mapping[str, Noise], text: str) -> Any:  # noqa: ANN401
    """Parse the value of a setting as the type of its default."""
    if isinstance(default, NoiseSpec | NoiseMixture):
        if word not in noises:
            names = ", ".join(noises)
            raise UnknownNameError(
                f"{word!r} is not a noise model{nearest_name(word, noises)}; give one of {names}."
            )
        return noises[word]
    try:
        if isinstance(default, bool):
            return WORDS[word]
        if isinstance(default, int | float):
            return type(default)(word)
    except (LookupError, ValueError) as error:
        kind = KINDS[type(default)]
        raise InputError(
            f"distortion {text!r} cannot be read; give {kind} in place of {word!r}."
        ) from error
    return tuple(part for part in word.split("/") if part) if isinstance(default, tuple) else word


def _texts(distortion: QueryDistortion) -> Iterator[str]:
    """Yield possible texts of a distortion: a name and the settings that are not the default."""
    first, *others = [item.name for item in fields(distortion)]
    values = {key: getattr(distortion, key) for key in (first, *others)}
    for name, base in NAMED_DISTORTIONS.items():
        is_level = name in DISTORTIONS
        # A level of the paper fits only if its number of errors, the first setting, is the same.
        if type(base) is not type(distortion) or (
            is_level and values[first] != getattr(base, first)
        ):
            continue
        words = [name, "" if is_level else _word(values[first])]
        words += [
            f"{key}={_word(values[key])}" for key in others if values[key] != getattr(base, key)
        ]
        yield ":".join(filter(None, words))


def _word(value: Any) -> str:  # noqa: ANN401 - a setting
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, NoiseSpec | NoiseMixture):
        return value.name
    if isinstance(value, tuple):
        return "/".join(value)
    short = f"{value:g}" if isinstance(value, float) else str(value)
    return short if not isinstance(value, float) or float(short) == value else repr(value)
