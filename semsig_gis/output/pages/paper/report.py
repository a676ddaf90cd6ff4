"""The report of the paper's experiments: tables and plots of our figures and the paper's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.evaluation import (
    BEST,
    DISTORTION_LEVELS,
    DISTORTIONS,
    FIRST_STAGE,
    OURS,
    READ_OFF,
    READINGS,
    machine,
)
from semsig_gis.evaluation import published as paris
from semsig_gis.output.figures.scenes import example_scenes
from semsig_gis.output.figures.shares import (
    COLUMNS,
    P10,
    P50,
    RECALL10,
    Share,
    calibration_plot,
    curve_of,
    plot_of,
    share_of,
)
from semsig_gis.output.pages.paper.cases import case_of, is_unambiguous, level_case, reweighted
from semsig_gis.output.pages.paper.comparisons import COMPARISONS, NAMES
from semsig_gis.output.report_model import Curve, Number, Plot, Report, Section
from semsig_gis.output.tables.tables import short_percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from semsig_gis.evaluation import Evaluation, Reproduction
    from semsig_gis.output.figures.shares import Figure, Points
    from semsig_gis.output.report_model import Scene

JUST_5 = "recall@10 %, just 5 % kept"
GROUP_KEYS = ("count", "mean", "std", "min", "25%", "50%", "75%", "max")
# Label, unit and decimals of facts of a database, by key.
FACTS = {
    "radius_m": ("visibility range", "m", 0),
    "signatures": ("signatures", "", 0),
    "mean_length": ("mean length", "", 2),
    "covered_km2": ("covered area", "km²", 1),
    "file_mb": ("storage", "MB", 1),
}
TIMED_COLUMNS = ("types", "angles", "types and angles, 5 %")
MIDDLE_LENGTHS = (10, 19)
MIDDLE_COLUMN = (
    f"{COLUMNS[P50]} of queries that see {MIDDLE_LENGTHS[0]} to {MIDDLE_LENGTHS[1]} objects"
)
# The paper's figures of the recommended method at medium distortion.
PARIS_P50, PARIS_RECALL10 = paris.ACCURACY[30.0, 16]


def reproduction_report(results: Reproduction, *, command: str = "") -> Report:
    """Return the report of the paper's experiments, its interpretations and the likelihood method.

    `command` is the command line of the run.
    """
    settings = results.settings
    first = next(iter(results.experiments["none"].values()))
    return Report(
        title=f"The paper's experiments on {settings['database']}",
        headline=reproduction_headline(results),
        text=(
            (
                "Semantic signatures locate a view in a city by the street objects in it. This "
                "report repeats the experiments of the source paper. Its city is Paris in the open "
                "data of its time, so its figures can be compared with ours only as far as the "
                "cities are similar."
            ),
            (
                "P(error ≤ 50 m) is the share of queries that are placed within 50 m of where they "
                "were seen from, and recall@10 % the share with the true cell among the best tenth "
                "of all cells. Types are the classes of the objects that are seen, in their order, "
                "and angles their directions."
            ),
            (
                "Shares have intervals of 95 % (Wilson), which show the random error of the "
                "sample of queries. Ties are scored by their expectation."
            ),
            *results.missing,
        ),
        settings=(
            ("City", str(settings["database"])),
            ("Cells", f"{len(results.database):,}"),
            ("Queries of each experiment", f"{settings['queries']:,}"),
            ("Seed", str(settings["seed"])),
            *first.versions.items(),
        ),
        command=command,
        sections=(
            _level_section(results),
            _object_section(results),
            _database_section(results),
            *_example_sections(results),
            _distortion_section(results),
            *(comparison.section(results) for comparison in COMPARISONS),
            _time_section(results),
            _unambiguous_section(results),
            *_range_sections(results),
            _scale_section(results),
            _reading_section(results),
            _likelihood_section(results),
        ),
        taxonomy=results.database.taxonomy,
        credits=results.database.licenses,
        facts={"settings": dict(settings), "versions": dict(first.versions), "machine": machine()},
    )


def reproduction_headline(results: Reproduction) -> str:
    """Return one sentence with the paper's and our figure of the recommended method."""
    best, ours = case_of(results, "medium", BEST), case_of(results, "ours", OURS, "medium")
    shares = [short_percent(share_of(case, P50).ours or 0.0) for case in (best, ours)]
    return (
        f"At medium distortion the method that the paper recommends places {shares[0]} of "
        f"{len(best.queries):,} queries within {P50[1]} m (the paper, on Paris: "
        f"{short_percent(PARIS_P50)}); the likelihood method places {shares[1]} of "
        f"{len(ours.queries):,}."
    )


