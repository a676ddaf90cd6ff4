"""The sections of the report of the paper's experiments that tell of the city."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis._paper_curves import case_of, level_case
from semsig_gis.distortion import DISTORTIONS
from semsig_gis.paper_experiments import BEST, LEVELS
from semsig_gis.paper_figures import (
    PARIS_ALONE,
    PARIS_BEARING_CLIP,
    PARIS_BEARING_SIGMA,
    PARIS_DATABASE,
    PARIS_ERRORS,
    PARIS_GROUPS,
    PARIS_OCCURRENCES,
)
from semsig_gis.report_parts import Number, Section
from semsig_gis.scenes import example_scenes

if TYPE_CHECKING:
    from semsig_gis.reproduction import Reproduction

GROUP_KEYS = ("count", "mean", "std", "min", "25%", "50%", "75%", "max")


def object_section(found: Reproduction) -> Section:
    total = sum(PARIS_OCCURRENCES.values())
    numbers = []
    for one in found.summary["occurrences"]:
        paper = PARIS_OCCURRENCES.get(one["name"])
        numbers += [
            Number(
                row=one["title"],
                column="occurrences",
                ours=one["number"],
                paper=paper,
                decimals=0,
            ),
            Number(
                row=one["title"],
                column="share of all",
                ours=one["share"],
                paper=None if paper is None else paper / total,
            ),
        ]
    return Section(
        name="objects",
        title="Street objects",
        text=(
            (
                "Paper, Table 1. An object counts once in every signature that it is in; the "
                "paper's numbers are of that kind, for they sum to 14 for each of its signatures."
            ),
        ),
        numbers=tuple(numbers),
    )


def database_section(found: Reproduction) -> Section:
    facts = found.summary
    basic = (
        ("visibility range", "radius_m", "m", 0),
        ("signatures", "signatures", "", 0),
        ("mean length", "mean_length", "", 2),
        ("covered area", "covered_km2", "km²", 1),
        ("storage", "file_mb", "MB", 1),
    )
    numbers = [
        Number(
            row=row,
            column="",
            ours=facts[key],
            paper=PARIS_DATABASE[key],
            unit=unit,
            decimals=decimals,
        )
        for row, key, unit, decimals in basic
    ]
    for place, part in enumerate(("type", "angle")):
        numbers += [
            Number(
                row=f"groups by {part}: {key}",
                column="",
                ours=facts["groups"][part][key],
                paper=float(PARIS_GROUPS[key][place].replace(",", "")),
                decimals=1 if key in {"mean", "std"} else 0,
            )
            for key in GROUP_KEYS
        ]
    numbers += [
        Number(
            row=f"cells alone in their group by {part}",
            column="",
            ours=facts["groups"][part]["alone"],
            paper=PARIS_ALONE if part == "type" else None,
            decimals=3,
        )
        for part in ("type", "angle")
    ]
    return Section(
        name="database",
        title="Database",
        text=(
            (
                "Paper, Tables 2a and 2b. A group is all cells with one sequence of types, or of "
                "angle levels. The paper's area is that of its city; ours is that of the cells. "
                "Its share of cells alone is that of its queries; it does not say by which part."
            ),
        ),
        numbers=tuple(numbers),
    )


def example_sections(found: Reproduction) -> tuple[Section, ...]:
    evaluation = case_of(found, "medium", BEST)
    return tuple(
        Section(
            name=name,
            title=title,
            text=(text,),
            scenes=example_scenes(evaluation, found.database, successful=successful),
        )
        for name, title, text, successful in (
            (
                "found",
                "Places that were found",
                (
                    "The first queries of the two-stage fusion at 5 %, medium distortion, whose "
                    "answer is right within 50 m. Signatures are as the database has them, before "
                    "the distortion."
                ),
                True,
            ),
            (
                "lost",
                "Places that were not found",
                "The first ones whose answer is not. They see few objects, and of common classes.",
                False,
            ),
        )
    )


def distortion_section(found: Reproduction) -> Section:
    numbers = []
    for name in LEVELS:
        level = DISTORTIONS[name]
        best = level_case(found, name)
        queries = best.queries
        numbers += [
            Number(
                row=name,
                column="errors a query",
                ours=level.occurrences,
                paper=PARIS_ERRORS[name],
                decimals=0,
            ),
            Number(
                row=name,
                column="bearing noise, degrees",
                ours=level.bearing_sigma,
                paper=PARIS_BEARING_SIGMA,
                decimals=0,
            ),
            Number(
                row=name,
                column="noise clipped at, degrees",
                ours=level.bearing_clip,
                paper=PARIS_BEARING_CLIP,
                decimals=0,
            ),
            Number(
                row=name,
                column="mean objects asked",
                ours=float(queries["query_length"].mean()),
                decimals=2,
            ),
            Number(row=name, column="left empty", ours=best.unlocalized / len(queries)),
        ]
    return Section(
        name="distortion",
        title="Distortion",
        text=(
            (
                "Each error is, with equal chance, an object missed, an object made up, or a class "
                "mistaken. The queries see a mean of "
                f"{float(queries['length'].mean()):.2f} objects before."
            ),
        ),
        numbers=tuple(numbers),
    )
