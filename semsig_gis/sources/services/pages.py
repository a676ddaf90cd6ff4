"""Client of a service for one layer: documents and pages of rows, requested through the cache."""

from __future__ import annotations

import dataclasses
import hashlib
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

    from semsig_gis.sources.http.cache import Cache, Fetched
    from semsig_gis.sources.http.fetch import HttpSpec, Progress
    from semsig_gis.sources.layer_spec import LayerSpec

T = TypeVar("T")
NAMES_LISTED = 12
NOT_FOUND = 404
BLANKS = b"\xef\xbb\xbf \r\n\t"
HTML = re.compile(rb"<(!doctype\s+)?html", re.IGNORECASE)


class ServiceQuery(NamedTuple):
    """An address and its parameters."""

    url: str
    params: Mapping[str, str | float] = {}

    def with_params(self, **params: str | float) -> ServiceQuery:
        """Return the query with further parameters."""
        return ServiceQuery(self.url, {**self.params, **params})


@dataclass(frozen=True, slots=True)
class Page:
    """Rows of a page in any form, with the number of all rows and the next page.

    `total` is None if the server does not state it. `more` is whether an ArcGIS server states that
    there are further rows. `following` is the address of the next page, if the server sends one.
    """

    rows: Sequence[Any]
    total: int | None = None
    more: bool = False
    following: str | None = None

    @property
    def digest(self) -> str:
        """Checksum of the rows, to recognize a page that comes twice."""
        return hashlib.sha256(json.dumps(self.rows, sort_keys=True).encode()).hexdigest()


