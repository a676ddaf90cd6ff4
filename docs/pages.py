"""Write the pages that the build generates: commands, public names, notebooks."""

from __future__ import annotations

import ast
import importlib
import inspect
import itertools
import re
import shutil
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from drawings import write_drawings
from gallery import write_gallery
from PIL import Image

import semsig_gis
from semsig_gis.cli.app import printing_of
from semsig_gis.commands import OUTPUT, PANELS, commands

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from sphinx.application import Sphinx

    from semsig_gis.commands import Command, Field

ROOT = Path(__file__).resolve().parents[1]
WRITTEN = ("api", "commands", "notebooks")
# Labels and keyboard focus that the theme lacks, for readers who use no screen or no mouse.
LABELS = {
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="Site">',
    '<aside class="toc-drawer': '<aside aria-label="On this page" class="toc-drawer',
    'role="heading">': 'role="heading" aria-level="2">',
    '<div class="highlight"><pre>': '<div class="highlight"><pre tabindex="0">',
    '<div class="table-wrapper': '<div tabindex="0" class="table-wrapper',
}
COLOURS = 64  # enough for figures and maps
# Parts of matplotlib's pictures and of the style of notebooks that are never visible.
UNSEEN = {
    ".svg": re.compile(
        r"""<path[ ]d="M[ ][\d.]+[ ][\d.]+[ ]\n"[^>]*/>  # a line of one point
        | \n[ ]*(?=<)
        | (?<=\d[.]\d\d)\d+(?=[ "])
        | (?<=[;:])[ ](?=[^<>"]*")
        | [ ]id="(?:line2d|patch|text)_\d+\"""",
        re.VERBOSE,
    ),
    ".css": re.compile(r"^div\.highlight \.-Color.*?\}\n", re.MULTILINE | re.DOTALL),
}
HELP = "Show the usual options; `--help-all` shows all."
COMMANDS = """# Commands

Every step is one command. `semsig COMMAND --help` prints its usual options and `--help-all` all
options. `semsig schema` prints the same for programs: the JSON Schema of the options and results.
"""
API = """# Python names

```python
import semsig_gis as sg
```

Most work needs twenty names:
"""
TASKS = {
    "Open": ("load", "objects_from_frame", "open_city", "load_catalog"),
    "Build": ("build", "City", "update_file"),
    "Ask": (
        *("localize", "localize_many", "parse_view", "Location"),
        *("locate_route", "evaluate", "identify"),
    ),
    "Draw": ("location_map", "city_map", "evaluation_map"),
    "Save": ("export_answer", "export_database", "save_map"),
}
MORE = """## More

The other names that `semsig_gis` has are listed by the package that defines them. Each package
exports more names, such as `semsig_gis.localization.search_regions`; `dir` lists them. Names that
are only in modules may change without notice.

The examples begin from `demo_objects` and `demo_database`: the street objects of a made-up town of
300 m, and the signatures of its cells.
"""


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages when the build begins, and the maps of the gallery when it ends."""
    app.connect("builder-inited", lambda app: write_pages(Path(app.srcdir)))
    app.connect("builder-inited", lambda app: _forget(Path(app.outdir)))
    app.connect("builder-inited", lambda app: write_drawings(Path(app.srcdir, "drawn")))
    app.connect("build-finished", _finish)
    app.connect("html-page-context", _lighten)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _forget(folder: Path) -> None:
    """Remove the notebook styles that the last build made smaller; they are copied again."""
    for path in folder.glob("_static/mystnb*.css"):
        path.unlink()


def _finish(app: Sphinx, error: Exception | None) -> None:
    """Label the parts of the written pages, make pictures smaller, and draw the maps."""
    for path in Path(app.outdir).rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        labelled = text
        for part, name in LABELS.items():
            labelled = labelled.replace(part, name)
        if labelled != text:
            path.write_text(labelled, encoding="utf-8")
    for path in [
        *Path(app.outdir).glob("_images/*.svg"),
        *Path(app.outdir).glob("_static/mystnb*.css"),
    ]:
        text = path.read_text(encoding="utf-8")
        path.write_text(UNSEEN[path.suffix].sub("", text), encoding="utf-8")
    for path in Path(app.outdir, "_images").glob("*.png"):
        with Image.open(path) as picture:
            if picture.mode != "P":
                few = picture.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
                few.save(path, optimize=True)
    if error is None and app.config.nb_execution_mode != "off":
        write_gallery(Path(app.outdir, "gallery"))


def _lighten(*event: Any) -> None:  # noqa: ANN401
    """Leave out the style of notebooks, which is large, on pages without a notebook cell."""
    *_, context, doctree = event
    parts = () if doctree is None else doctree.findall(nodes.Element)
    if not any("cell" in part["classes"] for part in parts):
        styles = context["css_files"]
        context["css_files"] = [style for style in styles if "mystnb" not in str(style.filename)]


def write_pages(docs: Path) -> None:
    """Write the folders of `WRITTEN`; an unchanged page is not written, and so not read again."""
    pages = {
        **{f"commands/{name}.md": text for name, text in command_pages()},
        **{f"api/{name}.md": text for name, text in api_pages()},
        "notebooks/index.md": notebooks_page(),
    }
    notebooks = {f"notebooks/{path.name}": path for path in ROOT.glob("notebooks/*.ipynb")}
    pages |= {name: path.read_text(encoding="utf-8") for name, path in notebooks.items()}
    for folder in WRITTEN:
        for path in docs.glob(f"{folder}/*"):
            if path.relative_to(docs).as_posix() not in pages:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
    for name, text in pages.items():
        path = docs / name
        path.parent.mkdir(exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def listed(head: str, entries: Mapping[str, tuple[str, str]]) -> str:
    """Return a page with a table of the pages in its folder: name, and first line."""
    rows = [f"| [`{name}`]({page}.md) | {marked(line)} |" for page, (name, line) in entries.items()]
    table = "\n".join(["| Name | What it does |", "| --- | --- |", *rows])
    pages = "\n".join(entries)
    return f"{head}\n{table}\n\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n"


# --- Commands ---------------------------------------------------------------------------------


def command_pages() -> Iterable[tuple[str, str]]:
    """Yield the name and the text of the page of every command, and of their list."""
    yield "index", commands_page()
    for item in commands().values():
        yield item.name, command_page(item)


def commands_page() -> str:
    """Return the page that lists the commands by group."""
    parts = [COMMANDS]
    for group, items in itertools.groupby(commands().values(), key=lambda item: item.group):
        rows = [
            f"| [`semsig {item.name}`]({item.name}.md) | {marked(item.line)} |" for item in items
        ]
        parts.append(f"## {group}\n\n| Name | What it does |\n| --- | --- |\n" + "\n".join(rows))
    pages = "\n".join(commands())
    return "\n\n".join([*parts, f"```{{toctree}}\n:hidden:\n\n{pages}\n```\n"])


def command_page(item: Command) -> str:
    """Return the page of a command, with an address for each of its options."""
    name = f"semsig {item.name}"
    arguments = [field.usage for field in item.fields if field.option.positional]
    usage = " ".join([name, *arguments, "[OPTIONS]"])
    parts = [
        f"# `{name}`\n\n{marked(item.help)}\n",
        f"```text\n{usage}\n```\n\n```{{program}} {name}\n```\n",
    ]
    usual: dict[str, list[str]] = {panel: [] for panel in PANELS}
    advanced: list[str] = []
    for field in [*item.fields, *printing_of(item)]:
        texts = advanced if field.option.advanced else usual[field.panel]
        texts.append(option_text(field))
    usual[OUTPUT].append(f"````{{option}} --help\n{HELP}\n````\n")
    for heading, texts in {**usual, "More options": advanced}.items():
        if texts:
            parts += [f"## {heading}\n", *texts]
    if item.examples:
        lines = "\n".join(item.examples)
        parts.append(f"## Examples\n\n```text\n{lines}\n```\n")
    return "\n".join(parts)


def option_text(field: Field) -> str:
    """Return an option with its help, and a line each for its default, range and names."""
    details = [detail[0].upper() + detail[1:] for detail in field.details]
    if field.option.suggestions is not None:
        details.append(f"Names: {', '.join(field.option.suggestions())}")
    lines = [marked(field.option.help), *(f"*{marked(line)}.*" for line in details)]
    text = "\n\n".join(lines)
    return f"````{{option}} {field.usage}\n{text}\n````\n"


def marked(text: str) -> str:
    """Return plain text as Markdown; text between backticks is not changed."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"([\\*_<>\[\]|#{}~$])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


# --- Public names -----------------------------------------------------------------------------


def public_names() -> dict[str, list[str]]:
    """Return the public names by package, in the order of the stub."""
    stub = ROOT / "semsig_gis/__init__.pyi"
    names: defaultdict[str, list[str]] = defaultdict(list)
    for node in ast.parse(stub.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            names[node.module.partition(".")[0]] += [alias.name for alias in node.names]
    return names


def api_pages() -> Iterable[tuple[str, str]]:
    """Yield the name and the text of the page of every package, and of their list."""
    packages = public_names()
    head = "\n".join([API, *map(task_table, TASKS), MORE])
    yield "index", listed(head, {package: (package, package_line(package)) for package in packages})
    for package, names in packages.items():
        yield package, api_page(package, names)


def task_table(task: str) -> str:
    """Return a heading and a table of the most used names for a task."""
    rows = []
    for name in TASKS[task]:
        line = (getattr(semsig_gis, name).__doc__ or "").partition("\n")[0]
        rows.append(f"| {{py:obj}}`{name} <semsig_gis.{name}>` | {marked(line)} |")
    table = "\n".join(["| Name | What it does |", "| --- | --- |", *rows])
    return f"## {task}\n\n{table}\n"


def package_line(package: str) -> str:
    """Return the first line of the docstring of a package."""
    module = importlib.import_module(f"semsig_gis.{package}")
    return (module.__doc__ or "").partition("\n")[0]


def api_page(package: str, names: list[str]) -> str:
    """Return the page of a package: its public names in brief, then each in full."""
    lines = [".. currentmodule:: semsig_gis", "", ".. autosummary::", ""]
    lines += [f"   {name}" for name in names]
    for name in names:
        member = getattr(semsig_gis, name)
        if inspect.isclass(member):
            lines += ["", f".. autoclass:: {name}", "   :members:"]
        else:
            lines += ["", f".. auto{'function' if callable(member) else 'data'}:: {name}"]
    rst = "\n".join(lines)
    return f"# `{package}`\n\n{package_line(package)}\n\n```{{eval-rst}}\n{rst}\n```\n"


# --- Notebooks --------------------------------------------------------------------------------


def notebooks_page() -> str:
    """Return the page that lists the notebooks."""
    text = (ROOT / "notebooks/README.md").read_text(encoding="utf-8")
    names = "\n".join(sorted(path.name for path in ROOT.glob("notebooks/*.ipynb")))
    return f"{text}\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"
