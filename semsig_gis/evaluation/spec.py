"""Specification of experiments: the database, the queries and the methods; read from TOML."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from semsig_gis.core import (
    Accepts,
    CatalogError,
    FileTable,
    InputError,
    Whole,
    pairs,
    read_table,
)
from semsig_gis.evaluation.file import used_noises
from semsig_gis.evaluation.queries.distortion_text import chain_text, parse_chain
from semsig_gis.evaluation.queries.draw import QuerySpec
from semsig_gis.localization import NOISES, noise_from_dict, open_noise, parse_method
from semsig_gis.storage import parse_toml, read_text, toml_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.evaluation.queries.distortion_text import QueryDistortion
    from semsig_gis.evaluation.queries.draw import SeenFrom
    from semsig_gis.localization import AnyMethod, Noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Districts:
    """Polygons of a vector `file` by which results are grouped; field `name` has their names."""

    file: str
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One evaluation of an experiment, given by the names of its distortion and its method.

    `top` is the number of best candidates that count.
    """

    distortion: str
    method: str
    top: int

    @property
    def name(self) -> str:
        """Name of the evaluation, and of its folder."""
        return f"{self.distortion}/{self.method}-top{self.top}"


_WholeNumbers = Annotated[tuple[Whole, ...], Accepts("a list of whole numbers")]
_Chain = Annotated[str | tuple[str, ...], Accepts("a text or a list of texts")]


class _ExperimentFile(FileTable):
    """The keys of a file; those that it lacks have the defaults of `ExperimentSpec`."""

    database: str
    methods: dict[str, str]
    distortions: dict[str, _Chain]
    queries: Whole = 0
    seeds: _WholeNumbers = ()
    seen_from: str = ""
    city: str = ""
    top: _WholeNumbers = ()
    districts: Districts | None = None
    noises: Annotated[
        tuple[tuple[str, Any], ...],
        pairs(Annotated[str | dict[str, Any], Accepts("a table or the name of a file")]),
    ] = ()


