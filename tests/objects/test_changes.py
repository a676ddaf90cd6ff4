from __future__ import annotations

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from raw_layers import raw_layer
from sentences import refused
from worlds import CODES, TAXONOMY

from semsig_gis.core.errors import CrsError, InputError
from semsig_gis.core.taxonomy import ObjectClass, Taxonomy
from semsig_gis.objects.changes import compare_objects, replace_layers
from semsig_gis.objects.load import build_objects
from semsig_gis.objects.table import Licence, StreetObjects, open_objects, save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.objects.changes import ObjectChanges

TREE, FOUNTAIN, LAMP = CODES[:3]
KINDS = ("same", "moved", "changed", "removed", "added")
Thing = tuple[float, float, int, str, str]  # x, y, class code, source, id


def table(
    *things: Thing,
    licenses: tuple[Licence, ...] = (Licence("City (CC0)", ("trees", "lamps")),),
    taxonomy: Taxonomy = TAXONOMY,
    merged: list[str] | None = None,
    crs: str = "EPSG:2154",
) -> StreetObjects:
    x, y, codes, sources, ids = zip(*things, strict=True) if things else ((),) * 5
    columns = {
        "class_code": np.array(codes, np.uint8),
        "source": np.array(sources, object),
        "source_id": np.array(ids, object),
        "count": np.ones(len(things), np.int32),
    }
    if merged is not None:
        columns["merged"] = np.array(merged, object)
    return StreetObjects(
        gpd.GeoDataFrame(columns, geometry=shapely.points(x, y), crs=crs), taxonomy, licenses
    )


def rows_of(changes: ObjectChanges) -> tuple[list[object], ...]:
    return tuple(getattr(changes, name).tolist() for name in KINDS)


OLD = table(
    (0, 0, TREE, "trees", "1"),
    (5, 0, TREE, "trees", "2"),
    (9, 0, LAMP, "lamps", "1"),
    (9, 9, LAMP, "lamps", "2"),
)


def test_added_removed_moved_and_of_another_class() -> None:
    new = table(
        (0, 0, TREE, "trees", "1"),
        (8, 4, TREE, "trees", "2"),
        (9, 0, TREE, "lamps", "1"),
        (7, 7, LAMP, "lamps", "3"),
        (7, 8, LAMP, "lamps", "4"),
    )
    changes = compare_objects(OLD, new)
    assert rows_of(changes) == ([[0, 0]], [[1, 1]], [[2, 2]], [3], [3, 4])
    assert sorted(changes.gone.tolist()) == [1, 2, 3]
    assert sorted(changes.come.tolist()) == [1, 2, 3, 4]
    assert [dataclasses.asdict(change) for change in changes.classes] == [
        {
            "class_name": "alignment_tree", "before": 2, "after": 3, "added": 0, "removed": 0,
            "moved": 1, "moved_m": 5.0, "gained": 1, "lost": 0,
        },
        {
            "class_name": "street_light", "before": 2, "after": 2, "added": 2, "removed": 1,
            "moved": 0, "moved_m": None, "gained": 0, "lost": 1,
        },
    ]  # fmt: skip


def test_of_several_at_one_place_the_one_with_the_id_is_the_same() -> None:
    old = table((0, 0, TREE, "trees", "1"), (0, 0, TREE, "trees", "2"))
    new = table((0, 0, TREE, "trees", "2"), (3, 4, TREE, "trees", "1"))
    assert rows_of(compare_objects(old, new)) == ([[1, 0]], [[0, 1]], [], [], [])


THINGS = st.lists(
    st.tuples(
        st.integers(0, 2).map(float),
        st.integers(0, 1).map(float),
        st.sampled_from([TREE, LAMP]),
        st.sampled_from(["trees", "lamps"]),
        st.sampled_from(["", "1", "2", "3", "4"]),
    ),
    max_size=12,
)


