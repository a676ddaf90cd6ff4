"""An answer as the page of the workbench draws it: plain values, places in degrees."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import CHANCES, percent
from semsig_gis.localization import UNKNOWN_NAME
from semsig_gis.maps import REGION_COLOURS, data_url, exact_latlon, region_levels, to_metres

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Explanation, Location, NoiseTable
    from semsig_gis.maps import CellPixels
    from semsig_gis.serve.question import MarkNumber, Question

LEAST_SHARE = 1e-6
LEAST_BITS = 0.05  # of what is told
LEAST_CHANCE = 0.05  # of a verdict, that it speaks for or against a place


def class_shares(database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the share of the cells that see each class code, shape (256,)."""
    types = database.type_sequences
    cells = np.bincount(types.inverse, minlength=len(types))
    shares = np.zeros(256)
    seen = cells @ (types.histogram > 0)
    shares[: len(seen)] = seen / len(database)
    return shares


def answer_drawing(
    location: Location,
    question: Question,
    *,
    table: NoiseTable,
    shares: NDArray[np.float64],
    pixels: CellPixels,
) -> dict[str, Any]:
    """Return what the page draws of an answer, the regions in an image of the city.

    `table` is the noise model that was searched with, `shares` are those of `class_shares`.
    """
    database, estimate = location.posterior.database, location.estimate
    levels = region_levels(location.posterior)
    image, bounds = pixels.image(pixels.levels(levels), REGION_COLOURS, effort=1)
    entropy = location.posterior.entropy
    drawer = _Drawer(location, question, table, shares)
    return {
        "given": location.answer.given,
        "mass": location.answer.mass,
        "radius": location.rule.radius,
        "entropy": entropy,
        "places_left": 2.0**entropy,
        "region": {
            "image": data_url(image),
            "bounds": bounds,
            "counts": {
                f"{share:g}": int((levels >= level).sum())
                for level, share in enumerate(sorted(CHANCES, reverse=True), start=1)
            },
            "colours": {f"{share:g}": colour for share, colour in CHANCES.items()},
        },
        "candidates": drawer.candidates(),
        "estimate": {
            "place": drawer.latlon([[estimate.x, estimate.y]])[0],
            "sigma": estimate.sigma,
            "heading": estimate.heading,
            "heading_sigma": None if estimate.heading is None else estimate.heading_sigma,
            "ellipse": drawer.latlon(estimate.outline()),
        },
        "truth": None if question.truth is None else drawer.truth(question.truth),
        "notes": list(location.notes),
        "cells": len(database),
    }


class _Drawer:
    """What an answer is drawn by."""

    def __init__(
        self,
        location: Location,
        question: Question,
        table: NoiseTable,
        shares: NDArray[np.float64],
    ) -> None:
        self.location, self.table, self.shares = location, table, shares
        self.database = location.posterior.database
        self.marks: tuple[MarkNumber, ...] = question.marks[question.shown]
        self.titles = {item.name: item.title for item in self.database.taxonomy.classes}
        self.codes = {item.name: item.code for item in self.database.taxonomy.classes}

    def latlon(self, xy: ArrayLike) -> list[list[float]]:
        """Return places in degrees."""
        return exact_latlon(xy, self.database.crs)

    def truth(self, place: tuple[float, float]) -> dict[str, Any]:
        """Return how far the answer is from the true place."""
        xy = to_metres(place, self.database.crs)
        (x, y), estimate = xy[0].tolist(), self.location.estimate
        metres = math.hypot(x - estimate.x, y - estimate.y)
        cell = int(self.database.cells_at(xy)[0])
        chances = self.location.chances
        better = int((chances > chances[cell]).sum()) if cell >= 0 else None
        return {
            "place": list(place),
            "metres": metres,
            "found": metres <= self.location.rule.radius,
            "rank": None if better is None else better + 1,
            "chance": None if cell < 0 else float(chances[cell]),
        }

    def candidates(self) -> list[dict[str, Any]]:
        """Return the candidates, likeliest first."""
        location = self.location
        columns = location.columns
        places = self.latlon(np.stack([columns["x"], columns["y"]], axis=1))
        rows = zip(*(columns[name].tolist() for name in ("cell", "cell_id", "chance")), strict=True)
        found = []
        for number, ((cell, cell_id, chance), place) in enumerate(zip(rows, places, strict=True)):
            heading = float(columns["heading"][number]) if "heading" in columns else None
            found.append(
                {
                    "rank": number + 1,
                    "cell": cell_id,
                    "types": self.database.types(cell),
                    "place": place,
                    "chance": chance,
                    "heading": heading,
                    "rays": [],
                    "for_against": [],
                }
            )
        for candidate, explanation in zip(found, location.explanations, strict=False):
            candidate["headings"] = list(explanation.headings)
            candidate["rays"] = self._rays(explanation)
            candidate["for_against"] = self._reasons(explanation)
        return found

    def _rays(self, explanation: Explanation) -> list[dict[str, Any]]:
        here = self.latlon([explanation.xy])[0]
        ends = self.latlon(explanation.ends(self.database.reach))
        return [
            {
                "verdict": row["verdict"],
                "class": row["object_class"] or row["query_class"],
                "title": self._title(row["object_class"] or row["query_class"]),
                "seen_class": row["query_class"],
                "seen_title": self._title(row["query_class"]),
                "seen_bearing": row["query_bearing"],
                "seen_range": row["query_range"],
                "bearing": row["object_bearing"],
                "distance": row["distance"],
                "from": here,
                "to": end,
                "chance": row["chance"],
                "mark": None if row["query"] is None else list(self.marks[row["query"]]),
            }
            for row, end in zip(explanation.rows, ends, strict=True)
        ]

    def _reasons(self, explanation: Explanation) -> list[dict[str, Any]]:
        """Return what speaks for a place and against it, in bits, the weightiest first.

        For it: how few cells see such a class. Against it: how seldom a detector fails so.
        """
        length = min(int(explanation.counts["matched"]), len(self.table.missed) - 1)
        reasons = []
        for row in explanation.rows:
            verdict, chance = row["verdict"], row["chance"]
            kind = row["object_class"] or row["query_class"]
            class_row = int(self.table.row_of[self.codes.get(kind, 0)])
            title = self._title(kind) or ""
            known = 0 <= class_row < len(self.table.codes)
            if chance < LEAST_CHANCE or verdict == "outside":
                continue
            if verdict == "matched":
                share = max(float(self.shares[self.codes[kind]]), LEAST_SHARE)
                weight = -chance * math.log2(share)
                text = f"{title}: it is where one stands, and {percent(share)} of the cells see one"
            elif verdict == "misnamed":
                odds = float(self.table.misnamed[length, class_row])
                weight = chance * math.log2(max(odds, LEAST_SHARE))
                text = f"{self._title(row['query_class'])}: a {title.lower()} stands there"
            elif verdict == "missed":
                odds = float(self.table.missed[length, class_row])
                weight = chance * math.log2(max(odds, LEAST_SHARE))
                text = f"{title}: one stands there, {row['distance']:.0f} m away, but is not marked"
            else:
                clutter = self.table.clutter
                odds = float(clutter[class_row] if known else clutter.sum())
                weight = chance * math.log2(min(max(odds, LEAST_SHARE), 1.0))
                text = f"{title}: none stands there"
            if abs(weight) >= LEAST_BITS:
                reasons.append({"text": text, "weight": round(weight, 3), "verdict": verdict})
        return sorted(reasons, key=lambda reason: -abs(reason["weight"]))

    def _title(self, name: str | None) -> str | None:
        return "Something" if name == UNKNOWN_NAME else self.titles.get(name or "", name)
