"""An answer as plain values for the page of the workbench, with places in degrees."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import CHANCES, percent
from semsig_gis.localization import UNKNOWN_NAME
from semsig_gis.output import REGION_COLOURS, data_url, exact_latlon, region_levels, to_metres

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Explanation, Location, NoiseTable
    from semsig_gis.output import CellPixels
    from semsig_gis.serve.question import MarkNumber, Question

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


def answer_drawing(
    location: Location,
    question: Question,
    *,
    table: NoiseTable,
    shares: NDArray[np.float64],
    pixels: CellPixels,
) -> dict[str, Any]:
    """Return an answer for the page, with the regions as an image of the city.

    `table` is the noise model of the search, `shares` come from `class_shares`.
    """
    database, estimate = location.posterior.database, location.estimate
    levels = region_levels(location.posterior)
    image, bounds = pixels.image(pixels.levels(levels), REGION_COLOURS, effort=1)
    parts = _AnswerParts(location, question, table, shares)
    return {
        "given": location.answer.given,
        "mass": location.answer.mass,
        "radius": location.rule.radius,
        "entropy": location.posterior.entropy,
        "doubt": location.doubt,
        "elsewhere": location.elsewhere,
        "fit": location.fit,
        "region": {
            "text": location.region_text,
            "image": data_url(image),
            "bounds": bounds,
            "counts": {
                f"{share:g}": int((levels >= level).sum())
                for level, share in enumerate(sorted(CHANCES, reverse=True), start=1)
            },
            "colours": {f"{share:g}": colour for share, colour in CHANCES.items()},
        },
        "candidates": parts.candidates(),
        "estimate": {
            "place": parts.latlon([[estimate.x, estimate.y]])[0],
            "sigma": estimate.sigma,
            "heading": estimate.heading,
            "heading_sigma": None if estimate.heading is None else estimate.heading_sigma,
            "ellipse": parts.latlon(estimate.outline()),
        },
        "truth": None if question.truth is None else parts.truth(question.truth),
        "notes": list(location.notes),
        "cells": len(database),
    }


class _AnswerParts:
    """Parts of an answer as values for JSON."""

    def __init__(
        self, location: Location, question: Question, table: NoiseTable, shares: NDArray[np.float64]
    ) -> None:
        self.location, self.table, self.shares = location, table, shares
        self.database = location.posterior.database
        self.marks: tuple[MarkNumber, ...] = question.marks[question.place_number]
        self.titles = {item.name: item.title for item in self.database.taxonomy.classes}
        self.codes = {item.name: item.code for item in self.database.taxonomy.classes}

    def latlon(self, xy: ArrayLike) -> list[list[float]]:
        """Return places in degrees."""
        return exact_latlon(xy, self.database.crs)

    def truth(self, place: tuple[float, float]) -> dict[str, Any]:
        """Return the distance from the true place, and the rank and chance of its cell."""
        xy = to_metres(place, self.database.crs)
        (x, y), estimate = xy[0].tolist(), self.location.estimate
        metres = math.hypot(x - estimate.x, y - estimate.y)
        # The true place may be outside all cells, which gives -1.
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
        candidates: list[dict[str, Any]] = []
        for number, ((cell, cell_id, chance), place) in enumerate(zip(rows, places, strict=True)):
            heading = float(columns["heading"][number]) if "heading" in columns else None
            candidates.append(
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
        for candidate, explanation in zip(candidates, location.explanations, strict=False):
            candidate["headings"] = list(explanation.headings)
            candidate["rays"] = self._rays(explanation)
            candidate["for_against"] = self._reasons(explanation)
        return candidates

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
        """Return the reasons for and against a place with weights in bits, largest first.

        For the place: how rare the class is among the cells. Against: how rare the error is.
        """
        # The chances of errors depend on the number of detections, up to the size of the table.
        length = min(int(explanation.counts["matched"]), len(self.table.missed) - 1)
        reasons = []
        for row in explanation.rows:
            verdict, chance = row["verdict"], row["chance"]
            kind = row["object_class"] or row["query_class"]
            class_row = int(self.table.row_of[self.codes.get(kind, 0)])
            title = self._title(kind) or ""
            in_table = 0 <= class_row < len(self.table.codes)
            if chance < LEAST_VERDICT_CHANCE or verdict == "outside":
                continue
            if verdict == "matched":
                share = max(float(self.shares[self.codes[kind]]), LEAST_SHARE)
                weight = -chance * math.log2(share)
                text = f"{title}: the map has one there; {percent(share, 1)} of the cells see one"
            elif verdict == "misnamed":
                odds = float(self.table.misnamed[length, class_row])
                weight = chance * math.log2(max(odds, LEAST_SHARE))
                text = f"{self._title(row['query_class'])}: the map has a {title.lower()} there"
            elif verdict == "missed":
                odds = float(self.table.missed[length, class_row])
                weight = chance * math.log2(max(odds, LEAST_SHARE))
                text = (
                    f"{title}: the map has one {row['distance']:.0f} m away, but it is not marked"
                )
            else:
                clutter = self.table.clutter
                odds = float(clutter[class_row] if in_table else clutter.sum())
                weight = chance * math.log2(min(max(odds, LEAST_SHARE), 1.0))
                text = f"{title}: the map has none there"
            if abs(weight) >= LEAST_REASON_BITS:
                reasons.append({"text": text, "weight": round(weight, 3), "verdict": verdict})
        return sorted(reasons, key=lambda reason: -abs(reason["weight"]))

    def _title(self, name: str | None) -> str | None:
        return "Something" if name == UNKNOWN_NAME else self.titles.get(name or "", name)
