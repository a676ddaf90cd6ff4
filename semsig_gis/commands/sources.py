"""`semsig sources`: the catalogues, or the layers of one."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from typing_extensions import TypedDict

from semsig_gis.commands.load import catalogs
from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.core import Table, codes_by_family, family_named

if TYPE_CHECKING:
    from semsig_gis.sources import Catalog, LayerSpec, Rules


class Needs(TypedDict):
    """What a catalogue needs: files, the network, an area, and a variable with a token."""

    files: bool
    network: bool
    area: bool
    token: str | None


class CatalogRow(TypedDict):
    """A catalogue in the list."""

    name: str
    title: str
    place: str
    needs: Needs
    classes: list[str]
    layers: int
    reader: str
    license: str


class CatalogList(TypedDict):
    """All catalogues, and the readers for own catalogues."""

    catalogs: list[CatalogRow]
    readers: list[str]


class CatalogDetails(TypedDict):
    """A catalogue with its layers."""

    name: str
    title: str
    taxonomy: dict[str, Any]
    layers: list[dict[str, Any]]
    metric_crs: str | None
    place: str
    url: str
    reader: str
    endpoints: list[str]
    token: str | None
    geocoder: str | None
    conflate: list[tuple[str, float]]
    license: str
    attribution: str


@command(
    "sources",
    title="Catalogues of open data",
    group="Prepare",
    order=3,
    returns=CatalogList | CatalogDetails,
    examples=(
        "semsig sources",
        "semsig sources openstreetmap --tables",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Sources:
    """List the catalogues, or the layers of one."""

    name: Annotated[
        str | None,
        Option(
            "Catalogue, by name or .toml file; default: list all.",
            title="Catalogue",
            positional=True,
            suggestions=catalogs,
        ),
    ] = None

    def run(self, _reporter: Reporter) -> Result:
        """Return the catalogues, or one of them."""
        from semsig_gis.sources import READERS, load_catalog

        if self.name is not None:
            catalog = load_catalog(self.name)
            return Result(
                values=partial(asdict, catalog),
                summary=_about(catalog),
                tables=_details(catalog),
            )
        listed = [load_catalog(name) for name in catalogs()]
        readers = list(READERS)
        return Result(
            values=lambda: {"catalogs": [*map(_row, listed)], "readers": readers},
            summary=_list(listed),
            tables=_more(listed, readers),
        )


def _row(catalog: Catalog) -> CatalogRow:
    live = bool(catalog.endpoints)
    return {
        "name": catalog.name,
        "title": catalog.title,
        "place": catalog.place,
        "needs": {"files": not live, "network": live, "area": live, "token": catalog.token},
        "classes": [item.name for item in catalog.classes],
        "layers": len(catalog.layers),
        "reader": catalog.reader,
        "license": catalog.license,
    }


def _list(listed: list[Catalog]) -> Iterator[str | Table]:
    yield Table.of(
        f"{len(listed)} catalogues; semsig sources NAME has the layers and classes of one",
        ("name", "place", "needs"),
        ([c.name, c.place, _needs_text(c)] for c in listed),
    )


def _more(listed: list[Catalog], readers: list[str]) -> Iterator[str | Table]:
    yield Table.of(
        "Contents",
        ("name", "classes", "layers", "reader", "licence"),
        ([c.name, len(c.classes), len(c.layers), c.reader, c.license] for c in listed),
    )
    yield f"Readers for own catalogues: {', '.join(readers)}."


def _about(catalog: Catalog) -> Iterator[str]:
    """Yield what a catalogue holds and needs, its classes and its licence."""
    yield (
        f"{catalog.title}: {len(catalog.layers)} layers; place: "
        f"{catalog.place or 'not stated'}; needs {_needs_text(catalog)}."
    )
    usual = {name for spec in catalog.layers if not spec.optional for name in spec.classes}
    titles = {
        item.code: item.title.lower() + ("" if item.name in usual else " (optional)")
        for item in catalog.classes
    }
    for family, codes in codes_by_family(catalog.taxonomy, titles).items():
        heading = family_named(family).title if family else "Classes"
        yield f"{heading}: {', '.join(titles[code] for code in codes)}."
    yield f"Licence: {catalog.license}."


def _details(catalog: Catalog) -> Iterator[str | Table]:
    # The exclusion that most layers of objects share is shown once.
    rules = Counter(spec.exclusions for spec in catalog.layers if spec.role == "objects")
    common, count = rules.most_common(1)[0] if rules else ((), 0)
    common = common if count > 1 or len(rules) == 1 else ()
    for title, layers in _layers_by_family(catalog).items():
        yield Table.of(
            title,
            ("layer", "class", "from", "filter", "licence", "note"),
            (
                [
                    f"{spec.name} (optional)" if spec.optional else spec.name,
                    _class_text(spec),
                    _origin_text(spec),
                    _filter_text(spec, common),
                    spec.license,
                    spec.note,
                ]
                for spec in layers
            ),
        )
    if common:
        which = "every layer" if len(rules) == 1 else "layers"
        others = "" if len(rules) == 1 else ", where the filter states nothing else"
        yield f"Left out of {which} of objects{others}: {', '.join(_rules(common))}."
    yield Table.of(
        "Classes",
        ("symbol", "code", "class", "title", "family"),
        ([c.symbol, c.code, c.name, c.title, c.family] for c in catalog.classes),
    )


def _layers_by_family(catalog: Catalog) -> dict[str, list[LayerSpec]]:
    """Return the layers by the title of their table: the catalogue's, or that of a family."""
    code_of = {item.name: item.code for item in catalog.classes}
    families = codes_by_family(catalog.taxonomy, code_of.values())
    title = f"{catalog.title} ({catalog.url})"
    if len(families) == 1:
        return {title: list(catalog.layers)}
    # A layer of several families is in that of its first class.
    family_of = {code: family for family, codes in families.items() for code in codes}
    tables: dict[str, list[LayerSpec]] = {
        f"{title}: {family_named(family).title}": [] for family in families
    }
    for spec in catalog.layers:
        family = family_of[code_of[spec.classes[0]]] if spec.classes else None
        heading = "Buildings and streets" if family is None else family_named(family).title
        tables.setdefault(f"{title}: {heading}", []).append(spec)
    return tables