def _section(
    name: str,
    title: str,
    *text: str,
    numbers: Iterable[Number] = (),
    plots: Iterable[Plot] = (),
    scenes: Iterable[Scene] = (),
) -> Section:
    return Section(
        name=name,
        title=title,
        text=text,
        numbers=tuple(numbers),
        plots=tuple(plots),
        scenes=tuple(scenes),
    )


def _shares(
    case: Evaluation, row: str, paper: Mapping[Figure, float | None] | None = None
) -> list[Number]:
    """Return the two shares that the paper gives for its recommended method."""
    return [
        share_of(case, figure).number(row, COLUMNS[figure], (paper or {}).get(figure))
        for figure in (P50, RECALL10)
    ]


def _just_5(results: Reproduction, experiment: str, row: str, column: str) -> Number:
    """Return the recall at 10 % if exactly 5 % of the cells are kept, without further tied cells.

    Then the best 10 % are those of the first stage.
    """
    case = case_of(results, experiment, FIRST_STAGE, "medium")
    radius = case.database["radius_m"]
    paper = paris.ACCURACY.get((radius, case.database["levels"]), (None, None))[1]
    return share_of(case, RECALL10).number(row, column, paper)


# --- The database and the queries ---------------------------------------------------------------


def _object_section(results: Reproduction) -> Section:
    total = sum(paris.OCCURRENCES.values())
    numbers = []
    for item in results.summary["occurrences"]:
        row = paris.TITLES.get(item["name"], item["title"])
        paper = paris.OCCURRENCES.get(item["name"])
        share = None if paper is None else paper / total
        numbers += [
            Number(row, "occurrences", item["number"], paper=paper, decimals=0),
            Number(row, "share of all", item["share"], paper=share),
        ]
    return _section(
        "objects",
        "Street objects",
        "Paper, Table 1. An object counts once in every signature that contains it. The paper "
        "must count in the same way, because its numbers sum to 14 for each of its signatures.",
        numbers=numbers,
    )


def _database_section(results: Reproduction) -> Section:
    facts = results.summary
    numbers = [
        Number(row, "", facts[key], paper=paris.DATABASE[key], unit=unit, decimals=decimals)
        for key, (row, unit, decimals) in FACTS.items()
    ]
    for column, part in enumerate(("type", "angle")):
        for key in GROUP_KEYS:
            paper = float(paris.GROUPS[key][column].replace(",", ""))
            decimals = 1 if key in {"mean", "std"} else 0
            ours = facts["groups"][part][key]
            row = f"groups by {part}: {key}"
            numbers.append(Number(row, "", ours, paper=paper, decimals=decimals))
    for part, paper_share in (("type", paris.UNAMBIGUOUS), ("angle", None)):
        row = f"cells in a group of one, by {part}"
        ours = facts["groups"][part]["unique"]
        numbers.append(Number(row, "", ours, paper=paper_share, decimals=3))
    return _section(
        "database",
        "Database",
        "Paper, Tables 2a and 2b. A group is all cells with the same sequence of types, or of "
        "angle levels. The paper's area is that of its city; ours is that of the cells. Its share "
        "of cells in a group of one is that of its queries, by type or by angle.",
        numbers=numbers,
    )


