"""`semsig map`, and the streets and buildings in the background of every map."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli.console import (
    Database,
    app,
    city_name,
    keep_inputs,
    known_identifiability,
    progress,
    remark,
    require_suffix,
    say,
    warn_if_online,
)
from semsig_gis.cli.options import Smooth
from semsig_gis.core import DatabaseError, EmptyResultError, InputError

if TYPE_CHECKING:
    import folium

    from semsig_gis.database import City


MARGIN_M = 100.0  # around the cells


def draw_ground(
    map_: folium.Map, city: City, *, buildings: Path | None = None, streets: Path | None = None
) -> None:
    """Add streets and buildings to a map, from files or else from the object store."""
    from semsig_gis.objects import read_surroundings
    from semsig_gis.output import ground_map

    crs = city.database.crs
    houses = None if buildings is None else read_surroundings(buildings, role="buildings", crs=crs)
    lines = None if streets is None else read_surroundings(streets, role="streets", crs=crs)
    if houses is None or lines is None:
        with contextlib.suppress(DatabaseError):  # a map does not need them
            houses = city.store.footprints if houses is None else houses
            lines = city.store.streets if lines is None else lines
    if houses is None and lines is None:
        return
    xy = city.database.xy
    low, high = xy.min(axis=0) - MARGIN_M, xy.max(axis=0) + MARGIN_M
    try:
        box = (*low.tolist(), *high.tolist())
        ground_map(buildings=houses, streets=lines, box=box, map_=map_)
    except EmptyResultError:
        if buildings is not None or streets is not None:
            raise


def _dates(city: City, newer: City) -> dict[str, Any]:
    """Return the newer database and the street objects of both, for `city_map`."""
    objects = {"objects_before": city.objects, "objects_after": newer.objects}
    if None in objects.values():
        remark("street objects of both databases were not found; drawing cells only")
        objects = {}
    return {"newer": newer.database, **objects}


@app.command(name="map")
def map_(
    database: Database,
    *,
    evaluation: Annotated[
        Path | None, typer.Option(help="Folder written by `semsig evaluate --out`.")
    ] = None,
    smooth: Smooth = None,
    identifiability: Annotated[
        bool,
        typer.Option(
            "--identifiability", help="Draw how well cells can be found (after `semsig identify`)."
        ),
    ] = False,
    ambiguity: Annotated[
        bool, typer.Option("--ambiguity", help="Draw how many cells look the same.")
    ] = False,
    drift: Annotated[
        Path | None, typer.Option(help="Draw the changes up to this newer database.")
    ] = None,
    location: Annotated[
        Path | None,
        typer.Option(help="Draw an answer: the .tif file that `semsig localize --out` wrote."),
    ] = None,
    objects: Annotated[
        Path | None, typer.Option(help="Draw street objects written by `semsig load`.")
    ] = None,
    buildings: Annotated[
        Path | None,
        typer.Option(help="Footprints to draw below the map; default: from the database."),
    ] = None,
    streets: Annotated[
        Path | None,
        typer.Option(help="Centre lines to draw below the map; default: from the database."),
    ] = None,
    tiles: Annotated[
        str | None,
        typer.Option(
            help="Draw online tiles below the map, of a provider of xyzservices that needs no key, "
            "such as OpenStreetMap.Mapnik."
        ),
    ] = None,
    title: Annotated[
        str | None,
        typer.Option(
            help="Write a title on the map, such as the city and the date of its data; default: "
            "the name of the database's file."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Map to write (.html).")],
) -> None:
    """Draw cells, evaluations, changes, answers or objects on a map."""
    import shapely

    from semsig_gis.database import open_city, require_same_place
    from semsig_gis.evaluation import open_evaluation
    from semsig_gis.localization import open_posterior
    from semsig_gis.objects import open_objects
    from semsig_gis.output import RASTER_SUFFIXES, city_map, save_map

    paths = (evaluation, drift, location, objects)
    if not (identifiability or ambiguity or any(path is not None for path in paths)):
        raise InputError(
            "there is nothing to show on the map; give --evaluation, --ambiguity, "
            "--identifiability, --drift, --location or --objects, or several of them."
        )
    if smooth is not None and evaluation is None:
        raise InputError(
            "--smooth works only with an evaluation; give --evaluation as well, or leave it out."
        )
    keep_inputs(out, read=(database, drift, location, objects, buildings, streets))
    require_suffix(".html", out)
    results = None if evaluation is None else open_evaluation(evaluation)
    city = open_city(database)
    opened = city.database
    columns = known_identifiability(city) if identifiability or ambiguity else None
    if identifiability and columns is None:
        raise InputError(
            f"{database} has no columns of semsig identify; run semsig identify first."
        )
    street_objects = None if objects is None else open_objects(objects)
    newer = None if drift is None else open_city(drift)
    dates = {} if newer is None else _dates(city, newer)
    answer: dict[str, Any] = {}
    if location is not None:
        raster = location.suffix.lower() in RASTER_SUFFIXES
        answer = {"posterior": open_posterior(location, opened)} if raster else {"answer": location}
    if street_objects is not None:
        places = shapely.get_coordinates(street_objects.table.geometry.to_crs(opened.crs).array)
        require_same_place(opened, places, "street objects")
    with progress("drawing the map"):
        page = city_map(
            opened,
            evaluation=results,
            smooth=smooth,
            ambiguity=ambiguity,
            identifiability=columns,
            objects=street_objects,
            tiles=tiles,
            **answer,
            **dates,
        )
        draw_ground(page, city, buildings=buildings, streets=streets)
        offline = save_map(page, out, title=title or city_name(database))
    say(f"map: {out}")
    warn_if_online(offline, tiles=tiles)
