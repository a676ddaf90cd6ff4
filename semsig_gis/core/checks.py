"""Checks that numbers are in a range."""

from __future__ import annotations

from semsig_gis.core.errors import InputError

MOST_SEED = 10**18
"""Fits into 64 bits, with room for seeds that are derived by adding to it."""
MOST_METRES = 1_000_000
MOST_WORKERS = 1024
"""Processes or threads of one machine."""


def require_number(what: str, value: float, *, least: float, most: float, unit: str = "") -> None:
    """Raise InputError if `value` is not from `least` to `most`, or is NaN.

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
