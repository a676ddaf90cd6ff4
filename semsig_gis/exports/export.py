"""Files for other programs, by their suffix.

``.gpkg`` (`exports.geopackage`) holds many layers, with styles for QGIS; ``.parquet``, ``.fgb``,
``.geojson`` and ``.csv`` (`exports.files`) hold one; ``.pmtiles`` (`exports.tiles`) holds the cells
by zoom, and ``.tif`` (`exports.rasters`) one number a cell. An answer goes into the same files, and
whole into ``.geojson`` and ``.kml`` (`exports.answers`). ``.json`` (`exports.stac`) tells of the
files of a database.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import EmptyResultError, InputError, UnknownNameError, extra, nearest_name
from semsig_gis.database import open_city, require_same_place
from semsig_gis.evaluation import error_field
from semsig_gis.exports import geopackage
from semsig_gis.exports.answers import write_answer_geojson, write_answer_kml
from semsig_gis.exports.files import write_csv, write_flatgeobuf, write_geojson, write_geoparquet
from semsig_gis.exports.layers import (
    answer_layers,
    cells_layer,
    evaluation_layers,
    figures_apart,
    objects_layer,
)
from semsig_gis.exports.rasters import cell_errors, export_field, export_geotiff
from semsig_gis.localization import REGION_SHARE
from semsig_gis.objects import open_objects

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import CellGeometry, SignatureDatabase
    from semsig_gis.evaluation import Evaluation, Identifiability
    from semsig_gis.exports.layers import Layer
    from semsig_gis.localization import Answer, SearchRegions
    from semsig_gis.objects import StreetObjects

    Progress = Callable[[int, int], None]

LAYERS = ("cells", "objects", "evaluation", "evaluation_lines", "hexagons")
"""What may be written of a database as layers."""

RASTERS = ("ambiguity", "identifiability", "error", "field")
"""What may be written of a database as a raster."""

ITEM = ".json"
"""Suffix of an item of STAC, which tells of the files of a database."""

_MANY_LAYERS = {".gpkg": geopackage.write_layers}
_ONE_LAYER: Mapping[str, Callable[..., None]] = {
    ".parquet": write_geoparquet,
    ".fgb": write_flatgeobuf,
    ".geojson": write_geojson,
    ".csv": write_csv,
}
_RASTER = frozenset({".tif", ".tiff"})
_TILES = ".pmtiles"
# What a file may hold of a database, the first by default.
_CONTENT: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys((*_MANY_LAYERS, *_ONE_LAYER), LAYERS),
    _TILES: ("cells",),
    **dict.fromkeys(sorted(_RASTER), RASTERS),
}
# All layers of an answer, in one file.
_ANSWER: Mapping[str, Callable[..., None]] = {
    **_MANY_LAYERS,
    ".geojson": write_answer_geojson,
    ".kml": write_answer_kml,
}
# What a layer or a raster is made from, beside the cells.
_NEEDS = {
    "objects": "objects",
    **dict.fromkeys(("evaluation", "evaluation_lines", "error", "field"), "evaluation"),
    "identifiability": "identifiability",
    "hexagons": "resolution",
}
# What is told in a layer where it is given.
_USES = {"cells": {"geometry"}, "field": {"smoothing"}, "hexagons": {"objects", "evaluation"}}


def export_database(
    database: SignatureDatabase,
    path: str | Path,
    *,
    layers: str | Sequence[str] = (),
    objects: StreetObjects | None = None,
    identifiability: Identifiability | None = None,
    evaluation: Evaluation | None = None,
    geometry: CellGeometry | None = None,
    smooth: float | None = None,
    h3: int | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a database, and what else there is of the city, in the format of the file's suffix.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    path : str or Path
        File to write: ``.gpkg``, ``.parquet``, ``.fgb``, ``.geojson``, ``.csv``, ``.pmtiles`` or
        ``.tif``; it appears whole, by rename.
    layers : str or sequence of str, optional
        What the file holds: some of `LAYERS` in a GeoPackage, by default all that is given; the
        cells in PMTiles; one of `RASTERS` in a GeoTIFF; one of `LAYERS` in the others, by default
        the hexagons if `h3` is given, else the first.
    objects : StreetObjects, optional
        The objects that the cells see.
    identifiability : Identifiability, optional
        What is known of the cells before any query.
    evaluation : Evaluation, optional
        Queries and what was found for them.
    geometry : {"polygon", "point"}, optional
        Whether a cell is its square or its viewpoint; by default the square, in CSV the viewpoint.
    smooth : float, optional
        How far away a query counts in the raster ``field``, in metres (see
        `evaluation.field.error_field`).
    h3 : int, optional
        Resolution of the layer ``hexagons``, from 0 to 15 (the finest; 9 is a block of houses).
    progress : callable, optional
        Called with the number of rows written and in all.

    Raises
    ------
    EmptyResultError
        If there is no cell or no object.
    InputError
        If the suffix is another, the file holds fewer layers than are named, a layer needs what
        was not given, what was given is in no layer, the identifiability is that of other cells,
        the evaluation is that of another database, the objects are in another CRS, or the file
        is open in another program or cannot be written.
    UnknownNameError
        If there is no such layer or geometry.

    Notes
    -----
    Layer ``cells``, in the CRS of the database: ``cell_id``, ``x`` and ``y`` (viewpoint, metres),
    ``length`` (objects seen), ``types`` (symbols), ``bearings`` (degrees to 0.01), ``levels``
    (angle levels) and ``distances`` (metres to 0.01), each of these four clockwise from north and
    the numbers separated by spaces; ``type_group_size`` and ``angle_group_size`` (cells with the
    same types or angle levels, 1 where the cell is alone); and, where given, the columns of
    `evaluation.identify.result.Identifiability.table`. `read_geopackage` gives the database back.

    Layer ``objects``, in the CRS of the objects: ``class_code``, ``symbol``, ``class_name``,
    ``title``, ``source``, ``source_id``, ``merged`` where sources were merged, and ``count``.

    Layers ``evaluation``, the queries at their true places, and ``evaluation_lines``, from there
    to the best place where that is another one: the columns of `Evaluation.queries` and
    ``outcome``: ``successful`` (the best place is within 50 m with a probability of 0.5 or more)
    or ``failed``. In a GeoPackage, the columns ``p0``, ``p5``, ..., ``near1``, ... stand in a table
    of their own, ``evaluation_figures``, by ``seed`` and ``number``.

    Layer ``hexagons``, those of H3 that hold a cell, an object or a query: ``h3`` (index),
    ``cells`` (their number), ``mean_length`` (objects seen from the mean cell), ``ambiguous``
    (share of the cells that look like another one, by types), ``type_group_size`` (median), and,
    where given, ``chance_found`` (mean), ``objects`` and ``queries`` (their numbers) and ``found``
    (share of the queries that are ``successful``).

    PMTiles hold the layer ``cells`` from the zoom at which a cell is four pixels wide, and farther
    out the layer ``squares`` with the same columns as ``hexagons``, but for the index, the objects
    and the queries. GeoJSON has longitude and latitude (WGS 84). The specs and the licences are in
    the metadata of every format but CSV.

    Raster ``field``: what became of the queries around every place, in three bands: ``failed`` (the
    share that failed), ``error`` (their mean error in metres) and ``queries`` (how many speak). A
    file beside a raster that ends in ``.qml`` has QGIS draw it as on the maps.

    Examples
    --------
    >>> import tempfile
    >>> import geopandas as gpd
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_database(demo_database, f"{folder}/cells.parquet")
    ...     export_database(demo_database, f"{folder}/city.gpkg", objects=demo_objects)
    ...     len(gpd.read_parquet(f"{folder}/cells.parquet")) == len(demo_database)
    ...     gpd.list_layers(f"{folder}/city.gpkg")["name"].tolist()
    True
    ['cells', 'objects', 'layer_styles']
    """
    suffix = _suffix(path, _CONTENT)
    options = {
        "objects": objects,
        "identifiability": identifiability,
        "evaluation": evaluation,
        "geometry": geometry,
        "smoothing": smooth,
        "resolution": h3,
    }
    names = _content(
        path,
        [layers] if isinstance(layers, str) else layers,
        suffix=suffix,
        given={name for name, value in options.items() if value is not None},
    )
    _require_one_city(path, database, objects, evaluation)
    if names == ["field"] and evaluation is not None:
        export_field(error_field(evaluation, database, radius=smooth), database, path)
        return
    if suffix in _RASTER:
        values, unit = _numbers(names[0], database, identifiability, evaluation)
        export_geotiff(database, values, path, name=names[0], unit=unit)
        return
    if suffix == _TILES:
        from semsig_gis.exports.tiles import write_pmtiles  # noqa: PLC0415 - where it is used

        write_pmtiles(database, path, identifiability=identifiability, progress=progress)
        return
    by_name: dict[str, Layer] = {}
    if "cells" in names:
        shape = geometry or ("point" if suffix == ".csv" else "polygon")
        by_name["cells"] = cells_layer(database, identifiability=identifiability, geometry=shape)
    if objects is not None:
        by_name["objects"] = objects_layer(objects)
    if evaluation is not None:
        by_name |= {one.name: one for one in evaluation_layers(evaluation, database)}
    if h3 is not None:
        from semsig_gis.exports.hexagons import hexagons_layer  # noqa: PLC0415 - where it is used

        by_name["hexagons"] = hexagons_layer(
            database, h3, objects=objects, identifiability=identifiability, evaluation=evaluation
        )
    written = [by_name[name] for name in names]
    if suffix == ".gpkg" and "evaluation" in names:
        written[names.index("evaluation")], figures = figures_apart(by_name["evaluation"])
        written.append(figures)
    if suffix in _MANY_LAYERS:
        _MANY_LAYERS[suffix](written, path, progress=progress)
    else:
        _ONE_LAYER[suffix](written[0], path, progress=progress)


