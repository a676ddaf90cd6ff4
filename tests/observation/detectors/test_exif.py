"""EXIF: focal length, heading and place of photographs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest
from PIL.ExifTags import GPS, Base
from sentences import refused
from workbench import picture

from semsig_gis.core import InputError
from semsig_gis.observation import read_exif

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def save(folder: Path, **groups: Any) -> Path:  # noqa: ANN401 - tags of any kind
    """Write a picture with EXIF tags of the groups ``image``, ``exif`` and ``gps``."""
    (folder / "a.jpg").write_bytes(picture(**groups))
    return folder / "a.jpg"


def test_exif_of_phone_has_camera_heading_and_position(tmp_path: Path) -> None:
    gps = {
        GPS.GPSLatitudeRef: "N",
        GPS.GPSLatitude: (43.0, 44.0, 6.0),
        GPS.GPSLongitudeRef: "W",
        GPS.GPSLongitude: (7.0, 30.0, 0.0),
        GPS.GPSImgDirectionRef: "M",
        GPS.GPSImgDirection: 123.5,
    }
    shot = read_exif(save(tmp_path, exif={Base.FocalLengthIn35mmFilm: 26}, gps=gps))
    assert shot.size == (400, 300)
    # 26 mm with a diagonal of 43.27 mm, which is 500 pixels.
    assert shot.focal == pytest.approx(26 / math.hypot(36, 24) * 500 / 400)
    assert (shot.heading, shot.north, shot.heading_error) == (123.5, "magnetic", 10.0)
    assert shot.position == pytest.approx((43.735, -7.5))
    # The size is that of the upright picture.
    assert read_exif(save(tmp_path, image={Base.Orientation: 6})).size == (300, 400)


UTC = {GPS.GPSDateStamp: "2026:05:31", GPS.GPSTimeStamp: (10.0, 5.0, 9.0)}
LOCAL = {Base.DateTimeOriginal: "2026:05:31 12:05:09"}


@pytest.mark.parametrize(
    ("exif", "gps", "time"),
    [
        (LOCAL, UTC, "2026-05-31T10:05:09+00:00"),
        (LOCAL | {Base.OffsetTimeOriginal: "+02:00"}, {}, "2026-05-31T12:05:09+02:00"),
        (LOCAL, {}, None),  # unknown time zone
        ({}, UTC | {GPS.GPSDateStamp: "never"}, None),
    ],
)
def test_time_of_picture(
    exif: Mapping[Any, Any], gps: Mapping[Any, Any], time: str | None, tmp_path: Path
) -> None:
    assert read_exif(save(tmp_path, exif=exif, gps=gps)).time == time


@pytest.mark.parametrize(
    ("unit", "resolution", "width"), [(3, 2000.0, 4000), (2, 5080.0, 4000), (3, 200.0, 400)]
)
def test_focal_length_from_pixels_of_sensor(
    unit: int, resolution: float, width: int, tmp_path: Path
) -> None:
    exif = {
        Base.FocalLength: 20.0,
        Base.FocalPlaneXResolution: resolution,
        Base.FocalPlaneResolutionUnit: unit,
        Base.ExifImageWidth: width,
    }
    # 20 mm with 200 pixels per millimetre and a width of 4,000 pixels; then a smaller copy.
    assert read_exif(save(tmp_path, exif=exif)).focal == pytest.approx(1.0)


@pytest.mark.parametrize(
    "groups",
    [
        {},
        {"exif": {Base.FocalLengthIn35mmFilm: 0}},
        {"exif": {Base.FocalLength: 4.0}},
        {"gps": {GPS.GPSImgDirection: 400.0, GPS.GPSLatitude: (1.0, 2.0, 3.0)}},
        {"gps": {GPS.GPSLatitude: 43.0, GPS.GPSLongitude: 7.0}},
    ],
)
def test_missing_or_invalid_tags_are_unknown(
    groups: dict[str, dict[Any, Any]], tmp_path: Path
) -> None:
    shot = read_exif(save(tmp_path, **groups))
    assert (shot.focal, shot.heading, shot.position) == (None, None, None)


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_text("no")
    for name in ("a.jpg", "absent.jpg"):
        with refused(InputError, name, "give a picture"):
            read_exif(tmp_path / name)
