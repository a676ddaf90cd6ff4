"""Addresses of the types of other packages in their documentation, for links from the API pages.

Sphinx would download the inventories of those sites; the site is built without a network.
"""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

from numpydoc.xref import DEFAULT_LINKS

if TYPE_CHECKING:
    from pathlib import Path

SITES = {
    "python": ("https://docs.python.org/3/", {"pathlib.Path": "library/pathlib.html#$"}),
    "numpy": (
        "https://numpy.org/doc/stable/",
        {"numpy.ndarray": "reference/generated/numpy.ndarray.html#$"},
    ),
    "pandas": (
        "https://pandas.pydata.org/docs/",
        {
            "pandas.DataFrame": "reference/api/pandas.DataFrame.html#$",
            "pandas.Series": "reference/api/pandas.Series.html#$",
        },
    ),
    "geopandas": (
        "https://geopandas.org/en/stable/",
        {
            "geopandas.GeoDataFrame": "docs/reference/api/geopandas.GeoDataFrame.html#$",
            "geopandas.GeoSeries": "docs/reference/api/geopandas.GeoSeries.html#$",
        },
    ),
    "shapely": (
        "https://shapely.readthedocs.io/en/stable/",
        {
            "shapely.Polygon": "reference/shapely.Polygon.html#$",
            "shapely.MultiPolygon": "reference/shapely.MultiPolygon.html#$",
        },
    ),
    "pyproj": (
        "https://pyproj4.github.io/pyproj/stable/",
        {"pyproj.crs.CRS": "api/crs/crs.html#$"},
    ),
    "pyarrow": (
        "https://arrow.apache.org/docs/",
        {"pyarrow.Table": "python/generated/pyarrow.Table.html#$"},
    ),
    "folium": (
        "https://python-visualization.github.io/folium/latest/",
        {"folium.folium.Map": "reference.html#$"},
    ),
    "matplotlib": (
        "https://matplotlib.org/stable/",
        {
            "matplotlib.axes.Axes": "api/_as_gen/matplotlib.axes.Axes.html#$",
            "matplotlib.figure.Figure": "api/figure_api.html#$",
        },
    ),
}
"""For each package the root of its site, and pages by full name; `$` stands for the name."""


def write_inventories(folder: Path) -> tuple[dict[str, tuple[str, str]], dict[str, str]]:
    """Write an inventory for each package; return the mapping of Sphinx, and full names by name."""
    folder.mkdir(parents=True, exist_ok=True)
    mapping, full_names = {}, {name: name for name in DEFAULT_LINKS}  # str, int: no links
    for package, (site, names) in SITES.items():
        head = f"# Sphinx inventory version 2\n# Project: {package}\n# Version: \n"
        rows = "".join(f"{name} py:class 1 {page} -\n" for name, page in names.items())
        path = folder / f"{package}.inv"
        path.write_bytes(
            f"{head}# The remainder of this file is compressed using zlib.\n".encode()
            + zlib.compress(rows.encode())
        )
        mapping[package] = (site, str(path))
        full_names |= {name.rpartition(".")[2]: name for name in names}
        full_names |= {name.replace(".folium", "").replace(".crs", ""): name for name in names}
    return mapping, full_names
