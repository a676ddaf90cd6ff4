"""Write result files into the documentation: ``python -m benchmarks.tables``."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING, Any

from benchmarks._accuracy_rows import PRECISIONS
from benchmarks._measuring import FOLDER, INPUTS, LAST_ONLY, read_rows
from benchmarks.see_more import bars as bars_of_more
from benchmarks.views import FULL_TURN, KNOWN, NORTHS, RANGES, SECTORS
from benchmarks.views import bars as bars_of_views

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

__all__ = ["main", "page"]

TODAY = "of the day"
"""Value of ``map`` in the rows of ``chances.json`` with a current map."""
PAGE = FOLDER.parent / "docs" / "figures.md"
TRUST = FOLDER.parent / "docs" / "reliability.md"
PHOTOGRAPHS = FOLDER.parent / "docs" / "real_photographs.md"
_END = "<!-- end -->"

_HEAD = """# Figures

This page is written by `python -m benchmarks.tables`, which `make bench`, `make accuracy`,
`make views`, `make bayes`, `make chances`, `make see-more` and `make reproduce` end with. All
figures are from one machine with two cores that other programs share, so ratios are more reliable
than times.
"""
_ACCURACY = """## Accuracy

`make accuracy` draws {queries:,} cells of a city, distorts their signatures, and localizes all of
them with every method. `light`, `medium` and `strong` are 1, 7 and 13 errors (missed, false, or of
a false class) and bearing noise of 5 degrees. `edit+edit:5%` is the best method that the paper
reports. The error is that of the best place; the interval of 95 % is Wilson's. "On the grid", a
query is seen from the centre of a cell, as in the paper; off the grid, from anywhere in it.
"""
_CHANCES = """## Chances

The likelihood method states a chance with each answer. "Stated" is its mean chance to be within
50 m, "came true" how often it was. A region of 90 % consists of whole cells, so its chance is
somewhat higher: "stated" is this chance, "holds" how often the true cell is in the region, and
"just 90 %" how often it is if the least likely cells of the region count only in part, so that the
chance is exactly 90 %.
"""
_SURE = """## Answers

The likelihood method gives an answer, or "cannot tell". The threshold is chosen on half of the
`medium` queries so that 98 % of the answers are right, with a confidence of 95 %; the table shows
the other halves. To show that takes at least 217 answers, all right: a city where fewer of the
thousand queries can be answered gets no threshold, and answers nothing. The last columns do not
depend on a threshold chosen before: they are the largest shares of the queries, those with the
highest chances, that could be answered with 90, 95 and 98 % of the answers right.
"""
_BARS = """## Targets

The target of each figure of accuracy, and the value that was measured.
"""
_VIEWS = """## Views

`make views` localizes up to {queries} queries for each line, of a camera that sees 70, 120 or 360
degrees. The detector finds 80 % of the objects, misnames 10 % of these, is 4 degrees out and makes
up one object in a full turn; the likelihood method has this noise model. The columns have the same
queries: as if they were full turns, with their sectors, or with sectors and distances that are 25 %
off. The figures are the shares with a best place within 50 m, with Wilson's intervals of 95 %.
Lines with {photos} photos are routes: the photos are 20 m apart, in random directions, with known
legs, and the last place is localized; "last only" is the same with only the last photo. "Cells"
means that queries are seen from the centres of cells, "anywhere" from random places in them. Places
are not refined.
"""
_VIEW_CHANCES = """The same lines: how often the true cell is in the region of just 90 %, and how
far off, at most, the stated chance is in a tenth of the chance with 100 queries or more.
"""
_BAYES = """### Upper bound for all methods

`make bayes` localizes {queries} queries for each line in a made-up city of {cells} cells, small
enough for exact sums over all one-to-one associations of detections and objects. With the noise
model and the cameras of the views, this gives the exact chances by Bayes' rule. "At most" is the
mean chance of the best place within 50 m: no method is right more often in the long run. "By Bayes"
is how often that place was right. The next columns are the same share for the likelihood method,
for the same queries of one to fourteen detections, and the chance that it states.
"""
_VIEW_BARS = """The target of each figure of views, and the value that was measured.
"""
_REAL = """## Chances in real cities