def _example_sections(results: Reproduction) -> Iterator[Section]:
    evaluation = case_of(results, "medium", BEST)
    yield _section(
        "successful",
        "Successful queries",
        "The first queries of the two-stage fusion at 5 %, medium distortion, with an answer "
        "within 50 m. Signatures are those of the database, before the distortion.",
        scenes=example_scenes(evaluation, results.database, successful=True),
    )
    yield _section(
        "failed",
        "Failed queries",
        "The first queries with an answer farther away. They see few objects of common classes.",
        scenes=example_scenes(evaluation, results.database, successful=False),
    )


def _distortion_section(results: Reproduction) -> Section:
    numbers = []
    for name in DISTORTION_LEVELS:
        level, case = DISTORTIONS[name], level_case(results, name)
        length = float(case.queries["query_length"].mean())
        empty = case.unlocalized / len(case.queries)
        for column, ours, paper in (
            ("errors a query", level.occurrences, paris.ERRORS[name]),
            ("bearing noise, degrees", level.bearing_sigma, paris.BEARING_SIGMA),
            ("noise clipped at, degrees", level.bearing_clip, paris.BEARING_CLIP),
        ):
            numbers.append(Number(name, column, ours, paper=paper, decimals=0))
        numbers.append(Number(name, "mean objects asked", length, decimals=2))
        numbers.append(Number(name, "left empty", empty))
    length = float(case.queries["length"].mean())
    return _section(
        "distortion",
        "Distortion",
        "Each error is, with equal chance, an object missed, an object made up, or a class "
        f"mistaken. Before the distortion, the queries see a mean of {length:.2f} objects.",
        numbers=numbers,
    )


# --- Times --------------------------------------------------------------------------------------


def _time_section(results: Reproduction) -> Section:
    numbers = []
    for measure, name in NAMES.items():
        methods = (f"types:{measure}", f"angles:{measure}", f"{measure}+{measure}:5%")
        for column, method in zip(TIMED_COLUMNS, methods, strict=True):
            ours, paper = 1000.0 * results.seconds[method], paris.QUERY_MS[method]
            row = f"{name} distance"
            numbers.append(Number(row, column, ours, paper=paper, unit="ms", decimals=2))
    return _section(
        "times",
        "Retrieval times",
        "Mean time to compare a query of 14 objects with all cells, for 100 queries, one by one on "
        "one thread. The paper used another computer and another program, so that only orders of "
        f"magnitude can be compared; it has 312,134 cells, we {len(results.database):,}.",
        numbers=numbers,
    )


# --- The recommended method and its parameters --------------------------------------------------


def _level_section(results: Reproduction) -> Section:
    cases = {name: level_case(results, name) for name in ("none", *DISTORTION_LEVELS)}
    highest = {P10: READ_OFF["light_small_error"], RECALL10: READ_OFF["light_recall"]}
    lowest = {P10: READ_OFF["strong_small_error"], RECALL10: READ_OFF["strong_recall"]}
    medium = {P50: PARIS_P50, RECALL10: PARIS_RECALL10}
    paper: dict[str, Mapping[Figure, float | None]]
    paper = {"none": highest, "light": highest, "medium": medium, "strong": lowest}
    numbers = [
        share_of(case, figure).number(name, COLUMNS[figure], paper[name].get(figure))
        for name, case in cases.items()
        for figure in (P10, P50, RECALL10)
    ]
    points = {
        "error": (
            (50.0, PARIS_P50, "medium (table)"),
            (10.0, READ_OFF["light_small_error"], "highest at small errors (text)"),
            (10.0, READ_OFF["strong_small_error"], "lowest at small errors (text)"),
        ),
        "recall": (
            (10.0, PARIS_RECALL10 or 0.0, "medium (table)"),
            (10.0, READ_OFF["light_recall"], "highest of top ranks, more than 0.90 (text)"),
            (10.0, READ_OFF["strong_recall"], "lowest of top ranks (text)"),
        ),
    }
    return _section(
        "levels",
        "The recommended method: edit + edit, 5 %",
        (
            "Only the first candidate counts. For medium distortion the paper prints figures. For "
            "all levels together, its text gives shares of small errors from 0.25 to 0.70, and "
            "recalls of top ranks from 0.50 to more than 0.90, without the level, error and rank. "
            "The highest may be for light or no distortion; it is shown for both."
        ),
        (
            "If cells tie with the last of the 5 %, all of them are kept here. If exactly 5 % are "
            "kept, the best 10 % are those of the first stage, the edit distance of the types; "
            "that recall is shown as well."
        ),
        numbers=[*numbers, _just_5(results, "medium", "medium", JUST_5)],
        plots=_plots("levels", "the recommended method", cases, points),
    )


