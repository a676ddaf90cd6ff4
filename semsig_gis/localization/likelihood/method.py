"""The likelihood method with its settings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis.core import LIKELIHOOD, InputError, UnknownNameError, nearest_name
from semsig_gis.localization.noise.presets import NOISES
from semsig_gis.observation import check_north

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.localization.noise.model import Noise

SWITCHES = ("refined", "on_grid", "surely_here")
"""Settings that are on or off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LikelihoodMethod:
    """The likelihood method with all its steps (see `likelihood.locate`).

    Parameters
    ----------
    noise : NoiseSpec or NoiseMixture
        How detectors fail, at a place that is known.
    refined : bool, default False
        Whether the place is looked for between the viewpoints, too, with the street objects.
    on_grid : bool, default False
        Whether queries are from the very viewpoints, as in the paper, and then not `refined`.
    north_sigma : float, default 0
        Standard deviation in degrees of the north of a query, 0 or 0.001 to 360; infinite if not
        known.
    surely_here : bool, default False
        Whether views are surely from the area of the database.

    Examples
    --------
    >>> LikelihoodMethod.parse("likelihood:generic:heading=10").north_sigma
    10.0
    """

    noise: Noise
    refined: bool = False
    on_grid: bool = False
    north_sigma: float = 0.0
    surely_here: bool = False

    def __post_init__(self) -> None:  # noqa: D105
        check_north(self.north_sigma)
        if self.refined and self.on_grid:
            raise InputError("refined and on_grid exclude each other; leave out one of them.")

    @classmethod
    def parse(cls, text: str, *, noises: Mapping[str, Noise] = NOISES) -> LikelihoodMethod:
        """Read a method from the text that `str` writes.

        It is ``likelihood``, or ``likelihood:NOISE``, then any of ``:refined``, ``:on_grid``,
        ``:surely_here`` and ``:heading=DEGREES`` or ``:heading=unknown``; `noises` are the noise
        models by name. Raises UnknownNameError for another noise model, and InputError if the text
        has another form.
        """
        _, *options = text.strip().split(":")
        noise = options.pop(0) if options else "generic"
        if noise not in noises:
            names = ", ".join(noises)
            hint = nearest_name(noise, noises)
            raise UnknownNameError(
                f"method {text!r} has an unknown noise model{hint}; give one of {names}."
            )
        misread = (
            f"method {text!r} cannot be read; give 'likelihood:NOISE' and optionally ':refined', "
            "':on_grid', ':surely_here', ':heading=10' (degrees) or ':heading=unknown'."
        )
        switches: set[str] = set()
        north_sigma = 0.0
        for option in options:
            key, _, value = option.partition("=")
            if option in SWITCHES:
                switches.add(option)
            elif key == "heading" and value:
                try:
                    north_sigma = math.inf if value == "unknown" else float(value)
                except ValueError as error:
                    raise InputError(misread) from error
            else:
                raise InputError(misread)
        return cls(noise=noises[noise], north_sigma=north_sigma, **dict.fromkeys(switches, True))

    def __str__(self) -> str:
        """Return the text that `parse` reads."""
        parts = [LIKELIHOOD, self.noise.name]
        parts += [name for name in SWITCHES if getattr(self, name)]
        if self.north_sigma:
            heading = str(self.north_sigma).removesuffix(".0")
            parts.append(f"heading={heading if math.isfinite(self.north_sigma) else 'unknown'}")
        return ":".join(parts)
