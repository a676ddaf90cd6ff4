"""Open data of cities: rows with the schema of each city, as files and as services."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

from geojson import collection, feature, point
from servers import Answer
from stand_ins import sent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from geojson import Feature
    from servers import Request, Server

    from semsig_gis.sources import LayerSpec

# For each city a place in it, and for each layer the name of its file, the rows that the catalogue
# keeps, and the rows that it filters out. A CSV file has its positions in fields, too.
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
    "hamburg": (
        (9.99, 53.55),
        {"trees": ("strassenbaumkataster_hh.geojson", [{"gid": 7, "gattung": "Tilia"}], [])},
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


def features_of(name: str) -> dict[str, list[Feature]]:
    """Return the features of each layer of a city, good and bad, each at a place of its own."""
    (x, y), layers = CITIES[name]
    places = ((x + n * 1e-4, y + m * 1e-4) for m in range(20) for n in range(5))
    return {
        layer: [feature(point(*next(places)), row) for row in (*good, *bad)]
        for layer, (_, good, bad) in layers.items()
    }


def as_csv(features: Iterable[Feature], axes: tuple[str, str]) -> str:
    """Return features as a table with their positions in two columns."""
    rows = [
        {**f["properties"], **dict(zip(axes, f["geometry"]["coordinates"], strict=True))}
        for f in features
    ]
    stream = io.StringIO()
    table = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return stream.getvalue()


def write_files(name: str, folder: Path) -> None:
    """Write the files of a city, as they are downloaded."""
    for layer, features in features_of(name).items():
        path = folder / CITIES[name][1][layer][0]
        is_table = path.suffix == ".csv"
        text = as_csv(features, AXES[name]) if is_table else json.dumps(collection(features))
        path.write_text(text, "utf-8")


def serve(server: Server, name: str, reader: str, specs: Iterable[LayerSpec]) -> str:
    """Publish the layers of a city as its service would; return the address of the service."""
    features = features_of(name)
    datasets = {
        spec.dataset: features[spec.name]
        for spec in specs
        if spec.dataset and spec.name in features
    }
    return SERVICES[reader](server, datasets, AXES.get(name, ("x", "y")))


Datasets = dict[str, "list[Feature]"]


def _fields(features: Iterable[Feature]) -> list[str]:
    return list(dict.fromkeys(key for item in features for key in item["properties"]))


def _opendatasoft(server: Server, datasets: Datasets, _: tuple[str, str]) -> str:
    for dataset, features in datasets.items():
        path = f"/api/explore/v2.1/catalog/datasets/{dataset}"
        fields = [{"name": field, "type": "text"} for field in _fields(features)]
        fields.append({"name": "geo_point_2d", "type": "geo_point_2d"})
        server.on(path, sent({"fields": fields}))
        server.on(f"{path}/exports/geojson", sent(collection(features)))
    return server.url


def _arcgis(server: Server, datasets: Datasets, _: tuple[str, str]) -> str:
    root = "/arcgis/rest/services"
    for service in {dataset.rpartition("/")[0] for dataset in datasets}:
        numbers = [name.rpartition("/")[2] for name in datasets if name.startswith(service)]
        layers = [{"id": int(number), "name": f"layer {number}"} for number in numbers]
        server.on(f"{root}/{service}", sent({"layers": layers}))
    for dataset, features in datasets.items():
        path = f"{root}/{dataset}"
        fields = [{"name": name, "type": "esriFieldTypeString"} for name in _fields(features)]
        about = {
            "type": "Feature Layer",
            "maxRecordCount": 2000,
            "supportedQueryFormats": "JSON, geoJSON",
            "advancedQueryCapabilities": {"supportsPagination": True},
            "fields": fields,
        }

        def query(request: Request, features: list[Feature] = features) -> Answer:
            if "returnCountOnly" in request.query:
                return sent({"count": len(features)})
            return sent(collection(features), type="application/geo+json")

        server.on(path, sent({**about, "id": int(dataset.rpartition("/")[2])}))
        server.on(f"{path}/query", query)
    return f"{server.url}{root}"


def _wfs(server: Server, datasets: Datasets, _: tuple[str, str]) -> str:
    names = "".join(f"<FeatureType><Name>{name}</Name></FeatureType>" for name in datasets)
    capabilities = (
        f'<WFS_Capabilities version="2.0.0"><Operation name="GetFeature"><Parameter '
        f'name="outputFormat"><Value>application/json</Value></Parameter></Operation>'
        f"<FeatureTypeList>{names}</FeatureTypeList></WFS_Capabilities>"
    )

    def answer(request: Request) -> Answer:
        query = request.query
        if query["request"] == "GetCapabilities":
            return Answer(capabilities.encode(), type="text/xml")
        features = datasets[query.get("typeNames") or query["typeName"]]
        if query.get("resultType") == "hits":
            text = f'<FeatureCollection numberMatched="{len(features)}" numberReturned="0"/>'
            return Answer(text.encode(), type="text/xml")
        if query["request"] == "GetFeature":
            return sent(collection(features, numberMatched=len(features)))
        fields = "".join(f'<element name="{n}" type="xsd:string"/>' for n in _fields(features))
        place = '<element name="SHAPE" type="gml:PointPropertyType"/>'
        schema = "http://www.w3.org/2001/XMLSchema"
        text = (
            f'<schema xmlns="{schema}"><complexType><complexContent><extension><sequence>'
            f"{place}{fields}</sequence></extension></complexContent></complexType></schema>"
        )
        return Answer(text.encode(), type="text/xml")

    server.on("/wfs", answer)
    return f"{server.url}/wfs"


def _socrata(server: Server, datasets: Datasets, axes: tuple[str, str]) -> str:
    geometries = {"693u-uax6": "location", "8znf-7b2c": "point", "uvpi-gqnh": ""}
    for dataset, features in datasets.items():
        place = geometries.get(dataset, "the_geom")
        columns = [{"fieldName": name, "dataTypeName": "text"} for name in _fields(features)]
        if place:
            columns.append({"fieldName": place, "dataTypeName": "point"})
        else:
            columns += [{"fieldName": name, "dataTypeName": "number"} for name in axes]
        rows = list(csv.DictReader(io.StringIO(as_csv(features, axes))))

        def table(
            request: Request, rows: list[dict[str, str]] = rows, features: list[Feature] = features
        ) -> Answer:
            if request.query.get("$select") == "count(*)":
                return sent([{"count": str(len(features))}])
            return sent(rows)

        server.on(f"/api/views/{dataset}.json", sent({"columns": columns}))
        server.on(f"/resource/{dataset}.json", table)
        server.on(f"/resource/{dataset}.geojson", sent(collection(features)))
    return server.url


def _ckan(server: Server, datasets: Datasets, axes: tuple[str, str]) -> str:
    files = {
        "arbrat-viari": "OD_Arbrat_Viari_BCN.csv",
        "arbrat-zona": "OD_Arbrat_Zona_BCN.csv",
        "fonts": "2025_fonts_beure.csv",
    }

    def package(request: Request) -> Answer:
        file = files[request.query["id"]]
        resource = {"id": file, "format": "CSV", "url": f"{server.url}/files/{file}"}
        return sent({"success": True, "result": {"resources": [resource]}})

    server.on("/data/api/3/action/package_show", package)
    for dataset, features in datasets.items():
        body = as_csv(features, axes).encode()
        server.on(f"/files/{files[dataset]}", Answer(body, type="text/csv"))
    return f"{server.url}/data"


def _ogc_features(server: Server, datasets: Datasets, _: tuple[str, str]) -> str:
    core = "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/core"
    server.on("/ogc/conformance", sent({"conformsTo": [core]}))
    for dataset, features in datasets.items():
        path = f"/ogc/collections/{dataset}"
        server.on(path, sent({"id": dataset, "links": []}))
        page = collection(features, numberMatched=len(features), links=[])
        server.on(f"{path}/items", sent(page, type="application/geo+json"))
    return f"{server.url}/ogc"


SERVICES: dict[str, Callable[[Server, Datasets, tuple[str, str]], str]] = {
    "arcgis": _arcgis,
    "ckan": _ckan,
    "ogc_features": _ogc_features,
    "opendatasoft": _opendatasoft,
    "socrata": _socrata,
    "wfs": _wfs,
}
