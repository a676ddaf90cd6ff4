"""The classes of OpenStreetMap's catalogue: a table of tags, and counts of plain loops."""

from __future__ import annotations

import itertools
import re
import tomllib
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

import osmium
import pytest
from osm_xml import node, relation, way, write_osm
from osmium.filter import KeyFilter
from osmium.osm import Node, Relation, Way

from semsig_gis.sources import built_in_taxonomy, load_catalog, read_layers

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from semsig_gis.sources import RawLayer

FOLDER = Path(__file__).parent
CATALOG = load_catalog("openstreetmap")
# Layers with a table of their own.
PLAIN = tomllib.loads((FOLDER / "openstreetmap.toml").read_text(encoding="utf-8"))
SPECS = [
    spec
    for spec in CATALOG.layers
    if spec.tags and spec.name not in PLAIN["paper"] | PLAIN["further"]
]
EXTRACTS = (
    "helsinki_2019.osm.pbf",
    "monaco_2022.osm.pbf",
    "neukolln_2024.osm",
    "paris_marais_routing.osm.pbf",
)
EXTENDED = {item.name for item in CATALOG.taxonomy.classes if item.shape != "point"}
KINDS = {"n": "node", "w": "way", "r": "relation"}
HIDING = {
    "location": {"underground", "indoor"},
    "surveillance": {"indoor"},
    "indoor": {"*"},
    "disused": {"*"},
    "abandoned": {"*"},
    "demolished": {"*"},
    "razed": {"*"},
    "proposed": {"*"},
    "construction": {"*"},
}
Rule = tuple[str, tuple[tuple[str, str, tuple[str, ...]], ...]]


def rules_of(text: str) -> Iterator[Rule]:
    """Yield the kinds of element and the conditions of each rule of a row."""
    for rule in text.split(" | "):
        kinds = re.match(r"[nwr]+(?= )", rule)
        conditions = re.findall(r"([a-z:_]+)(>=|=|!)(\S+)", rule)
        yield (
            kinds[0] if kinds else "nwr",
            tuple((key, sign, tuple(values.split(","))) for key, sign, values in conditions),
        )


TABLE: dict[str, list[Rule]] = {
    row.split(" | ", 1)[0]: [*rules_of(row.split(" | ", 1)[1])]
    for row in (FOLDER / "vocabulary.txt").read_text(encoding="utf-8").splitlines()
    if row and not row.startswith("#")
}


# Each rule by the key of its first condition, which no object of it lacks.
RULES = defaultdict(list)
for class_name, class_rules in TABLE.items():
    for element_kinds, tag_conditions in class_rules:
        RULES[tag_conditions[0][0]].append((class_name, element_kinds, tag_conditions))


def meets(tags: Mapping[str, str], key: str, sign: str, values: tuple[str, ...]) -> bool:
    value = tags.get(key, "")
    if sign == ">=":
        numbers = [part for part in value.split(";") if re.fullmatch(r"\d+(\.\d+)?", part)]
        return max(map(float, numbers), default=-1.0) >= float(values[0])
    if sign == "!":
        return value not in values
    return value in values or ("*" in values and value not in {"", "no"})


def is_hidden(tags: Mapping[str, str], name: str) -> bool:
    """Whether an object cannot be seen, by the rules that the head of the catalogue states."""
    below = any(
        key in tags and all(float(part) < 0 for part in re.split(";", tags[key]))
        for key in ("level", "layer")
        if re.fullmatch(r"-?[\d.]+(;-?[\d.]+)*", tags.get(key, ""))
    )
    # Building sites are what is being built.
    keys = HIDING if name != "construction_site" else HIDING.keys() - {"construction"}
    return below or any(
        tags.get(key) in HIDING[key] or ("*" in HIDING[key] and tags.get(key, "no") != "no")
        for key in keys
    )


def classes_of(kind: str, tags: Mapping[str, str]) -> set[str]:
    """Return the classes of an element that can be seen."""
    return {
        name
        for key in tags
        for name, kinds, conditions in RULES.get(key, ())
        if kind in kinds and all(meets(tags, *condition) for condition in conditions)
        if not is_hidden(tags, name)
    }


def examples() -> Iterator[dict[str, str]]:
    """Yield tags with each value of each condition, also of those that leave objects out."""
    for _, conditions in (rule for rules in TABLE.values() for rule in rules):
        least = {key: values[0] for key, sign, values in conditions if sign != "!"}
        for key, _, values in conditions:
            for value in values:
                tags = least | {key: value}
                yield {key: value.replace("*", "other") for key, value in tags.items() if value}


def found(layers: Iterable[RawLayer]) -> dict[str, set[str]]:
    ids = defaultdict(set)
    for layer in layers:
        for name, number in zip(layer.table.class_name, layer.table.source_id, strict=True):
            ids[name].add(number)
    return ids


def test_the_table_has_every_class_with_tags() -> None:
    assert set(TABLE) == {name for spec in SPECS for name in spec.classes}
    assert {item.name for item in CATALOG.taxonomy.classes} <= {
        item.name for item in built_in_taxonomy().classes
    }
    assert len(built_in_taxonomy().classes) >= 200


def test_objects_with_the_tags_of_a_rule_are_of_its_class(tmp_path: Path) -> None:
    """Check every value of every rule, as a node, a way and an area."""
    elements = [node(1, 0.0, 0.0), node(2, 0.001, 0.0), node(3, 0.001, 0.001)]
    expected = defaultdict(set)
    for number, tags in enumerate(examples(), 10):
        elements += [
            node(number, 0.002, 0.002, tags),
            way(number, [1, 2, 3, 1], tags),
            relation(number, {number: "outer"}, {**tags, "type": "multipolygon"}),
        ]
        for kind, word in KINDS.items():
            for name in classes_of(kind, tags):
                expected[name].add(f"{word}/{number}")
    assert expected.keys() == TABLE.keys()
    assert found(read_layers(write_osm(tmp_path / "city.osm", *elements), SPECS)) == expected


@pytest.mark.parametrize("file", EXTRACTS)
def test_objects_of_each_class_equal_those_of_a_plain_loop(geodata: Path, file: str) -> None:
    path = geodata / "osm" / file
    expected = defaultdict(set)
    keys = {key for rules in TABLE.values() for _, conditions in rules for key, *_ in conditions}
    for element in osmium.FileProcessor(str(path)).with_locations().with_filter(KeyFilter(*keys)):
        assert isinstance(element, Node | Way | Relation)
        tags = dict(element.tags)
        if isinstance(element, Relation) and tags.get("type") != "multipolygon":
            continue
        kind = element.type_str()
        names = classes_of(kind, tags)
        if isinstance(element, Way):
            # At the edge of a file nodes are missing: a part of an outline is enough.
            validity = [item.location.valid() for item in element.nodes]
            names = names if all(validity) else names & EXTENDED
            names = names if any(map(all, itertools.pairwise(validity))) else set()
        for name in names:
            expected[name].add(f"{KINDS[kind]}/{element.id}")
    layers = read_layers(path, SPECS)
    ours = found(layers)
    # Multipolygons at the edge of a file lack ways.
    clipped = [number for name in TABLE for number in expected[name] - ours[name]]
    assert all(number.startswith("relation/") for number in clipped), clipped
    assert len(clipped) <= sum(layer.counts.unreadable for layer in layers)
    assert {name: ours[name] - expected[name] for name in TABLE} == {name: set() for name in TABLE}
