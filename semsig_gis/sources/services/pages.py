"""What the readers of services share: documents and pages, asked for through the cache."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import json
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar
from urllib.parse import urlsplit

from semsig_gis.core import CatalogError, SourceError, nearest_name
from semsig_gis.sources.http.errors import error_text
from semsig_gis.sources.http.fetch import (
    DEFAULT_HTTP,
    RETRY_STATUSES,
    HttpError,
    TransientError,
    fetch,
    host_of,
)
from semsig_gis.sources.rows import RowRules, require_field
from semsig_gis.sources.services.gml import parse_xml
from semsig_gis.sources.services.layers import settle_fields
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from pathlib import Path
    from xml.etree import ElementTree as ET

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Cache, Fetched
    from semsig_gis.sources.http.fetch import HttpSpec, Progress
    from semsig_gis.sources.layers import LayerSpec
    from semsig_gis.sources.services.layers import Download

T = TypeVar("T")
# The module of this package that asks each kind of service, by the name of its reader.
SERVICES = {
    "arcgis": "arcgis",
    "ckan": "ckan",
    "ogc_features": "ogc_features",
    "opendatasoft": "opendatasoft",
    "socrata": "socrata",
    "wfs": "wfs",
}
NAMES_LISTED = 12
NOT_FOUND = 404
BLANKS = b"\xef\xbb\xbf \r\n\t"
HTML = re.compile(rb"<(!doctype\s+)?html", re.IGNORECASE)


class Query(NamedTuple):
    """An address, and what is asked of it."""

    url: str
    params: Mapping[str, str | float] = {}

    def also(self, **params: str | float) -> Query:
        """Return the query with more parameters."""
        return Query(self.url, {**self.params, **params})


@dataclass(frozen=True, slots=True)
class Page:
    """The rows of a page, however they are written, how many there are in all, and what is next.

    `told` is None where the server does not tell; `more` says that it has further rows, None where
    only their number tells, and `following` is the address of the next page where the server says
    it.
    """

    rows: Sequence[Any]
    told: int | None = None
    more: bool | None = None
    following: str | None = None

    @property
    def digest(self) -> str:
        """Return what two pages share only if their rows are the same."""
        return hashlib.sha256(json.dumps(self.rows, sort_keys=True).encode()).hexdigest()


class PagingError(SourceError):
    """Pages do not add up, so that those in the cache are of no use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Client:
    """Asks a service for what belongs to one layer; `asked` are the files that came, in order."""

    layer: LayerSpec
    endpoints: Sequence[str]
    cache: Cache
    spec: HttpSpec = DEFAULT_HTTP
    progress: Progress | None = None
    asked: list[Fetched] = field(default_factory=list)

    @property
    def endpoint(self) -> str:
        """The address of the service, without a slash at its end."""
        return self.endpoints[0].rstrip("/")

    @property
    def dataset(self) -> str:
        """What the catalogue calls the layer on the service."""
        return self.layer.dataset or ""

    def file(
        self,
        query: Query,
        check: Callable[[Path], object] | None = None,
        *,
        accept: tuple[str, ...] = (),
        suffix: str = ".json",
        progress: Progress | None = None,
    ) -> Fetched:
        """Fetch a file; SourceError if it lies with a host that the catalogue does not name."""
        hosts = frozenset(urlsplit(endpoint).hostname or "" for endpoint in self.endpoints)
        if urlsplit(query.url).hostname not in hosts:
            raise SourceError(
                f"{host_of(self.endpoint)} sends on to {query.url.partition('?')[0]}, whose host "
                "the catalogue does not name; if you trust it, add its address to `endpoints`."
            )
        at_home = urlsplit(query.url)[:2] == urlsplit(self.endpoint)[:2]
        spec = dataclasses.replace(
            self.spec, hosts=hosts, token=self.spec.token if at_home else None
        )
        file = fetch(
            query.url,
            params=query.params,
            cache=self.cache,
            spec=spec,
            accept=accept,
            suffix=suffix,
            check=check,
            progress=progress,
        )
        self.asked.append(file)
        return file

    def document(
        self, query: Query, parse: Callable[[bytes], T], *, accept: tuple[str, ...] = ()
    ) -> T:
        """Fetch a document and return what `parse` makes of it."""
        return self._parsed(query, parse, accept=accept)[1]

    def _parsed(
        self,
        query: Query,
        parse: Callable[[bytes], T],
        *,
        accept: tuple[str, ...],
        suffix: str = ".json",
    ) -> tuple[Fetched, T]:
        """Fetch a file and return what `parse` makes of it, which is done once."""
        came: list[T] = []
        file = self.file(
            query, lambda path: came.append(parse(path.read_bytes())), accept=accept, suffix=suffix
        )
        return file, came[-1] if came else parse(file.path.read_bytes())

    def json(self, query: Query, *, accept: tuple[str, ...] = ()) -> dict[str, Any]:
        """Fetch a JSON object; HttpError if the service sends an error instead."""
        return self.document(query, lambda content: json_object(content, query.url), accept=accept)

    def pages(
        self,
        query: Query,
        read: Callable[[bytes], Page],
        then: Callable[[Page, int], Query | None],
        *,
        told: int | None = None,
        accept: tuple[str, ...] = (),
        suffix: str = ".json",
    ) -> tuple[Fetched, ...]:
        """Fetch pages, as long as `then` returns the query of a next one.

        It takes a page, and the number of rows that have come with it. PagingError if a page comes
        twice, or the rows are not as many as the server tells. Pages that have come stay in the
        cache, so that a later run goes on where this one ended.
        """
        files: list[Fetched] = []
        digests: set[str] = set()
        rows = 0
        following: Query | None = query
        while following is not None:
            file, page = self._parsed(following, read, accept=accept, suffix=suffix)
            files.append(file)
            rows += len(page.rows)
            told = page.told if told is None else told
            if page.rows and page.digest in digests:
                self._refuse(f"sends the same page again after {rows - len(page.rows):,} rows")
            digests.add(page.digest)
            if told is not None and rows > told:
                self._refuse(f"sends {rows:,} rows where it announced {told:,}")
            if self.progress is not None:
                self.progress(rows, told or 0)
            following = then(page, rows)
        if told is not None and rows < told:
            self._refuse(f"sends {rows:,} rows where it announced {told:,}")
        return tuple(files)

    def _refuse(self, what: str) -> None:
        raise PagingError(
            f"{host_of(self.endpoint)} {what}; its data may have changed meanwhile, so run it "
            "again, or tell its publisher."
        )

    def unknown(self, names: Iterable[str], *, what: str, name: str = "") -> CatalogError:
        """Return the error for a dataset that the service does not have, with those it has."""
        names, name = list(names), name or self.dataset
        listed = ", ".join(names[:NAMES_LISTED]) or "none"
        rest = f" and {len(names) - NAMES_LISTED:,} more" if len(names) > NAMES_LISTED else ""
        return CatalogError(
            f"{host_of(self.endpoint)} has no {what} {name!r}, which the catalogue names for layer "
            f"{self.layer.name!r}{nearest_name(name, names)}; it has {listed}{rest}; correct "
            "`dataset` in the catalogue."
        )

    def fields(self, fields: Sequence[str]) -> list[str]:
        """Return the fields to ask for, which are none where the layer does not select any."""
        layer = self.layer
        if not layer.select:
            return []
        where = f"dataset {layer.dataset!r}"
        own = settle_fields(layer, fields)
        for name in own.select:
            require_field(name, fields, where=where, key="select")
        rules = RowRules(own, fields, filters=True, where=where)
        return list(dict.fromkeys([*own.select, *rules.fields]))

    def licensed(self, license_: object = "", attribution: object = "") -> LayerSpec:
        """Return the layer, with what the service says of its terms where the catalogue is mute."""
        layer = self.layer
        said = (" ".join(str(text or "").split()) for text in (license_, attribution))
        terms, whom = said
        known = layer.license != "unknown"
        return dataclasses.replace(
            layer,
            license=layer.license if known or not terms else terms,
            attribution=layer.attribution or whom,
        )