def _plots(
    name: str,
    subject: str,
    cases: Mapping[str, Evaluation],
    paper: Mapping[str, Points],
    *,
    unambiguous: bool = False,
) -> Iterator[Plot]:
    """Yield plots of the errors and the recalls of all queries, or only of unambiguous ones."""
    for kind in ("error", "recall"):
        curves = [
            curve_of(case, label, kind, is_unambiguous(case) if unambiguous else slice(None))
            for label, case in cases.items()
        ]
        yield plot_of(name, f"{kind.title()} of {subject}", kind, curves, paper.get(kind, ()))


def _unambiguous_section(results: Reproduction) -> Section:
    cases = {name: level_case(results, name) for name in DISTORTION_LEVELS}
    queries = Share.of(is_unambiguous(cases["medium"]).astype(np.float64))
    numbers = [queries.number("queries", "share in a group of one", paris.UNAMBIGUOUS)]
    for name, case in cases.items():
        for figure in (P50, RECALL10):
            share = share_of(case, figure, is_unambiguous(case))
            numbers.append(share.number(name, COLUMNS[figure]))
    return _section(
        "unambiguous",
        "Unambiguous queries",
        "The same for queries from cells with types that no other cell has, before the "
        "distortion. The paper shows these only as plots.",
        numbers=numbers,
        plots=_plots("unambiguous", "unambiguous queries", cases, {}, unambiguous=True),
    )


def _range_sections(results: Reproduction) -> Iterator[Section]:
    """Yield the section about visibility ranges, if there are databases with other ranges."""
    if not results.variants:
        return
    spec = results.database.spec
    names = {radius: f"range-{radius:g}" for radius in results.variants} | {spec.radius: "medium"}
    facts = {**results.variants, spec.radius: results.summary}
    numbers = []
    for radius, name in sorted(names.items()):
        case = case_of(results, name, BEST, "medium")
        p50, recall10 = paris.ACCURACY.get((radius, spec.levels), (None, None))
        row = f"R = {radius:g} m"
        middle = case.queries["length"].between(*MIDDLE_LENGTHS).to_numpy()
        numbers += [
            *_shares(case, row, {P50: p50, RECALL10: recall10}),
            _just_5(results, name, row, JUST_5),
            Number(row, "mean length", facts[radius]["mean_length"], decimals=2),
            share_of(case, P50, middle).number(row, MIDDLE_COLUMN),
        ]
    ranges = {f"R = {radius:g} m": radius for radius in sorted(names)}
    yield _section(
        "ranges",
        "Visibility range",
        (
            "The recommended method, medium distortion, only the first candidate, on newly "
            "built databases."
        ),
        (
            "The last column shows whether the range itself matters, or only the number of "
            "objects that are seen. In the second case, queries that see equally many objects are "
            "found equally often at every range, and differences from the paper are due to the "
            "cities."
        ),
        numbers=numbers,
        plots=[_parameter_plot("ranges", "visibility range in metres", numbers, ranges)],
    )


def _scale_section(results: Reproduction) -> Section:
    spec = results.database.spec
    cases = {spec.levels: level_case(results, "medium")}
    for name in results.experiments:
        if name.startswith("levels-"):
            cases[int(name.removeprefix("levels-"))] = case_of(results, name, BEST, "medium")
    numbers = []
    for levels, case in sorted(cases.items()):
        paper, _ = paris.ACCURACY.get((spec.radius, levels), (None, None))
        numbers.append(share_of(case, P50).number(f"Q = {levels}", COLUMNS[P50], paper))
    rows = {f"Q = {levels}": float(levels) for levels in cases}
    return _section(
        "scales",
        "Angle levels",
        "The same with other numbers of angle levels.",
        numbers=numbers,
        plots=[_parameter_plot("scales", "angle levels", numbers, rows)],
    )


