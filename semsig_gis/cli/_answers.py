"""Answers to queries as text for people."""

from __future__ import annotations

from typing import Any

import typer

from semsig_gis.console import print_rows

VERDICTS = ("matched", "misnamed", "missed", "false")


def print_answer(result: dict[str, Any]) -> None:
    """Print an answer, as its `to_dict` gives it."""
    by_chance = "noise" in result
    said = f"likelihood ({result['noise']} noise)" if by_chance else result["used"]
    score = "chance" if by_chance else "distance"
    candidates = result["candidates"]
    print_rows(
        f"{len(candidates)} best of {result['cells']:,} cells, by {said}",
        ("rank", "cell", "x", "y", "lon", "lat", score, "types"),
        (
            [
                row["rank"] if by_chance else _rank_text(row["rank_low"], row["rank_high"]),
                row["cell_id"],
                f"{row['x']:.1f}",
                f"{row['y']:.1f}",
                f"{row['lon']:.6f}",
                f"{row['lat']:.6f}",
                f"{row[score]:.4f}",
                row["types"],
            ]
            for row in candidates
        ),
    )
    if by_chance:
        _print_explanations(candidates)
        _print_place(result)
    elif result["tied_beyond"]:
        tied = result["tied_beyond"]
        more = "1 further cell ties" if tied == 1 else f"{tied:,} further cells tie"
        typer.echo(f"{more} with the last one.")


def _print_place(result: dict[str, Any]) -> None:
    place, region = result["place"], result["region"]
    where = f"{place['lat']:.6f}, {place['lon']:.6f} (lat, lon)"
    chance = f"within {place['within_m']:g} m of it with a chance of {place['chance']:.1%}"
    if result["answered"]:
        typer.echo(f"{where}, {chance}.")
    else:
        typer.echo(f"Cannot tell: the best place is {where}, {chance}.")
    ellipse = place["ellipse_90"]
    typer.echo(
        f"If there, at x {place['x']:.1f}, y {place['y']:.1f}, give or take {place['sigma']:.1f} m "
        f"(90%: {ellipse['longer']:.1f} m along {ellipse['bearing']:.0f}°, "
        f"{ellipse['shorter']:.1f} m across)."
    )
    if place["heading"] is not None:
        typer.echo(
            f"The north of the query lies at {place['heading'] % 360.0:.1f}°, give or take "
            f"{place['heading_sigma']:.1f}°."
        )
    typer.echo(
        f"{region['share']:.0%} of the chance is in {region['cells']:,} "
        f"cell{'' if region['cells'] == 1 else 's'} "
        f"({_area_text(region['km2'])})."
    )


def _area_text(km2: float) -> str:
    return f"{km2:.3f} km²" if km2 >= 0.1 else f"{km2 * 1e6:,.0f} m²"  # noqa: PLR2004 - 10 ha


def _print_explanations(candidates: list[dict[str, Any]]) -> None:
    """Print the objects of the best candidate, and the counts of the others."""
    for row in candidates:
        if "explanation" not in row:
            break
        why = row["explanation"]
        counts = ", ".join(f"{why['counts'][verdict]} {verdict}" for verdict in VERDICTS)
        title = f"Rank {row['rank']}, at x {why['x']:.1f}, y {why['y']:.1f}: {counts}"
        if row["rank"] > 1:
            typer.echo(title)
            continue
        print_rows(
            title,
            (
                "verdict",
                "chance",
                "seen",
                "at",
                "object",
                "at",
                "off by",
                "distance",
                "source",
                "id",
            ),
            (
                [
                    one["verdict"],
                    f"{one['chance']:.2f}",
                    one["query_class"] or "",
                    _measure(one["query_bearing"], "°"),
                    one["object_class"] or "",
                    _measure(one["object_bearing"], "°"),
                    _measure(one["bearing_error"], "°", sign="+"),
                    _measure(one["distance"], " m"),
                    one["source"] or "",
                    one["source_id"] or "",
                ]
                for one in sorted(why["rows"], key=lambda one: VERDICTS.index(one["verdict"]))
            ),
        )


def _measure(value: float | None, unit: str, *, sign: str = "") -> str:
    return "" if value is None else f"{value:{sign}.1f}{unit}"


def _rank_text(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}-{high}"
