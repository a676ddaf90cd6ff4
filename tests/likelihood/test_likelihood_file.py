from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from noisy_cells import random_database, random_query
from sentences import assert_sentence

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.database.city import City
from semsig_gis.database.file import save_database
from semsig_gis.likelihood.index import build_index, open_index, ready_index, save_index
from semsig_gis.likelihood.noise.model import NoiseSpec, named_noise

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

NOISE = named_noise("generic")
DATABASE = random_database(12, cells=150)


def test_an_index_comes_back_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "city.likelihood"
    save_index(DATABASE, NOISE, path)
    built, opened = build_index(DATABASE, NOISE), open_index(DATABASE, NOISE, path)
    query = random_query(DATABASE, 1, size=6)
    assert np.array_equal(built.columns, opened.columns)
    assert np.array_equal(built.scores(query).loglik, opened.scores(query).loglik)
    assert opened.fingerprint == built.fingerprint
    assert not opened.columns.flags.writeable
    assert [file.name for file in tmp_path.iterdir()] == ["city.likelihood"]


def test_each_model_has_a_file_of_its_own(tmp_path: Path) -> None:
    names = {
        City(tmp_path / "city.parquet").index_path(noise).name
        for noise in (NOISE, named_noise("light"), NoiseSpec(), NoiseSpec(clutter=2.0))
    }
    assert len(names) == 4
    assert all(name.startswith("city.parquet.") for name in names)
    strange = City(tmp_path / "city.parquet").index_path(NoiseSpec(name="a/b c"))
    assert strange.parent == tmp_path


@pytest.mark.parametrize("make", [ready_index, save_index])
def test_a_database_is_not_replaced(make: Callable[..., object], tmp_path: Path) -> None:
    path = tmp_path / "city.parquet"
    save_database(DATABASE, path)
    content = path.read_bytes()
    with pytest.raises(InputError) as caught:
        make(DATABASE, NOISE, path)
    assert_sentence(caught.value, str(City(path).index_path(NOISE)))
    assert path.read_bytes() == content


def damage(path: Path, how: str) -> None:
    content = bytearray(path.read_bytes())
    if how == "cut":
        path.write_bytes(content[:-1])
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "header":
        path.write_bytes(b"\xff" + content[1:])
    elif how == "list":
        path.write_bytes(b"[]".ljust(len(content)))
    elif how == "constants":
        content[4 * 4096 + 1] ^= 0x10
        path.write_bytes(content)
    elif how == "step":
        path.write_bytes(content.replace(b'"step": 0', b'"step":-0', 1))


@pytest.mark.parametrize("how", ["cut", "empty", "header", "list", "constants", "step"])
def test_a_damaged_file_is_refused_and_then_renewed(how: str, tmp_path: Path) -> None:
    path = tmp_path / "city.likelihood"
    save_index(DATABASE, NOISE, path)
    damage(path, how)
    with pytest.raises(DatabaseError, match="damaged"):
        open_index(DATABASE, NOISE, path)
    notes: list[str] = []
    index = ready_index(DATABASE, NOISE, path, note=notes.append)
    assert len(notes) == 1
    assert notes[0].startswith("The likelihood index is built again: ")
    assert np.array_equal(index.columns, build_index(DATABASE, NOISE).columns)
    ready_index(DATABASE, NOISE, path, note=notes.append)
    assert len(notes) == 1


def test_a_stale_file_is_told_and_renewed(tmp_path: Path) -> None:
    path = tmp_path / "city.likelihood"
    save_index(random_database(13, cells=150), NOISE, path)
    with pytest.raises(DatabaseError, match="another database, noise model or version"):
        open_index(DATABASE, NOISE, path)
    notes: list[str] = []
    done: list[tuple[int, int]] = []
    ready_index(
        DATABASE,
        NOISE,
        path,
        note=notes.append,
        progress=lambda *cells: done.append(cells),
        threads=2,
    )
    assert "belongs to another" in notes[0]
    assert done[-1] == (150, 150)
    open_index(DATABASE, NOISE, path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatabaseError, match="No such file"):
        open_index(DATABASE, NOISE, tmp_path / "none.likelihood")


def test_where_no_file_can_be_written_the_index_is_kept_in_memory(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way of a folder")
    notes: list[str] = []
    index = ready_index(DATABASE, NOISE, tmp_path / "file" / "x", note=notes.append)
    assert "kept in memory only" in notes[-1]
    assert len(index.constants) == 150
    assert ready_index(DATABASE, NOISE, tmp_path / "file" / "x").step == index.step
