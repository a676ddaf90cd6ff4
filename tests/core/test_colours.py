"""No colour has two meanings, and overlapping colours are distinguishable for all people.

Colour blindness is simulated after Machado, Oliveira and Fernandes (2009) at full severity, and
colours are as far apart as CIEDE2000 says.
"""

from __future__ import annotations

import itertools
import re
import warnings
from collections import Counter
from importlib import resources
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from semsig_gis.core import (
    ANSWERS,
    CANDIDATE_RAMP,
    CELL_CHANCES,
    CHANCES,
    COLOURS,
    DRIFT_COLOURS,
    FAILURES,
    FAMILIES,
    FOUND_RAMP,
    GROUP_COLOURS,
    OBJECT_COLOURS,
    OUTCOMES,
    RANK_RAMP,
    SAME_LEVELS,
    SAME_TYPES,
    SHADES,
    SHAPES,
    VERDICTS,
    ClassSign,
    ObjectClass,
    Taxonomy,
    class_signs,
)
from semsig_gis.output import (
    AMBIGUITY,
    CLASS_MARKERS,
    IDENTIFIABILITY,
    MARKERS,
    OUTLINES,
    by_outcome,
    mark_svg,
    renderer,
)
from semsig_gis.output.figures import axes, plots, scenes

SIGHTS = {
    "normal": None,
    "deuteranopia": "Deuteranomaly",
    "protanopia": "Protanomaly",
    "tritanopia": "Tritanomaly",
}
APART = 15.0
MARKS = [mark.colour for mark in OUTCOMES.values()]
ANSWER_MARKS = [mark.colour for mark in ANSWERS.values()]


def rgb(colours: list[str]) -> np.ndarray:
    return np.array([list(bytes.fromhex(colour[1:])) for colour in colours]) / 255.0


def flipped(colours: list[str]) -> np.ndarray:
    """Return colours as ``invert(1) hue-rotate(180deg) brightness(1.15)`` of CSS shows them."""
    inverted = 1.0 - rgb(colours)
    turned = 2.0 * (inverted @ [0.213, 0.715, 0.072])[:, None] - inverted
    return np.clip(1.15 * np.clip(turned, 0.0, 1.0), 0.0, 1.0)


def lifted(colours: list[str]) -> np.ndarray:
    """Return colours as ``brightness(1.4)`` of CSS shows them."""
    return np.clip(1.4 * rgb(colours), 0.0, 1.0)


def distances(ones: np.ndarray, others: np.ndarray, sight: str) -> np.ndarray:
    """Return how far apart colours are for a sight, shape (ones, others)."""
    # Imported here, because it takes half a second. It sets how numpy prints.
    with warnings.catch_warnings(), np.printoptions():
        warnings.simplefilter("ignore")  # on optional packages and its tritanopia model
        import colour

        lack = SIGHTS[sight]
        seen_of = colour.matrix_cvd_Machado2009(lack, 1.0).T if lack else np.eye(3)
    labs = []
    for colours in (ones, others):
        light = np.clip(colour.models.eotf_sRGB(colours) @ seen_of, 0.0, 1.0)
        simulated = colour.models.eotf_inverse_sRGB(light)
        labs.append(colour.XYZ_to_Lab(colour.sRGB_to_XYZ(simulated)))
    return np.asarray(colour.delta_E(labs[0][:, None], labs[1][None], method="CIE 2000"))


def script(name: str) -> str:
    return resources.files("semsig_gis.output.html").joinpath("js", name).read_text("utf-8")


