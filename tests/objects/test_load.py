from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
import shapely
from osm_xml import node, relation, street_town, way, write_osm
from pyproj import CRS
from raw_layers import BENCHES, catalog_of, raw_layer
from sentences import refused
from servers import Answer

from semsig_gis.core import MERGED, CrsError, InputError, SourceError, UnknownNameError
from semsig_gis.database import build_database, open_database, save_database
from semsig_gis.objects import (
    assemble,
    choose_layers,
    layers_in_same_extracts,
    load,
    open_objects,
    quality_report,
    read_files,
    read_small_layers,
    save_objects,
)
from semsig_gis.output import quality_tables
from semsig_gis.sources import (
    READERS,
    ClassBy,
    LayerSpec,
    RowCounts,
    RowRules,
    Rows,
    fetch_layers,
    find_area,
    load_catalog,
    open_cache,
    paper_taxonomy,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from servers import Server

    from semsig_gis.sources import RawLayer


def raw(name: str, *places: tuple[float, float], crs: str | None = "EPSG:2154") -> RawLayer:
    return raw_layer(
        [shapely.Point(place) for place in places], name=name, classes="bench", crs=crs
    )


def test_layers_are_selected_by_name_and_selection() -> None:
    osm = load_catalog("openstreetmap")

    def chosen(*names: str, **options: Any) -> set[str]:  # noqa: ANN401
        return {spec.name for spec in choose_layers(osm, names, **options)}

    default, paper, everything = chosen(), chosen(selection="paper"), chosen(selection="all")
    assert default & {"trees", "crossings", "telephones", "buildings"} == {"trees", "crossings"}
    assert paper & {"trees", "crossings", "telephones"} == {"trees"}
    assert everything == {spec.name for spec in osm.layers if spec.role == "objects"}
    assert chosen("telephones") == {"telephones"}
    assert chosen("+telephones") == default | {"telephones"}
    assert chosen("+telephones", "trees") == {"telephones", "trees"}
    assert chosen("+telephones", selection="paper") == paper | {"telephones"}
    with refused(UnknownNameError, "'telephone'", "the nearest is 'telephones'"):
        chosen("+telephone")
    with refused(
        InputError, "'telephones' was given without a plus sign", "all layers", "'+telephones'"
    ):
        chosen("telephones", selection="all")
    roles = {spec.role for spec in choose_layers(osm, ["trees"], surroundings=True)}
    assert roles == {"objects", "buildings", "streets"}


def test_values_of_other_classes_match_no_pattern_of_the_paper() -> None:
    """Values of other classes are omitted, and no later pattern matches them."""
    values = (("Taxi VIP", "kiosk"), ("/Taxi.*/", "taxi_station"))
    bays = LayerSpec(
        name="bays", class_name="kiosk", class_by=ClassBy("type", values, otherwise=True)
    )
    kiosks = LayerSpec(name="kiosks", class_name="kiosk")
    (own,) = choose_layers(catalog_of(layers=(bays, kiosks)), selection="paper")
    rules = RowRules(own, ["type"], filters=True, where="bays")
    rows = Rows.of(rules.fields)
    for text in ("Taxi VIP", "Taxi", "other"):
        rows.add({"type": text}, text, (0.0, 0.0))
    assert own.classes == ("taxi_station",)
    filtered = rules.apply(rows)
    assert filtered.columns["source_id"].to_pylist() == ["Taxi"]
    assert filtered.notes == ("left out, unlisted in class_by 'type': 'Taxi VIP' 1, 'other' 1",)


def test_files_are_loaded_in_one_call(tmp_path: Path) -> None:
    town = write_osm(tmp_path / "town.osm", *street_town())
    lines: list[str] = []
    loaded = load(town, remark=lines.append)
    osm = load_catalog("openstreetmap")
    layers, _ = read_files(choose_layers(osm, surroundings=True), [town])
    same = assemble(layers, osm)
    assert loaded.objects.table.equals(same.objects.table)
    assert loaded.buildings is not None
    assert loaded.buildings.equals(same.buildings)
    assert "town.osm" in lines[0]
    for catalog in ("openstreetmap", osm, [osm]):
        assert len(load([town], catalog=catalog, surroundings=False).objects) == len(same.objects)
    assert load(town, surroundings=False).buildings is None
    assert set(load(town, layers=["benches"]).objects.codes) == {osm.taxonomy.by_name("bench").code}
    with refused(UnknownNameError, "opnstreetmap"):
        load(town, catalog="opnstreetmap")
    with refused(InputError, "no file"):
        load([])


def test_coordinate_systems_are_given_as_codes_text_or_values(tmp_path: Path) -> None:
    rows = "lon;lat\n7.42;43.73\n7.43;43.74\n"
    (tmp_path / "benches.csv").write_text(rows, encoding="utf-8")
    spec = LayerSpec(name="b", class_name="bench", files=("b*.csv",), x_field="lon", y_field="lat")
    catalog = catalog_of(layers=(spec,))
    results = [
        load(tmp_path, catalog=catalog, crs=crs, metric_crs=metric).objects
        for crs, metric in (
            (4326, 32632),
            ("EPSG:4326", "EPSG:32632"),
            (CRS.from_epsg(4326), CRS.from_epsg(32632)),
        )
    ]
    for objects in results:
        assert objects.crs.to_epsg() == 32632
        assert (objects.xy == results[0].xy).all()
    wrong: list[dict[str, Any]] = [
        {"crs": 4326, "metric_crs": 4326},
        {"crs": 4326, "metric_crs": 999_999},
        {"crs": 999_999},
    ]
    for options in wrong:
        with refused(CrsError, "EPSG:"):
            load(tmp_path, catalog=catalog, **options)


def test_other_layers_of_an_extract_are_counted(tmp_path: Path) -> None:
    osm = load_catalog("openstreetmap")
    tags = [{"amenity": "bench"}, *[{"amenity": "telephone"}] * 2, {"natural": "tree"}]
    nodes = (node(n, 7.42, 43.73 + n / 1000, tag) for n, tag in enumerate(tags, start=1))
    specs = choose_layers(osm, ["benches", "trees"])
    others = layers_in_same_extracts(osm, specs)
    assert {"telephones", "taxi_ranks"} < {spec.name for spec in others}
    layers, _ = read_files([*specs, *others], [write_osm(tmp_path / "town.osm", *nodes)])
    counted = [layer for layer in layers if layer.spec in others]
    loaded = assemble([layer for layer in layers if layer.spec in specs], osm, counted=counted)
    numbers = {layer.name: layer.objects for layer in loaded.report.unread}
    derived = {spec.name for spec in osm.layers if spec.derive is not None}
    assert {name for name, number in numbers.items() if number is None} == derived
    assert numbers["telephones"] == 2
    assert {*numbers.values()} == {0, 2, None}
    report = quality_report(loaded.objects, loaded.report)
    assert report.absent == ()
    assert {layer["name"]: layer["objects"] for layer in report.to_dict()["unread"]}[
        "telephones"
    ] == 2
    (table,) = [item for item in quality_tables(report) if item.title == "Layers not read"]
    assert ("telephones", "telephone", "2") in table.rows
    # Layers in other files, or not fetched, are not counted.
    assert layers_in_same_extracts(load_catalog("montpellier"), []) == ()
    unread = assemble([layer for layer in layers if layer.spec in specs], osm).report.unread
    assert {layer.objects for layer in unread} == {None}


def test_layers_of_small_files_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Others are skipped: too large, absent, without a CRS, or in two files."""
    rows = "\n".join(f"{n};7;43" for n in range(5))
    for name in ("bins", "odd", "twice_a", "twice_b", "large"):
        size = 200 if name == "large" else 1
        (tmp_path / f"{name}.csv").write_text(f"n;lon;lat\n{rows}\n" * size, encoding="utf-8")
    specs = [
        LayerSpec(name=name, class_name="bench", files=(f"{name}*.csv",), crs=crs)
        for name, crs in (
            *(("bins", "EPSG:4326"), ("odd", None), ("twice", "EPSG:4326")),
            *(("large", "EPSG:4326"), ("absent", "EPSG:4326")),
        )
    ]
    specs[0] = replace(specs[0], where=(("n", (">=3",)),))
    catalog = catalog_of(layers=(BENCHES, *specs))
    monkeypatch.setattr("semsig_gis.objects.skipped_layers.SMALL_BYTES", 1000)
    (bins,) = read_small_layers(catalog, [BENCHES], [tmp_path, tmp_path / "bins.csv"])
    assert (bins.spec.name, bins.counts.kept) == ("bins", 2)
    assert read_small_layers(catalog, specs, [tmp_path]) == ()


def test_file_is_read_once_for_all_its_layers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    osm = load_catalog("openstreetmap")
    path = write_osm(
        tmp_path / "town.osm",
        node(1, 7.42, 43.73, {"amenity": "bench"}),
        node(2, 7.42, 43.74, {"natural": "tree"}),
        node(3, 7.43, 43.74),
        way(9, [1, 2, 3, 1], {"building": "yes"}),
        way(10, [1, 2], {"highway": "primary"}),
        way(11, [2, 3], {"highway": "road"}),
    )
    real, calls = READERS["osm_file"], []

    def counted(file: Path, specs: Sequence[LayerSpec], **options: Any) -> tuple[RawLayer, ...]:  # noqa: ANN401
        calls.append(file)
        return real.read(file, specs, **options)

    monkeypatch.setitem(READERS._objects, "osm_file", replace(real, read=counted))
    specs = choose_layers(osm, surroundings=True)
    steps: list[tuple[int, int]] = []
    layers, absent = read_files(specs, [path], progress=lambda *step: steps.append(step))
    assert (len(calls), absent, steps) == (1, (), [(1, 1)])
    assert [layer.spec for layer in layers] == list(specs)
    loaded = assemble(layers, osm)
    assert loaded.objects.crs.to_epsg() == 32632
    assert sorted(loaded.objects.table["source"]) == ["benches", "trees"]
    assert loaded.buildings is not None
    assert list(loaded.buildings.geom_type) == ["Polygon"]
    assert loaded.buildings.crs == loaded.objects.crs
    assert loaded.streets is not None
    assert loaded.streets["half_width"].tolist() == pytest.approx([12.0, math.nan], nan_ok=True)


def test_buildings_and_streets_are_reported_like_other_layers(tmp_path: Path) -> None:
    osm = load_catalog("openstreetmap")
    shapes = [way(n, ring, {"building": "yes"}) for n, ring in ((9, [1, 2, 3, 1]), (10, [1, 2, 3]))]
    square = way(11, [1, 2, 3, 1], {"highway": "pedestrian", "area": "yes"})
    corners = [
        node(1, 7.42, 43.73, {"amenity": "bench"}),
        node(2, 7.43, 43.73),
        node(3, 7.42, 43.74),
    ]
    clipped = [
        relation(n, ways, {"type": "multipolygon", "building": "yes"})
        for n, ways in ((1, {9: "", 77: ""}), (2, {9: "", 88: "", 99: ""}))
    ]
    path = write_osm(tmp_path / "town.osm", *corners, *shapes, square, *clipped)
    layers, _ = read_files(choose_layers(osm, ["benches"], surroundings=True), [path])
    loaded = assemble(layers, osm)
    _, buildings, streets = loaded.report.layers
    assert [layer.role for layer in loaded.report.layers] == ["objects", "buildings", "streets"]
    assert buildings.counts == RowCounts(read=4, unreadable=3)
    assert streets.counts == RowCounts(read=1, filtered=1)
    why = (
        "lacks some of its ways, as where a file is clipped (2), is not closed, as the outline of a"
    )
    assert buildings.notes[0] == f"unreadable: {why} building is (1)"
    report = quality_report(loaded.objects, loaded.report)
    assert [source["kept"] for source in report.to_dict()["sources"]] == [1, 1, 0]
    assert "buildings" in str(quality_tables(report)[1].rows)


def test_unusable_buildings_are_counted() -> None:
    house = shapely.box(770_000, 6_280_000, 770_010, 6_280_010)
    far = shapely.box(1e9, 0, 2e9, 1)
    layer = raw_layer([house, None, shapely.Polygon(), house.boundary, far], name="houses")
    spec = replace(layer.spec, role="buildings", geometry="polygon")
    before = RowCounts(read=8, filtered=1, misplaced=2)
    houses = replace(layer, spec=spec, counts=before)
    benches = raw("city", (770000, 6280000))
    loaded = assemble([benches, houses], catalog_of(metric_crs="EPSG:2154"))
    assert loaded.buildings is not None
    assert loaded.buildings.geometry.tolist() == [house]
    after = replace(before, unreadable=1, missing=2, misplaced=3)
    assert loaded.report.layers[1].counts == after


def test_same_bench_in_two_layers_is_merged() -> None:
    layers = [
        raw("city", (770000, 6280000), (770050, 6280000)),
        raw("osm", (770000, 6280000), (770051, 6280000), (770099, 6280000)),
    ]
    catalog = catalog_of(metric_crs="EPSG:2154", conflate=(("bench", 3.0),))
    merged = assemble(layers, catalog)
    # The one at exactly the same place is recorded as well.
    assert merged.objects.table[MERGED].tolist() == ["osm:0", "osm:1", ""]
    assert (merged.conflation.count, merged.buildings) == (2, None)
    apart = assemble(layers, catalog, merge=False)
    assert (len(apart.objects), apart.conflation.count) == (4, 0)
    assert len(assemble(layers, catalog, merge=False, collapse=False).objects) == 5


def test_visibility_ranges_of_the_catalogue_are_stored_in_the_database(tmp_path: Path) -> None:
    taxonomy = paper_taxonomy().with_ranges({"bench": 12.0})
    catalog = catalog_of(metric_crs="EPSG:2154", taxonomy=taxonomy)
    loaded = assemble([raw("city", (770005, 6280005))], catalog)
    save_objects(loaded.objects, tmp_path / "objects.parquet")
    objects = open_objects(tmp_path / "objects.parquet")
    save_database(build_database(objects), tmp_path / "city.parquet")
    database = open_database(tmp_path / "city.parquet")
    assert objects.taxonomy == database.taxonomy == taxonomy
    assert len(database) == 5  # a cell and its neighbours, of the 29 within 30 m


def test_openstreetmap_is_fetched_clipped_and_cached(server: Server, tmp_path: Path) -> None:
    elements = [
        {"type": "node", "id": i, "lon": x, "lat": 43.73, "tags": {"amenity": "bench"}}
        for i, x in enumerate((7.42, 7.49), start=1)
    ]
    osm = load_catalog("openstreetmap")
    here = catalog_of(
        taxonomy=osm.taxonomy,
        layers=(osm.layer("benches"),),
        reader="osm_file",
        endpoints=(f"{server.url}/api",),
        geocoder=f"{server.url}/search",
    )
    server.on("/api/interpreter", Answer(json.dumps({"elements": elements}).encode()))
    cache, http = open_cache(tmp_path / "cache")
    area = find_area("7.41,43.72,7.43,43.74", here, cache=cache, http=http)
    (layer,) = fetch_layers(here.layers, here, area=area, cache=cache, http=http)
    assert layer.table["source_id"].tolist() == ["node/1"]
    assert (layer.counts.read, layer.counts.outside) == (2, 1)
    request_count = len(server.requests)
    _, offline = open_cache(tmp_path / "cache", offline=True)
    (again,) = fetch_layers(here.layers, here, area=area, cache=cache, http=offline)
    assert again.table["source_id"].tolist() == ["node/1"]
    assert len(server.requests) == request_count
    far = find_area("1,2,3,4", here, cache=cache, http=offline)
    with refused(SourceError, "127.0.0.1"):
        fetch_layers(here.layers, here, area=far, cache=cache, http=offline)


def test_place_name_needs_a_geocoder_in_the_catalogue(server: Server, tmp_path: Path) -> None:
    cache, http = open_cache(tmp_path)
    with refused(InputError, "'town'", "'Monaco'", "polygon file"):
        find_area("Monaco", catalog_of(), cache=cache, http=http)
    area = find_area("1,2,3,4", catalog_of(), cache=cache, http=http)
    with refused(InputError, "'town'", "semsig load"):
        fetch_layers([BENCHES], catalog_of(), area=area, cache=cache, http=http)
    assert server.requests == []