@given(THINGS, THINGS)
def test_every_row_is_told_of_once(before: list[Thing], now: list[Thing]) -> None:
    old, new = table(*before), table(*now)
    changes = compare_objects(old, new)
    old_rows = [*changes.same[:, 0], *changes.gone]
    new_rows = [*changes.same[:, 1], *changes.come]
    assert sorted(old_rows) == list(range(len(old)))
    assert sorted(new_rows) == list(range(len(new)))
    # What is gone and has come is what differs in class and place, and no more.
    looks = [Counter(thing[:3] for thing in things) for things in (before, now)]
    assert Counter(before[row][:3] for row in changes.gone) == looks[0] - looks[1]
    assert Counter(now[row][:3] for row in changes.come) == looks[1] - looks[0]
    for kind, alike in ((changes.moved, True), (changes.changed, False)):
        for row, other in kind:
            assert before[row][3:] == now[other][3:]
            assert before[row][4]
            assert (before[row][2] == now[other][2]) == alike
            for things, number in ((before, row), (now, other)):
                assert [thing[3:] for thing in things].count(things[number][3:]) == 1
    names = {before[row][3:] for row in changes.removed} & {now[row][3:] for row in changes.added}
    for name in names:
        assert (
            not name[1]
            or max([thing[3:] for thing in things].count(name) for things in (before, now)) > 1
        )
    for item in changes.classes:
        gains, losses = item.added + item.gained, item.removed + item.lost
        assert item.after == item.before + gains - losses
    assert sum(item.before for item in changes.classes) == len(old)
    assert sum(item.after for item in changes.classes) == len(new)


def test_layers_that_were_not_loaded_anew_stay() -> None:
    old = table(
        (0, 0, TREE, "trees", "1"),
        (9, 0, LAMP, "lamps", "1"),
        (9, 9, LAMP, "signals", "1"),
        licenses=(Licence("City (CC0)", ("trees", "lamps")), Licence("Roads (OGL)", ("signals",))),
    )
    # The layer of signals was read and is empty now.
    new = table(
        (4, 4, TREE, "trees", "5"),
        licenses=(Licence("City (CC0)", ("trees",)), Licence("Streets (OGL)", ("signals",))),
    )
    objects, kept, notes = replace_layers(old, new)
    assert objects.table["source"].tolist() == ["lamps", "trees"]
    assert objects.xy.tolist() == [[9, 0], [4, 4]]
    assert objects.table["class_code"].dtype == np.uint8
    assert objects.crs == old.crs
    assert (kept, notes) == (("lamps",), ())
    assert objects.licenses == (
        Licence("City (CC0)", ("lamps", "trees")),
        Licence("Streets (OGL)", ("signals",)),
    )


@pytest.mark.parametrize("name", ["parks, trees", "parks: trees", "A: parks, trees", ": trees, "])
@pytest.mark.parametrize("has_objects", [True, False])
def test_a_layer_may_have_any_name(tmp_path: Path, name: str, *, has_objects: bool) -> None:
    def saved(file: str, **places: list[tuple[float, float]]) -> StreetObjects:
        """Save a layer for each name, all of one publisher, and open them again."""
        layers = [
            raw_layer([shapely.Point(point) for point in points], name=name)
            for name, points in places.items()
        ]
        objects, _ = build_objects(layers, taxonomy=TAXONOMY, crs="EPSG:2154")
        save_objects(objects, tmp_path / file)
        return open_objects(tmp_path / file)

    city = saved("city.parquet", trees=[(0, 0), (1, 0)], parks=[(3, 0)], **{name: [(2.0, 0.0)]})
    renewed: dict[str, list[tuple[float, float]]] = {name: [(5, 0)] if has_objects else []}
    objects, kept, _ = replace_layers(city, saved("new.parquet", **renewed, lamps=[(9, 9)]))
    assert kept == ("parks", "trees")
    assert Counter(objects.table["source"]) == Counter(
        {"trees": 2, "parks": 1, "lamps": 1} | ({name: 1} if has_objects else {})
    )


