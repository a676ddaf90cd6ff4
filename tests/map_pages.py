"""Pages of maps in a browser, and hostile data for tests."""

from __future__ import annotations

import json
import re
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import shapely
from machine import PATIENCE_S
from pyproj import Transformer
from selenium.webdriver import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait
from small_city import chances_of

from semsig_gis.core import Taxonomy
from semsig_gis.database import ObjectStore, build_database
from semsig_gis.localization import Method, build_index, localize, locate
from semsig_gis.output import (
    ambiguity_map,
    drift_map,
    evaluation_map,
    ground_map,
    identifiability_map,
    localization_map,
    location_map,
    objects_map,
    save_map,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import folium
    from selenium.webdriver import Chrome
    from selenium.webdriver.remote.webelement import WebElement

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.localization import Noise
    from semsig_gis.objects import StreetObjects

HOSTILE = (
    "<script>alert(1)</script><img src=x onerror=alert(1)>\"'`${alert(1)}`\\</script>"
    "{{7*7}}{% raw %}{# gone #}&lt;é\u202eabc\u2028]]>"
)
IMAGES = "img.leaflet-image-layer"
LEGEND = ".semsig-legend"

# Run before each page: collects the promises of arrays that the page unpacks.
UNPACKING = """
window.unpacking = [];
for (const name of ["arrayBuffer", "json"]) {
  const read = Response.prototype[name];
  Response.prototype[name] = function () {
    const result = read.call(this);
    window.unpacking.push(result);
    return result;
  };
}
"""
READY = "unpacked().then(() => requestAnimationFrame(() => arguments[0]()));"
# JavaScript functions that tests call on a page with a map.
ASK = Path(__file__).with_name("map_pages.js").read_text(encoding="utf-8")


@dataclass(frozen=True)
class BrowserPage:
    """A page in a browser that saves files in a folder."""

    browser: Chrome
    folder: Path

    def ask(self, script: str, *arguments: object) -> Any:  # noqa: ANN401
        """Return what a script returns."""
        return self.browser.execute_script(script, *arguments)

    def one(self, selector: str) -> WebElement:
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector: str) -> list[WebElement]:
        return self.browser.find_elements(By.CSS_SELECTOR, selector)

    def text(self, selector: str) -> str:
        """Return the text of the first such element, even if it is hidden."""
        return str(self.ask("return document.querySelector(arguments[0]).textContent", selector))


