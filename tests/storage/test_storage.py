from __future__ import annotations

import errno
import json
import os
import random
import tempfile
from pathlib import Path
from typing import Any, NoReturn

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS
from sentences import assert_sentence

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.storage.geoparquet import (
    geo_metadata,
    points_to_wkb,
    read_geoparquet,
    write_geoparquet,
)
from semsig_gis.storage.whole import move_folder, whole_file, whole_folder

NUMBERS = list(range(0, 900, 3))
TEXTS = [f"café {number}" for number in NUMBERS]
LISTS = [[number % 7, 7_199] * (number % 4) for number in NUMBERS]
POINTS = [shapely.Point(700_000 + number, 6_600_000 - number) for number in NUMBERS]


def write_example(
    path: Path, *, specs: dict[str, Any] | None = None, crs: object = "EPSG:2154"
) -> Path:
    table = pa.table(
        {
            "number": pa.array(NUMBERS, pa.int32()),
            "text": TEXTS,
            "list": pa.array(LISTS, pa.list_(pa.uint16())),
            "geometry": pa.array(shapely.to_wkb(POINTS), pa.binary()),
        }
    )
    geo = geo_metadata(
        CRS(2154), geometry_types=["Point"], bounds=shapely.total_bounds(POINTS).tolist()
    )
    if crs != "EPSG:2154":
        geo["columns"]["geometry"]["crs"] = crs
    write_geoparquet(table, path, geo=geo, specs={"kind": "sample"} if specs is None else specs)
    return path


@pytest.fixture
def example(tmp_path: Path) -> Path:
    return write_example(tmp_path / "example.parquet")


# --- whole_file -------------------------------------------------------------------------------


def test_a_file_appears_when_the_block_is_done(tmp_path: Path) -> None:
    target = tmp_path / "new" / "folder" / "a.gpkg"
    with whole_file(str(target)) as partial:
        assert partial.suffix == ".gpkg"
        assert partial.parent.parent == target.parent
        partial.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt, SystemExit, MemoryError])
def test_an_error_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, stop: type[BaseException]
) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(stop), whole_file(target) as partial:  # noqa: PT012
        partial.write_text("half")
        raise stop
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_companions_of_the_file_are_removed(tmp_path: Path) -> None:
    target = tmp_path / "a.gpkg"
    with whole_file(target) as partial:
        partial.write_text("whole")
        partial.with_name("a.gpkg-journal").write_text("half")
        partial.with_name("folder").mkdir()
        (partial.with_name("folder") / "more").write_text("x")
    assert list(tmp_path.iterdir()) == [target]


def test_a_block_that_writes_nothing_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught, whole_file(tmp_path / "a.txt"):
        pass
    assert_sentence(caught.value, "a.txt", "could not be written")
    assert list(tmp_path.iterdir()) == []


def test_a_path_below_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for path in (tmp_path / "file" / "a.txt", tmp_path / "file" / "deeper" / "a.txt"):
        with pytest.raises(InputError) as caught, whole_file(path):
            pytest.fail("the block must not run")
        assert_sentence(caught.value, str(path), "cannot be written", "choose a folder")


def test_a_folder_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, Path()):
        with pytest.raises(InputError) as caught, whole_file(path):
            pytest.fail("the block must not run")
        assert_sentence(caught.value, str(path), "is a folder")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_device_or_a_pipe_is_refused_and_stays(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, Path(os.devnull)):
        with pytest.raises(InputError) as caught, whole_file(path):
            pytest.fail("the block must not run")
        assert_sentence(caught.value, str(path), "is a device or a pipe")
    assert pipe.is_fifo()


def test_a_folder_that_may_not_be_written_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: object) -> NoReturn:
        raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path))

    monkeypatch.setattr(tempfile, "mkdtemp", refuse)
    with pytest.raises(InputError) as caught, whole_file(tmp_path / "a.txt"):
        pytest.fail("the block must not run")
    assert_sentence(caught.value, "a.txt", "Permission denied")


def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    # As pyarrow raises it: with a number, without a file name, and with words of its own.
    full = OSError(errno.ENOSPC, "Error writing bytes to file. Detail: [errno 28] No space left")
    with pytest.raises(InputError) as caught, whole_file(target):
        raise full
    assert_sentence(caught.value, str(target), os.strerror(errno.ENOSPC), "unchanged")
    assert "Detail" not in str(caught.value)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_rename_that_fails_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")

    def refuse(source: Path, _: Path) -> NoReturn:
        raise OSError(errno.EBUSY, "Device or resource busy", str(source))

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(InputError) as caught, whole_file(target) as partial:
        partial.write_text("new")
    assert_sentence(caught.value, str(target), "unchanged")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_an_error_about_another_file_keeps_its_own_message(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"other\.txt"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "other.txt").read_text()
    assert list(tmp_path.iterdir()) == []