`make chances` localizes queries from anywhere in a city, {queries} at each of `light`, `medium` and
`strong`, with the settings of `semsig localize`: generic noise, refined places. "Stated" is the
mean chance to be within 50 m, of the queries in a tenth; "came true" is how often it was. Queries
without any object left are not counted.
"""
_OLD = """## Old maps

`make chances` also uses maps that are older than the queries ({queries} at each of `light` and
`medium`). For Monaco there is real data of two dates, and the built-in drift report is of its
changes. The other cities are changed for three years, by rules that the noise model does not have:
single objects are removed, added and moved; in whole streets lamps are replaced, and trees felled
and planted again; and new rows appear. "Settings" is what the method gets: nothing, the age of the
map (`--map-age`) with the changes of Monaco, or with a drift report of another simulated first year
of the city (`--drift-report`). "Answered" are the queries with a chance of 0.9 or more.
"""
_PAPER = """## The paper's experiments

`make reproduce` runs them on a made-up city with as many cells and objects as the paper's Paris,
with 10,000 queries each, and writes a report with all plots into `reproduction/`. The table has the
numbers that the paper prints as well, with intervals of 95 %. Numbers that were read off plots of
the paper are marked in the report.
"""
_SEE_MORE = """## More kinds of things

`make see-more` localizes {queries} views for each line and north, from random places in the street
cells of a city, the same places for every line. A person finds 70 % of the things in sight,
misnames 5 % of these, is 8 degrees out and makes up one in five views; the likelihood method has
this noise model. From line to line more kinds of things are on the map. The figures are the share
of all views with a best place within 50 m (100 m in the last line of a city), and in brackets the
share that is answered with a chance of 0.9 or more, and how many of these are right. The region is
the median of the regions of 90 %, with north known; "off" is how far the stated chances are off on
the average of their tenths, at most for any north.
"""
_SEE_MORE_BARS = """The target of each figure of more kinds of things, and what was measured.
"""
_SPEED = """## Speed

