"""Map features of Mapillary from files and from a local service with the same limits."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from sentences import refused
from servers import Answer

from semsig_gis.core import InputError
from semsig_gis.sources import (
    MOST_FEATURES,
    AccessToken,
    HttpError,
    HttpSpec,
    detect_catalogs,
    load_catalog,
    parse_area,
)
from semsig_gis.sources.readers.mapillary import fetch_layers, read_layers

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from servers import Request, Server

    from semsig_gis.sources import Cache

CATALOG = load_catalog("mapillary")
AREA = parse_area("2.30,48.85,2.31,48.86")
TOKEN = "MLY|4711|0123456789abcdef"  # noqa: S105 - of nobody


def feature(number: int, value: str, x: float = 2.305, y: float = 48.855) -> dict[str, Any]:
    return {
        "id": str(number),
        "object_value": value,
        "object_type": "point",
        "geometry": {"type": "Point", "coordinates": [x, y]},
        "first_seen_at": "2019-05-01T10:00:00+0000",
        "last_seen_at": "2024-05-01T10:00:00+0000",
    }


VALUES = {
    "object--street-light": "street_lights",
    "object--traffic-light--general-upright": "traffic_lights",
    "regulatory--stop--g1": "signs",
    "complementary--both-directions--g1": "signs",
    "object--bench": "benches",
    "object--fire-hydrant": "fire_hydrants",
    "object--support--pole": "",
}


@pytest.mark.parametrize("form", ["answer", "answers", "list", "geojson", "older geojson"])
def test_value_belongs_to_its_layer(tmp_path: Path, form: str) -> None:
    features = [feature(number, value) for number, value in enumerate(VALUES)]
    content: dict[str, Any] = {"data": features}
    if form == "older geojson":
        features = [
            {"key": item["id"], "value": item["object_value"], "geometry": item["geometry"]}
            for item in features
        ]
    if form.endswith("geojson"):
        parts = [{"geometry": item.pop("geometry"), "properties": item} for item in features]
        content = {"type": "FeatureCollection", "features": parts}
    path = tmp_path / "points.json"
    forms = {"answers": [{"data": features[:2]}, {"data": features[2:]}], "list": features}
    path.write_text(json.dumps(forms.get(form, content)), "utf-8")
    assert detect_catalogs([path])[0] == ("mapillary",)
    layers = read_layers([path, path], CATALOG.layers)  # an id counts once
    counts = {item.spec.name: len(item.table) for item in layers if len(item.table)}
    names = [name for name in VALUES.values() if name]
    assert counts == {name: names.count(name) for name in names}
    assert {layer.counts.read for layer in layers} == {len(VALUES)}


class Service:
    """Answers as the Graph API does: by box, with a limit on the number of features."""

    def __init__(self, features: Sequence[dict[str, Any]]) -> None:
        self.features = features

    def __call__(self, request: Request) -> Answer:
        if request.headers.get("authorization") != f"OAuth {TOKEN}":
            error = {"error": {"message": f"Invalid token {request.headers.get('authorization')}"}}
            return Answer(json.dumps(error).encode(), status=401)
        west, south, east, north = map(float, request.query["bbox"].split(","))
        if (east - west) * (north - south) > 0.01:
            return Answer(b'{"error": {"message": "bbox too large"}}', status=500)
        inside = [
            item
            for item in self.features
            for x, y in [item["geometry"]["coordinates"]]
            if west <= x <= east and south <= y <= north
        ][: int(request.query["limit"])]
        return Answer(json.dumps({"data": inside}).encode())


@pytest.fixture
def crowd() -> list[dict[str, Any]]:
    """Return more benches than an answer may have, half of them in one corner."""
    corner = [feature(n, "object--bench", 2.3001 + n * 1e-8, 48.8501) for n in range(1500)]
    return [*corner, *(feature(2000 + n, "object--bench", 2.3099) for n in range(1500))]


def test_full_box_is_requested_in_quarters(
    server: Server, cache: Cache, crowd: list[dict[str, Any]], slept: list[float]
) -> None:
    server.on("/map_features", Service(crowd))
    lines: list[str] = []
    spec = HttpSpec(sleep=slept.append, report=lines.append, token=AccessToken(TOKEN))
    benches = [CATALOG.layer("benches"), CATALOG.layer("signs")]
    options: Any = {"endpoints": [server.url], "area": AREA, "cache": cache}
    steps: list[tuple[int, int]] = []
    files = fetch_layers(benches, spec=spec, progress=lambda *s: steps.append(s), **options)
    assert len(read_layers(files, benches)[0].table) == len(crowd) > MOST_FEATURES
    assert len(server.requests) == 1 + 4
    assert steps[-1] == (4, 4)
    query = server.requests[0].query
    assert query["object_values"].split(",")[:2] == ["complementary--*", "information--*"]
    assert "access_token" not in query
    # A second run uses the cache, also offline and without a token.
    server.requests.clear()
    assert fetch_layers(benches, spec=spec, **options) == files
    assert not server.requests
    assert fetch_layers(benches, spec=HttpSpec(offline=True), **options) == files
    # No file name or line contains the token.
    names = [path.name for path in cache.folder.iterdir()]
    assert TOKEN not in "\n".join([*names, *lines, repr(spec)])


def test_error_for_a_refused_token_hides_it(server: Server, cache: Cache) -> None:
    server.on("/map_features", Service([]))
    spec = HttpSpec(attempts=1, token=AccessToken("MLY|1|other"))
    words = ("401", "Invalid token OAuth (token)", "access token is still valid")
    with refused(HttpError, *words):
        fetch_layers(CATALOG.layers, endpoints=[server.url], area=AREA, cache=cache, spec=spec)


def test_token_is_read_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MAPILLARY_ACCESS_TOKEN", raising=False)
    with refused(InputError, "MAPILLARY_ACCESS_TOKEN", "is not set"):
        AccessToken.from_environment("MAPILLARY_ACCESS_TOKEN")
    monkeypatch.setenv("MAPILLARY_ACCESS_TOKEN", " MLY|1\n2 ")
    with pytest.raises(InputError, match=r"^[^|]*MAPILLARY_ACCESS_TOKEN contains blanks[^|]*$"):
        AccessToken.from_environment("MAPILLARY_ACCESS_TOKEN")
    monkeypatch.setenv("MAPILLARY_ACCESS_TOKEN", f"{TOKEN}\n")
    assert AccessToken.from_environment("MAPILLARY_ACCESS_TOKEN") == AccessToken(TOKEN)


def test_token_is_hidden_as_it_is_and_as_in_an_address() -> None:
    assert AccessToken("a/b").redact("a/b, x?t=a%2fb and a%2Fb, ab") == (
        "(token), x?t=(token) and (token), ab"
    )
