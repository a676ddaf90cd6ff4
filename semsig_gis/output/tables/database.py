"""Tables of the properties of a database, with the paper's figures of Paris for comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.core import Table, Town, family_named, percent
from semsig_gis.database import database_summary
from semsig_gis.evaluation import published as paris
from semsig_gis.output.tables.tables import distortion_rows, note_tables

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from semsig_gis.database import Companion, SignatureDatabase

MOST_TYPES = 20  # objects that fit into a table
NAMED = 20  # classes in a sentence, the commonest
GROUP_LABELS = {"unique": "cells in a group of one", "entropy_bits": "entropy, in bits"}


def database_tables(
    database: SignatureDatabase,
    *,
    file_bytes: int | None = None,
    object_counts: Mapping[int, int] | None = None,
    symbols: bool = False,
) -> tuple[Table, ...]:
    """Return the paper's Tables 1, 2a and 2b for a database, and tables of classes and notes.

    With `symbols`, a class has its letter as well.
    """
    facts = database_summary(database, file_bytes=file_bytes, object_counts=object_counts)
    facts["occurrences"] = [
        {**item, "title": class_label(item, symbols=symbols)} for item in facts["occurrences"]
    ]
    types = facts["largest_type_group"]["types"]
    first = types[:MOST_TYPES]
    text = first if symbols else database.taxonomy.words(database.taxonomy.encode(first))
    more = f"… ({len(types)} objects)" if len(types) > MOST_TYPES else ""
    facts["largest_type_group"]["types"] = text + more
    tables = [_occurrence_table, _property_table, _group_table, _class_table]
    if len({item["family"] for item in facts["occurrences"] if item["number"]}) > 1:
        tables.append(_family_table)
    return (*(table(facts) for table in tables), *note_tables(facts["notes"]))


def database_sentences(facts: Mapping[str, Any], *, symbols: bool = False) -> list[str]:
    """Return the size of a database, how distinct its cells are, and the classes that are seen.

    With `symbols`, a class has its letter as well.
    """
    ranges = (item["range_m"] for item in facts["occurrences"] if item["number"])
    size = (
        f"{facts['signatures']:,} cells of {facts['step_m']:g} m {Town(**facts['town'])} see "
        f"{facts['mean_length']:.1f} street objects on average, up to {max(ranges):,g} m away; "
        f"{percent(facts['groups']['type']['unique'], 0)} of them see classes in an order that no "
        "other cell sees."
    )
    items = sorted(facts["occurrences"], key=lambda item: -item["number"])
    names = [class_label(item, symbols=symbols) for item in items if item["number"]]
    more = len(names) - NAMED
    # With symbols, they are all of use.
    if more > 1 and not symbols:
        names[NAMED:] = [f"and {more} more classes"]
    return [size, f"Seen: {', '.join(names)}."]


def companion_table(title: str, companions: Iterable[Companion]) -> Table:
    """Return a table of the files that belong to a database."""
    rows = ((file.path.name, file.what, f"{file.bytes / 1e6:,.1f}") for file in companions)
    return Table(title, ("File", "What", "MB"), tuple(rows))


def _family_table(facts: Mapping[str, Any]) -> Table:
    items_of: dict[str, list[Mapping[str, Any]]] = {}
    for item in facts["occurrences"]:
        if item["number"] or item["objects"]:
            items_of.setdefault(item["family"], []).append(item)
    order = sorted(items_of, key=lambda family: -sum(item["number"] for item in items_of[family]))
    rows = [items_of[family] for family in order]
    counted = facts["density_from"] == "objects"
    objects = {"Objects": [f"{sum(item['objects'] for item in row):,}" for row in rows]}
    return Table.of_columns(
        "Families of classes",
        {
            "Family": [family_named(family).title for family in order],
            "Classes": [str(len(row)) for row in rows],
            **(objects if counted else {}),
            "Occurrences": [f"{sum(item['number'] for item in row):,}" for row in rows],
            "Share": [percent(sum(item["share"] for item in row), 1) for row in rows],
        },
        "Points of a line or an outline count as objects, the nearest one as an occurrence.",
    )


def _occurrence_table(facts: Mapping[str, Any]) -> Table:
    items = facts["occurrences"]
    total = sum(paris.OCCURRENCES.values())
    numbers = [paris.OCCURRENCES.get(item["name"]) for item in items]
    return Table(
        "Occurrences by class",
        ("Class", "Number", "Share", paris.COLUMN, "Share"),
        tuple(
            (
                *(item["title"], f"{item['number']:,}", percent(item["share"], 1)),
                *(("", "") if number is None else (f"{number:,}", percent(number / total, 1))),
            )
            for item, number in zip(items, numbers, strict=True)
        ),
        "An object counts once in every signature that contains it.",
    )


def class_label(item: Mapping[str, Any], *, symbols: bool) -> str:
    """Return the title of a class in lower case, with its symbol or without."""
    title = str(item["title"]).lower()
    return f"{title} ({item['symbol']})" if symbols else title


def _property_table(facts: Mapping[str, Any]) -> Table:
    megabytes, density, depth = facts["file_mb"], facts["mb_per_km2"], facts["occlusion_m"]
    largest = facts["largest_type_group"]
    present = [item for item in facts["occurrences"] if item["number"]]
    exceptions = sum(item["range_m"] != facts["radius_m"] for item in present)
    others = f" ({exceptions} classes have their own)" if exceptions else ""
    occlusion = "none" if depth is None else f"by buildings, more than {depth:g} m deep"
    return Table(
        "Database",
        ("Property", "Ours", paris.COLUMN),
        (
            ("Visibility range", f"{facts['radius_m']:g} m{others}", "30 m"),
            ("Occlusion", occlusion, ""),
            ("Viewpoints", _viewpoint_text(facts["viewpoints"]), ""),
            ("Grid step", f"{facts['step_m']:g} m", "10 m"),
            ("Angle levels", str(facts["levels"]), "16"),
            ("Where", str(Town(**facts["town"])), ""),
            ("Coordinate system", facts["crs"], ""),
            (
                "West, south, east, north",
                ", ".join(f"{side:.5f}" for side in facts["extent_degrees"]),
                "",
            ),
            *((name, value, "") for name, value in distortion_rows(facts["distortion"])),
            ("Signatures", f"{facts['signatures']:,}", "312,134"),
            ("Mean length", f"{facts['mean_length']:.3f} objects", "14 objects"),
            ("Covered area", f"{facts['covered_km2']:.1f} km²", "79 km²"),
            ("File", "" if megabytes is None else f"{megabytes:.1f} MB", "38.7 MB"),
            ("File per km²", "" if density is None else f"{density:.2f} MB", "1.24 MB"),
            (
                "Largest group by type",
                f"{largest['types']}, {largest['cells']:,} cells",
                "DDD, 29,958 cells",
            ),
        ),
        (
            "Our covered area is cells times the area of a cell; by that count "
            "the paper's signatures cover 31.2 km², not 79."
        ),
    )


def _viewpoint_text(viewpoints: Mapping[str, Any]) -> str:
    """Return a text about the cells that have signatures."""
    text: str = {
        "all": "all cells",
        "outdoor": "cells outside buildings",
        "streets": "cells along streets",
    }[viewpoints["mode"]]
    if viewpoints["half_width_m"] is not None:
        text += f" ({viewpoints['half_width_m']:g} m from the centre line, or by class)"
    if viewpoints["area_km2"] is not None:
        text += f", in an area of {viewpoints['area_km2']:.1f} km²"
    return text


def _group_table(facts: Mapping[str, Any]) -> Table:
    groups = [facts["groups"][kind] for kind in ("type", "angle", "both")]
    return Table(
        "Sizes of the signature groups, in cells",
        ("", "By type", "By angle", "By both", f"{paris.COLUMN}, by type", "by angle"),
        tuple(
            (
                GROUP_LABELS.get(name, name),
                *(_statistic_text(name, group[name]) for group in groups),
                *paper,
            )
            for name, paper in paris.GROUPS.items()
        ),
        (
            "The paper counts distinct patterns over its 10,000 queries, not over all cells. "
            f"{facts['cell_bits']:.2f} bits would identify every cell."
        ),
    )


def _class_table(facts: Mapping[str, Any]) -> Table:
    items = [item for item in facts["occurrences"] if item["number"] or item["objects"]]
    counted = facts["density_from"] == "objects"
    omission = "" if facts["occlusion_m"] is None else ", without what buildings hide"
    density = (
        "Objects per km² of the covered area."
        if counted
        else "Objects per km² are estimated: what the mean cell sees, divided by the area within "
        f"range of it{omission}."
    )
    objects = {"Objects": [f"{item['objects']:,}" for item in items]} if counted else {}
    return Table.of_columns(
        "Classes that occur",
        {
            "Class": [item["title"] for item in items],
            "Range, m": [f"{item['range_m']:g}" for item in items],
            **objects,
            "Objects per km²": [f"{item['objects_per_km2']:,.1f}" for item in items],
            "Entropy, bits": [f"{item['entropy_bits']:.3f}" for item in items],
        },
        f"{density} Entropy: how much the number of objects of the class says about the cell.",
    )


def _statistic_text(name: str, value: float | None) -> str:
    """Return one statistic of group sizes as text."""
    if value is None:
        return ""
    if name == "unique":
        return percent(value, 1)
    if name == "entropy_bits":
        return f"{value:.2f}"
    return f"{value:,.1f}" if name in {"mean", "std"} else f"{value:,g}"
