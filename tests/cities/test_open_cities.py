"""Cities whose schemas were written down from documentation: rows of the documented shape."""

from __future__ import annotations

import csv
import json
import re
from typing import TYPE_CHECKING, Any

import pytest

from semsig_gis.objects.load import assemble, choose_layers, read_files
from semsig_gis.sources.catalog import data_folder, load_catalog

if TYPE_CHECKING:
    from pathlib import Path

# Of each city, a place in it, and of each layer, the name of its file and the fields of rows: those
# that count, and those that do not. A file of CSV has its positions in fields, too.
CITIES: dict[str, tuple[tuple[float, float], dict[str, tuple[str, list[Any], list[Any]]]]] = {
    "vienna": (
        (16.37, 48.21),
        {
            "trees": ("BAUMKATOGD.json", [{"OBJECTID": 1, "GATTUNG_ART": "Tilia"}], []),
            "fountains": (
                "TRINKBRUNNENOGD.json",
                [{"OBJECTID": 1, "BASIS_TYP_TXT": "Trinkbrunnen"},
                 {"OBJECTID": 2, "BASIS_TYP_TXT": "Trinkbrunnen mit Tränke"}],
                [{"OBJECTID": 3, "BASIS_TYP_TXT": "Spielbrunnen"},
                 {"OBJECTID": 4, "BASIS_TYP_TXT": "Trinkhydrant"}],
            ),
            "toilets": ("WCANLAGEOGD.json", [{"KATEGORIE": "behindertengerecht"}], []),
            "stops": ("HALTESTELLEWLOGD.json", [{"HTXT": "Rathaus"}], []),
            "taxi_ranks": ("TAXIOGD.json", [{"ADRESSE": "1., Am Hof"}], []),
            "car_sharing": ("CARSHARINGOGD.json", [{"ADRESSE": "1., Am Hof"}], []),
        },
    ),
    "washington": (
        (-77.03, 38.90),
        {
            "trees": (
                "Urban_Forestry_Street_Trees.geojson",
                [{"SCI_NM": "Quercus rubra", "CONDITION": "Good"}],
                [{"SCI_NM": None, "CONDITION": None}],
            ),
            "street_lights": ("Street_Lights.geojson", [{"FACILITYID": "SL-1"}], []),
            "traffic_lights": ("Traffic_Signals.geojson", [{"INTERSECTIONKEY": "a"}], []),
            "signal_cabinets": ("Signal_Cabinets.geojson", [{"OBJECTID": 1}], []),
        },
    ),
    "melbourne": (
        (144.96, -37.81),
        {
            "trees": (
                "trees-with-species-and-dimensions-urban-forest.geojson",
                [{"com_id": "1022794", "located_in": "Street"}],
                [],
            ),
            "street_lights": ("street-lights-with-emitted-lux-level.geojson", [{"label": 8}], []),
            "furniture": (
                "street-furniture-including-bollards-bicycle-rails-bins.geojson",
                [{"asset_type": kind} for kind in ("Seat", "Bollard", "Litter Bin")],
                [{"asset_type": "Bicycle Rails"}, {"asset_type": "Planter Box"}],
            ),
            "drinking_fountains": ("drinking-fountains.geojson", [{"description": "Metal"}], []),
            "toilets": ("public-toilets.geojson", [{"name": "Public Toilet"}], []),
        },
    ),
    "new_york": (
        (-73.98, 40.75),
        {
            "trees": (
                "uvpi-gqnh.csv",
                [{"tree_id": 1, "status": "Alive"}],
                [{"tree_id": 2, "status": "Dead"}, {"tree_id": 3, "status": "Stump"}],
            ),
            "benches": ("esmy-s8q5.geojson", [{"siteid": "a", "asset_subtype": "Backed"}], []),
            "bus_shelters": ("t4f2-8md7.geojson", [{"shelter_id": "BX01"}], []),
            "drinking_fountains": (
                "qnv7-p7a2.geojson",
                [{"featuresta": "Active"}],
                [{"featuresta": "Inactive"}],
            ),
            "fire_hydrants": ("5bgh-vtsn.geojson", [{"unitid": "H1"}], []),
            "parking_meters": ("693u-uax6.geojson", [{"meter_number": "3"}], []),
            "litter_baskets": ("8znf-7b2c.geojson", [{"baskettype": "S"}], []),
        },
    ),
    "barcelona": (
        (2.17, 41.39),
        {
            "street_trees": ("OD_Arbrat_Viari_BCN.csv", [{"codi": "0000022AR"}], []),
            "square_trees": ("OD_Arbrat_Zona_BCN.csv", [{"codi": "0000023AR"}], []),
            "fountains": ("2025_fonts_beure.csv", [{"codi": "01.01"}], []),
        },
    ),
}  # fmt: skip
AXES = {"new_york": ("longitude", "latitude"), "barcelona": ("longitud", "latitud")}


def write(path: Path, rows: list[dict[str, Any]], axes: tuple[str, str], places: Any) -> None:  # noqa: ANN401
    """Write rows at places, as GeoJSON or CSV."""
    if path.suffix == ".csv":
        with path.open("w", encoding="utf-8", newline="") as stream:
            table = csv.DictWriter(stream, [*rows[0], *axes])
            table.writeheader()
            table.writerows(
                {**row, **dict(zip(axes, xy, strict=True))}
                for row, xy in zip(rows, places, strict=False)
            )
        return
    features = [
        {"type": "Feature", "properties": row, "geometry": {"type": "Point", "coordinates": xy}}
        for row, xy in zip(rows, places, strict=False)
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), "utf-8")


@pytest.mark.parametrize("name", CITIES)
def test_documented_rows_become_objects(name: str, tmp_path: Path) -> None:
    catalog = load_catalog(name)
    (x, y), layers = CITIES[name]
    places = ((x + n * 1e-4, y + m * 1e-4) for m in range(20) for n in range(5))
    for file, good, bad in layers.values():
        write(tmp_path / file, [*good, *bad], AXES.get(name, ("x", "y")), places)
    found, absent = read_files(choose_layers(catalog), [tmp_path])
    assert not absent
    assert {layer.spec.name: layer.counts.kept for layer in found} == {
        layer: len(good) for layer, (_, good, _) in layers.items()
    }
    assert not any(layer.errors for layer in found)
    loaded = assemble(found, catalog)  # in the catalogue's CRS, which suits the place
    assert len(loaded.objects) == sum(len(good) for _, good, _ in layers.values())
    assert loaded.objects.crs.to_string() == catalog.metric_crs
    assert not loaded.notes


@pytest.mark.parametrize("name", CITIES)
def test_a_catalogue_says_what_was_checked(name: str) -> None:
    catalog = load_catalog(name)
    assert catalog.endpoints
    assert "unknown" not in {spec.license for spec in catalog.layers}
    assert all(spec.attribution for spec in catalog.layers)
    text = (data_folder() / f"{name}.toml").read_text("utf-8")
    assert re.search(r"# Checked on \d{4}-\d\d-\d\d", text)
    assert "Not checked: " in text.replace("\n# ", " ")