(POINTED,) = re.findall(r'highlight: "(#\w{6})"', script("layers.js"))
LIGHT_PAPER, DARK_PAPER = re.findall(r"--paper: (#\w{6})", script("page.css"))
GROUND = re.findall(r'dark \? "(#\w{6})" : "(#\w{6})"', script("ground.js"))
FLIPPED, LIFTED = (
    re.search(pattern, script("page.css"))
    for pattern in (r"invert\(1\) hue-rotate\(180deg\) brightness\(1.15\)", r"brightness\(1.4\)")
)
LIGHT = rgb([LIGHT_PAPER, *SHADES.values(), *(light for _, light in GROUND)])
DARK = np.concatenate(
    [rgb([DARK_PAPER, *(dark for dark, _ in GROUND)]), flipped([*SHADES.values()])]
)
SAME, *CHANGES = DRIFT_COLOURS.values()
FIELD = rgb([*FAILURES.values()])
FOUND = [*FAILURES.values(), *FOUND_RAMP]
RAYS = ("matched", "misnamed", "false")  # the others are thin, grey and dashed on purpose
# What can lie on what, and next to it.
PAIRS = {
    "outcomes": (rgb(MARKS[:1]), rgb(MARKS[1:])),
    "field, light ground": (FIELD, LIGHT),
    "field, dark ground": (FIELD, DARK),
    "outcomes, light ground": (rgb(MARKS), LIGHT),
    "outcomes, dark ground": (rgb(MARKS), DARK),
    "outcomes, field": (rgb(MARKS), FIELD),
    **{
        f"{what}, {name}": (ones, others)
        for name, colours, in_the_dark in (
            ("cells found", FOUND, rgb(FOUND)),
            ("cells that differ", CHANGES, lifted(CHANGES)),
        )
        for what, ones, others in (
            ("outcomes", rgb(MARKS), rgb(colours)),
            ("outcomes in the dark", rgb(MARKS), in_the_dark),
            ("light paper", rgb([LIGHT_PAPER]), rgb(colours)),
            ("dark paper", rgb([DARK_PAPER]), in_the_dark),
            ("what is pointed at", rgb([POINTED]), np.concatenate([rgb(colours), in_the_dark])),
        )
    },
    "cells that look the same": (rgb([SAME_TYPES, SAME_LEVELS]), rgb([*GROUP_COLOURS.values()])),
    "what is pointed at": (rgb([POINTED]), np.concatenate([LIGHT, DARK, FIELD, rgb(MARKS)])),
    "answers": (rgb(ANSWER_MARKS[:1]), rgb(ANSWER_MARKS[1:])),
    "answers, ground": (rgb(ANSWER_MARKS), np.concatenate([LIGHT, DARK])),
    "answers, chances": (rgb(ANSWER_MARKS), rgb([*CELL_CHANCES.values()])),
    "answers, chances in the dark": (rgb(ANSWER_MARKS), flipped([*CELL_CHANCES.values()])),
    "answers, outcomes": (rgb(ANSWER_MARKS), rgb(MARKS)),
    "outcomes, cells that are the same": (rgb(MARKS), rgb([SAME])),
    "outcomes in the dark, cells that are the same": (rgb(MARKS), flipped([SAME])),
    **{
        f"{first}, {second}": (rgb([table[first]]), rgb([table[second]]))
        for table in (VERDICTS, OBJECT_COLOURS)
        for first, second in itertools.combinations(table, 2)
    },
    "rays to objects": (
        rgb([VERDICTS[verdict] for verdict in RAYS]),
        np.concatenate([LIGHT, DARK]),
    ),
    "changes": (rgb(CHANGES), rgb([SAME])),
    "changes in the dark": (lifted(CHANGES), flipped([SAME])),
}


@pytest.mark.parametrize("sight", SIGHTS)
def test_overlapping_colours_are_distinguishable_for_all_people(sight: str) -> None:
    assert FLIPPED
    assert LIFTED
    assert len(GROUND) == 2
    near = {name: float(distances(*pair, sight).min()) for name, pair in PAIRS.items()}
    assert {name: apart for name, apart in near.items() if apart < APART} == {}


@pytest.mark.parametrize("sight", SIGHTS)
def test_class_signs_contrast_with_the_ground_by_fill_or_outline(sight: str) -> None:
    """Eighteen colours are too many to differ, so either the fill or the outline must contrast."""
    edges = {"light": "#222222", "dark": "#e9e9e6"}
    assert 'isDark(map) ? "#e9e9e6" : "#222"' in script("controls.js")
    assert 'dark ? "#131518" : bright ? "#444" : "#fff"' in script("objects.js")
    for ground, edge in edges.items():
        for colour in COLOURS:
            bright = ClassSign("A", "a", "circle", colour).ink == "#000000"
            own = "#131518" if ground == "dark" else "#444444" if bright else "#ffffff"
            sign, fill = rgb([colour, own]), rgb([colour])
            for below in (rgb(MARKS), FIELD):
                assert distances(sign, below, sight).max(axis=0).min() >= APART
            for mark in MARKS:
                assert distances(rgb([mark, edge]), fill, sight).max() >= APART


@pytest.mark.parametrize("sight", SIGHTS)
def test_object_signs_contrast_with_the_ground_by_fill_or_edge(sight: str) -> None:
    light, dark = rgb([SAME, *CHANGES]), np.concatenate([flipped([SAME]), lifted(CHANGES)])
    for signs, edge, below in (
        (VERDICTS, "#222222", LIGHT),
        (VERDICTS, "#e9e9e6", DARK),
        (OBJECT_COLOURS, "#222222", np.concatenate([LIGHT, light])),
        (OBJECT_COLOURS, "#e9e9e6", np.concatenate([DARK, dark])),
    ):
        near = {
            name: float(distances(rgb([fill, edge]), below, sight).max(axis=0).min())
            for name, fill in signs.items()
        }
        assert {name: apart for name, apart in near.items() if apart < APART} == {}


