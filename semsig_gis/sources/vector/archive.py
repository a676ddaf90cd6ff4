"""Which files and members of archives hold layers, and which driver may open each."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

from semsig_gis.core.errors import SourceError

# The only drivers that may open a file: GDAL has some eighty, and a few of them follow links.
DRIVERS = {
    ".csv": "CSV",
    ".fgb": "FlatGeobuf",
    ".geojson": "GeoJSON",
    ".gpkg": "GPKG",
    ".json": "GeoJSON",
    ".shp": "ESRI Shapefile",
}
# In an archive beside other data, these hold a legend or metadata.
SIDE_SUFFIXES = frozenset({".csv", ".json"})


@dataclass(frozen=True, slots=True)
class Member:
    """One layer of a file, or of a file in an archive, by its name there (`inner`).

    `layer` is None until its name is known.
    """

    file: Path
    inner: str | None
    layer: str | None = None

    @property
    def driver(self) -> str:
        """GDAL's name of the one driver that may open it."""
        return DRIVERS[Path(self.inner or self.file).suffix.lower()]

    @property
    def address(self) -> str | Path:
        """What GDAL opens."""
        if self.inner is None:
            return self.file
        # GDAL's own form: fiona parses zip:// as a URL and loses what follows a '#' or a '?'.
        return f"/vsizip/{{{self.file.resolve().as_posix()}}}/{self.inner}"

    def __str__(self) -> str:
        """Return the name as messages say it."""
        return str(self.file) if self.inner is None else f"{self.inner} in {self.file}"

    def content(self, size: int = -1) -> bytes:
        """Return the bytes of the file, or the first `size` of them."""
        if self.inner is None:
            with self.file.open("rb") as stream:
                return stream.read(size)
        with zipfile.ZipFile(self.file) as archive, archive.open(self.inner) as stream:
            return stream.read(size)


def unreadable(what: object, error: BaseException) -> SourceError:
    """Return the plain sentence for what a library raised on opening something."""
    if isinstance(error, UnicodeDecodeError):
        return SourceError(f"{what} is not UTF-8 text; save it as UTF-8.")
    cause = " ".join(str(error.__cause__ or error).split()).rpartition(" failed: ")[2].rstrip(".")
    if "not recognized" in cause:
        return SourceError(f"{what} is not the kind of file that its name says; get it again.")
    return SourceError(f"{what} cannot be read ({cause}); it may be damaged, get it again.")


def members(path: Path) -> tuple[Member, ...]:
    """Return the parts of a file that hold layers: itself, or the vector files in an archive.

    SourceError if it is missing, of another kind, or a damaged or useless archive.
    """
    suffix = path.suffix.lower()
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        msg = f"{path} {what}; give a vector file."
        raise SourceError(msg)
    suffixes = {*DRIVERS, ".zip"}
    if suffix not in suffixes:
        msg = f"{path} is not a vector file; give one of {', '.join(sorted(suffixes))}."
        raise SourceError(msg)
    inner = _archived(path) if suffix == ".zip" else (None,)
    return tuple(Member(path, name) for name in inner)


def _archived(path: Path) -> tuple[str, ...]:
    """Return the names of the vector files in an archive whose checksums hold."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = [item.filename for item in archive.infolist() if not item.is_dir()]
            broken = archive.testzip()
    except (NotImplementedError, OSError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise unreadable(path, error) from error
    if broken is not None:
        msg = f"archive {path} is damaged at {broken}; get it again."
        raise SourceError(msg)
    usable = [
        name
        for name in names
        if Path(name).suffix.lower() in DRIVERS and not name.startswith("__MACOSX/")
    ]
    if not usable:
        msg = (
            f"archive {path} holds no vector file, only {', '.join(names) or 'nothing'}; "
            f"one of {', '.join(sorted(DRIVERS))} is needed."
        )
        raise SourceError(msg)
    data = [name for name in usable if Path(name).suffix.lower() not in SIDE_SUFFIXES]
    return tuple(data or usable)
