"""Maps of a city of the size of Paris in Chromium: size, time to open, length of frames."""

from __future__ import annotations

import shutil
import statistics
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks._cities import made_up
from benchmarks.comparison import Comparison
from semsig_gis.database import ViewpointSpec, build_database
from semsig_gis.evaluation import evaluate
from semsig_gis.localization import Method
from semsig_gis.objects import StreetObjects
from semsig_gis.output import ambiguity_map, available, drift_map, evaluation_map, save_map
from semsig_gis.sources import PARIS_LIKE, CitySpec, synthetic_surroundings

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import folium
    from selenium.webdriver import Chrome

__all__ = ["comparisons"]

_CITIES = {"full": PARIS_LIKE, "small": CitySpec(size=300.0)}
_QUERIES = {"full": 20_000, "small": 50}
_ZOOMS = {"full": (1, 1, 1, -1, -1, -1), "small": (1,)}
_MOST_MB, _MOST_SECONDS, _MOST_MS = 8.0, 5.0, 100.0
_REPEATS = {"full": 3, "small": 1}
_SEED = 20
_REMOVED = 0.02  # share of the objects that are removed in a year

# Seconds from the start of loading until all layers are drawn.
DRAWN = """
const done = arguments[0];
const images = [...document.querySelectorAll("img.leaflet-image-layer")];
Promise.all(images.map((image) => image.decode())).then(() =>
  requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now() / 1000))));
"""

# Milliseconds between frames while the map is moved and zoomed.
FRAMES = """
const [zooms, done] = arguments;
const map = Object.values(window).find((value) => value instanceof L.Map);
const moved = (name, start) => new Promise((resolve) => { map.once(name, resolve); start(); });
const times = [];
let last = null;
let moving = true;
const frame = (now) => {
  if (last !== null) times.push(now - last);
  last = now;
  if (moving) requestAnimationFrame(frame);
};
(async () => {
  requestAnimationFrame(frame);
  for (const zoom of zooms) {
    await moved("zoomend", () => map.setZoom(map.getZoom() + zoom));
    for (const side of [[200, 0], [0, 200], [-200, -200]]) {
      await moved("moveend", () => map.panBy(side, {duration: 0.4}));
    }
  }
  moving = false;
  done(times);
})();
"""

# Milliseconds between frames while the sliders of the filters are moved, one step a frame.
_FILTERED = """
const done = arguments[0];
const sliders = [...document.querySelectorAll(".semsig-track input")];
const times = [];
let [last, step] = [null, 0];
const frame = (now) => {
  if (last !== null) times.push(now - last);
  last = now;
  const slider = sliders[Math.floor(step / 30) % sliders.length];
  slider.value = Math.round(slider.max * Math.abs(1 - step % 30 / 15));
  slider.dispatchEvent(new Event("input"));
  step += 1;
  if (step < 240) requestAnimationFrame(frame); else done(times);
};
requestAnimationFrame(frame);
"""

# Switch all layers off.
_BARE = """
for (const box of document.querySelectorAll(".leaflet-control-layers-overlays input:checked")) {
  box.click();
}
"""


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure the size and time of every map, and frames of the map with most points.

    Nothing is measured without Chromium, its driver, or the map files of the package.
    """
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None or not available():
        print("maps: not measured, because Chromium, its driver or the map files are not here")
        return
    with tempfile.TemporaryDirectory() as folder:
        browser = started(chromium, driver, folder)
        try:
            for what, city_map in _maps(_CITIES[size], _QUERIES[size]):
                page = Path(folder, "map.html")
                save_map(city_map, page, self_contained=True)
                yield from _measured(browser, page, what, _REPEATS[size])
            yield _filtering(browser, what)
            yield _smoothness(browser, what, _ZOOMS[size])
        finally:
            browser.quit()


def _maps(city: CitySpec, queries: int) -> Iterator[tuple[str, folium.Map]]:
    """Yield descriptions and maps; the map with most points is the last."""
    objects = made_up(city)
    streets = synthetic_surroundings(city)[1].table
    remaining = np.random.default_rng(_SEED).random(len(objects)) >= _REMOVED
    later = StreetObjects(objects.table[remaining], objects.taxonomy, objects.licenses)
    database, newer = (
        build_database(table, viewpoints=ViewpointSpec(mode="streets"), streets=streets)
        for table in (objects, later)
    )
    cells = f"{len(database):,} cells"
    yield f"which of {cells} look the same", ambiguity_map(database)
    drift = drift_map(database, newer, objects_before=objects, objects_after=later)
    yield f"which of {cells} have changed, with {int((~remaining).sum()):,} objects", drift
    evaluation = evaluate(database, queries=queries, method=Method.parse("types:edit"))
    yield f"{queries:,} queries among {cells}", evaluation_map(evaluation, database)


def _measured(browser: Chrome, page: Path, what: str, repeats: int) -> Iterator[Comparison]:
    """Measure the size of a map, and the time to open it."""
    seconds = []
    for _ in range(repeats):
        browser.get("about:blank")
        browser.get(page.as_uri())
        seconds.append(browser.execute_async_script(DRAWN))
    yield Comparison(
        name=f"map of {what}",
        unit="MB",
        ours=page.stat().st_size / 1e6,
        peer=_MOST_MB,
        peer_name="the most that is wanted",
        bar=1.0,
    )
    yield Comparison(
        name=f"opening the map of {what} in Chromium",
        unit="s",
        ours=statistics.median(seconds),
        peer=_MOST_SECONDS,
        peer_name="the most that is wanted",
        bar=1.0,
    )


def _filtering(browser: Chrome, what: str) -> Comparison:
    """Measure the frames while the filters of the open map are moved."""
    times = statistics.quantiles(browser.execute_async_script(_FILTERED), n=20)
    return Comparison(
        name=f"the longest of twenty frames while the filters of {what} are moved",
        unit="ms",
        ours=times[-1],
        peer=_MOST_MS,
        peer_name="the most that is wanted",
        bar=1.0,
    )


def _smoothness(browser: Chrome, what: str, zooms: Sequence[int]) -> Comparison:
    """Measure the frames while the open map is moved, with and without its layers."""
    with_layers = statistics.quantiles(browser.execute_async_script(FRAMES, zooms), n=20)[-1]
    browser.execute_script(_BARE)
    bare = statistics.quantiles(browser.execute_async_script(FRAMES, zooms), n=20)[-1]
    return Comparison(
        name=f"the longest frame of twenty while the map of {what} is moved",
        unit="ms",
        ours=with_layers,
        peer=bare,
        peer_name="the same page without its layers",
        bar=None,
    )


def started(chromium: str, driver: str, folder: str | Path) -> Chrome:
    """Start a browser without access to a network."""
    from selenium import webdriver  # noqa: PLC0415 - optional

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--no-first-run",
        "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
        "--window-size=1400,900",
        f"--user-data-dir={folder}/chromium",
    ):
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
