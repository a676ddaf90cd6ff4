from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import Signature
from semsig_gis.likelihood.noise.learn import Sample, read_samples
from semsig_gis.sources.catalog import paper_taxonomy

if TYPE_CHECKING:
    from pathlib import Path

TAXONOMY = paper_taxonomy()


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_csv_and_json_lines_say_the_same(tmp_path: Path) -> None:
    table = written(
        tmp_path,
        "seen.CSV",
        'note,cell_id,types,bearings,x,y\nfirst,7,DB,"10, 350",,\nnothing,8,,,,\n,,D,-10,1.5,2\n',
    )
    lines = [
        {"cell_id": 7, "types": "DB", "bearings": [10, 350]},
        {"cell_id": 8, "types": "", "bearings": []},
        {"x": 1.5, "y": 2, "types": "D", "bearings": -10},
    ]
    text = "\n\n".join(json.dumps(line) for line in lines)
    other = written(tmp_path, "seen.jsonl", text)
    for path in (table, other):
        found = read_samples(path, taxonomy=TAXONOMY)
        assert [sample.cell_id for sample in found] == [7, 8, None]
        assert [sample.xy for sample in found] == [None, None, (1.5, 2.0)]
        bearings = [np.asarray(sample.signature.bearings).tolist() for sample in found]
        assert bearings == [[10.0, 350.0], [], [350.0]]
        codes = [np.asarray(sample.signature.codes).tolist() for sample in found]
        assert codes == [[3, 1], [], [3]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cell_id,types,bearings\n7,DB,10\n", ["line 2", "2 types", "1 bearings"]),
        ("cell_id,types,bearings\n7,D,10\n7,%,10\n", ["line 3", "%"]),
        ("cell_id,types,bearings\n7,?,10\n", ["line 2", "unknown class"]),
        ("cell_id,types,bearings\n7,D,nan\n", ["line 2", "nan"]),
        ("cell_id,types,bearings\n7,D,400\n", ["line 2", "400"]),
        ("cell_id,types,bearings\n7,D,north\n", ["line 2", "north"]),
        ("cell_id,types,bearings\nx7,D,10\n", ["line 2", "x7"]),
        ("x,types,bearings\n7,D,10\n", ["line 2", "place"]),
        ("x,y,types,bearings\n7,inf,D,10\n", ["line 2", "inf"]),
        ("x,y,bearings\n7,8,10\n", ["line 2", "types"]),
        ("x,y,types,bearings\n", ["no rows"]),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, text: str, words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        read_samples(written(tmp_path, "seen.csv", text), taxonomy=TAXONOMY)
    assert_sentence(caught.value, *words)


@pytest.mark.parametrize("text", ["[1]", "{", '{"types": "D", "bearings": {"a": 1}, "cell_id": 7}'])
def test_lines_that_are_no_samples(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError) as caught:
        read_samples(written(tmp_path, "seen.jsonl", text), taxonomy=TAXONOMY)
    assert_sentence(caught.value, "line 1")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_samples(tmp_path / "none.csv", taxonomy=TAXONOMY)
    assert_sentence(caught.value, "none.csv", "CSV")


def test_a_sample_needs_both_parts() -> None:
    with pytest.raises(InputError) as caught:
        Sample(signature=Signature(np.array([3]), None), cell_id=3)
    assert_sentence(caught.value, "bearings")
