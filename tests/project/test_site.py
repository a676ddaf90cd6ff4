"""The site builds without a warning, its links work, and its pages are accessible.

These tests build it without running notebooks. ``make docs`` builds all of it, and then runs them
on the site that SEMSIG_SITE names.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import pytest
from axe_core_python.selenium import Axe
from typer.main import get_group

import semsig_gis
from semsig_gis.cli.app import app

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
# Size on disk of a page with its styles, scripts and pictures, but without its maps.
MOST_BYTES = 320_000
DRAWN_SCENES = {"real_photographs": 900_000}  # six pairs of scenes
MAIN = (
    *("index", "install", "tutorial", "gallery", "compared_with_the_paper", "how_sure"),
    *("commands/localize", "api/localization"),
)

pytestmark = pytest.mark.skipif(
    not (DOCS / "conf.py").is_file(), reason="the tests do not run from a checkout"
)


@dataclass
class Page(HTMLParser):
    """Links, loaded files, pictures and anchors of a page."""

    path: Path
    links: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)
    pictures: list[dict[str, str | None]] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    size: int = 0

    def __post_init__(self) -> None:
        super().__init__()
        text = re.sub(r' srcdoc="[^"]*"', "", self.path.read_text(encoding="utf-8"))
        self.size = len(text.encode())
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.names |= {values[key] or "" for key in ("id", "name") if key in values}
        if tag == "a" and values.get("href"):
            self.links.append(values["href"] or "")
        if tag == "img":
            self.pictures.append(values)
        if tag in {"img", "script"} and values.get("src"):
            self.loaded.append(values["src"] or "")
        if tag == "link" and values.get("rel") == "stylesheet":
            self.loaded.append(values["href"] or "")

    def file(self, address: str) -> Path:
        """Return the file of an address on this page."""
        path = unquote(urlsplit(address).path)
        return (self.path.parent / path).resolve() if path else self.path.resolve()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = os.environ.get("SEMSIG_SITE")
    if built:
        return Path(built).resolve()
    out = tmp_path_factory.mktemp("site")
    options = ["-W", "--keep-going", "-q", "-D", "nb_execution_mode=off"]
    places = ["-d", f"{out}.doctrees", str(DOCS), str(out)]
    command = [sys.executable, "-m", "sphinx", *options, *places]
    run = subprocess.run(command, check=False, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return out


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[str, Page]:
    paths = (path for path in site.rglob("*.html") if path.parent != site / "gallery")
    return {path.relative_to(site).with_suffix("").as_posix(): Page(path) for path in paths}


def test_links_within_the_site_exist(site: Path, pages: dict[str, Page]) -> None:
    by_file = {page.path.resolve(): page for page in pages.values()}
    has_gallery = (site / "gallery").is_dir()
    broken = []
    for name, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            target = page.file(link)
            if parts.scheme or (target.parent.name == "gallery" and not has_gallery):
                continue
            fragment = unquote(parts.fragment)
            there = target.is_file()
            if there and fragment and target in by_file:
                there = fragment in by_file[target].names
            if not there:
                broken.append(f"{name}: {link}")
    assert broken == []


def test_pages_load_only_local_files_and_are_small(pages: dict[str, Page]) -> None:
    heavy = {}
    for name, page in pages.items():
        assert {urlsplit(address).scheme for address in page.loaded} <= {"", "data"}, name
        files = {page.file(address) for address in page.loaded if not urlsplit(address).scheme}
        size = page.size + sum(file.stat().st_size for file in files)
        # The page of the search loads the index of all words; other pages are the source code.
        other = name == "search" or name.startswith("_modules/")
        if size > DRAWN_SCENES.get(name, MOST_BYTES) and not other:
            heavy[name] = size
    assert heavy == {}


def test_every_picture_has_an_alternative(pages: dict[str, Page]) -> None:
    without = [
        f"{name}: {picture['src']}"
        for name, page in pages.items()
        for picture in page.pictures
        if not (picture.get("alt") or "").strip()
    ]
    assert without == []
    main = {"index", "install", "tutorial", "gallery", "how_sure", "compared_with_the_paper"}
    if "SEMSIG_SITE" not in os.environ:
        main.remove("tutorial")  # its pictures are drawn by its commands
    assert [name for name in main if not pages[name].pictures] == []


def test_tables_that_the_tutorial_prints_are_whole(site: Path) -> None:
    text = (site / "tutorial.html").read_text(encoding="utf-8")
    rows = [line.rstrip() for line in text.splitlines() if line[:1] in set("┏┃┡│└")]
    assert [row for row in rows if row[-1] not in "┓┃┩│┘"] == []
    assert rows or "SEMSIG_SITE" not in os.environ


def test_every_command_and_every_public_name_is_documented_once(pages: dict[str, Page]) -> None:
    for name in get_group(app).commands:
        assert f"cmdoption-semsig-{name}-help" in pages[f"commands/{name}"].names
    places = Counter(
        name.removeprefix("semsig_gis.")
        for key, page in pages.items()
        for name in page.names
        if key.startswith("api/") and re.fullmatch(r"semsig_gis\.\w+", name)
    )
    assert places == Counter(dir(semsig_gis))


def test_twenty_names_are_listed_by_task(pages: dict[str, Page]) -> None:
    links = re.findall(r"#semsig_gis\.(\w+)", "\n".join(pages["api/index"].links))
    assert len(links) == len(set(links)) == 20
    assert set(links) <= set(dir(semsig_gis))


def test_every_thumbnail_of_the_gallery_shows_a_file_of_a_command() -> None:
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    targets = re.findall(r"^:target: gallery/(\S+)$", text, re.MULTILINE)
    thumbnails = re.findall(r"^```\{figure\} (images/gallery/\S+)$", text, re.MULTILINE)
    assert [Path(name).stem for name in targets] == [Path(name).stem for name in thumbnails]
    code = "".join(
        re.findall(r"^```(?:console|python)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    )
    for target, thumbnail in zip(targets, thumbnails, strict=True):
        assert re.search(rf"[ \"]{re.escape(target)}[\n\"]", code), target
        assert (DOCS / thumbnail).is_file()


@pytest.mark.parametrize("name", MAIN)
def test_main_pages_are_accessible(name: str, site: Path, browser: Chrome) -> None:
    browser.get((site / f"{name}.html").as_uri())
    context = {"exclude": [["iframe"]]}  # maps have their own tests
    result = Axe().run(browser, context=context, options={"resultTypes": ["violations"]})
    assert [
        (rule["id"], [node["html"][:200] for node in rule["nodes"]])
        for rule in result["violations"]
    ] == []
