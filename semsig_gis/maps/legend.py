"""How maps draw the signs of the classes of street objects."""

from __future__ import annotations

import itertools
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis import __version__
from semsig_gis.core.colours import (
    CANDIDATE_RAMP,
    CELL_CHANCES,
    CHANCES,
    DRIFT_COLOURS,
    ERROR_RAMP,
    FAILED,
    FOUND_RAMP,
    GROUP_COLOURS,
    OBJECT_COLOURS,
    SHADES,
    SUCCESSFUL,
    VERDICTS,
)
from semsig_gis.core.signs import class_signs
from semsig_gis.evaluation.result import SUCCESS_METRES, SUCCESS_PROBABILITY
from semsig_gis.queries.chain import chain_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.core.signs import ClassSign
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.update import CellChanges
    from semsig_gis.evaluation.identify.result import Identifiability
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.likelihood.locate import Location
    from semsig_gis.matching.search import Localization
    from semsig_gis.objects.changes import ObjectChanges
    from semsig_gis.objects.table import StreetObjects


OUTLINES = {
    "circle": "M-1,0A1,1 0 1 1 1,0A1,1 0 1 1 -1,0Z",
    "square": "M-.9,-.9H.9V.9H-.9Z",
    "diamond": "M0,-1.25L1.25,0L0,1.25L-1.25,0Z",
    "triangle": "M0,-1.2L1.2,1.2H-1.2Z",
    "hexagon": "M0,-1.15L1,-.575V.575L0,1.15L-1,.575V-.575Z",
    "triangle_down": "M0,1.2L1.2,-1.2H-1.2Z",
    "cross": "M-.6,-1.1H.6V-.6H1.1V.6H.6V1.1H-.6V.6H-1.1V-.6H-.6Z",
}
"""Path of an SVG for each shape, around (0, 0), of about the area of a circle of radius 1."""


def sign_svg(sign: ClassSign) -> str:
    """Return a sign as an element of a page."""
    return (
        '<svg class="semsig-sign" viewBox="-1.3 -1.3 2.6 2.6" aria-hidden="true">'
        f'<path d="{OUTLINES[sign.shape]}" fill="{sign.colour}"/>'
        f'<text y="{sign.drop + 0.42:.2f}" font-size="1.2" font-weight="700" '
        f'font-family="system-ui,sans-serif" text-anchor="middle" fill="{sign.ink}">'
        f"{sign.symbol}</text></svg>"
    )


SAME_TYPES, SAME_LEVELS = "#ffffff", "#e69f00"


FLIPPING = "square semsig-flip"
"""A sign whose lightness flips in the dark, as what it explains does."""


LIFTING = "square semsig-lift"
"""A sign that is brighter in the dark, as what it explains is."""


_THRESHOLDS = (10, 25, 50, 100)


_EXPLAINED_BEST = (
    "<p>The best place is where most of the chance is around it; ranks are of single cells.</p>"
)


_HELPERS = 6  # classes that the legend names


def evaluation_legend(evaluation: Evaluation, *, error_limit: str, licenses: Sequence[str]) -> str:
    """Return the legend of a map of errors, as HTML for a ``details`` element with data escaped.

    ``error_limit`` is the error at the end of the colour ramp, with its unit.
    """
    count, distortions = len(evaluation.queries), chain_text(evaluation.asked.distortions)
    successes = int(evaluation.successful.sum())
    best = "the best candidate" if evaluation.top == 1 else f"the best of {evaluation.top:,}"
    shares = "".join(
        f"<tr><td>P(error ≤ {threshold} m)</td><td>{share:.1%}</td></tr>"
        for threshold, share in zip(_THRESHOLDS, evaluation.cdf(_THRESHOLDS), strict=True)
    )
    return (
        "<summary>Localization errors</summary>"
        f"<p>{count:,} queries among {evaluation.database['cells']:,} cells<br>"
        f"Method: {escape(str(evaluation.method))}, {best}<br>"
        f"Distortion: {_alone(distortions or 'none')}</p>"
        f"<table>{shares}</table>"
        f"<p>{_sign(SUCCESSFUL)}{successes:,} successful: within {SUCCESS_METRES} m "
        f"with probability {SUCCESS_PROBABILITY:g} or more<br>"
        f"{_sign(FAILED)}{count - successes:,} failed</p>"
        "<p>Mean expected error nearby"
        f"{_ramp(ERROR_RAMP, '0 m', f'{error_limit}, as bad as a guess', sign='ramp heat')}</p>"
        f"{_shades()}{_sources(licenses)}"
    )


