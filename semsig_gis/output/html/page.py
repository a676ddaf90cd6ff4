"""Pages of maps, with Leaflet and other browser files included so that no request is needed.

The build of the package copies these files into the folder ``assets`` (``hatch_build.py``, which
needs ``npm`` and adds their licences and a bill of materials to the metadata). If they are missing,
`available` is false and a map links to the web instead.
"""

from __future__ import annotations

import base64
import functools
import hashlib
import html
import json
import re
import tomllib
from dataclasses import dataclass, field
from importlib import resources
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, cast
from urllib.parse import urlsplit

import folium
from folium.raster_layers import WmsTileLayer

from semsig_gis.core import InputError, UnknownNameError, nearest_name
from semsig_gis.output.html.page_elements import layers_of
from semsig_gis.storage import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping
    from importlib.resources.abc import Traversable
    from pathlib import Path

    from branca.element import Figure

# Files that every folium page links but that our maps do not use: only `folium.Icon`, Font Awesome
# and Bootstrap widgets need them.
UNUSED = {
    *("bootstrap.bundle.min.js", "bootstrap.min.css", "bootstrap-glyphicons.css", "all.min.css"),
    *("leaflet.awesome-markers.js", "leaflet.awesome-markers.css"),
    "leaflet.awesome.rotate.min.css",
}
_REFERENCE = re.compile(
    r"""<script\b[^>]*\bsrc\s*=\s*["'](?P<script>[^"']*)["'][^>]*>\s*</script\s*>"""
    r"""|<link\b[^>]*\bhref\s*=\s*["'](?P<link>[^"']*)["'][^>]*>""",
    re.IGNORECASE,
)
_CSS_IMAGE = re.compile(r"url\(images/(?P<name>[\w-]+\.png)\)")
_SOURCE_MAP = re.compile(r"\n?//# sourceMappingURL=\S*\s*$")
# folium disables zooming of a page with two fingers, which is needed to read small text on a phone.
_NO_PAGE_ZOOM = re.compile(r",\s*maximum-scale=1\.0,\s*user-scalable=no")


@dataclass(frozen=True, slots=True)
class Asset:
    """A third-party file of the package, and the names of the linked files that it replaces."""

    name: str
    package: str
    version: str
    sha256: str
    replaces: tuple[str, ...]


@functools.cache
def assets() -> Mapping[str, Asset]:
    """Return the files of the manifest by name, in its order, including missing ones."""
    manifest = tomllib.loads(_folder().joinpath("manifest.toml").read_text(encoding="utf-8"))
    return {
        file["target"]: Asset(
            name=file["target"],
            package=package["name"],
            version=package["version"],
            sha256=file["sha256"],
            replaces=tuple(file.get("stands_for", ())),
        )
        for package in manifest["package"]
        for file in package["file"]
    }


def available() -> bool:
    """Whether all files exist unchanged, so that a map can be self-contained."""
    return all(_content(asset) is not None for asset in assets().values())


def asset_text(name: str) -> str:
    """Return a script or style sheet, escaped for its element of a page.

    Images of a style sheet become data URIs. InputError if the package does not contain the file.
    """
    files = {asset.name: asset for asset in assets().values() if asset.replaces}
    if name not in files:
        raise UnknownNameError(f"{name!r} is not a map file{nearest_name(name, files)}.")
    text = _required(files[name]).decode("utf-8")
    if name.endswith(".css"):
        text = _CSS_IMAGE.sub(lambda match: f"url({_data_uri(match['name'])})", text)
        return re.sub(r"</(style)", r"<\\/\1", text, flags=re.IGNORECASE)
    text = _SOURCE_MAP.sub("", text)
    if name == "leaflet.js":
        # Leaflet would look for the images of its default marker in the folder of its script.
        images = {
            "iconUrl": _data_uri("marker-icon.png"),
            "iconRetinaUrl": _data_uri("marker-icon-2x.png"),
            "shadowUrl": _data_uri("marker-shadow.png"),
        }
        icon = f"L.Icon.Default.imagePath='';L.Icon.Default.mergeOptions({json.dumps(images)});"
        text += f"\n{icon}"
    # Inside <script>, "</script" closes it and "<!--" changes how the rest is read.
    return re.sub(r"</(script)", r"<\\/\1", text, flags=re.IGNORECASE).replace("<!--", r"<\!--")


def external_files(page: str) -> tuple[str, ...]:
    """Return the addresses of scripts and style sheets that the head of a page loads, in order."""
    head, _, _ = page.partition("</head>")
    return tuple(match["script"] or match["link"] for match in _REFERENCE.finditer(head))


