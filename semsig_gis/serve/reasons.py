"""Reasons for and against the candidates of an answer."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import percent

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import NoiseTable

LEAST_SHARE = 1e-6  # lower bound of shares and odds before the logarithm
LEAST_REASON_BITS = 0.05  # smallest weight of a reason in the list
LEAST_VERDICT_CHANCE = 0.05  # smallest chance of a verdict that counts as a reason


def class_shares(database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the share of cells that see each class code, shape (256,)."""
    types = database.type_sequences
    cells = np.bincount(types.inverse, minlength=len(types))
    shares = np.zeros(256)
    counts = cells @ (types.histogram > 0)
    shares[: len(counts)] = counts / len(database)
    return shares


def place_reasons(
    rays: Sequence[Mapping[str, Any]],
    codes: Mapping[str, int],
    *,
    table: NoiseTable,
    shares: NDArray[np.float64],
) -> list[dict[str, Any]]:
    """Return the reasons for and against a candidate with weights in bits, largest first.

    For the place: how rare the class is among the cells. Against: how rare the error is. `rays` are
    those of `answer_drawing`, `codes` the classes by name, `table` is the noise model of the
    search, and `shares` come from `class_shares`.
    """
    # The chances of errors depend on the number of detections, up to the size of the table.
    length = min(sum(ray["verdict"] == "matched" for ray in rays), len(table.missed) - 1)
    listed = []
    for ray in rays:
        verdict, chance = ray["verdict"], ray["chance"]
        if chance < LEAST_VERDICT_CHANCE or verdict == "outside":
            continue
        title, class_row = ray["title"], int(table.row_of[codes.get(ray["class"], 0)])
        sign = 1.0
        if verdict == "matched":
            odds, sign = float(shares[codes[ray["class"]]]), -1.0
            text = f"{title}: the map has one there; {percent(odds, 1)} of the cells see one"
        elif verdict == "misnamed":
            odds = float(table.misnamed[length, class_row])
            text = f"{ray['seen_title']}: the map has a {title.lower()} there"
        elif verdict == "missed":
            odds = float(table.missed[length, class_row])
            text = f"{title}: the map has one {ray['distance']:.0f} m away, but it is not marked"
        else:
            in_table = 0 <= class_row < len(table.codes)
            odds = min(float(table.clutter[class_row] if in_table else table.clutter.sum()), 1.0)
            text = f"{title}: the map has none there"
        weight = sign * chance * math.log2(max(odds, LEAST_SHARE))
        if abs(weight) >= LEAST_REASON_BITS:
            listed.append({"text": text, "weight": round(weight, 3), "verdict": verdict})
    return sorted(listed, key=lambda reason: -abs(reason["weight"]))
