"""Formats of vector files: the driver of each suffix, and what to do with files of other formats.

GDAL has about 80 drivers, and some of them follow links, so each suffix has one driver.
"""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from semsig_gis.core import SourceError

if TYPE_CHECKING:
    from pathlib import Path

CSV = "CSV"
DXF = "DXF"
GEODATABASE = "OpenFileGDB"
GEOJSON = "GeoJSON"
GEOPACKAGE = "GPKG"
GPX = "GPX"
KML = "LIBKML"  # reads the attributes, which GDAL's other driver of KML does not
SHAPEFILE = "ESRI Shapefile"
SHEETS = "XLSX"
DRIVERS: dict[str, str] = {
    ".csv": CSV,
    ".db": "SQLite",
    ".dxf": DXF,
    ".fgb": "FlatGeobuf",
    ".gdb": GEODATABASE,
    ".geojson": GEOJSON,
    ".geojsonl": GEOJSON,
    ".geojsons": GEOJSON,
    ".geojsonseq": GEOJSON,
    ".gpkg": GEOPACKAGE,
    ".gpx": GPX,
    ".json": GEOJSON,
    ".jsonl": GEOJSON,
    ".kml": KML,
    ".mif": "MapInfo File",
    ".ndjson": GEOJSON,
    ".ods": "ODS",
    ".shp": SHAPEFILE,
    ".spatialite": "SQLite",
    ".sqlite": "SQLite",
    ".sqlite3": "SQLite",
    ".tab": "MapInfo File",
    ".topojson": GEOJSON,
    ".tsv": CSV,
    ".txt": CSV,
    ".umap": GEOJSON,
    ".xlsx": SHEETS,
}
"""The only driver that may open a file, by suffix."""
ARCHIVES: frozenset[str] = frozenset({".kmz", ".zip"})
SQLITE = frozenset({GEOPACKAGE, "SQLite"})
WORKBOOKS: frozenset[str] = frozenset({"ODS", SHEETS})
# Formats with one layer in a file.
SINGLE = frozenset({CSV, "FlatGeobuf", GEOJSON, SHAPEFILE})
# Formats with damage that fiona reports row by row.
WITH_FIONA = frozenset({"FlatGeobuf", GEOJSON, GEOPACKAGE, SHAPEFILE})
# Formats with bytes that are read from the start, so that a file may be compressed.
STREAMED = frozenset({CSV, DXF, GEOJSON, GPX, KML})
_SQLITE = re.compile(rb"SQLite format 3\0")
_ZIPPED = re.compile(rb"PK\x03\x04")
# How a file begins, by driver.
FIRST_BYTES = {
    CSV: re.compile(rb""),
    DXF: re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:999|0)\s*\n|AutoCAD Binary DXF"),
    "FlatGeobuf": re.compile(rb"fgb"),
    GEOJSON: re.compile(rb"(?:\xef\xbb\xbf)?\s*\{"),
    GEOPACKAGE: _SQLITE,
    GPX: re.compile(rb"(?:\xef\xbb\xbf)?\s*<.*<gpx|(?:\xef\xbb\xbf)?\s*<gpx", re.DOTALL),
    KML: re.compile(rb"(?:\xef\xbb\xbf)?\s*<(?:.*<)?(?:\w+:)?kml", re.DOTALL),
    "MapInfo File": re.compile(rb"\s*(?:!table|version\s)", re.IGNORECASE),
    "ODS": _ZIPPED,
    SHAPEFILE: re.compile(rb"\x00\x00\x27\x0a"),
    SHEETS: _ZIPPED,
    "SQLite": _SQLITE,
}
CONVERT = "convert it with `ogr2ogr out.gpkg {name}` (GDAL) and give out.gpkg"
UNWRAP = (
    "remove what stands before the first { and after the last } (such as `var x =`), and save it "
    "as .geojson"
)
UNPACK = "is a packed archive; unpack it and give what is inside, or pack it as .zip"
DUMP = (
    "is a dump of a database; load it into PostGIS with psql or pg_restore, write the table with "
    '`ogr2ogr out.gpkg PG:"dbname=NAME" TABLE`, and give out.gpkg'
)
PART_OF_SHAPEFILE = "is a part of a shapefile; give its .shp, with the other parts in its folder"
PROJECT = "is a project, which only names the files of its layers; give these files"
# What a file of another format is and what to do, by its suffix.
OTHERS = {
    suffix: sentence
    for suffixes, sentence in {
        ".7z .rar .tar .tgz .tbz .bz2 .gz .xz .zst": UNPACK,
        ".sql .dump .backup": DUMP,
        ".xls .xlsb .xlsm .numbers": "is a workbook; save it as .xlsx or .csv",
        ".dwg": "is a drawing; save it as .dxf in the program that made it",
        ".js": f"is JavaScript; {UNWRAP}",
        ".html .htm": "is a web page, not data; download the file that the page links to",
        ".dbf .shx .prj .cpg .sbn .sbx .qix": PART_OF_SHAPEFILE,
        ".dat .map .id .ind": "is a part of a MapInfo table; give its .tab",
        ".mid": "is a part of a MapInfo file; give its .mif",
        ".pdf .doc .docx": "is a document; ask its publisher for the data, such as .csv or .gpkg",
        ".qgz .qgs .mxd .aprx .lyr .lyrx .qlr": PROJECT,
        ".mbtiles .pmtiles .mvt": "has tiles for display; ask its publisher for the data",
        ".gdbtable .gdbtablx .gdbindexes": (
            "is a part of a file geodatabase; give the folder that ends with .gdb"
        ),
    }.items()
    for suffix in suffixes.split()
}
TABLE = "a table of text"
XML = "XML, such as an error of a server"
# What the content of a file is, by its first bytes: a description, and the suffix to give it.
CONTENTS = (
    (re.compile(rb"\s*<(?:!doctype\s+html|html|head|body)", re.IGNORECASE), "a web page", ""),
    (re.compile(rb"\s*(?:(?:var|let|const)\s+\w+\s*=|export\s+default|[A-Za-z_][\w.]*\s*[=(]\s*[{\[])"),
     "JavaScript", ""),
    (re.compile(rb"PK\x03\x04.{26}(?:mimetype.*opendocument\.spreadsheet)", re.DOTALL),
     "a spreadsheet", ".ods"),
    (re.compile(rb"PK\x03\x04.*(?:xl/|\[Content_Types\])", re.DOTALL), "a workbook", ".xlsx"),
    (re.compile(rb"PK\x03\x04.{0,80}\.kml", re.DOTALL), "zipped KML", ".kmz"),
    (_ZIPPED, "a ZIP archive", ".zip"),
    (re.compile(rb"PK\x05\x06"), "an empty ZIP archive", ""),
    (re.compile(rb"\x1f\x8b"), "compressed by gzip", ".gz"),
    (re.compile(rb"7z\xbc\xaf|Rar!|BZh|\xfd7zXZ|\x28\xb5\x2f\xfd"), "a packed archive", ""),
    (_SQLITE, "a GeoPackage or another SQLite database", ".gpkg"),
    (re.compile(rb"PAR1"), "Parquet", ".parquet"),
    (FIRST_BYTES["FlatGeobuf"], "FlatGeobuf", ".fgb"),
    (FIRST_BYTES[SHAPEFILE], "the .shp of a shapefile", ".shp"),
    (re.compile(rb"%PDF"), "a PDF document", ""),
    (re.compile(rb"\x89PNG|\xff\xd8\xff|GIF8|II\*\0|MM\0\*"), "a picture", ""),
    (re.compile(rb"version https://git-lfs"), "a Git LFS pointer, which only names the data", ""),
    (FIRST_BYTES[KML], "KML", ".kml"),
    (FIRST_BYTES[GPX], "GPX", ".gpx"),
    (re.compile(rb"(?:\xef\xbb\xbf)?\s*<.*<osm\b|\s*<osm\b", re.DOTALL), "OpenStreetMap data",
     ".osm"),
    (re.compile(rb"(?:\xef\xbb\xbf)?\s*<.*(?:opengis\.net/gml|FeatureCollection)", re.DOTALL),
     "GML", ".gml"),
    (re.compile(rb"(?:\xef\xbb\xbf)?\s*<"), XML, ""),
    (re.compile(rb"(?:\xef\xbb\xbf)?\s*[\[{\x1e]"), "JSON", ".json"),
    (re.compile(rb"\s*!table", re.IGNORECASE), "a MapInfo table", ".tab"),
    (re.compile(rb"[^\0\n]*[^\0\n,;\t|][,;\t|][^\0\n]*\n"), TABLE, ".csv"),
)  # fmt: skip
# Content that is not data, and what to do.
NO_DATA = {
    "a web page": "the link led to a page, perhaps for a login; download the data itself",
    "JavaScript": UNWRAP,
    "a packed archive": "unpack it and give what is inside",
    "a Git LFS pointer, which only names the data": "fetch the data with `git lfs pull`",
    XML: "look at it in a text editor, and download the data again",
}


