"""Maps in a real browser, and data that tries to harm them."""

from __future__ import annotations

import dataclasses
import json
import time
from typing import TYPE_CHECKING, Any

from selenium.webdriver.common.by import By

from semsig_gis.core.taxonomy import ObjectClass, Taxonomy
from semsig_gis.maps.page import save_map

if TYPE_CHECKING:
    from pathlib import Path

    import folium
    from selenium.webdriver import Chrome

    from semsig_gis.database.database import SignatureDatabase

HOSTILE = (
    "<script>alert(1)</script><img src=x onerror=alert(1)>\"'`${alert(1)}`\\</script>"
    "{{7*7}}{% raw %}{# gone #}&lt;é\u202eabc\u2028]]>"
)

# What the script of a page can be asked about its one map.
ASK = """
const map = Object.values(window).find((value) => value instanceof L.Map);
const circles = (colour) => {
  const found = [];
  map.eachLayer((layer) => {
    if (layer instanceof L.CircleMarker && layer.options.fillColor === colour) found.push(layer);
  });
  return found;
};
"""


def opened(browser: Chrome, map_: folium.Map, folder: Path) -> None:
    """Save a map as a self-contained page and open it."""
    file = folder / "map.html"
    assert save_map(map_, file, self_contained=True)
    browser.get(file.as_uri())


def asked(browser: Chrome, script: str, *arguments: Any) -> Any:  # noqa: ANN401
    return browser.execute_script(ASK + script, *arguments)


def drawn(browser: Chrome, colour: str, canvas: str = ".leaflet-marker-pane canvas") -> int:
    """Return the number of pixels of about this colour on a canvas, by default the circles'."""
    time.sleep(0.3)  # canvases are drawn with the next frame
    script = """
    const canvas = document.querySelector(arguments[1]);
    if (canvas === null) return 0;
    const wanted = [1, 3, 5].map((at) => parseInt(arguments[0].slice(at, at + 2), 16));
    const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let count = 0;
    for (let at = 0; at < data.length; at += 4) {
      if (data[at + 3] > 200 && wanted.every((part, i) => Math.abs(data[at + i] - part) < 12)) {
        count += 1;
      }
    }
    return count;
    """
    count: int = asked(browser, script, colour, canvas)
    return count


def searched(browser: Chrome, text: str, *keys: str) -> list[str]:
    """Type something into the search box, then press keys; return what it offered."""
    box = browser.find_element(By.CSS_SELECTOR, ".semsig-search input")
    box.clear()
    box.send_keys(text)
    offered = [
        one.text for one in browser.find_elements(By.CSS_SELECTOR, ".semsig-search [role=option]")
    ]
    for key in keys:
        box.send_keys(key)
    return offered


def popup_text(browser: Chrome) -> str:
    """Return what the newest popup says; one before it may still fade away."""
    time.sleep(0.3)
    text: str = browser.execute_script(
        "return [...document.querySelectorAll('.semsig-details')].pop().innerText"
    )
    return text


def switch(browser: Chrome, name: str) -> None:
    """Click a layer in the layer control."""
    labels = browser.find_elements(By.CSS_SELECTOR, ".leaflet-control-layers-overlays label")
    next(label for label in labels if label.text.strip().startswith(name)).click()


def assert_quiet(browser: Chrome) -> None:
    """Check that the page reported no error and asked for nothing."""
    # `drawn` reads canvases back, for which Chromium has an advice, not an error.
    messages = [
        entry
        for entry in browser.get_log("browser")
        if "willReadFrequently" not in entry["message"]
    ]
    assert messages == []
    assert browser.execute_script("return performance.getEntriesByType('resource').length") == 0
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked_for = [
        event["params"]["request"]["url"]
        for event in events
        if event["method"] == "Network.requestWillBeSent"
    ]
    assert [url for url in asked_for if not url.startswith(("file:", "data:"))] == []
    assert sum(url.startswith("file:") for url in asked_for) == 1


def hostile_database(database: SignatureDatabase) -> SignatureDatabase:
    """Return the database with a taxonomy and licences that try to do harm."""
    classes = tuple(
        ObjectClass(item.code, item.symbol, item.name, f"{item.symbol} {HOSTILE}")
        for item in database.taxonomy.classes
    )
    return dataclasses.replace(
        database, taxonomy=Taxonomy(classes), licenses=(f"{HOSTILE}: {HOSTILE}",)
    )
