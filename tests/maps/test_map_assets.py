"""Map files that a page carries: nothing is left to be requested."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import folium
import pytest
from folium.plugins import MarkerCluster

from conftest import unavailable
from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.maps import page as map_assets

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome


@pytest.fixture
def _carried() -> None:
    if not map_assets.available():
        unavailable("browser", "the package was built without npm, so it carries no map files")


carried = pytest.mark.usefixtures("_carried")


def a_map(*, tiles: str | None = None) -> folium.Map:
    """Return a map with one of each element that needs a file: popup, marker, control."""
    map_ = folium.Map(location=[43.6, 3.88], zoom_start=14, tiles=tiles)
    map_.options["maxZoom"] = 20
    folium.Marker([43.6, 3.88], popup="<b>here</b>").add_to(map_)
    folium.LayerControl(collapsed=True).add_to(map_)
    return map_


def a_page() -> str:
    page: str = a_map().get_root().render()
    return page


class Resources(HTMLParser):
    """Every address that a page makes a browser load, as an HTML parser sees it."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.open: str | None = None
        self.text: dict[str, list[str]] = {"script": [], "style": []}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open = tag
        self.found += [value for name, value in attrs if name in {"src", "href"} and value]

    def handle_endtag(self, tag: str) -> None:  # noqa: ARG002
        self.open = None

    def handle_data(self, data: str) -> None:
        if self.open in self.text:
            self.text[self.open].append(data)


def test_every_link_of_a_folium_page_is_known() -> None:
    known = {file for asset in map_assets.assets().values() for file in asset.stands_for}
    linked = {address.rpartition("/")[2] for address in map_assets.external_files(a_page())}
    assert linked <= known | map_assets.UNUSED
    # and nothing in our lists is left over from an older folium
    assert linked >= map_assets.UNUSED
    assert linked >= known


@carried
def test_a_page_is_left_without_addresses_to_load() -> None:
    page = map_assets.inline_assets(a_page())
    assert map_assets.external_files(page) == ()
    parser = Resources()
    parser.feed(page)
    assert parser.found == []
    # one element a file: nothing inside a script or style closed it early
    assert [text for text in parser.text["style"] if "images/" in text] == []
    assert sum("Leaflet 1.9.3" in text for text in parser.text["script"]) == 1
    assert "sourceMappingURL" not in page


@carried
def test_the_rest_of_the_page_is_not_touched() -> None:
    page = a_page()
    inlined = map_assets.inline_assets(page)
    assert inlined.partition("</head>\n<body>")[2] == page.partition("</head>\n<body>")[2]
    assert map_assets.inline_assets(inlined) == inlined


@carried
def test_text_in_the_body_is_not_taken_for_a_link() -> None:
    body = '<head></head><body>&lt;b&gt;<script src="data:,"></script></body>'
    assert map_assets.inline_assets(body) == body


@pytest.mark.parametrize(
    "element",
    [
        folium.Marker([43.6, 3.88], icon=folium.Icon(color="red")),
        MarkerCluster([[43.6, 3.88]]),
    ],
    ids=["icon", "plugin"],
)
@carried
def test_an_element_that_needs_another_file_is_refused(element: folium.Element) -> None:
    map_ = a_map()
    element.add_to(map_)
    with pytest.raises(InputError, match="A self-contained map cannot"):
        map_assets.inline_assets(map_.get_root().render())


@carried
def test_the_end_of_an_element_inside_a_file_is_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    content = b"let a = '</SCRIPT><!-- </style>';"
    monkeypatch.setattr(map_assets, "_content", lambda _: content)
    assert map_assets.asset_text("jquery.min.js") == r"let a = '<\/SCRIPT><\!-- </style>';"
    assert map_assets.asset_text("leaflet.css") == r"let a = '</SCRIPT><!-- <\/style>';"


def test_unknown_names() -> None:
    with pytest.raises(UnknownNameError, match=r"nearest is 'jquery\.min\.js'"):
        map_assets.asset_text("jquery.js")
    with pytest.raises(UnknownNameError, match=r"'layers\.png' is not a map file"):
        map_assets.asset_text("layers.png")


@pytest.mark.parametrize("damage", ["absent", "changed"])
def test_without_the_files(damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    map_assets.assets()  # the manifest is read once, from the package
    if damage == "changed":
        (tmp_path / "leaflet.js").write_text("alert(1)", encoding="utf-8")
    monkeypatch.setattr(map_assets, "_folder", lambda: tmp_path)
    assert not map_assets.available()
    with pytest.raises(InputError, match=r"does not carry leaflet\.js of leaflet 1\.9\.3; make"):
        map_assets.asset_text("leaflet.js")


@carried
def test_the_page_works_in_a_browser_and_requests_nothing(browser: Chrome, tmp_path: Path) -> None:
    file = tmp_path / "map.html"
    file.write_text(map_assets.inline_assets(a_page()), encoding="utf-8")
    browser.get(file.as_uri())
    marker = browser.find_element("css selector", "img.leaflet-marker-icon")
    assert browser.execute_script("return arguments[0].naturalWidth", marker) == 25
    marker.click()
    popup = browser.find_element("css selector", ".leaflet-popup-content")
    assert (
        str(popup.get_property("innerText")).strip() == "here"
    )  # `text` is empty while it fades in
    assert browser.get_log("browser") == []
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    requested = {
        event["params"]["request"]["url"].partition(":")[0]
        for event in events
        if event["method"] == "Network.requestWillBeSent"
    }
    assert requested <= {"file", "data"}
