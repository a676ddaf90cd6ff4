"""Every command: unusable input, interrupts, a full disk, and output that matches its schema."""

from __future__ import annotations

import dataclasses
import errno
import functools
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest
from sentences import sentence

import semsig_gis.cli.app  # noqa: F401 - with the command of the workbench
from semsig_gis.cli.console import PIPED_WIDTH
from semsig_gis.commands import Result, command_line, commands, find_command
from semsig_gis.commands.schema import command_schema
from semsig_gis.evaluation.identifiability import analysis

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from conftest import Run
    from semsig_gis.commands import Field

COMMANDS = commands(installed=False)
# A use of each command in the folder of the fixture `city`.
LINES: dict[str, tuple[str, ...]] = {
    "load": ("files=.", "catalog=tiny.toml", "out=o.parquet"),
    "fetch": ("catalog=tiny.toml", "area=3,43,4,44", "out=o.parquet"),
    "sources": ("name=tiny.toml",),
    "draft": ("file=lights.gpkg",),
    "survey": ("files=.", "catalog=tiny.toml"),
    "synthesize": ("out=town", "size=100"),
    "demo": ("out=demo", "queries=2"),
    "build": ("objects=objects.parquet", "out=c.parquet"),
    "update": ("database=city.parquet", "objects=objects.parquet", "out=c.parquet"),
    "merge": ("first=city.parquet", "second=city.parquet", "out=c.parquet"),
    "info": ("database=city.parquet",),
    "clean": ("database=city.parquet",),
    "localize": ("database=city.parquet", "types=DX", "out=answer.gpkg", "map=m.html"),
    "route": ("database=city.parquet", "views=route.jsonl"),
    "suggest": ("database=city.parquet", "types=DX"),
    "serve": ("database=city.parquet",),
    "view": ("files=boxes.json", "fov=90", "out=v.jsonl"),
    "learn": ("database=city.parquet", "samples=samples.csv", "out=n.toml"),
    "calibrate": ("database=city.parquet", "samples=samples.csv", "out=r.json"),
    "evaluate": ("database=city.parquet", "queries=5", "out=eval", "report=e.html"),
    "experiment": ("spec=spec.toml", "out=results"),
    "compare": ("first=compared", "second=compared"),
    "reproduce": ("database=city.parquet", "out=paper"),
    "identify": ("database=city.parquet", "check=5", "out=chances"),
    "benchmark": ("data=flatlandia", "folder=.", "out=b.json"),
    "map": ("database=city.parquet", "objects=objects.parquet", "out=m.html"),
    "export": ("database=city.parquet", "objects=objects.parquet", "out=c.gpkg"),
    "import": ("geopackage=cells.gpkg", "out=c.parquet"),
    "schema": (),
}
# Fields that need other values as well, or are read after another file that cannot be used.
OTHERS: dict[tuple[str, str], tuple[dict[str, str], str]] = {
    **{
        (name, "drift_report"): ({"map_age": "3"}, "nowhere.parquet")
        for name in ("localize", "route", "suggest", "learn", "calibrate", "evaluate")
    },
    ("localize", "queries"): ({"types": "", "out": "", "map": ""}, "nowhere.parquet"),
    ("benchmark", "noise"): ({}, "flatlandia.toml"),
    ("learn", "unlabelled"): ({"samples": ""}, "nowhere.parquet"),
    ("learn", "noise"): ({"samples": "", "unlabelled": "route.jsonl"}, "nowhere.parquet"),
    ("build", "streets"): ({"viewpoints": "streets"}, "nowhere.parquet"),
    ("view", "detector"): ({}, "boxes.json cannot be read"),
}
# They need a network, a browser or much data; tests of their own run them.
NOT_RUN = {"fetch", "serve", "benchmark", "reproduce"}
RUN = [name for name in COMMANDS if name not in NOT_RUN]


# Their output is the content of a file.
FOR_FILES = {"draft", "schema"}


