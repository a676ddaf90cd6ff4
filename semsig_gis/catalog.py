"""Catalogues: TOML files that say which layers of which source hold which class of object."""

from __future__ import annotations

import importlib.resources
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.errors import CatalogError, CrsError, UnknownNameError, nearest_name
from semsig_gis.layer_spec import (
    ClassBy,
    ElementKind,
    GeometryKind,
    LayerSpec,
    Role,
    Value,
)
from semsig_gis.plugins import installed_catalogs
from semsig_gis.schema import require_metric_crs
from semsig_gis.taxonomy import ObjectClass, Taxonomy

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from importlib.resources.abc import Traversable

__all__ = [
    "Catalog",
    "ClassBy",
    "LayerSpec",
    "catalog_names",
    "data_folder",
    "load_catalog",
    "paper_taxonomy",
]

# Shipped beside the catalogues: the paper's classes, and words by which drafts are made.
NO_CATALOGS = frozenset({"keywords", "taxonomy"})
# What a catalogue may say, and of which type; every other key is a mistake that gets named.
CATALOG_KEYS = {
    "name": str,
    "title": str,
    "url": str,
    "license": str,
    "attribution": str,
    "metric_crs": str,
    "reader": str,
    "endpoints": list,
    "geocoder": str,
    "files": list,
    "conflate": dict,
    "classes": list,
    "layers": list,
}
CLASS_KEYS = {"code": int, "symbol": str, "name": str, "title": str}
LAYER_KEYS = {
    "name": str,
    "class": str,
    "files": list,
    "layer": str,
    "where": dict,
    "class_by": dict,
    "aliases": dict,
    "id_field": str,
    "unique_id": bool,
    "dataset": str,
    "server_where": str,
    "select": list,
    "tags": list,
    "elements": list,
    "role": str,
    "optional": bool,
    "note": str,
    "geometry": str,
    "crs": str,
    "rows": list,
    "x_field": str,
    "y_field": str,
    "license": str,
    "attribution": str,
}
CLASS_BY_KEYS = {"field": str, "values": dict}


@dataclass(frozen=True, kw_only=True)
class Catalog:
    """A source of open data: its classes, its layers and its licence.

    Parameters
    ----------
    name : str
        Short name.
    title : str
        Name to show to people.
    metric_crs : str, optional
        Coordinate reference system in metres in which distances are taken; where it is left
        out, the UTM zone of the data.
    taxonomy : Taxonomy
        The paper's classes and the catalogue's own.
    layers : tuple of LayerSpec
        The layers.
    url : str
        Where the data is published.
    reader : str
        Reader of `semsig_gis.sources` for its files.
    endpoints : tuple of str
        Base addresses of the services that send the data, best first.
    geocoder : str, optional
        Base address of the Nominatim service that knows places by name.
    conflate : tuple of (str, float)
        Classes whose objects from different layers are the same thing within so many metres.
    license, attribution : str
        What holds for every layer that does not say otherwise.

    Examples
    --------
    >>> load_catalog("montpellier").layer("trees").class_name
    'alignment_tree'
    """

    name: str
    title: str
    taxonomy: Taxonomy
    layers: tuple[LayerSpec, ...]
    metric_crs: str | None = None
    url: str = ""
    reader: str = "vector_file"
    endpoints: tuple[str, ...] = ()
    geocoder: str | None = None
    conflate: tuple[tuple[str, float], ...] = ()
    license: str = "unknown"
    attribution: str = ""

    def layer(self, name: str) -> LayerSpec:
        """Return the layer of that name.

        Parameters
        ----------
        name : str
            Name of a layer.

        Returns
        -------
        LayerSpec
            The layer.

        Raises
        ------
        UnknownNameError
            If there is none; the nearest name is offered.
        """
        for spec in self.layers:
            if spec.name == name:
                return spec
        known = [spec.name for spec in self.layers]
        msg = (
            f"catalogue {self.name!r} has no layer {name!r}{nearest_name(name, known)}; "
            f"its layers are {', '.join(known)}."
        )
        raise UnknownNameError(msg)


