"""Open data of Montpellier, compared with an independent program and plain loops."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pandas as pd
import pyogrio
import pytest
from worlds import assert_same

from semsig_gis.core import GridSpec
from semsig_gis.database import build_database, open_database, save_database
from semsig_gis.objects import build_objects, choose_layers, quality_report
from semsig_gis.sources import find_files, load_catalog, read_layer

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import LoadReport, StreetObjects

RADIUS = 30.0

# File, class and rows of every layer as published, and the rows after the filters of the catalogue
# and the collapsing of duplicates.
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
def filtered(geodata: Path) -> tuple[StreetObjects, LoadReport]:
    """Return the objects with filters and collapsing."""
    return load(geodata, filters=True, collapse=True)


@pytest.fixture(scope="module")
def city(everything: tuple[StreetObjects, LoadReport]) -> SignatureDatabase:
    return build_database(everything[0])


# --- Independent recomputations ---------------------------------------------------------------


@pytest.fixture(scope="module")
def published(geodata: Path) -> pd.DataFrame:
    """Read the twelve layers with another reader: class, x, y and the fields of the filters."""
    parts = []
    for name, (file, kind, _, _) in LAYERS.items():
        frame = pyogrio.read_dataframe(geodata / "montpellier" / f"VilleMTP_MTP_{file}.zip")
        metric = frame.to_crs("EPSG:2154")
        parts.append(
            pd.DataFrame(
                {
                    "layer": name,
                    "kind": kind,
                    "x": metric.geometry.x,
                    "y": metric.geometry.y,
                    "state": frame.get("ETAT"),
                    "lantern": frame.get("type_lante"),
                    "bay": frame.get("F01_TYPE_D"),
                    "parking": frame.get("TYPARK_C_2"),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def check_cells(database: SignatureDatabase, objects: StreetObjects) -> None:
    """Compare all cells with the sightings of every object from every cell around it."""
    x, y = objects.xy.T
    east, north = database.grid.origin
    column, row = np.floor((objects.xy - (east, north)) / 10.0).astype(np.int64).T
    parts = []
    for i, j in itertools.product(range(-4, 5), repeat=2):
        dx = x - (east + 10.0 * (column + i) + 5.0)
        dy = y - (north + 10.0 * (row + j) + 5.0)
        bearing = np.round(np.degrees(np.arctan2(dx, dy)) % 360.0, 9) % 360.0
        sightings = np.stack([column + i, row + j, bearing, np.hypot(dx, dy), objects.codes])
        parts.append(sightings[:, dx * dx + dy * dy <= RADIUS * RADIUS])
    sightings = np.concatenate(parts, axis=1)
    column, row, bearing, distance, codes = sightings[:, np.lexsort(sightings[::-1])]
    numbers, lengths = np.unique(column * 1e8 + row, return_counts=True)
    for ours, expected in (
        (database.cell_ids, numbers),
        (database.lengths, lengths),
        (database.codes, codes),
        (database.bearing_units, np.floor(bearing * 20)),
        (database.levels, np.floor(bearing / 22.5)),
        (database.distance_units, np.rint(distance * (255 / RADIUS))),
    ):
        np.testing.assert_array_equal(ours, expected)


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


def test_positions_equal_another_reader(
    everything: tuple[StreetObjects, LoadReport], published: pd.DataFrame
) -> None:
    objects, _ = everything
    frame = published
    assert objects.table["source"].tolist() == frame["layer"].tolist()
    # Files with their own WKT differ by some micrometres at most.
    assert objects.xy == pytest.approx(frame[["x", "y"]].to_numpy(), abs=1e-3)
    names = [objects.taxonomy.by_code(code).name for code in objects.codes.tolist()]
    taxi = frame["bay"].eq("Taxi").to_numpy(bool)
    disabled = frame["bay"].eq("GIG/GIC").to_numpy(bool)
    expected = np.where(taxi, "taxi_station", np.where(disabled, "disabled_bay", frame["kind"]))
    assert names == expected.tolist()
    assert (taxi.sum(), disabled.sum()) == (6, 150)


def test_number_and_length_of_signatures_equal_another_program(
    city: SignatureDatabase, everything: tuple[StreetObjects, LoadReport]
) -> None:
    assert abs(len(city) - 265_099) <= 20
    assert city.lengths.mean() == pytest.approx(6.344, abs=0.001)
    assert (city.spec.radius, city.grid.step, city.grid.origin) == (30.0, 10.0, (0.0, 0.0))
    # Viewpoints at 765205 + 10 i, 6275005 + 10 j.
    assert set(np.unique(city.xy % 10.0)) == {5.0}
    check_cells(city, everything[0])


def test_the_grid_may_have_another_origin(everything: tuple[StreetObjects, LoadReport]) -> None:
    shifted = build_database(everything[0], grid=GridSpec(origin=(5.0, 5.0)))
    assert set(np.unique(shifted.xy % 10.0)) == {0.0}
    assert len(shifted) == 265_191
    check_cells(shifted, everything[0])


def test_the_database_survives_its_file(city: SignatureDatabase, tmp_path: Path) -> None:
    path = tmp_path / "montpellier.parquet"
    save_database(city, path)
    assert_same(open_database(path), city)
    # 1,681,844 sightings, five bytes each before compression.
    assert path.stat().st_size < 8_000_000
    frame = gpd.read_parquet(path, columns=["cell_id", "length", "geometry"])
    assert frame["length"].tolist() == city.lengths.tolist()
    assert frame["cell_id"].tolist() == city.cell_ids.tolist()


# --- Filters and collapsing on ----------------------------------------------------------------


def test_filters_of_the_catalogue_equal_a_plain_selection(
    filtered: tuple[StreetObjects, LoadReport], published: pd.DataFrame
) -> None:
    objects, report = filtered
    assert {item.name: item.counts.kept for item in report.layers} == {
        name: rows for name, (_, _, _, rows) in LAYERS.items()
    }
    assert len(objects) == 55_652
    frame = published
    lamp = ["LANTERNE", "Lanterne", "LUMINAIRE AMBIANCE", "Luminaire en applique"]
    selection = (
        (frame["layer"].ne("fountains") | frame["state"].eq("en fonction"))
        & (frame["layer"].ne("street_lights") | frame["lantern"].isin(lamp))
        & (frame["layer"].ne("reserved_bays") | frame["bay"].ne("GIG/GIC"))
        & (frame["layer"].ne("car_parks") | frame["parking"].isin(["Surface", "Superstructure"]))
    )
    expected = frame[selection]
    assert int(objects.table["count"].sum()) == len(expected)
    places = expected.assign(
        x=expected["x"].round(2), y=expected["y"].round(2), bay=expected["bay"].fillna("")
    )
    distinct = places.drop_duplicates(["kind", "bay", "x", "y"])
    assert len(objects) == len(distinct)
    assert objects.table["source"].tolist() == distinct["layer"].tolist()


def test_quality_report_of_montpellier(filtered: tuple[StreetObjects, LoadReport]) -> None:
    objects, load = filtered
    report = quality_report(objects, load)
    by_name = {item.class_name: item for item in report.classes}
    assert by_name["alignment_tree"].nearest_m == pytest.approx(6.5, abs=0.1)
    meters = by_name["parking_meter"]
    assert (meters.rows, meters.objects, report.objects) == (823, 701, len(objects))
    # The commune has 57 km2, about the hull of its objects; the occupied squares are fewer.
    assert 40 < report.hull_km2 < 80
    squares = {(int(x // 100), int(y // 100)) for x, y in objects.xy.tolist()}
    assert report.occupied_km2 == pytest.approx(len(squares) / 100)
    assert report.occupied_km2 < report.hull_km2
    assert np.allclose(report.extent_degrees, (3.81, 43.57, 3.94, 43.65), atol=0.02)


def test_signatures_with_filters_and_collapsing(
    filtered: tuple[StreetObjects, LoadReport],
) -> None:
    database = build_database(filtered[0])
    assert len(database) == 263_487
    assert database.lengths.mean() == pytest.approx(5.97264, abs=5e-6)
    check_cells(database, filtered[0])


def test_street_widths_follow_the_kind_of_street(geodata: Path) -> None:
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