def line_of(name: str, /, **changes: str) -> list[str]:
    """Return the words of the use of a command, with other values of some fields or none ("")."""
    values = dict(item.split("=", 1) for item in LINES[name]) | changes
    words = [name]
    for field in COMMANDS[name].fields:
        if values.get(field.name):
            words += ([] if field.option.positional else [field.flag]) + [values[field.name]]
    return words


def value_of(name: str, field: Field) -> str | None:
    """Return the value of a field in the use of a command."""
    return dict(item.split("=", 1) for item in LINES[name]).get(field.name)


def fields(condition: Callable[[Field], Any]) -> list[Any]:
    """Return the fields of all commands that meet a condition, as parameters of a test."""
    return [
        pytest.param(name, field, id=f"{name}-{field.name}")
        for name, command in COMMANDS.items()
        for field in command.fields
        if condition(field)
    ]


def files(folder: Path) -> dict[Path, int]:
    """Return the files in a folder with their times."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(autouse=True)
def _few_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    few = functools.partial(analysis.identify, trials=60, class_trials=5)
    monkeypatch.setattr(analysis, "identify", few)


@pytest.fixture
def unchanged(tiny_city: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the folder of a small city, which the command runs in and may not change."""
    monkeypatch.chdir(tiny_city)
    before = files(tiny_city)
    yield tiny_city
    assert files(tiny_city) == before


def test_every_command_has_a_use_here() -> None:
    assert set(LINES) == set(COMMANDS)


def test_a_command_is_in_the_module_of_its_name() -> None:
    code = (
        "import sys\n"
        "from semsig_gis.commands import find_command\n"
        "for name in sys.argv[1:]:\n"
        "    print(find_command(name).name)\n"
        "    others = [module for module in sys.modules if module.endswith('commands.survey')]\n"
        "    assert not others, others\n"
    )
    names = [name for name in COMMANDS if name not in {"serve", "survey"}]
    command = [sys.executable, "-c", code, *names]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert run.stdout.split() == names
    with pytest.raises(KeyError):
        find_command("nonsense")


@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize(("name", "field"), fields(lambda field: field.option.reads))
def test_missing_file_is_refused(name: str, field: Field, run: Run) -> None:
    changes, words = OTHERS.get((name, field.name), ({}, "nowhere.parquet"))
    sentence(run("", *line_of(name, **{field.name: "nowhere.parquet"}, **changes)), words)


@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize(
    ("name", "field"),
    fields(lambda field: field.suffixes and "" not in field.suffixes),
)
def test_wrong_suffix_is_refused(name: str, field: Field, run: Run) -> None:
    sentence(run("", *line_of(name, **{field.name: "a.wrong"})), "a.wrong", "must end in")


@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize(("name", "field"), fields(lambda field: field.suffixes))
def test_input_is_not_overwritten(name: str, field: Field, run: Run) -> None:
    for other in COMMANDS[name].fields:
        path = value_of(name, other)
        if other.option.reads and path is not None:
            line = line_of(name, **{field.name: path})
            sentence(run("", *line), path, "uses it for something else")


@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize(
    ("name", "field"), fields(lambda field: field.choices or field.option.suggestions)
)
def test_unknown_name_is_refused(name: str, field: Field, run: Run) -> None:
    changes, _ = OTHERS.get((name, field.name), ({}, ""))
    sentence(run("", *line_of(name, **{field.name: "nothing"}, **changes)), "nothing")


@pytest.mark.usefixtures("city")
@pytest.mark.parametrize("name", RUN)
def test_json_matches_the_schema_and_quiet_prints_only_results(name: str, run: Run) -> None:
    # The fixture `run` compares JSON with the schema.
    as_json = ["--json"] if COMMANDS[name].returns else []
    code, out, err = run("", *line_of(name), "--quiet", *as_json)
    assert (code, err) == (0, "")
    assert out


@pytest.mark.usefixtures("city")
@pytest.mark.parametrize("name", RUN)
def test_verbose_reports_on_standard_error(name: str, run: Run) -> None:
    code, out, err = run("", *line_of(name), "--verbose")
    assert code == 0
    assert out
    assert all(line.startswith("semsig: ") for line in err.splitlines())
    if name not in FOR_FILES:
        lines = [line for line in out.splitlines() if not line.startswith("  ")]  # no commands
        assert [line for line in lines if len(line) > PIPED_WIDTH] == []


