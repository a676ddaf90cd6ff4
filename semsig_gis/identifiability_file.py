"""Identifiability as columns of the files of its database."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.added_columns import add_columns, read_added
from semsig_gis.errors import DatabaseError, SemsigError
from semsig_gis.identifiability import ClassGain, Identifiability
from semsig_gis.likelihood import index_fingerprint
from semsig_gis.noise import noise_from_dict

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    import pyarrow as pa

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.noise import Noise

__all__ = [
    "identifiability_facts",
    "identifiability_of",
    "open_identifiability",
    "save_identifiability",
]

NAME = "identifiability"
# Raised whenever the same cells and noise give other numbers, or they are told otherwise.
FORMAT = 1


def save_identifiability(told: Identifiability, path: str | Path) -> None:
    """Put what is known of the cells into the files of their database.

    Parameters
    ----------
    told : Identifiability
        What to save.
    path : str or Path
        File of the database, or folder of its parts; it is replaced whole.

    Raises
    ------
    DatabaseError
        If it is damaged, or is not the database of `told`.
    InputError
        If it cannot be written; it is unchanged then.

    Notes
    -----
    The columns are those of `Identifiability.table`. Whoever builds or updates the database gets
    one without them.
    """
    add_columns(
        path,
        told.table(),
        cell_ids=told.database.cell_ids,
        name=NAME,
        facts=identifiability_facts(told),
    )


def identifiability_facts(told: Identifiability) -> dict[str, Any]:
    """Return what is needed beside `Identifiability.table` to read it again, as values for JSON."""
    return {
        "format": FORMAT,
        "belongs_to": index_fingerprint(told.database, told.noise),
        "noise": told.noise.to_dict(),
        "radius": told.radius,
        "trials": told.trials,
        "seed": told.seed,
        "classes": [
            {"code": item.code, "near": item.near, "bits": item.bits} for item in told.classes
        ],
    }


def open_identifiability(database: SignatureDatabase, path: str | Path) -> Identifiability | None:
    """Read what `save_identifiability` put into the files of a database.

    Parameters
    ----------
    database : SignatureDatabase
        The database, opened.
    path : str or Path
        Its file, or the folder of its parts.

    Returns
    -------
    Identifiability or None
        What is known of the cells; None where nothing was found out yet.

    Raises
    ------
    DatabaseError
        If the files are damaged, or what they tell belongs to other signatures.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.database_file import save_database
    >>> from semsig_gis.identifying import identify
    >>> from semsig_gis.likelihood import build_index
    >>> from semsig_gis.noise import named_noise
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> told = identify(build_index(database, named_noise("light")), trials=20, class_trials=5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/city.parquet"
    ...     save_database(database, path)
    ...     before = open_identifiability(database, path)
    ...     save_identifiability(told, path)
    ...     after = open_identifiability(database, path)
    >>> before is None, bool((after.found == told.found).all())
    (True, True)
    """
    table, facts = read_added(path, name=NAME)
    if table is None or facts is None:
        return None
    return identifiability_of(database, table, facts, path)


def identifiability_of(
    database: SignatureDatabase, table: pa.Table, facts: dict[str, Any], path: str | Path
) -> Identifiability:
    """Return what columns of `Identifiability.table` and `identifiability_facts` tell.

    `path`, which they were read from, is named in errors. Raises DatabaseError if they are damaged,
    or belong to other signatures or another version of the format.
    """
    try:
        noise = noise_from_dict(facts["noise"])
        fits = facts["format"] == FORMAT and (
            facts["belongs_to"] == index_fingerprint(database, noise)
        )
        told = _told(database, noise, table, facts) if fits else None
    except (KeyError, TypeError, ValueError, SemsigError) as error:
        msg = f"the identifiability in {path} is damaged ({error}); run semsig identify again."
        raise DatabaseError(msg) from error
    if told is None:
        msg = (
            f"the identifiability in {path} is that of other signatures, or of another version of "
            "semsig; run semsig identify again."
        )
        raise DatabaseError(msg)
    return told


def _told(
    database: SignatureDatabase, noise: Noise, table: pa.Table, facts: dict[str, Any]
) -> Identifiability:
    """Return what a table and the facts beside it tell."""
    classes = tuple(ClassGain(**item) for item in facts["classes"])
    names = {item.code: item.name for item in database.taxonomy.classes}
    ids = database.cell_ids
    places = [name for name in table.column_names if name.endswith("_chance")]

    def stacked(columns: list[str]) -> np.ndarray:
        return np.stack([table[name].to_numpy() for name in columns], axis=1)

    def rows(name: str) -> np.ndarray:
        cells = table[name]
        found = np.searchsorted(ids, cells.fill_null(ids[0]).to_numpy())
        return np.where(cells.is_valid().to_numpy(), found, -1)

    return Identifiability(
        database=database,
        noise=noise,
        radius=float(facts["radius"]),
        itself=table["chance_itself"].to_numpy(),
        near=table["chance_near"].to_numpy(),
        found=table["chance_found"].to_numpy(),
        bits=table["bits_left"].to_numpy(),
        lookalikes=np.stack([rows(name.removesuffix("_chance")) for name in places], axis=1),
        lookalike_chances=stacked(places),
        gains=stacked([f"gain_{names[item.code]}" for item in classes]),
        classes=classes,
        trials=int(facts["trials"]),
        seed=int(facts["seed"]),
    )