def test_a_link_stays_and_the_file_that_it_names_is_replaced(tmp_path: Path) -> None:
    real, link = tmp_path / "city-2.txt", tmp_path / "latest.txt"
    real.write_text("old")
    link.symlink_to(real)
    with whole_file(link) as partial:
        partial.write_text("new")
    assert link.is_symlink()
    assert real.read_text() == "new"


def test_as_long_a_name_as_the_system_takes_can_be_written(tmp_path: Path) -> None:
    target = tmp_path / ("a" * 251 + ".txt")
    with whole_file(target) as partial:
        partial.write_text("new")
    assert target.read_text() == "new"


# --- whole_folder -----------------------------------------------------------------------------


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_a_folder_replaces_all_that_was_there(tmp_path: Path) -> None:
    target = tmp_path / "new" / "city"
    for number in range(2):
        with whole_folder(str(target)) as partial:
            assert partial.name == "city"
            assert list(partial.iterdir()) == []
            (partial / f"{number}.txt").write_text("whole")
        assert contents(target) == {f"{number}.txt": "whole"}
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt, OSError(28, "No space left")])
def test_an_error_leaves_the_old_folder_and_nothing_else(
    tmp_path: Path, stop: type[BaseException] | OSError
) -> None:
    target = tmp_path / "city"
    target.mkdir()
    (target / "old.txt").write_text("old")

    def half() -> None:
        with whole_folder(target) as partial:
            (partial / "new.txt").write_text("half")
            raise stop

    with pytest.raises((RuntimeError, KeyboardInterrupt, InputError)) as caught:
        half()
    if isinstance(stop, OSError):
        assert_sentence(caught.value, str(target), "No space left on device")
    assert contents(target) == {"old.txt": "old"}
    assert list(tmp_path.iterdir()) == [target]


