"""Surveys: a plain loop over the places along streets, and the sentences and tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from sentences import refused
from worlds import objects_of, surroundings

from semsig_gis.core import EmptyResultError, ObjectClass, Taxonomy
from semsig_gis.database import SEEN, Footprints, hidden, survey
from semsig_gis.objects import ConflationReport, Loaded, LoadReport
from semsig_gis.output import survey_sentence, survey_tables

if TYPE_CHECKING:
    from semsig_gis.objects import StreetObjects

CLASSES = Taxonomy(
    (
        ObjectClass(1, "B", "tree", "Tree", family="furniture"),
        ObjectClass(200, "s", "bakery", "Bakery", family="shop", range_m=45.0),
        ObjectClass(201, "c", "church", "Church", family="worship"),
        ObjectClass(224, "o", "own", "Own"),
    )
)


def at(x: float, y: float) -> tuple[float, float]:
    return 700_000.0 + x, 6_600_000.0 + y


# Position along the street, class code and layer.
OPTIONAL = [(0, 1, "a"), (10, 200, "a"), (20, 1, "huts"), (40, 200, "huts"), (90, 200, "huts")]
STREET = shapely.LineString([at(0, 0), at(95, 0)])
LANE = shapely.MultiLineString([[at(0, 40), at(3, 40)], [at(0, 0), at(0, 40)]])
WALL = shapely.box(*at(20, 2), *at(60, 6))


def random_objects(seed: int, codes: tuple[int, ...]) -> StreetObjects:
    rng = np.random.default_rng(seed)
    places = rng.uniform(-10, 110, (60, 2)).tolist()
    things = [
        (*at(x, y), int(rng.choice(codes)), "layer", str(row)) for row, (x, y) in enumerate(places)
    ]
    return objects_of(*things, licenses=(), taxonomy=CLASSES)


def loaded(objects: StreetObjects, streets: Any = None, buildings: Any = None) -> Loaded:  # noqa: ANN401
    return Loaded(
        objects=objects,
        report=LoadReport(()),
        conflation=ConflationReport(()),
        buildings=buildings,
        streets=streets,
    )


def ranges(counts: list[int]) -> tuple[float, ...]:
    labels = [
        next(label for least, label in zip((10, 5, 1, 0), SEEN[::-1], strict=True) if n >= least)
        for n in counts
    ]
    return tuple(labels.count(label) / len(labels) for label in SEEN)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("walled", [False, True])
def test_a_survey_equals_a_plain_loop(seed: int, *, walled: bool) -> None:
    objects = random_objects(seed, (1, 200, 201, 224))
    area = shapely.box(*at(-20, -20), *at(200, 30))
    buildings = surroundings(WALL) if walled else None
    result = survey(loaded(objects, surroundings(STREET, LANE), buildings), area=area)
    # Ten places along the street and three along what is in the area of the lane.
    places = [at(9.5 * (step + 0.5), 0) for step in range(10)]
    places += [at(0, 10 * (step + 0.5)) for step in range(3)]
    families = {"furniture": (1, 224), "shop": (200,), "worship": (201,)}
    counts: dict[str, list[int]] = {name: [0] * len(places) for name in families}
    wall = Footprints([WALL])
    for number, place in enumerate(places):
        ends = np.tile(place, (len(objects), 1))
        behind = hidden(ends, objects.xy, footprints=wall) & walled
        for code, xy, out in zip(objects.codes, objects.xy, behind, strict=True):
            near = math.dist(place, xy) <= (45.0 if code == 200 else 30.0)
            for name, codes in families.items():
                counts[name][number] += code in codes and near and not out
    assert [item.family for item in result.families] == list(families)
    assert (result.places, result.along_streets, result.occlusion) == (13, True, walled)
    assert result.street_km == pytest.approx(0.125)
    total = np.zeros(len(places), int)
    inside = objects.xy[:, 1] <= at(0, 30)[1]
    for item, (name, codes) in zip(result.families, families.items(), strict=True):
        total += counts[name]
        assert item.own == pytest.approx(ranges(counts[name]))
        assert item.added == pytest.approx(ranges(total.tolist()))
        assert item.objects == (np.isin(objects.codes, codes) & inside).sum()
        assert item.per_km == pytest.approx(item.objects / 0.125)


def test_without_streets_places_are_outdoors() -> None:
    objects = random_objects(0, (201,))
    result = survey(loaded(objects, buildings=surroundings(WALL)), radius=10.0)
    assert not result.along_streets
    furniture, worship = result.families
    assert furniture.own == (1.0, 0.0, 0.0, 0.0)
    assert (furniture.objects, furniture.per_km, worship.per_km) == (0, None, None)
    assert 0.9 * 144 < result.places < 169
    sentence = survey_sentence(result)
    assert sentence.startswith(f"60 objects {result.town}. Of {result.places} places outdoors, ")
    first, _, last = survey_tables(result)
    assert [row[0] for row in first.rows] == ["Street furniture", "+ Places of worship"]
    assert last.rows[0] == ("Street furniture", "0", "0", "")


def test_the_points_of_an_extended_thing_are_one_object() -> None:
    points = [(*at(x, 10), 1, "layer", f"way/{x}") for x in (0, 5, 10, 20, 25, 30)]
    objects = objects_of(*points, licenses=(), taxonomy=CLASSES, group=[0, 0, 0, 7, 7, -1])
    (furniture,) = survey(loaded(objects, surroundings(STREET))).families
    assert furniture.objects == 3


def test_optional_layers_come_last() -> None:
    things = [(*at(x, 0), code, layer, str(x)) for x, code, layer in OPTIONAL]
    objects = objects_of(*things, licenses=(), taxonomy=CLASSES)
    town = loaded(objects, surroundings(STREET))
    result = survey(town, optional=["huts", "nothing"])
    rows = [(item.family, item.optional, item.objects) for item in result.families]
    assert rows == [
        ("furniture", False, 1),
        ("shop", False, 1),
        ("furniture", True, 1),
        ("shop", True, 2),
    ]
    places = [row for row, (_, _, layer) in enumerate(OPTIONAL) if layer != "huts"]
    plain = survey(
        loaded(
            objects_of(*(things[row] for row in places), licenses=(), taxonomy=CLASSES),
            surroundings(STREET),
        )
    )
    assert (result.objects, result.seen) == (plain.objects, plain.seen)
    assert result.families[:2] == plain.families
    assert result.families[-1].added == survey(town).seen
    first, *_ = survey_tables(result)
    assert first.rows[-1][0] == "+ Shops (optional)"


def test_many_places_are_sampled(monkeypatch: pytest.MonkeyPatch) -> None:
    objects = random_objects(0, (1,))
    monkeypatch.setattr("semsig_gis.database.street_survey.MOST_PLACES", 7)
    assert survey(loaded(objects, surroundings(STREET))).places == 7
    assert survey(loaded(objects)).places <= 7


def test_a_survey_without_a_place_is_refused() -> None:
    objects = random_objects(0, (1,))
    house = surroundings(shapely.box(*at(-100, -100), *at(300, 300)))
    with refused(EmptyResultError, "no place outside the buildings"):
        survey(loaded(objects, surroundings(STREET), house))
