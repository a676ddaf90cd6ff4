"""Read the EXIF and XMP of photographs: camera, heading, position and time."""

from __future__ import annotations

import contextlib
import datetime as dt
import io
import math
import re
import struct
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL import Image, ImageOps
from PIL.ExifTags import GPS, IFD, Base

from semsig_gis.core import FULL_TURN, InputError, extra
from semsig_gis.observation.detectors.camera import MOST_PIXELS
from semsig_gis.observation.detectors.pictures import Shot, same_shape

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import BinaryIO

    from semsig_gis.observation.detectors.camera import Projection

COMPASS_ERROR = 10.0
"""Standard deviation of the headings of phones, in degrees, usual in streets."""
TRAVEL_ERROR = 20.0
"""Standard deviation of a camera's direction from that of its travel, as on a windscreen."""

FILM_MM = math.hypot(36.0, 24.0)
UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
BROWSER_FORMATS = ("JPEG", "PNG", "WEBP", "AVIF", "GIF")
# Brands in the first box of a file; those of any codec are followed by others.
HEIC_BRANDS = frozenset({b"heic", b"heix", b"hevc", b"hevx", b"heim", b"heis", b"hevm", b"hevs"})
ANY_CODEC_BRANDS = frozenset({b"mif1", b"msf1"})
HEADER_BYTES = 64
THUMBNAIL = (256, 256)
UNREADABLE = (
    *(OSError, ValueError, SyntaxError, EOFError, RuntimeError),
    *(struct.error, Image.DecompressionBombError),
)
CLOCK_NUMBERS = 3  # hours, minutes and seconds
SIDEWAYS = frozenset({5, 6, 7, 8})  # orientations that exchange width and height
TURNS = {6: 90, 8: 270}  # degrees clockwise of orientations that are not mirrored
# The focal length of a picture that is longer is that of the parts it was joined from.
LONGEST_SIDES = 2.5

# The data of panoramas that Google defined, as attributes or elements of XMP.
_GPANO = re.compile(r"GPano:(\w+)(?:\s*=\s*[\"']([^\"']*)[\"']|>([^<]*)<)")
PANORAMAS: dict[str, Projection] = {
    "equirectangular": "equirectangular",
    "cylindrical": "cylindrical",
}


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
    reason = "it is not a picture"
    try:
        with warnings.catch_warnings(), Path(path).open("rb") as file:
            warnings.simplefilter("ignore")  # about sizes and damaged tags
            if _is_heic(file):
                _read_heic(path)
                reason = "it is a damaged HEIC picture"
            with Image.open(file) as image:
                yield image
    except InputError:
        raise
    except UNREADABLE as error:
        reason = getattr(error, "strerror", None) or reason
        raise InputError(
            f"{path} cannot be read ({reason}); give a picture, leave it out, or give what it "
            "would say: --fov, --heading and --size."
        ) from error


def _is_heic(file: BinaryIO) -> bool:
    """Return whether a file is a picture in the format of iPhones, which Pillow cannot read."""
    header = file.read(HEADER_BYTES)
    file.seek(0)
    if header[4:8] != b"ftyp":
        return False
    size = min(int.from_bytes(header[:4]), HEADER_BYTES)
    others = {header[place : place + 4] for place in range(16, size, 4)}
    brand = header[8:12]
    return brand in HEIC_BRANDS or (brand in ANY_CODEC_BRANDS and b"avif" not in others)


def _read_heic(path: str | Path) -> None:
    """Let Pillow read HEIC; InputError if the extra for it is not installed."""
    try:
        with extra("heic", f"the HEIC picture {path}"):
            from pillow_heif import register_heif_opener  # noqa: PLC0415 - is an optional extra
    except InputError as error:
        raise InputError(
            f"{str(error).removesuffix('.')}, save the picture as JPEG, or give what it "
            "would say: --fov, --heading and --size."
        ) from error
    register_heif_opener()


def picture_shot(content: bytes, name: str) -> Shot:
    """Return the result of `read_exif` for the content of a picture that a browser can show.

    The picture is decoded: InputError if it has another format, is damaged, or is too large for
    Pillow.
    """
    if _is_heic(io.BytesIO(content)):
        raise InputError(
            f"{name} is a HEIC picture, which most browsers do not show; save it as JPEG."
        )
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
            f"{name} cannot be read as a picture; give JPEG, PNG, WebP, AVIF or GIF."
        ) from error
    return shot


