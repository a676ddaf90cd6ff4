"""Links and commands in the README and the documentation exist."""

from __future__ import annotations

import itertools
import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_group

from semsig_gis.cli.app import app

ROOT = Path(__file__).parents[2]
# Sphinx checks the links of the other pages.
REFERRED = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "data_sources" / "README.md",
    ROOT / "notebooks" / "README.md",
]
PAGES = [
    *REFERRED,
    *sorted(
        path
        for path in (ROOT / "docs").rglob("*.md")
        if not {"_build", "api", "commands", "notebooks"} & {*path.relative_to(ROOT / "docs").parts}
    ),
]
MOST_LINES = 150
# A line of a block, with or without a prompt, or code in a sentence.
COMMAND = re.compile(r"^(?:\$ )?(semsig .+)$|`(semsig [^`]+)`", re.MULTILINE)

pytestmark = pytest.mark.skipif(
    not (ROOT / "README.md").is_file(), reason="the tests do not run from a checkout"
)


def commands(page: Path) -> list[list[str]]:
    """Return the arguments of every `semsig` command that a page shows."""
    text = re.sub(
        r"^```(?:text|\{).*?^```", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL
    )
    split = [
        shlex.split((block or within).replace("\n", " "), comments=True)
        for block, within in COMMAND.findall(text)
    ]
    return [
        list(itertools.takewhile(lambda word: word not in {">", "|"}, words[1:])) for words in split
    ]


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= MOST_LINES


@pytest.mark.parametrize("page", REFERRED, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_of_a_page_exist(page: Path) -> None:
    text = re.sub(
        r"^```.*?^```|`[^`]*`", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL
    )
    targets = re.findall(r"\]\(<?([^)>\s]+)>?\)", text)
    local = [target for target in targets if not re.match(r"[a-z]+:|#", target)]
    missing = [name for name in local if not (page.parent / name.partition("#")[0]).exists()]
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_accept_the_options_on_a_page(page: Path) -> None:
    group = get_group(app)
    for words in commands(page):
        if words[0].startswith("-") or words[0].isupper():  # not of one command
            continue
        command = group.commands.get(words[0])
        assert command is not None, f"there is no command {words[0]}"
        within = command.make_context(words[0], [], resilient_parsing=True)
        command.make_parser(within).parse_args(words[1:])


def test_commands_are_found() -> None:
    assert ["export", "monaco.parquet", "--out", "monaco.gpkg"] in commands(ROOT / "README.md")
