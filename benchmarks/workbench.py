"""Use the workbench in a browser: open a photo, mark objects, and time the answers."""

from __future__ import annotations

import contextlib
import secrets
import threading
import time
from typing import TYPE_CHECKING

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from benchmarks.street_photos import WIDTH, street_photo
from semsig_gis.commands import SILENT, object_store
from semsig_gis.evaluation import Sight
from semsig_gis.serve import Workbench, make_server, open_listener, server_address

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from selenium.webdriver import Chrome

    from benchmarks.street_photos import StreetPhoto
    from semsig_gis.database import City

__all__ = ["answer_times", "mark_object", "open_photo", "photo_in", "serving"]

_TURNS = range(0, 360, 45)
_PATIENCE_S = 60.0
_STAGE = "#picture .stage"
_DROP = """
const files = new DataTransfer();
files.items.add(new File([new Uint8Array(arguments[0])], arguments[1], {type: "image/jpeg"}));
for (const kind of ["dragover", "drop"]) {
  document.body.dispatchEvent(
    new DragEvent(kind, {dataTransfer: files, bubbles: true, cancelable: true}));
}
"""
_ANSWERED = """
const {session} = semsig;
return Boolean(session) && !session.asking && !document.body.ariaBusy
  && Number(document.body.dataset.answered) === session.changedAt
  && (session.scenes.length > 0 || !arguments[0]);
"""
_SLIDE = """
const slider = document.getElementById(arguments[0]);
slider.value = arguments[1];
slider.dispatchEvent(new Event("input"));
"""
_TITLE = "return semsig.session.city.classes.find((item) => item.symbol === arguments[0]).title"
_TIMES = "return performance.getEntriesByName('semsig-answer').map((entry) => entry.duration)"


@contextlib.contextmanager
def serving(city: City) -> Iterator[str]:
    """Serve the workbench of a city while the block runs; yield its address."""
    bench = Workbench(city=city, store=object_store(city, None, SILENT, needed=False))
    bench.prepare()
    token = secrets.token_urlsafe(32)
    with open_listener(0) as listener:
        running = make_server(bench, listener, token=token)
        thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield server_address(listener, token)
        finally:
            running.should_exit = True
            thread.join()


def photo_in(city: City, folder: Path) -> StreetPhoto:
    """Draw a photo from the cell with most classes, in the direction with most of them."""
    database = city.database
    types = database.type_sequences
    cell = int((types.histogram > 0).sum(axis=1)[types.inverse].argmax())
    sight = Sight.of_cell(database, cell)
    file = folder / "street.jpg"
    draw = {
        turn: street_photo(sight, database.taxonomy, heading=turn, file=file) for turn in _TURNS
    }
    best = max(draw, key=lambda turn: len({symbol for symbol, _ in draw[turn].things}))
    return street_photo(sight, database.taxonomy, heading=best, file=file)


def answer_times(
    browser: Chrome, address: str, photo: StreetPhoto, *, marks: int, with_heading: bool
) -> list[float]:
    """Open a photo and mark some objects; return the milliseconds from each change to its answer.

    The heading of the photo is given, with an error of ten degrees, or is unknown.
    """
    heading = photo.heading if with_heading else None
    open_photo(browser, address, photo.file, fov=photo.fov, heading=heading)
    for symbol, box in photo.things[:marks]:
        mark_object(browser, box, symbol, width=WIDTH)
    return list(browser.execute_script(_TIMES))


def open_photo(
    browser: Chrome, address: str, file: Path, *, fov: float, heading: float | None
) -> None:
    """Open the workbench with a photo; None: its heading is unknown."""
    browser.get(address)
    _settle(browser)
    browser.execute_script(_DROP, list(file.read_bytes()), file.name)
    _settle(browser, with_photo=True)
    Select(browser.find_element(By.ID, "fov-known")).select_by_value("known")
    browser.execute_script(_SLIDE, "fov", fov)
    if heading is not None:
        Select(browser.find_element(By.ID, "heading-known")).select_by_value("known")
        browser.execute_script(_SLIDE, "heading", heading)
    _settle(browser)


def mark_object(
    browser: Chrome, box: tuple[float, float, float, float], symbol: str, *, width: float
) -> None:
    """Draw a box on a photo, in pixels of a picture of that width, and type its class."""
    x_min, y_min, x_max, y_max = box
    stage = browser.find_element(By.CSS_SELECTOR, _STAGE)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", stage)
    size = stage.size
    scale = size["width"] / width
    x, y = (
        round(corner * scale - size[side] / 2)
        for corner, side in ((x_min, "width"), (y_min, "height"))
    )
    wide, high = (max(round(edge * scale), 9) for edge in (x_max - x_min, y_max - y_min))
    chain = ActionChains(browser, duration=0)
    chain.move_to_element_with_offset(stage, x, y).click_and_hold()
    chain.move_by_offset(wide, high).release().perform()
    title = browser.execute_script(_TITLE, symbol)
    ActionChains(browser).send_keys(title, Keys.ENTER).perform()
    _settle(browser)


def _settle(browser: Chrome, *, with_photo: bool = False) -> None:
    """Wait until the last change is answered and, if `with_photo`, a photo is there."""
    end = time.monotonic() + _PATIENCE_S
    while not browser.execute_script(_ANSWERED, with_photo):
        if time.monotonic() > end:
            notice = browser.find_element(By.ID, "notice").text
            raise TimeoutError(f"the workbench did not answer within {_PATIENCE_S:g} s: {notice}")
        time.sleep(0.02)
