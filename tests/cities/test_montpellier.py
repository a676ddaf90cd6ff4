"""The real city of Montpellier, against figures of an independent program and plain loops."""

from __future__ import annotations

import math
import random
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pandas as pd
import pyogrio
import pytest
from worlds import assert_same

from semsig_gis.core.geometry import GridSpec, cell_ids
from semsig_gis.database.build import build_database
from semsig_gis.database.file import open_database, save_database
from semsig_gis.objects.load import build_objects, choose_layers
from semsig_gis.reports.quality import quality_report
from semsig_gis.sources import find_files
from semsig_gis.sources.catalog import load_catalog
from semsig_gis.sources.vector import read_layer

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.objects.load import LoadReport
    from semsig_gis.objects.table import StreetObjects

RADIUS = 30.0

# File, class and rows of every layer as published, and what the catalogue's filters and the
# collapsing of duplicates leave of it.
LAYERS = {
    "trees": ("ArbresAlign", "alignment_tree", 23_972, 23_972),
    "fountains": ("FontainesPublic", "water_fountain", 89, 64),
    "drinking_taps": ("Fontaines", "water_fountain", 48, 48),
    "street_lights": ("EclairagePublic", "street_light", 29_969, 26_452),
    "notice_boards": ("AffichageLibre", "notice_board", 124, 124),
    "traffic_lights": ("Signalisation", "traffic_light", 373, 373),
    "parking_meters": ("Horodateurs_2011", "parking_meter", 823, 701),
    "disabled_bays": ("PlacesGIG", "disabled_bay", 477, 477),
    "car_parks": ("ParkingOuv", "car_park", 22, 11),
    "reserved_bays": ("PlacesReserv", "reserved_bay", 309, 159),
    "cameras": ("CameraSurv", "camera", 141, 141),
    "crossings": ("PassagesPiet", "pedestrian_crossing", 3_130, 3_130),
}


def load(geodata: Path, *, filters: bool, collapse: bool) -> tuple[StreetObjects, LoadReport]:
    catalog = load_catalog("montpellier")
    assert catalog.metric_crs is not None
    pairs, missing = find_files(choose_layers(catalog), [geodata / "montpellier"])
    assert not missing
    layers = [read_layer(path, spec, filters=filters) for spec, path in pairs]
    return build_objects(
        layers, taxonomy=catalog.taxonomy, crs=catalog.metric_crs, collapse=collapse
    )


@pytest.fixture(scope="module")
def everything(geodata: Path) -> tuple[StreetObjects, LoadReport]:
    """Return all objects of the twelve layers: no filter, no collapsing."""
    return load(geodata, filters=False, collapse=False)


@pytest.fixture(scope="module")
def chosen(geodata: Path) -> tuple[StreetObjects, LoadReport]:
    """Return the objects as the catalogue means them: filters and collapsing on."""
    return load(geodata, filters=True, collapse=True)


@pytest.fixture(scope="module")
def city(everything: tuple[StreetObjects, LoadReport]) -> SignatureDatabase:
    return build_database(everything[0])


# --- Independent recomputations ---------------------------------------------------------------