def json_object(content: bytes, url: str) -> dict[str, Any]:
    """Return a JSON object that a service sent, as `json_value` does; SourceError if it is none."""
    reply = json_value(content, url)
    if not isinstance(reply, dict):
        raise SourceError(
            f"{host_of(url)} sent JSON that is not an object; check the address {url}."
        )
    return reply


def json_value(content: bytes, url: str) -> Any:  # noqa: ANN401 - any JSON
    """Return JSON that a service sent.

    SourceError if it is something else, such as a web page, HttpError if it is the service's word
    for an error, TransientError where a later answer may be better.
    """
    refuse_markup(content, url)
    host = host_of(url)
    try:
        reply = parse_json(content.decode("utf-8-sig"))
    except ValueError as error:
        what = "sent JSON that is not whole"
        raise TransientError(what) from error
    failed = reply.get("error") if isinstance(reply, dict) else None
    if failed:
        code = failed.get("code") if isinstance(failed, dict) else None
        status = code if isinstance(code, int) else 0
        what = f"answered with the error {error_text(content) or status}"
        if status in RETRY_STATUSES:
            raise TransientError(what, status)
        raise HttpError(f"{host} {what} to {url}; correct it.", status)
    return reply


def geojson_page(content: bytes, client: Client) -> Page:
    """Return a page of GeoJSON as OGC services send it."""
    reply = json_object(content, client.endpoint)
    rows = reply.get("features")
    if not isinstance(rows, list):
        raise SourceError(
            f"{host_of(client.endpoint)} sent JSON without features; check the address "
            f"{client.endpoint}."
        )
    counts = (reply.get(name) for name in ("numberMatched", "totalFeatures"))
    told = next((count for count in counts if isinstance(count, int) and count >= 0), None)
    links = reply.get("links") or ()
    following = (item["href"] for item in links if item.get("rel") == "next")
    return Page(rows, told=told, following=next(following, None))


