"""The file of what is known of the cells before any query: beside its database, a row a cell."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from semsig_gis import __version__
from semsig_gis.errors import DatabaseError, SemsigError
from semsig_gis.identifiability import ClassGain, Identifiability
from semsig_gis.likelihood import index_fingerprint
from semsig_gis.noise import noise_from_dict
from semsig_gis.storage import geo_metadata, points_to_wkb, read_geoparquet, write_geoparquet

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase

__all__ = ["identifiability_path", "open_identifiability", "save_identifiability"]

KIND = "identifiability"
SUFFIX = ".identifiability.parquet"


def identifiability_path(database: str | Path) -> Path:
    """Return where the identifiability of a database is kept.

    Parameters
    ----------
    database : str or Path
        The database, a file or a folder.

    Returns
    -------
    Path
        A file beside it.

    Examples
    --------
    >>> identifiability_path("maps/city.parquet").as_posix()
    'maps/city.identifiability.parquet'
    """
    file = Path(database)
    return file.with_name(file.name.removesuffix(".parquet") + SUFFIX)


def save_identifiability(told: Identifiability, path: str | Path) -> None:
    """Save what is known of the cells as one GeoParquet file.

    Parameters
    ----------
    told : Identifiability
        What to save.
    path : str or Path
        File to write; it appears whole, by rename.

    Notes
    -----
    Columns: ``cell_id``, those of `Identifiability.table`, and ``geometry``, the viewpoint as WKB.
    """
    database = told.database
    table = told.table().add_column(0, "cell_id", [database.cell_ids])
    xy = database.xy
    bounds = [*xy.min(axis=0).tolist(), *xy.max(axis=0).tolist()]
    write_geoparquet(
        table.append_column("geometry", points_to_wkb(xy)),
        path,
        geo=geo_metadata(database.crs, geometry_types=["Point"], bounds=bounds),
        specs={
            "kind": KIND,
            "version": __version__,
            "belongs_to": index_fingerprint(database, told.noise),
            "noise": told.noise.to_dict(),
            "radius": told.radius,
            "trials": told.trials,
            "seed": told.seed,
            "places": told.lookalikes.shape[1],
            "classes": [
                {"code": item.code, "near": item.near, "bits": item.bits} for item in told.classes
            ],
            "licenses": list(database.licenses),
        },
    )


def open_identifiability(database: SignatureDatabase, path: str | Path) -> Identifiability:
    """Open a file that `save_identifiability` wrote.

    Parameters
    ----------
    database : SignatureDatabase
        The database that it belongs to.
    path : str or Path
        File to read.

    Returns
    -------
    Identifiability
        What is known of the cells.

    Raises
    ------
    DatabaseError
        If the file is missing or damaged, or belongs to another database.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.identifiability import identify
    >>> from semsig_gis.likelihood import build_index
    >>> from semsig_gis.noise import named_noise
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> told = identify(build_index(database, named_noise("light")), trials=20, class_trials=5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/city.identifiability.parquet"
    ...     save_identifiability(told, path)
    ...     bool((open_identifiability(database, path).found == told.found).all())
    True
    """
    table, specs, _ = read_geoparquet(path, kind=KIND)
    try:
        noise = noise_from_dict(specs["noise"])
        same = specs["belongs_to"] == index_fingerprint(database, noise) and np.array_equal(
            table["cell_id"].to_numpy(), database.cell_ids
        )
        classes = tuple(ClassGain(**item) for item in specs["classes"])
        names = {item.code: item.name for item in database.taxonomy.classes}
        columns = {
            name: table[name].to_numpy()
            for name in table.column_names
            if table[name].type == pa.float32()
        }
        ids = database.cell_ids
        places = [f"lookalike_{number + 1}" for number in range(specs["places"])]
        told = same and Identifiability(
            database=database,
            noise=noise,
            radius=float(specs["radius"]),
            itself=columns["chance_itself"],
            near=columns["chance_near"],
            found=columns["chance_found"],
            bits=columns["bits_left"],
            lookalikes=np.stack(
                [
                    np.searchsorted(ids, table[name].fill_null(ids[0] - 1).to_numpy(), side="right")
                    - 1
                    for name in places
                ],
                axis=1,
            ),
            lookalike_chances=np.stack([columns[f"{name}_chance"] for name in places], axis=1),
            gains=np.stack([columns[f"gain_{names[item.code]}"] for item in classes], axis=1),
            classes=classes,
            trials=int(specs["trials"]),
            seed=int(specs["seed"]),
        )
    except (KeyError, TypeError, ValueError, SemsigError) as error:
        msg = f"{path} is damaged ({error}); run semsig identify again."
        raise DatabaseError(msg) from error
    if not told:
        msg = f"{path} belongs to another database or an older one; run semsig identify again."
        raise DatabaseError(msg)
    return told
