from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core.errors import DatabaseError
from semsig_gis.database.file import MANIFEST, Manifest, Part, digest, part_files, read_manifest

if TYPE_CHECKING:
    from pathlib import Path

NUMBERS = st.integers(-(10**6), 10**6)
PARTS = st.builds(
    Part,
    st.tuples(NUMBERS, NUMBERS),
    st.integers(1, 10**9),
    st.integers(1, 10**9),
    st.integers(1, 10**9),
    st.text("0123456789abcdef", min_size=64, max_size=64),
)


@given(st.lists(PARTS, unique_by=lambda part: part.tile))
def test_a_manifest_is_read_as_it_was_written(
    tmp_path_factory: pytest.TempPathFactory, parts: list[Part]
) -> None:
    folder = tmp_path_factory.mktemp("manifest")
    manifest = Manifest({"grid": {"step": 10.0}}, tuple(sorted(parts)))
    manifest.write(folder)
    again = read_manifest(folder)
    assert again == manifest
    assert again.cells == sum(part.cells for part in parts)
    assert again.entries == sum(part.entries for part in parts)
    assert len({part.file for part in parts}) == len(parts)


def test_a_digest_is_that_of_the_joined_content(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_bytes(b"a" * 3_000_000)
    other.write_bytes(b"b")
    assert digest(one, other) == hashlib.sha256(b"a" * 3_000_000 + b"b").hexdigest()


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"parts": 3}', '{"kind": 1, "recipe": {}, "parts": [{}]}']
)
def test_a_damaged_manifest_is_an_error(tmp_path: Path, content: str) -> None:
    (tmp_path / MANIFEST).write_text(content)
    with refused(DatabaseError, MANIFEST, "build the database again"):
        read_manifest(tmp_path)


def test_a_manifest_of_another_kind_or_without_parts_is_an_error(tmp_path: Path) -> None:
    Manifest({}, ()).write(tmp_path)
    with refused(DatabaseError, "lists no parts"):
        part_files(tmp_path)
    content = json.loads((tmp_path / MANIFEST).read_text())
    (tmp_path / MANIFEST).write_text(json.dumps({**content, "kind": "recipes"}))
    with refused(DatabaseError, "another kind", "semsig build --tile"):
        read_manifest(tmp_path)