@dataclass(frozen=True)
class MapPage(BrowserPage):
    """A self-contained page with a map."""

    def open(self, map_: folium.Map) -> None:
        """Save a map as a self-contained page and open it; an alert fails the next command."""
        file = self.folder / "map.html"
        assert save_map(map_, file, self_contained=True)
        self.visit(file.as_uri())

    def visit(self, address: str) -> None:
        """Open an address, and wait until the page has unpacked its numbers."""
        self.browser.get(address)
        self.ask_later(READY)

    def follow(self, address: str) -> None:
        """Open an address like a link on another page, without stored colours."""
        self.browser.get("about:blank")
        storage = {"origin": "file://", "storageTypes": "local_storage"}
        self.browser.execute_cdp_cmd("Storage.clearDataForOrigin", storage)
        for log in ("browser", "performance"):
            self.browser.get_log(log)
        self.visit(address)

    def ask_later(self, script: str, *arguments: Any) -> Any:  # noqa: ANN401
        """Return what a script passes to its last argument, a callback."""
        return self.browser.execute_async_script(ASK + script, *arguments)

    def ask(self, script: str, *arguments: object) -> Any:  # noqa: ANN401
        return super().ask(ASK + script, *arguments)

    def circles(self, kind: str) -> int:
        """Return the number of circles of a colour, or of queries with an outcome."""
        return int(self.ask("return signs(arguments[0]).length", kind))

    def drawn(self, colour: str, canvas: str = ".leaflet-marker-pane canvas") -> int:
        """Return the number of pixels of about this colour on a canvas, by default the circles'."""
        self.rest()
        return int(self.ask("return drawn(...arguments)", colour, canvas))

    def texts(self, selector: str) -> list[str]:
        """Return the visible texts of all such elements, in a single fast request."""
        script = "return [...document.querySelectorAll(arguments[0])].map((part) => part.innerText)"
        return [text.strip() for text in self.ask(script, selector)]

    def layers(self) -> list[str]:
        """Return the names in the layer control."""
        return self.texts(".leaflet-control-layers-overlays label")

    def switch(self, name: str) -> None:
        """Click a layer in the layer control, which is folded where the panel is open at first."""
        ActionChains(self.browser).move_to_element(self.one(".leaflet-control-layers")).perform()
        at = next(at for at, layer in enumerate(self.layers()) if layer.startswith(name))
        self.all(".leaflet-control-layers-overlays label")[at].click()

    def search(self, text: str, *keys: str) -> list[str]:
        """Search for a text and press keys; return the results once the map is at rest.

        Only the last two characters are typed, the others are pasted.
        """
        box = self.one(".semsig-search input")
        self.ask("arguments[0].value = arguments[1]", box, text[:-2])
        box.send_keys(text[-2:])
        results = self.texts(".semsig-search [role=option]")
        for key in keys:
            box.send_keys(key)
        self.rest()
        return results

    def rest(self) -> None:
        """Wait until arrays are unpacked, canvases are drawn, and the map is at rest."""
        self.ask_later("unpacked().then(() => atRest(arguments[0]))")

    def until(self, condition: Callable[[], Any]) -> Any:  # noqa: ANN401
        """Wait until a condition has a true value, and return it."""
        return WebDriverWait(self.browser, PATIENCE_S, 0.02).until(lambda _: condition())

    def until_gone(self, selector: str) -> None:
        """Wait until the last such element has faded away."""
        self.until(lambda: self.all(selector) == [])

    def panel(self) -> str:
        """Return the text of the panel, empty if it is closed."""
        self.rest()
        return str(self.ask("return panel()"))

    def facts(self) -> dict[str, str]:
        """Return the values of the panel by label, its ``title``, and the whole ``text``."""
        text = self.panel()
        title, *lines = text.splitlines()
        pairs = (line.split("\t", 1) for line in lines if "\t" in line)
        labels = {label.strip(): value.strip() for label, value in pairs}
        return {"text": text, "title": title.strip(), **labels}

    def classes(self, label: str) -> list[str]:
        """Return the titles of the objects that the panel lists with their bearings."""
        parts = self.facts()[label].replace("\u00a0", " ").split(", ")
        return [re.sub(r" \d+°.*", "", part) for part in parts]

    def click(self, database: SignatureDatabase, cell: int) -> dict[str, str]:
        """Click the middle of a cell; return the facts in the panel."""
        to_degrees = Transformer.from_crs(database.crs, "EPSG:4326")
        self.click_at(to_degrees.transform(*database.xy[cell].tolist()))
        return self.facts()

    def click_at(self, latlon: Sequence[float]) -> None:
        self.ask("map.fire('click', {latlng: L.latLng(...arguments)})", *latlon)

    def panel_of(self, kind: str) -> str:
        """Click the first circle of a colour, or query of an outcome; return the panel text."""
        self.ask("signs(arguments[0])[0].fire('click')", kind)
        return self.panel()

    def point_at(self, circle: str, *arguments: object) -> None:
        """Zoom to the circle that a script returns and click it with the mouse."""
        script = f"""
        const place = ({circle}).getLatLng();
        map.setView(place, 20, {{animate: false}});
        const point = map.latLngToContainerPoint(place);
        return [point.x, point.y];
        """
        x, y = self.ask(script, *arguments)
        mouse = ActionBuilder(self.browser)
        mouse.pointer_action.move_to_location(round(x), round(y)).click()
        mouse.perform()

    def jumps(self) -> list[str]:
        """Return the lines with buttons of the panel."""
        return [line.replace("\n", " ") for line in self.texts(".semsig-jumps")]

    def press(self, text: str) -> dict[str, str]:
        """Press the first button of the panel with a text or hint; return the new facts."""
        script = """
        const buttons = [...document.querySelectorAll(".semsig-jumps button")];
        return buttons.find(({innerText, title}) => `${innerText} ${title}`.includes(arguments[0]));
        """
        self.ask(script, text).click()
        return self.facts()

    @contextmanager
    def screen(
        self,
        width: int,
        height: int,
        *,
        mobile: bool = True,
        dots: int = 1,
        media: str = "",
        moving: bool = False,
    ) -> Iterator[None]:
        """Set the size of the window, or of a printed page.

        With `moving`, reduced motion is off and the map glides.
        """
        size = {"width": width, "height": height, "deviceScaleFactor": dots, "mobile": mobile}
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        motion = {"name": "prefers-reduced-motion", "value": "no-preference" if moving else ""}
        emulated = {"media": media, "features": [motion]}
        self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", emulated)
        try:
            yield
        finally:
            self.browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
            self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})

    def assert_text_stays_text(self) -> None:
        """Check that no text from data is an element of the page."""
        for element in ("script", "img"):
            assert self.all(f"{LEGEND} {element}, .semsig-panel {element}") == []