def _needs_text(catalog: Catalog) -> str:
    """Return the inputs that a catalogue needs, as text."""
    if not catalog.endpoints:
        return "files"
    if catalog.token is None:
        return "files, or an area and the network"
    state = "set" if os.environ.get(catalog.token) else "not set"
    return f"files, or an area, the network and a token ({catalog.token}, {state})"


def _class_text(spec: LayerSpec) -> str:
    by = f" (by {spec.class_by.field})" if spec.class_by else ""
    return f"{', '.join(spec.classes)}{by}" if spec.classes else spec.role


def _origin_text(spec: LayerSpec) -> str:
    """Return the origin of a layer: tags, a dataset of a portal, or files."""
    if spec.tags:
        tags = " or ".join(
            " and ".join(f"{key}={'/'.join(values)}" for key, values in tags) for tags in spec.tags
        )
        return tags if spec.dataset is None else f"{spec.dataset}: {tags}"
    if spec.derive is not None:
        return f"computed from streets and buildings ({spec.derive})"
    files, dataset = ", ".join(spec.files), spec.dataset or spec.server_where
    return files if dataset is None else f"{dataset} ({files})"


def _filter_text(spec: LayerSpec, common: Rules) -> str:
    exclusions = spec.exclusions if spec.exclusions != common else ()
    return " and ".join([*_rules(spec.where), *(f"not {rule}" for rule in _rules(exclusions))])


def _rules(rules: Rules) -> list[str]:
    return [f"{field} = {' or '.join(map(str, accepted))}" for field, accepted in rules]