def _numbers(
    name: str,
    database: SignatureDatabase,
    identifiability: Identifiability | None,
    evaluation: Evaluation | None,
) -> tuple[NDArray[np.float64], str]:
    """Return the numbers of the cells in a raster, and their unit."""
    if name == "error" and evaluation is not None:
        return cell_errors(evaluation, database), "m"
    if name == "identifiability" and identifiability is not None:
        return identifiability.found, ""
    return database.type_group_sizes.astype(np.float64), "cells"


def _require_one_city(
    path: str | Path,
    database: SignatureDatabase,
    objects: StreetObjects | None,
    evaluation: Evaluation | None,
) -> None:
    """Refuse what is empty, and what is of another city."""
    if len(database) == 0 or (objects is not None and len(objects) == 0):
        what = "object" if len(database) else "cell"
        raise EmptyResultError(f"there is no {what} to write to {path}; give at least one.")
    if objects is not None and objects.crs != database.crs:
        raise InputError(
            f"the street objects are in {objects.crs.name} and the cells in {database.crs.name}; "
            "give the objects that the database was built from."
        )
    if objects is not None:
        require_same_place(database, objects.xy, "street objects")
    if evaluation is not None:
        evaluation.rows_in(database)


def _content(path: str | Path, names: Sequence[str], *, suffix: str, given: set[str]) -> list[str]:
    """Return what a file holds, and refuse what lacks its data, or data that it would not hold."""
    accepted = _CONTENT[suffix]
    for name in names:
        if name not in accepted:
            hint = nearest_name(name, accepted)
            raise UnknownNameError(
                f"{path} cannot contain {name!r}; give one of {', '.join(accepted)}{hint}."
            )
    many = suffix in _MANY_LAYERS
    if len(names) > 1 and not many:
        raise InputError(
            f"{path} can contain only one layer, but {' and '.join(names)} were given; give one of "
            "them, or write a GeoPackage."
        )
    possible = [name for name in accepted if _NEEDS.get(name) in {None, *given}]
    # Who gives the resolution of hexagons wants them.
    default = [name for name in accepted if _NEEDS.get(name) == "resolution" and name in possible]
    content = list(dict.fromkeys(names)) or (possible if many else [*default, accepted[0]][:1])
    for name in content:
        if name not in possible:
            raise InputError(
                f"layer {name!r} was chosen for {path} with no {_NEEDS[name]}; give that as well."
            )
    # Identifiability is part of a database, wherever it is not asked for.
    used = {"identifiability", *(_NEEDS[name] for name in content if name in _NEEDS)}
    used.update(*(_USES.get(name, ()) for name in content))
    used -= {"geometry"} if suffix == _TILES else set()
    unused = sorted(given - used)
    if unused:
        raise InputError(
            f"{path} contains only the {' and '.join(content)}, not the {' or '.join(unused)}; "
            f"leave that out or choose another layer{'' if many else ', or write a GeoPackage'}."
        )
    return content


