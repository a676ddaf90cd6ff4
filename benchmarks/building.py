"""Building and saving a signature database, beside the bare search for the pairs behind it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from scipy.spatial import cKDTree

from benchmarks.comparison import compare
from semsig_gis.building import build_database
from semsig_gis.catalog import paper_taxonomy
from semsig_gis.database_file import save_database
from semsig_gis.objects import build_objects
from semsig_gis.sources.synthetic import CitySpec, synthetic_city

if TYPE_CHECKING:
    from collections.abc import Iterator

    from benchmarks.comparison import Comparison

__all__ = ["comparisons"]

_SIDES = {"full": 11_200.0, "small": 300.0}  # metres of the procedural city: 200,000 objects


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure one city.

    Parameters
    ----------
    size : str
        ``"full"`` or ``"small"``.

    Yields
    ------
    Comparison
        The result.
    """
    layers = synthetic_city(CitySpec(size=_SIDES[size]))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    viewpoints, points = build_database(objects).xy, objects.xy

    with tempfile.TemporaryDirectory() as folder:

        def ours(_: int) -> None:
            save_database(build_database(objects), Path(folder) / "city.parquet")

        def peer(_: int) -> None:
            near = cKDTree(viewpoints)
            near.sparse_distance_matrix(cKDTree(points), 30.0, output_type="ndarray")

        yield compare(
            f"building and saving a database from {len(objects):,} objects",
            ours,
            peer,
            peer_name="scipy.spatial.cKDTree, the pairs alone",
            repeats=1,
            bar=1 / 3,
        )
