from __future__ import annotations

import dataclasses
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused
from worlds import CODES, TAXONOMY, objects_of

from semsig_gis.core import CrsError, InputError, ObjectClass, Taxonomy
from semsig_gis.objects import Licence, compare_objects, open_objects, replace_layers, save_objects

if TYPE_CHECKING:
    from pathlib import Path

    from worlds import Thing

    from semsig_gis.objects import ObjectChanges, StreetObjects

TREE, _, LAMP = CODES[:3]
KINDS = ("same", "moved", "changed", "removed", "added")


CITY = (Licence("City (CC0)", ("trees", "lamps")),)


def table(*things: Thing, licenses: tuple[Licence, ...] = CITY, **more: Any) -> StreetObjects:  # noqa: ANN401
    return objects_of(*things, licenses=licenses, **more)


def rows_of(changes: ObjectChanges) -> tuple[list[object], ...]:
    return tuple(getattr(changes, name).tolist() for name in KINDS)


OLD = table(
    (0, 0, TREE, "trees", "1"),
    (5, 0, TREE, "trees", "2"),
    (9, 0, LAMP, "lamps", "1"),
    (9, 9, LAMP, "lamps", "2"),
)


def test_added_removed_moved_and_reclassified_objects() -> None:
    new = table(
        (0, 0, TREE, "trees", "1"),
        (8, 4, TREE, "trees", "2"),
        (9, 0, TREE, "lamps", "1"),
        (7, 7, LAMP, "lamps", "3"),
        (7, 8, LAMP, "lamps", "4"),
    )
    changes = compare_objects(OLD, new)
    assert rows_of(changes) == ([[0, 0]], [[1, 1]], [[2, 2]], [3], [3, 4])
    assert sorted(changes.obsolete_rows.tolist()) == [1, 2, 3]
    assert sorted(changes.new_rows.tolist()) == [1, 2, 3, 4]
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


def test_objects_at_the_same_place_are_matched_by_id() -> None:
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
def test_every_row_has_exactly_one_kind_of_change(before: list[Thing], now: list[Thing]) -> None:
    old, new = table(*before), table(*now)
    changes = compare_objects(old, new)
    assert sorted([*changes.same[:, 0], *changes.obsolete_rows]) == list(range(len(old)))
    assert sorted([*changes.same[:, 1], *changes.new_rows]) == list(range(len(new)))
    # Obsolete and new rows are exactly those that differ in class or place.
    looks = [Counter(thing[:3] for thing in things) for things in (before, now)]
    assert Counter(before[row][:3] for row in changes.obsolete_rows) == looks[0] - looks[1]
    assert Counter(now[row][:3] for row in changes.new_rows) == looks[1] - looks[0]
    names = [Counter(thing[3:] for thing in things) for things in (before, now)]
    for kind, same_class in ((changes.moved, True), (changes.changed, False)):
        for row, other in kind:
            name = before[row][3:]
            assert name == now[other][3:]
            assert name[1]
            assert (before[row][2] == now[other][2]) == same_class
            assert names[0][name] == names[1][name] == 1
    unmatched = {before[row][3:] for row in changes.removed} & {
        now[row][3:] for row in changes.added
    }
    assert all(not name[1] or names[0][name] > 1 or names[1][name] > 1 for name in unmatched)
    for item in changes.classes:
        gains, losses = item.added + item.gained, item.removed + item.lost
        assert item.after == item.before + gains - losses
    assert sum(item.before for item in changes.classes) == len(old)
    assert sum(item.after for item in changes.classes) == len(new)


def test_layers_that_were_not_reloaded_remain() -> None:
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
    objects, remaining, notes = replace_layers(old, new)
    assert objects.table["source"].tolist() == ["lamps", "trees"]
    assert objects.xy.tolist() == [[9, 0], [4, 4]]
    assert objects.table["class_code"].dtype == np.uint8
    assert objects.crs == old.crs
    assert (remaining, notes) == (("lamps",), ())
    assert objects.licenses == (
        Licence("City (CC0)", ("lamps", "trees")),
        Licence("Streets (OGL)", ("signals",)),
    )


@pytest.mark.parametrize("name", ["parks, trees", "parks: trees", "A: parks, trees", ": trees, "])
@pytest.mark.parametrize("has_objects", [True, False])
def test_layer_may_have_any_name(tmp_path: Path, name: str, *, has_objects: bool) -> None:
    def saved(*sources: str, layers: tuple[str, ...]) -> StreetObjects:
        """Save an object of each source, and open them again."""
        things = [(float(x), 0.0, TREE, source, str(x)) for x, source in enumerate(sources)]
        licences = (Licence("Town (CC0)", layers),)
        save_objects(table(*things, licenses=licences), tmp_path / "objects.parquet")
        return open_objects(tmp_path / "objects.parquet")

    city = saved("trees", "trees", "parks", name, layers=("trees", "parks", name))
    new = [name] * has_objects + ["lamps"]
    objects, remaining, _ = replace_layers(city, saved(*new, layers=(name, "lamps")))
    assert remaining == ("parks", "trees")
    assert Counter(objects.table["source"]) == Counter(["trees", "trees", "parks", *new])


