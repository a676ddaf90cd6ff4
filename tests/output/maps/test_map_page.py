"""Pages of maps with all their files, so that nothing is requested."""

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
from semsig_gis.output import (
    asset_text,
    assets,
    external_files,
    inline_assets,
    page_of_map,
    save_map,
    show_map,
)
from semsig_gis.output.html import page as map_page

if TYPE_CHECKING:
    from pathlib import Path

    from selenium.webdriver import Chrome

carried = pytest.mark.usefixtures("map_files")


def map_with_marker(*elements: folium.Element) -> folium.Map:
    """Return a map with the elements that need files: popup, marker, control."""
    map_ = folium.Map(location=[43.6, 3.88], zoom_start=14, tiles=None)
    map_.options["maxZoom"] = 20
    folium.Marker([43.6, 3.88], popup="<b>here</b>").add_to(map_)
    for element in (folium.LayerControl(collapsed=True), *elements):
        element.add_to(map_)
    return map_


def linked_page() -> str:
    page: str = map_with_marker().get_root().render()
    return page


def test_all_links_of_a_folium_page_are_in_the_manifest() -> None:
    replaceable = {file for asset in assets().values() for file in asset.replaces}
    linked = {address.rpartition("/")[2] for address in external_files(linked_page())}
    # Our lists contain no files of older folium versions.
    assert linked == replaceable | map_page.UNUSED


@carried
def test_inlined_page_loads_nothing() -> None:
    page = inline_assets(linked_page())
    assert external_files(page) == ()
    parsed = HtmlPage(page)
    assert [address for address in parsed.loaded if not address.startswith("data:")] == []
    # One element per file: nothing inside a script or style has closed it early.
    assert [text for text in parsed.text_of["style"] if "images/" in text] == []
    assert sum("Leaflet 1.9.3" in text for text in parsed.text_of["script"]) == 1
    assert "sourceMappingURL" not in page


@carried
def test_inlining_changes_only_the_head() -> None:
    page = linked_page()
    inlined = inline_assets(page)
    assert inlined.partition("</head>\n<body>")[2] == page.partition("</head>\n<body>")[2]
    assert inline_assets(inlined) == inlined
    body = '<head></head><body>&lt;b&gt;<script src="data:,"></script></body>'
    assert inline_assets(body) == body


@carried
def test_other_files_are_linked_or_refused() -> None:
    icon = folium.Marker([43.6, 3.88], icon=folium.Icon(color="red"))
    cluster = folium.plugins.MarkerCluster([[43.6, 3.88]])
    for element in (icon, cluster, folium.plugins.Draw()):
        map_ = map_with_marker(element)
        assert external_files(page_of_map(map_)) != ()
        with pytest.raises(InputError, match="A self-contained map cannot"):
            page_of_map(map_, self_contained=True)


@carried
def test_end_tags_in_files_are_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    content = b"let a = '</SCRIPT><!-- </style>';"
    monkeypatch.setattr(map_page, "_content", lambda _: content)
    assert asset_text("jquery.min.js") == r"let a = '<\/SCRIPT><\!-- </style>';"
    assert asset_text("leaflet.css") == r"let a = '</SCRIPT><!-- <\/style>';"


@pytest.mark.parametrize(
    ("name", "words"),
    [("jquery.js", "nearest is 'jquery.min.js'"), ("layers.png", "'layers.png' is not a map file")],
)
def test_unknown_asset_names_are_refused(name: str, words: str) -> None:
    with refused(UnknownNameError, words):
        asset_text(name)


@pytest.mark.parametrize("damage", ["absent", "changed"])
def test_missing_files_are_linked_or_refused(
    damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assets()  # the manifest is read once, from the package
    if damage == "changed":
        (tmp_path / "leaflet.js").write_text("alert(1)", encoding="utf-8")
    monkeypatch.setattr(map_page, "_folder", lambda: tmp_path)
    assert not map_page.available()
    with pytest.raises(InputError, match=r"does not contain leaflet\.js of leaflet 1\.9\.3; make"):
        asset_text("leaflet.js")
    assert external_files(framed_page(map_with_marker()))
    assert not save_map(map_with_marker(), tmp_path / "map.html")
    before = (tmp_path / "map.html").read_bytes()
    with pytest.raises(InputError, match="does not contain"):
        save_map(map_with_marker(), tmp_path / "map.html", self_contained=True)
    assert (tmp_path / "map.html").read_bytes() == before


@carried
def test_saved_page_works_without_requests(browser: Chrome, tmp_path: Path) -> None:
    file = tmp_path / "map.html"
    assert save_map(map_with_marker(), file)
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
def test_save_map_returns_whether_a_page_needs_no_requests(tmp_path: Path) -> None:
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
def test_framed_map_has_language_and_zoom_and_no_requests() -> None:
    map_ = folium.Map(tiles=None)
    folium.Marker((0, 0), tooltip='<b>"a" & b</b>').add_to(map_)
    page = framed_page(map_)
    assert external_files(page) == ()
    assert "L.marker(" in page
    assert '<html lang="en">' in page
    (scale,) = re.findall(r'<meta name="viewport"\s*content="([^"]*)"', page)
    assert scale == "width=device-width,\n                initial-scale=1.0"
