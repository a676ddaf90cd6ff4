"""Methods named by text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.likelihood.method import LIKELIHOOD, LikelihoodMethod
from semsig_gis.likelihood.noise.model import NOISES
from semsig_gis.matching.method import Method

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.likelihood.noise.model import Noise


def parse_method(text: str, *, noises: Mapping[str, Noise] = NOISES) -> Method | LikelihoodMethod:
    """Read a method of either kind from text.

    Parameters
    ----------
    text : str
        What `Method.parse` or `LikelihoodMethod.parse` reads.
    noises : mapping of str to Noise, optional
        The noise models by name.

    Returns
    -------
    Method or LikelihoodMethod
        The method.

    Raises
    ------
    SemsigError
        If the text cannot be read.

    Examples
    --------
    >>> str(parse_method("edit+edit:5%")), str(parse_method("likelihood"))
    ('edit+edit:5%', 'likelihood:generic')
    """
    if text.strip().partition(":")[0] == LIKELIHOOD:
        return LikelihoodMethod.parse(text, noises=noises)
    return Method.parse(text)