def _shot_of(image: Image.Image) -> Shot:
    width, height = image.size
    exif = image.getexif()
    tags, gps = exif.get_ifd(IFD.Exif), exif.get_ifd(IFD.GPSInfo)
    # The size of a TIFF is that of the upright picture already.
    orientation = exif.get(Base.Orientation)
    sideways = orientation in SIDEWAYS and image.format != "TIFF"
    panorama = _panorama(image)
    heading, north = _direction(gps, GPS.GPSImgDirection, GPS.GPSImgDirectionRef)
    travels = heading is None and _number(gps.get(GPS.GPSSpeed)) != 0  # otherwise at rest
    if travels:
        heading, north = _direction(gps, GPS.GPSTrack, GPS.GPSTrackRef)
    camera = Shot(
        size=(height, width) if sideways else (width, height),
        focal=None if panorama is None else _focal(tags, width, height),
        heading=heading,
        heading_error=TRAVEL_ERROR if travels else COMPASS_ERROR,
        north=north,
        travels=travels,
        position=_position(gps),
        time=_time(tags, gps),
        turn=TURNS.get(orientation or 0) if sideways else None,
    )
    return camera if panorama is None else panorama.filled(camera)


def _direction(gps: Any, tag: GPS, reference: GPS) -> tuple[float | None, str]:  # noqa: ANN401 - of any tags
    """Return a direction in degrees, None if it is unknown, and the name of its north."""
    degrees = _number(gps.get(tag))
    north = "magnetic" if _text(gps.get(reference)) == "M" else "true"
    return None if degrees is None or degrees > FULL_TURN else degrees % FULL_TURN, north


def _panorama(image: Image.Image) -> Shot | None:
    """Return what Google's XMP of a panorama says; its heading is that of the middle column.

    The heading in the XMP is that of the middle of the full panorama, and the picture may be a part
    of it. None if it is about another part than the picture, as after edits.
    """
    # In Pillow 11, that of PNG and TIFF has other places.
    tags = image.getexif()
    xmp = image.info.get("xmp") or image.info.get("XML:com.adobe.xmp") or tags.get(Base.XMLPacket)
    text = xmp.decode("utf-8", "replace") if isinstance(xmp, bytes) else str(xmp or "")
    values = {name: (first or second).strip() for name, first, second in _GPANO.findall(text)}
    numbers = {
        name: number
        for name, value in values.items()
        if (number := _number(value, least=-MOST_PIXELS)) is not None and number <= MOST_PIXELS
    }
    full = numbers.get("FullPanoWidthPixels", 0.0)
    width = numbers.get("CroppedAreaImageWidthPixels", full)
    # The full panorama is twice as wide as high.
    usual = full / 2.0 if width == full else width * image.height / image.width
    height = numbers.get("CroppedAreaImageHeightPixels", usual)
    has_sizes = min(full, width, height) >= 1
    kind = values.get("ProjectionType", "equirectangular" if has_sizes else "").lower()
    camera = PANORAMAS.get(kind)
    fov, turn, horizon = FULL_TURN, 0.0, None
    if camera and has_sizes:
        if not same_shape((width, height), image.size):
            return None
        fov = min(width / full, 1.0) * FULL_TURN
        left = numbers.get("CroppedAreaLeftPixels", (full - width) / 2.0)
        turn = ((left + width / 2.0) / full - 0.5) * FULL_TURN
        # The rows of a cylinder are counted from the horizon, those of a sphere from its top.
        middle = full / 4.0 if kind == "equirectangular" else 0.0
        if "CroppedAreaTopPixels" in numbers:
            horizon = (middle - numbers["CroppedAreaTopPixels"]) / height
    shot = Shot(camera=camera, fov=fov if camera else None, horizon=horizon)
    if abs(heading := numbers.get("PoseHeadingDegrees", math.inf)) > FULL_TURN:
        return shot
    heading = (heading + turn) % FULL_TURN
    return replace(shot, heading=heading, heading_error=COMPASS_ERROR, north="true")


def _focal(tags: Any, width: int, height: int) -> float | None:  # noqa: ANN401 - of any tags
    """Return the focal length divided by the length of the longer side.

    It is from the equivalent for 35 mm film, which nearly all cameras write, otherwise from the
    size of the sensor; None for a picture that is joined from several.
    """
    longer = max(width, height)
    if longer > LONGEST_SIDES * min(width, height):
        return None
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
    """Return latitude and longitude in degrees, None if they are unknown or out of range."""
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
    latitude, longitude = position
    in_range = abs(latitude) <= FULL_TURN / 4 and abs(longitude) <= FULL_TURN / 2
    return (latitude, longitude) if in_range else None


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


def _number(value: Any, *, least: float = 0.0) -> float | None:  # noqa: ANN401 - of any tag
    """Return a finite number from `least`, or None."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and number >= least else None


def _text(value: Any) -> str:  # noqa: ANN401 - of any tag
    text = value.decode("ascii", "replace") if isinstance(value, bytes) else str(value or "")
    return text.strip("\0 ").upper()
