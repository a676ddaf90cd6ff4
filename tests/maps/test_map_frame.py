"""Tests of semsig_gis.maps.page."""

from __future__ import annotations

import html
import re

import folium
import folium.plugins
import pytest
from sentences import assert_sentence

from semsig_gis.core.errors import InputError
from semsig_gis.maps import page as map_assets
from semsig_gis.maps.page import page_of_map, show_map


def framed_page(map_: folium.Map) -> str:
    """Return the page that a notebook would show."""
    shown = show_map(map_, height=321)._repr_html_()
    assert "height: 321px" in shown
    (source,) = re.findall(r'srcdoc="([^"]*)"', shown)
    return html.unescape(source)


@pytest.mark.skipif(not map_assets.available(), reason="the package carries no map files")
def test_a_framed_map_makes_no_request() -> None:
    map_ = folium.Map(tiles=None)
    folium.Marker((0, 0), tooltip='<b>"a" & b</b>').add_to(map_)
    page = framed_page(map_)
    assert map_assets.external_files(page) == ()
    assert "L.marker(" in page


@pytest.mark.skipif(not map_assets.available(), reason="the package carries no map files")
def test_a_map_that_needs_other_files_links_them() -> None:
    map_ = folium.Map(tiles=None)
    folium.plugins.Draw().add_to(map_)
    assert any("draw" in address for address in map_assets.external_files(framed_page(map_)))
    with pytest.raises(InputError) as caught:
        page_of_map(map_, self_contained=True)
    assert_sentence(caught.value, "draw")


def test_a_page_names_its_language_and_may_be_enlarged() -> None:
    page = framed_page(folium.Map(tiles=None))
    assert '<html lang="en">' in page
    (scale,) = re.findall(r'<meta name="viewport"\s*content="([^"]*)"', page)
    assert scale == "width=device-width,\n                initial-scale=1.0"


def test_a_map_is_shown_without_the_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_assets, "available", lambda: False)
    page = framed_page(folium.Map(tiles=None))
    assert map_assets.external_files(page)
    assert page.startswith("<!DOCTYPE html>")
