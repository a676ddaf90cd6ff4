"""Which lines of the browser code the tests ran, as Chromium counts them."""

from __future__ import annotations

from collections import defaultdict
from importlib import resources
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

SCRIPTS = {
    file.name: file.read_text(encoding="utf-8")
    for file in resources.files("semsig_gis.maps").joinpath("js").iterdir()
    if file.name.endswith(".js")
}
# The name that `maps.parts.page_element` gives the script in a page.
FOLDER = "semsig/"


class BrowserCoverage:
    """A plugin of pytest that sums up what all browsers of all processes ran."""

    def __init__(self) -> None:
        self.lines: defaultdict[str, set[int]] = defaultdict(set)
        self.functions: defaultdict[str, dict[str, bool]] = defaultdict(dict)

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
            file = script["url"].removeprefix(FOLDER)
            if script["url"].startswith(FOLDER):
                self.lines[file] |= _lines(SCRIPTS[file], script["functions"])
                for function in script["functions"]:
                    whole = function["ranges"][0]
                    if whole["startOffset"] > 0:  # not the script itself
                        name = f"{whole['startOffset']}-{whole['endOffset']}"
                        ran = self.functions[file].get(name, False) or whole["count"] > 0
                        self.functions[file][name] = ran

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            lines = {file: sorted(numbers) for file, numbers in self.lines.items()}
            output["browser_coverage"] = (lines, dict(self.functions))

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:  # noqa: ANN401 - a class of pytest-xdist
        lines, functions = getattr(node, "workeroutput", {}).get("browser_coverage", ({}, {}))
        for file, numbers in lines.items():
            self.lines[file] |= set(numbers)
        for file, ran in functions.items():
            for name, once in ran.items():
                self.functions[file][name] = self.functions[file].get(name, False) or once

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if not self.lines:
            return
        terminalreporter.section("browser code that the tests ran")
        for file, text in sorted(SCRIPTS.items()):
            code = _code(text)
            ran, functions = len(self.lines[file] & code.keys()), self.functions[file].values()
            terminalreporter.write_line(
                f"{file:16}{ran:4} of {len(code):4} lines{ran / len(code):5.0%}"
                f"{sum(functions):4} of {len(functions):3} functions"
            )


def _code(text: str) -> dict[int, tuple[int, int]]:
    """Return where each line of code begins and ends, by its number."""
    code = {}
    end = 0
    for number, line in enumerate(text.splitlines(keepends=True), start=1):
        end += len(line)
        words = line.strip()
        if words and not words.startswith("//"):
            code[number] = (end - len(line.lstrip()), end - 1)
    return code


def _lines(text: str, functions: list[dict[str, Any]]) -> set[int]:
    """Return the numbers of the lines of which something ran."""
    ran = bytearray(len(text))
    for function in functions:
        for part in function["ranges"]:  # from the outermost to the innermost
            start, end = part["startOffset"], min(part["endOffset"], len(text))
            ran[start:end] = bytes([part["count"] > 0]) * (end - start)
    return {number for number, (start, end) in _code(text).items() if any(ran[start:end])}
