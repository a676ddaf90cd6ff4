"""Pictograms of classes: small drawings that people recognize on maps and in legends."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

# SVG path data in a box of 16 x 16, to be filled with the rule "nonzero": outlines run clockwise,
# holes counterclockwise.
GENERAL_PICTOGRAM = (
    "M8 1a5 5 0 0 1 5 5c0 3.5-3 5.5-5 9-2-3.5-5-5.5-5-9a5 5 0 0 1 5-5z"
    "M8 4a2 2 0 1 0 0 4 2 2 0 1 0 0-4z"
)
"""Pictogram of a class that has none of its own: a pin."""

PICTOGRAMS: Mapping[str, str] = MappingProxyType(
    {
        "alignment_tree": (
            "M7 15v-4A3.6 3.6 0 0 1 3 6.7 3 3 0 0 1 4.6 3.5 3.6 3.6 0 0 1 11.4 3.5 "
            "3 3 0 0 1 13 6.7 3.6 3.6 0 0 1 9 11v4z"
        ),
        "water_fountain": (
            "M8 1c2 2.8 3 4.2 3 5.8a3 3 0 0 1-6 0c0-1.6 1-3 3-5.8zM2 11h12l-1.5 2H9v2H7v-2H3.5z"
        ),
        "street_light": (
            "M3 15V5a4 4 0 0 1 4-4h5.5v2H7a2 2 0 0 0-2 2v10zM8.8 4h6.4a3.2 3.2 0 0 1-6.4 0z"
        ),
        "indicator": "M2 1h12v9.5H9V15H7v-4.5H2zM7.1 2.3v1.6h1.8V2.3zM7.1 4.8v4.4h1.8V4.8z",
        "traffic_light": (
            "M4.5 1h7v12H9v2H7v-2H4.5zM8 2a1.4 1.4 0 1 0 0 2.8A1.4 1.4 0 1 0 8 2z"
            "M8 5.6a1.4 1.4 0 1 0 0 2.8 1.4 1.4 0 1 0 0-2.8z"
            "M8 9.2a1.4 1.4 0 1 0 0 2.8 1.4 1.4 0 1 0 0-2.8z"
        ),
        "bike_station": (
            "M3.8 7.2a3.5 3.5 0 1 1 0 7 3.5 3.5 0 1 1 0-7zM3.8 8.7a2 2 0 1 0 0 4 2 2 0 1 0 0-4z"
            "M12.2 7.2a3.5 3.5 0 1 1 0 7 3.5 3.5 0 1 1 0-7z"
            "M12.2 8.7a2 2 0 1 0 0 4 2 2 0 1 0 0-4z"
            "M4.5 2.8h3v1.4h-.7l.4 1.2h2.9L9.5 3.3V2H12v1.4h-1l1.9 7.1-1.3.4-1-3.7-2.2 4H4.1l-.9-1"
            " 2.5-4-.6-1.6V4.2h-.6zM6.2 8.2 5.3 9.8h1.5zM7.7 6.8l.6 2 1.2-2z"
        ),
        "automatic_wc": (
            "M4.5 1a1.5 1.5 0 1 1 0 3 1.5 1.5 0 1 1 0-3zM2.4 4.7h4.2v5.6h-.8V15H3.2v-4.7h-.8z"
            "M11.5 1a1.5 1.5 0 1 1 0 3 1.5 1.5 0 1 1 0-3zM10.2 4.7h2.6l2 6.3h-2v4h-2.6v-4h-2z"
        ),
        "car_station": (
            "M1 8.6 2.8 8l1.8-3.8H10L13 7.8l2.2.9V12h-1.4a2.1 2.1 0 0 1-4.2 0H6.4a2.1 2.1 0 0 1"
            "-4.2 0H1zM5.5 5.7 4.4 7.9h2.5V5.7zM8.1 5.7v2.2H11L9.3 5.7z"
        ),
        "taxi_station": (
            "M5.5 1.5h5v2h-5zM3.6 4.5h8.8l1.8 4.2v5.8h-2.6V13H4.4v1.5H1.8V8.7z"
            "M4.8 6 3.8 8.5h8.4L11.2 6zM3.4 10v1.4h2V10zM10.6 10v1.4h2V10z"
        ),
        "bench": "M2 2.5h12v2H2zM2 5.7h12v2H2zM1 9h14v2h-1.4v3.5h-2V11H4.4v3.5h-2V11H1z",
        "bus_stop": (
            "M3.4 1.5h9.2A1.9 1.9 0 0 1 14.5 3.4v9.4H13v2h-2.4v-2H5.4v2H3v-2H1.5V3.4"
            "A1.9 1.9 0 0 1 3.4 1.5zM3.2 3.8v4.4h9.6V3.8zM3.2 9.7v1.5h2V9.7zM10.8 9.7v1.5h2V9.7z"
        ),
        "pedestrian_crossing": (
            "M2.8 2.5h1.8L3.2 13.5H.6zM6 2.5h1.5l-.2 11H4.8zM8.5 2.5H10l1.2 11H8.7z"
            "M11.4 2.5h1.8l2.2 11h-2.6z"
        ),
        "parking_meter": (
            "M8 1a4.2 4.2 0 0 1 4.2 4.2V10.5H9V15H7v-4.5H3.8V5.2A4.2 4.2 0 0 1 8 1z"
            "M5.6 4.2v2.2h4.8V4.2zM7.2 7.6v1.7h1.6V7.6z"
        ),
        "reserved_bay": "M1.5 2h1.8v10.7h9.4V2h1.8v12.5h-13zM5.3 4h5.4v6H5.3zM7.5 4v2.4h1V4z",
        "disabled_bay": (
            "M6.6.8a1.6 1.6 0 1 1 0 3.2 1.6 1.6 0 1 1 0-3.2zM5.8 4.6h2v1.5h3v1.6h-3v1.6h3.8l1.7 4"
            " 1.3-.3.3 1.5-2.6.7-2-4.2H5.8z"
            "M4.7 7v1.8a3 3 0 1 0 4.6 3.4h1.6A4.5 4.5 0 1 1 4.7 7z"
        ),
        "car_park": (
            "M3 1h10a2 2 0 0 1 2 2v10a2 2 0 0 1-2 2H3a2 2 0 0 1-2-2V3a2 2 0 0 1 2-2z"
            "M5 3v10h2.2V9.6h1.5a3.3 3.3 0 0 0 0-6.6zM7.2 4.9h1.3a1.4 1.4 0 0 1 0 2.8H7.2z"
        ),
        "camera": (
            "M1.2 4.2 11 1.6l1.3 4.8-9.8 2.6zM12.4 3l1.9-.5.8 2.8-1.9.5z"
            "M1 10h1.9v1.4H6l.8-2.1 2-.5-1.6 4.4H2.9V15H1z"
        ),
        "notice_board": (
            "M1.5 2h13v8.5H13V15h-2v-4.5H5V15H3v-4.5H1.5zM3.4 3.8v1.3h9.2V3.8zM3.4 6.8v1.3h5.8V6.8z"
        ),
        "fire_hydrant": (
            "M8 .8A3.2 3.2 0 0 1 11.2 4h1v1.8h-1.2V7H13v3.5h-2V13h1.2v2H3.8v-2H5v-2.5H3V7h2V5.8"
            "H3.8V4h1A3.2 3.2 0 0 1 8 .8zM8 7.2a1.6 1.6 0 1 0 0 3.2 1.6 1.6 0 1 0 0-3.2z"
        ),
        "post_box": "M1.6 3h12.8L8 8.4zM1 4.6l7 5.8 7-5.8V13H1z",
        "waste_basket": (
            "M2 3h4V1.2h4V3h4v2H2zM3 6h10l-1 9H4zM5.6 7.6l.5 5.8h1.1l-.4-5.8z"
            "M9.2 7.6l-.4 5.8h1.1l.5-5.8z"
        ),
        "bollard": "M5.2 3.8a2.8 2.8 0 0 1 5.6 0v1.4H5.2zM5.2 6.6h5.6V13h1.4v2H3.8v-2h1.4z",
        "advertising_column": (
            "M8 .8c.6.8 4.2.8 5 4v.8H3v-.8c.8-3.2 4.4-3.2 5-4zM4 6.6h8V13H4z"
            "M5.6 8v3.6h4.8V8zM3 13.6h10V15H3z"
        ),
        "monument": "M8 .8l1.6 2.2 1 7.8H5.4l1-7.8zM4 11.6h8v1.4H4zM2.5 13.8h11v1.5h-11z",
        "telephone": (
            "M4 1l2.4 4-1.7 1.8c.9 2 2.5 3.6 4.5 4.5L11 9.6l4 2.4-1.4 2.9C7.5 15.4.6 8.5 1.1 2.4z"
        ),
        "vending_machine": (
            "M3 1h10v14H3zM4.4 2.4v7.2h4.8V2.4zM4.4 5.4h4.8v1.2H4.4zM10.4 2.4v1.4h1.4V2.4z"
            "M10.4 5v1.4h1.4V5zM4.9 11.2v2.2h4.3v-2.2z"
        ),
        "clock": (
            "M8 1a7 7 0 1 1 0 14A7 7 0 1 1 8 1zM8 2.7a5.3 5.3 0 1 0 0 10.6A5.3 5.3 0 1 0 8 2.7z"
            "M7.2 4h1.6v3.6l2.7 1.6-.8 1.4-3.5-2.1z"
        ),
        "flagpole": "M2.6 1h1.8v14H2.6zM5.2 2c2.4-1.2 4.4 1.4 8.6 0v6.4c-4.2 1.4-6.2-1.2-8.6 0z",
        "street_cabinet": (
            "M2 2h12v11.2h-1V15h-2v-1.8H5V15H3v-1.8H2zM7.5 3.4v8.4h1V3.4zM3.5 4v1h2.8V4z"
            "M3.5 6v1h2.8V6zM9.7 4v1h2.8V4zM9.7 6v1h2.8V6z"
        ),
    }
)
"""Pictogram of each class by its name."""