def localization_legend(localization: Localization) -> str:
    """Return the legend of a map of candidates, as HTML with data escaped."""
    candidates = localization.candidates
    more = localization.tied_beyond
    said = "1 more cell is" if more == 1 else f"{more:,} more cells are"
    beyond = f"<br>{said} as good as the last one" if more else ""
    distances = candidates["distance"]
    return (
        "<summary>Candidate places</summary>"
        f"<p>{_asked(localization.query, localization.taxonomy)}"
        f"Method: {escape(str(localization.method))}, by {escape(localization.used)}</p>"
        f"<p>The best {len(candidates):,} of {localization.cells:,} cells{beyond}</p>"
        "<p>Distance to the query (large sign: rank 1)"
        f"{_ramp(CANDIDATE_RAMP, f'{distances.min():.3f}', f'{distances.max():.3f}')}</p>"
        f"{_shades()}{_sources(localization.licenses)}"
    )


def location_legend(location: Location) -> str:
    """Return the legend of a map of chances, as HTML with data escaped."""
    database, estimate = location.posterior.database, location.estimate
    colour = SUCCESSFUL if location.answer.given else FAILED
    told = "The answer" if location.answer.given else "Cannot tell; the best place"
    cells = {share: len(location.posterior.credible_cells(share)) for share in CHANCES}
    shares = "<br>".join(
        f"{_sign(CHANCES[share], FLIPPING)}{share:.0%} in {_cells(cells[share])}"
        for share in CHANCES
    )
    chances = " ".join(
        f"<span style='white-space:nowrap'>{_sign(colour, FLIPPING)}{100.0 * least:g}+</span>"
        for least, colour in sorted(CELL_CHANCES.items(), reverse=True)
    )
    explained = "".join(
        f"<br>{_sign(VERDICTS[verdict])}{text}"
        for verdict, text in (
            ("matched", "matched: a street object"),
            ("misnamed", "misnamed: one of another class"),
            ("missed", "missed: a street object not in the query"),
            ("false", "false: no street object"),
        )
    )
    rays = (
        f"<p>Objects of the query, as rays where they were seen{explained}</p>"
        if location.explanations
        else ""
    )
    return (
        "<summary>Where it was seen</summary>"
        f"<p>{_asked(location.query, database.taxonomy)}"
        f"Method: likelihood, {_alone(location.noise)} noise, {len(database):,} cells</p>"
        f"<p>{_sign(colour)}<b>{told}</b>: within {location.rule.radius:g} m with a chance of "
        f"{location.answer.mass:.1%}; if there, ±&nbsp;{estimate.sigma:.1f}&nbsp;m each way "
        "(ellipse: 90 %)</p>"
        f"{'' if location.answer.given else _EXPLAINED_BEST}"
        f"<p>Chance of a cell, or around it, in percent<br>{chances}</p>"
        f"<p>Regions, the fewest cells that hold<br>{shares}</p>"
        f"<p>{_sign('#ffffff')}Candidates by rank</p>"
        f"{rays}{_shades()}{_sources(database.licenses)}"
    )


