"""What formats of vector files differ in: identifiers, encodings, parts, layers and damage."""

from __future__ import annotations

import json
import zipfile
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyogrio
import pytest
import shapely
from geojson import collection, feature, point
from vector_files import write

from semsig_gis.sources import (
    DRIVERS,
    LayerSpec,
    data_folder,
    first_rows,
    list_layers,
    read_layer,
)

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.sources import RawLayer


def read(path: Path, **what: Any) -> RawLayer:  # noqa: ANN401 - any field of a LayerSpec
    return read_layer(path, LayerSpec(name="things", class_name="bench", **what))


def frame(rows: int, **columns: Any) -> gpd.GeoDataFrame:  # noqa: ANN401
    places = [shapely.Point(n, n) for n in range(rows)]
    return gpd.GeoDataFrame(columns or {"n": range(rows)}, geometry=places, crs="EPSG:2154")


def xy(layer: RawLayer) -> list[list[float]]:
    places: list[list[float]] = shapely.get_coordinates(layer.table.geometry.array).tolist()
    return places


# Names of fields that GDAL has for the numbers of rows in some formats.
@pytest.mark.parametrize("name", ["id", "fid", "FID", "OGC_FID", "ogc_fid"])
@pytest.mark.parametrize("suffix", ["fgb", "geojson", "gpkg", "shp"])
def test_fields_named_like_numbers_of_rows(
    tmp_path: Path, suffix: str, name: str, engine: str
) -> None:
    table = frame(4, **{name: [70, 80, 80, 90]})
    options = {"FID": "row", "GEOMETRY_NAME": "shape"} if suffix == "gpkg" else {}
    path = write(table, tmp_path, suffix, **options)
    for layer in (read(path, id_field=name), read(path, where=((name, (">=0",)),), id_field=name)):
        assert sorted(layer.table["source_id"]) == ["70", "80", "80", "90"]
    ((_, rows, _),) = first_rows(path, limit=9)
    assert sorted(row[name] for row in rows) == [70, 80, 80, 90], engine


@pytest.mark.parametrize("own", [(), (7, 8), (7, 7), ("a", "b")])
@pytest.mark.parametrize("ids", [(1, 2), (1, 1), (1, "b"), ("a", "b"), (0.5, 1)])
def test_identifiers_of_geojson_of_any_type(
    tmp_path: Path, ids: tuple[Any, ...], own: tuple[Any, ...]
) -> None:
    features = [feature(point(2, 48), {"id": value}) for value in ids]
    for item, value in zip(features, own, strict=False):
        item["id"] = value
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps(collection(features)))
    layer = read(path, id_field="id")
    identifiers = layer.table["source_id"].tolist()
    assert identifiers == [str(value) for value in ids][: len(identifiers)]
    assert layer.counts.read == len(ids) == len(identifiers) + layer.counts.unreadable
    assert not layer.counts.unreadable or own == (7, 7)


