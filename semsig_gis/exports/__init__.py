"""Hand results on to other programs: pick a format by the suffix of the file.

``.gpkg`` (`semsig_gis.exports.geopackage`) holds all layers, with styles for QGIS; ``.parquet``
(`semsig_gis.exports.geoparquet`) and ``.csv`` (`semsig_gis.exports.csv_text`) hold one; ``.tif``
(`semsig_gis.exports.geotiff`) holds one number a cell.
"""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError, UnknownNameError, nearest_name
from semsig_gis.exports import csv_text, geopackage, geoparquet
from semsig_gis.exports._layers import answer_layers, cells_layer, evaluation_layers, objects_layer
from semsig_gis.exports.geotiff import cell_errors, export_geotiff
from semsig_gis.location import REGION_SHARE, Location
from semsig_gis.regions import search_regions

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation_result import Evaluation
    from semsig_gis.exports._layers import CellGeometry
    from semsig_gis.identifiability import Identifiability
    from semsig_gis.localization import Localization
    from semsig_gis.objects import StreetObjects
    from semsig_gis.regions import SearchRegions

    Progress = Callable[[int, int], None]

__all__ = ["LAYERS", "RASTERS", "export_answer", "export_database"]

LAYERS = ("cells", "objects", "evaluation", "evaluation_lines")
"""What a GeoParquet or CSV file of a database may hold; the first by default."""

RASTERS = ("ambiguity", "identifiability", "error")
"""What a GeoTIFF of a database may hold; the first by default."""

_ONE_LAYER: Mapping[str, Callable[..., None]] = MappingProxyType(
    {".parquet": geoparquet.write_layer, ".csv": csv_text.write_layer}
)
_TIFF = (".tif", ".tiff")


