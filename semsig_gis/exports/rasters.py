"""One number a cell: Cloud-Optimised GeoTIFFs, and how QGIS draws them (QML)."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np

from semsig_gis.core import CELL_CHANCES, ERROR_BREAKS, FAILURES, InputError, percent
from semsig_gis.exports.styles import AMBIGUITY, IDENTIFIABILITY
from semsig_gis.storage import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import ErrorField, Evaluation
    from semsig_gis.exports.styles import Classes


FAILED: Classes = {
    (low, high): (f"failed: {percent(low, 0)} to {percent(high, 0)}", colour)
    for (low, high), colour in zip(pairwise([*FAILURES, 1.0]), FAILURES.values(), strict=True)
}
"""What is said of a place, and its colour, by the share of the queries around it that failed."""

# The farther off, the darker, as the shares that failed.
_METRES = [*(f"{low} to {high} m" for low, high in pairwise((0, *ERROR_BREAKS))), "farther"]
ERRORS: Classes = {
    bounds: (label, colour)
    for bounds, label, colour in zip(
        pairwise((0, *ERROR_BREAKS, np.inf)), _METRES, FAILURES.values(), strict=True
    )
}
"""What is said of a cell, and its colour, by the mean error of the queries from it."""

CLEAR = "#ffffff00"
CHANCES: Classes = {
    (0.0, min(CELL_CHANCES)): (f"less than {percent(min(CELL_CHANCES), 3)}", CLEAR),
    **{
        (low, high): (f"{100 * low:g} % or more", colour)
        for (low, high), colour in zip(
            pairwise([*CELL_CHANCES, 1.0]), CELL_CHANCES.values(), strict=True
        )
    },
}
"""What is said of a cell, and its colour, by the chance that the place is in it."""

STYLES: Mapping[str, Classes] = {
    "ambiguity": AMBIGUITY,
    "identifiability": IDENTIFIABILITY,
    "error": ERRORS,
    "field": FAILED,
    "posterior": CHANCES,
}
"""How QGIS draws the first band of each raster."""


def export_geotiff(
    database: SignatureDatabase,
    values: ArrayLike,
    path: str | Path,
    *,
    name: str,
    unit: str = "",
    facts: Mapping[str, Any] | None = None,
) -> None:
    """Write one number a cell as a Cloud-Optimised GeoTIFF.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    values : array_like of float, shape (n,)
        Numbers such as ``database.type_group_sizes`` or ``identifiability.found``; NaN where there
        is none.
    path : str or Path
        File to write; it appears whole, by rename.
    name : str
        What the numbers are.
    unit : str, optional
        Their unit.
    facts : mapping of str, optional
        Plain values on the numbers, which go to the tags of the file as JSON.

    Raises
    ------
    InputError
        If there is not one number a cell, the cells span too wide an area, or the file cannot be
        written.

    Notes
    -----
    A pixel is a cell of the grid of the database, in its CRS, as float32; NaN is no data. The
    overviews hold means, so that it is read fast from afar. A file beside it that ends in ``.qml``
    has QGIS draw what is in `STYLES` in the colours of the maps.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/objects.tif"
    ...     export_geotiff(demo_database, demo_database.lengths, path, name="objects seen")
    """
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != (len(database),):
        raise InputError(
            f"{numbers.size} numbers were given for {len(database)} cells; give one for each."
        )
    from semsig_gis.storage import write_cells  # noqa: PLC0415 - an extra

    write_cells(
        path,
        {name: (numbers, unit)},
        grid=database.grid,
        columns=database.columns,
        rows=database.rows,
        crs=database.crs,
        notes=_notes(database, facts or {}),
    )
    if name in STYLES:
        _write_style(path, name)


def _notes(database: SignatureDatabase, facts: Mapping[str, Any]) -> dict[str, str]:
    return {
        "licenses": "\n".join(database.licenses),
        "semsig_version": database.version,
        **{key: json.dumps(value) for key, value in facts.items()},
    }


def export_field(field: ErrorField, database: SignatureDatabase, path: str | Path) -> None:
    """Write an error field as a GeoTIFF of three bands; NaN where no query is near.

    ``failed`` is the share of the queries around a pixel that failed, ``error`` their mean error in
    metres, and ``queries`` how many speak; the radius is in the tags. A file beside it, ``.qml``,
    has QGIS draw it as on the map.
    """
    columns, rows = np.nonzero(np.isfinite(field.failed.T))
    unit = {"failed": "", "error": "m", "queries": "queries"}
    bands = zip(unit, (field.failed, field.errors, field.speaking), strict=True)
    from semsig_gis.storage import write_cells  # noqa: PLC0415 - an extra

    write_cells(
        path,
        {name: (values[rows, columns], unit[name]) for name, values in bands},
        grid=field.grid,
        columns=columns.astype(np.int32),
        rows=rows.astype(np.int32),
        crs=database.crs,
        notes=_notes(database, {"radius_m": field.radius}),
    )
    _write_style(path, "field")


def _write_style(path: str | Path, name: str) -> None:
    """Write the file by which QGIS draws a raster, beside it."""
    write_whole(Path(path).with_suffix(".qml"), by_pixel(STYLES[name]))


def by_pixel(classes: Classes) -> str:
    """Return a document by which QGIS colours the first band of a raster; borders are below."""
    root = ET.Element("qgis", version="3.22.0", styleCategories="Symbology")
    band = {"type": "singlebandpseudocolor", "band": "1", "opacity": "1", "alphaBand": "-1"}
    bounds = [*classes]
    ends = {"classificationMin": f"{bounds[0][0]:g}", "classificationMax": f"{bounds[-1][0]:g}"}
    renderer = ET.SubElement(ET.SubElement(root, "pipe"), "rasterrenderer", {**band, **ends})
    steps = {"colorRampType": "DISCRETE", "classificationMode": "1", "clip": "0"}
    shader = ET.SubElement(ET.SubElement(renderer, "rastershader"), "colorrampshader", steps)
    for (low, high), (label, colour) in classes.items():
        value = "inf" if (low, high) == bounds[-1] else f"{high:g}"
        said = {"value": value, "label": label, "color": colour[:7]}
        ET.SubElement(shader, "item", {**said, "alpha": "0" if colour == CLEAR else "255"})
    return ET.tostring(root, encoding="unicode")


def cell_errors(evaluation: Evaluation, database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the mean expected error in metres of the queries from each cell (float64, n).

    NaN where no query is from; queries of which the distortion left nothing do not count. Raises
    `InputError` if another database was searched.
    """
    errors = evaluation.queries["error_m"].to_numpy(np.float64)
    rows = evaluation.rows_in(database)
    kept = np.isfinite(errors) & (rows >= 0)
    counts = np.bincount(rows[kept], minlength=len(database))
    sums = np.bincount(rows[kept], errors[kept], minlength=len(database))
    means = np.full(len(database), np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means
