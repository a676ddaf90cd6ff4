"""Distortions one after the other, as plain text and at work: ``medium, compass:10, view:90``."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from semsig_gis.core.errors import InputError, UnknownNameError, nearest_name
from semsig_gis.likelihood.noise.model import NOISES, NoiseMixture, NoiseSpec, named_noise
from semsig_gis.queries.distortions import (
    BlockedSectors,
    CompassBias,
    Detector,
    FieldOfView,
    HiddenBehind,
    MissingClasses,
    Obstacles,
)
from semsig_gis.queries.paper_errors import DISTORTIONS, Distortion

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.queries.sight import CitySights, Sight, Spoiling


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
    }
)
"""What each name stands for, before its settings."""

WORDS = {"true": True, "false": False}


def parse_chain(
    text: str | Iterable[str], *, noises: Mapping[str, Noise] = NOISES
) -> tuple[QueryDistortion, ...]:
    """Read distortions from text such as ``medium, compass:10, view:90``.

    A text holds them with commas between them, an iterable one each. Each is a name of
    `NAMED_DISTORTIONS`; then, for all but the paper's levels, ``:VALUE`` for its first setting;
    then any number of ``:SETTING=VALUE``. Lists are written ``bench/bus_stop``, switches ``true``
    and ``false``; a detector names one of `noises`. Blank text gives none. Raises UnknownNameError
    for an unknown distortion, setting or noise model and for a setting given twice, and InputError
    for a value of the wrong kind or out of range.
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
    return ", ".join(
        # Of the names that may serve, the one that needs the fewest words.
        min((_text(name, base, one) for name, base in _bases(one)), key=len)
        for one in distortions
    )


def ready_chain(
    distortions: Sequence[QueryDistortion], city: CitySights
) -> Callable[[Sight, int, int], Sight]:
    """Return the function that applies distortions to a query.

    It takes what is seen, a seed and the number of the query. Each distortion of each query has
    random numbers of its own, which depend on the seed, the number of the query, the kind of
    distortion and how many of that kind come before. So a query meets the same compass whatever
    else happens to it, and experiments that differ in one distortion differ in nothing else. Raises
    SemsigError if a distortion does not fit the city.
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
        return sight

    return spoil


def _parsed(text: str, noises: Mapping[str, Noise]) -> QueryDistortion:
    """Return the distortion of a text."""
    name, *settings = text.split(":")
    if name not in NAMED_DISTORTIONS:
        *most, last = NAMED_DISTORTIONS
        hint = nearest_name(name, NAMED_DISTORTIONS)
        msg = f"{name!r} is no distortion{hint}; give {', '.join(most)} or {last}."
        raise UnknownNameError(msg)
    base = NAMED_DISTORTIONS[name]
    values: dict[str, Any] = {}
    for place, setting in enumerate(settings):
        key, equals, said = setting.partition("=")
        first = _first(name, base)
        if not equals and place == 0 and first is not None:
            key, said = first, setting
        known = [item.name for item in fields(base)]
        if key not in known or key in values:
            fault = "is given twice" if key in values else "means nothing"
            msg = (
                f"distortion {text!r} cannot be read: {key!r} {fault}{nearest_name(key, known)}; "
                f"the settings of {name} are {', '.join(known)}."
            )
            raise UnknownNameError(msg)
        values[key] = _value(said, getattr(base, key), noises, text)
    return replace(base, **values)


def _value(said: str, like: object, noises: Mapping[str, Noise], text: str) -> Any:  # noqa: ANN401
    """Return a setting, of the kind that its default has."""
    if isinstance(like, NoiseSpec | NoiseMixture):
        if said not in noises:
            known = ", ".join(noises)
            msg = f"{said!r} is no noise model{nearest_name(said, noises)}; give one of {known}."
            raise UnknownNameError(msg)
        return noises[said]
    try:
        if isinstance(like, bool):
            return WORDS[said]
        if isinstance(like, int | float):
            return type(like)(said)
    except (LookupError, ValueError) as error:
        wanted = "true or false" if isinstance(like, bool) else "a number"
        whole = "a whole number" if type(like) is int else wanted
        msg = f"distortion {text!r} cannot be read: {said!r} is given for {whole}; give one."
        raise InputError(msg) from error
    return tuple(part for part in said.split("/") if part) if isinstance(like, tuple) else said


def _bases(one: QueryDistortion) -> list[tuple[str, QueryDistortion]]:
    """Return the names that may stand for a distortion."""
    return [
        (name, base)
        for name, base in NAMED_DISTORTIONS.items()
        if type(base) is type(one)
        # A level of the paper is a number of errors, whatever else differs.
        and (name not in DISTORTIONS or _errors(base) == _errors(one))
    ]


def _errors(one: QueryDistortion) -> int | None:
    return one.occurrences if isinstance(one, Distortion) else None


def _first(name: str, base: QueryDistortion) -> str | None:
    """Return the setting that needs no name; a level of the paper has none."""
    return None if name in DISTORTIONS else fields(base)[0].name


def _text(name: str, base: QueryDistortion, one: QueryDistortion) -> str:
    """Return a distortion as a name and what differs from it."""
    first = _first(name, base)
    said = [name] if first is None else [name, _word(getattr(one, first))]
    said += [
        f"{item.name}={_word(getattr(one, item.name))}"
        for item in fields(one)
        if item.name != first and getattr(one, item.name) != getattr(base, item.name)
    ]
    return ":".join(part for part in said if part)


def _word(value: Any) -> str:  # noqa: ANN401 - a setting
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, NoiseSpec | NoiseMixture):
        return value.name
    if isinstance(value, tuple):
        return "/".join(value)
    short = f"{value:g}" if isinstance(value, float) else str(value)
    return short if not isinstance(value, float) or float(short) == value else repr(value)