def _parameter_plot(
    name: str, x_label: str, numbers: Iterable[Number], rows: Mapping[str, float]
) -> Plot:
    """Return a plot of our and the paper's shares by a parameter; `rows` has its values by row."""
    curves = []
    for column in (COLUMNS[P50], COLUMNS[RECALL10]):
        ours = [item for item in numbers if item.column == column and item.ours is not None]
        paper = [item for item in ours if item.paper is not None]
        if ours:
            ends = {end: tuple(getattr(item, end) for item in ours) for end in ("low", "high")}
            x, y = tuple(rows[item.row] for item in ours), tuple(item.ours or 0.0 for item in ours)
            curves.append(Curve(label=f"ours, {column}", x=x, y=y, **ends))
        if paper:
            x = tuple(rows[item.row] for item in paper)
            y = tuple(item.paper or 0.0 for item in paper)
            curves.append(Curve(label=f"paper, {column}", x=x, y=y))
    return Plot(
        name=f"{name}-shares",
        title=f"The recommended method by {x_label}",
        x_label=x_label,
        y_label="share of the queries",
        curves=tuple(curves),
    )


# --- Beyond the paper ---------------------------------------------------------------------------


def _reading_section(results: Reproduction) -> Section:
    paper = {P50: PARIS_P50, RECALL10: PARIS_RECALL10}
    numbers: list[Number] = []
    for name, level in READINGS.items():
        for method, scale in ((BEST, "distances from 0 to 1"), ("raw", "raw distances")):
            case = case_of(results, "readings", method, name)
            numbers += _shares(case, f"{level}, {scale}", paper)
    medium = level_case(results, "medium")
    row = "as the first, with the paper's share of unambiguous queries"
    for figure, share in paper.items():
        numbers.append(reweighted(medium, figure).number(row, COLUMNS[figure], share))
    row = "as the first, but just 5 % of the cells are kept, not all that tie"
    numbers.append(_just_5(results, "medium", row, COLUMNS[RECALL10]))
    errors = [n for n in numbers if n.column == COLUMNS[P50] and n.difference is not None]
    nearest = min(errors, key=lambda number: abs(number.difference or 0.0))
    queries = len(case_of(results, "readings", BEST, next(iter(READINGS))).queries)
    return _section(
        "readings",
        "What the paper leaves open",
        (
            "The paper does not say whether a query is sorted again after bearing noise, which "
            "class a false object has, and whether distances are scaled to 0 to 1 before they are "
            "added. This is the recommended method with each of these readings and "
            f"{queries:,} queries of medium distortion. The paper's figures are of Paris."
        ),
        (
            "The last row but one adjusts for the city: it weights the queries of the first "
            f"reading so that {100 * paris.UNAMBIGUOUS:.1f} % are unambiguous, as in the paper."
        ),
        f"Nearest to the paper's {PARIS_P50} is: {nearest.row}, with {nearest.ours:.4f}.",
        numbers=numbers,
    )


def _likelihood_section(results: Reproduction) -> Section:
    cases = {name: case_of(results, "ours", OURS, name) for name in DISTORTION_LEVELS}
    numbers = []
    for name, case in cases.items():
        numbers += _shares(case, f"{name}: likelihood")
        numbers += _shares(level_case(results, name), f"{name}: edit + edit, 5 %")
    return _section(
        "likelihood",
        "The likelihood method",
        "Not in the paper. A noise model of detectors replaces the distances; it does not know the "
        "level of the distortion. The method that the paper recommends is shown for comparison. "
        f"{len(case.queries):,} queries, only the first candidate.",
        numbers=numbers,
        plots=(
            plot_of(
                "likelihood",
                "Error of the likelihood method",
                "error",
                [curve_of(case, name, "error") for name, case in cases.items()],
            ),
            calibration_plot("likelihood", cases),
        ),
    )
