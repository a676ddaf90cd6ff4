"""Check SQLite files, such as GeoPackages."""

from __future__ import annotations

import contextlib
import sqlite3
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def sqlite_fault(path: Path) -> str:
    """Return what is wrong with an SQLite file in a few words, empty if it is sound.

    GDAL reads damaged tables without a word, and its readers may crash.
    """
    address = f"{path.resolve().as_uri()}?mode=ro"
    try:
        with contextlib.closing(sqlite3.connect(address, uri=True)) as connection:
            verdict = str(connection.execute("PRAGMA quick_check(1)").fetchone()[0])
    except UnicodeDecodeError:
        return "a name in it is not UTF-8 text"
    except sqlite3.Error as error:
        verdict = str(error)
    return "" if verdict == "ok" else " ".join(verdict.split())