def paper_taxonomy() -> Taxonomy:
    """Return the eleven classes of the paper, with its identifiers as codes and its symbols.

    Returns
    -------
    Taxonomy
        Codes 1 to 11 (paper, table of semantic objects).

    Examples
    --------
    >>> "".join(item.symbol for item in paper_taxonomy().classes)
    'BCDEGHIJKLM'
    """
    source = data_folder() / "taxonomy.toml"
    content = _parse(source.read_text(encoding="utf-8"), "taxonomy.toml")
    _check_keys(content, {"classes": list}, "taxonomy.toml")
    return Taxonomy(_classes(content["classes"], "taxonomy.toml"))


def catalog_names() -> tuple[str, ...]:
    """Return the names of the catalogues there are.

    Returns
    -------
    tuple of str
        Names that `load_catalog` takes, sorted: the built-in catalogues, and those that other
        packages bring by the entry-point group ``semsig_gis.catalogs``.

    Examples
    --------
    >>> "montpellier" in catalog_names()
    True
    """
    return tuple(sorted(_sources()))


def _sources() -> dict[str, Path | Traversable]:
    """Return the file of every catalogue by name."""
    shipped: dict[str, Path | Traversable] = {
        Path(item.name).stem: item
        for item in data_folder().iterdir()
        if item.name.endswith(".toml") and Path(item.name).stem not in NO_CATALOGS
    }
    return {**shipped, **installed_catalogs(taken=shipped)}


def load_catalog(name: str | Path) -> Catalog:
    """Read and check a catalogue.

    Parameters
    ----------
    name : str or Path
        Name of a built-in or installed catalogue, or path of a TOML file (it ends in ``.toml``).

    Returns
    -------
    Catalog
        The catalogue; its taxonomy is the paper's classes followed by its own.

    Raises
    ------
    UnknownNameError
        If there is no catalogue of that name.
    CatalogError
        If the file is missing, is not TOML, has a key that means nothing, lacks one that is
        needed, or names a class or CRS that does not exist.

    Examples
    --------
    >>> load_catalog("montpellier").metric_crs
    'EPSG:2154'
    """
    text = str(name)
    source: Path | Traversable
    if text.endswith(".toml"):
        source = Path(text)
        if not source.is_file():
            msg = f"catalogue {text} does not exist; give a TOML file or one of {_known()}."
            raise CatalogError(msg)
    else:
        sources = _sources()
        if text not in sources:
            msg = (
                f"catalogue {text!r} is unknown{nearest_name(text, sources)}; "
                f"give one of {_known()}, or the path of a .toml file."
            )
            raise UnknownNameError(msg)
        source = sources[text]
    try:
        content = source.read_text(encoding="utf-8-sig")  # some editors write a BOM
    except UnicodeDecodeError as error:
        msg = f"catalogue {text} is not UTF-8 text ({error}); save it as UTF-8."
        raise CatalogError(msg) from error
    except OSError as error:
        msg = f"catalogue {text} cannot be read ({error.strerror}); give a file that you can read."
        raise CatalogError(msg) from error
    return _catalog(_parse(content, text), text)


def _known() -> str:
    return ", ".join(repr(name) for name in catalog_names())


def data_folder() -> Traversable:
    """Return the folder of shipped catalogues: in the wheel, or at the top of a checkout.

    Returns
    -------
    Traversable
        The folder ``data_sources``.

    Examples
    --------
    >>> (data_folder() / "taxonomy.toml").is_file()
    True
    """
    shipped = importlib.resources.files("semsig_gis") / "data_sources"
    if shipped.is_dir():
        return shipped
    return Path(__file__).resolve().parent.parent / "data_sources"