def assert_quiet(browser: Chrome) -> None:
    """Check that the page reported no error and requested nothing."""
    # Chromium logs advice about canvases that `drawn` reads back, which is no error.
    messages = [entry["message"] for entry in browser.get_log("browser")]
    assert [message for message in messages if "willReadFrequently" not in message] == []
    assert browser.execute_script("return performance.getEntriesByType('resource').length") == 0
    requests = requested(browser)
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []
    assert sum(url.startswith("file:") for url in requests) == 1


def requested(browser: Chrome) -> list[str]:
    """Return the addresses that the browser requested since its logs were read."""
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [
        event["params"]["request"]["url"]
        for event in events
        if event["method"] == "Network.requestWillBeSent"
    ]


def maps_of(
    city: SignatureDatabase, objects: StreetObjects, evaluation: Evaluation, noise: Noise
) -> dict[str, Callable[..., folium.Map]]:
    """Return a function for each map of a city."""
    query = city.signature(0)
    location = locate(
        build_index(city, noise), query, top=5, explained=1, store=ObjectStore.of(objects)
    )
    localization = localize(city, query, top=5, method=Method())
    later = replace(objects, table=objects.table[3:])
    dates: dict[str, Any] = {"objects_before": objects, "objects_after": later}
    house = shapely.box(*city.xy[0], *(city.xy[0] + 20))
    return {
        "evaluation": partial(evaluation_map, evaluation, city),
        "localization": partial(localization_map, localization, city),
        "location": partial(location_map, location),
        "ambiguity": partial(ambiguity_map, city),
        "identifiability": partial(identifiability_map, replace(chances_of(city), noise=noise)),
        "drift": partial(drift_map, city, build_database(later), **dates),
        "objects": partial(objects_map, objects),
        "ground": partial(ground_map, buildings=gpd.GeoDataFrame(geometry=[house], crs=city.crs)),
    }


def hostile_taxonomy(taxonomy: Taxonomy, harm: str = HOSTILE) -> Taxonomy:
    classes = (replace(item, title=f"{item.symbol} {harm}") for item in taxonomy.classes)
    return Taxonomy(tuple(classes))


def hostile_database(database: SignatureDatabase) -> SignatureDatabase:
    """Return the database with hostile class titles and licences."""
    taxonomy = hostile_taxonomy(database.taxonomy)
    return replace(database, taxonomy=taxonomy, licenses=(f"{HOSTILE}: {HOSTILE}",))


def titles(database: SignatureDatabase, types: str) -> list[str]:
    """Return the titles of symbols of classes."""
    return [database.taxonomy.by_symbol(symbol).title for symbol in types]
