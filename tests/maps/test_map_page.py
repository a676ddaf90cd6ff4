"""Pages of maps: files that they carry, so that nothing is left to be requested."""

from __future__ import annotations

import html
import re
from typing import TYPE_CHECKING

import folium
import folium.plugins
import pytest
from html_pages import HtmlPage
from map_pages import requested
from sentences import refused

from semsig_gis.core import InputError, UnknownNameError
from semsig_gis.maps import (
    asset_text,
    assets,
    external_files,
    inline_assets,
    page_of_map,
    save_map,
    show_map,
)
from semsig_gis.maps import page as map_page

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

carried = pytest.mark.usefixtures("carried")


def a_map(*elements: folium.Element) -> folium.Map:
    """Return a map with one of each element that needs a file: popup, marker, control."""
    map_ = folium.Map(location=[43.6, 3.88], zoom_start=14, tiles=None)
    map_.options["maxZoom"] = 20
    folium.Marker([43.6, 3.88], popup="<b>here</b>").add_to(map_)
    for element in (folium.LayerControl(collapsed=True), *elements):
        element.add_to(map_)
    return map_


def linked_page() -> str:
    page: str = a_map().get_root().render()
    return page


def test_every_link_of_a_folium_page_is_known() -> None:
    known = {file for asset in assets().values() for file in asset.stands_for}
    linked = {address.rpartition("/")[2] for address in external_files(linked_page())}
    # and nothing in our lists is left over from an older folium
    assert linked == known | map_page.UNUSED


@carried
def test_a_page_is_left_without_addresses_to_load() -> None:
    page = inline_assets(linked_page())
    assert external_files(page) == ()
    parsed = HtmlPage(page)
    assert [address for address in parsed.loaded if not address.startswith("data:")] == []
    # one element a file: nothing inside a script or style closed it early
    assert [text for text in parsed.text_of["style"] if "images/" in text] == []
    assert sum("Leaflet 1.9.3" in text for text in parsed.text_of["script"]) == 1
    assert "sourceMappingURL" not in page


@carried
def test_the_rest_of_the_page_is_not_touched() -> None:
    page = linked_page()
    inlined = inline_assets(page)
    assert inlined.partition("</head>\n<body>")[2] == page.partition("</head>\n<body>")[2]
    assert inline_assets(inlined) == inlined
    body = '<head></head><body>&lt;b&gt;<script src="data:,"></script></body>'
    assert inline_assets(body) == body


@carried
def test_an_element_that_needs_another_file_is_linked_or_refused() -> None:
    icon = folium.Marker([43.6, 3.88], icon=folium.Icon(color="red"))
    cluster = folium.plugins.MarkerCluster([[43.6, 3.88]])
    for element in (icon, cluster, folium.plugins.Draw()):
        map_ = a_map(element)
        assert external_files(page_of_map(map_)) != ()
        with pytest.raises(InputError, match="A self-contained map cannot"):
            page_of_map(map_, self_contained=True)


@carried
def test_the_end_of_an_element_inside_a_file_is_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    content = b"let a = '</SCRIPT><!-- </style>';"
    monkeypatch.setattr(map_page, "_content", lambda _: content)
    assert asset_text("jquery.min.js") == r"let a = '<\/SCRIPT><\!-- </style>';"
    assert asset_text("leaflet.css") == r"let a = '</SCRIPT><!-- <\/style>';"


@pytest.mark.parametrize(
    ("name", "words"),
    [("jquery.js", "nearest is 'jquery.min.js'"), ("layers.png", "'layers.png' is not a map file")],
)
def test_unknown_names(name: str, words: str) -> None:
    with refused(UnknownNameError, words):
        asset_text(name)


@pytest.mark.parametrize("damage", ["absent", "changed"])
def test_without_the_files(damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assets()  # the manifest is read once, from the package
    if damage == "changed":
        (tmp_path / "leaflet.js").write_text("alert(1)", encoding="utf-8")
    monkeypatch.setattr(map_page, "_folder", lambda: tmp_path)
    assert not map_page.available()
    with pytest.raises(InputError, match=r"does not contain leaflet\.js of leaflet 1\.9\.3; make"):
        asset_text("leaflet.js")
    assert external_files(framed_page(a_map()))
    assert not save_map(a_map(), tmp_path / "map.html")
    before = (tmp_path / "map.html").read_bytes()
    with pytest.raises(InputError, match="does not contain"):
        save_map(a_map(), tmp_path / "map.html", self_contained=True)
    assert (tmp_path / "map.html").read_bytes() == before


@carried
def test_the_page_works_in_a_browser_and_requests_nothing(browser: Chrome, tmp_path: Path) -> None:
    file = tmp_path / "map.html"
    assert save_map(a_map(), file)
    browser.get(file.as_uri())
    marker = browser.find_element("css selector", "img.leaflet-marker-icon")
    assert browser.execute_script("return arguments[0].naturalWidth", marker) == 25
    marker.click()
    popup = browser.find_element("css selector", ".leaflet-popup-content")
    # `text` is empty while it fades in
    assert str(popup.get_property("innerText")).strip() == "here"
    assert browser.get_log("browser") == []
    assert {url.partition(":")[0] for url in requested(browser)} <= {"file", "data"}


@carried
def test_a_map_says_whether_it_makes_requests(tmp_path: Path) -> None:
    file = tmp_path / "map.html"
    assert not save_map(folium.Map(tiles=None), file, self_contained=False)
    before = file.read_text(encoding="utf-8")
    assert "https://" in before
    with refused(InputError, "map.html"):
        save_map(folium.Map(tiles=None), file / "map.html", self_contained=False)
    assert file.read_text(encoding="utf-8") == before
    assert save_map(folium.Map(tiles=None), file)
    assert not save_map(folium.Map(), file)


def framed_page(map_: folium.Map) -> str:
    """Return the page that a notebook would show."""
    frame = show_map(map_, height=321)._repr_html_()
    assert "height: 321px" in frame
    (source,) = re.findall(r'srcdoc="([^"]*)"', frame)
    page = html.unescape(source)
    assert page.startswith("<!DOCTYPE html>")
    return page


@carried
def test_a_framed_map_makes_no_request_names_its_language_and_may_be_enlarged() -> None:
    map_ = folium.Map(tiles=None)
    folium.Marker((0, 0), tooltip='<b>"a" & b</b>').add_to(map_)
    page = framed_page(map_)
    assert external_files(page) == ()
    assert "L.marker(" in page
    assert '<html lang="en">' in page
    (scale,) = re.findall(r'<meta name="viewport"\s*content="([^"]*)"', page)
    assert scale == "width=device-width,\n                initial-scale=1.0"