def _parse(text: str, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        msg = f"{where} is not valid TOML: {error}."
        raise CatalogError(msg) from error


def _check_keys(
    table: Mapping[str, Any],
    allowed: Mapping[str, type],
    where: str,
    needed: Iterable[str] = (),
) -> None:
    for key, value in table.items():
        if key not in allowed:
            msg = (
                f"{where} has the key {key!r}, which means nothing"
                f"{nearest_name(key, allowed)}; the keys are {', '.join(allowed)}."
            )
            raise CatalogError(msg)
        # bool is an int to Python, never to a catalogue
        if not isinstance(value, allowed[key]) or isinstance(value, bool) != (allowed[key] is bool):
            msg = f"{where} has {key} = {value!r}; write {_TOML_TYPES[allowed[key]]}."
            raise CatalogError(msg)
    for key in needed:
        if key not in table:
            msg = f"{where} lacks the key {key!r}; add it."
            raise CatalogError(msg)


_TOML_TYPES: dict[type, str] = {
    str: "a string",
    int: "a whole number",
    list: "a list",
    dict: "a table",
    bool: "true or false",
}


def _catalog(content: dict[str, Any], where: str) -> Catalog:
    where = f"catalogue {where}"
    _check_keys(content, CATALOG_KEYS, where, ("name", "title", "layers"))
    own = _classes(content.get("classes", []), where)
    try:
        taxonomy = paper_taxonomy().extended(own)
        if "metric_crs" in content:
            require_metric_crs(content["metric_crs"])
    except (CatalogError, CrsError) as error:
        msg = f"{where}: {error}"
        raise CatalogError(msg) from error
    shared = {
        "license": content.get("license", "unknown"),
        "attribution": content.get("attribution", ""),
        "files": _texts(content.get("files", []), "files", where),
        "reader": content.get("reader", "vector_file"),
    }
    layers = tuple(_layer(item, where, taxonomy, shared) for item in content["layers"])
    names = [spec.name for spec in layers]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None or not names:
        what = f"two layers named {double!r}; rename one" if names else "no layer; add [[layers]]"
        msg = f"{where} has {what}."
        raise CatalogError(msg)
    return Catalog(
        name=content["name"],
        title=content["title"],
        metric_crs=content.get("metric_crs"),
        taxonomy=taxonomy,
        layers=layers,
        url=content.get("url", ""),
        reader=content.get("reader", "vector_file"),
        endpoints=_texts(content.get("endpoints", []), "endpoints", where),
        geocoder=content.get("geocoder"),
        conflate=_radii(content.get("conflate", {}), taxonomy, where),
        license=shared["license"],
        attribution=shared["attribution"],
    )


def _classes(items: list[Any], where: str) -> tuple[ObjectClass, ...]:
    classes = []
    for number, item in enumerate(items, start=1):
        place = f"{where}, class {number}"
        if not isinstance(item, dict):
            msg = f"{place} is {item!r}; write a [[classes]] table."
            raise CatalogError(msg)
        _check_keys(item, CLASS_KEYS, place, CLASS_KEYS)
        try:
            classes.append(ObjectClass(**item))
        except CatalogError as error:
            msg = f"{place}: {error}"
            raise CatalogError(msg) from error
    return tuple(classes)


def _layer(item: object, where: str, taxonomy: Taxonomy, shared: Mapping[str, Any]) -> LayerSpec:
    if not isinstance(item, dict):
        msg = f"{where} has the layer {item!r}; write a [[layers]] table."
        raise CatalogError(msg)
    where = f"{where}, layer {item.get('name', '?')!r}"
    _check_keys(item, LAYER_KEYS, where, ("name",))
    role = _choice(item.get("role", "objects"), "role", get_args(Role), where)
    if (role == "objects") != ("class" in item):
        what = "lacks the key 'class'; add it" if role == "objects" else "needs no class; remove it"
        msg = f"{where} {what}."
        raise CatalogError(msg)
    if role == "objects":
        _require_class(item["class"], taxonomy, where)
    if "crs" in item:
        try:
            CRS.from_user_input(item["crs"])
        except CRSError as error:
            msg = (
                f"{where} has crs = {item['crs']!r}, which is unknown; "
                "write a code such as 'EPSG:4326'."
            )
            raise CatalogError(msg) from error
    if item.get("unique_id", False) and "id_field" not in item:
        msg = f"{where} has unique_id = true without an id_field; name the field of the ids."
        raise CatalogError(msg)
    files = _texts(item.get("files", list(shared["files"])), "files", where)
    if not files:
        msg = f"{where} has files = []; write a list of file names or patterns."
        raise CatalogError(msg)
    plain = ("layer", "id_field", "unique_id", "dataset", "server_where", "optional", "note")
    kinds = _texts(item.get("elements", list(get_args(ElementKind))), "elements", where)
    return LayerSpec(
        name=item["name"],
        class_name=item.get("class", ""),
        role=role,
        files=files,
        where=tuple(
            (field, _values(accepted, field, where))
            for field, accepted in item.get("where", {}).items()
        ),
        class_by=_class_by(item["class_by"], taxonomy, where) if "class_by" in item else None,
        aliases=tuple(
            (field, _texts(names, f"aliases of {field!r}", where))
            for field, names in item.get("aliases", {}).items()
        ),
        geometry=_choice(item.get("geometry", "point"), "geometry", get_args(GeometryKind), where),
        rows=_rows(item["rows"], where) if "rows" in item else None,
        select=_texts(item.get("select", []), "select", where),
        tags=tuple(_tags(tags, where) for tags in item.get("tags", [])),
        elements=tuple(_choice(kind, "elements", get_args(ElementKind), where) for kind in kinds),
        reader=shared["reader"],
        license=item.get("license", shared["license"]),
        attribution=item.get("attribution", shared["attribution"]),
        **{key: item[key] for key in (*plain, "crs", "x_field", "y_field") if key in item},
    )


def _choice(value: str, key: str, choices: tuple[str, ...], where: str) -> Any:  # noqa: ANN401
    if value not in choices:
        known = ", ".join(repr(choice) for choice in choices)
        msg = f"{where} has {key} = {value!r}{nearest_name(value, choices)}; write one of {known}."
        raise CatalogError(msg)
    return value


def _texts(items: object, key: str, where: str) -> tuple[str, ...]:
    if not isinstance(items, list) or not all(isinstance(item, str) and item for item in items):
        msg = f"{where} has {key} = {items!r}; write a list of texts."
        raise CatalogError(msg)
    return tuple(items)


def _tags(item: object, where: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    if not isinstance(item, dict) or not item:
        msg = f"{where} has the tags {item!r}; write a table of keys and values."
        raise CatalogError(msg)
    return tuple(
        (key, _texts(value if isinstance(value, list) else [value], f"tag {key!r}", where))
        for key, value in item.items()
    )


def _radii(item: dict[str, Any], taxonomy: Taxonomy, where: str) -> tuple[tuple[str, float], ...]:
    for name, radius in item.items():
        _require_class(name, taxonomy, f"{where}, conflate")
        if isinstance(radius, bool) or not isinstance(radius, int | float) or not 0 < radius < 100:  # noqa: PLR2004
            msg = f"{where}, conflate has {name} = {radius!r}; write metres above 0 and below 100."
            raise CatalogError(msg)
    return tuple((name, float(radius)) for name, radius in item.items())


def _require_class(name: str, taxonomy: Taxonomy, where: str) -> None:
    try:
        taxonomy.by_name(name)
    except UnknownNameError as error:
        msg = f"{where}: {error}"
        raise CatalogError(msg) from error


def _class_by(item: dict[str, Any], taxonomy: Taxonomy, where: str) -> ClassBy:
    where = f"{where}, class_by"
    _check_keys(item, CLASS_BY_KEYS, where, CLASS_BY_KEYS)
    for value, name in item["values"].items():
        if not isinstance(name, str):
            msg = f"{where} has {value!r} = {name!r}; write the name of a class."
            raise CatalogError(msg)
        _require_class(name, taxonomy, where)
    return ClassBy(item["field"], tuple(item["values"].items()))


def _values(accepted: object, field: str, where: str) -> tuple[Value, ...]:
    values = accepted if isinstance(accepted, list) else [accepted]
    if not values or not all(isinstance(value, Value) for value in values):
        msg = (
            f"{where} filters {field!r} by {accepted!r}; "
            "write the accepted value, or a list of accepted values."
        )
        raise CatalogError(msg)
    return tuple(values)


def _rows(item: list[Any], where: str) -> tuple[int, int]:
    match item:
        # bool is an int to Python, never to a catalogue
        case [int(least), int(most)] if 0 <= least <= most and bool not in map(type, item):
            return least, most
    msg = f"{where} has rows = {item!r}; write [least, most]."
    raise CatalogError(msg)