`make bench` times ours and a peer in turns, in one process, and takes the medians. The paper's
times are for 312,134 cells, on its own machine.
"""

# Titles of the columns of tables.
_ACCURACY_HEAD = (
    "noise | method | setting | <= 25 m | <= 50 m | interval | ten objects or more | "
    "recall@10 % | ms"
)
_CHANCE_HEAD = (
    "city | noise | method | setting | stated | came true | region: stated | holds | just 90 %"
)
_ANSWER_HEAD = (
    "city | noise | queries | answered | right, of these | most, 90 % right | 95 % right | "
    "98 % right"
)
_BAYES_HEAD = (
    "degrees | ranges | detections | at most | by Bayes | the likelihood method | interval | stated"
)
_SEE_MORE_HEAD = (
    "city | on the map | north known | 10 degrees off | unknown | region, m² | chances off"
)
_REAL_HEAD = "city | chance | queries | stated | came true | interval"
_OLD_HEAD = (
    "city | map | settings | within 50 m | stated | answered | right, of these | "
    "interval | right, of those below 0.99"
)
_BAR_HEAD = "city | figure | target | measured | reached"
_PAPER_HEAD = "experiment | case | figure | ours | interval | the paper"
_PHOTOGRAPHS_HEAD = (
    "method | set | detections | views | <= 5 m | <= 10 m | <= 25 m | <= 50 m | answered | right | "
    "Brier | calibration error | heading error (degrees) | s"
)
_SPEED_HEAD = "figure | ours | peer | times better | target | the paper"


def main() -> None:
    """Write the page of figures, and the tables of the soak and of real photographs."""
    names = ("accuracy", "results", "reproduction", "chances", "views")
    results = [read_rows(FOLDER / f"{name}.json") for name in names]
    bayes, more = (read_rows(FOLDER / f"{name}.json") for name in ("bayes", "see_more"))
    PAGE.write_text(page(*results, bayes=bayes, see_more=more), encoding="utf-8")
    TRUST.write_text(
        trust_page(TRUST.read_text(encoding="utf-8"), read_rows(FOLDER / "soak.json")),
        encoding="utf-8",
    )
    PHOTOGRAPHS.write_text(
        photographs_page(
            PHOTOGRAPHS.read_text(encoding="utf-8"),
            json.loads((FOLDER / "real_photographs.json").read_text(encoding="utf-8")),
        ),
        encoding="utf-8",
    )
    for path in (PAGE, TRUST, PHOTOGRAPHS):
        print(f"wrote {path.relative_to(FOLDER.parent)}")


def page(
    accuracy: Sequence[dict[str, Any]],
    speed: Sequence[dict[str, Any]],
    paper: Sequence[dict[str, Any]],
    chances: Sequence[dict[str, Any]],
    views: Sequence[dict[str, Any]],
    *,
    bayes: Sequence[dict[str, Any]],
    see_more: Sequence[dict[str, Any]] = (),
) -> str:
    """Return the page of figures as Markdown, from the rows of the files of results.

    `speed` are the rows of ``results.json``, `paper` of ``reproduction.json``, the others of the
    file of their name.
    """
    parts = [_HEAD]
    plain = [row for row in accuracy if row["coverage"] is None]
    if plain:
        parts.append(_ACCURACY.format(queries=plain[0]["queries"]))
    for city in dict.fromkeys(row["city"] for row in plain):
        in_city = [row for row in plain if row["city"] == city]
        parts += [
            f"### {city}, {in_city[0]['cells']:,} cells\n",
            _table(_ACCURACY_HEAD, _accuracy_cells, in_city),
        ]
    with_regions = [row for row in plain if row["in_region"] is not None]
    sure = [row for row in accuracy if row["coverage"] is not None]
    real = [row for row in chances if row["map"] == TODAY]
    old = [row for row in chances if row["map"] != TODAY]
    bars = [{**bar, "city": row["city"]} for row in accuracy for bar in row["bars"]]
    more_bars = [{**bar.to_dict(), "city": city} for city, bar in bars_of_more(see_more)]
    view_bars = [{**bar.to_dict(), "city": city} for city, bar in bars_of_views(views)]
    sections = (
        (_CHANCES, with_regions, partial(_table, _CHANCE_HEAD, _chance_cells)),
        (_SURE, sure, partial(_table, _ANSWER_HEAD, _answer_cells)),
        (_views_text(views), views, partial(_view_table, _view_cell)),
        (_VIEW_CHANCES, views, partial(_view_table, _view_chance_cell)),
        (_VIEW_BARS, view_bars, partial(_table, _BAR_HEAD, _bar_cells)),
        (_bayes_text(bayes), bayes, partial(_table, _BAYES_HEAD, _bayes_cells)),
        (_more_text(see_more), see_more, _more_table),
        (_SEE_MORE_BARS, more_bars, partial(_table, _BAR_HEAD, _bar_cells)),
        (_each_level(_REAL, real), real, _real_table),
        (_each_level(_OLD, old), old, partial(_table, _OLD_HEAD, _old_cells)),
        (_BARS, bars, partial(_table, _BAR_HEAD, _bar_cells)),
        (_PAPER, paper, partial(_table, _PAPER_HEAD, _paper_cells)),
        (_SPEED, speed, partial(_table, _SPEED_HEAD, _speed_cells)),
    )
    for text, rows, table in sections:
        if rows:
            parts += [text, table(rows)]
    return "\n".join(parts)


def _paper_cells(row: Mapping[str, Any]) -> Sequence[str]:
    return (
        *(row["section"], row["row"], row["column"]),
        _number(row["ours"], row["unit"]),
        "" if row["low"] is None else f"{row['low']:.4f}-{row['high']:.4f}",
        _number(row["paper"], row["unit"]),
    )


def _number(value: float, unit: str) -> str:
    large = abs(value) >= 1000  # noqa: PLR2004 - then it is a count
    return f"{value:,.0f}{unit and ' '}{unit}" if large else f"{value:.4g}{unit and ' '}{unit}"


def _accuracy_cells(row: Mapping[str, Any]) -> Sequence[str]:
    return (
        *(row["distortion"], f"`{row['method']}`", row["setting"]),
        *(_share(row["p25"]), _share(row["p50"])),
        f"{_share(row['p50_low'])}-{_share(row['p50_high'])}",
        *(_share(row["p50_ten"]), _share(row["recall10pct"])),
        f"{row['ms_per_query']:.3g}",
    )


def _chance_cells(row: Mapping[str, Any]) -> Sequence[str]:
    names = ("chance", "p50", "region_mass", "in_region", "in_exact_region")
    return (
        *(row["city"], row["distortion"], f"`{row['method']}`", row["setting"]),
        *(_share(row[name]) for name in names),
    )


def _answer_cells(row: Mapping[str, Any]) -> Sequence[str]:
    return (
        *(row["city"], row["distortion"], f"{row['queries']:,}"),
        *(_share(row["coverage"]), _share(row["precision"])),
        *(_share(row[f"most_at_{share}"]) for share in PRECISIONS),
    )


def _each_level(text: str, rows: Sequence[dict[str, Any]]) -> str:
    """Fill in the number of queries at each level."""
    return text.format(queries=rows[0]["queries"] // len(rows[0]["levels"])) if rows else text


def _views_text(rows: Sequence[dict[str, Any]]) -> str:
    """Fill in the numbers of queries of a line and of photos of a route."""
    if not rows:
        return ""
    queries, photos = (max(row[name] for row in rows) for name in ("queries", "photos"))
    return _VIEWS.format(queries=f"{queries:,}", photos=photos)


def _view_cell(row: Mapping[str, Any]) -> str:
    last = f"; last only {_share(row[LAST_ONLY])}" if LAST_ONLY in row else ""
    return f"{_share(row['p50'])} ({_share(row['p50_low'])}-{_share(row['p50_high'])}){last}"


def _view_chance_cell(row: Mapping[str, Any]) -> str:
    return _share(row["in_region"]) + (f", off {_share(row['off'])}" if row["off"] else "")


def _bayes_text(rows: Sequence[dict[str, Any]]) -> str:
    """Fill in the numbers of queries of a line and of cells of the city."""
    if not rows:
        return ""
    return _BAYES.format(**{name: f"{rows[0][name]:,}" for name in ("queries", "cells")})


def _bayes_cells(row: Mapping[str, Any]) -> Sequence[str]:
    return (
        *(str(row["degrees"]), "yes" if row["ranges"] else "no"),
        f"{row['detections']:.1f}",
        f"{_share(row['limit'])} ± {_share(row['limit_error'])}",
        *(_share(row["bayes"]), _share(row["ours"]), _interval(row)),
        _share(row["stated"]),
    )


def _more_text(rows: Sequence[dict[str, Any]]) -> str:
    """Fill in the number of views of a line."""
    return _SEE_MORE.format(queries=f"{max(row['queries'] for row in rows):,}") if rows else ""


def _more_table(rows: Iterable[dict[str, Any]]) -> str:
    """Return a table with a line for each kind of map, and a column for each north."""
    lines: dict[tuple[str, str], dict[str, dict[str, Any]]] = {}
    for row in rows:
        lines.setdefault((row["city"], row["line"]), {})[row["heading"]] = row
    cells = (
        [
            *key,
            *(_more_cell(by_north[north]) if north in by_north else "" for north in NORTHS),
            f"{by_north[KNOWN]['region_m2'] or 0:,.0f}" if KNOWN in by_north else "",
            _share(max(row["gap"] or 0.0 for row in by_north.values())),
        ]
        for key, by_north in lines.items()
    )
    return _table(_SEE_MORE_HEAD, list, cells)


def _more_cell(row: Mapping[str, Any]) -> str:
    answered = _share(row["answered"] / row["queries"])
    right = f"; {_share(row['right'] / row['answered'])}" if row["answered"] else ""
    return f"{_share(row['near'])} ({answered}{right})"


def _view_table(cell: Callable[[Mapping[str, Any]], str], rows: Iterable[dict[str, Any]]) -> str:
    """Return a table with a line for each kind of view, and a column for the inputs."""
    columns = (FULL_TURN, SECTORS, RANGES)
    names = ("city", "seen_from", "photos", "degrees", "queries", "least", "heading")
    lines: dict[tuple[Any, ...], dict[str, str]] = {}
    for row in rows:
        lines.setdefault(tuple(row[name] for name in names), {})[row[INPUTS]] = cell(row)
    titles = ("city", "from", "photos", "degrees", "queries", "detections", "heading", *columns)
    cells = (
        [*map(str, key[:4]), f"{key[4]:,}", f"{key[5]} or more", key[6]]
        + [values.get(column, "") for column in columns]
        for key, values in lines.items()
    )
    return _table(" | ".join(titles), list, cells)


def _real_table(rows: Iterable[dict[str, Any]]) -> str:
    tenths = ({"city": row["city"], **tenth} for row in rows for tenth in row["bins"])
    return _table(_REAL_HEAD, _real_cells, tenths)


def _real_cells(tenth: Mapping[str, Any]) -> Sequence[str]:
    return (
        *(tenth["city"], f"{tenth['from']:g} to {tenth['to']:g}", f"{tenth['n']:,}"),
        *(_share(tenth["stated"]), _share(tenth["true"])),
        _interval(tenth),
    )


def _old_cells(row: Mapping[str, Any]) -> Sequence[str]:
    return (
        *(row["city"], row["map"], f"`{row[INPUTS]}`" if row[INPUTS] else "nothing"),
        *(_share(row["p50"]), _share(row["stated"])),
        f"{row['answered']} of {row['queries']}",
        f"{row['right'] / row['answered']:.3f}",
        _interval(row),
        f"{row['nearly_right']} of {row['nearly']}",
    )


def _interval(values: Mapping[str, Any]) -> str:
    low, high = values["low"], values["high"]
    return "" if low is None else f"{_share(low)}-{_share(high)}"


def _bar_cells(row: Mapping[str, Any]) -> Sequence[str]:
    return (
        *(row["city"], row["what"]),
        " to ".join(f"{end:g}" for end in (row["low"], row["high"]) if end is not None),
        "infinite" if row["value"] is None else f"{row['value']:.3f}",
        "yes" if row["met"] else "no",
    )


def _speed_cells(row: Mapping[str, Any]) -> Sequence[str]:
    return (
        row["name"],
        f"{row['ours']:,.4g} {row['unit']}",
        f"{row['peer']:,.4g} {row['unit']} ({row['peer_name']})",
        f"{row['ratio']:.3g}",
        "" if row["bar"] is None else f"{row['bar']:.3g}{'' if row['met'] else ', missed'}",
        "" if row["paper"] is None else f"{row['paper']:,.4g} {row['unit']}",
    )


def trust_page(text: str, rows: Iterable[dict[str, Any]]) -> str:
    """Return the page ``reliability.md`` with its table replaced, from rows of ``soak.json``."""
    return _with_table(text, "<!-- make soak -->\n", soak_table(rows))


def photographs_page(text: str, result: Mapping[str, Any]) -> str:
    """Return ``real_photographs.md`` with its table replaced, from ``real_photographs.json``."""
    table = _table(_PHOTOGRAPHS_HEAD, _photograph_cells, result["table"])
    return _with_table(text, "<!-- make photographs -->\n", table)


def _photograph_cells(row: Mapping[str, Any]) -> Sequence[str]:
    shares = ("p5", "p10", "p25", "p50", "answered", "right", "brier", "calibration_error")
    heading = row["heading_error"]
    return [
        *(str(row[name]) for name in ("method", "set", "detections", "n")),
        *(_share(row[name]) for name in shares),
        "" if heading is None else f"{heading:.1f}",
        f"{row['seconds']:.3f}",
    ]


def _with_table(text: str, mark: str, table: str) -> str:
    """Return a page with the table after a mark replaced."""
    before, _, rest = text.partition(mark)
    after = rest.partition(_END)[2]
    return f"{before}{mark}\n{table}\n{_END}{after}"


def soak_table(rows: Iterable[dict[str, Any]]) -> str:
    """Return the table of the trials of a soak as Markdown, from rows of ``soak.json``."""
    rows = list(rows)
    counts = list(rows[0])[1:]
    total = {"part": "all"} | {name: sum(row[name] for row in rows) for name in counts}
    return _table(
        " | ".join(["trial", *counts]),
        lambda row: [row["part"], *(f"{row[name]:,}" for name in counts)],
        [*rows, total],
    )


def _table(head: str, cells: Callable[[Any], Sequence[str]], rows: Iterable[Any]) -> str:
    """Return a table with the cells of each row; the titles of `head` are separated by bars."""
    titles = head.split(" | ")
    lines = [titles, ["---"] * len(titles), *map(cells, rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _share(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


if __name__ == "__main__":
    main()
