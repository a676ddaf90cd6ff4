"""Read the EXIF of photographs: camera, heading, position and time."""

from __future__ import annotations

import contextlib
import datetime as dt
import io
import math
import struct
import warnings
from typing import TYPE_CHECKING, Any

from PIL import Image, ImageOps
from PIL.ExifTags import GPS, IFD, Base

from semsig_gis.core import FULL_TURN, InputError
from semsig_gis.observation.detectors.pictures import Shot

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

COMPASS_ERROR = 10.0
"""Standard deviation of the headings of phones, in degrees, usual in streets."""

FILM_MM = math.hypot(36.0, 24.0)
UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
BROWSER_FORMATS = ("JPEG", "PNG", "WEBP", "GIF")
HEIC_BRANDS = frozenset({b"heic", b"heix", b"hevc", b"heim", b"heis", b"mif1", b"msf1"})
THUMBNAIL = (256, 256)
UNREADABLE = (OSError, ValueError, SyntaxError, struct.error, Image.DecompressionBombError)
CLOCK_NUMBERS = 3  # hours, minutes and seconds
SIDEWAYS = frozenset({5, 6, 7, 8})  # orientations that exchange width and height


def read_exif(path: str | Path) -> Shot:
    """Read the EXIF of a picture; width and height are of the picture in its shown orientation.

    InputError if the file is not a picture.
    """
    with _opened(path) as image:
        return _shot_of(image)


def open_upright(path: str | Path) -> Image.Image:
    """Return the pixels of a picture in its shown orientation, in RGB.

    InputError if the file is not a picture.
    """
    with _opened(path) as image:
        return ImageOps.exif_transpose(image).convert("RGB")


@contextlib.contextmanager
def _opened(path: str | Path) -> Iterator[Image.Image]:
    """Open a picture; InputError if it is not valid, also while the block reads it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about sizes and damaged tags
            with Image.open(path) as image:
                yield image
    except UNREADABLE as error:
        reason = getattr(error, "strerror", None) or "it is not a picture"
        raise InputError(
            f"{path} cannot be read ({reason}); give a picture, or leave it out."
        ) from error


def picture_shot(content: bytes, name: str) -> Shot:
    """Return the result of `read_exif` for the content of a picture that a browser can show.

    The picture is decoded: InputError if it has another format, is damaged, or is too large for
    Pillow.
    """
    if content[4:8] == b"ftyp" and content[8:12] in HEIC_BRANDS:
        raise InputError(f"{name} is a HEIC picture, which is not supported; save it as JPEG.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(content), formats=BROWSER_FORMATS) as image:
                shot = _shot_of(image)
                image.draft(
                    "L", THUMBNAIL
                )  # decodes a JPEG faster; the whole content is still read
                image.load()
    except Image.DecompressionBombError as error:
        raise InputError(
            f"{name} has too many pixels to be decoded safely; give a smaller copy of it."
        ) from error
    except UNREADABLE as error:
        raise InputError(
            f"{name} cannot be read as a picture; give JPEG, PNG, WebP or GIF."
        ) from error
    return shot


def _shot_of(image: Image.Image) -> Shot:
    width, height = image.size
    exif = image.getexif()
    tags, gps = exif.get_ifd(IFD.Exif), exif.get_ifd(IFD.GPSInfo)
    sideways = exif.get(Base.Orientation) in SIDEWAYS
    heading = _number(gps.get(GPS.GPSImgDirection))
    return Shot(
        size=(height, width) if sideways else (width, height),
        focal=_focal(tags, width, height),
        heading=None if heading is None or heading > FULL_TURN else heading % FULL_TURN,
        heading_error=COMPASS_ERROR,
        north="magnetic" if _text(gps.get(GPS.GPSImgDirectionRef)) == "M" else "true",
        position=_position(gps),
        time=_time(tags, gps),
    )


def _focal(tags: Any, width: int, height: int) -> float | None:  # noqa: ANN401 - of any tags
    """Return the focal length divided by the length of the longer side.

    It is from the equivalent for 35 mm film, which nearly all cameras write, otherwise from the
    size of the sensor.
    """
    longer = max(width, height)
    film = _number(tags.get(Base.FocalLengthIn35mmFilm))
    if film:
        return film / FILM_MM * math.hypot(width, height) / longer
    length = _number(tags.get(Base.FocalLength))
    across = _number(tags.get(Base.FocalPlaneXResolution))
    unit = UNIT_MM.get(tags.get(Base.FocalPlaneResolutionUnit, 2))
    if not length or not across or not unit:
        return None
    # The picture may be a smaller copy of the pixels of the sensor.
    sides = [_number(tags.get(tag)) for tag in (Base.ExifImageWidth, Base.ExifImageHeight)]
    return length * across / unit / max(*(side or 0.0 for side in sides), longer)


def _position(gps: Any) -> tuple[float, float] | None:  # noqa: ANN401 - of any tags
    """Return latitude and longitude in degrees."""
    position = []
    pairs = (
        (GPS.GPSLatitude, GPS.GPSLatitudeRef, "S"),
        (GPS.GPSLongitude, GPS.GPSLongitudeRef, "W"),
    )
    for tag, side, below in pairs:
        parts = gps.get(tag)
        if not isinstance(parts, tuple) or not parts:
            return None
        numbers = [_number(part) for part in parts]
        if None in numbers:
            return None
        degrees = sum((part or 0.0) / 60**place for place, part in enumerate(numbers))
        position.append(-degrees if _text(gps.get(side)) == below else degrees)
    return position[0], position[1]


def _time(tags: Any, gps: Any) -> str | None:  # noqa: ANN401 - of any tags
    """Return the time of a picture from GPS, otherwise from a clock with a time zone."""
    parts = gps.get(GPS.GPSTimeStamp)
    numbers = [_number(part) for part in parts] if isinstance(parts, tuple) else []
    day, zone = _text(gps.get(GPS.GPSDateStamp)), "+00:00"
    clock = ":".join(f"{int(part or 0):02}" for part in numbers)
    if len(numbers) != CLOCK_NUMBERS or None in numbers or not day:
        day, _, clock = _text(tags.get(Base.DateTimeOriginal)).partition(" ")
        zone = _text(tags.get(Base.OffsetTimeOriginal))
    text = f"{day.replace(':', '-')}T{clock}{zone}"
    try:
        time = dt.datetime.fromisoformat(text)
    except ValueError:
        return None
    return time.isoformat() if time.tzinfo else None


def _number(value: Any) -> float | None:  # noqa: ANN401 - of any tag
    """Return a finite number from 0, or None."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and number >= 0 else None


def _text(value: Any) -> str:  # noqa: ANN401 - of any tag
    text = value.decode("ascii", "replace") if isinstance(value, bytes) else str(value or "")
    return text.strip("\0 ").upper()