def test_a_link_to_a_folder_stays(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with whole_folder(tmp_path / "link") as partial:
        (partial / "a.txt").write_text("a")
    assert (tmp_path / "link").is_symlink()
    assert contents(tmp_path / "real") == {"a.txt": "a"}


def test_a_folder_that_cannot_be_renamed_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("new", "old"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.txt").write_text(name)
    rename = Path.rename

    def denied(self: Path, target: Path) -> Path:
        if self.name == "new":
            raise PermissionError(errno.EACCES, "Permission denied")
        return rename(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", denied)
        with pytest.raises(InputError) as caught:
            move_folder(tmp_path / "new", tmp_path / "old")
    assert_sentence(caught.value, "Permission denied", "is unchanged")
    assert {name: contents(tmp_path / name)["a.txt"] for name in ("new", "old")} == {
        "new": "new",
        "old": "old",
    }
    move_folder(tmp_path / "new", tmp_path / "old")
    assert contents(tmp_path / "old") == {"a.txt": "new"}
    assert list(tmp_path.iterdir()) == [tmp_path / "old"]


# --- Points -----------------------------------------------------------------------------------


@given(st.lists(st.tuples(*[st.floats(allow_nan=False)] * 2)))
def test_points_are_the_bytes_that_shapely_writes(places: list[tuple[float, float]]) -> None:
    xy = np.array(places).reshape(-1, 2)
    column = points_to_wkb(xy)
    assert column.type == pa.binary()
    points = np.asarray(shapely.points(xy))
    assert column.to_pylist() == [shapely.to_wkb(point, byte_order=1) for point in points]


# --- GeoParquet -------------------------------------------------------------------------------


def test_what_is_written_is_read_again(example: Path) -> None:
    table, specs, crs = read_geoparquet(example, kind="sample")
    assert table["number"].to_pylist() == NUMBERS
    assert table["text"].to_pylist() == TEXTS
    assert table["list"].to_pylist() == LISTS
    assert specs == {"kind": "sample"}
    assert crs == CRS(2154)
    some, _, _ = read_geoparquet(example, kind="sample", columns=["text"])
    assert some.column_names == ["text"]


def test_geopandas_reads_the_file(example: Path) -> None:
    frame = gpd.read_parquet(example)
    assert frame.crs == CRS(2154)
    assert frame.geometry.tolist() == POINTS
    assert frame["number"].tolist() == NUMBERS
    assert frame["text"].tolist() == TEXTS
    assert [row.tolist() for row in frame["list"]] == LISTS
    metadata = json.loads(pq.read_metadata(example).metadata[b"geo"])
    assert metadata["version"] == "1.1.0"
    assert metadata["primary_column"] == "geometry"
    column = metadata["columns"]["geometry"]
    assert column["encoding"] == "WKB"
    assert column["geometry_types"] == ["Point"]
    assert column["bbox"] == list(shapely.total_bounds(POINTS))


def test_pyarrow_alone_reads_a_column(example: Path) -> None:
    assert pq.read_table(example, columns=["number"])["number"].to_pylist() == NUMBERS


def test_a_file_cut_anywhere_is_an_error(example: Path) -> None:
    content = example.read_bytes()
    for size in range(0, len(content), 10):
        example.write_bytes(content[:size])
        with pytest.raises(DatabaseError) as caught:
            read_geoparquet(example, kind="sample")
        assert_sentence(caught.value, str(example), "make the sample file again")


def test_a_flipped_bit_is_an_error_or_changes_nothing_that_is_read(example: Path) -> None:
    content = example.read_bytes()
    whole, _, _ = read_geoparquet(example, kind="sample")
    chance = random.Random(0)  # noqa: S311
    for _ in range(300):
        broken = bytearray(content)
        broken[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        example.write_bytes(broken)
        try:
            table, _, _ = read_geoparquet(example, kind="sample", columns=whole.column_names)
        except DatabaseError as error:
            assert_sentence(error, str(example))
        else:
            assert table.equals(whole)


def test_a_file_of_another_kind_is_named(example: Path) -> None:
    with pytest.raises(DatabaseError) as caught:
        read_geoparquet(example, kind="signature database")
    assert_sentence(caught.value, "is a sample file", "give a signature database file")


@pytest.mark.parametrize("specs", [[], ["kind"], "kind", 3, None, {"name": "x"}])
def test_specs_of_another_program_are_not_ours(tmp_path: Path, specs: object) -> None:
    path = tmp_path / "a.parquet"
    table = pa.table({"geometry": [shapely.to_wkb(POINTS[0])]})
    geo = geo_metadata(CRS(2154), geometry_types=["Point"], bounds=[0, 0, 1, 1])
    write_geoparquet(table, path, geo=geo, specs=specs)  # type: ignore[arg-type]
    with pytest.raises(DatabaseError) as caught:
        read_geoparquet(path, kind="sample")
    assert_sentence(caught.value, "was not written by semsig")


@pytest.mark.parametrize("crs", [None, {}, {"type": "x"}, "EPSG:0", 7.5])
def test_a_file_without_a_usable_crs_is_not_ours(tmp_path: Path, crs: object) -> None:
    path = write_example(tmp_path / "a.parquet", crs=crs)
    with pytest.raises(DatabaseError) as caught:
        read_geoparquet(path, kind="sample")
    assert_sentence(caught.value, "was not written by semsig")


def test_a_geoparquet_file_of_another_program_is_not_ours(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    gpd.GeoDataFrame(geometry=POINTS, crs=2154).to_parquet(path)
    with pytest.raises(DatabaseError) as caught:
        read_geoparquet(path, kind="sample")
    assert_sentence(caught.value, "was not written by semsig", "give a sample file")


@pytest.mark.parametrize("content", [b"", b"PAR1", b"name = 'town'\n", b"PK\x03\x04" * 20])
def test_a_file_that_is_not_parquet_is_an_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.parquet"
    path.write_bytes(content)
    with pytest.raises(DatabaseError) as caught:
        read_geoparquet(path, kind="sample")
    assert_sentence(caught.value, str(path), "is damaged or is not a Parquet file")


def test_a_missing_file_and_a_folder_are_told_apart(tmp_path: Path) -> None:
    missing = (tmp_path / "a.parquet", tmp_path / ("a" * 300))
    for path in missing:
        with pytest.raises(DatabaseError) as caught:
            read_geoparquet(path, kind="sample")
        assert_sentence(caught.value, str(path), "does not exist")
    with pytest.raises(DatabaseError) as caught:
        read_geoparquet(tmp_path, kind="sample")
    assert_sentence(caught.value, str(tmp_path), "is a folder")


def test_a_file_that_may_not_be_read_is_not_called_damaged(
    example: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> NoReturn:
        raise PermissionError(errno.EACCES, "Failed to open local file")

    monkeypatch.setattr(pq, "ParquetFile", refuse)
    with pytest.raises(DatabaseError) as caught:
        read_geoparquet(example, kind="sample")
    assert_sentence(caught.value, str(example), "cannot be read (Permission denied)")


def test_a_missing_column_is_named(example: Path) -> None:
    with pytest.raises(DatabaseError) as caught:
        read_geoparquet(example, kind="sample", columns=["number", "types"])
    assert_sentence(caught.value, "lacks the column 'types'")


def test_a_file_in_use_can_be_replaced(example: Path) -> None:
    table, _, _ = read_geoparquet(example, kind="sample")
    write_example(example, specs={"kind": "other"})
    assert table["number"].to_pylist() == NUMBERS
    assert read_geoparquet(example, kind="other")[1] == {"kind": "other"}