def xml_root(content: bytes, url: str) -> ET.Element:
    """Return the root of XML that a service sent, with the errors of `json_object`."""
    host, begin = host_of(url), content[:2_000].lstrip(BLANKS)
    if begin.startswith(b"<") and not HTML.match(begin):
        said = error_text(content)
        if said:
            raise HttpError(f"{host} answered with the error {said} to {url}; correct it.")
        try:
            return parse_xml(content)
        except ValueError as error:
            what = "sent XML that is not whole"
            raise TransientError(what) from error
    what = "a web page" if HTML.match(begin) else "something else"
    raise SourceError(f"{host} sent {what} where XML was expected; check the address {url}.")


def refuse_markup(content: bytes, url: str) -> None:
    """Refuse a web page, and the report of an exception, where data was expected."""
    begin = content[:2_000].lstrip(BLANKS)
    if not begin.startswith(b"<"):
        return
    said = error_text(content)
    if said:
        raise HttpError(f"{host_of(url)} answered with the error {said} to {url}; correct it.")
    what = "a web page" if HTML.match(begin) else "XML"
    raise SourceError(
        f"{host_of(url)} sent {what} where JSON was expected; check the address {url}."
    )


def fetch_layers(
    name: str,
    specs: Sequence[LayerSpec],
    *,
    endpoints: Sequence[str],
    area: Area | None = None,
    cache: Cache,
    spec: HttpSpec = DEFAULT_HTTP,
    progress: Progress | None = None,
) -> list[Download]:
    """Fetch layers from a service by the name of its reader; the first endpoint is its address.

    Layers without a dataset are left out, because the service does not have them. CatalogError if
    it lacks a dataset or field that the catalogue names, SourceError if it refuses, fails or sends
    something else.
    """
    adapter = importlib.import_module(f"{__package__}.{SERVICES[name]}")
    downloads = []
    for layer in specs:
        if layer.dataset is None:
            continue
        client = Client(layer=layer, endpoints=endpoints, cache=cache, spec=spec, progress=progress)
        try:
            download = adapter.fetch_layer(client, area)
            downloads.append(dataclasses.replace(download, area=area))
        except SourceError as error:
            if isinstance(error, PagingError):
                for file in client.asked:
                    cache.forget(file)
            raise _of_layer(error, layer) from error
    return downloads


def _of_layer(error: SourceError, layer: LayerSpec) -> SourceError:
    """Return an error that says which layer it is about."""
    msg = f"layer {layer.name!r}: {error}"
    return HttpError(msg, error.status) if isinstance(error, HttpError) else type(error)(msg)