def identifiability_legend(told: Identifiability) -> str:
    """Return the legend of a map of where a query can be placed, as HTML with data escaped."""
    facts = told.summary()
    within = f"within {facts['radius_m']:g} m"
    bands = "<br>".join(
        f"{band['from']:.0%} to {band['to']:.0%}: {band['share']:.1%} of the cells"
        for band in reversed(facts["bands"])
    )
    classes = "".join(
        f"<tr><td class='title'>{_alone(item['title'])}</td>"
        f"<td>{100 * item['chance_near']:+.1f} %</td></tr>"
        for item in facts["classes"][:_HELPERS]
    )
    return (
        "<summary>Where a query can be placed</summary>"
        f"<p>{facts['cells']:,} cells, {_alone(facts['noise'])} noise</p>"
        f"<p>Chance that the answer to a query is {within}; {facts['chance_found']:.1%} for the "
        f"mean cell{_ramp(FOUND_RAMP, '0 %', '100 %', sign='ramp semsig-lift')}</p>"
        f"<p>{bands}</p>"
        f"<p>What each class adds to the chance {within}</p><table>{classes}</table>"
        "<p>Click a cell to see what it is taken for.</p>"
        f"{_sources(told.database.licenses)}"
    )


def objects_legend(objects: StreetObjects) -> str:
    """Return the legend of a map of street objects, as HTML with data escaped."""
    signs, counts = class_signs(objects.taxonomy), objects.class_counts
    rows = "".join(
        f"<tr><td>{sign_svg(signs[code])}</td>"
        f"<td class='title'>{_alone(signs[code].title)}</td>"
        f'<td class="count">{count:,}</td></tr>'
        for code, count in counts.items()
    )
    return (
        "<summary>Street objects</summary>"
        f"<p>{len(objects):,} objects of {len(counts)} classes; shapes show from near, letters "
        f"from nearer, and a click tells what is known of one.</p><table>{rows}</table>"
        f"{_sources(map(str, objects.licenses))}"
    )


def _alone(text: str) -> str:
    """Return text from data, in which signs of direction turn no other text."""
    return f"<bdi>{escape(text)}</bdi>"


def _cells(number: int) -> str:
    return "1 cell" if number == 1 else f"{number:,} cells"


def _asked(query: Signature, taxonomy: Taxonomy) -> str:
    """Return what was asked, a line each."""
    asked = []
    if query.codes is not None:
        asked.append(f"Types: {escape(taxonomy.decode(query.codes))}<br>")
    if query.bearings is not None:
        degrees = (round(bearing) % 360 for bearing in query.bearings.tolist())
        asked.append(f"Bearings: {' '.join(f'{value}°' for value in degrees)}<br>")
    return "".join(asked)


def _sign(colour: str, shape: str = "round") -> str:
    return f'<i class="{shape}" style="background:{colour}"></i>'


def _ramp(colours: Iterable[str], low: str, high: str, *, sign: str = "ramp") -> str:
    gradient = f"linear-gradient(to right,{','.join(colours)})"
    return (
        f'<i class="{sign}" style="background:{gradient}"></i>'
        f'<span class="ends"><small>{low}</small><small>{high}</small></span>'
    )


def _shades() -> str:
    """Return what the shades of the cells mean."""
    labels = [f"{low}-{high - 1}" for low, high in itertools.pairwise(SHADES)]
    labels.append(f"{max(SHADES)}+")
    signs = " &ensp;".join(
        f"{_sign(colour, FLIPPING)}{label}"
        for colour, label in zip(SHADES.values(), labels, strict=True)
    )
    return f"<p>Objects seen from a cell<br>{signs}</p>"


def _sources(licenses: Iterable[str]) -> str:
    """Return who is to be named for the data, and under which licence."""
    lines = [f"Data: {_alone(line)}<br>" for line in licenses]
    return f"<p><small>{''.join(lines)}Made with semsig_gis {escape(__version__)}</small></p>"


