"""Experiments as values: what is searched, which queries are asked, and which methods answer."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import CatalogError, InputError
from semsig_gis.evaluation.file import used_noises
from semsig_gis.evaluation.queries.distortion_text import chain_text, parse_chain
from semsig_gis.evaluation.queries.draw import QuerySpec
from semsig_gis.localization import NOISES, noise_from_dict, open_noise, parse_method
from semsig_gis.storage import check_keys, parse_toml, read_text, toml_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.evaluation.queries.distortion_text import QueryDistortion
    from semsig_gis.evaluation.queries.draw import SeenFrom
    from semsig_gis.localization import AnyMethod, Noise

KEYS = {
    "database": str,
    "queries": int,
    "seeds": list,
    "seen_from": str,
    "city": str,
    "top": list,
    "methods": dict,
    "distortions": dict,
    "noises": dict,
    "districts": dict,
}
DISTRICT_KEYS = {"file": str, "name": str}


@dataclass(frozen=True, slots=True, kw_only=True)
class Districts:
    """Polygons of a vector `file` by which figures are told; the field `name` names them."""

    file: str
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One evaluation of an experiment: the names of a distortion and of a method in it.

    `top` is how many best candidates count.
    """

    distortion: str
    method: str
    top: int

    @property
    def name(self) -> str:
        """What stands for it, also as a folder."""
        return f"{self.distortion}/{self.method}-top{self.top}"


@dataclass(frozen=True, kw_only=True)
class ExperimentSpec:
    """An experiment: every method answers the same queries, after each of some distortions.

    Parameters
    ----------
    database : str
        File of the database that is searched.
    methods : mapping of str to Method or LikelihoodMethod
        The methods by name.
    distortions : mapping of str to tuple
        What happens to the queries, each a chain of distortions, by name.
    queries : int, default 500
        How many of each seed.
    seeds : tuple of int, default (0,)
        Seeds of all chances.
    seen_from : {"cells", "anywhere"}, default "cells"
        Where queries are seen from (see `QuerySpec`).
    city : str, optional
        File of the database of the city that is looked at, if another than is searched.
    top : tuple of int, default (1,)
        Numbers of best candidates that count (t).
    districts : Districts, optional
        Polygons by which the figures are told, too.

    Raises
    ------
    InputError
        If there is no method or no distortion, a name cannot be that of a folder, a number is out
        of range, or two noise models have one name.
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
        for what, named in (("methods", self.methods), ("distortions", self.distortions)):
            if not named:
                raise InputError(f"the experiment has no {what}; name at least one.")
            for name in named:
                if not re.fullmatch("[A-Za-z0-9_-]+", name):
                    raise InputError(
                        f"{name!r} cannot be a name in {what}; use only letters, digits, _ and -."
                    )
        if not self.top or len(set(self.top)) < len(self.top) or min(self.top) < 1:
            raise InputError(f"top is {list(self.top)}; give different whole numbers from 1.")
        for name in self.distortions:
            self.asked(name)
        self.noises  # noqa: B018 - looks at their names

    @property
    def noises(self) -> dict[str, Noise]:
        """The noise models of all methods and detectors, by name."""
        chains = [one for chain in self.distortions.values() for one in chain]
        return used_noises(self.methods.values(), chains)

    @property
    def cases(self) -> tuple[Case, ...]:
        """All evaluations: each distortion, each method, each number of candidates."""
        return tuple(
            Case(distortion=distortion, method=method, top=top)
            for distortion in self.distortions
            for method in self.methods
            for top in self.top
        )

    def asked(self, distortion: str) -> QuerySpec:
        """Return the queries of one of the distortions, given by name."""
        return QuerySpec(
            number=self.queries,
            seeds=self.seeds,
            seen_from=self.seen_from,
            distortions=self.distortions[distortion],
        )

    def to_dict(self) -> dict[str, Any]:
        """Return what `parse_experiment` reads, with noise models that have no known name."""
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
                name: [chain_text([one]) for one in chain]
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
    """Read an experiment from TOML, which messages call `where`.

    It has the fields of `ExperimentSpec`: ``methods`` are texts such as ``"edit+edit:5%"``,
    ``distortions`` texts or lists of them, such as ``"medium, view:90"``. Each of the table
    ``noises`` is a table or the name of a file in `folder`. Raises UnknownNameError for an unknown
    method, distortion or noise model, and InputError if a key or value cannot be used.
    """
    try:
        values = parse_toml(text, where)
        check_keys(values, KEYS, where, ["database", "methods", "distortions"])
        methods, districts = values.pop("methods"), values.pop("districts", None)
        check_keys(methods, dict.fromkeys(methods, str), f"{where}, methods")
        if districts is not None:
            check_keys(districts, DISTRICT_KEYS, f"{where}, districts", DISTRICT_KEYS)
    except CatalogError as error:
        raise InputError(str(error)) from error
    noises = {**NOISES}
    for name, noise in values.pop("noises", {}).items():
        noises[name] = _noise(name, noise, where, Path(folder))
    for name in ("seeds", "top"):
        if name in values:
            values[name] = _whole_numbers(values[name], name, where)
    distortions = {
        name: parse_chain(_chain(chain, name, where), noises=noises)
        for name, chain in values.pop("distortions").items()
    }
    return ExperimentSpec(
        methods={name: parse_method(text, noises=noises) for name, text in methods.items()},
        distortions=distortions,
        districts=None if districts is None else Districts(**districts),
        **values,
    )


def open_experiment_spec(path: str | Path) -> ExperimentSpec:
    """Read an experiment from a TOML file.

    Parameters
    ----------
    path : str or Path
        The file; files that it names are looked for beside it.

    Returns
    -------
    ExperimentSpec
        The experiment.

    Raises
    ------
    InputError
        If the file cannot be read, or does not hold an experiment.

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


def _noise(name: str, noise: object, where: str, folder: Path) -> Noise:
    """Return a noise model that is written out, or that of a file, under its name."""
    if isinstance(noise, str):
        values = open_noise(folder / noise).to_dict()
    elif isinstance(noise, dict):
        values = noise
    else:
        raise InputError(
            f"{where} has {name} = {noise!r} in noises; write a table or the name of a file."
        )
    return noise_from_dict({**values, "name": name})


def _chain(chain: object, name: str, where: str) -> str:
    texts: list[Any] = chain if isinstance(chain, list) else [chain]
    if not all(isinstance(text, str) for text in texts):
        raise InputError(
            f"{where} has {name} = {chain!r} in distortions; write a text or a list of texts."
        )
    return ", ".join(texts)


def _whole_numbers(items: list[object], key: str, where: str) -> tuple[int, ...]:
    # bool is an int to Python, never to a person
    if not all(type(item) is int for item in items):
        raise InputError(f"{where} has {key} = {items!r}; write a list of whole numbers.")
    return tuple(item for item in items if isinstance(item, int))
