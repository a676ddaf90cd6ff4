"""The page of the workbench in a browser, used by clicks, keys and files."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest
from machine import PATIENCE_S
from map_pages import BrowserPage, requested
from selenium.common.exceptions import TimeoutException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

if TYPE_CHECKING:
    from pathlib import Path

    from benchmarks.street_photos import StreetPhoto

STAGE = "#picture .stage"
QUIET = """
const {session} = semsig;
return Boolean(session) && !session.asking && !document.body.ariaBusy
  && Number(document.body.dataset.answered) === session.changedAt;
"""

# The page polls the condition itself, which is faster than repeated requests to the browser.
UNTIL = """
const [values, done] = [[...arguments].slice(0, -1), arguments[arguments.length - 1]];
const ask = function () { %s };
const look = () => {
  const value = ask.apply(null, values);
  if (value) done(value); else setTimeout(look, 20);
};
look();
"""


@dataclass(frozen=True)
class WorkbenchPage(BrowserPage):
    """The page of a workbench."""

    url: str

    def open(self) -> None:
        self.browser.get(self.url)
        behavior = {"behavior": "allow", "downloadPath": str(self.folder)}
        self.browser.execute_cdp_cmd("Browser.setDownloadBehavior", behavior)
        self.settle()

    def settle(self) -> str:
        """Wait until all changes are answered; return the sentence of the answer."""
        self.until(QUIET)
        return self.text("#sentence")

    def press(self, selector: str, text: str = "") -> str:
        """Click the first such element, or the first with a text."""
        next(element for element in self.all(selector) if text in ("", element.text)).click()
        return self.settle()

    def choose(self, selector: str, value: str) -> str:
        Select(self.one(selector)).select_by_value(value)
        return self.settle()

    def type(self, *keys: str) -> str:
        ActionChains(self.browser).send_keys(*keys).perform()
        return self.settle()

    def chord(self, *keys: str) -> str:
        """Press the last key while the others are held."""
        chain = ActionChains(self.browser)
        for key in keys[:-1]:
            chain.key_down(key)
        chain.send_keys(keys[-1])
        for key in keys[:-1]:
            chain.key_up(key)
        chain.perform()
        return self.settle()

    def give(self, selector: str, *files: Path) -> str:
        """Choose files in a file input; return the sentence of the answer."""
        self.one(selector).send_keys("\n".join(map(str, files)))
        return self.settle()

    def give_new(self, selector: str, name: str, content: str | bytes) -> str:
        """Write a file, and choose it in a file input; return the sentence of the answer."""
        file = self.folder / name
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        return self.give(selector, file)

    def notice(self) -> str:
        """Wait for a notice of the page; return it."""
        return str(self.until("return document.querySelector('#notice span')?.textContent"))

    def slide(self, selector: str, value: float) -> str:
        self.ask(
            "const [at, value] = arguments; const input = document.querySelector(at);"
            "input.value = value; input.dispatchEvent(new Event('input'));",
            selector,
            value,
        )
        return self.settle()

    def drag(self, selector: str, start: tuple[float, float], *moves: tuple[int, int]) -> str:
        """Drag from a place in an element, in shares of its size, by pixels; return the answer."""
        self.pull(selector, start, *moves)
        return self.settle()

    def pull(self, selector: str, start: tuple[float, float], *moves: tuple[int, int]) -> None:
        """Drag without waiting for an answer."""
        element = self.one(selector)
        self.ask("arguments[0].scrollIntoView({block: 'center'})", element)
        size = element.size
        x, y = (
            round((share - 0.5) * size[side])
            for share, side in zip(start, ("width", "height"), strict=True)
        )
        chain = ActionChains(self.browser, duration=0)
        chain.move_to_element_with_offset(element, x, y).click_and_hold()
        for move in moves:
            chain.move_by_offset(*move)
        chain.release().perform()

    def mark(self, photo: StreetPhoto, number: int) -> str:
        """Draw the box of an object of a photo, then type its class into the menu."""
        stage = self.one(STAGE).size
        wide, high = photo.size(number)
        size = max(round(wide * stage["width"]), 9), max(round(high * stage["height"]), 9)
        self.pull(STAGE, photo.corner(number), size)
        title = (
            "return semsig.session.city.classes.find((item) => item.symbol === arguments[0]).title"
        )
        return self.type(str(self.ask(title, photo.things[number][0])), Keys.ENTER)

    def brush(self, name: str) -> None:
        """Choose the class of the next marks; an empty one asks at each."""
        self.ask("document.getElementById('several').open = true")
        self.press(f"#palette [data-name='{name}']")

    def until(self, script: str, *arguments: object) -> Any:  # noqa: ANN401
        """Wait until a script returns a true value, and return it."""
        try:
            return self.browser.execute_async_script(UNTIL % script, *arguments)
        except TimeoutException:
            pytest.fail(f"{script}\n{self.text('#notice')}")

    def question(self) -> str:
        """Return the next question, which is shown shortly after an answer."""
        return str(self.until("return document.querySelector('#question b')?.textContent"))

    def saved(self, name: str) -> Path:
        """Return a file that the browser has saved."""
        file = self.folder / name
        end = time.monotonic() + PATIENCE_S
        while not file.exists():
            assert time.monotonic() < end, f"{name} is not saved"
            time.sleep(0.02)
        return file

    def assert_quiet(self) -> None:
        """Check that the page reported no error, and requested only its own server."""
        own = self.url.partition("?")[0]
        errors = [
            entry["message"]
            for entry in self.browser.get_log("browser")
            # The page shows a refused upload; the browser also logs its status code.
            if "the server responded with a status of 4" not in entry["message"]
        ]
        assert not errors, errors
        addresses = requested(self.browser)
        assert [url for url in addresses if not url.startswith((own, "data:", "blob:"))] == []
