"""Write databases, evaluations and answers to files; the suffix gives the format.

`output.files` has the formats, `output.layers` and `output.rasters` what they hold. ``.json``
(`output.stac`) describes a database.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import EmptyResultError, InputError, UnknownNameError, extra, nearest_name
from semsig_gis.database import open_city, require_same_place
from semsig_gis.localization import REGION_SHARE, search_regions
from semsig_gis.objects import open_objects
from semsig_gis.output.files import FORMATS, ONLY_ANSWERS
from semsig_gis.output.layers import LAYERS, needed_results, used_results
from semsig_gis.output.layers.answer import answer_layers
from semsig_gis.output.layers.model import cell_raster
from semsig_gis.output.layers.styles import CHANCES
from semsig_gis.output.rasters import RASTERS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import geopandas as gpd

    from semsig_gis.core import Registry
    from semsig_gis.database import CellGeometry, SignatureDatabase
    from semsig_gis.evaluation import Evaluation, Identifiability
    from semsig_gis.localization import Answer, SearchRegions
    from semsig_gis.objects import StreetObjects
    from semsig_gis.output.files import Writer

ITEM = ".json"
"""Suffix of a STAC item, which describes the files of a database."""

RASTER_FACTS = ("query", "north", "prior", "elsewhere", "fit", "notes")
# Other suffixes of a format.
ALIASES = {".tiff": ".tif"}
# Layers and raster of a file by default, if it holds only one; hexagons if a resolution is given.
CELLS, HEXAGONS, AMBIGUITY = "cells", "hexagons", "ambiguity"


def export_database(
    database: SignatureDatabase,
    path: str | Path,
    *,
    layers: str | Sequence[str] = (),
    objects: StreetObjects | None = None,
    buildings: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
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
    buildings, streets : GeoDataFrame, optional
        The ground below the cells, with a ``name`` where it is known (see `ObjectStore`).
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
    ``title``, ``source``, ``source_id``, ``merged`` where sources were merged, and ``count``; where
    they are known, ``family`` (of the class), ``name``, ``brand``, ``operator``, ``ref``,
    ``house_number``, ``street``, ``height`` (metres) and ``group`` (the points of one line or area
    have the same).

    Layers ``buildings`` and ``streets``, in the CRS of the database: what is within 250 m of the
    box of the cells, with its ``name`` where it is known.

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
    suffix = _suffix(path, [f".{name}" for name in FORMATS if name not in ONLY_ANSWERS])
    options = {
        "objects": objects,
        "buildings": buildings,
        "streets": streets,
        "identifiability": identifiability,
        "evaluation": evaluation,
        "geometry": geometry,
        "smoothing": smooth,
        "resolution": h3,
    }
    results: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    write = FORMATS[suffix[1:]]
    kinds: Registry[Callable[..., Any]] = RASTERS if write.holds == "raster" else LAYERS
    names = _content(
        path, [layers] if isinstance(layers, str) else layers, write=write, results=results
    )
    _require_same_city(path, database, objects, evaluation)
    if write.cells is not None:
        results.setdefault("geometry", write.cells)
    results["database"] = database
    content = []
    for name in names:
        used = used_results(kinds[name])
        content.append(kinds[name](**{key: results[key] for key in used & results.keys()}))
    if write.holds == "raster":
        write(content[0], path)
    elif write.holds == "layer":
        write(content[0], path, progress=progress)
    else:
        content.sort(key=lambda layer: layer.display.level < 0)  # the ground is written last
        parts = [part for layer in content for part in layer.parts or (layer,)]
        write(parts, path, progress=progress)


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
    path: str | Path, names: Sequence[str], *, write: Writer, results: Mapping[str, object]
) -> list[str]:
    """Return the names of the layers or the raster to write.

    Raise if a name is not accepted or lacks a result, or if nothing uses a result that is given.
    """
    kinds: Registry[Callable[..., Any]] = RASTERS if write.holds == "raster" else LAYERS
    accepted = write.layers or tuple(kinds)
    for name in names:
        if name not in accepted:
            hint = nearest_name(name, accepted)
            raise UnknownNameError(
                f"{path} cannot contain {name!r}; give one of {', '.join(accepted)}{hint}."
            )
    many = write.holds == "layers"
    if len(names) > 1 and not many:
        raise InputError(
            f"{path} can contain only one layer, but {' and '.join(names)} were given; give one of "
            "them, or write a GeoPackage."
        )
    missing = {name: needed_results(kinds[name]) - results.keys() for name in accepted}
    default = AMBIGUITY if write.holds == "raster" else CELLS
    if "resolution" in results and HEXAGONS in accepted:
        default = HEXAGONS
    possible = [name for name in accepted if not missing[name]]
    content = list(dict.fromkeys(names)) or (possible if many else [default])
    for name in content:
        if missing[name]:
            needed = " and ".join(sorted(missing[name]))
            raise InputError(
                f"layer {name!r} was chosen for {path} with no {needed}; give that as well."
            )
    # Identifiability is a property of the database, so it never counts as unused.
    used = {"identifiability"}.union(*(used_results(kinds[name]) for name in content))
    used -= {"geometry"} if write.cells is None else set()
    unused = sorted(results.keys() - used)
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
    _suffix(path, [ITEM])
    with extra("stac", "a STAC item"):
        from semsig_gis.output.stac import write_item  # noqa: PLC0415 - pystac is an extra
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
    buildings: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
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
    buildings, streets : GeoDataFrame, optional
        The ground around the likely candidates, for a GeoPackage (see `ObjectStore`).

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
    suffix = _suffix(path, [f".{name}" for name in FORMATS if not FORMATS[name].layers])
    write = FORMATS[suffix[1:]]
    if write.holds == "raster" and answer.chances is None:
        raise InputError(
            f"{path} would contain the chance of every cell, which this method does not compute; "
            "use the likelihood method, or write a GeoPackage."
        )
    regions = search_regions(answer, database, share=share, within=within)
    if write.holds == "raster" and answer.chances is not None:
        values: Mapping[str, Any] = answer.to_dict()
        facts = {name: values[name] for name in RASTER_FACTS}
        chances = cell_raster(database, "posterior", answer.chances, scale=CHANCES, facts=facts)
        write(chances, path)
        return regions
    ground = {"buildings": buildings, "streets": streets} if write.holds == "layers" else {}
    layers = answer_layers(answer, database, regions, **ground)
    if write.write_answer is not None:
        write.write_answer(layers, path)
    else:
        write(layers[0] if write.holds == "layer" else layers, path)
    return regions


def _suffix(path: str | Path, accepted: Sequence[str]) -> str:
    """Return the suffix of a file in lower case; raise if it is not accepted."""
    suffix = Path(path).suffix.lower()
    suffix = ALIASES.get(suffix, suffix)
    if suffix not in accepted:
        *names, last = accepted
        listed = f"{', '.join(names)} or {last}" if names else last
        raise InputError(
            f"{path} does not end in {listed}; give a name with one of these suffixes."
        )
    return suffix
