"""EXIF: focal length, heading and place of photographs."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

import pillow_heif
import pytest
from PIL.ExifTags import GPS, Base
from sentences import refused
from workbench import picture

from semsig_gis.core import InputError
from semsig_gis.observation import read_exif
from semsig_gis.observation.detectors.exif import open_upright

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def save(folder: Path, **groups: Any) -> Path:  # noqa: ANN401 - of any kind
    """Write a picture with EXIF tags of the groups ``image``, ``exif`` and ``gps``, or XMP."""
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
        {"gps": {GPS.GPSLatitude: (91.0, 0.0, 0.0), GPS.GPSLongitude: (7.0, 0.0, 0.0)}},
        {"gps": {GPS.GPSLatitude: (1e6, 0.0, 0.0), GPS.GPSLongitude: (1e9, 0.0, 0.0)}},
    ],
)
def test_missing_or_invalid_tags_are_unknown(
    groups: dict[str, dict[Any, Any]], tmp_path: Path
) -> None:
    shot = read_exif(save(tmp_path, **groups))
    assert (shot.focal, shot.heading, shot.position) == (None, None, None)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP", "AVIF", "TIFF", "MPO", "HEIF"])
@pytest.mark.parametrize("orientation", [1, 6])
def test_every_kind_of_picture_has_its_tags_and_its_upright_size(
    kind: str, orientation: int, tmp_path: Path
) -> None:
    pillow_heif.register_heif_opener()  # also for writing
    file = save(
        tmp_path,
        kind=kind,
        image={Base.Orientation: orientation},
        exif={Base.FocalLengthIn35mmFilm: 26},
        gps={GPS.GPSImgDirection: 123.5},
    )
    shot = read_exif(file)
    assert shot.focal == pytest.approx(26 / math.hypot(36, 24) * 1.25)
    assert shot.heading == 123.5
    assert shot.size == open_upright(file).size


@pytest.mark.parametrize(
    ("gps", "expected"),
    [
        ({GPS.GPSTrack: 200.0}, (200.0, 20.0, "true", True)),
        (
            {GPS.GPSTrack: 200.0, GPS.GPSTrackRef: "M", GPS.GPSSpeed: 9.5},
            (200, 20, "magnetic", True),
        ),
        ({GPS.GPSTrack: 200.0, GPS.GPSImgDirection: 90.0}, (90.0, 10.0, "true", False)),
        ({GPS.GPSTrack: 200.0, GPS.GPSSpeed: 0.0}, (None,)),
        ({GPS.GPSTrack: 400.0}, (None,)),
    ],
)
def test_direction_of_travel_is_a_heading_where_there_is_no_other(
    gps: Mapping[Any, Any], expected: tuple[object, ...], tmp_path: Path
) -> None:
    shot = read_exif(save(tmp_path, gps=gps))
    direction = (shot.heading, shot.heading_error, shot.north, shot.travels)
    assert direction[: len(expected)] == expected


SPHERE = {"ProjectionType": "equirectangular", "PoseHeadingDegrees": "90.0"}
FULL = {"FullPanoWidthPixels": 4000, "FullPanoHeightPixels": 2000}
PLAIN = ("equirectangular", 90, 90, None)
PART = {"CroppedAreaImageWidthPixels": 1000, "CroppedAreaImageHeightPixels": 750}


@pytest.mark.parametrize(
    ("xmp", "size", "expected"),
    [
        (SPHERE, (400, 200), ("equirectangular", 360, 90, None)),
        (SPHERE | FULL, (400, 200), ("equirectangular", 360, 90, None)),
        # A quarter of the turn that ends at the middle of the full panorama.
        (
            SPHERE | FULL | PART | {"CroppedAreaLeftPixels": 1000, "CroppedAreaTopPixels": 700},
            (400, 300),
            ("equirectangular", 90, 45, 0.4),
        ),
        (SPHERE | FULL | PART, (400, 300), ("equirectangular", 90, 90, None)),
        (
            SPHERE | FULL | PART | {"ProjectionType": "cylindrical", "CroppedAreaTopPixels": -300},
            (400, 300),
            ("cylindrical", 90, 90, 0.4),
        ),
        (
            SPHERE | {"FullPanoWidthPixels": 4000, "CroppedAreaImageWidthPixels": 1000},
            (400, 300),
            PLAIN,
        ),
        # Of a part that was cut or turned later.
        (SPHERE | FULL | PART, (300, 400), (None, None, None, None)),
        # The long photograph of a phone, with an unknown projection.
        ({"PoseHeadingDegrees": 300}, (1600, 400), (None, None, 300, None)),
        (SPHERE | FULL | PART | {"CroppedAreaTopPixels": "1e300"}, (400, 300), PLAIN),
        (SPHERE | FULL | PART | {"FullPanoWidthPixels": "1e-300"}, (400, 300), PLAIN[:1]),
        ({"ProjectionType": "cubemap"}, (400, 300), (None, None, None, None)),
        (
            SPHERE | {"PoseHeadingDegrees": "north"},
            (400, 200),
            ("equirectangular", 360, None, None),
        ),
    ],
)
def test_xmp_of_panorama(
    xmp: Mapping[str, object], size: tuple[int, int], expected: tuple[object, ...], tmp_path: Path
) -> None:
    exif = {Base.FocalLengthIn35mmFilm: 26}
    shot = read_exif(save(tmp_path, size=size, xmp=xmp, exif=exif))
    assert (shot.camera, shot.fov, shot.heading, shot.horizon)[: len(expected)] == expected
    # Only of a photograph as it was taken does the focal length say anything.
    assert (shot.focal is None) == ("cubemap" not in xmp.values())


HEIC = b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(100)


def test_heic_needs_its_extra_and_damaged_heic_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.heic").write_bytes(HEIC)
    with refused(InputError, "damaged HEIC"):
        read_exif(tmp_path / "a.heic")
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    with refused(InputError, "HEIC", "pip install 'semsig_gis[heic]'", "JPEG", "--fov"):
        read_exif(tmp_path / "a.heic")


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_text("no")
    for name in ("a.jpg", "absent.jpg"):
        with refused(InputError, name, "give a picture"):
            read_exif(tmp_path / name)