@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize(
    ("name", "field"), fields(lambda field: field.suffixes and field.suffixes != ("",))
)
def test_missing_folder_is_not_made(name: str, field: Field, run: Run) -> None:
    path = f"nowhere/a{field.suffixes[0]}"
    sentence(run("", *line_of(name, **{field.name: path})), path, "there is no folder nowhere")


EXAMPLES = [(name, line) for name, command in COMMANDS.items() for line in command.examples]


def test_every_command_has_two_examples() -> None:
    assert {name: len(command.examples) for name, command in COMMANDS.items()} == dict.fromkeys(
        COMMANDS, 2
    )


@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize(("name", "line"), EXAMPLES)
def test_example_in_the_help_is_understood(
    name: str, line: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    requests: list[Any] = []

    def keep(request: object, _: object) -> Result:
        requests.append(request)
        return Result()

    monkeypatch.setattr(COMMANDS[name].request, "run", keep)
    program, *words = shlex.split(line)
    assert (program, words[0], run("", *words)[0], len(requests)) == ("semsig", name, 0, 1)
    assert line in " ".join(run("", name, "--help")[1].splitlines()).replace("  ", "")


WRITING = [
    name
    for name in RUN
    if any(field.suffixes and value_of(name, field) for field in COMMANDS[name].fields)
]


@pytest.mark.usefixtures("city")
@pytest.mark.parametrize("name", WRITING)
def test_quiet_prints_only_the_paths_of_files(name: str, run: Run) -> None:
    code, out, err = run("", *line_of(name), "--quiet")
    assert (code, err) == (0, "")
    assert [line for line in out.splitlines() if not Path(line).exists()] == []


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (OSError(errno.ENOSPC, "No space left on device"), 2, os.strerror(errno.ENOSPC)),
    ],
    ids=["interrupt", "full disk"],
)
@pytest.mark.parametrize("name", WRITING)
def test_interrupt_and_full_disk_leave_no_new_file(
    *,
    name: str,
    error: BaseException,
    code: int,
    message: str,
    city: Path,
    run: Run,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = files(city)

    def failing(rename: Callable[..., None]) -> Callable[..., None]:
        """Return a rename that fails in the folder of the city, where it publishes a file."""

        def call(source: Any, target: Any, **options: Any) -> None:  # noqa: ANN401 - as in `os`
            if str(target).startswith(str(city)):
                raise error
            rename(source, target, **options)

        return call

    for function in ("rename", "replace"):
        monkeypatch.setattr(os, function, failing(getattr(os, function)))
    outcome = run("", *line_of(name))
    assert outcome[0] == code, outcome
    assert outcome[1] == ""
    assert message in outcome[2].splitlines()[-1]
    assert files(city) == before


@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize("name", COMMANDS)
def test_interrupt_in_the_work_ends_the_command(
    name: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(COMMANDS[name].request, "run", interrupted)
    assert run("", *line_of(name)) == (130, "", "semsig: interrupted\n")


@pytest.mark.usefixtures("unchanged")
@pytest.mark.parametrize("name", COMMANDS)
def test_request_fits_its_schema_and_is_given_again_by_its_command_line(
    name: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    requests: list[Any] = []

    def keep(request: object, _: object) -> Result:
        requests.append(request)
        return Result()

    monkeypatch.setattr(COMMANDS[name].request, "run", keep)
    assert run("", *line_of(name))[0] == 0
    (request,) = requests
    program, *words = shlex.split(command_line(request))
    assert program == "semsig"
    assert run("", *words)[0] == 0
    assert requests == [request, request]
    schema = command_schema(COMMANDS[name])["request"]
    jsonschema.Draft202012Validator.check_schema(schema)
    values = json.loads(json.dumps(dataclasses.asdict(request), default=str))
    jsonschema.validate(values, schema)
