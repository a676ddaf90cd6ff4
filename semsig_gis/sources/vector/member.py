"""Members of a vector file: the file itself, or the vector files in an archive."""

from __future__ import annotations

import contextlib
import sqlite3
import struct
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, TYPE_CHECKING

from semsig_gis.core import SourceError
from semsig_gis.sources.compression import decompression_bomb_error, ratio_too_high
from semsig_gis.sources.paths import require_file

if TYPE_CHECKING:
    from pyproj import CRS

CSV = "CSV"
GEOJSON = "GeoJSON"
SHAPEFILE = "ESRI Shapefile"
CONTAINER = "GPKG"  # the only driver with several layers in a file
# The only drivers that may open a file: GDAL has about 80, and some of them follow links.
DRIVERS: dict[str, str] = {
    ".csv": CSV,
    ".fgb": "FlatGeobuf",
    ".geojson": GEOJSON,
    ".gpkg": CONTAINER,
    ".json": GEOJSON,
    ".shp": SHAPEFILE,
}
# Messages of both readers.
NOT_UTF8 = "some text is not UTF-8 and was read as missing"
OUT_OF_REACH = "out of reach behind unreadable rows"
# First bytes of a file by driver, of GeoJSON after white space.
FIRST_BYTES = {
    "FlatGeobuf": b"fgb",
    GEOJSON: b"{",
    CONTAINER: b"SQLite format 3\0",
    SHAPEFILE: b"\x00\x00\x27\x0a",
}
# GDAL's geometry type of a layer with several types.
UNKNOWN = "Unknown"
# In an archive with other data, these files contain a legend or metadata.
SIDE_SUFFIXES = frozenset({".csv", ".json"})


@dataclass(frozen=True, slots=True)
class Member:
    """A layer of a file, or of the file `inner` of an archive; `layer` None is the first one."""

    file: Path
    inner: str | None
    layer: str | None = None

    @property
    def driver(self) -> str:
        """GDAL's name of the one driver that may open it."""
        return DRIVERS[Path(self.inner or self.file).suffix.lower()]

    @property
    def address(self) -> str:
        """Path that GDAL opens."""
        if self.inner is None:
            file = str(self.file)
            # pyogrio takes the part before a '!' for an archive, and a ';' for the end of the name,
            # except in GDAL's own forms.
            escaped = file.replace("%", "%25").replace("&", "%26")
            return f"/vsicached?file={escaped}" if {"!", ";"} & {*file} else file
        # GDAL's own form, because zip:// is parsed as a URL and cut at a '#' or a '?'.
        return f"/vsizip/{{{self.file.resolve().as_posix()}}}/{self.inner}"

    def __str__(self) -> str:
        """Return the name for messages."""
        return str(self.file) if self.inner is None else f"{self.inner} in {self.file}"

    def open(self) -> IO[bytes]:
        """Return a stream of the bytes of the file."""
        if self.inner is None:
            return self.file.open("rb")
        with zipfile.ZipFile(self.file) as archive:
            return archive.open(self.inner)

    def sibling(self, suffix: str) -> Member:
        """Return the file of the same name with another suffix."""
        if self.inner is None:
            return Member(self.file.with_suffix(suffix), None)
        return Member(self.file, str(PurePosixPath(self.inner).with_suffix(suffix)))

    def require_sound(self) -> None:
        """Raise SourceError if the content does not match the suffix, or is damaged."""
        try:
            with self.open() as stream:
                start = stream.read(4096)
        except OSError as error:
            raise unreadable(self, error) from error
        if self.driver == GEOJSON:
            start = start.removeprefix(b"\xef\xbb\xbf").lstrip()
        if not start.startswith(FIRST_BYTES[self.driver]):
            raise not_of_its_kind(self)
        if self.driver != CONTAINER or self.inner is not None:
            return
        # With the messages of GDAL, the readers of a damaged GeoPackage would crash.
        address = f"{self.file.resolve().as_uri()}?mode=ro"
        try:
            with contextlib.closing(sqlite3.connect(address, uri=True)) as connection:
                verdict = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
        except UnicodeDecodeError:
            verdict = "a name in it is not UTF-8 text"
        except sqlite3.Error as error:
            verdict = str(error)
        if verdict != "ok":
            raise SourceError(
                f"{self.file} cannot be read ({' '.join(verdict.split())}); it may be damaged, so "
                "download it again."
            )


@dataclass(frozen=True, slots=True)
class LayerDescription:
    """Description of a layer: geometry type, fields, CRS, number of rows and bounds.

    The `crs` is None if the file states none that is known; that of GeoJSON may be `implicit`.
    `bounds` are west, south, east, north in the unit of the CRS. Of GeoJSON, `empty` are the
    numbers of the rows without coordinates; geometry type and bounds may be unknown.
    """

    geometry: str
    fields: tuple[str, ...]
    crs: CRS | None
    rows: int
    bounds: tuple[float, ...] | None = None
    implicit: bool = False
    empty: frozenset[int] = frozenset()


def not_of_its_kind(what: object) -> SourceError:
    """Return the error for a file with content that does not match its suffix."""
    return SourceError(f"{what} is not the kind of file that its name says; download it again.")


def unreadable(what: object, error: BaseException) -> SourceError:
    """Return the error for an exception that a library raised when it opened a file."""
    if isinstance(error, UnicodeDecodeError):
        return SourceError(f"{what} is not UTF-8 text; save it as UTF-8.")
    cause = " ".join(str(error.__cause__ or error).split()).rpartition(" failed: ")[2].rstrip(".")
    if "not recognized" in cause:
        return not_of_its_kind(what)
    return SourceError(f"{what} cannot be read ({cause}); it may be damaged, so download it again.")


# Exceptions of zipfile for damaged archives.
_ZIP_FAULTS = (
    *(EOFError, IndexError, NotImplementedError, OSError, RuntimeError, ValueError),
    *(struct.error, zipfile.BadZipFile, zlib.error),
)


def members(path: Path) -> tuple[Member, ...]:
    """Return the members of a file: the file itself, or the vector files in an archive."""
    suffix = path.suffix.lower()
    require_file(path, "a vector file")
    suffixes = {*DRIVERS, ".zip"}
    if suffix not in suffixes:
        raise SourceError(
            f"{path} is not a vector file; give one of {', '.join(sorted(suffixes))}."
        )
    if suffix != ".zip":
        return (Member(path, None),)
    try:
        with zipfile.ZipFile(path) as archive:
            items = [item for item in archive.infolist() if not item.is_dir()]
            for item in items:
                if ratio_too_high(item.compress_size, item.file_size):
                    raise decompression_bomb_error(f"{item.filename} in {path}")
            names = [item.filename for item in items]
            broken = archive.testzip()
    except SourceError:
        raise
    except _ZIP_FAULTS as error:
        raise unreadable(path, error) from error
    if broken is not None:
        raise SourceError(f"archive {path} is damaged at {broken}; download it again.")
    usable = [
        name
        for name in names
        if Path(name).suffix.lower() in DRIVERS and not name.startswith("__MACOSX/")
    ]
    if not usable:
        raise SourceError(
            f"archive {path} contains no vector file, only {', '.join(names) or 'nothing'}; one of "
            f"{', '.join(sorted(DRIVERS))} is needed."
        )
    data = [name for name in usable if Path(name).suffix.lower() not in SIDE_SUFFIXES]
    return tuple(Member(path, name) for name in data or usable)
