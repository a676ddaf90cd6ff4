"""`semsig benchmark`: methods measured on photographs with known places."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from sentences import sentence
from small_city import small_city

if TYPE_CHECKING:
    from conftest import Run, RunOk

CATALOGUE = """
name = "flatlandia"
title = "A town"
place = "Nowhere"
url = "https://example.org"
license = "CC0"
attribution = "Nobody"
metric_crs = "EPSG:32631"

[[layers]]
name = "things"
files = ["objects.csv"]
crs = "EPSG:32631"
id_field = "id"
geometry = "point"
x_field = "x"
y_field = "y"
[layers.class_by]
field = "class"
[layers.class_by.values]
"""
FIGURES = {
    *("method", "set", "detections", "n", "p5", "p10", "p25", "p50", "heading_error", "answered"),
    *("right", "brier", "calibration_error", "seconds"),
}
SETS = {"single", "places", "no compass"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with files of the layout of Flatlandia, from which the command runs."""
    monkeypatch.chdir(tmp_path)
    database, objects = small_city()
    names = [objects.taxonomy.by_code(code).name for code in objects.codes.tolist()]
    used = "".join(f'{name} = "{name}"\n' for name in dict.fromkeys(names))
    (tmp_path / "flatlandia.toml").write_text(CATALOGUE + used, encoding="utf-8")
    numbered = enumerate(zip(names, objects.xy.tolist(), strict=True))
    lines = [f"{number},{name},{x},{y}" for number, (name, (x, y)) in numbered]
    (tmp_path / "objects.csv").write_text("\n".join(["id,class,x,y", *lines]), encoding="utf-8")

    def detections(x: float, y: float) -> list[dict[str, Any]]:
        east, north = (objects.xy - (x, y)).T
        near = np.flatnonzero(np.hypot(east, north) < 50)[:9]
        bearings = np.degrees(np.arctan2(east[near], north[near])) % 360
        return [
            {"class": names[row], "bearing": bearing}
            for row, bearing in zip(near.tolist(), bearings.tolist(), strict=True)
        ]

    busy = np.flatnonzero(database.lengths > 8)
    places = database.xy[busy[:: len(busy) // 12]].tolist()
    views = [{"id": f"v{i}", "x": x, "y": y} for i, (x, y) in enumerate(places)]
    for row in views:
        row["detections"] = detections(row["x"], row["y"])
    unknown = [{**row, "heading_error": "unknown"} for row in views[:2]]
    several = [
        {"id": row["id"], "x": row["x"], "y": row["y"], "photos": [
            {"heading": 0, "fov": 360, "detections": row["detections"][:3]},
            {"heading": 0, "fov": 360, "detections": row["detections"][3:]},
        ]}
        for row in views[:3]
    ]  # fmt: skip
    for name, rows in {
        "learn": views,
        "test_thin": views[:5],
        "test_places": several,
        "test_no_compass": unknown,
    }.items():
        text = "\n".join(map(json.dumps, rows))
        (tmp_path / f"{name}.jsonl").write_text(text, encoding="utf-8")
    return tmp_path


def test_methods_are_measured_and_written(folder: Path, run_ok: RunOk) -> None:
    out = run_ok("benchmark flatlandia . --methods paper,default,generic,learned --out result.json")
    assert "Real photographs" in out
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    assert (result["data"], result["radius"], result["limit"]) == ("flatlandia", 60.0, None)
    assert {frozenset(row) for row in result["table"]} == {frozenset(FIGURES)}
    whole = {
        (row["method"], row["set"]): row for row in result["table"] if row["detections"] == "all"
    }
    # The distance of the paper needs a compass.
    assert whole.keys() == {
        (method, name)
        for method in ("paper", "default", "generic", "learned")
        for name in SETS
        if (method, name) != ("paper", "no compass")
    }
    single, blind = whole["learned", "single"], whole["learned", "no compass"]
    assert (single["n"], single["p50"], single["heading_error"]) == (5, 1.0, None)
    assert single["brier"] < 0.1
    assert blind["heading_error"] < 5  # the turn of the bearings was found
    assert whole["paper", "single"]["brier"] is None
    assert {row["method"] for row in result["calibration"]} == {"default", "generic", "learned"}


def test_failures_have_the_scenes_of_both_places(folder: Path, run_ok: RunOk) -> None:
    rows = [json.loads(line) for line in (folder / "learn.jsonl").read_text().splitlines()]
    for row in rows:
        row["x"] += 100  # so every answer is wrong
    (folder / "test_thin.jsonl").write_text("\n".join(map(json.dumps, rows)), encoding="utf-8")
    out = run_ok("benchmark flatlandia . --methods generic --limit 4 --json")
    result = json.loads(out)
    assert {row["n"] for row in result["table"] if row["set"] == "single"} <= {1, 2, 3, 4}
    assert result["failures"]["method"] == "generic"
    failures = result["failures"]["views"]
    chances = [failure["chance"] for failure in failures]
    assert len(failures) >= 4
    assert chances == sorted(chances, reverse=True)
    for failure in failures:
        assert failure["error_m"] > 50
        assert {row["verdict"] for row in failure["true"]["rows"]} & {"false", "missed"}
        assert any(row["query_class"] for row in failure["answered"]["rows"])


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("benchmark flatlandio .", ["data set 'flatlandio' is unknown; the nearest is"]),
        ("benchmark flatlandia . --methods papr", ["method 'papr' is unknown; the nearest is"]),
        ("benchmark london-lights .", ["has no file london.toml"]),
        ("benchmark flatlandia nowhere", ["nowhere has no file flatlandia.toml"]),
        ("benchmark flatlandia . --out result.txt", ["the name must end in .json"]),
        ("benchmark flatlandia . --noise n.toml --out objects.csv", ["must end in .json"]),
        ("benchmark flatlandia . --noise none.toml --methods learned --limit 1", ["none.toml"]),
    ],
)
def test_unusable_input_is_refused(folder: Path, run: Run, line: str, words: list[str]) -> None:
    sentence(run(line), *words)
    assert not (folder / "result.json").exists()


def test_a_view_without_a_place_is_refused(folder: Path, run: Run) -> None:
    (folder / "test_thin.jsonl").write_text('{"detections": []}\n', encoding="utf-8")
    sentence(run("benchmark flatlandia . --methods paper"), "it has no true place")


@pytest.mark.parametrize(
    ("line", "sets"),
    [
        ("flatlandia {}/flatlandia", SETS),
        ("london-lights {}/london_lights", {"panoramas"}),
    ],
)
def test_real_photographs_are_measured(
    geodata: Path, run_ok: RunOk, line: str, sets: set[str]
) -> None:
    if not Path(line.format(geodata).split()[1]).is_dir():
        pytest.skip(f"{geodata} has no folder of these photographs")
    out = run_ok(f"benchmark {line.format(geodata)} --methods paper,generic --limit 4 --json")
    table = json.loads(out)["table"]
    assert {frozenset(row) for row in table} == {frozenset(FIGURES)}
    assert {row["set"] for row in table} == sets
    assert all(0 <= row["p5"] <= row["p50"] <= 1 for row in table)
