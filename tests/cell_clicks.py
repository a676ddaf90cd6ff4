"""Clicks on the cells of a map, and what its popup says."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from map_pages import asked
from pyproj import Transformer
from selenium.webdriver.common.by import By

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

    from semsig_gis.database.database import SignatureDatabase

POPUP = "return [...document.querySelectorAll('.semsig-details')].pop()?.innerText"


def click(browser: Chrome, database: SignatureDatabase, cell: int) -> dict[str, str]:
    """Click the middle of a cell; return what its popup says, line by line."""
    to_degrees = Transformer.from_crs(database.crs, "EPSG:4326")
    latitude, longitude = to_degrees.transform(*database.xy[cell])
    script = "map.fire('click', {latlng: L.latLng(arguments[0], arguments[1])});"
    asked(browser, script, float(latitude), float(longitude))
    return popup(browser)


def popup(browser: Chrome) -> dict[str, str]:
    """Return what the popup says by its labels, its ``title``, and all of it as ``text``."""
    time.sleep(0.4)  # the arrays are unpacked once, and the popup before fades away
    text = browser.execute_script(POPUP)
    title, *lines = text.splitlines()
    said = (line.split("\t", 1) for line in lines if "\t" in line)
    labels = {one[0].strip(): one[1].strip() for one in said}
    return {"text": text, "title": title.strip(), **labels}


def jumps(browser: Chrome) -> list[str]:
    """Return the lines with buttons of the popup."""
    lines = browser.find_elements(By.CSS_SELECTOR, ".semsig-jumps")
    return [line.text.replace("\n", " ").strip() for line in lines]


def press(browser: Chrome, text: str) -> dict[str, str]:
    """Press the first button of the popup with a text or hint; return what the next one says."""
    buttons = browser.find_elements(By.CSS_SELECTOR, ".semsig-jumps button")
    words = (f"{button.text} {button.get_attribute('title')}" for button in buttons)
    next(button for button, said in zip(buttons, words, strict=True) if text in said).click()
    return popup(browser)
