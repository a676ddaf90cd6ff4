"""Screenshots of every map and of the workbench in Chromium, and errors of the browser."""

from __future__ import annotations

import argparse
import functools
import itertools
import math
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
from benchmarks._measuring import SIZES, add_geodata, write_rows
from benchmarks.maps import DRAWN, FRAMES, started
from benchmarks.workbench import answer_times, photo_in, serving
from semsig_gis.database import ObjectStore, build_database, open_city, save_with_store
from semsig_gis.evaluation import evaluate, identify
from semsig_gis.localization import Method, build_index, cell_noise, localize, locate, named_noise
from semsig_gis.objects import StreetObjects
from semsig_gis.output import (
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
REMOVED = 0.02  # share of the objects that are removed in a year
QUERIES, TRIALS = 500, 5
WORKBENCH, MARKS = "workbench", 6
MOST_MB, MOST_MEDIAN_MS, MOST_LATE_MS = 6.5, 20.0, 100.0
ZOOMS = {"full": (-1, -1, 1, 1), "small": (1,)}
# Every screen with every background, or each of them once.
LOOKS = {
    "full": tuple(itertools.product(SCREENS, GROUNDS)),
    "small": tuple(zip(SCREENS, GROUNDS, strict=True)),
}
SETTLED_S = 1.0  # until all animations have ended
# Click on the middle of the map.
ASK = """
const map = Object.values(window).find((value) => value instanceof L.Map);
map.fire("click", {latlng: map.getCenter()});
"""


@dataclass(frozen=True, kw_only=True)
class Screenshot:
    """One screenshot of a page, and errors and times in the browser."""

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
        """Whether there are no errors, and size and times are within the limits."""
        fast = self.median_ms <= MOST_MEDIAN_MS and self.late_ms <= MOST_LATE_MS
        quiet = not (self.errors or self.requests or self.violations)
        return fast and quiet and self.mb <= MOST_MB


def main() -> None:
    """Take the screenshots, print the results, and write them to ``pictures.json``."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pictures", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("pictures"), metavar="FOLDER")
    parser.add_argument("--size", choices=SIZES, default="full")
    parser.add_argument("--map", nargs="+", metavar="NAME", help="take pictures only of these maps")
    parser.add_argument(
        "--database", type=Path, metavar="FILE", help="take pictures of its workbench, too"
    )
    add_geodata(parser, "; without it, a made-up city")
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
                for picture in _screenshots(browser, page, options.out, looks, zooms):
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
    rows = [{**asdict(picture), "passed": picture.passed} for picture in pictures]
    write_rows(options.out / "pictures.json", rows)
    print(f"pictures: {options.out}")
    sys.exit(0 if all(picture.passed for picture in pictures) else 1)


def _maps(objects: StreetObjects, queries: int) -> dict[str, Callable[[], folium.Map]]:
    """Return the functions that draw each kind of map of a city, by name."""
    remaining = np.random.default_rng(SEED).random(len(objects)) >= REMOVED
    later = StreetObjects(objects.table[remaining], objects.taxonomy, objects.licenses)
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


def _screenshots(
    browser: Chrome, page: Path, out: Path, looks: Looks, zooms: Sequence[int]
) -> Iterator[Screenshot]:
    """Yield the screenshots of one page, for each screen and background."""
    url = page.resolve().as_uri()
    for screen, ground in _screens(browser, looks):
        browser.get(url)
        browser.execute_async_script(DRAWN)
        browser.execute_script(ASK)
        picture = _screenshot(browser, out, (page.stem, screen, ground), page.stat().st_size)
        browser.get(url)
        browser.execute_async_script(DRAWN)
        yield _with_frames(browser, picture, zooms)


def _workbench(
    browser: Chrome, path: Path, out: Path, looks: Looks, zooms: Sequence[int], *, marks: int
) -> Iterator[Screenshot]:
    """Yield the screenshots of the workbench of a city; print the times of its answers."""
    city = open_city(path)
    times: dict[bool, list[float]] = {True: [], False: []}
    name = WORKBENCH if path.stem == "city" else f"{WORKBENCH}-{path.stem}"
    with tempfile.TemporaryDirectory() as folder, serving(city) as address:
        photo = photo_in(city, Path(folder))
        for screen, ground in _screens(browser, looks):
            for with_heading in times:  # the pictures show the last case, without heading
                times[with_heading] += answer_times(
                    browser, address, photo, marks=marks, with_heading=with_heading
                )
            browser.execute_script("scroll(0, 0); document.querySelector('#seen').scrollTop = 0")
            size = len(browser.page_source.encode())
            picture = _screenshot(
                browser, out, (name, screen, ground), size, own=address.partition("?")[0]
            )
            browser.execute_script("document.getElementById('map').scrollIntoView()")
            browser.save_screenshot(str(out / f"{name}-{screen}-{ground}-map.png"))
            browser.execute_script("window.moved = semsig.map")
            yield _with_frames(browser, picture, zooms)
    for with_heading, own in times.items():
        median, late = statistics.median(own), statistics.quantiles(own, n=10)[-1]
        heading = "known" if with_heading else "unknown"
        print(
            f"{name}, {len(city.database):,} cells, heading {heading}: of "
            f"{len(own)} changes half are answered and drawn within {median:.0f} ms, and nine of "
            f"ten within {late:.0f} ms"
        )


def _screens(browser: Chrome, looks: Looks) -> Iterator[tuple[str, str]]:
    """Yield the names of each screen and background, after setting them in the browser."""
    for screen, ground in looks:
        width, height, dots = SCREENS[screen]
        browser.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": dots, "mobile": dots > 1.0},
        )
        scheme = {"name": "prefers-color-scheme", "value": ground}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        yield screen, ground


def _screenshot(
    browser: Chrome, out: Path, names: tuple[str, str, str], size: int, *, own: str | None = None
) -> Screenshot:
    """Take a screenshot of the open page; only requests to its own server are allowed."""
    time.sleep(SETTLED_S)
    browser.save_screenshot(str(out / f"{'-'.join(names)}.png"))
    broken = Axe().run(browser, options={"resultTypes": ["violations"]})["violations"]
    requests = browser.execute_script(
        "return performance.getEntriesByType('resource').map((entry) => entry.name)"
    )
    allowed = () if own is None else (own, "data:", "blob:")
    name, screen, ground = names
    return Screenshot(
        map=name,
        screen=screen,
        ground=ground,
        mb=size / 1e6,
        errors=tuple(entry["message"] for entry in browser.get_log("browser")),
        requests=tuple(address for address in requests if not address.startswith(allowed)),
        violations=tuple(rule["id"] for rule in broken),
    )


def _with_frames(browser: Chrome, picture: Screenshot, zooms: Sequence[int]) -> Screenshot:
    """Return a screenshot with the lengths of frames while the open map is moved."""
    frames = browser.execute_async_script(FRAMES, zooms)
    late = statistics.quantiles(frames, n=20)[-1]
    return replace(picture, median_ms=statistics.median(frames), late_ms=late)


def _line(picture: Screenshot) -> str:
    """Return the results of a screenshot as a line of text."""
    wrong = [*picture.errors, *picture.requests, *picture.violations]
    return (
        f"{picture.map}, {picture.screen}, {picture.ground}: {picture.mb:.1f} MB, frames of "
        f"{picture.median_ms:.1f} ms, of twenty the longest {picture.late_ms:.1f} ms"
        + (f"; wrong: {', '.join(wrong)}" if wrong else "")
    )


if __name__ == "__main__":
    main()
