"""Time of building, saving and opening a signature database, and of the core of that work."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow.parquet as pq
from scipy.spatial import cKDTree

from benchmarks._cities import MONTPELLIER, made_up, made_up_streets, real
from benchmarks.comparison import Comparison, compare
from semsig_gis.database import build_database, open_database, save_database
from semsig_gis.objects import save_objects
from semsig_gis.sources import PARIS_LIKE, CitySpec, synthetic_surroundings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects

__all__ = ["comparisons"]

# 200,000 objects to build from; about 312,134 signatures of mean length 14 to store.
_BUILT = {"full": CitySpec(size=8_200.0), "small": CitySpec(size=300.0)}
_STORED = {"full": PARIS_LIKE, "small": CitySpec(size=300.0)}
_HOUSES = {"full": 4_000.0, "small": 300.0}
# Half the time that the command would take with an R-tree of all sight lines and places.
_LEAST_BUILD_RATIO = 3.0
_MOST_MB, _MOST_MS = 15.0, 300.0
_REPEATS = {"full": 5, "small": 1}


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure building one city, and the file of another."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "city.parquet"
        yield _building(made_up(_BUILT[size]), path, repeats=_REPEATS[size])
        yield _command(size, Path(folder))
        city = _STORED[size]
        database = made_up_streets(city, made_up(city))
        save_database(database, path)
        yield from _storing(database, path, repeats=_REPEATS[size])


def _building(objects: StreetObjects, path: Path, *, repeats: int) -> Comparison:
    """Compare building and saving with only the search for pairs of viewpoints and objects."""
    viewpoints, points = build_database(objects).xy, objects.xy

    def ours(_: int) -> None:
        save_database(build_database(objects), path)

    def peer(_: int) -> None:
        near = cKDTree(viewpoints)
        near.sparse_distance_matrix(cKDTree(points), 30.0, output_type="ndarray")

    return compare(
        f"building and saving a database from {len(objects):,} objects",
        ours,
        peer,
        peer_name="scipy.spatial.cKDTree, only the pairs",
        repeats=repeats,
        bar=1 / 3,
    )


def _command(size: str, folder: Path) -> Comparison:
    """Compare `semsig build` with buildings, from its start, with a script of other libraries."""
    geodata = os.environ.get("SEMSIG_GEODATA")
    objects, houses = folder / "objects.parquet", folder / "houses.gpkg"
    if size == "full" and geodata:
        name = MONTPELLIER
        save_objects(real(Path(geodata), name), objects)
        houses = Path(geodata) / "montpellier/VilleMTP_MTP_Batiments.zip"
    else:
        name, city = "a made-up city", CitySpec(size=_HOUSES[size])
        save_objects(made_up(city), objects)
        synthetic_surroundings(city)[0].table[["geometry"]].to_file(houses)
    inputs = ("-m", "semsig_gis.cli", "build", objects, "--buildings", houses, "--out")
    return compare(
        f"cold: semsig build of {name} with buildings",
        lambda _: _process(*inputs, folder / "built.parquet"),
        lambda _: _process("-m", "benchmarks._plain_build", objects, houses, folder / "plain"),
        peer_name="a script with geopandas, scipy's cKDTree and shapely.STRtree",
        repeats=_REPEATS[size],
        bar=_LEAST_BUILD_RATIO,
    )


def _process(*arguments: str | Path) -> None:
    subprocess.run([sys.executable, *map(str, arguments)], check=True, capture_output=True)  # noqa: S603


def _storing(database: SignatureDatabase, path: Path, *, repeats: int) -> Iterator[Comparison]:
    """Compare a file with the same numbers in compressed arrays."""
    mean = database.offsets[-1] / len(database)
    what = f"{len(database):,} signatures of mean length {mean:.1f}"
    plain = path.with_suffix(".npz")
    np.savez_compressed(
        plain,
        cells=database.cell_ids,
        lengths=database.lengths.astype(np.int32),
        codes=database.codes,
        bearings=database.bearing_units,
        distances=database.distance_units,
    )
    yield Comparison(
        name=f"file of {what}",
        unit="MB",
        ours=path.stat().st_size / 1e6,
        peer=plain.stat().st_size / 1e6,
        peer_name="numpy.savez_compressed of the same arrays",
        bar=None,
    ).at_most(_MOST_MB)
    columns = ["cell_id", "types", "bearings", "distances"]
    yield compare(
        f"opening the file of {what}",
        lambda _: open_database(path),
        lambda _: pq.read_table(path, columns=columns),
        peer_name="pyarrow.parquet.read_table, the columns unchecked",
        repeats=repeats,
    ).at_most(_MOST_MS)
