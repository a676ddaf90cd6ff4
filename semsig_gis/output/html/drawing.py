"""What maps and the workbench draw of an answer, as plain values with places in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import CHANCES
from semsig_gis.observation import View
from semsig_gis.output.html.page_elements import exact_latlon
from semsig_gis.output.layers.answer import explanation_rows
from semsig_gis.output.layers.columns import described

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.localization import Explanation, Location, Posterior
    from semsig_gis.output.layers.columns import Form

REGION_COLOURS = [CHANCES[share] for share in sorted(CHANCES, reverse=True)]
ARC_POINTS = 72  # of the outline of a sector


def answer_drawing(location: Location) -> dict[str, Any]:
    """Return what is drawn of an answer by likelihood, as plain values for JSON.

    Parameters
    ----------
    location : Location
        The answer.

    Returns
    -------
    dict
        Whether the answer is ``given``, its ``mass`` within ``radius``, ``doubt`` with
        ``elsewhere`` and ``fit``, and ``notes``; the ``estimate`` with its ``place``, ``ellipse``
        of 90 %, ``sigma`` and ``heading``; the ``candidates``, likeliest first, those with an
        explanation with ``headings`` of the photos and ``rays``. A ray goes ``from`` the candidate
        ``to`` where an object was seen or is, and ``sign`` is the place of the street object, or
        its end. Places are latitude and longitude, bearings are from grid north.

    Examples
    --------
    >>> from semsig_gis import build_index, locate, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> drawing = answer_drawing(locate(index, demo_database.signature(0), explained=1))
    >>> drawing["candidates"][0]["rays"][0]["verdict"]
    'matched'
    """
    database, estimate, columns = location.posterior.database, location.estimate, location.columns
    places = exact_latlon(np.stack([columns["x"], columns["y"]], axis=1), database.crs)
    candidates = [
        {"heading": None, "headings": [], "rays": [], **row, "place": place}
        for row, place in zip(location.candidate_rows(), places, strict=True)
    ]
    for candidate, explanation in zip(candidates, location.explanations, strict=False):
        candidate |= {"headings": list(explanation.headings), "rays": _rays(location, explanation)}
    return {
        "given": location.answer.given,
        "mass": location.answer.mass,
        "radius": location.rule.radius,
        "entropy": location.posterior.entropy,
        "doubt": location.doubt,
        "elsewhere": location.elsewhere,
        "fit": location.fit,
        "notes": list(location.notes),
        "cells": location.cells,
        "candidates": candidates,
        "estimate": {
            "place": exact_latlon([estimate.x, estimate.y], database.crs)[0],
            "ellipse": exact_latlon(estimate.outline(), database.crs),
            "sigma": estimate.sigma,
            "heading": estimate.heading,
            "heading_sigma": None if estimate.heading is None else estimate.heading_sigma,
        },
    }


def _rays(location: Location, explanation: Explanation) -> list[dict[str, Any]]:
    """Return a ray for each row of an explanation."""
    rows, ends = explanation_rows(location, explanation), ("from", "to", "sign")
    metres = [row[name] for row in rows for name in ends]
    degrees = exact_latlon(np.array(metres).reshape(-1, 2), location.crs)
    for number, row in enumerate(rows):
        row.update(zip(ends, degrees[3 * number : 3 * number + 3], strict=True))
    return rows


def described_points(
    rows: Iterable[Mapping[str, Any]],
    form: Form,
    names: Sequence[str],
    looks: Iterable[Sequence[Any]],
    *,
    wheels: Sequence[tuple[str, Sequence[Any]]] = (),
    signs: Mapping[str, Any] | None = None,
    outline: str | None = None,
) -> list[Any]:
    """Return the drawing of rows as signs; the panel shows the columns in `names` and the place.

    A row has its ``place`` in degrees. `looks` are the colour, the size, the name and perhaps the
    label of each sign, `wheels` titles with a signature for each row. The last row is drawn first,
    so that the best lies on top.
    """
    columns = described(names, form, {})
    records = []
    for number, (row, (colour, size, name, *label)) in enumerate(zip(rows, looks, strict=True)):
        lat, lon = row["place"]
        details = [
            *(signatures[number] for _, signatures in wheels),
            *(column.text(row.get(column.name)) for column in columns),
            f"{lat:.6f}, {lon:.6f}",
        ]
        records.append([row["place"], colour, size, name, details, *label])
    fields = [*(title for title, _ in wheels), *(column.title for column in columns)]
    fields.append("Latitude, longitude")
    drawing = ["points", fields, signs or {}, records[::-1]]
    return drawing if outline is None else [*drawing, outline]


def sector_outlines(location: Location, explanation: Explanation) -> list[list[list[float]]]:
    """Return the outlines of the photo sectors at a place, out to the visibility range."""
    database = location.posterior.database
    outlines = []
    photos = View.of(location.grid_query).photos
    for photo, turn in zip(photos, explanation.headings, strict=True):
        for low, high in photo.turned(turn).sectors:
            bearings = np.radians(np.linspace(low, high, ARC_POINTS))
            arc = np.stack([np.sin(bearings), np.cos(bearings)], axis=1)
            corners = np.concatenate([[[0.0, 0.0]], arc, [[0.0, 0.0]]])
            places = np.array(explanation.xy) + database.spec.radius * corners
            outlines.append(exact_latlon(places, database.crs))
    return outlines


def region_levels(posterior: Posterior) -> NDArray[np.uint8]:
    """Return the level of the smallest region that contains each cell, or 0.

    Level 1 is the region of the largest share of `CHANCES`: the fewest cells that contain it.
    """
    levels = np.zeros(len(posterior.database), np.uint8)
    for level, share in enumerate(sorted(CHANCES, reverse=True), start=1):
        levels[posterior.credible_cells(share)] = level
    return levels
