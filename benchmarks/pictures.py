"""Pictures of every kind of map in Chromium, to be looked at, and what the browser found wrong."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from axe_core_python.selenium import Axe

from benchmarks._cities import MONTPELLIER, made_up, real
from benchmarks.maps import DRAWN, FRAMES, started
from semsig_gis.database.build import build_database
from semsig_gis.database.city import ObjectStore
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.evaluation.identify.identify import identify
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.noise.model import cell_noise, named_noise
from semsig_gis.maps.cells import ambiguity_map, identifiability_map
from semsig_gis.maps.city import city_map
from semsig_gis.maps.drift import drift_map
from semsig_gis.maps.evaluation import evaluation_map
from semsig_gis.maps.location import localization_map, location_map
from semsig_gis.maps.objects import objects_map
from semsig_gis.maps.page import available, save_map
from semsig_gis.matching.method import Method
from semsig_gis.matching.search import localize
from semsig_gis.objects.table import StreetObjects
from semsig_gis.sources.synthetic.city import CitySpec

if TYPE_CHECKING:
    from collections.abc import Iterator

    import folium
    from selenium.webdriver import Chrome

SCREENS = {"desk": (1440, 900, 1.0), "phone": (390, 844, 2.0)}
GROUNDS = ("light", "dark")
SEED = 20
GONE = 0.02  # share of the objects that a year takes away
QUERIES, TRIALS = 500, 5
MOST_MB, MOST_MEDIAN_MS, MOST_LATE_MS = 6.5, 20.0, 100.0
ZOOMS = (-1, -1, 1, 1)
SETTLED_S = 1.0  # until what moves and fades is at rest
# Clicks the middle of the map.
ASK = """
const map = Object.values(window).find((value) => value instanceof L.Map);
map.fire("click", {latlng: map.getCenter()});
"""


@dataclass(frozen=True, kw_only=True)
class Picture:
    """One picture of a map, and what the browser said of the page."""

    map: str
    screen: str
    ground: str
    mb: float
    median_ms: float
    late_ms: float
    errors: tuple[str, ...]
    requests: tuple[str, ...]
    violations: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong with it."""
        fast = self.median_ms <= MOST_MEDIAN_MS and self.late_ms <= MOST_LATE_MS
        quiet = not (self.errors or self.requests or self.violations)
        return fast and quiet and self.mb <= MOST_MB


def main() -> None:
    """Read the options, draw, look and tell."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pictures", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("pictures"), metavar="FOLDER")
    parser.add_argument("--size", choices=["full", "small"], default="full")
    parser.add_argument("--map", metavar="NAME", help="take pictures of this map alone")
    parser.add_argument(
        "--geodata",
        type=Path,
        default=os.environ.get("SEMSIG_GEODATA"),
        metavar="FOLDER",
        help="folder of open data (default: what SEMSIG_GEODATA names; else a made-up city)",
    )
    options = parser.parse_args()
    small = options.size == "small" or options.geodata is None
    objects = made_up(CitySpec(size=300.0)) if small else real(Path(options.geodata), MONTPELLIER)
    options.out.mkdir(parents=True, exist_ok=True)
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None or not available():
        sys.exit("Chromium, its driver or the map files are not here; see CONTRIBUTING.md.")
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        browser = started(chromium, driver, folder)
        try:
            for name, drawn in _maps(objects, 50 if small else QUERIES):
                if options.map not in {None, name}:
                    continue
                page = options.out / f"{name}.html"
                save_map(drawn, page, self_contained=True, title=None if small else MONTPELLIER)
                for picture in _pictures(browser, page, options.out):
                    print(_line(picture), flush=True)
                    pictures.append(picture)
        finally:
            browser.quit()
    told = [{**asdict(picture), "passed": picture.passed} for picture in pictures]
    (options.out / "pictures.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    print(f"pictures: {options.out}")
    sys.exit(0 if all(picture.passed for picture in pictures) else 1)


def _maps(objects: StreetObjects, queries: int) -> Iterator[tuple[str, folium.Map]]:
    """Yield every kind of map of a city, by name."""
    kept = np.random.default_rng(SEED).random(len(objects)) >= GONE
    later = StreetObjects(objects.table[kept], objects.taxonomy, objects.licenses)
    database, newer = build_database(objects), build_database(later)
    index = build_index(database, cell_noise(named_noise("generic"), database.grid.step))
    identifiability = identify(index, trials=TRIALS, class_trials=1)
    yield "ambiguity", ambiguity_map(database, identifiability=identifiability)
    yield "identifiability", identifiability_map(identifiability)
    evaluation = evaluate(database, queries=queries, method=Method.parse("types:edit"))
    yield "evaluation", evaluation_map(evaluation, database)
    yield "drift", drift_map(database, newer, objects_before=objects, objects_after=later)
    everything = city_map(
        database,
        evaluation=evaluation,
        identifiability=identifiability,
        ambiguity=True,
        newer=newer,
        objects_before=objects,
        objects_after=later,
    )
    yield "everything", everything
    yield "objects", objects_map(objects, database=database)
    query = database.signature(int(np.argsort(database.lengths)[-len(database) // 10]))
    yield "localization", localization_map(localize(database, query), database)
    store = ObjectStore.of(objects)
    yield "location", location_map(locate(index, query, store=store, refined=True, explained=3))


def _pictures(browser: Chrome, page: Path, out: Path) -> Iterator[Picture]:
    """Yield the pictures of one page: on each screen, on each ground."""
    for screen, (width, height, dots) in SCREENS.items():
        browser.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": dots, "mobile": dots > 1.0},
        )
        for ground in GROUNDS:
            scheme = {"name": "prefers-color-scheme", "value": ground}
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
            browser.get(page.resolve().as_uri())
            browser.execute_async_script(DRAWN)
            browser.execute_script(ASK)
            time.sleep(SETTLED_S)
            browser.save_screenshot(str(out / f"{page.stem}-{screen}-{ground}.png"))
            broken = Axe().run(browser)["violations"]
            errors = browser.get_log("browser")
            requests = browser.execute_script(
                "return performance.getEntriesByType('resource').map((one) => one.name)"
            )
            browser.get(page.resolve().as_uri())
            browser.execute_async_script(DRAWN)
            frames = browser.execute_async_script(FRAMES, ZOOMS)
            yield Picture(
                map=page.stem,
                screen=screen,
                ground=ground,
                mb=page.stat().st_size / 1e6,
                median_ms=statistics.median(frames),
                late_ms=statistics.quantiles(frames, n=20)[-1],
                errors=tuple(entry["message"] for entry in errors),
                requests=tuple(requests),
                violations=tuple(rule["id"] for rule in broken),
            )


def _line(picture: Picture) -> str:
    """Return what a picture showed, in a line."""
    wrong = [*picture.errors, *picture.requests, *picture.violations]
    return (
        f"{picture.map}, {picture.screen}, {picture.ground}: {picture.mb:.1f} MB, frames of "
        f"{picture.median_ms:.1f} ms, of twenty the longest {picture.late_ms:.1f} ms"
        + (f"; wrong: {', '.join(wrong)}" if wrong else "")
    )


if __name__ == "__main__":
    main()
