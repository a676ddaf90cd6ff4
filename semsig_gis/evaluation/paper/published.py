"""Figures of Paris in the source paper, for comparison with our figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

# The paper's Tables 1, 2a and 2b.
OCCURRENCES: Mapping[str, int] = {
    "alignment_tree": 1_752_696,
    "water_fountain": 6_713,
    "street_light": 2_299_639,
    "indicator": 36_333,
    "traffic_light": 102_240,
    "bike_station": 14_397,
    "automatic_wc": 8_006,
    "car_station": 4_421,
    "taxi_station": 2_537,
    "bench": 135_748,
    "bus_stop": 32_320,
}
# Its names of the classes.
TITLES: Mapping[str, str] = {
    "alignment_tree": "Alignment tree",
    "water_fountain": "Water fountain",
    "street_light": "Street light",
    "indicator": "Indicator",
    "traffic_light": "Traffic light",
    "bike_station": "Bike station",
    "automatic_wc": "Automatic WC",
    "car_station": "Car station",
    "taxi_station": "Taxi station",
    "bench": "Public bench",
    "bus_stop": "Bus stop",
}
DATABASE: Mapping[str, float] = {
    "radius_m": 30.0,
    "signatures": 312_134,
    "mean_length": 14.0,
    "covered_km2": 79.0,
    "file_mb": 38.7,
}
GROUPS: Mapping[str, tuple[str, str]] = {
    "count": ("140,296", "204,891"),
    "mean": ("2.2", "1.5"),
    "std": ("121.5", "11.1"),
    "min": ("1", "1"),
    "25%": ("1", "1"),
    "50%": ("1", "1"),
    "75%": ("1", "1"),
    "max": ("29,958", "1,240"),
    # Of its 10,000 queries. It must be by type: at least 75 % of the 204,891 angle groups have one
    # cell, which is 49 % of the cells or more.
    "unique": ("41.8 %", ""),
    "entropy_bits": ("", ""),
}
# P(error <= 50 m) and recall at 10 % of its two-stage edit+edit at 5 %, medium distortion, t = 1,
# by visibility range and angle levels.
ACCURACY: Mapping[tuple[float, int], tuple[float, float | None]] = {
    (20.0, 16): (0.1793, 0.5110),
    (30.0, 16): (0.3733, 0.6462),
    (40.0, 16): (0.4946, 0.7269),
    (30.0, 8): (0.3243, None),
    (30.0, 24): (0.3861, None),
    (30.0, 32): (0.3766, None),
}
# Share of its 10,000 queries with types that no other cell has.
UNAMBIGUOUS = 0.418
# Values that its text reads off its plots, with unknown precision. For single measures and fusions:
# the best of 100 candidates; for light and strong distortion: the first candidate of edit+edit:5%.
READ_OFF: Mapping[str, float] = {
    "single_none_p10": 0.90,  # more than
    "single_none_p0": 0.92,
    "single_medium_p0": 0.50,
    "single_medium_recall20": 0.80,
    "fusion_none_p0": 0.93,  # more than
    "light_small_error": 0.70,
    "strong_small_error": 0.25,
    "light_recall": 0.90,  # more than
    "strong_recall": 0.50,
}
# Its distortion: number of errors of each level, and bearing noise in degrees.
ERRORS: Mapping[str, int] = {"light": 1, "medium": 7, "strong": 13}
BEARING_SIGMA, BEARING_CLIP = 5.0, 30.0
# Milliseconds of one query of length 14 over its 312,134 cells, by method.
QUERY_MS: Mapping[str, float] = {
    "types:jaccard": 82.0,
    "angles:jaccard": 496.0,
    "jaccard+jaccard:5%": 107.0,
    "types:histogram": 173.0,
    "angles:histogram": 538.0,
    "histogram+histogram:5%": 200.0,
    "types:edit": 277.0,
    "angles:edit": 1850.0,
    "edit+edit:5%": 370.0,
}
COLUMN = "Paris (paper)"
STEP_M = 10.0