def accepted() -> str:
    """Return the suffixes of all vector files that are read."""
    return ", ".join(sorted({*DRIVERS, *ARCHIVES}))


def suffix_error(file: Path) -> SourceError:
    """Return the error for a file with a suffix that no driver has."""
    suffix = file.suffix.lower()
    if suffix in OTHERS:
        return SourceError(f"{file} {OTHERS[suffix]}.")
    remedy = _by_content(_start(file), suffix) or CONVERT.format(name=file.name)
    return SourceError(f"{file} is not a vector file; give one of {accepted()}; {remedy}.")


def content_error(what: object, start: bytes) -> SourceError:
    """Return the error for a file with first bytes that do not match its suffix."""
    suffix = PurePosixPath(str(what).partition(" in ")[0]).suffix.lower()
    if not start.strip(b"\0"):
        remedy = "it is empty; download it again"
    else:
        remedy = _by_content(start, suffix) or "download it again"
    return SourceError(f"{what} is not the kind of file that its name says; {remedy}.")


def require_text(what: object, start: bytes) -> None:
    """Raise SourceError if a file is not a table in text, JSON, GML or Parquet by its first bytes.

    Unknown text passes.
    """
    kind = next((kind for pattern, kind, _ in CONTENTS if pattern.match(start)), XML)
    if kind not in {"GML", "JSON", "Parquet", TABLE, XML}:
        raise content_error(what, start)


def _by_content(start: bytes, suffix: str) -> str:
    """Return what a file is by its first bytes, and what to do; empty if that is unknown."""
    for pattern, kind, right in CONTENTS:
        if pattern.match(start):
            if kind in NO_DATA:
                return f"its content is {kind}: {NO_DATA[kind]}"
            if right == suffix:
                return ""
            if right == ".gz":
                return f"its content is {kind}: add .gz to its name"
            return f"its content is {kind}" + (f": rename it to end with {right}" if right else "")
    return ""


def _start(file: Path) -> bytes:
    try:
        with file.open("rb") as stream:
            return stream.read(4096)
    except OSError:
        return b""
