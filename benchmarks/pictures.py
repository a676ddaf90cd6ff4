"""Pictures of every map and of the workbench in Chromium, and what the browser found wrong."""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import math
import os
import shutil
import statistics
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from axe_core_python.selenium import Axe

from benchmarks._cities import MONTPELLIER, made_up, real
from benchmarks.maps import DRAWN, FRAMES, started
from benchmarks.workbench import asked, photo_in, serving
from semsig_gis.database import ObjectStore, build_database, open_city, save_with_store
from semsig_gis.evaluation import evaluate, identify
from semsig_gis.localization import Method, build_index, cell_noise, localize, locate, named_noise
from semsig_gis.maps import (
    ambiguity_map,
    available,
    city_map,
    drift_map,
    evaluation_map,
    identifiability_map,
    localization_map,
    location_map,
    objects_map,
    save_map,
)
from semsig_gis.objects import StreetObjects
from semsig_gis.sources import CitySpec

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import folium
    from selenium.webdriver import Chrome

    from semsig_gis.evaluation import Evaluation, Identifiability

    Looks = Sequence[tuple[str, str]]

SCREENS = {"desk": (1440, 900, 1.0), "phone": (390, 844, 2.0)}
GROUNDS = ("light", "dark")
SEED = 20
GONE = 0.02  # share of the objects that a year takes away
QUERIES, TRIALS = 500, 5
WORKBENCH, MARKS = "workbench", 6
MOST_MB, MOST_MEDIAN_MS, MOST_LATE_MS = 6.5, 20.0, 100.0
ZOOMS = {"full": (-1, -1, 1, 1), "small": (1,)}
# Every screen with every ground, or each of them once.
LOOKS = {
    "full": tuple(itertools.product(SCREENS, GROUNDS)),
    "small": tuple(zip(SCREENS, GROUNDS, strict=True)),
}
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
    errors: tuple[str, ...]
    requests: tuple[str, ...]
    violations: tuple[str, ...]
    median_ms: float = math.nan
    late_ms: float = math.nan

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
    parser.add_argument(
        "--map", nargs="+", metavar="NAME", help="take pictures of these maps alone"
    )
    parser.add_argument(
        "--database", type=Path, metavar="FILE", help="take pictures of its workbench, too"
    )
    parser.add_argument(
        "--geodata",
        type=Path,
        default=os.environ.get("SEMSIG_GEODATA"),
        metavar="FOLDER",
        help="folder of open data (default: what SEMSIG_GEODATA names; else a made-up city)",
    )
    options = parser.parse_args()
    small = options.size == "small" or options.geodata is None
    size = "small" if small else "full"
    zooms, looks = ZOOMS[size], LOOKS[size]
    objects = made_up(CitySpec(size=300.0)) if small else real(Path(options.geodata), MONTPELLIER)
    options.out.mkdir(parents=True, exist_ok=True)
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None or not available():
        sys.exit("Chromium, its driver or the map files are not here; see CONTRIBUTING.md.")
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        browser = started(chromium, driver, folder)
        try:
            for name, draw in _maps(objects, 50 if small else QUERIES).items():
                if options.map and name not in options.map:
                    continue
                page = options.out / f"{name}.html"
                save_map(draw(), page, self_contained=True, title=None if small else MONTPELLIER)
                for picture in _pictures(browser, page, options.out, looks, zooms):
                    print(_line(picture), flush=True)
                    pictures.append(picture)
            cities = [] if options.database is None else [options.database]
            if not options.map or WORKBENCH in options.map:
                cities.insert(0, Path(folder, "city.parquet"))
                save_with_store(build_database(objects), ObjectStore.of(objects), cities[0])
            for city in cities:
                marks = 2 if small else MARKS
                for picture in _workbench(browser, city, options.out, looks, zooms, marks=marks):
                    print(_line(picture), flush=True)
                    pictures.append(picture)
        finally:
            browser.quit()
    told = [{**asdict(picture), "passed": picture.passed} for picture in pictures]
    (options.out / "pictures.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    print(f"pictures: {options.out}")
    sys.exit(0 if all(picture.passed for picture in pictures) else 1)


def _maps(objects: StreetObjects, queries: int) -> dict[str, Callable[[], folium.Map]]:
    """Return what draws every kind of map of a city, by name."""
    kept = np.random.default_rng(SEED).random(len(objects)) >= GONE
    later = StreetObjects(objects.table[kept], objects.taxonomy, objects.licenses)
    database, newer = build_database(objects), build_database(later)
    index = build_index(database, cell_noise(named_noise("generic"), database.grid.step))
    store = ObjectStore.of(objects)
    query = database.signature(int(np.argsort(database.lengths)[-len(database) // 10]))
    changes: Any = {"objects_before": objects, "objects_after": later}

    @functools.cache
    def identifiability() -> Identifiability:
        return identify(index, trials=TRIALS, class_trials=1)

    @functools.cache
    def evaluation() -> Evaluation:
        return evaluate(database, queries=queries, method=Method.parse("types:edit"))

    return {
        "ambiguity": lambda: ambiguity_map(database, identifiability=identifiability()),
        "identifiability": lambda: identifiability_map(identifiability()),
        "evaluation": lambda: evaluation_map(evaluation(), database),
        "drift": lambda: drift_map(database, newer, **changes),
        "everything": lambda: city_map(
            database,
            evaluation=evaluation(),
            identifiability=identifiability(),
            ambiguity=True,
            newer=newer,
            **changes,
        ),
        "objects": lambda: objects_map(objects, database=database),
        "localization": lambda: localization_map(
            localize(database, query, method=Method(), top=100), database
        ),
        "location": lambda: location_map(
            locate(index, query, store=store, refined=True, explained=3)
        ),
    }


def _pictures(
    browser: Chrome, page: Path, out: Path, looks: Looks, zooms: Sequence[int]
) -> Iterator[Picture]:
    """Yield the pictures of one page: on each screen, on each ground."""
    url = page.resolve().as_uri()
    for screen, ground in _screens(browser, looks):
        browser.get(url)
        browser.execute_async_script(DRAWN)
        browser.execute_script(ASK)
        picture = _picture(browser, out, (page.stem, screen, ground), page.stat().st_size)
        browser.get(url)
        browser.execute_async_script(DRAWN)
        yield _moved(browser, picture, zooms)


def _workbench(
    browser: Chrome, path: Path, out: Path, looks: Looks, zooms: Sequence[int], *, marks: int
) -> Iterator[Picture]:
    """Yield the pictures of the workbench of a city; print how soon it answers."""
    city = open_city(path)
    times: dict[bool, list[float]] = {True: [], False: []}
    name = WORKBENCH if path.stem == "city" else f"{WORKBENCH}-{path.stem}"
    with tempfile.TemporaryDirectory() as folder, serving(city) as address:
        photo = photo_in(city, Path(folder))
        for screen, ground in _screens(browser, looks):
            for known in times:  # pictures are of the one that is not known
                times[known] += asked(browser, address, photo, marks=marks, known=known)
            browser.execute_script("scroll(0, 0); document.querySelector('#seen').scrollTop = 0")
            size = len(browser.page_source.encode())
            picture = _picture(
                browser, out, (name, screen, ground), size, own=address.partition("?")[0]
            )
            browser.execute_script("document.getElementById('map').scrollIntoView()")
            browser.save_screenshot(str(out / f"{name}-{screen}-{ground}-map.png"))
            browser.execute_script("window.moved = semsig.map")
            yield _moved(browser, picture, zooms)
    for known, own in times.items():
        median, late = statistics.median(own), statistics.quantiles(own, n=10)[-1]
        print(
            f"{name}, {len(city.database):,} cells, heading {'known' if known else 'unknown'}: of "
            f"{len(own)} changes half are answered and drawn within {median:.0f} ms, and nine of "
            f"ten within {late:.0f} ms"
        )


def _screens(browser: Chrome, looks: Looks) -> Iterator[tuple[str, str]]:
    """Yield the names of each screen and ground, once the browser has them."""
    for screen, ground in looks:
        width, height, dots = SCREENS[screen]
        browser.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": dots, "mobile": dots > 1.0},
        )
        scheme = {"name": "prefers-color-scheme", "value": ground}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        yield screen, ground


def _picture(
    browser: Chrome, out: Path, names: tuple[str, str, str], size: int, *, own: str | None = None
) -> Picture:
    """Take a picture of the page that is open, which may ask its own server alone."""
    time.sleep(SETTLED_S)
    browser.save_screenshot(str(out / f"{'-'.join(names)}.png"))
    broken = Axe().run(browser, options={"resultTypes": ["violations"]})["violations"]
    requests = browser.execute_script(
        "return performance.getEntriesByType('resource').map((one) => one.name)"
    )
    allowed = () if own is None else (own, "data:", "blob:")
    name, screen, ground = names
    return Picture(
        map=name,
        screen=screen,
        ground=ground,
        mb=size / 1e6,
        errors=tuple(entry["message"] for entry in browser.get_log("browser")),
        requests=tuple(one for one in requests if not one.startswith(allowed)),
        violations=tuple(rule["id"] for rule in broken),
    )


def _moved(browser: Chrome, picture: Picture, zooms: Sequence[int]) -> Picture:
    """Return a picture with how smoothly the map that is open moves."""
    frames = browser.execute_async_script(FRAMES, zooms)
    late = statistics.quantiles(frames, n=20)[-1]
    return replace(picture, median_ms=statistics.median(frames), late_ms=late)


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