def export_item(
    database: str | Path, path: str | Path, *, objects: str | Path | None = None
) -> None:
    """Write what a database is as an item of a SpatioTemporal Asset Catalog (STAC 1.1).

    Parameters
    ----------
    database : str or Path
        File of the database, or folder of its parts.
    path : str or Path
        File to write, ``.json``; it appears whole, by rename. It names the files of the database
        by where they are from there.
    objects : str or Path, optional
        File of the objects that the cells see.

    Raises
    ------
    DatabaseError
        If the database or the file of objects is missing, damaged, or holds something else.
    EmptyResultError
        If there is no cell or no object.
    InputError
        If the suffix is another, pystac is not installed, the objects are those of another city,
        or the file cannot be written.

    Notes
    -----
    The item has the extent, the CRS and the grid (extension ``projection``), the licences, and the
    files as assets, with their sizes and checksums (extension ``file``). Its date is when the
    database was written. The names of the specs begin with ``semsig:``.

    Examples
    --------
    >>> import json
    >>> import tempfile
    >>> from pathlib import Path
    >>> from semsig_gis import save_database
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(demo_database, f"{folder}/city.parquet")
    ...     export_item(f"{folder}/city.parquet", f"{folder}/city.json")
    ...     item = json.loads(Path(folder, "city.json").read_text())
    >>> item["assets"]["database"]["href"], item["properties"]["proj:code"]
    ('city.parquet', 'EPSG:32631')
    """
    _suffix(path, {ITEM})
    with extra("stac", "a STAC item"):
        from semsig_gis.exports.stac import write_item  # noqa: PLC0415 - an extra
    city = open_city(database)
    if objects is not None:
        _require_one_city(path, city.database, open_objects(objects), None)
    write_item(city, path, objects=objects)


