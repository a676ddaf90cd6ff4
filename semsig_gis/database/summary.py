"""Summary of a database as plain values: the numbers of the paper's Tables 1 and 2, and more."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.core import degree_bounds, plane_distortion, town_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from semsig_gis.core import ObjectClass
    from semsig_gis.database.database import SignatureDatabase


def database_summary(
    database: SignatureDatabase,
    *,
    file_bytes: int | None = None,
    object_counts: Mapping[int, int] | None = None,
) -> dict[str, Any]:
    """Return the summary of a database as plain values for JSON.

    Parameters
    ----------
    database : SignatureDatabase
        The database.
    file_bytes : int, optional
        Size of its file in bytes.
    object_counts : mapping of int to int, optional
        Number of objects of each class code that it was built from.

    Returns
    -------
    dict
        ``signatures``, ``mean_length``, ``covered_km2``, ``radius_m``, ``step_m``, ``levels``,
        ``crs``, ``extent_degrees`` (west, south, east and north of the viewpoints), ``town`` (see
        `Town`), ``distortion`` (of the plane, see `Distortion.to_dict`), ``file_mb`` and
        ``mb_per_km2`` (millions of bytes or None), ``version``, ``licenses``, ``notes`` (warnings
        about its data); ``viewpoints``: ``mode``, ``half_width_m`` (of streets, else None) and
        ``area_km2`` (of the chosen area, or None); ``occlusion_m``: the tolerance, or None without
        buildings; ``occurrences``: one dict per class (``code``, ``symbol``, ``name``, ``title``,
        ``family``, ``range_m``, ``number``, ``share``, ``objects``: its count or None,
        ``objects_per_km2``, ``entropy_bits``); ``density_from``: ``"objects"`` or
        ``"occurrences"``; ``cell_bits``; ``groups``: for ``type``, ``angle`` and ``both`` the
        statistics of the group sizes from `pandas.Series.describe` (``std`` is that of a sample,
        None for a single group), ``unique`` (share of the cells with a unique signature) and
        ``entropy_bits``; ``largest_type_group``: ``types`` and ``cells``.

    Notes
    -----
    Paper, Tables 1 and 2. An object occurs once in every cell that sees it. The covered area is the
    number n of cells times the area of a cell.

    Objects per km2 of a class: with `object_counts`, their number divided by the covered area.
    Without, occurrences / (n pi R^2), where R is the range of the class; with occlusion, this is
    too small.

    Entropy of a class, in bits: -sum over k of p_k log2 p_k, where p_k is the share of the cells
    that see exactly k objects of it; log2 n (``cell_bits``) would identify the cell. Entropy of
    groups: the same of the shares of the cells in each group.

    Examples
    --------
    >>> facts = database_summary(demo_database)
    >>> facts["groups"]["type"]["count"] <= facts["signatures"]
    True
    """
    total = int(database.occurrences.sum())
    covered = len(database) * database.grid.step**2 / 1e6
    area = database.viewpoints.area
    mode = database.viewpoints.mode
    west, south, east, north = database.bounds.tolist()
    extent = (west, south, east, north)
    types, angles = database.type_sequences, database.angle_sequences
    pairs = types.inverse.astype(np.int64) * len(angles) + angles.inverse
    both = np.unique(pairs, return_counts=True)[1]
    largest = int(np.argmax(types.counts))
    return {
        "signatures": len(database),
        "mean_length": float(database.lengths.mean()),
        "covered_km2": covered,
        "radius_m": float(database.spec.radius),
        "step_m": float(database.grid.step),
        "levels": int(database.spec.levels),
        "crs": database.crs.to_string(),
        "extent_degrees": list(degree_bounds(database.crs, extent)),
        "town": asdict(town_of(database.xy, database.crs)),
        "distortion": plane_distortion(database.crs, extent).to_dict(),
        "file_mb": None if file_bytes is None else file_bytes / 1e6,
        "mb_per_km2": None if file_bytes is None else file_bytes / 1e6 / covered,
        "version": database.version,
        "licenses": list(database.licenses),
        "notes": list(database.notes),
        "viewpoints": {
            "mode": mode,
            "half_width_m": float(database.viewpoints.width) if mode == "streets" else None,
            "area_km2": None if area is None else area.area / 1e6,
        },
        "occlusion_m": database.occlusion,
        "occurrences": [
            _class_facts(database, item, total=total, object_counts=object_counts)
            for item in sorted(database.taxonomy.classes, key=lambda item: item.code)
        ],
        "density_from": "occurrences" if object_counts is None else "objects",
        "cell_bits": float(np.log2(len(database))),
        "groups": {
            "type": _group_statistics(types.counts),
            "angle": _group_statistics(angles.counts),
            "both": _group_statistics(both),
        },
        "largest_type_group": {
            "types": database.taxonomy.decode(types[largest]),
            "cells": int(types.counts[largest]),
        },
    }


def landmark_costs(
    parts: Iterable[SignatureDatabase], file_bytes: int
) -> dict[str, tuple[int, int]]:
    """Return the sightings and the bytes of each class of landmarks that is seen, by title.

    `parts` are those of one database, and `file_bytes` is the size of its files, in which every
    sighting takes about the same room.
    """
    counts = np.zeros(256, np.int64)
    tall: dict[int, str] = {}
    for part in parts:
        counts += part.occurrences
        tall |= {item.code: item.title for item in part.taxonomy.classes if item.tall}
    each = file_bytes / max(int(counts.sum()), 1)
    return {
        title: (int(counts[code]), round(each * int(counts[code])))
        for code, title in sorted(tall.items())
        if counts[code]
    }


def _class_facts(
    database: SignatureDatabase,
    item: ObjectClass,
    *,
    total: int,
    object_counts: Mapping[int, int] | None,
) -> dict[str, Any]:
    """Return the facts about one class."""
    cells = len(database)
    number = int(database.occurrences[item.code])
    range_m = item.range_m or float(database.spec.radius)
    if object_counts is None:
        objects, density = None, number / (cells * np.pi * range_m**2)
    else:
        objects = int(object_counts.get(item.code, 0))
        density = objects / (cells * database.grid.step**2)
    # No cell of a database is empty, as `reduceat` requires.
    counts = np.add.reduceat(database.codes == item.code, database.offsets[:-1], dtype=np.int64)
    return {
        "code": item.code,
        "symbol": item.symbol,
        "name": item.name,
        "title": item.title,
        "family": item.family,
        "range_m": range_m,
        "number": number,
        "share": number / total,
        "objects": objects,
        "objects_per_km2": 1e6 * density,
        "entropy_bits": _entropy(np.bincount(counts)),
    }


def _entropy(sizes: NDArray[np.int64]) -> float:
    """Return the Shannon entropy of a partition with these sizes, in bits."""
    shares = sizes[sizes > 0] / sizes.sum()
    return max(0.0, -float((shares * np.log2(shares)).sum()))


def _group_statistics(sizes: NDArray[np.int64]) -> dict[str, float | int | None]:
    """Return the statistics of group sizes and the share of cells with a unique signature."""
    described = pd.Series(sizes).describe()
    statistics: dict[str, float | int | None] = {
        name: int(described[name]) for name in ("count", "min", "max")
    }
    for name in ("mean", "std", "25%", "50%", "75%"):
        value = float(described[name])
        statistics[name] = None if np.isnan(value) else value
    statistics["unique"] = int(np.count_nonzero(sizes == 1)) / int(sizes.sum())
    statistics["entropy_bits"] = _entropy(sizes)
    return statistics
