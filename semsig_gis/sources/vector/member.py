"""Members of a vector file: the file itself, its layers, or the vector files in an archive."""

from __future__ import annotations

import contextlib
import re
import tempfile
import weakref
import zipfile
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import IO, TYPE_CHECKING

from semsig_gis.core import SourceError, temporary_folder
from semsig_gis.sources.encodings import gdal_name
from semsig_gis.sources.vector.formats import (
    DRIVERS,
    FIRST_BYTES,
    GEODATABASE,
    SQLITE,
    content_error,
)
from semsig_gis.storage import sqlite_fault

if TYPE_CHECKING:
    from pyproj import CRS

    from semsig_gis.sources.encodings import Guess

# Messages of both readers.
NOT_UTF8 = "some text is not UTF-8 and was read as missing"
OUT_OF_REACH = "out of reach behind unreadable rows"
# GDAL's geometry type of a layer with several types.
UNKNOWN = "Unknown"
START_BYTES = 4096
# Drivers of GDAL that find their mark anywhere in the start of a file, and follow links.
LINKING = re.compile(rb"<\s*(OGRVRT|OGRWFS|VRTDataset|WMS_|GDAL_|WFS|OGR[A-Z]+DataSource)")


class Copy:
    """A file in a temporary folder, which is removed together with this object."""

    def __init__(self, name: str) -> None:
        """Create the folder, for a file of this name."""
        stack = contextlib.ExitStack()
        self.path = stack.enter_context(temporary_folder(Path(tempfile.gettempdir()))) / name
        weakref.finalize(self, stack.close)


@dataclass(frozen=True, slots=True)
class Member:
    """A layer of a file, or of the file `inner` of an archive; `layer` None is the first one.

    What GDAL cannot open as it is has a `copy` that it can open. `encoding` is that of the texts
    according to the catalogue, `guess` a guess of one that the file does not state. `label` is the
    name of the layer where its own is not unique, and `notes` are for the user.
    """

    file: Path
    inner: str | None
    layer: str | None = None
    copy: Copy | None = field(default=None, compare=False)
    encoding: str | None = None
    guess: Guess | None = None
    label: str = ""
    notes: tuple[str, ...] = ()

    @property
    def path(self) -> PurePosixPath | Path:
        """The path in the archive, or else the path of the file or its copy."""
        if self.copy is not None:
            return self.copy.path
        return self.file if self.inner is None else PurePosixPath(self.inner)

    @property
    def name(self) -> str:
        """The name of the layer for users."""
        return self.label or self.layer or PurePosixPath(self.inner or self.file.name).stem

    @property
    def driver(self) -> str:
        """GDAL's name of the one driver that may open it."""
        return DRIVERS[self.path.suffix.lower()]

    @property
    def address(self) -> str:
        """Path that GDAL opens."""
        if self.inner is None or self.copy is not None:
            file = str(self.path)
            # pyogrio takes the part before a '!' for an archive, and a ';' for the end of the name,
            # except in GDAL's own forms.
            escaped = file.replace("%", "%25").replace("&", "%26")
            return f"/vsicached?file={escaped}" if {"!", ";"} & {*file} else file
        # GDAL's own form, because zip:// is parsed as a URL and cut at a '#' or a '?'.
        return f"/vsizip/{{{self.file.resolve().as_posix()}}}/{self.inner}"

    @property
    def gdal_encoding(self) -> str | None:
        """GDAL's name of the encoding of the texts, or None if the file states it."""
        encoding = self.encoding or (self.guess and self.guess.encoding)
        return gdal_name(encoding) if encoding else None

    def __str__(self) -> str:
        """Return the name for messages."""
        return str(self.file) if self.inner is None else f"{self.inner} in {self.file}"

    def open(self) -> IO[bytes]:
        """Return a stream of the bytes of the file."""
        if isinstance(self.path, Path):
            return self.path.open("rb")
        with zipfile.ZipFile(self.file) as archive:
            return archive.open(str(self.path))

    def sibling(self, suffix: str) -> Member | None:
        """Return the file of the same name with another suffix in any case, or None."""
        target = self.path.with_suffix(suffix).name.casefold()
        if isinstance(self.path, Path):
            files = (file for file in self.path.parent.iterdir() if file.name.casefold() == target)
            return next((Member(file, None) for file in files), None)
        with zipfile.ZipFile(self.file) as archive:
            names = map(PurePosixPath, archive.namelist())
        same = (name for name in names if name.name.casefold() == target)
        return next(
            (Member(self.file, str(name)) for name in same if name.parent == self.path.parent), None
        )

    def require_sound(self) -> None:
        """Raise SourceError if the content does not match the suffix, or is damaged."""
        if self.driver == GEODATABASE:
            return
        try:
            with self.open() as stream:
                start = stream.read(START_BYTES)
        except OSError as error:
            raise unreadable(self, error) from error
        if not FIRST_BYTES[self.driver].match(start) or LINKING.search(start):
            raise content_error(self, start)
        if self.driver not in SQLITE or not isinstance(self.path, Path):
            return
        if fault := sqlite_fault(self.file):
            raise SourceError(
                f"{self.file} cannot be read ({fault}); it may be damaged, so download it again."
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


def unreadable(what: object, error: BaseException) -> SourceError:
    """Return the error for an exception that a library raised when it opened a file."""
    if isinstance(error, UnicodeDecodeError):
        return SourceError(f"{what} is not UTF-8 text; save it as UTF-8.")
    cause = " ".join(str(error.__cause__ or error).split()).rpartition(" failed: ")[2].rstrip(".")
    if "not recognized" in cause:
        return SourceError(f"{what} is not the kind of file that its name says; download it again.")
    return SourceError(f"{what} cannot be read ({cause}); it may be damaged, so download it again.")
