"""Maps as whole pages, and within a notebook, without a network where that is to be had."""

from __future__ import annotations

import html
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis import map_assets
from semsig_gis.errors import InputError

if TYPE_CHECKING:
    import folium

__all__ = ["MapFrame", "page_of_map", "show_map"]

# folium forbids to enlarge a page with two fingers, which is how small text is read on a phone.
_RIGID = re.compile(r",\s*maximum-scale=1\.0,\s*user-scalable=no")


@dataclass(frozen=True, slots=True)
class MapFrame:
    """A map as a notebook shows it: its HTML page, in a frame ``height`` pixels high."""

    page: str
    height: int

    def _repr_html_(self) -> str:
        """Show the page in a frame of its own, where its scripts harm nothing else."""
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" title="map" allowfullscreen '
            f'style="width: 100%; height: {self.height}px; border: none"></iframe>'
        )


def page_of_map(map_: folium.Map, *, self_contained: bool | None = None) -> str:
    """Return a map as one HTML page.

    By default Leaflet and all else are put into the page where the package carries them and the map
    needs no others; ``self_contained=False`` links them, and True raises `InputError` where they
    cannot be put into it.
    """
    page = map_.get_root().render().replace("<html>", '<html lang="en">', 1)
    page = _RIGID.sub("", page, count=1)
    if self_contained or (self_contained is None and map_assets.available()):
        try:
            return map_assets.inline_assets(page)
        except InputError:
            if self_contained:
                raise
    return page


def show_map(map_: folium.Map, *, height: int = 520) -> MapFrame:
    """Show a map in a notebook, as the last thing of a cell.

    What folium shows by itself loads Leaflet from the web, and stays blank without it.

    Parameters
    ----------
    map_ : folium.Map
        The map.
    height : int, default 520
        How high it is shown, in pixels.

    Returns
    -------
    MapFrame
        What a notebook shows. Its page makes no request, but for the tiles of a map that has some;
        where the package was built without the map files, or the map needs others, it links them.

    Examples
    --------
    >>> import folium
    >>> show_map(folium.Map(tiles=None), height=300).height
    300
    """
    return MapFrame(page_of_map(map_), height)
