"""`semsig map`, and the streets and buildings below every map."""

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
    tell_if_online,
)
from semsig_gis.cli.options import Smooth
from semsig_gis.core import DatabaseError, EmptyResultError, InputError

if TYPE_CHECKING:
    import folium

    from semsig_gis.database import City


AROUND_M = 100.0


def draw_ground(
    drawn: folium.Map, city: City, *, buildings: Path | None = None, streets: Path | None = None
) -> None:
    """Add streets and buildings to a map: those of files, else of the store of the database."""
    from semsig_gis.maps import ground_map
    from semsig_gis.objects import read_surroundings

    crs = city.database.crs
    houses = None if buildings is None else read_surroundings(buildings, role="buildings", crs=crs)
    lines = None if streets is None else read_surroundings(streets, role="streets", crs=crs)
    if houses is None or lines is None:
        with contextlib.suppress(DatabaseError):  # a map may do without
            houses = city.store.footprints if houses is None else houses
            lines = city.store.streets if lines is None else lines
    if houses is None and lines is None:
        return
    xy = city.database.xy
    low, high = xy.min(axis=0) - AROUND_M, xy.max(axis=0) + AROUND_M
    try:
        box = (*low.tolist(), *high.tolist())
        ground_map(buildings=houses, streets=lines, box=box, map_=drawn)
    except EmptyResultError:
        if buildings is not None or streets is not None:
            raise


def _dates(city: City, newer: City) -> dict[str, Any]:
    """Return the later database, and the street objects of both where there are."""
    objects = {"objects_before": city.objects, "objects_after": newer.objects}
    if None in objects.values():
        remark("street objects of both databases were not found; drawing cells only")
        objects = {}
    return {"newer": newer.database, **objects}


def _require_content(evaluation: Path | None, smooth: float | None, *, other: bool) -> None:
    if evaluation is None and not other:
        raise InputError(
            "there is nothing to show on the map; give --evaluation, --ambiguity, "
            "--identifiability, --drift, --location or --objects, or several of them."
        )
    if smooth is not None and evaluation is None:
        raise InputError(
            "--smooth works only with an evaluation; give --evaluation as well, or leave it out."
        )


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
        typer.Option(help="Footprints to draw below the map; default: those of the database."),
    ] = None,
    streets: Annotated[
        Path | None,
        typer.Option(help="Centre lines to draw below the map; default: those of the database."),
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
    from semsig_gis.maps import RASTERS, city_map, save_map
    from semsig_gis.objects import open_objects

    others = (drift, location, objects)
    cells = identifiability or ambiguity
    _require_content(evaluation, smooth, other=cells or others != (None, None, None))
    keep_inputs(out, read=(database, drift, location, objects, buildings, streets))
    require_suffix(".html", out)
    results = None if evaluation is None else open_evaluation(evaluation)
    city = open_city(database)
    opened = city.database
    known = known_identifiability(city) if identifiability or ambiguity else None
    if identifiability and known is None:
        raise InputError(
            f"{database} has no columns of semsig identify; run semsig identify first."
        )
    seen = None if objects is None else open_objects(objects)
    newer = None if drift is None else open_city(drift)
    dates = {} if newer is None else _dates(city, newer)
    answer: dict[str, Any] = {}
    if location is not None:
        raster = location.suffix.lower() in RASTERS
        answer = {"posterior": open_posterior(location, opened)} if raster else {"answer": location}
    if seen is not None:
        places = shapely.get_coordinates(seen.table.geometry.to_crs(opened.crs).array)
        require_same_place(opened, places, "street objects")
    with progress("drawing the map"):
        drawn = city_map(
            opened,
            evaluation=results,
            smooth=smooth,
            ambiguity=ambiguity,
            identifiability=known,
            objects=seen,
            tiles=tiles,
            **answer,
            **dates,
        )
        draw_ground(drawn, city, buildings=buildings, streets=streets)
        offline = save_map(drawn, out, title=title or city_name(database))
    say(f"map: {out}")
    tell_if_online(offline, tiles=tiles)
