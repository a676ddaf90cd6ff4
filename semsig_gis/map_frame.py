"""Maps within a notebook, without a network where the package carries the map files."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis import map_assets

if TYPE_CHECKING:
    import folium

__all__ = ["MapFrame", "show_map"]


@dataclass(frozen=True, slots=True)
class MapFrame:
    """A map as a notebook shows it.

    Parameters
    ----------
    page : str
        The HTML page of the map.
    height : int
        Of the frame in which it is shown, in pixels.
    """

    page: str
    height: int

    def _repr_html_(self) -> str:
        """Show the page in a frame of its own, where its scripts harm nothing else."""
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" title="map" allowfullscreen '
            f'style="width: 100%; height: {self.height}px; border: none"></iframe>'
        )


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
        where the package was built without the map files, it links them.

    Raises
    ------
    InputError
        If the map needs a file that the package never carries (see
        `semsig_gis.map_assets.inline_assets`).

    Examples
    --------
    >>> import folium
    >>> show_map(folium.Map(tiles=None), height=300).height
    300
    """
    page = map_.get_root().render()
    return MapFrame(map_assets.inline_assets(page) if map_assets.available() else page, height)
