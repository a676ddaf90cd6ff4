"""Ranges of numbers that callers give."""

from __future__ import annotations

from semsig_gis.core.errors import InputError

MOST_SEED = 10**18
"""What 64 bits hold, with room for the seeds that are counted on from it."""
MOST_METRES = 1_000_000
MOST_WORKERS = 1024
"""Processes or threads of one machine."""


def require_number(what: str, value: float, *, least: float, most: float, unit: str = "") -> None:
    """Raise InputError unless a number is in a range; NaN is in none.

    Examples
    --------
    >>> require_number("a radius", 1e308, least=0, most=MOST_METRES, unit="metres")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.InputError: a radius is 1e+308; give a number from 0 to 1,000,000 metres.
    """
    if not least <= value <= most:
        raise InputError(
            f"{what} is {value}; give a number from {least:,} to {most:,} {unit}".rstrip() + "."
        )