def export_answer(
    answer: Answer,
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
        File to write: ``.gpkg`` holds the regions to search, the candidates and, of the likelihood
        method, the place, as do ``.geojson`` and ``.kml`` in degrees (WGS 84); ``.parquet``,
        ``.fgb`` and ``.csv`` hold the regions, ``.tif`` the chance of every cell, of the likelihood
        method only.
    share, within : float, optional
        Which cells the regions hold (see `exports.regions.search_regions`).

    Returns
    -------
    SearchRegions
        What must be searched.

    Raises
    ------
    InputError
        If the suffix is another, a number is out of range, the answer has no chances or is from
        another database, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import localize
    >>> answer = localize(demo_database, demo_database.signature(0), method="edit+edit", top=5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_answer(answer, demo_database, f"{folder}/regions.gpkg").to_dict()["cells"]
    5
    """
    suffix = _suffix(path, [*dict.fromkeys((*_ANSWER, *_ONE_LAYER)), *sorted(_RASTER)])
    if suffix in _RASTER and answer.chances is None:
        raise InputError(
            f"{path} would contain the chance of every cell, which this method does not compute; "
            "use the likelihood method, or write a GeoPackage."
        )
    from semsig_gis.localization import search_regions  # noqa: PLC0415 - only where it is used

    regions = search_regions(answer, database, share=share, within=within)
    if suffix in _RASTER and answer.chances is not None:
        facts = answer.to_dict()
        facts = {name: facts[name] for name in ("query", "north", "prior", "notes")}
        export_geotiff(database, answer.chances, path, name="posterior", facts=facts)
    elif suffix in _ANSWER:
        _ANSWER[suffix](answer_layers(answer, database, regions), path)
    else:
        _ONE_LAYER[suffix](answer_layers(answer, database, regions)[0], path)
    return regions


def _suffix(path: str | Path, accepted: Collection[str]) -> str:
    """Return the suffix of a file, in lower case, if it is one of some."""
    suffix = Path(path).suffix.lower()
    if suffix not in accepted:
        # One of each format.
        *names, last = [name for name in accepted if name != ".tiff"]
        listed = f"{', '.join(names)} or {last}" if names else last
        raise InputError(
            f"{path} does not end in {listed}; give a name with one of these suffixes."
        )
    return suffix
