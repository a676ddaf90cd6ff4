"""Take the pictures of maps that the site shows, in Chromium: ``python docs/thumbnails.py``.

By default, these are the pictures of the gallery that ``make docs`` wrote. ``--hero MAP`` takes the
picture of the first page instead: a map of Montpellier by ``semsig map city.parquet --ambiguity``.
"""

from __future__ import annotations

import argparse
import io
import shutil
import sys
import time
from pathlib import Path

from PIL import Image
from selenium import webdriver

DOCS = Path(__file__).resolve().parent
GALLERY, IMAGES = DOCS / "_build/html/gallery", DOCS / "images"
HERO = IMAGES / "hero.webp"
HERO_SIZE, THUMBNAIL_SIZE = (1280, 640), (900, 600)
THUMBNAIL_WIDTH = 450
QUALITY = 72
SETTLED_S = 4.0  # until all animations have ended


def main() -> None:
    """Read the options, and take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hero", type=Path, metavar="MAP")
    hero = parser.parse_args().hero
    if hero is not None:
        pages = [(hero, HERO, HERO_SIZE, HERO_SIZE[0])]
    else:
        pages = [
            (page, IMAGES / f"gallery/{page.stem}.webp", THUMBNAIL_SIZE, THUMBNAIL_WIDTH)
            for page in sorted([*GALLERY.glob("*.html"), *GALLERY.glob("*.svg")])
        ]
    browser = open_browser(HERO_SIZE)
    for page, target, (across, down), width in pages:
        screen = {"width": across, "height": down, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        browser.get(page.resolve().as_uri())
        time.sleep(SETTLED_S)
        picture = Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")
        height = round(picture.height * width / picture.width)
        target.parent.mkdir(exist_ok=True)
        picture.resize((width, height), Image.Resampling.LANCZOS).save(target, quality=QUALITY)
        print(f"{target.relative_to(DOCS)}: {target.stat().st_size / 1000:.0f} kB")  # noqa: T201
    browser.quit()


def open_browser(size: tuple[int, int]) -> webdriver.Chrome:
    """Open Chromium with a window of a size in pixels."""
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        sys.exit("Chromium and its driver are not on this machine.")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for switch in ("headless=new", "no-sandbox", "disable-dev-shm-usage", "hide-scrollbars"):
        options.add_argument(f"--{switch}")
    options.add_argument("--window-size={},{}".format(*size))
    service = webdriver.ChromeService(executable_path=driver)
    return webdriver.Chrome(options=options, service=service)


if __name__ == "__main__":
    main()
