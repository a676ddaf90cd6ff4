"""What the commands by likelihood share: their options, and what they make of them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli.app import numbers
from semsig_gis.cli.console import progress, remark
from semsig_gis.core.errors import CrsError, DatabaseError, InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database.city import City
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.store import ObjectStore
    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.locate import LikelihoodLocator
    from semsig_gis.likelihood.noise.model import Noise

EXPLAINED = 3
"""How many candidates are explained."""

NoiseName = Annotated[
    str,
    typer.Option(
        "--noise",
        help="With likelihood, how the detector fails: light, medium, strong, generic (which of "
        "them is not known), or a file such as `semsig learn` writes.",
    ),
]
Heading = Annotated[
    str,
    typer.Option(
        "--heading",
        help="With likelihood: known, unknown, or by how many degrees the north of the query may "
        "be off (standard deviation).",
    ),
]
OnGrid = Annotated[
    bool,
    typer.Option(
        "--on-grid",
        help="With likelihood: the query is from the very middle of a cell, as in the paper's "
        "experiment, not from anywhere in it.",
    ),
]
Refine = Annotated[
    bool | None,
    typer.Option(
        "--refine/--no-refine",
        help="With likelihood: look for the place between the middles of the cells, too; by "
        "default where the street objects are there and the query has bearings.",
        show_default=False,
    ),
]
Objects = Annotated[
    Path | None,
    typer.Option(
        "--objects",
        help="With likelihood, the street objects: a file that `semsig load` wrote, or an object "
        "store; that beside the database by default.",
    ),
]


def locator(
    city: City,
    *,
    noise: str,
    heading: str,
    on_grid: bool,
    objects: Path | None,
    refine: bool | None,
    explain: bool = False,
    rule: Path | None = None,
    top: int = 10,
    known: dict[str, Any] | None = None,
) -> LikelihoodLocator:
    """Return what answers the queries of a command."""
    from semsig_gis.likelihood.answer_rule import DEFAULT_RULE, open_rule
    from semsig_gis.likelihood.locate import LikelihoodLocator
    from semsig_gis.likelihood.noise.model import cell_noise

    if on_grid and refine:
        msg = "--on-grid and --refine were given; a place on the grid is not to be refined, so "
        msg += "leave out one of them."
        raise InputError(msg)
    wanted = not on_grid if refine is None else refine
    if objects is not None and not (wanted or explain):
        given = "--on-grid" if on_grid else "--no-refine"
        msg = f"--objects and {given} were given, so that nothing looks at them; leave out one."
        raise InputError(msg)
    sigma, answer_rule = north_sigma(heading), DEFAULT_RULE if rule is None else open_rule(rule)
    model = read_noise(noise)
    if not on_grid:
        model = cell_noise(model, city.database.grid.step)
    log_prior = None if known is None else _prior(city.database, **known)
    store = None
    if wanted or explain:
        store = object_store(city, objects, needed=bool(refine))
    return LikelihoodLocator(
        index=prepared_index(city, model),
        north_sigma=sigma,
        log_prior=log_prior,
        rule=answer_rule,
        top=top,
        store=store,
        refined=None if wanted and refine is None else refine,
        explained=EXPLAINED if explain else 0,
    )


def prepared_index(city: City, model: Noise) -> LikelihoodIndex:
    """Return the likelihood index beside a database; it is built where it is not there."""
    from semsig_gis.likelihood.index import ready_index

    with progress("preparing the likelihood index") as advance:
        path = city.index_path(model)
        return ready_index(city.database, model, path, note=remark, progress=advance)


def read_noise(noise: str) -> Noise:
    """Return a noise model by its name or file."""
    from semsig_gis.likelihood.noise.model import NOISES, named_noise, open_noise

    return open_noise(noise) if noise not in NOISES and Path(noise).suffix else named_noise(noise)


def object_store(city: City, objects: Path | None, *, needed: bool) -> ObjectStore | None:
    """Return the street objects of a database; None where there are none, unless needed."""
    from semsig_gis.database.store import ObjectStore, open_store
    from semsig_gis.objects.table import open_objects

    if objects is not None and not objects.is_dir():
        store = ObjectStore.of(open_objects(objects))
        if store.objects.crs != city.database.crs:
            msg = (
                f"{objects} is in {store.objects.crs.to_string()} and the database in "
                f"{city.database.crs.to_string()}; give the objects that it was built from."
            )
            raise CrsError(msg)
        return store
    try:
        store = city.store if objects is None else open_store(city.path, objects)
    except DatabaseError as error:
        if needed or objects is not None:
            raise
        remark(f"the street objects are not at hand, so the cells must do: {error}")
        return None
    for note in store.notes:
        remark(note)
    return store


def north_sigma(heading: str) -> float:
    """Return the deviation of north that an option says."""
    if heading in {"known", "unknown"}:
        return 0.0 if heading == "known" else math.inf
    try:
        sigma = float(heading)
    except ValueError:
        sigma = -1.0
    if not sigma >= 0:
        msg = f"--heading was given as {heading!r}; give known, unknown, or degrees from 0 up."
        raise InputError(msg)
    return sigma


def _prior(
    opened: SignatureDatabase,
    *,
    near: str | None,
    area: Path | None,
    popularity: Path | None,
    require: str | None,
) -> NDArray[Any] | None:
    """Return the log-prior that the options ask for."""
    import numpy as np

    from semsig_gis.database.requirement import PatternIndex, Requirement
    from semsig_gis.likelihood.priors import area_prior, position_prior, raster_prior, weight_prior
    from semsig_gis.objects.surroundings import read_area

    parts = []
    if near is not None:
        place = numbers(near, "--near")
        if len(place) != 3:  # noqa: PLR2004 - x, y and sigma
            msg = f"--near was given as {near!r}; give X,Y,SIGMA in metres."
            raise InputError(msg)
        parts.append(position_prior(opened, (place[0], place[1]), sigma=place[2]))
    if area is not None:
        parts.append(area_prior(opened, read_area(area, crs=opened.crs)))
    if popularity is not None:
        parts.append(raster_prior(opened, popularity))
    if require is not None:
        wanted = Requirement.parse(require, opened.taxonomy)
        met = PatternIndex.build(opened.type_sequences).meeting(wanted)
        parts.append(weight_prior(opened, met.astype(np.float64)))
    return None if not parts else np.sum(parts, axis=0)