def export_database(
    database: SignatureDatabase,
    path: str | Path,
    *,
    layer: str | None = None,
    objects: StreetObjects | None = None,
    identifiability: Identifiability | None = None,
    evaluation: Evaluation | None = None,
    geometry: CellGeometry | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a database, and what else there is of the city, in the format of the file's suffix.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    path : str or Path
        File to write: ``.gpkg``, ``.parquet``, ``.csv`` or ``.tif``; it appears whole, by rename.
    layer : str, optional
        What a file of one layer holds: one of `LAYERS`, or of `RASTERS`. A GeoPackage holds all.
    objects : StreetObjects, optional
        The objects that the cells see.
    identifiability : Identifiability, optional
        What is known of the cells before any query.
    evaluation : Evaluation, optional
        Queries and what was found for them.
    geometry : {"polygon", "point"}, optional
        Whether a cell is its square or its viewpoint; by default the square, in CSV the viewpoint.
    progress : callable, optional
        Called with the number of rows written and in all.

    Raises
    ------
    InputError
        If the suffix is another, the layer needs what was not given or does not hold what was,
        or the file cannot be written.
    UnknownNameError
        If there is no such layer or geometry.

    Examples
    --------
    >>> import tempfile
    >>> import geopandas as gpd
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_database(database, f"{folder}/cells.parquet")
    ...     len(gpd.read_parquet(f"{folder}/cells.parquet")) == len(database)
    True
    """
    suffix = _suffix(path, (".gpkg", *_ONE_LAYER, *_TIFF))
    if suffix == ".gpkg":
        if layer is not None:
            msg = f"{path} holds all layers, but only {layer!r} was asked for; name no layer."
            raise InputError(msg)
        geopackage.export_geopackage(
            database,
            path,
            objects=objects,
            identifiability=identifiability,
            evaluation=evaluation,
            geometry=geometry or "polygon",
            progress=progress,
        )
        return
    name = _checked_layer(path, layer, known=RASTERS if suffix in _TIFF else LAYERS)
    given = {"objects": objects, "identifiability": identifiability, "evaluation": evaluation}
    _require_needed(path, name, {what for what, value in given.items() if value is not None})
    if suffix in _TIFF:
        values, unit = database.type_group_sizes.astype(np.float64), "cells"
        if name == "error" and evaluation is not None:
            values, unit = cell_errors(evaluation, database), "m"
        elif name == "identifiability" and identifiability is not None:
            values, unit = identifiability.found, ""
        export_geotiff(database, values, path, name=name, unit=unit)
        return
    if name == "objects" and objects is not None:
        chosen = objects_layer(objects)
    elif evaluation is not None:
        chosen = evaluation_layers(evaluation, database.licenses)[name == "evaluation_lines"]
    else:
        drawn = geometry or ("point" if suffix == ".csv" else "polygon")
        chosen = cells_layer(database, identifiability=identifiability, geometry=drawn)
    _ONE_LAYER[suffix](chosen, path, progress=progress)


def _checked_layer(path: str | Path, layer: str | None, *, known: tuple[str, ...]) -> str:
    """Return what a file of one layer holds."""
    if layer is not None and layer not in known:
        hint = nearest_name(layer, known)
        msg = f"{path} cannot hold {layer!r}; give one of {', '.join(known)}{hint}."
        raise UnknownNameError(msg)
    return layer or known[0]


def _require_needed(path: str | Path, name: str, given: set[str]) -> None:
    """Refuse a file of one layer that lacks what the layer needs, or cannot hold what is given."""
    needs = {
        "objects": "objects",
        "evaluation": "evaluation",
        "evaluation_lines": "evaluation",
        "error": "evaluation",
        "identifiability": "identifiability",
    }
    needed = needs.get(name)
    if needed is not None and needed not in given:
        msg = f"{path} is to hold the {name}, but there is no {needed}; give that too."
        raise InputError(msg)
    # Identifiability is part of a database, wherever it is not asked for.
    unused = sorted(given - {needed, "identifiability"})
    if unused:
        msg = (
            f"{path} holds the {name} alone, and no {' or '.join(unused)}; leave that out, name "
            "another layer, or write a GeoPackage, which holds all."
        )
        raise InputError(msg)


def export_answer(
    answer: Location | Localization,
    database: SignatureDatabase,
    path: str | Path,
    *,
    share: float = REGION_SHARE,
    within: float = 0.0,
) -> SearchRegions:
    """Write the answer to a query in the format of the file's suffix.

    Parameters
    ----------
    answer : Location or Localization
        The answer.
    database : SignatureDatabase
        The database that was searched.
    path : str or Path
        File to write: ``.gpkg`` holds the regions to search and the candidates, ``.parquet`` and
        ``.csv`` the regions, ``.tif`` the chance of every cell, of the likelihood method only; it
        appears whole, by rename.
    share, within : float, optional
        Which cells the regions hold (see `semsig_gis.regions.search_regions`).

    Returns
    -------
    SearchRegions
        What must be searched.

    Raises
    ------
    InputError
        If the suffix is another, a number is out of range, the answer has no chances or is from
        another database, or the file cannot be written.
    """
    suffix = _suffix(path, (".gpkg", *_ONE_LAYER, *_TIFF))
    if suffix in _TIFF and not isinstance(answer, Location):
        msg = (
            f"{path} is to hold the chance of every cell, which the method does not tell; use the "
            "likelihood method, or write a GeoPackage."
        )
        raise InputError(msg)
    regions = search_regions(answer, database, share=share, within=within)
    if suffix in _TIFF and isinstance(answer, Location):
        export_geotiff(database, answer.posterior.chances, path, name="posterior")
    elif suffix == ".gpkg":
        geopackage.write_layers(answer_layers(answer, regions), path)
    else:
        _ONE_LAYER[suffix](answer_layers(answer, regions)[0], path)
    return regions


def _suffix(path: str | Path, known: tuple[str, ...]) -> str:
    """Return the suffix of a file, in lower case."""
    suffix = Path(path).suffix.lower()
    if suffix not in known:
        names = f"{', '.join(known[:-2])} or {known[-2]}"
        msg = f"{path} does not end in {names}; give a name that says the format."
        raise InputError(msg)
    return suffix
