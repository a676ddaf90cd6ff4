"""The noise models that have names; those of pictures are files of ``data_sources/noise``."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from semsig_gis.core import UnknownNameError, nearest_name
from semsig_gis.localization.noise.levels import Level, level_mixture
from semsig_gis.localization.noise.model import ALL, NoiseMixture, NoiseSpec
from semsig_gis.sources import data_folder
from semsig_gis.storage import parse_toml

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.localization.noise.model import Noise


def named_noise(name: str) -> Noise:
    """Return a noise model by name.

    Parameters
    ----------
    name : {"light", "medium", "strong", "generic", "by-hand", "photo", "panorama"}
        A level of the source's distortion, ``"generic"`` if the level is not known, or
        ``"by-hand"`` for a person, who marks or names some of the visible objects: nine, six,
        three or one in ten. ``"photo"`` and ``"panorama"`` are for detections in such pictures,
        by a machine or a careful person.

    Returns
    -------
    NoiseSpec or NoiseMixture
        The model.

    Raises
    ------
    UnknownNameError
        If there is no such model.

    Examples
    --------
    >>> named_noise("medium").clutter
    2.3333333333333335
    """
    if name not in NOISES:
        *most, last = NOISES
        hint = nearest_name(name, NOISES)
        raise UnknownNameError(
            f"{name!r} is not a noise model; give {', '.join(most)} or {last}{hint}."
        )
    return NOISES[name]


def _pictured(name: str) -> Noise:
    """Read a noise model of a kind of picture.

    A file has parts with a chance ``weight``, the fields of `NoiseSpec`, ``families`` of classes
    with the same detection and fading, and the ``levels`` of `level_mixture`.
    """
    text = (data_folder() / "noise" / f"{name}.toml").read_text(encoding="utf-8")
    specs: list[NoiseSpec] = []
    weights: list[float] = []
    for number, part in enumerate(parse_toml(text, f"{name}.toml")["parts"], start=1):
        weight, families = part.pop("weight"), part.pop("families", [])
        levels = tuple(Level(**{"weight": 1.0, **level}) for level in part.pop("levels", [{}]))
        fading: dict[str, Any] = {ALL: part.pop("fading")} if "fading" in part else {}
        by_class = {item: family for family in families for item in family["classes"]}
        spec = NoiseSpec(
            **part,
            detection_by_class={item: family["detection"] for item, family in by_class.items()},
            fading=fading | {item: family["fading"] for item, family in by_class.items()},
            general=True,
            name=f"{name} {number}",
        )
        mixture = level_mixture(spec, levels)
        specs += mixture.specs
        weights += [weight * share for share in mixture.weights]
    return NoiseMixture(specs=tuple(specs), weights=tuple(weights), name=name)


def _level(name: str, occurrences: int) -> NoiseSpec:
    """Return the model of one of the source's levels: each occurrence is one of three kinds."""
    each = occurrences / 3
    sure = NoiseSpec(detection=1.0, misnamed=0.0, name=name)
    return replace(sure, clutter=each, missed_each=each, misnamed_each=each)


def _equal_mixture(name: str, specs: tuple[NoiseSpec, ...]) -> NoiseMixture:
    """Return a mixture of models that are equally likely."""
    return NoiseMixture(specs=specs, weights=(1 / len(specs),) * len(specs), name=name)


_LEVELS = (_level("light", 1), _level("medium", 7), _level("strong", 13))
# A person leaves out many or few objects, rarely misnames the others, and invents almost none.
_MARKED = tuple(
    NoiseSpec(
        detection=share, misnamed=0.02, clutter=0.1, bearing_sigma=4.0, name=f"{share:g} marked"
    )
    for share in (0.9, 0.6, 0.3, 0.1)
)
NOISES: Mapping[str, Noise] = MappingProxyType(
    {
        **{spec.name: spec for spec in _LEVELS},
        "generic": _equal_mixture("generic", _LEVELS),
        "by-hand": NoiseMixture(specs=_MARKED, weights=(0.3, 0.3, 0.3, 0.1), name="by-hand"),
        **{name: _pictured(name) for name in ("photo", "panorama")},
    }
)
"""The noise models by name."""