def meanings() -> list[str]:
    """Return what the tables of signs draw anything with, but the classes."""
    tables = (
        *([POINTED], MARKS, ANSWER_MARKS, {*FOUND, *GROUP_COLOURS.values()}),
        *(RANK_RAMP, CANDIDATE_RAMP, SHADES.values(), CELL_CHANCES.values()),
        *(CHANCES.values(), VERDICTS.values(), DRIFT_COLOURS.values()),
        *(OBJECT_COLOURS.values(), [SAME_TYPES, SAME_LEVELS]),
    )
    return [*itertools.chain(*tables)]


def test_no_colour_has_two_meanings() -> None:
    families = [family.colour for family in FAMILIES.values()]
    counts = Counter([*meanings(), *COLOURS, *families])
    assert [colour for colour, count in counts.items() if count > 1] == []


def test_colours_of_reports_have_no_other_meaning() -> None:
    # Their curves and the classes, which no picture has together, are both many things of a kind.
    inks = (plots.INK, plots.GROUND, plots.AXIS, plots.TICK, plots.GRID, plots.SOFT)
    used = {*plots.COLOURS, *inks, *plots.DARK.values(), scenes.ANSWER, axes.CELL_GROUND}
    assert used & {*meanings()} == set()


def test_web_and_qgis_use_the_same_colours() -> None:
    assert len({mark.shape for mark in OUTCOMES.values()}) == len(OUTCOMES)
    root = ET.fromstring(renderer(by_outcome(geometry="point"), "point"))  # noqa: S314 - our own
    for (outcome, mark), category in zip(OUTCOMES.items(), root.iter("category"), strict=True):
        assert (category.get("value"), category.get("label")) == (outcome, outcome)
        symbol = root.find(f".//symbol[@name='{category.get('symbol')}']")
        assert symbol is not None
        options = {item.get("name"): item.get("value") for item in symbol.iter("Option")}
        red, green, blue = bytes.fromhex(mark.colour[1:])
        assert options["color"] == f"{red},{green},{blue},255"
        assert options["name"] == CLASS_MARKERS[mark.shape][0]
        assert f'd="{OUTLINES[mark.shape]}" fill="{mark.colour}"' in mark_svg(mark)
    labels = ("no other", "2 to 9", "10 to 99", "100 to 999", "1,000 to 9,999", "10,000 or more")
    assert AMBIGUITY.labels == labels
    assert AMBIGUITY.colours == tuple(GROUP_COLOURS.values())
    assert IDENTIFIABILITY.colours == FOUND_RAMP


def test_well_found_is_the_bright_end_of_the_same_ramp_on_every_map() -> None:
    assert [*FAILURES.values()] == [*GROUP_COLOURS.values()]
    assert FOUND_RAMP[-1] == FAILURES[0.0]
    assert FOUND_RAMP[0] == FAILURES[0.9]
    for colours in (FOUND_RAMP, [*FAILURES.values()][::-1]):
        assert np.all(np.diff([luminance(colour) for colour in colours]) > 0.0)


# --- Signs of classes ---------------------------------------------------------------------------

MANY = Taxonomy(
    tuple(ObjectClass(code, chr(64 + code), f"c{code}", f"C {code}") for code in range(1, 27))
)


def luminance(colour: str) -> float:
    shares = np.array(list(bytes.fromhex(colour[1:]))) / 255.0
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_signs_do_not_depend_on_the_order_of_classes() -> None:
    signs = class_signs(MANY)
    assert class_signs(Taxonomy(MANY.classes[::-1])) == signs
    for item in MANY.classes:
        assert (signs[item.code].symbol, signs[item.code].title) == (item.symbol, item.title)


def test_signs_differ_in_colour_or_shape() -> None:
    signs = list(class_signs(MANY).values())
    assert len({sign.colour for sign in signs[:18]}) == 18
    assert len({(sign.colour, sign.shape) for sign in signs}) == 26
    for sign, following in itertools.pairwise(signs):
        assert sign.shape != following.shape
        assert sign.colour != following.colour


@pytest.mark.parametrize("colour", [*COLOURS, "#000000", "#ffffff", "#777777"])
def test_letter_contrasts_with_its_shape(colour: str) -> None:
    sign = ClassSign("A", "a class", "circle", colour)
    assert sign.ink in {"#000000", "#ffffff"}
    darker, lighter = sorted((luminance(sign.ink), luminance(colour)))
    assert (lighter + 0.05) / (darker + 0.05) >= 4.5


def test_every_output_format_draws_every_shape() -> None:
    assert list(OUTLINES) == list(CLASS_MARKERS) == list(MARKERS) == list(SHAPES)
