"""Distortions one after the other, as plain text and at work: ``medium, compass:10, view:90``."""

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
    Detector,
    Distortion,
    FieldOfView,
    HiddenBehind,
    MissingClasses,
    Obstacles,
    RoughRanges,
    distortion_of,
)
from semsig_gis.localization import NOISES, NoiseMixture, NoiseSpec, named_noise

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from semsig_gis.evaluation.queries.true_view import CitySights, Sight, Spoiling
    from semsig_gis.localization import Noise


@runtime_checkable
class QueryDistortion(Protocol):
    """Anything that happens to a query between the street and the search: a frozen dataclass.

    `stream` keys its random numbers. It belongs to the kind of distortion for ever: another number
    changes every seeded result.
    """

    stream: ClassVar[int]
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def ready(self, city: CitySights) -> Spoiling:
        """Return what it does to a query of a city, with all chances from a generator."""


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
        "detector": Detector(noise=named_noise("generic")),
        "ranges": RoughRanges(),
        "scores": ClassScores(),
    }
)
"""What each name stands for, before its settings."""

WORDS = {"true": True, "false": False}
KINDS: Mapping[type, str] = {bool: "true or false", int: "a whole number", float: "a number"}


def parse_chain(
    text: str | Iterable[str], *, noises: Mapping[str, Noise] = NOISES
) -> tuple[QueryDistortion, ...]:
    """Read distortions from text such as ``medium, compass:10, view:90``.

    A text holds them with commas between them, an iterable one each. Each is a name of
    `NAMED_DISTORTIONS`; then, for all but the paper's levels, ``:VALUE`` for its first setting;
    then any number of ``:SETTING=VALUE``. Lists are written ``bench/bus_stop``, switches ``true``
    and ``false``; a detector names one of `noises`. Blank text gives none. Raises UnknownNameError
    for an unknown distortion, setting or noise model, and InputError for a value of the wrong kind
    or out of range and for a setting given twice.
    """
    parts = text.split(",") if isinstance(text, str) else list(text)
    if isinstance(text, str) and not text.strip():
        return ()
    return tuple(_parsed(part.strip(), noises) for part in parts)


def chain_text(distortions: Sequence[QueryDistortion]) -> str:
    """Write distortions as the shortest text that `parse_chain` reads.

    Noise models are written by name alone, so `parse_chain` must be given those that the package
    does not have.
    """
    return ", ".join(min(_texts(one), key=len) for one in distortions)


def ready_chain(
    distortions: Sequence[QueryDistortion], city: CitySights
) -> Callable[[Sight, int, int], Sight]:
    """Return the function that applies distortions to a query.

    It takes what is seen, a seed and the number of the query. The random numbers of a distortion
    depend on these, its kind and how many of that kind come before: a query meets the same compass
    whatever else happens to it, and experiments that differ in one distortion differ in nothing
    else. What ends up out of a view that is told is left out. Raises SemsigError if a distortion
    does not fit the city.
    """
    repeats: Counter[int] = Counter()
    steps = []
    for one in distortions:
        steps.append(((one.stream, repeats[one.stream]), one.ready(city)))
        repeats[one.stream] += 1

    def spoil(sight: Sight, seed: int, number: int) -> Sight:
        for stream, step in steps:
            entropy = np.random.SeedSequence(seed, spawn_key=(number, *stream))
            sight = step(sight, np.random.default_rng(entropy))
        return sight.in_view()

    return spoil


def _parsed(text: str, noises: Mapping[str, Noise]) -> QueryDistortion:
    """Return the distortion of a text."""
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


def _value(word: str, like: object, noises: Mapping[str, Noise], text: str) -> Any:  # noqa: ANN401
    """Return a setting, of the kind that its default has."""
    if isinstance(like, NoiseSpec | NoiseMixture):
        if word not in noises:
            names = ", ".join(noises)
            raise UnknownNameError(
                f"{word!r} is not a noise model{nearest_name(word, noises)}; give one of {names}."
            )
        return noises[word]
    try:
        if isinstance(like, bool):
            return WORDS[word]
        if isinstance(like, int | float):
            return type(like)(word)
    except (LookupError, ValueError) as error:
        kind = KINDS[type(like)]
        raise InputError(
            f"distortion {text!r} cannot be read; give {kind} in place of {word!r}."
        ) from error
    return tuple(part for part in word.split("/") if part) if isinstance(like, tuple) else word


def _texts(one: QueryDistortion) -> Iterator[str]:
    """Yield what may stand for a distortion: a name and what differs from its settings."""
    first, *others = [item.name for item in fields(one)]
    for name, base in NAMED_DISTORTIONS.items():
        level = name in DISTORTIONS
        # A level of the paper is a number of errors, whatever else differs.
        if type(base) is not type(one) or (level and getattr(one, first) != getattr(base, first)):
            continue
        words = [name, "" if level else _word(getattr(one, first))]
        words += [
            f"{key}={_word(getattr(one, key))}"
            for key in others
            if getattr(one, key) != getattr(base, key)
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
