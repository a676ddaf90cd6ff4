"""The page of the workbench: its files put into one, each allowed by the nonce of the page."""

from __future__ import annotations

import html
import re
from importlib import resources

from semsig_gis.maps import asset_text

_SCRIPT = re.compile(r'<script src="(?P<name>[^"]+)"></script>')
_STYLE = re.compile(r'<link rel="stylesheet" href="(?P<name>[^"]+)">')
ASSETS = frozenset({"leaflet.js", "leaflet.css"})


def workbench_page(nonce: str) -> str:
    """Return the page, which asks no other server for anything.

    Scripts and style sheets that ``index.html`` names stand in it: ``leaflet.js`` and
    ``leaflet.css``, those of maps as ``maps/FILE``, and the workbench's own. InputError if the
    package was built without Leaflet.
    """
    allowed = f'nonce="{html.escape(nonce)}"'

    def script(match: re.Match[str]) -> str:
        name = match["name"]
        source = f"semsig/{name.removeprefix('maps/') if '/' in name else f'serve/{name}'}"
        return f"<script {allowed}>{_text(name)}\n//# sourceURL={source}\n</script>"

    page = _text("index.html")
    page = _STYLE.sub(lambda match: f"<style {allowed}>{_text(match['name'])}</style>", page)
    return _SCRIPT.sub(script, page)


def policy(nonce: str) -> str:
    """Return what the page may do: run its own scripts, and ask its own server."""
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src 'nonce-{nonce}'",
            f"style-src 'nonce-{nonce}'",
            "img-src 'self' data: blob:",
            "connect-src 'self'",
            "base-uri 'none'",
            "form-action 'none'",
            "frame-ancestors 'none'",
        )
    )


def _text(name: str) -> str:
    if name in ASSETS:
        return asset_text(name)
    folder, _, file = name.rpartition("/")
    package = "semsig_gis.maps" if folder == "maps" else "semsig_gis.serve"
    return resources.files(package).joinpath("js", file).read_text(encoding="utf-8")
