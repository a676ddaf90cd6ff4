"""Services that send pages, each simulated by a local server."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import pytest
import shapely
from geojson import collection
from raw_layers import ids, xy
from sentences import refused
from servers import Answer
from stand_ins import (
    PLACES,
    ROWS,
    STAND_INS,
    ArcGIS,
    Ckan,
    OgcFeatures,
    Socrata,
    Wfs,
    WfsOfGml,
    features,
    sent,
)

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources import Area, HttpError, LayerSpec, PagingError, parse_area
from semsig_gis.sources.services.fetch import fetch_layers

if TYPE_CHECKING:
    from collections.abc import Callable

    from servers import Server
    from stand_ins import StandIn

    from semsig_gis.sources import Cache, Download, HttpSpec, RawLayer

    Fetch = Callable[..., Download]

LAMPS = LayerSpec(name="lamps", class_name="street_light", id_field="objectid")
NEAR = Area(shapely.box(2.355, 48.8, 2.385, 48.9), "a box")


@pytest.fixture(params=STAND_INS, ids=lambda kind: kind.__name__)
def service(request: pytest.FixtureRequest, server: Server) -> StandIn:
    stand_in: StandIn = request.param(server)
    return stand_in


@pytest.fixture
def fetched(cache: Cache, quick: HttpSpec) -> Fetch:
    """Fetch the layer of a stand-in."""

    def call(service: StandIn, layer: LayerSpec = LAMPS, **options: Any) -> Download:  # noqa: ANN401
        layer = replace(layer, dataset=layer.dataset or service.dataset)
        arguments = {"endpoints": [service.endpoint], "cache": cache, "spec": quick, **options}
        module = import_module(f"semsig_gis.sources.readers.{service.reader}")
        (download,) = fetch_layers(module.fetch_layer, [layer], **arguments)
        return download

    return call


def test_pages_become_one_layer_and_are_cached(
    service: StandIn, fetched: Fetch, quick: HttpSpec
) -> None:
    steps: list[tuple[int, int]] = []
    download = fetched(service, progress=lambda rows, total: steps.append((rows, total)))
    layer = download.read()
    assert (ids(layer), xy(layer)) == (["11", "12", "13", "14", "15"], PLACES)
    assert (layer.table.crs, layer.errors, layer.notes) == ("EPSG:4326", (), ())
    assert len(download.files) == len(service.page_requests()) == 3
    assert steps == [(2, 5), (4, 5), (5, 5)]
    requests = len(service.server.requests)
    again = fetched(service, spec=replace(quick, offline=True))
    assert len(service.server.requests) == requests
    assert ids(again.read()) == ids(layer)


def test_service_selects_the_area(service: StandIn, fetched: Fetch) -> None:
    layer = fetched(service, area=NEAR).read()
    if not service.cuts:
        assert layer.counts.read == 5
        return
    assert (ids(layer), layer.counts.read) == (["12", "13", "14"], 3)
    nowhere = Area(shapely.box(7.0, 48.0, 7.1, 48.1), "elsewhere")
    layer = fetched(service, area=nowhere).read()  # which is no fault, and has all fields
    assert (layer.counts.read, layer.notes) == (0, ("the layer has no rows",))


def test_area_across_180_degrees_is_two_boxes(server: Server, fetched: Fetch) -> None:
    service = ArcGIS(server)
    service.rows = [{**ROWS[0], "xy": (179.95, 1.0)}, {**ROWS[1], "xy": (-179.95, 1.0)}]
    layer = fetched(service, area=parse_area("179.9,0,-179.9,2")).read()
    assert (ids(layer), len(service.page_requests())) == (["11", "12"], 2)


def test_interrupted_run_continues_at_the_next_page(service: StandIn, fetched: Fetch) -> None:
    service.whole = 2
    with refused(HttpError, "layer 'lamps'", "503", "try again later"):
        fetched(service)
    service.whole = None
    before = len(service.page_requests())
    assert ids(fetched(service).read()) == ["11", "12", "13", "14", "15"]
    assert len(service.page_requests()) == before + 1


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"circles": True}, ["sends the same page again after 2 rows"]),
        ({"surplus": 1}, ["sends 5 rows where it announced 6"]),
        ({"surplus": -2}, ["sends 4 rows where it announced 3"]),
    ],
)
def test_inconsistent_pages_are_refused_and_fetched_again(
    service: StandIn, fetched: Fetch, *, fault: dict[str, Any], words: list[str]
) -> None:
    for name, value in fault.items():
        setattr(service, name, value)
    with refused(PagingError, "layer 'lamps'", "127.0.0.1", "run it again", *words):
        fetched(service)
    for name, value in fault.items():
        setattr(service, name, type(value)())
    assert ids(fetched(service).read()) == ["11", "12", "13", "14", "15"]


@pytest.mark.parametrize(
    ("page", "error", "words"),
    [
        (Answer(b"<!DOCTYPE html><html></html>", type="text/html"), SourceError, ["layer 'lamps'"]),
        (Answer(b"{}"), SourceError, ["address"]),
        (Answer(b'"what?"'), SourceError, ["address"]),
        (Answer(b'{"message": "Log in."}', status=403), HttpError, ["403", "(Log in)"]),
    ],
)
def test_answer_that_is_not_a_page_is_an_error(
    service: StandIn, fetched: Fetch, *, page: Answer, error: type[Exception], words: list[str]
) -> None:
    service.page = page
    with refused(error, *words):
        fetched(service)


def test_truncated_page_is_requested_again(service: StandIn, fetched: Fetch) -> None:
    service.page = Answer(service.half)
    with refused(HttpError, "layer 'lamps'", "not whole", "3 times"):
        fetched(service)


def test_unknown_dataset_is_an_error_with_the_known_ones(service: StandIn, fetched: Fetch) -> None:
    with refused(CatalogError, "'lamps'", "`dataset`", "127.0.0.1", *service.others):
        fetched(service, replace(LAMPS, dataset=service.wrong))


def test_only_needed_fields_are_requested(service: StandIn, fetched: Fetch) -> None:
    layer = replace(LAMPS, select=("Note",), where=(("kind", ("lamp",)),))
    lamps = fetched(service, layer).read()
    assert ids(lamps) == ["11", "13", "15"]
    assert lamps.counts.filtered == 2
    with refused(CatalogError, "'noot'", "select", "'NOTE'"):
        fetched(service, replace(LAMPS, select=("noot",)))


def test_service_filters_rows_and_states_its_terms(service: StandIn, fetched: Fetch) -> None:
    lamps = replace(LAMPS, server_where=service.only_lamps)
    layer = fetched(service, lamps).read()
    assert (ids(layer), layer.spec.terms) == (["11", "13", "15"], service.terms)
    if service.cuts:
        near = fetched(service, lamps, area=NEAR).read()
        assert (ids(near), near.counts.read) == (["13"], 1)


# --- ArcGIS -----------------------------------------------------------------------------------


def test_terms_of_the_catalogue_have_priority(server: Server, fetched: Fetch) -> None:
    service = ArcGIS(server)
    ours = replace(LAMPS, license="CC0", attribution="Us")
    assert fetched(service, ours).read().spec.terms == "Us (CC0)"
    with refused(HttpError, "layer 'lamps'", "Invalid query parameters", "'where' clause is"):
        fetched(service, replace(LAMPS, server_where="KIND=lamp"))


def test_old_arcgis_server_sends_esri_json(server: Server, fetched: Fetch) -> None:
    service = ArcGIS(server)
    service.geojson = False
    layer = fetched(service).read()
    assert (ids(layer), xy(layer)) == (["11", "12", "13", "14", "15"], PLACES)


def test_arcgis_server_without_paging_sends_one_page(server: Server, fetched: Fetch) -> None:
    service = ArcGIS(server)
    service.paging = False
    few = Area(shapely.box(2.355, 48.8, 2.375, 48.9), "a box")
    assert ids(fetched(service, area=few).read()) == ["12", "13"]


@pytest.mark.parametrize(
    ("geometry", "texts"),
    [
        ({"x": 1, "y": 2, "z": 3}, ["POINT (1 2)"]),
        ({"x": "NaN", "y": None}, [None]),
        ({"points": [[1, 2], [3, 4]]}, ["POINT (1 2)", "POINT (3 4)"]),
        ({"paths": [[[0, 0], [1, 1, 5]]]}, ["MULTILINESTRING ((0 0, 1 1))"]),
        (
            {"rings": [[[0, 0], [0, 4], [4, 4], [0, 0]], [[1, 2], [1, 3], [2, 3], [1, 2]]]},
            ["POLYGON ((0 0, 0 4, 4 4, 0 0), (1 2, 2 3, 1 3, 1 2))"],
        ),
        ({"rings": []}, [None]),
    ],
)
def test_esri_geometries_are_read(
    read_as: Callable[..., RawLayer], geometry: dict[str, Any], texts: list[str | None]
) -> None:
    rows = [{"attributes": {"a": 1}, "geometry": geometry}]
    content = {"spatialReference": {"wkid": 102100, "latestWkid": 3857}, "features": rows}
    layer = read_as("a.json", content, replace(LAMPS, id_field=None))
    assert layer.table.crs == "EPSG:3857"
    for shape, text in zip(layer.table.geometry, texts, strict=True):
        assert (shape is None) == (text is None)
        assert text is None or shape.equals(shapely.from_wkt(text))


def test_arcgis_errors_come_with_status_200(server: Server, fetched: Fetch) -> None:
    service = ArcGIS(server)
    path = "/arcgis/rest/services/Parks/FeatureServer"
    server.on(path, sent({"error": {"code": 400, "message": "Invalid URL", "details": []}}))
    with refused(HttpError, "'lamps'", "the error Invalid URL", "`dataset`"):
        fetched(service, replace(LAMPS, dataset="Parks/FeatureServer/0"))
    with refused(CatalogError, "'lamps'", "'Parks'", "FeatureServer/LAYER"):
        fetched(service, replace(LAMPS, dataset="Parks"))


def test_arcgis_may_be_busy_and_send_an_empty_page_before_the_last(
    server: Server, fetched: Fetch, slept: list[float]
) -> None:
    service = ArcGIS(server)
    path = "/arcgis/rest/services/Street/FeatureServer/0/query"
    busy = sent({"error": {"code": 503, "message": "Service is busy"}})
    empty = sent({"features": [], "exceededTransferLimit": True})
    rest = sent(collection(features(ROWS)))
    server.on(path, sent({"count": 5}), busy, empty, rest)
    assert ids(fetched(service).read()) == ["11", "12", "13", "14", "15"]
    assert (len(slept), service.page_requests()[-1].query["resultOffset"]) == (1, "2")


# --- WFS --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [Wfs, WfsOfGml])
def test_refused_filter_of_a_wfs_is_an_error(
    server: Server, fetched: Fetch, kind: type[Wfs]
) -> None:
    with refused(HttpError, "layer 'lamps'", "400", "(No such property)"):
        fetched(kind(server), replace(LAMPS, server_where=Wfs.only_lamps.replace("lamp<", "x<")))


def test_wfs_without_natural_order_and_id_field_may_send_one_page(
    server: Server, fetched: Fetch
) -> None:
    service = Wfs(server)
    service.rows = service.rows[:2]  # which fit in one page
    assert len(fetched(service, replace(LAMPS, id_field=None), area=NEAR).read().table) == 1


def test_wfs_without_paging_sends_all_rows(server: Server, fetched: Fetch) -> None:
    service = WfsOfGml(server)
    service.limit = 5
    service.constraints = (("ImplementsResultPaging", "FALSE"), ("ImplementsSorting", "FALSE"))
    layer = fetched(service, replace(LAMPS, id_field="id")).read()
    assert ids(layer) == [f"lamps.{number}" for number in range(11, 16)]


def test_exchanged_axes_of_a_wfs_are_corrected(server: Server, fetched: Fetch) -> None:
    service = Wfs(server)
    service.turned = True
    layer = fetched(service, area=NEAR).read()
    assert xy(layer) == PLACES[1:4]
    assert layer.notes == ("the service sends latitude as x and longitude as y; exchanged here",)


def test_answer_that_is_not_a_wfs_is_an_error(server: Server, fetched: Fetch) -> None:
    service = Wfs(server)
    for answer, words in [
        (
            Answer(b"<WMS_Capabilities/>"),
            ["not a Web Feature Service", "(it sent WMS_Capabilities)"],
        ),
        (Answer(b"<WFS_Capabilities version='1.1.0'/>"), ["(it sent WFS_Capabilities 1.1.0)"]),
        (Answer(b"<!DOCTYPE html><html></html>"), ["a web page", "XML"]),
        (Answer(b"<r version='2'><ServiceException>No.</ServiceException></r>"), ["error No to"]),
    ]:
        server.on("/wfs", answer)
        with refused(SourceError, "127.0.0.1", "/wfs", *words):
            fetched(service)


# --- OGC API - Features -----------------------------------------------------------------------


def test_ogc_features_have_ids_of_their_own(server: Server, fetched: Fetch) -> None:
    layer = fetched(OgcFeatures(server), replace(LAMPS, id_field="id")).read()
    assert ids(layer) == ["11", "12", "13", "14", "15"]


# --- CKAN -------------------------------------------------------------------------------------


FILE = collection(features(ROWS))
CSV = {"format": "csv", "url": "files/lamps_2023.csv", "created": "2023-05-01T00:00:00"}
NEWER = {"format": "CSV", "url": "files/lamps_2024.csv", "created": "2024-05-01T00:00:00"}


@pytest.mark.parametrize(
    "case",
    [
        ([CSV, {"format": "GeoJSON", "url": "/files/lamps.geojson"}], (), "lamps.geojson"),
        ([CSV, {"format": "", "url": "/files/lamps.geojson?a=b"}], ("*.CSV",), "lamps_2023.csv"),
        ([NEWER, CSV], ("lamps_*",), "lamps_2024.csv"),
        ([CSV, {"format": "PDF", "url": "/files/a.pdf"}], (), "lamps_2023.csv"),
    ],
)
def test_ckan_file_has_the_best_format(
    server: Server, fetched: Fetch, case: tuple[Any, ...]
) -> None:
    service = Ckan(server)
    service.resources, files, expected = case
    table = "OBJECTID,KIND,lon,lat\n" + "".join(
        f"{row['OBJECTID']},{row['KIND']},{row['xy'][0]},{row['xy'][1]}\n" for row in ROWS
    )
    for name in ("lamps_2023.csv", "lamps_2024.csv"):
        server.on(f"/files/{name}", Answer(table.encode(), type="text/csv"))
    server.on("/files/lamps.geojson", sent(FILE))
    layer = fetched(service, replace(LAMPS, files=files)).read()
    assert (ids(layer), xy(layer)) == (["11", "12", "13", "14", "15"], PLACES)
    assert server.paths()[-1] == f"/files/{expected}"


def test_file_may_be_on_another_host_of_the_catalogue(server: Server, fetched: Fetch) -> None:
    service = Ckan(server)
    service.resources = [{"format": "GeoJSON", "url": "/files/lamps.geojson"}]
    there = {"Location": f"{server.other_host}/store/lamps.geojson"}
    server.on("/files/lamps.geojson", Answer(status=302, headers=there))
    server.on("/store/lamps.geojson", sent(FILE))
    with refused(SourceError, "redirects to localhost", "the catalogue"):
        fetched(service)
    both = [service.endpoint, server.other_host]
    assert ids(fetched(service, endpoints=both).read()) == ["11", "12", "13", "14", "15"]
    service.resources = [{"format": "GeoJSON", "url": there["Location"]}]
    direct = replace(LAMPS, name="others")
    assert len(fetched(service, direct, endpoints=both).read().table) == 5


LIMITED = {"server_where": "KIND = 'lamp'"}
PDF = {"format": "PDF", "url": "/files/map.pdf"}
FAR = {**CSV, "url": "http://far.example/a.csv"}
# A service, its attributes, those of the layer, and the error.
UNUSABLE: list[tuple[type[StandIn], dict[str, Any], dict[str, Any], type[Exception], list[str]]] = [
    (OgcFeatures, {"filters": ""}, LIMITED, CatalogError, ["127.0.0.1", "accepts no filter"]),
    (OgcFeatures, {"conforms": ()}, {}, SourceError,
     ["127.0.0.1", "OGC API - Features", "address", "/ogc"]),
    (OgcFeatures, {"next_host": "http://elsewhere.example/x"}, {}, SourceError,
     ["127.0.0.1", "elsewhere", "endpoints"]),
    (Ckan, {"resources": [PDF]}, {}, CatalogError, ["'lamps'", "no resource", "map.pdf"]),
    (Ckan, {"resources": [CSV, NEWER]}, {}, CatalogError,
     ["several", "lamps_2023.csv", "`files`"]),
    (Ckan, {"resources": [CSV]}, {"server_where": "{}"}, CatalogError,
     ["'lamps'", "datastore", "`where`"]),
    (Ckan, {"resources": [CSV]}, {}, SourceError, ["a web page", "/files/lamps_2023.csv"]),
    (Ckan, {"resources": [FAR]}, {}, SourceError, ["far.example", "endpoi"]),
    (ArcGIS, {"paging": False}, {}, SourceError,
     ["'lamps'", "sends 2 rows at most", "smaller area"]),
    (Wfs, {}, {"id_field": None}, HttpError,
     ["layer 'lamps'", "(Cannot do natural order, Add a key)"]),
]  # fmt: skip


@pytest.mark.parametrize("case", UNUSABLE)
def test_unsupported_request_or_unusable_dataset_is_an_error(
    server: Server, fetched: Fetch, case: tuple[Any, ...]
) -> None:
    kind, change, layer, error, words = case
    service = kind(server)
    for name, value in change.items():
        setattr(service, name, value)
    server.on("/files/lamps_2023.csv", Answer(b"<html>Moved</html>", type="text/html"))
    with refused(error, *words):
        fetched(service, replace(LAMPS, **layer))


# --- Socrata ----------------------------------------------------------------------------------


@pytest.mark.parametrize("place", ["point", "multipolygon", "location", ""])
def test_socrata_positions_are_read(server: Server, fetched: Fetch, place: str) -> None:
    service = Socrata(server)
    service.place = place
    lamps = replace(LAMPS, server_where=service.only_lamps)
    layer = fetched(service, lamps, area=NEAR).read()
    assert (ids(layer), xy(layer), layer.counts.read) == (["13"], [PLACES[2]], 1)
    selection = replace(LAMPS, select=("KIND",), x_field="LON", y_field="LAT")
    assert xy(fetched(service, selection).read()) == PLACES
    with_alias = replace(LAMPS, aliases=(("geo_shape", ("the_place",)),))
    assert xy(fetched(service, with_alias).read()) == PLACES


@pytest.mark.parametrize(
    "text",
    [
        'OBJECTID,the_geom\n7,"POINT (2.35 48.85)"\n',
        'OBJECTID,Location\n7,"(48.85, 2.35)"\n',
        "OBJECTID,Longitude,Latitude\n7,2.35,48.85\n",
        '[{"OBJECTID": "7", "location": {"latitude": "48.85", "longitude": "2.35"}}]',
        '{"result": {"total": 1, "records": [{"OBJECTID": 7, "lon": "2.35", "lat": "48.85"}]}}',
        '{"features": [{"attributes": {"OBJECTID": 7}, "geometry": {"x": 2.35, "y": 48.85}}]}',
    ],
)
def test_file_downloaded_by_hand_is_read(read_as: Callable[..., RawLayer], text: str) -> None:
    spec = replace(LAMPS, aliases=(("geo_point_2d", ("location",)),))
    layer = read_as("a.csv" if text[0] == "O" else "a.json", text, spec, by="socrata")
    assert (ids(layer), xy(layer), layer.notes) == (["7"], [(2.35, 48.85)], ())
