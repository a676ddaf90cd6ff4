"""Take the pictures of maps that the site shows, in Chromium: ``python docs/thumbnails.py``.

These are the pictures of the gallery that ``make docs`` wrote.
"""

from __future__ import annotations

import io
import shutil
import sys
import time
from pathlib import Path

from PIL import Image
from selenium import webdriver

DOCS = Path(__file__).resolve().parent
GALLERY, THUMBNAILS = DOCS / "_build/html/gallery", DOCS / "images/gallery"
SIZE, WIDTH = (900, 600), 450
QUALITY = 64
SETTLED_S = 4.0  # until all animations have ended


def main() -> None:
    """Take the pictures."""
    THUMBNAILS.mkdir(exist_ok=True)
    browser = open_browser(SIZE)
    screen = {"width": SIZE[0], "height": SIZE[1], "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    for page in sorted([*GALLERY.glob("*.html"), *GALLERY.glob("*.svg")]):
        target = THUMBNAILS / f"{page.stem}.webp"
        browser.get(page.resolve().as_uri())
        time.sleep(SETTLED_S)
        picture = Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")
        height = round(picture.height * WIDTH / picture.width)
        picture.resize((WIDTH, height), Image.Resampling.LANCZOS).save(target, quality=QUALITY)
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