class PagingError(SourceError):
    """The pages of a layer are inconsistent, so the cached ones cannot be used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Client:
    """Client of a service for one layer; `requested_files` are the fetched files, in order."""

    layer: LayerSpec
    endpoints: Sequence[str]
    cache: Cache
    spec: HttpSpec = DEFAULT_HTTP
    progress: Progress | None = None
    requested_files: list[Fetched] = field(default_factory=list)

    @property
    def endpoint(self) -> str:
        """The address of the service, without a slash at its end."""
        return self.endpoints[0].rstrip("/")

    @property
    def dataset(self) -> str:
        """Name of the layer on the service, from the catalogue."""
        return self.layer.dataset or ""

    def file(
        self,
        query: ServiceQuery,
        check: Callable[[Path], object] | None = None,
        *,
        accept: tuple[str, ...] = (),
        suffix: str = ".json",
        progress: Progress | None = None,
    ) -> Fetched:
        """Fetch a file; SourceError if its host is not named in the catalogue."""
        hosts = frozenset(urlsplit(endpoint).hostname or "" for endpoint in self.endpoints)
        if urlsplit(query.url).hostname not in hosts:
            raise SourceError(
                f"{host_of(self.endpoint)} sends on to {query.url.partition('?')[0]}, whose host "
                "the catalogue does not name; if you trust it, add its address to `endpoints`."
            )
        # Only the service itself gets the token, not the other hosts of the catalogue.
        same_server = urlsplit(query.url)[:2] == urlsplit(self.endpoint)[:2]
        spec = dataclasses.replace(
            self.spec, hosts=hosts, token=self.spec.token if same_server else None
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
        self.requested_files.append(file)
        return file

    def document(
        self, query: ServiceQuery, parse: Callable[[bytes], T], *, accept: tuple[str, ...] = ()
    ) -> T:
        """Fetch a document and parse it."""
        return self._fetch_and_parse(query, parse, accept=accept)[1]

    def _fetch_and_parse(
        self,
        query: ServiceQuery,
        parse: Callable[[bytes], T],
        *,
        accept: tuple[str, ...],
        suffix: str = ".json",
    ) -> tuple[Fetched, T]:
        """Fetch a file and parse it, once: the check of a new file is its parsing."""
        results: list[T] = []

        def check(path: Path) -> None:
            results.append(parse(path.read_bytes()))

        file = self.file(query, check, accept=accept, suffix=suffix)
        return file, results[-1] if results else parse(file.path.read_bytes())

    def json(self, query: ServiceQuery, *, accept: tuple[str, ...] = ()) -> dict[str, Any]:
        """Fetch a JSON object; HttpError if the service sends an error instead."""
        return self.document(query, lambda content: json_object(content, query.url), accept=accept)

    def pages(
        self,
        query: ServiceQuery,
        read: Callable[[bytes], Page],
        then: Callable[[Page, int], ServiceQuery | None],
        *,
        total: int | None = None,
        accept: tuple[str, ...] = (),
        suffix: str = ".json",
    ) -> tuple[Fetched, ...]:
        """Fetch pages as long as `then` returns a query for the next one.

        `then` takes a page and the number of rows received, with this page. PagingError if a page
        comes twice or the number of rows is not the stated one. Pages stay in the cache, so that a
        later run continues where this one ended.
        """
        files: list[Fetched] = []
        digests: set[str] = set()
        rows = 0
        following: ServiceQuery | None = query
        while following is not None:
            file, page = self._fetch_and_parse(following, read, accept=accept, suffix=suffix)
            files.append(file)
            rows += len(page.rows)
            total = page.total if total is None else total
            if page.rows and page.digest in digests:
                self._refuse(f"sends the same page again after {rows - len(page.rows):,} rows")
            digests.add(page.digest)
            if total is not None and rows > total:
                self._refuse(f"sends {rows:,} rows where it announced {total:,}")
            if self.progress is not None:
                self.progress(rows, total or 0)
            following = then(page, rows)
        if total is not None and rows < total:
            self._refuse(f"sends {rows:,} rows where it announced {total:,}")
        return tuple(files)

    def _refuse(self, what: str) -> None:
        raise PagingError(
            f"{host_of(self.endpoint)} {what}; its data may have changed meanwhile, so run it "
            "again, or report it to the publisher."
        )

    def unknown_dataset(self, names: Iterable[str], *, what: str, name: str = "") -> CatalogError:
        """Return the error for a dataset that the service lacks, with the ones it has."""
        names, name = list(names), name or self.dataset
        known_names = ", ".join(names[:NAMES_LISTED]) or "none"
        rest = f" and {len(names) - NAMES_LISTED:,} more" if len(names) > NAMES_LISTED else ""
        return CatalogError(
            f"{host_of(self.endpoint)} has no {what} {name!r}, which the catalogue names for layer "
            f"{self.layer.name!r}{nearest_name(name, names)}; it has {known_names}{rest}; correct "
            "`dataset` in the catalogue."
        )

    def description(
        self,
        query: ServiceQuery,
        parse: Callable[[bytes], T],
        *,
        page: str,
        accept: tuple[str, ...] = (),
    ) -> T:
        """Fetch and parse the description of the dataset.

        CatalogError if the portal does not have the dataset; `page` is where users can search it.
        """
        try:
            return self.document(query, parse, accept=accept)
        except HttpError as error:
            if error.status != NOT_FOUND:
                raise
            raise CatalogError(
                f"{self.endpoint} has no dataset {self.dataset!r}, which the catalogue names for "
                f"layer {self.layer.name!r}; look for it at {self.endpoint}/{page} and correct "
                "`dataset` in the catalogue."
            ) from error

    def fields(self, fields: Sequence[str]) -> list[str]:
        """Return the fields to request; empty, for all fields, if the layer selects none."""
        layer = self.layer
        if not layer.select:
            return []
        where = f"dataset {layer.dataset!r}"
        own = settle_fields(layer, fields)
        for name in own.select:
            require_field(name, fields, where=where, key="select")
        rules = RowRules(own, fields, filters=True, where=where)
        return list(dict.fromkeys([*own.select, *rules.fields]))

    def with_license(self, license_: object = "", attribution: object = "") -> LayerSpec:
        """Return the layer with the terms of the service if the catalogue gives none."""
        layer = self.layer
        terms, owner = (" ".join(str(text or "").split()) for text in (license_, attribution))
        return dataclasses.replace(
            layer,
            license=terms if terms and layer.license == "unknown" else layer.license,
            attribution=layer.attribution or owner,
        )


def json_object(content: bytes, url: str) -> dict[str, Any]:
    """Parse a JSON object of a service, with the errors of `json_value`; SourceError if not one."""
    reply = json_value(content, url)
    if not isinstance(reply, dict):
        raise SourceError(
            f"{host_of(url)} sent JSON that is not an object; check the address {url}."
        )
    return reply


def json_value(content: bytes, url: str) -> Any:  # noqa: ANN401 - any JSON
    """Parse JSON of a service.

    SourceError if it is something else, such as a web page, HttpError if it is an error message of
    the service, TransientError if a retry may help.
    """
    host, start = host_of(url), content[:2_000].lstrip(BLANKS)
    if start.startswith(b"<"):  # an exception report, a web page or other XML
        message = error_text(content)
        if message:
            raise HttpError(f"{host} answered with the error {message} to {url}; correct it.")
        what = "a web page" if HTML.match(start) else "XML"
        raise SourceError(f"{host} sent {what} where JSON was expected; check the address {url}.")
    try:
        reply = parse_json(content.decode("utf-8-sig"))
    except ValueError as error:
        raise TransientError("sent JSON that is not whole") from error
    failure = reply.get("error") if isinstance(reply, dict) else None
    if failure:
        code = failure.get("code") if isinstance(failure, dict) else None
        status = code if isinstance(code, int) else 0
        what = f"answered with the error {error_text(content) or status}"
        if status in RETRY_STATUSES:
            raise TransientError(what, status)
        raise HttpError(f"{host} {what} to {url}; correct it.", status)
    return reply


def geojson_page(content: bytes, client: Client) -> Page:
    """Parse a page of GeoJSON, or of JSON with the same list of features."""
    reply = json_object(content, client.endpoint)
    rows = reply.get("features")
    if not isinstance(rows, list):
        raise SourceError(
            f"{host_of(client.endpoint)} sent JSON without features; check the address "
            f"{client.endpoint}."
        )
    counts = (reply.get(name) for name in ("numberMatched", "totalFeatures"))
    total = next((count for count in counts if isinstance(count, int) and count >= 0), None)
    links = reply.get("links") or ()
    following = (item["href"] for item in links if item.get("rel") == "next")
    # The place of ArcGIS servers for this flag depends on the format.
    places = (reply, reply.get("properties"))
    more = any(item.get("exceededTransferLimit") for item in places if isinstance(item, dict))
    return Page(rows, total=total, more=more, following=next(following, None))


def next_offset(
    query: ServiceQuery, parameter: str, total: int | None = None
) -> Callable[[Page, int], ServiceQuery | None]:
    """Return the `then` of `Client.pages` for a service that takes the number of rows to skip."""

    def then(page: Page, rows: int) -> ServiceQuery | None:
        stated = page.total if total is None else total
        rest = page.rows and (stated is None or rows < stated)
        return query.with_params(**{parameter: rows}) if rest else None

    return then


def xml_root(content: bytes, url: str) -> ET.Element:
    """Parse XML of a service and return its root, with the errors of `json_value`."""
    host, start = host_of(url), content[:2_000].lstrip(BLANKS)
    if not start.startswith(b"<") or HTML.match(start):
        what = "a web page" if HTML.match(start) else "something else"
        raise SourceError(f"{host} sent {what} where XML was expected; check the address {url}.")
    message = error_text(content)
    if message:
        raise HttpError(f"{host} answered with the error {message} to {url}; correct it.")
    try:
        return parse_xml(content)
    except ValueError as error:
        raise TransientError("sent XML that is not whole") from error
