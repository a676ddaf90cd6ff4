"""Colours that maps, reports and exports share."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray


# Blue and orange of Okabe and Ito, which colour-blind people tell apart.
SUCCESSFUL, FAILED = "#0072b2", "#e69f00"

# Both ramps change their lightness steadily, so that the hue does not matter.
ERROR_RAMP = ("#fde0dd", "#fa9fb5", "#dd3497", "#7a0177")
CANDIDATE_RAMP = ("#31688e", "#35b779", "#fde725")  # of which none is lost in the dark

# Ten steps of viridis, whose lightness rises steadily.
FOUND_RAMP = (
    "#440154",
    "#482878",
    "#3e4989",
    "#31688e",
    "#26828e",
    "#1f9e89",
    "#35b779",
    "#6ece58",
    "#b5de2b",
    "#fde725",
)
"""Colour of a cell by tenths of the chance to be found."""


SHADES: Mapping[int, str] = MappingProxyType(
    {1: "#dfdfdb", 5: "#c8c8c2", 10: "#aeaea7", 20: "#8f8f88"}
)
"""Colour of a cell by the smallest number of objects that are seen from it."""


CELL_CHANCES: Mapping[float, str] = MappingProxyType(
    {1e-5: "#d9bdf2", 1e-4: "#bd8be8", 1e-3: "#9650d2", 1e-2: "#6a1cb0", 1e-1: "#35006b"}
)
"""Colour of a cell by the least chance that the place is in it, or near it."""


CHANCES: Mapping[float, str] = MappingProxyType({0.5: "#00441b", 0.9: "#41ab5d", 0.99: "#c7e9c0"})
"""Colour of the fewest cells that hold a share of the chance."""


VERDICTS: Mapping[str, str] = MappingProxyType(
    {"matched": "#009e73", "misnamed": "#cc79a7", "missed": "#ffffff", "false": "#d55e00"}
)
"""Colour of what became of an object."""


GROUP_COLOURS: Mapping[int, str] = MappingProxyType(
    {
        1: "#fde725",
        2: "#7ad151",
        10: "#22a884",
        100: "#2a788e",
        1_000: "#414487",
        10_000: "#440154",
    }
)
"""Colour of a cell by the smallest number of cells with its signature, itself among them."""


SAME_TYPES, SAME_LEVELS = "#ffffff", "#e69f00"
"""Colours of the cells with the same types, and with the same angle levels, too."""


DRIFT_COLOURS: Mapping[str, str] = MappingProxyType(
    {"same": "#b3b3ad", "changed": "#f0bf5c", "appeared": "#5aa5d6", "vanished": "#8a3f66"}
)
"""Colour of a cell by what became of it."""


OBJECT_COLOURS: Mapping[str, str] = MappingProxyType(
    {"added": "#0072b2", "removed": "#6d1a47", "moved": "#e69f00", "of another class": "#ffffff"}
)
"""Colour of an object by what became of it: that of the cells, but darker."""


def mixed(values: NDArray[np.float64], ramp: Sequence[str]) -> list[str]:
    """Return the colour of each value in [0, 1] on a ramp of evenly spaced colours."""
    anchors = np.array([list(bytes.fromhex(colour[1:])) for colour in ramp])
    stops = np.linspace(0.0, 1.0, len(ramp))
    parts = np.stack([np.interp(values, stops, part) for part in anchors.T], axis=1)
    return [f"#{bytes(row).hex()}" for row in np.rint(parts).astype(np.uint8)]
