"""Which lines of the browser code the tests ran, as Chromium counts them."""

from __future__ import annotations

import re
from collections import defaultdict
from importlib import resources
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

SCRIPTS = {
    f"{folder}{file.name}": file.read_text(encoding="utf-8")
    for package, folder in (("output.html", ""), ("serve", "serve/"))
    for file in resources.files(f"semsig_gis.{package}").joinpath("js").iterdir()
    if file.name.endswith(".js")
}
# The name that `output.html.page_elements.page_element` and `serve.page` give the script in a page.
FOLDER = "semsig/"
MOST_LISTED = 20  # lines that no test ran


class BrowserCoverage:
    """A plugin of pytest that sums up what all browsers of all processes ran."""

    def __init__(self) -> None:
        self.lines: defaultdict[str, set[int]] = defaultdict(set)

    def start(self, browser: Chrome) -> None:
        """Count from now on, and once more before each page is left."""
        browser.execute_cdp_cmd("Profiler.enable", {})
        settings = {"callCount": False, "detailed": True}
        browser.execute_cdp_cmd("Profiler.startPreciseCoverage", settings)
        visit = browser.get

        def get(url: str) -> None:
            self.take(browser)
            visit(url)

        browser.get = get  # type: ignore[method-assign]

    def take(self, browser: Chrome) -> None:
        """Add what the page of a browser ran."""
        for script in browser.execute_cdp_cmd("Profiler.takePreciseCoverage", {})["result"]:
            if script["url"].removeprefix(FOLDER) in SCRIPTS:
                file = script["url"].removeprefix(FOLDER)
                self.lines[file] |= _lines_run(SCRIPTS[file], script["functions"])

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            output["browser_lines"] = {file: sorted(lines) for file, lines in self.lines.items()}

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:  # noqa: ANN401 - a class of pytest-xdist
        for file, lines in getattr(node, "workeroutput", {}).get("browser_lines", {}).items():
            self.lines[file] |= set(lines)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if not self.lines:
            return
        terminalreporter.section("browser code that the tests ran")
        for file, text in sorted(SCRIPTS.items()):
            code = [start for start, _ in _code(text)]
            ran = len(self.lines[file])
            missing = [text.count("\n", 0, at) + 1 for at in code if at not in self.lines[file]]
            listed = ", ".join(map(str, missing)) if len(missing) <= MOST_LISTED else ""
            note = f"  not {listed}" if listed else ""
            line = f"{file:20}{ran:4} of {len(code):4} lines{ran / len(code):5.0%}{note}"
            terminalreporter.write_line(line)


def _code(text: str) -> list[tuple[int, int]]:
    """Return where the words of each line of code begin and end."""
    lines = re.finditer(r"^[ \t]*+(?!//)(\S.*)$", text, re.MULTILINE)
    return [line.span(1) for line in lines]


def _lines_run(text: str, functions: list[dict[str, Any]]) -> set[int]:
    """Return the offsets of lines that ran at least in part."""
    ran = bytearray(len(text))
    for function in functions:
        for part in function["ranges"]:  # from the outermost to the innermost
            start, end = part["startOffset"], min(part["endOffset"], len(text))
            ran[start:end] = bytes([part["count"] > 0]) * (end - start)
    return {start for start, end in _code(text) if any(ran[start:end])}
