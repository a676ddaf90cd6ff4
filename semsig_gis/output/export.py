"""Write databases, evaluations and answers to files; the suffix gives the format.

``.gpkg`` (`output.qgis`) holds many layers, with styles for QGIS; ``.parquet``, ``.fgb``,
``.geojson`` and ``.csv`` (`output.files.tables`) hold one layer; ``.pmtiles``
(`output.files.tiles`) holds the cells by zoom, and ``.tif`` (`output.qgis.rasters`) one number per
cell. For an answer, ``.geojson`` and ``.kml`` (`output.files.answers`) hold all its layers.
``.json`` (`output.files.stac`) describes a database.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import EmptyResultError, InputError, UnknownNameError, extra, nearest_name
from semsig_gis.database import open_city, require_same_place
from semsig_gis.evaluation import error_field
from semsig_gis.localization import REGION_SHARE, search_regions
from semsig_gis.objects import open_objects
from semsig_gis.output.files.answers import write_answer_geojson, write_answer_kml
from semsig_gis.output.files.tables import (
    write_csv,
    write_flatgeobuf,
    write_geojson,
    write_geoparquet,
)
from semsig_gis.output.files.tiles import write_pmtiles
from semsig_gis.output.layers.answer import answer_layers
from semsig_gis.output.layers.cells import cells_layer
from semsig_gis.output.layers.evaluation import evaluation_layers, split_figures
from semsig_gis.output.layers.hexagons import hexagons_layer
from semsig_gis.output.layers.objects import objects_layer
from semsig_gis.output.qgis import geopackage
from semsig_gis.output.qgis.rasters import cell_errors, export_field, export_geotiff

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import CellGeometry, SignatureDatabase
    from semsig_gis.evaluation import Evaluation, Identifiability
    from semsig_gis.localization import Answer, SearchRegions
    from semsig_gis.objects import StreetObjects
    from semsig_gis.output.layers.model import Layer

LAYERS = ("cells", "objects", "evaluation", "evaluation_lines", "hexagons")
"""Layers that `export_database` writes."""

RASTERS = ("ambiguity", "identifiability", "error", "field")
"""Rasters that `export_database` writes."""

ITEM = ".json"
"""Suffix of a STAC item, which describes the files of a database."""

_MANY_LAYERS = {".gpkg": geopackage.write_layers}
_ONE_LAYER: Mapping[str, Callable[..., None]] = {
    ".parquet": write_geoparquet,
    ".fgb": write_flatgeobuf,
    ".geojson": write_geojson,
    ".csv": write_csv,
}
RASTER_FACTS = ("query", "north", "prior", "elsewhere", "fit", "notes")
_RASTER = frozenset({".tif", ".tiff"})
_TILES = ".pmtiles"
# Accepted layers or rasters by suffix; the first is the default.
_CONTENT: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys((*_MANY_LAYERS, *_ONE_LAYER), LAYERS),
    _TILES: ("cells",),
    **dict.fromkeys(sorted(_RASTER), RASTERS),
}
# Formats that hold all layers of an answer in one file.
_ANSWER: Mapping[str, Callable[..., None]] = {
    **_MANY_LAYERS,
    ".geojson": write_answer_geojson,
    ".kml": write_answer_kml,
}
# The option that a layer or a raster needs in addition to the cells.
_NEEDS = {
    "objects": "objects",
    **dict.fromkeys(("evaluation", "evaluation_lines", "error", "field"), "evaluation"),
    "identifiability": "identifiability",
    "hexagons": "resolution",
}
# Options that a layer or a raster uses where they are given.
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
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a database and other layers of its city, in the format of the file's suffix.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    path : str or Path
        File to write: ``.gpkg``, ``.parquet``, ``.fgb``, ``.geojson``, ``.csv``, ``.pmtiles`` or
        ``.tif``; a failure leaves an older file unchanged.
    layers : str or sequence of str, optional
        Content of the file: some of `LAYERS` in a GeoPackage (default: all that the other arguments
        allow), ``cells`` in PMTiles, one of `RASTERS` in a GeoTIFF, one of `LAYERS` in other
        formats (default: the hexagons if `h3` is given, else the cells).
    objects : StreetObjects, optional
        The objects that the cells see.
    identifiability : Identifiability, optional
        Chances of the cells to be found, for additional columns or the raster.
    evaluation : Evaluation, optional
        Queries and their results.
    geometry : {"polygon", "point"}, optional
        Whether a cell is its square or its viewpoint; by default the square, in CSV the viewpoint.
    smooth : float, optional
        Radius of the raster ``field`` in metres (see `evaluation.error_field`).
    h3 : int, optional
        Resolution of the layer ``hexagons``, from 0 to 15 (the finest; 9 is a block of houses).
    progress : callable, optional
        Called with the numbers of rows written and in total.

    Raises
    ------
    EmptyResultError
        If there is no cell or no object.
    InputError
        If the suffix is not supported, several layers are given for a format of one layer, a layer
        needs an argument that is missing, no layer uses an argument, the identifiability or the
        evaluation is of another database, the objects are in another CRS, or the file is open in
        another program or cannot be written.
    UnknownNameError
        If a layer or the geometry is unknown.

    Notes
    -----
    Layer ``cells``, in the CRS of the database: ``cell_id``, ``x`` and ``y`` (viewpoint, metres),
    ``length`` (objects seen), ``types`` (symbols), ``bearings`` (degrees to 0.01), ``levels``
    (angle levels) and ``distances`` (metres to 0.01), each of these four clockwise from north and
    the numbers separated by spaces; ``type_group_size`` and ``angle_group_size`` (number of cells
    with the same types or angle levels, including this cell); and, where given, the columns of
    `Identifiability.table`. `read_geopackage` reads the database back.

    Layer ``objects``, in the CRS of the objects: ``class_code``, ``symbol``, ``class_name``,
    ``title``, ``source``, ``source_id``, ``merged`` where sources were merged, and ``count``.

    Layers ``evaluation`` (queries at their true places) and ``evaluation_lines`` (from the true to
    a different best place): the columns of `Evaluation.queries` and ``outcome``: ``successful``
    (the best place is within 50 m with a probability of 0.5 or more) or ``failed``. A GeoPackage
    has the columns ``p0``, ``p5``, ..., ``near1``, ... in the separate table
    ``evaluation_figures``, by ``seed`` and ``number``.

    Layer ``hexagons``, the H3 cells that contain a cell, an object or a query: ``h3`` (index),
    ``cells`` (their number), ``mean_length`` (objects seen from the mean cell), ``ambiguous``
    (share of the cells with the types of another cell), ``type_group_size`` (median), and,
    where given, ``chance_found`` (mean), ``objects`` and ``queries`` (their numbers) and ``found``
    (share of the queries that are ``successful``).

    PMTiles hold the layer ``cells`` from the zoom at which a cell is four pixels wide, and at lower
    zooms the layer ``squares`` with the columns of ``hexagons`` except the index, the objects
    and the queries. GeoJSON has longitude and latitude (WGS 84). The specs and the licences are in
    the metadata of every format except CSV.

    Raster ``field``, from the queries around every place, in three bands: ``failed`` (the share
    that failed), ``error`` (their mean error in metres) and ``queries`` (their weighted number). A
    style file ``.qml`` in the same folder makes QGIS draw a raster as on the maps.

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
        options={name for name, value in options.items() if value is not None},
    )
    _require_same_city(path, database, objects, evaluation)
    if names == ["field"] and evaluation is not None:
        export_field(error_field(evaluation, database, radius=smooth), database, path)
        return
    if suffix in _RASTER:
        values, unit = _raster_values(names[0], database, identifiability, evaluation)
        export_geotiff(database, values, path, name=names[0], unit=unit)
        return
    if suffix == _TILES:
        write_pmtiles(database, path, identifiability=identifiability, progress=progress)
        return
    by_name: dict[str, Layer] = {}
    if "cells" in names:
        shape = geometry or ("point" if suffix == ".csv" else "polygon")
        by_name["cells"] = cells_layer(database, identifiability=identifiability, geometry=shape)
    if objects is not None:
        by_name["objects"] = objects_layer(objects)
    if evaluation is not None:
        by_name |= {layer.name: layer for layer in evaluation_layers(evaluation, database)}
    if h3 is not None:
        by_name["hexagons"] = hexagons_layer(
            database, h3, objects=objects, identifiability=identifiability, evaluation=evaluation
        )
    content = [by_name[name] for name in names]
    if suffix == ".gpkg" and "evaluation" in names:
        content[names.index("evaluation")], figures = split_figures(by_name["evaluation"])
        content.append(figures)
    if suffix in _MANY_LAYERS:
        _MANY_LAYERS[suffix](content, path, progress=progress)
    else:
        _ONE_LAYER[suffix](content[0], path, progress=progress)


def _raster_values(
    name: str,
    database: SignatureDatabase,
    identifiability: Identifiability | None,
    evaluation: Evaluation | None,
) -> tuple[NDArray[np.float64], str]:
    """Return the values of the cells in a raster, and their unit."""
    if name == "error" and evaluation is not None:
        return cell_errors(evaluation, database), "m"
    if name == "identifiability" and identifiability is not None:
        return identifiability.found, ""
    return database.type_group_sizes.astype(np.float64), "cells"


def _require_same_city(
    path: str | Path,
    database: SignatureDatabase,
    objects: StreetObjects | None,
    evaluation: Evaluation | None,
) -> None:
    """Raise if cells or objects are empty, or objects or the evaluation are of another city."""
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


def _content(
    path: str | Path, names: Sequence[str], *, suffix: str, options: set[str]
) -> list[str]:
    """Return the names of the layers or the raster to write.

    Raise if a name is not accepted or lacks an option, or if nothing uses one of `options`.
    """
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
    possible = [name for name in accepted if _NEEDS.get(name) in {None, *options}]
    # A resolution of hexagons makes them the default of a format of one layer.
    default = [name for name in accepted if _NEEDS.get(name) == "resolution" and name in possible]
    content = list(dict.fromkeys(names)) or (possible if many else [*default, accepted[0]][:1])
    for name in content:
        if name not in possible:
            raise InputError(
                f"layer {name!r} was chosen for {path} with no {_NEEDS[name]}; give that as well."
            )
    # Identifiability is a property of the database, so it never counts as unused.
    used = {"identifiability", *(_NEEDS[name] for name in content if name in _NEEDS)}
    used.update(*(_USES.get(name, ()) for name in content))
    used -= {"geometry"} if suffix == _TILES else set()
    unused = sorted(options - used)
    if unused:
        raise InputError(
            f"{path} contains only the {' and '.join(content)}, not the {' or '.join(unused)}; "
            f"leave that out or choose another layer{'' if many else ', or write a GeoPackage'}."
        )
    return content


def export_item(
    database: str | Path, path: str | Path, *, objects: str | Path | None = None
) -> None:
    """Write the description of a database as an item of a SpatioTemporal Asset Catalog (STAC 1.1).

    Parameters
    ----------
    database : str or Path
        File of the database, or folder of its parts.
    path : str or Path
        File to write, ``.json``; a failure leaves an older file unchanged. Paths in it are relative
        to its folder.
    objects : str or Path, optional
        File of the objects that the cells see.

    Raises
    ------
    DatabaseError
        If the database or the file of objects is missing, damaged, or holds something else.
    EmptyResultError
        If there is no cell or no object.
    InputError
        If the suffix is not ``.json``, pystac is not installed, the objects are of another city, or
        the file cannot be written.

    Notes
    -----
    The item has the extent, the CRS and the grid (extension ``projection``), the licences, and the
    files as assets, with their sizes and checksums (extension ``file``). Its date is the time at
    which the database was written. The names of the specs begin with ``semsig:``.

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
        from semsig_gis.output.files.stac import write_item  # noqa: PLC0415 - pystac is an extra
    city = open_city(database)
    if objects is not None:
        _require_same_city(path, city.database, open_objects(objects), None)
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
        File to write: ``.gpkg``, and in degrees (WGS 84) ``.geojson`` and ``.kml``, hold the
        regions to search, the candidates and, with the likelihood method, the place; ``.parquet``,
        ``.fgb`` and ``.csv`` hold the regions; ``.tif`` holds the chance of every cell, with the
        likelihood method only.
    share, within : float, optional
        Extent of the regions (see `localization.search_regions`).

    Returns
    -------
    SearchRegions
        The regions to search.

    Raises
    ------
    InputError
        If the suffix is not supported, a number is out of range, the answer has no chances or is
        from another database, or the file cannot be written.

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
    regions = search_regions(answer, database, share=share, within=within)
    if suffix in _RASTER and answer.chances is not None:
        values: Mapping[str, Any] = answer.to_dict()
        facts = {name: values[name] for name in RASTER_FACTS}
        export_geotiff(database, answer.chances, path, name="posterior", facts=facts)
    elif suffix in _ANSWER:
        _ANSWER[suffix](answer_layers(answer, database, regions), path)
    else:
        _ONE_LAYER[suffix](answer_layers(answer, database, regions)[0], path)
    return regions


def _suffix(path: str | Path, accepted: Collection[str]) -> str:
    """Return the suffix of a file in lower case; raise if it is not accepted."""
    suffix = Path(path).suffix.lower()
    if suffix not in accepted:
        # The message lists one suffix for each format.
        *names, last = [name for name in accepted if name != ".tiff"]
        listed = f"{', '.join(names)} or {last}" if names else last
        raise InputError(
            f"{path} does not end in {listed}; give a name with one of these suffixes."
        )
    return suffix