@dataclass(frozen=True, kw_only=True)
class ExperimentSpec:
    """An experiment: every method locates the same queries, with every distortion.

    Parameters
    ----------
    database : str
        File of the database to search.
    methods : mapping of str to Method or LikelihoodMethod
        The methods by name.
    distortions : mapping of str to tuple
        The chains of distortions by name.
    queries : int, default 500
        Number of queries of each seed.
    seeds : tuple of int, default (0,)
        Random seeds.
    seen_from : {"cells", "anywhere"}, default "cells"
        Where queries are seen from (see `QuerySpec`).
    city : str, optional
        File of the database of the observed city, if it is not the searched one.
    top : tuple of int, default (1,)
        Numbers of best candidates that count (t).
    districts : Districts, optional
        Polygons by which results are grouped in addition.

    Raises
    ------
    InputError
        If there is no method or no distortion, a name is not valid as a folder name, a number is
        out of range, or two noise models have the same name.
    UnknownNameError
        If `seen_from` is neither.

    Examples
    --------
    >>> spec = parse_experiment('''
    ... database = "city.parquet"
    ... [methods]
    ... paper = "edit+edit:5%"
    ... [distortions]
    ... phone = ["medium", "compass:10", "view:90"]
    ... ''')
    >>> [case.name for case in spec.cases]
    ['phone/paper-top1']
    """

    database: str
    methods: Mapping[str, AnyMethod]
    distortions: Mapping[str, tuple[QueryDistortion, ...]]
    queries: int = 500
    seeds: tuple[int, ...] = (0,)
    seen_from: SeenFrom = "cells"
    city: str | None = None
    top: tuple[int, ...] = (1,)
    districts: Districts | None = None

    def __post_init__(self) -> None:  # noqa: D105
        for what, items in (("methods", self.methods), ("distortions", self.distortions)):
            if not items:
                raise InputError(f"the experiment has no {what}; name at least one.")
            for name in items:
                if not re.fullmatch("[A-Za-z0-9_-]+", name):
                    raise InputError(
                        f"{name!r} cannot be a name in {what}; use only letters, digits, _ and -."
                    )
        if not self.top or len(set(self.top)) < len(self.top) or min(self.top) < 1:
            raise InputError(f"top is {list(self.top)}; give different whole numbers from 1.")
        for name in self.distortions:
            self.asked(name)  # checks the numbers
        self.noises  # noqa: B018 - checks the names

    @property
    def noises(self) -> dict[str, Noise]:
        """The noise models of all methods and detectors, by name."""
        distortions = [item for chain in self.distortions.values() for item in chain]
        return used_noises(self.methods.values(), distortions)

    @property
    def cases(self) -> tuple[Case, ...]:
        """All evaluations: every combination of distortion, method and number of candidates."""
        return tuple(
            Case(distortion=distortion, method=method, top=top)
            for distortion in self.distortions
            for method in self.methods
            for top in self.top
        )

    def asked(self, distortion: str) -> QuerySpec:
        """Return the specification of the queries with a distortion, given by name."""
        return QuerySpec(
            number=self.queries,
            seeds=self.seeds,
            seen_from=self.seen_from,
            distortions=self.distortions[distortion],
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the fields that `parse_experiment` reads; built-in noise models only by name."""
        noises = {
            name: noise.to_dict()
            for name, noise in self.noises.items()
            if NOISES.get(name) != noise
        }
        return {
            "database": self.database,
            "queries": self.queries,
            "seeds": list(self.seeds),
            "seen_from": self.seen_from,
            **({} if self.city is None else {"city": self.city}),
            "top": list(self.top),
            "methods": {name: str(method) for name, method in self.methods.items()},
            "distortions": {
                name: [chain_text([item]) for item in chain]
                for name, chain in self.distortions.items()
            },
            **({} if self.districts is None else {"districts": asdict(self.districts)}),
            **({"noises": noises} if noises else {}),
        }

    def to_toml(self) -> str:
        """Return the experiment as the TOML that `parse_experiment` reads."""
        return toml_text(self.to_dict())


def parse_experiment(
    text: str, *, where: str = "the experiment", folder: str | Path = "."
) -> ExperimentSpec:
    """Read an experiment from TOML; messages name it `where`.

    The keys are the fields of `ExperimentSpec`: ``methods`` are texts such as ``"edit+edit:5%"``,
    ``distortions`` texts or lists of texts, such as ``"medium, view:90"``. In addition, ``noises``
    has noise models by name, each a table or the name of a file in `folder`. Raises
    UnknownNameError for an unknown method, distortion or noise model, and InputError if a key or
    value is not valid.
    """
    try:
        file = read_table(_ExperimentFile, parse_toml(text, where), where, error=InputError)
    except CatalogError as error:
        raise InputError(str(error)) from error
    noises = {**NOISES}
    for name, noise in file.noises:
        place = f"{where}, noises, {name}"
        values = open_noise(Path(folder, noise)).to_dict() if isinstance(noise, str) else noise
        noises[name] = noise_from_dict({**values, "name": name}, where=place)
    chains = {
        name: chain if isinstance(chain, str) else ", ".join(chain)
        for name, chain in file.distortions.items()
    }
    keys = file.model_fields_set - {"methods", "distortions", "noises"}
    return ExperimentSpec(
        methods={name: parse_method(text, noises=noises) for name, text in file.methods.items()},
        distortions={name: parse_chain(chain, noises=noises) for name, chain in chains.items()},
        **{key: getattr(file, key) for key in keys},
    )


def open_experiment_spec(path: str | Path) -> ExperimentSpec:
    """Read an experiment from a TOML file.

    Parameters
    ----------
    path : str or Path
        The file; the paths in it are relative to its folder.

    Returns
    -------
    ExperimentSpec
        The experiment.

    Raises
    ------
    InputError
        If the file cannot be read, or does not contain an experiment.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> text = '''
    ... database = "city.parquet"
    ... methods = {paper = "edit+edit"}
    ... distortions = {phone = ["light"]}
    ... '''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = Path(folder, "phone.toml").write_text(text)
    ...     list(open_experiment_spec(f"{folder}/phone.toml").methods)
    ['paper']
    """
    file = Path(path)
    try:
        text = read_text(file)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise InputError(
            f"experiment {file} cannot be read ({reason}); give a TOML file."
        ) from error
    return parse_experiment(text, where=str(file), folder=file.parent)