def test_all_layers_may_be_loaded_anew() -> None:
    new = table((4, 4, TREE, "trees", "5"))
    objects, kept, _ = replace_layers(OLD, new)
    assert (kept, objects.licenses) == ((), new.licenses)
    assert objects.table.equals(new.table)


def test_what_may_be_twice_is_told() -> None:
    old = table(
        (0, 0, LAMP, "lamps", "1"),
        (5, 5, LAMP, "lamps", "2"),
        (9, 9, TREE, "trees", "1"),
        merged=["posts:4; signals:2", "", ""],
    )
    new = table((1, 0, LAMP, "posts", "4"), (9, 9, TREE, "posts", "5"), licenses=())
    objects, kept, notes = replace_layers(old, new)
    assert kept == ("lamps", "trees")
    assert objects.table["merged"].tolist() == ["posts:4; signals:2", "", "", "", ""]
    assert "1 objects of layers that stay were merged with objects of 'posts'" in notes[0]
    assert "1 new objects stand exactly where" in notes[1]
    assert len(notes) == 2


def test_a_licence_of_unknown_layers_renews_none() -> None:
    """Nothing is lost by it; and what may have stayed too long is told."""
    unclear = Licence("City (CC0): lamps, trees")
    old = dataclasses.replace(OLD, licenses=(unclear,))
    new = table((4, 4, TREE, "trees", "5"), licenses=(unclear,))
    objects, kept, notes = replace_layers(old, new)
    assert (kept, objects.licenses) == (("lamps",), (unclear,))
    assert "which layers 'City (CC0): lamps, trees' is about" in notes[0]


def test_another_crs_is_refused() -> None:
    with refused(CrsError, "EPSG:32631", "EPSG:2154", "--metric-crs"):
        replace_layers(OLD, table((0, 0, TREE, "trees", "1"), crs="EPSG:32631"))


def changed(**values: object) -> Taxonomy:
    first, *others = TAXONOMY.classes
    return Taxonomy((dataclasses.replace(first, **values), *others))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("taxonomy", "words"),
    [
        (changed(symbol="9"), ["symbol 9", "again"]),
        (changed(name="shrub"), ["'shrub'", "'alignment_tree'"]),
        (changed(range_m=50.0), ["seen from 50 m"]),
        (changed(code=251), ["given to both", "again"]),
        (changed(code=251, symbol="9"), ["name 'alignment_tree' is given to both"]),
    ],
)
def test_another_meaning_of_a_class_is_refused(taxonomy: Taxonomy, words: list[str]) -> None:
    old = dataclasses.replace(OLD, taxonomy=Taxonomy(TAXONOMY.classes[:2]))
    new = table((4, 4, LAMP, "lamps", "5"), taxonomy=taxonomy)
    with refused(InputError, *words):
        replace_layers(old, new)


def test_further_classes_are_fine() -> None:
    few, further = TAXONOMY.classes[:3], ObjectClass(250, "9", "drain", "Drain")
    old = dataclasses.replace(OLD, taxonomy=Taxonomy(few))
    new = table((4, 4, 250, "drains", "5"), taxonomy=Taxonomy((further,)), licenses=())
    objects, _, _ = replace_layers(old, new)
    assert objects.taxonomy.classes == (*few, further)
    both = Taxonomy((further, *few[::-1]))
    objects, _, _ = replace_layers(old, dataclasses.replace(new, taxonomy=both))
    assert objects.taxonomy == both
    changes = compare_objects(old, objects)
    (drain,) = (change for change in changes.classes if change.class_name == "drain")
    assert drain.added == 1
    titled = changed(title="Tree in a row")
    objects, _, _ = replace_layers(OLD, table((4, 4, LAMP, "lamps", "5"), taxonomy=titled))
    assert objects.taxonomy == titled
