"""Tests of semsig_gis.map_frame."""

from __future__ import annotations

import html
import re

import folium
import pytest

from semsig_gis import map_assets
from semsig_gis.map_frame import show_map


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


def test_a_map_is_shown_without_the_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_assets, "available", lambda: False)
    page = framed_page(folium.Map(tiles=None))
    assert map_assets.external_files(page)
    assert page.startswith("<!DOCTYPE html>")
