"""Methods of either kind: named by text, and with what they need to answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import LikelihoodLocator
from semsig_gis.likelihood.method import LIKELIHOOD, LikelihoodMethod
from semsig_gis.likelihood.noise.model import NOISES, cell_noise
from semsig_gis.matching.method import Method
from semsig_gis.matching.search import DistanceLocator

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.database.answer import Answer, Locator
    from semsig_gis.database.city import ObjectStore
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.noise.model import Noise

AnyMethod = Method | LikelihoodMethod


def parse_method(text: str, *, noises: Mapping[str, Noise] = NOISES) -> AnyMethod:
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


def make_locator(
    database: SignatureDatabase,
    method: AnyMethod,
    *,
    store: Callable[[], ObjectStore],
) -> Locator[Answer]:
    """Return a method with all that it needs; `store` is called if it is needed."""
    if isinstance(method, Method):
        return DistanceLocator(database=database, method=method)
    noise = method.noise if method.on_grid else cell_noise(method.noise, database.grid.step)
    return LikelihoodLocator(
        index=build_index(database, noise),
        north_sigma=method.north_sigma,
        store=store() if method.refined else None,
        refined=method.refined,
    )
