"""A map of the street objects, a layer a class."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis._map_board import mercator
from semsig_gis._map_packing import packed, steps
from semsig_gis._map_parts import (
    Drawing,
    Legend,
    Script,
    add_city,
    finished_map,
    free_name,
    layer_text,
    layers_of,
    prepared_map,
    to_latlon,
)
from semsig_gis._map_signs import OUTLINES, sign_svg
from semsig_gis.boxes import hilbert_order
from semsig_gis.class_signs import class_signs
from semsig_gis.errors import EmptyResultError
from semsig_gis.map_legend import objects_legend
from semsig_gis.schema import COUNT, MERGED, SOURCE, SOURCE_ID

if TYPE_CHECKING:
    import folium
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects

__all__ = ["objects_map"]

FIELDS = ("Class", "Source", "Identifier", "Stands for", "Also", "Place")


def objects_map(
    objects: StreetObjects,
    *,
    database: SignatureDatabase | None = None,
    map_: folium.Map | None = None,
    tiles: str | None = None,
) -> folium.Map:
    """Show where the street objects are, and what is known of each.

    Parameters
    ----------
    objects : StreetObjects
        What to show.
    database : SignatureDatabase, optional
        The cells from which they are seen: a layer that is hidden at first, and to be found by
        number.
    map_ : folium.Map, optional
        Map to add the layers to, where they are hidden at first; a new one by default.
    tiles : str, optional
        Online background of a new map, by a name that folium knows; none by default.

    Returns
    -------
    folium.Map
        The map, with a layer for each class, named with its sign and number; a click on an object
        tells its class, source, identifier and place. All are drawn on one canvas, so that
        hundreds of thousands stay smooth.

    Raises
    ------
    EmptyResultError
        If there is no object.
    InputError
        If `tiles` is not known to folium, or both `tiles` and `map_` are given.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> objects_map(objects).options["maxZoom"]
    20
    """
    if len(objects) == 0:
        msg = "there is no street object to show; look at what was loaded."
        raise EmptyResultError(msg)
    chosen = prepared_map(map_, tiles, title="Street objects")
    if database is not None:
        add_city(chosen, database, show=False)
    key = f"objects{len(layers_of(chosen))}"
    Script("streetObjects", key, *_drawn(objects)).add_to(chosen)
    signs, counts = class_signs(objects.taxonomy), objects.class_counts
    for number, (code, count) in enumerate(counts.items()):
        title = layer_text(signs[code].title)
        name = free_name(chosen, f"{sign_svg(signs[code])} {title} ({count:,})")
        Drawing(name, "classLayer", key, number, show=map_ is None).add_to(chosen)
    corners = np.stack([objects.xy.min(axis=0), objects.xy.max(axis=0)])
    view = to_latlon(corners, objects.crs) if map_ is None else None
    Legend(objects_legend(objects), view).add_to(chosen)
    source = objects if database is None else database
    return finished_map(chosen, source, licenses=objects.licenses)


def _drawn(objects: StreetObjects) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """Return the objects for the script: class by class, neighbours together; and what they are."""
    near = hilbert_order(objects.table.geometry.array)
    order = near[np.argsort(objects.codes[near], kind="stable")]
    table = objects.table.iloc[order]
    places, about = mercator(objects.xy[order], objects.crs)
    source, sources = pd.factorize(table[SOURCE], sort=True)
    arrays: dict[str, NDArray[Any] | list[str]] = {
        "ids": table[SOURCE_ID].astype(str).tolist(),
        "source": source.astype(np.uint16),
        "count": table[COUNT].to_numpy(np.int32),
        "merged": table[MERGED].astype(str).tolist() if MERGED in table else [],
    }
    signs, counts = class_signs(objects.taxonomy), objects.class_counts
    ends = np.cumsum(list(counts.values())).tolist()
    classes = [
        {
            "title": signs[code].title,
            "symbol": signs[code].symbol,
            "colour": signs[code].colour,
            "ink": signs[code].ink,
            "outline": OUTLINES[signs[code].shape],
            "drop": signs[code].drop,
            "start": end - count,
            "end": end,
        }
        for (code, count), end in zip(counts.items(), ends, strict=True)
    ]
    about |= {
        "classes": classes,
        "sources": sources.tolist(),
        "fields": FIELDS,
        # The rare ones last, so that they lie on top.
        "order": np.argsort([-count for count in counts.values()], kind="stable").tolist(),
    }
    told = {name: packed(values) for name, values in arrays.items()}
    told |= {name: steps(part) for name, part in zip("xy", places.T, strict=True)}
    return told, about