def test_all_layers_may_be_reloaded() -> None:
    new = table((4, 4, TREE, "trees", "5"))
    objects, remaining, _ = replace_layers(OLD, new)
    assert (remaining, objects.licenses) == ((), new.licenses)
    assert objects.table.equals(new.table)


def test_possible_duplicates_are_noted() -> None:
    old = table(
        (0, 0, LAMP, "lamps", "1"),
        (5, 5, LAMP, "lamps", "2"),
        (9, 9, TREE, "trees", "1"),
        merged=["posts:4; signals:2", "", ""],
    )
    new = table((1, 0, LAMP, "posts", "4"), (9, 9, TREE, "posts", "5"), licenses=())
    objects, remaining, notes = replace_layers(old, new)
    assert remaining == ("lamps", "trees")
    assert objects.table["merged"].tolist() == ["posts:4; signals:2", "", "", "", ""]
    assert "not loaded again were merged with objects of 'posts'" in notes[0]
    assert "1 new objects are at exactly the place" in notes[1]
    assert len(notes) == 2


def test_licence_without_layers_replaces_no_layer() -> None:
    """No object is lost, and a note says that old objects may remain."""
    unclear = Licence("City (CC0): lamps, trees")
    before = (Licence("Town (CC0)"),)
    new = table((4, 4, TREE, "trees", "5"), licenses=(unclear,))
    objects, remaining, notes = replace_layers(dataclasses.replace(OLD, licenses=before), new)
    assert (remaining, objects.licenses) == (("lamps",), (*before, unclear))
    assert "which layers the licence 'City (CC0): lamps, trees' is for" in notes[0]


def test_notes_are_replaced_with_their_layers() -> None:
    old = dataclasses.replace(OLD, notes=("a file is missing", "lamps: odd", "trees: odd"))
    new = table((4, 4, LAMP, "lamps", "5"), licenses=(Licence("City (CC0)", ("lamps",)),))
    objects, _, _ = replace_layers(old, dataclasses.replace(new, notes=("lamps: few",)))
    assert objects.notes == ("a file is missing", "trees: odd", "lamps: few")


def changed(**values: object) -> Taxonomy:
    first, *others = TAXONOMY.classes
    return Taxonomy((dataclasses.replace(first, **values), *others))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"crs": "EPSG:32631"}, CrsError, ["EPSG:32631", "EPSG:2154", "--metric-crs"]),
        *(
            ({"taxonomy": taxonomy}, InputError, words)
            for taxonomy, words in (
                (changed(symbol="9"), ["symbol 9", "again"]),
                (changed(name="shrub"), ["'shrub'", "'alignment_tree'"]),
                (changed(range_m=50.0), ["seen from 50 m"]),
                (changed(code=251), ["given to both", "again"]),
                (changed(code=251, symbol="9"), ["name 'alignment_tree' is given to both"]),
            )
        ),
    ],
)
def test_other_crs_or_different_class_is_refused(
    options: dict[str, Any], error: type[Exception], words: list[str]
) -> None:
    old = dataclasses.replace(OLD, taxonomy=Taxonomy(TAXONOMY.classes[:2]))
    with refused(error, *words):
        replace_layers(old, table((4, 4, LAMP, "lamps", "5"), **options))


def test_new_classes_are_added() -> None:
    few, drain = TAXONOMY.classes[:3], ObjectClass(250, "9", "drain", "Drain")
    old = dataclasses.replace(OLD, taxonomy=Taxonomy(few))
    for classes, joined in (((drain,), (*few, drain)), ((drain, *few[::-1]), (drain, *few[::-1]))):
        new = table((4, 4, 250, "drains", "5"), taxonomy=Taxonomy(classes), licenses=())
        objects, _, _ = replace_layers(old, new)
        assert objects.taxonomy.classes == joined
        classes_of = {change.class_name: change for change in compare_objects(old, objects).classes}
        assert classes_of["drain"].added == 1
    titled = changed(title="Tree in a row")
    objects, _, _ = replace_layers(OLD, table((4, 4, LAMP, "lamps", "5"), taxonomy=titled))
    assert objects.taxonomy.to_list() == titled.to_list()