def test_layers_of_the_same_name_in_folders_of_an_archive(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        write(frame(1), tmp_path / folder, "shp")
    path = tmp_path / "city.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for file in tmp_path.glob("?/*"):
            archive.write(file, file.relative_to(tmp_path))
    names = [info.name for info in list_layers(path)]
    assert sorted(names) == ["a/things.shp/things", "b/things.shp/things"]
    assert read(path, layer=names[0]).counts.read == 1


def test_shapefile_without_index_is_read_and_nothing_written(tmp_path: Path) -> None:
    path = write(frame(2), tmp_path, "shp")
    path.with_suffix(".shx").unlink()
    files = sorted(tmp_path.iterdir())
    layer = read(path)
    assert xy(layer) == [[0, 0], [1, 1]]
    assert ["no index" in note for note in layer.notes] == [True]
    assert sorted(tmp_path.iterdir()) == files


def test_symbol_of_a_drawing_is_at_its_point_of_insertion(tmp_path: Path) -> None:
    pairs = (
        "0 SECTION 2 HEADER 0 ENDSEC 0 SECTION 2 BLOCKS 0 BLOCK 8 0 2 TREE 70 0 10 0 20 0 "
        "0 LINE 8 0 10 0 20 0 11 9 21 9 0 ENDBLK 0 ENDSEC "
        "0 SECTION 2 ENTITIES 0 INSERT 8 trees 2 TREE 10 5 20 6 0 ENDSEC 0 EOF"
    )
    path = tmp_path / "a.dxf"
    path.write_text("\n".join(pairs.split()) + "\n")
    layer = read(path, crs="EPSG:2154", where=(("Layer", ("trees",)),))
    assert xy(layer) == [[5, 6]]
    assert [info.geometry for info in list_layers(path)] == ["Point"]


def test_lines_that_are_damaged_are_counted(tmp_path: Path) -> None:
    lines = [json.dumps(feature(point(n, 48), {"n": n})) for n in range(4)]
    path = tmp_path / "a.ndjson"
    path.write_text("\n".join([*lines[:2], "{oops", *lines[2:]])[:-9])
    counts = read(path, crs="EPSG:4326").counts
    assert (counts.read, counts.kept, counts.unreadable) == (5, 3, 2)


def test_sheets_of_remarks_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    for sheet, table in {
        "trees": pd.DataFrame({"lon": [2.5], "lat": [48.5]}),
        "about": pd.DataFrame({"Trees of the town": ["made in 2020"]}),
    }.items():
        pyogrio.write_dataframe(table, path, layer=sheet, append=path.exists())
    assert [info.name for info in list_layers(path)] == ["trees"]
    assert xy(read(path, crs="EPSG:4326")) == [[2.5, 48.5]]


# The name of a field and values in an encoding.
TEXTS = {
    "cp949": ("종류", "벤치", "가로등", "쓰레기통"),
    "cp932": ("種別", "ベンチ", "街灯", "ゴミ箱"),
    "gb18030": ("类型", "长椅", "路灯", "垃圾桶"),
    "cp1251": ("тип", "Скамейка", "Фонарь", "Урна"),
    "cp866": ("тип", "Скамейка", "Фонарь", "Урна"),
    "cp1250": ("typ", "ławka", "śmietnik", "źródło"),
    "cp1253": ("είδος", "Παγκάκι", "δέντρο", "φανοστάτης"),
    "utf-8": ("тип", "Скамейка", "Фонарь", "Урна"),
}


@pytest.mark.parametrize(("page", "language_driver"), [(None, 0x00), ("unknown", 0x57)])
@pytest.mark.parametrize("encoding", TEXTS)
def test_unstated_encoding_of_a_shapefile_is_found(
    tmp_path: Path, encoding: str, language_driver: int, page: str | None
) -> None:
    field, *kinds = TEXTS[encoding]
    path = tmp_path / "things.shp"
    frame(3, kind=["x" * 20] * 3).to_file(path, encoding="ISO-8859-1")
    path.with_suffix(".cpg").unlink()
    if page is not None:
        path.with_suffix(".CPG").write_text(page)
    table = path.with_suffix(".dbf")
    content = bytearray(table.read_bytes())
    content[29] = language_driver
    content[32:43] = field.encode(encoding).ljust(11, b"\0")
    for kind in kinds:
        at = content.index(b"x" * 20)
        content[at : at + 20] = kind.encode(encoding).ljust(20)
    table.write_bytes(content)
    by_guess, by_name = (read(path, id_field=field, encoding=by) for by in (None, encoding))
    for layer in (by_guess, by_name):
        assert layer.table["source_id"].tolist() == kinds
    remark = f"the encoding is not stated; read as {encoding}"
    assert [remark in note for note in by_guess.notes] == [True] * (encoding != "utf-8")
    assert by_name.notes == ()
    (info,) = list_layers(path)
    assert (info.encoding and info.encoding.encoding) == (None if encoding == "utf-8" else encoding)


def test_links_of_kml_are_not_followed(tmp_path: Path) -> None:
    mark = "<Placemark><Point><coordinates>2.5,48.5</coordinates></Point></Placemark>"
    link = "<NetworkLink><Link><href>inner.kml</href></Link></NetworkLink>"
    folder = "<Folder><name>empty</name></Folder>"
    for name, content in (("inner.kml", mark * 5), ("a.kml", link + folder + mark)):
        (tmp_path / name).write_text(f"<kml><Document>{content}</Document></kml>")
    assert [info.rows for info in list_layers(tmp_path / "a.kml")] == [1]


def test_documentation_names_every_suffix() -> None:
    table = (data_folder() / "README.md").read_text("utf-8").partition("## Formats of files")[2]
    rows = table.partition("\n## ")[0]
    assert {suffix for suffix in DRIVERS if f"`{suffix}`" not in rows} == set()
