"""Take the pictures of `from_photo.md` and of the workbench: ``python docs/photo_pictures.py``.

A photo is drawn from a place of a made-up town, opened in the workbench and marked there.
"""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from selenium.webdriver.support.expected_conditions import presence_of_element_located
from selenium.webdriver.support.ui import WebDriverWait
from street_view import draw_view
from thumbnails import open_browser

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import semsig_gis as sg
from benchmarks.workbench import mark_object, open_photo, serving

if TYPE_CHECKING:
    from selenium.webdriver import Chrome
    from street_view import Mark

IMAGES = Path(__file__).resolve().parent / "images"
STEPS = IMAGES / "from_photo"
CELL, HEADING, FOV = 1386, 60.0, 75.0
MARKED = ("bike_station", "bus_stop", "bench", "street_light", "street_light", "alignment_tree")
DOUBTFUL = 2  # marks that are not enough for an answer
SCREEN = 1400, 1000
QUALITY = 72
PATIENCE_S = 60
WIDTH = 900


def main() -> None:
    """Make the town, and take the pictures."""
    STEPS.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        town = Path(folder)
        for command in (
            ["synthesize", "--size", "1000", "--out", town / "town"],
            ["build", town / "town/objects.parquet", "--out", town / "town.parquet"],
        ):
            subprocess.run(["semsig", *map(str, command)], check=True)  # noqa: S603, S607
        city = sg.open_city(town / "town.parquet")
        place = city.database.xy[CELL] + np.array([2.0, -1.5])  # as nobody stands in a centre
        photo, marks = draw_view(
            city.store.objects, city.store.footprints, place, heading=HEADING, fov=FOV
        )
        save(photo, STEPS / "photo.webp")
        file = town / "street.jpg"
        photo.save(file, quality=90)
        browser = open_browser(SCREEN)
        with serving(city) as address:
            open_photo(browser, address, file, fov=FOV, heading=None)
            symbols = {item.name: item.symbol for item in city.database.taxonomy.classes}
            things = chosen(marks)
            for mark in things[:DOUBTFUL]:
                mark_object(browser, mark.box, symbols[mark.name], width=photo.width)
            question = "css selector", "#question b"
            WebDriverWait(browser, PATIENCE_S).until(presence_of_element_located(question))
            save(
                below(element(browser, "#answer"), element(browser, "#question")),
                STEPS / "question.webp",
            )
            for mark in things[DOUBTFUL:]:
                mark_object(browser, mark.box, symbols[mark.name], width=photo.width)
            save(screenshot(browser), IMAGES / "workbench.webp")
            for name, selector in (("marks", "#scene"), ("wheels", "#wheels"), ("place", "#map")):
                save(element(browser, selector), STEPS / f"{name}.webp")
        browser.quit()


def chosen(marks: list[Mark]) -> list[Mark]:
    """Return the largest objects of each class that a person marks."""
    names = list(MARKED)
    result = []
    for mark in sorted(marks, key=lambda mark: mark.box[1] - mark.box[3]):
        if mark.name in names:
            names.remove(mark.name)
            result.append(mark)
    return result


def screenshot(browser: Chrome) -> Image.Image:
    """Return a picture of the window."""
    browser.execute_script("scroll(0, 0)")
    return Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")


def element(browser: Chrome, selector: str) -> Image.Image:
    """Return a picture of an element."""
    node = browser.find_element("css selector", selector)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", node)
    return Image.open(io.BytesIO(node.screenshot_as_png)).convert("RGB")


def below(*pictures: Image.Image) -> Image.Image:
    """Return pictures one below the other."""
    width, height = (max(picture.width for picture in pictures), sum(p.height for p in pictures))
    result, top = Image.new("RGB", (width, height), "white"), 0
    for picture in pictures:
        result.paste(picture, (0, top))
        top += picture.height
    return result


def save(picture: Image.Image, file: Path) -> None:
    """Save a picture, at most as wide as the text."""
    if picture.width > WIDTH:
        height = round(picture.height * WIDTH / picture.width)
        picture = picture.resize((WIDTH, height), Image.Resampling.LANCZOS)
    picture.save(file, quality=QUALITY)
    print(f"{file.name}: {file.stat().st_size / 1000:.0f} kB")  # noqa: T201


if __name__ == "__main__":
    main()
