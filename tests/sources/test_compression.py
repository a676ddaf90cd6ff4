"""Compressed files with a ratio that is too high, and files that are only well compressed."""

from __future__ import annotations

import bz2
import gzip
import zipfile
from typing import TYPE_CHECKING

import pytest
from sentences import refused

from semsig_gis.core import SourceError
from semsig_gis.sources import (
    HARMLESS_BYTES,
    LayerSpec,
    check_compression_ratio,
    read_layer,
    read_layers,
)

if TYPE_CHECKING:
    from pathlib import Path

SPEC = LayerSpec(name="a", class_name="bench", tags=((("amenity", ("bench",)),),))
# Several members in succession, so that the test compresses less.
GZIP_BOMB = gzip.compress(b" " * 2**24) * 10
BZIP_BOMB = bz2.compress(b" " * 2**24) * 10


@pytest.mark.parametrize(("suffix", "bomb"), [(".gz", GZIP_BOMB), (".bz2", BZIP_BOMB)])
def test_extract_with_a_high_ratio_is_refused(tmp_path: Path, suffix: str, bomb: bytes) -> None:
    path = tmp_path / f"city.osm{suffix}"
    path.write_bytes(bomb)
    with refused(SourceError, f"{path} unpacks to more than 250 times", "give what is inside"):
        read_layers(path, [SPEC])


def test_archive_with_a_high_ratio_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "city.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("city.csv", b" " * (HARMLESS_BYTES + 1))
    with refused(SourceError, f"city.csv in {path} unpacks to more than 250 times"):
        read_layer(path, SPEC)


@pytest.mark.parametrize(
    "content", [gzip.compress(b" " * 2**24), GZIP_BOMB[:1000], b"", b"no archive"]
)
def test_small_or_damaged_file_passes(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "city.osm.gz"
    path.write_bytes(content)
    check_compression_ratio(path)