def ambiguity_legend(sizes: Mapping[str, NDArray[np.int64]], *, licenses: Sequence[str]) -> str:
    """Return the legend of a map of how many cells look the same, as HTML with data escaped.

    ``sizes`` has for every cell how many look the same, by what is compared.
    """
    starts = list(GROUP_COLOURS)
    labels = [
        "no other",
        *(f"{low:,} to {high - 1:,}" for low, high in itertools.pairwise(starts[1:])),
        f"{starts[-1]:,} or more",
    ]
    shares = [
        np.bincount(np.digitize(size, starts), minlength=len(starts) + 1)[1:] / len(size)
        for size in sizes.values()
    ]
    rows = "".join(
        f"<tr><td>{_sign(colour, LIFTING)}{label}</td>"
        + "".join(f"<td>{share:.1%}</td>" for share in line)
        + "</tr>"
        for colour, label, *line in zip(GROUP_COLOURS.values(), labels, *shares, strict=True)
    )
    head = "".join(f"<td><small>{escape(name)}</small></td>" for name in sizes)
    cells = len(next(iter(sizes.values())))
    return (
        "<summary>Cells that look the same</summary>"
        f"<p>{cells:,} cells, by how many look the same</p>"
        f"<table><tr><td></td>{head}</tr>{rows}</table>"
        "<p>Click a cell to see its signature, and to go to cells that look the same:<br>"
        f"{_sign(SAME_TYPES)}same types &ensp;{_sign(SAME_LEVELS)}and angle levels</p>"
        f"{_sources(licenses)}"
    )


def drift_legend(
    cells: CellChanges,
    objects: ObjectChanges | None,
    *,
    taxonomy: Taxonomy,
    licenses: Sequence[str],
) -> str:
    """Return the legend of a map of changes between two dates, as HTML with data escaped.

    ``objects`` is None where the street objects are not at hand.
    """
    kinds = {
        "same": (cells.same, "see what they saw"),
        "changed": (cells.changed, "see something else"),
        "appeared": (cells.appeared, "saw nothing before"),
        "vanished": (cells.vanished, "see nothing now"),
    }
    total = sum(len(rows) for rows, _ in kinds.values())
    lines = "".join(
        f"<tr><td>{_sign(DRIFT_COLOURS[kind], FLIPPING if kind == 'same' else LIFTING)}{title}</td>"
        f"<td>{len(rows):,}</td><td>{len(rows) / total:.1%}</td></tr>"
        for kind, (rows, title) in kinds.items()
    )
    return (
        "<summary>What has changed</summary>"
        f"<p>Cells, of {total:,} before or after</p><table>{lines}</table>"
        f"{'' if objects is None else _drifted(objects, taxonomy)}"
        "<p>Click a cell to see its signature before and after.</p>"
        f"{_sources(licenses)}"
    )


def _drifted(objects: ObjectChanges, taxonomy: Taxonomy) -> str:
    """Return how many objects have changed, and of which classes most."""
    kinds = {
        "added": objects.added,
        "removed": objects.removed,
        "moved": objects.moved,
        "of another class": objects.changed,
    }
    counts = "<br>".join(
        f"{_sign(OBJECT_COLOURS[kind])}{len(rows):,} {kind}" for kind, rows in kinds.items()
    )
    changes = {
        item: item.added + item.removed + item.moved + item.gained + item.lost
        for item in objects.classes
    }
    most = sorted((item for item in changes if changes[item]), key=lambda one: -changes[one])
    rows = "".join(
        f"<tr><td class='title'>{_alone(taxonomy.by_name(item.class_name).title)}</td>"
        f"<td>{item.added:,}</td><td>{item.removed:,}</td><td>{item.moved:,}</td></tr>"
        for item in most[:_HELPERS]
    )
    head = "".join(f"<td><small>{name}</small></td>" for name in ("added", "removed", "moved"))
    table = f"<table><tr><td></td>{head}</tr>{rows}</table>" if most else ""
    return f"<p>Street objects<br>{counts}</p>{table}"
