"""The settings of an evaluation as plain values, and the machine that it ran on."""

from __future__ import annotations

import os
import platform
from typing import TYPE_CHECKING, Any

from semsig_gis.detector import Detector
from semsig_gis.distortion_chain import chain_text, parse_chain
from semsig_gis.errors import InputError
from semsig_gis.method import LikelihoodMethod, parse_method
from semsig_gis.noise import noise_from_dict
from semsig_gis.queries import QuerySpec

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from semsig_gis.distortion_chain import QueryDistortion
    from semsig_gis.method import Method
    from semsig_gis.noise import Noise

__all__ = ["machine", "settings_from_dict", "settings_to_dict", "used_noises"]


def machine() -> dict[str, Any]:
    """Return what decides how long things take here.

    Keys are ``system``, ``processor``, ``processors`` (how many there are) and ``memory_gb`` (None
    where the system does not tell).
    """
    pages = "SC_PHYS_PAGES" in getattr(os, "sysconf_names", ())
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9 if pages else None
    return {
        "system": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "processors": os.cpu_count() or 1,
        "memory_gb": None if memory is None else round(memory, 1),
    }


def used_noises(
    methods: Iterable[Method | LikelihoodMethod], distortions: Iterable[QueryDistortion]
) -> dict[str, Noise]:
    """Return the noise models of likelihood methods and detectors by name.

    Raises InputError if two models have one name, or a name has one of the signs ``, : / =`` that
    texts of methods and distortions use.
    """
    found: dict[str, Noise] = {}
    models = [one.noise for one in methods if isinstance(one, LikelihoodMethod)]
    models += [one.noise for one in distortions if isinstance(one, Detector)]
    for noise in models:
        if set(noise.name) & set(",:/="):
            msg = f"a noise model is called {noise.name!r}; give it a name without , : / and =."
            raise InputError(msg)
        if found.setdefault(noise.name, noise) != noise:
            msg = f"two noise models are called {noise.name!r}; give each a name of its own."
            raise InputError(msg)
    return found


def settings_to_dict(method: Method | LikelihoodMethod, asked: QuerySpec) -> dict[str, Any]:
    """Return a method and what it was asked as plain values for JSON.

    Keys are ``method``, ``asked`` and ``noises``: all noise models in full, so that nothing else is
    needed to read the texts. Raises InputError as `used_noises` does.
    """
    noises = used_noises([method], asked.distortions)
    return {
        "method": str(method),
        "asked": {
            "number": asked.number,
            "seeds": list(asked.seeds),
            "seen_from": asked.seen_from,
            "distortions": [chain_text([one]) for one in asked.distortions],
        },
        "noises": {name: noise.to_dict() for name, noise in noises.items()},
    }


def settings_from_dict(values: Mapping[str, Any]) -> tuple[Method | LikelihoodMethod, QuerySpec]:
    """Read a method and what it was asked, the inverse of `settings_to_dict`.

    Other values raise AttributeError, LookupError, TypeError or ValueError, which the caller turns
    into an error that names the file.
    """
    noises = {name: noise_from_dict(one) for name, one in values["noises"].items()}
    asked = dict(values["asked"])
    asked["seeds"] = tuple(asked["seeds"])
    asked["distortions"] = parse_chain(asked["distortions"], noises=noises)
    return parse_method(values["method"], noises=noises), QuerySpec(**asked)
