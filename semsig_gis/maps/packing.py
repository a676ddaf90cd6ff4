"""Data in the script of a page: JSON made safe for it, and compressed arrays of numbers.

folium renders what it has rendered once more as a Jinja template, so that ``{{...}}`` in a class
title would be *run* when the map is made. Text from data therefore enters a page only through
`script_json`, and the script shows it as text nodes; legends are HTML-escaped as well.
"""

from __future__ import annotations

import base64
import json
import re
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np
from pyproj import Transformer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from pyproj import CRS

QUANTUM_M = 0.25  # of Web Mercator


def script_json(value: object) -> str:
    """Return a value as JSON that may stand in the script of a folium page.

    It is ASCII that no HTML parser takes for markup and no Jinja rendering changes. Numbers must be
    finite.
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    # Only a brace of text can be followed by one of these: JSON's own is by a quote or a "}".
    text = re.sub(r"\{(?=[{%#])", r"\\u007b", text)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def packed(values: NDArray[Any] | Sequence[str]) -> list[str]:
    """Return an array of u1, u2, i4 or f8, or a list of text, for `semsig.arrays`."""
    if not isinstance(values, np.ndarray):
        return ["json", _text(json.dumps(values).encode())]
    kind = values.dtype.newbyteorder("<")
    text = _text(np.ascontiguousarray(values, kind).tobytes())
    return [f"{kind.kind}{kind.itemsize}", text]


def steps(values: NDArray[np.int32]) -> list[str]:
    """Return numbers that change little from one to the next, for `semsig.arrays`."""
    change = np.diff(values.astype("<i4"), prepend=np.int32(0))
    return ["steps", _text(change.view(np.uint8).reshape(-1, 4).T.tobytes())]


def mercator(xy: NDArray[np.float64], crs: CRS) -> tuple[NDArray[np.int32], dict[str, Any]]:
    """Return places as whole numbers, shape (n, 2), and how the script gets them back."""
    to_mercator = Transformer.from_crs(crs, "EPSG:3857", always_xy=True)
    metres = np.stack(to_mercator.transform(xy[:, 0], xy[:, 1]), axis=1)
    origin = metres.min(axis=0)
    places = np.rint((metres - origin) / QUANTUM_M).astype(np.int32)
    return places, {"origin": origin.tolist(), "quantum": QUANTUM_M}


def _text(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content)).decode("ascii")
