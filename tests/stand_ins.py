"""Simulated services on this machine: each follows its protocol, with configurable errors."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any
from urllib.parse import urlencode

from geojson import collection, feature, point
from servers import Answer

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from geojson import Feature
    from servers import Request, Server

Row = dict[str, Any]
FIELDS = ("OBJECTID", "KIND", "NOTE")
# Five rows, three of them lamps; all notes are empty.
ROWS: list[Row] = [
    {"OBJECTID": number, "KIND": kind, "NOTE": None, "xy": xy}
    for number, kind, xy in [
        (11, "lamp", (2.35, 48.85)),
        (12, "bench", (2.36, 48.86)),
        (13, "lamp", (2.37, 48.87)),
        (14, "bench", (2.38, 48.88)),
        (15, "lamp", (2.39, 48.89)),
    ]
]
PLACES = [row["xy"] for row in ROWS]


def sent(content: object, **options: Any) -> Answer:  # noqa: ANN401
    """Return an answer of JSON."""
    return Answer(json.dumps(content).encode(), **options)


def properties(row: Row, fields: Sequence[str] = FIELDS) -> Row:
    """Return the fields of a row."""
    return {name: row[name] for name in fields}


def features(rows: Sequence[Row], fields: Sequence[str] = FIELDS) -> list[Feature]:
    """Return rows as GeoJSON."""
    return [feature(point(*row["xy"]), properties(row, fields), id=row["OBJECTID"]) for row in rows]


class StandIn:
    """A service with one layer and two rows per page.

    It reports `surplus` more rows than it has, always sends its first page if it `circles`, sends
    `page` instead of a page if that is set, and fails after `whole` pages.
    """

    reader = ""
    dataset = ""
    wrong = ""
    # The names in the answer to a wrong `dataset`.
    others: tuple[str, ...] = ()
    # The filter of the service that selects lamps, and the terms that it states.
    only_lamps = "KIND = 'lamp'"
    terms = ""
    limit = 2
    # Whether it can clip to an area.
    cuts = True
    # The beginning of a page.
    half = b'{"features": [{"type"'

    def __init__(self, server: Server) -> None:
        self.server = server
        self.surplus = 0
        self.circles = False
        self.page: Answer | None = None
        self.whole: int | None = None
        self.rows = ROWS
        self.start()

    @property
    def endpoint(self) -> str:
        return self.server.url

    def start(self) -> None:
        raise NotImplementedError

    def failure(self) -> Answer | None:
        """Return the answer instead of the requested page, if any."""
        if self.whole is not None and len(self.page_requests()) > self.whole:
            return Answer(status=503)
        return self.page

    def part(self, rows: Sequence[Row], start: object, count: object) -> Sequence[Row]:
        begin = 0 if self.circles else int(str(start))
        return rows[begin : begin + min(int(str(count)), self.limit)]

    def inside(self, west: float, south: float, east: float, north: float) -> list[Row]:
        return [
            row
            for row in self.rows
            if west <= row["xy"][0] <= east and south <= row["xy"][1] <= north
        ]

    def page_requests(self) -> list[Request]:
        """Return the requests for pages, in order."""
        return [request for request in self.server.requests if self.is_page(request)]

    def is_page(self, request: Request) -> bool:
        raise NotImplementedError


class ArcGIS(StandIn):
    reader = "arcgis"
    dataset = "Street/FeatureServer/Lamps"
    wrong = "Street/FeatureServer/Lampposts"
    others = ("0 (Lamps)", "3 (Kerbs)")
    only_lamps = "KIND='lamp'"
    terms = "City of Somewhere (unknown)"
    geojson = True
    paging = True

    def start(self) -> None:
        path = "/arcgis/rest/services/Street/FeatureServer"
        layers = [{"id": 0, "name": "Lamps"}, {"id": 3, "name": "Kerbs"}]
        self.server.on(path, sent({"layers": layers, "tables": []}, type="text/plain"))
        self.server.on(f"{path}/0", self.description)
        self.server.on(f"{path}/0/query", self.query)

    @property
    def endpoint(self) -> str:
        return f"{self.server.url}/arcgis/rest/services/"

    def description(self, request: Request) -> Answer:
        assert request.query == {"f": "json"}
        return sent(
            {
                "id": 0,
                "name": "Lamps",
                "type": "Feature Layer",
                "geometryType": "esriGeometryPoint",
                "copyrightText": "City of  Somewhere",
                "maxRecordCount": self.limit,
                "supportedQueryFormats": "JSON, geoJSON, PBF" if self.geojson else "JSON",
                "advancedQueryCapabilities": {"supportsPagination": self.paging},
                "objectIdField": "OBJECTID",
                "fields": [{"name": name, "type": "esriFieldTypeString"} for name in FIELDS],
            }
        )

    def is_page(self, request: Request) -> bool:
        return request.path.endswith("/query") and "returnCountOnly" not in request.query

    def query(self, request: Request) -> Answer:
        query = request.query
        assert query["outSR"] == "4326"
        rows: Sequence[Row] = self.rows
        if "geometry" in query:
            assert query["geometryType"] == "esriGeometryEnvelope"
            assert (query["inSR"], query["spatialRel"]) == ("4326", "esriSpatialRelIntersects")
            west, south, east, north = map(float, query["geometry"].split(","))
            rows = self.inside(west, south, east, north)
        if query["where"] == self.only_lamps:
            rows = [row for row in rows if row["KIND"] == "lamp"]
        elif query["where"] != "1=1":
            details = ["'where' clause is invalid"]
            message = "Cannot perform query. Invalid query parameters."
            return sent({"error": {"code": 400, "message": message, "details": details}})
        if query.get("returnCountOnly") == "true":
            return sent({"count": len(rows) + self.surplus})
        if (failure := self.failure()) is not None:
            return failure
        if self.paging:
            assert query["orderByFields"] == "OBJECTID"
        start, count = query.get("resultOffset", 0), query.get("resultRecordCount", self.limit)
        some = self.part(rows, start, count)
        more = self.circles or int(start) + len(some) < len(rows)
        names = FIELDS if query["outFields"] == "*" else query["outFields"].split(",")
        if query["f"] == "geojson":
            more_rows = {"properties": {"exceededTransferLimit": True}} if more else {}
            content = collection(features(some, names), **more_rows)
            return sent(content, type="application/geo+json")
        content = {
            "geometryType": "esriGeometryPoint",
            "spatialReference": {"wkid": 4326, "latestWkid": 4326},
            "features": [
                {
                    "attributes": properties(row, names),
                    "geometry": dict(zip("xy", row["xy"], strict=True)),
                }
                for row in some
            ],
        }
        return sent(content | ({"exceededTransferLimit": True} if more else {}))


WFS_NAMES = (
    'xmlns:wfs="http://www.opengis.net/wfs/2.0" xmlns:gml="http://www.opengis.net/gml/3.2" '
    'xmlns:ows="http://www.opengis.net/ows/1.1" xmlns:city="http://city.example"'
)
EXCEPTION = (
    '<?xml version="1.0" encoding="UTF-8"?><ows:ExceptionReport version="2.0.0" '
    'xmlns:ows="http://www.opengis.net/ows/1.1"><ows:Exception exceptionCode="{}">'
    "<ows:ExceptionText>{}</ows:ExceptionText></ows:Exception></ows:ExceptionReport>"
)


class Wfs(StandIn):
    """Its GeoJSON has x first; of what is named by a URN, latitude is first."""

    reader = "wfs"
    dataset = "lamps"
    wrong = "city:lampposts"
    others = ("city:lamps", "city:kerbs")
    only_lamps = (
        "<fes:PropertyIsEqualTo><fes:ValueReference>KIND</fes:ValueReference>"
        "<fes:Literal>lamp</fes:Literal></fes:PropertyIsEqualTo>"
    )
    terms = "City of Somewhere (CC BY 4.0)"
    formats: tuple[str, ...] = ("text/xml; subtype=gml/3.2", "application/json; subtype=geojson")
    constraints: tuple[tuple[str, str], ...] = (("CountDefault", "2"),)
    turned = False

    def start(self) -> None:
        self.server.on("/wfs", self.answer)

    @property
    def endpoint(self) -> str:
        return f"{self.server.url}/wfs"

    def is_page(self, request: Request) -> bool:
        query = request.query
        return query.get("request") == "GetFeature" and query.get("resultType") != "hits"

    def answer(self, request: Request) -> Answer:
        query = request.query
        assert (query["service"], query["version"]) == ("WFS", "2.0.0")
        if query["request"] == "GetCapabilities":
            return self.capabilities()
        description = query["request"] == "DescribeFeatureType"
        assert query["typeName" if description else "typeNames"] == "city:lamps"
        if description:
            return self.schema()
        rows = self.matching_rows(query)
        return rows if isinstance(rows, Answer) else self.get_features(query, rows)

    def get_features(self, query: Mapping[str, str], rows: Sequence[Row]) -> Answer:
        total = str(len(rows) + self.surplus)
        if query.get("resultType") == "hits":
            return self.collection((), total)
        if (failure := self.failure()) is not None:
            return failure
        names = query.get("propertyName", f"geom,{','.join(FIELDS)}").split(",")
        assert "geom" in names
        if self.constraints and "startIndex" in query and query.get("sortBy") != "OBJECTID":
            return self.refusal("NoApplicableCode", "Cannot do natural order. Add a key.")
        some = self.part(rows, query.get("startIndex", 0), query.get("count", len(rows)))
        if query.get("outputFormat") == "application/json; subtype=geojson":
            assert query["srsName"] == "EPSG:4326"
            crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::4326"}}
            listed = features(some, [name for name in names if name != "geom"])
            for item in listed if self.turned else ():
                item["geometry"]["coordinates"].reverse()
            return sent(collection(listed, crs=crs))
        return self.collection(some, total)

    def matching_rows(self, query: Mapping[str, str]) -> Sequence[Row] | Answer:
        if "filter" in query:
            corners = re.findall(r"Corner>([^\s<]+) ([^\s<]+)</", query["filter"])
            (south, west), (north, east) = corners or [("-90", "-180"), ("90", "180")]
            if "<fes:Literal>lamp</fes:Literal>" not in query["filter"]:
                return self.refusal("OperationParsingFailed", "No such property.")
            rows = self.inside(*map(float, (west, south, east, north)))
            return [row for row in rows if row["KIND"] == "lamp"]
        if "bbox" not in query:
            return self.rows
        south, west, north, east, crs = query["bbox"].split(",")
        assert crs == "urn:ogc:def:crs:EPSG::4326"
        return self.inside(*map(float, (west, south, east, north)))

    @staticmethod
    def refusal(code: str, text: str) -> Answer:
        return Answer(EXCEPTION.format(code, text).encode(), type="text/xml", status=400)

    def capabilities(self) -> Answer:
        values = "".join(f"<ows:Value>{text}</ows:Value>" for text in self.formats)
        constraints = "".join(
            f'<ows:Constraint name="{name}"><ows:NoValues/>'
            f"<ows:DefaultValue>{value}</ows:DefaultValue></ows:Constraint>"
            for name, value in self.constraints
        )
        text = f"""<?xml version="1.0" encoding="UTF-8"?>
            <wfs:WFS_Capabilities version="2.0.0" {WFS_NAMES}>
            <ows:ServiceIdentification><ows:Fees>none</ows:Fees>
            <ows:AccessConstraints>CC BY 4.0</ows:AccessConstraints></ows:ServiceIdentification>
            <ows:ServiceProvider><ows:ProviderName>City of Somewhere</ows:ProviderName>
            </ows:ServiceProvider><ows:OperationsMetadata><ows:Operation name="GetFeature">
            <ows:Parameter name="outputFormat"><ows:AllowedValues>{values}</ows:AllowedValues>
            </ows:Parameter></ows:Operation>{constraints}</ows:OperationsMetadata>
            <wfs:FeatureTypeList><wfs:FeatureType><wfs:Name>city:lamps</wfs:Name></wfs:FeatureType>
            <wfs:FeatureType><wfs:Name>city:kerbs</wfs:Name></wfs:FeatureType>
            </wfs:FeatureTypeList></wfs:WFS_Capabilities>"""
        return Answer(text.encode(), type="application/xml")

    @staticmethod
    def schema() -> Answer:
        names = "".join(f'<xsd:element name="{name}" type="xsd:string"/>' for name in FIELDS)
        text = f"""<xsd:schema xmlns:xsd="http://www.w3.org/2001/XMLSchema">
            <xsd:complexType name="lampsType"><xsd:complexContent><xsd:extension><xsd:sequence>
            <xsd:element name="geom" type="gml:PointPropertyType"/>{names}
            </xsd:sequence></xsd:extension></xsd:complexContent></xsd:complexType>
            <xsd:element name="lamps" type="city:lampsType"/></xsd:schema>"""
        return Answer(text.encode(), type="text/xml")

    def collection(self, rows: Sequence[Row], count: str) -> Answer:
        members = "".join(
            f"""<wfs:member><city:lamps gml:id="lamps.{row["OBJECTID"]}">
            <city:geom><gml:Point srsName="urn:ogc:def:crs:EPSG::4326">
            <gml:pos>{row["xy"][1]} {row["xy"][0]}</gml:pos></gml:Point></city:geom>
            <city:OBJECTID>{row["OBJECTID"]}</city:OBJECTID><city:KIND>{row["KIND"]}</city:KIND>
            </city:lamps></wfs:member>"""
            for row in rows
        )
        text = f"""<?xml version="1.0" encoding="UTF-8"?><wfs:FeatureCollection {WFS_NAMES}
            numberMatched="{count}"
            numberReturned="{len(rows)}">{members}</wfs:FeatureCollection>"""
        return Answer(text.encode(), type="application/gml+xml; version=3.2")


class WfsOfGml(Wfs):
    """A WFS without GeoJSON."""

    half = b"<FeatureCollection><member>"

    formats = ("application/gml+xml; version=3.2",)


class OgcFeatures(StandIn):
    """Its pages have links to the next ones, on the same address or another; it omits nulls."""

    reader = "ogc_features"
    dataset = "lamps"
    wrong = "lampposts"
    others = ("lamps", "kerbs")
    terms = "no attribution given (https://licence.example/by)"
    conforms: tuple[str, ...] = ("core", "geojson")
    filters = "http://www.opengis.net/spec/ogcapi-features-3/1.0/conf/features-filter"
    next_host = ""

    def start(self) -> None:
        on, path = self.server.on, "/ogc/collections"
        on("/ogc/conformance", self.conformance)
        links = [
            {"rel": "items", "type": "text/html", "href": f"{path}/lamps/items?f=html"},
            {"rel": "items", "type": "application/geo+json", "href": f"{path}/lamps/items?f=x"},
            {"rel": "license", "href": "https://licence.example/by"},
            {
                "rel": "http://www.opengis.net/def/rel/ogc/1.0/queryables",
                "href": f"{self.server.url}{path}/lamps/queryables",
            },
        ]
        on(path, sent({"collections": [{"id": "lamps"}, {"id": "kerbs"}]}))
        on(f"{path}/lamps", sent({"id": "lamps", "links": links}))
        schema = {"type": "object", "properties": {name: {} for name in FIELDS}}
        on(f"{path}/lamps/queryables", sent(schema, type="application/schema+json"))
        on(f"{path}/lamps/items", self.items)

    @property
    def endpoint(self) -> str:
        return f"{self.server.url}/ogc"

    def is_page(self, request: Request) -> bool:
        return request.path.endswith("/items")

    def conformance(self, _: Request) -> Answer:
        base = "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf"
        return sent({"conformsTo": [*(f"{base}/{name}" for name in self.conforms), self.filters]})

    def items(self, request: Request) -> Answer:
        query = request.query
        assert request.headers["accept"].startswith("application/geo+json, ")
        rows: Sequence[Row] = self.rows
        if "bbox" in query:
            rows = self.inside(*map(float, query["bbox"].split(",")))
        if "filter" in query:
            assert (query["filter"], query["filter-lang"]) == (self.only_lamps, "cql2-text")
            rows = [row for row in rows if row["KIND"] == "lamp"]
        if (failure := self.failure()) is not None:
            return failure
        start = int(query.get("offset", 0))
        some = self.part(rows, start, query["limit"])
        listed = features(some)
        for item in listed:
            item["properties"] = {k: v for k, v in item["properties"].items() if v is not None}
        links = [{"rel": "self", "href": request.path}]
        if self.circles or start + len(some) < len(rows):
            next_query = urlencode({**query, "offset": start + len(some)})
            links.append({"rel": "next", "href": f"{self.next_host}?{next_query}"})
        content = collection(
            listed,
            links=links,
            timeStamp=f"2024-01-01T00:00:{len(self.server.requests):02}Z",
            numberMatched=len(rows) + self.surplus,
            numberReturned=len(some),
        )
        return sent(content, type="application/geo+json")


class Ckan(StandIn):
    """Its datastore has coordinates in two fields; it cannot clip to an area."""

    reader = "ckan"
    dataset = "lamps"
    wrong = "lampposts"
    others = ("the nearest is 'lamps'", "kerbs")
    only_lamps = '{"KIND": "lamp"}'
    terms = "City of Somewhere (CC0)"
    cuts = False
    half = b'{"success": true, "result": {"records": ['

    def start(self) -> None:
        on = self.server.on
        self.resources: list[dict[str, Any]] = [
            {"id": "r-1", "name": "Map", "format": "PDF", "url": "/files/map.pdf"},
            {"id": "r-2", "name": "Table", "format": "XLSX", "datastore_active": True},
        ]
        on("/api/3/action/package_show", self.package_show)
        on("/api/3/action/package_list", sent({"success": True, "result": ["kerbs", "lamps"]}))
        on("/api/3/action/datastore_search", self.datastore_search)

    def is_page(self, request: Request) -> bool:
        return request.path.endswith("/datastore_search") and request.query["limit"] != "0"

    def package_show(self, request: Request) -> Answer:
        if request.query["id"] != "lamps":
            error = {"__type": "Not Found Error", "message": "Not records_answer"}
            return sent({"success": False, "error": error}, status=404)
        result = {
            "name": "lamps",
            "license_title": "CC0",
            "organization": {"title": "City of Somewhere"},
            "resources": self.resources,
        }
        return sent({"success": True, "result": result})

    def datastore_search(self, request: Request) -> Answer:
        query = request.query
        assert query["resource_id"] == "r-2"
        if query["limit"] == "0":
            return self.records_answer((), len(self.rows))
        if (failure := self.failure()) is not None:
            return failure
        assert query["sort"] == "_id"
        filters = json.loads(query.get("filters", "{}")).items()
        rows = [row for row in self.rows if all(row[name] == value for name, value in filters)]
        names = query.get("fields", f"{','.join(FIELDS)},Longitude,Latitude").split(",")
        records = [
            {k: v for k, v in self.record(row).items() if k in names}
            for row in self.part(rows, query["offset"], query["limit"])
        ]
        return self.records_answer(records, len(rows) + self.surplus)

    @staticmethod
    def record(row: Row) -> Row:
        x, y = map(str, row["xy"])
        return properties(row) | {"Longitude": x, "Latitude": y}

    @staticmethod
    def records_answer(records: Sequence[Row], total: int) -> Answer:
        fields = [{"id": name} for name in (*FIELDS, "Longitude", "Latitude")]
        result = {"fields": fields, "records": records, "total": total}
        return sent({"success": True, "result": result})


class Socrata(StandIn):
    """Its rows are GeoJSON, or plain if the position is a `location` or two columns."""

    reader = "socrata"
    dataset = "abcd-1234"
    wrong = "abcd-9999"
    others = ("/browse",)
    terms = "City of Somewhere (PDDL)"
    place = "point"

    def start(self) -> None:
        self.server.on("/api/views/abcd-1234.json", self.views)
        for kind in ("json", "geojson"):
            self.server.on(f"/resource/abcd-1234.{kind}", self.resource)

    def is_page(self, request: Request) -> bool:
        return request.path.startswith("/resource/") and request.query.get("$select") != "count(*)"

    def views(self, _: Request) -> Answer:
        kinds = dict.fromkeys(FIELDS, "text") | {":@computed_region_x": "number"}
        kinds |= {"the_place": self.place} if self.place else {"lon": "text", "lat": "text"}
        columns = [{"fieldName": name, "dataTypeName": kind} for name, kind in kinds.items()]
        terms = {"license": {"name": "PDDL"}, "attribution": "City of Somewhere"}
        return sent({"id": "abcd-1234", "columns": columns, **terms})

    def resource(self, request: Request) -> Answer:
        query = request.query
        rows: Sequence[Row] = self.rows
        for condition in re.findall(r"\((.+?\)?)\)(?: AND |$)", query.get("$where", "")):
            rows = [row for row in rows if self.holds(condition, row)]
        if query.get("$select") == "count(*)":
            return sent([{"count": str(len(rows) + self.surplus)}])
        if (failure := self.failure()) is not None:
            return failure
        assert query["$order"] == ":id"
        names = query.get("$select", ",".join(FIELDS)).split(",")
        names = [name for name in names if name in FIELDS]
        some = self.part(rows, query["$offset"], query["$limit"])
        if request.path.endswith(".geojson"):
            assert self.place not in {"", "location"}
            return sent(collection(features(some, names)), type="application/vnd.geo+json")
        return sent([self.plain(row, names) for row in some])

    def plain(self, row: Row, names: Sequence[str]) -> Row:
        x, y = map(str, row["xy"])
        where = {"latitude": y, "longitude": x, "human_address": "{}"}
        values = {k: v for k, v in properties(row, names).items() if v is not None}
        return values | ({"the_place": where} if self.place else {"lon": x, "lat": y})

    def holds(self, condition: str, row: Row) -> bool:
        if condition == self.only_lamps:
            return bool(row["KIND"] == "lamp")
        numbers = [float(text) for text in re.findall(r"-?\d+\.\d+", condition)]
        x, y = map(float, row["xy"])
        if condition.startswith("within_box(the_place, "):
            north, west, south, east = numbers
            return west <= x <= east and south <= y <= north
        if condition.startswith("intersects(the_place, 'POLYGON (("):
            return numbers[0] <= x <= numbers[2] and numbers[1] <= y <= numbers[5]
        name = condition.partition("::number between ")[0]
        least, most = numbers
        return least <= (x if name == "lon" else y) <= most


STAND_INS = (ArcGIS, Wfs, WfsOfGml, OgcFeatures, Ckan, Socrata)