def inline_assets(page: str) -> str:
    """Return a page of folium with its linked scripts and style sheets included.

    InputError if the package was built without the files, or the page needs others (for a plugin,
    `folium.Icon`, a colour map drawn by branca).
    """
    replacements = {
        file: asset.name for asset in assets().values() for file in asset.replaces
    } | dict.fromkeys(UNUSED)
    if "L.AwesomeMarkers." in page:
        raise InputError(
            "A self-contained map cannot show folium.Icon markers; use CircleMarker or DivIcon."
        )

    def replace(match: re.Match[str]) -> str:
        address = match["script"] or match["link"]
        file = PurePosixPath(urlsplit(address).path).name
        if file not in replacements:
            raise InputError(
                f"A self-contained map cannot use {address}; the files it may use are "
                f"{', '.join(sorted(replacements.keys() - UNUSED))}."
            )
        name = replacements[file]
        if name is None:
            return ""
        element = "script" if match["script"] else "style"
        return f"<{element}>\n{asset_text(name)}\n</{element}>"

    # folium links files only in the head; the rest may contain text that looks like a link.
    head, end, rest = page.partition("</head>")
    return _REFERENCE.sub(replace, head) + end + rest


def _folder() -> Traversable:
    return resources.files("semsig_gis") / "assets"


def _content(asset: Asset) -> bytes | None:
    """Return the content of a file, or None if it is missing or its checksum is wrong."""
    path = _folder() / asset.name
    content = path.read_bytes() if path.is_file() else b""
    return content if hashlib.sha256(content).hexdigest() == asset.sha256 else None


def _required(asset: Asset) -> bytes:
    content = _content(asset)
    if content is None:
        raise InputError(
            f"This installation does not contain {asset.name} of {asset.package} {asset.version}; "
            "make a map that links it, or install semsig_gis again where npm is available."
        )
    return content


def _data_uri(name: str) -> str:
    return f"data:image/png;base64,{base64.b64encode(_required(assets()[name])).decode('ascii')}"


@dataclass(frozen=True, slots=True)
class MapFrame:
    """A map in a frame of ``height`` pixels, for notebooks and the documentation."""

    map: folium.Map = field(repr=False)
    height: int

    @property
    def page(self) -> str:
        """The page of the map as `save_map` writes it by default."""
        return page_of_map(self.map)

    def save(self, path: str | Path, *, title: str | None = None) -> None:
        """Write the map as one HTML page (see `save_map`)."""
        save_map(self.map, path, title=title)

    def _repr_html_(self) -> str:
        """Return the page in a frame, which isolates its scripts from the notebook."""
        return (
            f'<iframe srcdoc="{html.escape(self.page)}" title="map" allowfullscreen '
            f'style="width: 100%; height: {self.height}px; border: none"></iframe>'
        )


def page_of_map(
    map_: folium.Map, *, title: str | None = None, self_contained: bool | None = None
) -> str:
    """Return a map as one HTML page (see `save_map`)."""
    if title is not None:
        cast("Figure", map_.get_root()).title = html.escape(title)
    page = map_.get_root().render().replace("<html>", '<html lang="en">', 1)
    page = _NO_PAGE_ZOOM.sub("", page, count=1)
    if self_contained or (self_contained is None and available()):
        # By default a page that needs other files keeps its links.
        try:
            return inline_assets(page)
        except InputError:
            if self_contained:
                raise
    return page


def show_map(map_: folium.Map, *, height: int = 520) -> MapFrame:
    """Show a map in a notebook, as the last expression of a cell.

    The display of folium itself loads Leaflet from the web, and stays blank without it.

    Parameters
    ----------
    map_ : folium.Map
        The map.
    height : int, default 520
        Height of the frame in pixels.

    Returns
    -------
    MapFrame
        A page as `save_map` writes it by default, in a frame.

    Examples
    --------
    >>> import folium
    >>> show_map(folium.Map(tiles=None), height=300).height
    300
    """
    return MapFrame(map_, height)


def save_map(
    map_: folium.Map,
    path: str | Path,
    *,
    title: str | None = None,
    self_contained: bool | None = None,
) -> bool:
    """Write a map as one HTML page.

    Parameters
    ----------
    map_ : folium.Map
        The map.
    path : str or Path
        File to write; it appears whole, by rename.
    title : str, optional
        Title on the map, such as the city and the date of its data; by default, the kind of map.
    self_contained : bool, optional
        True to include Leaflet and all other files in the page, False to link them; by default
        they are included if the package contains all files that the map needs.

    Returns
    -------
    bool
        Whether the page opens without any request, even for tiles.

    Raises
    ------
    InputError
        If the file cannot be written, or a self-contained page was requested and is not possible.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_map(folium.Map(tiles=None), f"{folder}/map.html", self_contained=False)
    False
    """
    page = page_of_map(map_, title=title, self_contained=self_contained)
    write_whole(path, page)
    tiled = any(
        isinstance(child, folium.TileLayer | WmsTileLayer) for child in layers_of(map_).values()
    )
    return not external_files(page) and not tiled
