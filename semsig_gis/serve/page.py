"""The page of the workbench: all files in one, with a nonce that allows them to run."""

from __future__ import annotations

import html
import re
from importlib import resources

from semsig_gis.output import asset_text

_SCRIPT = re.compile(r'<script src="(?P<name>[^"]+)"></script>')
_STYLE = re.compile(r'<link rel="stylesheet" href="(?P<name>[^"]+)">')
LEAFLET_FILES = frozenset({"leaflet.js", "leaflet.css"})


def workbench_page(nonce: str) -> str:
    """Return the HTML page of the workbench with all scripts and style sheets included.

    These are the files that ``index.html`` links: ``leaflet.js`` and ``leaflet.css``, ``maps/FILE``
    of the maps, and the files of the workbench. `nonce` is that of the Content-Security-Policy.
    InputError if the package was built without Leaflet.
    """
    attribute = f'nonce="{html.escape(nonce)}"'

    def script(match: re.Match[str]) -> str:
        name = match["name"]
        source = f"semsig/{name.removeprefix('maps/') if '/' in name else f'serve/{name}'}"
        return f"<script {attribute}>{_text(name)}\n//# sourceURL={source}\n</script>"

    page = _text("index.html")
    page = _STYLE.sub(lambda match: f"<style {attribute}>{_text(match['name'])}</style>", page)
    return _SCRIPT.sub(script, page)


def security_policy(nonce: str) -> str:
    """Return the Content-Security-Policy: only its own scripts and requests to its server."""
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
    if name in LEAFLET_FILES:
        return asset_text(name)
    folder, _, file = name.rpartition("/")
    package = "semsig_gis.output.html" if folder == "maps" else "semsig_gis.serve"
    return resources.files(package).joinpath("js", file).read_text(encoding="utf-8")