def published(geodata: Path) -> pd.DataFrame:
    """Read the twelve layers with another reader: class, x, y and the fields of the filters."""
    parts = []
    for name, (file, kind, _, _) in LAYERS.items():
        frame = pyogrio.read_dataframe(geodata / "montpellier" / f"VilleMTP_MTP_{file}.zip")
        moved = frame.to_crs("EPSG:2154")
        parts.append(
            pd.DataFrame(
                {
                    "layer": name,
                    "kind": kind,
                    "x": moved.geometry.x,
                    "y": moved.geometry.y,
                    "state": frame.get("ETAT"),
                    "lantern": frame.get("type_lante"),
                    "bay": frame.get("F01_TYPE_D"),
                    "parking": frame.get("TYPARK_C_2"),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def seen_by_cells(
    xy: NDArray[np.float64], origin: tuple[float, float]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of the cells of 10 m that see something, and how much each sees."""
    column, row = np.floor((xy - origin) / 10.0).astype(np.int64).T
    numbers = []
    for i in range(-4, 5):
        for j in range(-4, 5):
            dx = xy[:, 0] - (origin[0] + 10.0 * (column + i) + 5.0)
            dy = xy[:, 1] - (origin[1] + 10.0 * (row + j) + 5.0)
            near = dx * dx + dy * dy <= RADIUS * RADIUS
            numbers.append((column[near] + i) * 10**8 + row[near] + j)
    return np.unique(np.concatenate(numbers), return_counts=True)


def look_around(
    objects: StreetObjects, viewpoints: list[tuple[float, float]]
) -> list[list[tuple[float, float, int]]]:
    """Return (bearing, distance, class code) of what viewpoints see, one pair at a time."""
    squares: dict[tuple[int, int], list[tuple[float, float, int]]] = {}
    for (x, y), code in zip(objects.xy.tolist(), objects.codes.tolist(), strict=True):
        squares.setdefault((int(x // RADIUS), int(y // RADIUS)), []).append((x, y, code))
    views = []
    for vx, vy in viewpoints:
        seen = []
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                square = (int(vx // RADIUS) + i, int(vy // RADIUS) + j)
                for x, y, code in squares.get(square, []):
                    distance = math.hypot(x - vx, y - vy)
                    if distance <= RADIUS:
                        bearing = math.degrees(math.atan2(x - vx, y - vy)) % 360.0
                        seen.append((round(bearing, 9) % 360.0, distance, code))
        views.append(sorted(seen))
    return views


def check_cells(
    database: SignatureDatabase, objects: StreetObjects, *, count: int, seed: int
) -> None:
    """Compare the lengths of all cells and the signatures of random ones with plain loops."""
    east, north = database.grid.origin
    numbers, lengths = seen_by_cells(objects.xy, (east, north))
    assert database.cell_ids.tolist() == numbers.tolist()
    assert database.lengths.tolist() == lengths.tolist()
    cells = random.Random(seed).sample(range(len(database)), count)  # noqa: S311
    viewpoints = [
        (
            east + 10.0 * int(database.columns[cell]) + 5.0,
            north + 10.0 * int(database.rows[cell]) + 5.0,
        )
        for cell in cells
    ]
    for cell, seen in zip(cells, look_around(objects, viewpoints), strict=True):
        part = slice(database.offsets[cell], database.offsets[cell + 1])
        assert database.codes[part].tolist() == [code for _, _, code in seen]
        assert database.bearing_units[part].tolist() == [int(b * 20) for b, _, _ in seen]
        assert database.levels[part].tolist() == [int(b / 22.5) for b, _, _ in seen]
        units = [round(d * (255 / RADIUS)) for _, d, _ in seen]
        assert database.distance_units[part].tolist() == units


# --- All objects ------------------------------------------------------------------------------


def test_every_object_is_loaded(everything: tuple[StreetObjects, LoadReport]) -> None:
    objects, report = everything
    assert len(objects) == 59_477
    corner = np.array([765_200.0, 6_275_000.0])
    assert ((objects.xy >= corner) & (objects.xy <= corner + 10_500.0)).all()
    assert {item.name: item.counts.read for item in report.layers} == {
        name: rows for name, (_, _, rows, _) in LAYERS.items()
    }
    for item in report.layers:
        assert item.counts.kept == item.counts.read
        assert item.notes == ()


def test_positions_are_those_of_another_reader(
    everything: tuple[StreetObjects, LoadReport], geodata: Path
) -> None:
    objects, _ = everything
    frame = published(geodata)
    assert objects.table["source"].tolist() == frame["layer"].tolist()
    # The files with a WKT of their own are moved by some micrometres at most.
    assert objects.xy == pytest.approx(frame[["x", "y"]].to_numpy(), abs=1e-3)
    names = [objects.taxonomy.by_code(code).name for code in objects.codes.tolist()]
    taxi = frame["bay"].eq("Taxi").to_numpy(bool)
    disabled = frame["bay"].eq("GIG/GIC").to_numpy(bool)
    expected = np.where(taxi, "taxi_station", np.where(disabled, "disabled_bay", frame["kind"]))
    assert names == expected.tolist()
    assert (taxi.sum(), disabled.sum()) == (6, 150)


def test_the_signatures_are_as_many_and_as_long_as_another_program_found(
    city: SignatureDatabase, everything: tuple[StreetObjects, LoadReport]
) -> None:
    assert abs(len(city) - 265_099) <= 20
    assert city.lengths.mean() == pytest.approx(6.344, abs=0.001)
    assert (city.spec.radius, city.grid.step, city.grid.origin) == (30.0, 10.0, (0.0, 0.0))
    # Viewpoints at 765205 + 10 i, 6275005 + 10 j.
    assert set(np.unique(city.xy % 10.0)) == {5.0}
    check_cells(city, everything[0], count=1000, seed=1)


def test_the_grid_may_begin_elsewhere(everything: tuple[StreetObjects, LoadReport]) -> None:
    shifted = build_database(everything[0], grid=GridSpec(origin=(5.0, 5.0)))
    assert set(np.unique(shifted.xy % 10.0)) == {0.0}
    assert len(shifted) == 265_191
    check_cells(shifted, everything[0], count=300, seed=2)


def test_the_database_survives_its_file(city: SignatureDatabase, tmp_path: Path) -> None:
    path = tmp_path / "montpellier.parquet"
    save_database(city, path)
    assert_same(open_database(path), city)
    # 1,681,844 objects seen, of one, two and two bytes before compression.
    assert path.stat().st_size < 8_000_000
    frame = gpd.read_parquet(path, columns=["cell_id", "length", "geometry"])
    assert int(frame["length"].sum()) == len(city.codes)
    assert frame["cell_id"].tolist() == cell_ids(city.columns, city.rows).tolist()


# --- Filters and collapsing on ----------------------------------------------------------------


def test_the_catalogue_leaves_what_it_should(
    chosen: tuple[StreetObjects, LoadReport], geodata: Path
) -> None:
    objects, report = chosen
    assert {item.name: item.counts.kept for item in report.layers} == {
        name: kept for name, (_, _, _, kept) in LAYERS.items()
    }
    assert len(objects) == 55_652
    frame = published(geodata)
    lamp = ["LANTERNE", "Lanterne", "LUMINAIRE AMBIANCE", "Luminaire en applique"]
    wanted = (
        (frame["layer"].ne("fountains") | frame["state"].eq("en fonction"))
        & (frame["layer"].ne("street_lights") | frame["lantern"].isin(lamp))
        & (frame["layer"].ne("reserved_bays") | frame["bay"].ne("GIG/GIC"))
        & (frame["layer"].ne("car_parks") | frame["parking"].isin(["Surface", "Superstructure"]))
    )
    kept = frame[wanted]
    assert int(objects.table["count"].sum()) == len(kept)
    places = kept.assign(x=kept["x"].round(2), y=kept["y"].round(2), bay=kept["bay"].fillna(""))
    distinct = places.drop_duplicates(["kind", "bay", "x", "y"])
    assert len(objects) == len(distinct)
    assert objects.table["source"].tolist() == distinct["layer"].tolist()


def test_the_quality_of_the_load(chosen: tuple[StreetObjects, LoadReport]) -> None:
    objects, load = chosen
    report = quality_report(objects, load)
    by_name = {item.class_name: item for item in report.classes}
    assert by_name["alignment_tree"].nearest_m == pytest.approx(6.5, abs=0.1)
    meters = by_name["parking_meter"]
    assert (meters.rows, meters.objects, report.objects) == (823, 701, len(objects))
    # The commune has 57 km2; the hull of its objects is of that size, what is lit is less.
    assert 40 < report.hull_km2 < 80
    squares = {(int(x // 100), int(y // 100)) for x, y in objects.xy.tolist()}
    assert report.occupied_km2 == pytest.approx(len(squares) / 100)
    assert report.occupied_km2 < report.hull_km2
    assert np.allclose(report.extent_degrees, (3.81, 43.57, 3.94, 43.65), atol=0.02)


def test_duplicates_at_one_place_are_counted(geodata: Path) -> None:
    objects, report = load(geodata, filters=False, collapse=True)
    kept = {item.name: item.counts.kept for item in report.layers}
    assert kept["street_lights"] == 29_743
    assert kept["parking_meters"] == 701
    assert int(objects.table["count"].sum()) == 59_477
    assert sum(item.counts.collapsed for item in report.layers) == 59_477 - len(objects)


def test_the_figures_with_the_catalogue_as_it_is(
    chosen: tuple[StreetObjects, LoadReport],
) -> None:
    database = build_database(chosen[0])
    assert len(database) == 263_487
    assert database.lengths.mean() == pytest.approx(5.97264, abs=5e-6)
    check_cells(database, chosen[0], count=300, seed=3)


def test_streets_are_as_wide_as_their_kind_is(geodata: Path) -> None:
    (pair,), _ = find_files(
        [load_catalog("montpellier").layer("streets")], [geodata / "montpellier"]
    )
    layer = read_layer(pair[1], pair[0])
    frame = pyogrio.read_dataframe(pair[1])
    kinds = frame.set_index(frame["IDARC"].astype(str)).loc[layer.table["source_id"], "TYPVOI"]
    assert (layer.counts.read, layer.counts.filtered, len(layer.table)) == (8_011, 51, 7_960)
    half = layer.table["half_width"].to_numpy()
    expected = {"RUE": {7.0}, "AV": {12.0}, "PASS": {3.0}}
    assert {kind: set(half[kinds == kind]) for kind in expected} == expected
    assert np.isnan(half[kinds == "PL"]).all()
    assert np.isnan(half).mean() < 0.1
    assert layer.notes == (f"{np.isnan(half).sum()} of 7960 streets have no known width",)
