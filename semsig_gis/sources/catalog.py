"""Catalogues: TOML files that say which layers of which source hold which class of object."""

from __future__ import annotations

import dataclasses
import importlib.resources
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core.display import Displayed
from semsig_gis.core.errors import (
    CatalogError,
    CrsError,
    InputError,
    UnknownNameError,
    nearest_name,
)
from semsig_gis.core.geometry import require_metric_crs
from semsig_gis.core.plugins import installed_catalogs
from semsig_gis.core.taxonomy import MAX_HEIGHT_M, MAX_RANGE_M, ObjectClass, Taxonomy
from semsig_gis.sources.conditions import COMPARES, Condition, Value
from semsig_gis.storage.text import read_text
from semsig_gis.storage.toml import check_keys, metres, one_of, parse_toml, texts

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from importlib.resources.abc import Traversable

    from semsig_gis.sources.conditions import Rules


GeometryKind = Literal["point", "line", "polygon"]
ElementKind = Literal["node", "way", "relation"]
Role = Literal["objects", "buildings", "streets"]
# No street is narrower or wider; the number is in another unit, or means something else.
MIN_WIDTH_M = 0.1
MAX_WIDTH_M = 200.0


@dataclass(frozen=True, slots=True)
class ClassBy:
    """A field whose value decides the class of a row.

    Rows of other values, and of values without a class, are left out, unless `otherwise` gives the
    former the layer's class.
    """

    field: str
    classes: tuple[tuple[Value, str], ...]
    otherwise: bool = False


@dataclass(frozen=True, slots=True)
class WidthBy:
    """A field that says of which class a street is, and how wide the streets of a class are.

    Widths are in metres; `default` is for other values, None where nobody knows.
    """

    field: str
    widths: tuple[tuple[Value, float], ...]
    default: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LayerSpec:
    """One layer of a source and the class of street object it holds.

    Parameters
    ----------
    name, class_name : str
        Name of the layer in the catalogue, and class of its rows; empty where `class_by` says it
        of every row, and for surroundings.
    files : tuple of str
        File-name patterns (``*``, ``?``) by which the layer's file is recognised.
    layer : str, optional
        Layer inside a file that holds several.
    where, exclusions : tuple of (str, tuple)
        Fields or tags and the values of each: of `where`, all must hold for a row to count, and of
        `exclusions`, none. Values are exact, but for texts between slashes (a regular expression
        that the whole value must match), comparisons such as ``">=0"``, ``"none"`` (absent or
        empty) and ``"*"`` (every value but ``"no"``).
    class_by : ClassBy, optional
        Field that decides the class row by row.
    width_by, width_field : WidthBy, str, optional
        Of streets: the field that says how wide they are by its class of street, and the one that
        holds their width in metres, which goes first.
    name_field : str, optional
        Of streets: the field that holds their name.
    id_field, unique_id : str, bool, optional
        Field that identifies a row in its source (else the feature's number does), and whether rows
        of the same id are the same object, also across several files.
    geometry, crs, rows : {"point", "line", "polygon"}, str, tuple of (int, int), optional
        What is expected: geometry, CRS (used where the file states none), and the least and largest
        number of rows.
    x_field, y_field : str, optional
        Coordinate columns of a CSV file.
    aliases : tuple of (str, tuple of str)
        Fields and the names that they go by in other editions of the file (Opendatasoft only).
    dataset, server_where, select : str, str, tuple of str, optional
        Name of the dataset on its portal, filter in the portal's own language, and fields to ask
        for.
    tags, elements : tuple of tuple of (str, tuple of str), tuple of {"node", "way", "relation"}
        OpenStreetMap elements that count, and their tags: alternatives, each of keys and accepted
        values that must all hold; the value ``"*"`` accepts every value but ``"no"``.
    role : {"objects", "buildings", "streets"}
        Street objects, footprints that hide them, or centre lines. Only objects have a class.
    optional, reader, note : bool, str, str
        Whether the layer is read only when it is named, the reader of its file, and a remark for
        people.
    license, attribution : str
        Licence of the data and the line that its publisher asks for.

    Examples
    --------
    >>> LayerSpec(name="trees", class_name="alignment_tree", files=("trees.*",)).geometry
    'point'
    """

    name: str
    class_name: str
    files: tuple[str, ...] = ()
    layer: str | None = None
    where: Rules = ()
    exclusions: Rules = ()
    class_by: ClassBy | None = None
    width_by: WidthBy | None = None
    width_field: str | None = None
    name_field: str | None = None
    id_field: str | None = None
    geometry: GeometryKind = "point"
    crs: str | None = None
    rows: tuple[int, int] | None = None
    x_field: str | None = None
    y_field: str | None = None
    aliases: tuple[tuple[str, tuple[str, ...]], ...] = ()
    unique_id: bool = False
    dataset: str | None = None
    server_where: str | None = None
    select: tuple[str, ...] = ()
    tags: tuple[tuple[tuple[str, tuple[str, ...]], ...], ...] = ()
    elements: tuple[ElementKind, ...] = ("node", "way", "relation")
    role: Role = "objects"
    optional: bool = False
    reader: str = "vector_file"
    note: str = ""
    license: str = "unknown"
    attribution: str = ""

    @property
    def has_width(self) -> bool:
        """Whether something is said about the widths of streets."""
        return self.width_by is not None or self.width_field is not None

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that objects of the layer may have."""
        by = self.class_by
        if by is None:
            return (self.class_name,) if self.role == "objects" else ()
        names = [name for _, name in by.classes if name]
        return tuple(dict.fromkeys([self.class_name, *names] if by.otherwise else names))

    @property
    def terms(self) -> str:
        """Whom to name for the layer, and under which licence."""
        return f"{self.attribution or 'no attribution given'} ({self.license})"

    @property
    def fields(self) -> tuple[tuple[str, str], ...]:
        """The keys that name a field of the file, but for coordinates, and the fields."""
        uses = [("where", field) for field, _ in self.where]
        uses += [("not", field) for field, _ in self.exclusions]
        uses += [("class_by", self.class_by.field)] if self.class_by else []
        uses += [("width_by", self.width_by.field)] if self.width_by else []
        uses += [("width_field", self.width_field)] if self.width_field else []
        uses += [("name_field", self.name_field)] if self.name_field else []
        uses += [("id_field", self.id_field)] if self.id_field else []
        return tuple(uses)


LAYER_KEYS = {
    "name": str,
    "class": str,
    "files": list,
    "layer": str,
    "where": dict,
    "not": dict,
    "class_by": dict,
    "width_by": dict,
    "width_field": str,
    "name_field": str,
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
OTHERWISE = "class"  # the one thing that class_by may say of other values
WIDTH_BY_KEYS = {"field": str, "values": dict, "default": object}


def layer_of(
    item: object, where: str, *, taxonomy: Taxonomy, shared: Mapping[str, Any]
) -> LayerSpec:
    """Return the checked layer of a ``[[layers]]`` table; CatalogError says what is wrong in it.

    `shared` has files, reader, license, attribution and exclusions of layers that do not say
    otherwise; surroundings have no exclusions but their own.
    """
    if not isinstance(item, dict):
        msg = f"{where} has the layer {item!r}; write a [[layers]] table."
        raise CatalogError(msg)
    where = f"{where}, layer {item.get('name', '?')!r}"
    check_keys(item, LAYER_KEYS, where, ("name",))
    role = one_of(item.get("role", "objects"), "role", get_args(Role), where)
    class_by = _class_by(item["class_by"], taxonomy, where) if "class_by" in item else None
    _require_classes(item, role, class_by, where)
    if "class" in item:
        require_class(item["class"], taxonomy, where)
    if "crs" in item:
        try:
            CRS.from_user_input(item["crs"])
        except CRSError as error:
            msg = (
                f"{where} has crs = {item['crs']!r}, which is unknown; "
                "write a code such as 'EPSG:4326'."
            )
            raise CatalogError(msg) from error
    if role != "streets" and (of_streets := {"width_by", "width_field", "name_field"} & set(item)):
        msg = f"{where} has {min(of_streets)}, which only streets have; remove it or add its role."
        raise CatalogError(msg)
    if item.get("unique_id", False) and "id_field" not in item:
        msg = f"{where} has unique_id = true without an id_field; name the field of the ids."
        raise CatalogError(msg)
    files = texts(item.get("files", list(shared["files"])), "files", where)
    if not files and ("files" in item or "dataset" not in item):
        msg = f"{where} has files = []; write a list of file names or patterns."
        raise CatalogError(msg)
    kinds = texts(item.get("elements", list(get_args(ElementKind))), "elements", where)
    exclusions = shared["exclusions"] if role == "objects" else ()
    if "not" in item:
        exclusions = _conditions(item["not"], "not", where)
    plain = {key: value for key, value in item.items() if LAYER_KEYS[key] in {str, bool}}
    own = {
        "class_name": plain.pop("class", ""),
        "role": role,
        "files": files,
        "where": _conditions(item.get("where", {}), "where", where),
        "exclusions": exclusions,
        "class_by": class_by,
        "width_by": _width_by(item["width_by"], where) if "width_by" in item else None,
        "aliases": tuple(
            (field, texts(names, f"aliases of {field!r}", where))
            for field, names in item.get("aliases", {}).items()
        ),
        "geometry": one_of(
            item.get("geometry", "point"), "geometry", get_args(GeometryKind), where
        ),
        "rows": _rows(item["rows"], where) if "rows" in item else None,
        "select": texts(item.get("select", []), "select", where),
        "tags": tuple(_tags(tags, where) for tags in item.get("tags", [])),
        "elements": tuple(one_of(kind, "elements", get_args(ElementKind), where) for kind in kinds),
    }
    return LayerSpec(**{**shared, **plain, **own})


def _require_classes(
    item: Mapping[str, Any], role: Role, class_by: ClassBy | None, where: str
) -> None:
    """Refuse objects without a class, and surroundings with one."""
    given = "class" in item
    if role == "objects" and not given and (class_by is None or class_by.otherwise):
        msg = f"{where} lacks the key 'class'; add it."
        raise CatalogError(msg)
    if role != "objects" and given:
        msg = f"{where} needs no class; remove it."
        raise CatalogError(msg)


def _tags(item: object, where: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    if not isinstance(item, dict) or not item:
        msg = f"{where} has the tags {item!r}; write a table of keys and values."
        raise CatalogError(msg)
    tags = tuple(
        (key, texts(value if isinstance(value, list) else [value], f"tag {key!r}", where))
        for key, value in item.items()
    )
    for key, values in tags:
        comparison = next(filter(COMPARES.match, values), None)
        if comparison is not None:
            msg = (
                f"{where} has the tag {key!r} = {comparison!r}, and tags are exact; compare in "
                f"where = {{ {key} = {comparison!r} }}."
            )
            raise CatalogError(msg)
    return tags


def require_class(name: str, taxonomy: Taxonomy, where: str) -> None:
    """Refuse a class that does not exist, with a CatalogError that offers the nearest name."""
    try:
        taxonomy.by_name(name)
    except UnknownNameError as error:
        msg = f"{where}: {error}"
        raise CatalogError(msg) from error


def _class_by(item: dict[str, Any], taxonomy: Taxonomy, where: str) -> ClassBy:
    where = f"{where}, class_by"
    check_keys(item, {**CLASS_BY_KEYS, "otherwise": str}, where, CLASS_BY_KEYS)
    if item.get("otherwise", OTHERWISE) != OTHERWISE:
        msg = (
            f"{where} has otherwise = {item['otherwise']!r}; write {OTHERWISE!r}, which gives "
            "other values the layer's class, or remove it, so that they are left out."
        )
        raise CatalogError(msg)
    for value, name in item["values"].items():
        if not isinstance(name, str):
            msg = f"{where} has {value!r} = {name!r}; write the name of a class."
            raise CatalogError(msg)
        require_class(name, taxonomy, where)
    return ClassBy(item["field"], tuple(item["values"].items()), "otherwise" in item)


def _width_by(item: dict[str, Any], where: str) -> WidthBy:
    where = f"{where}, width_by"
    check_keys(item, WIDTH_BY_KEYS, where, ("field", "values"))
    default = item.get("default")
    return WidthBy(
        item["field"],
        tuple(
            (value, metres(width, repr(value), f"{where}, values", most=MAX_WIDTH_M))
            for value, width in item["values"].items()
        ),
        None if default is None else metres(default, "default", where, most=MAX_WIDTH_M),
    )


def _conditions(item: dict[str, Any], key: str, where: str) -> Rules:
    return tuple((field, _values(accepted, key, field, where)) for field, accepted in item.items())


def _values(accepted: object, key: str, field: str, where: str) -> tuple[Value, ...]:
    values: list[Any] = accepted if isinstance(accepted, list) else [accepted]
    if not values or not all(isinstance(value, Value) for value in values):
        msg = (
            f"{where} filters {field!r} by {accepted!r}; "
            "write the accepted value, or a list of accepted values."
        )
        raise CatalogError(msg)
    try:
        Condition.parse(values)
    except CatalogError as error:
        msg = f"{where} has {key} = {{ {field} = {accepted!r} }}: {error}"
        raise CatalogError(msg) from error
    return tuple(values)


def _rows(item: list[Any], where: str) -> tuple[int, int]:
    match item:
        # bool is an int to Python, never to a catalogue
        case [int(least), int(most)] if 0 <= least <= most and bool not in map(type, item):
            return least, most
    msg = f"{where} has rows = {item!r}; write [least, most]."
    raise CatalogError(msg)


# Shipped beside the catalogues: the paper's classes, words by which drafts are made, and more.
NO_CATALOGS = frozenset({"drift", "geofabrik", "keywords", "taxonomy"})
# What a catalogue may say, and of which type; every other key is a mistake that gets named.
CATALOG_KEYS = {
    "name": str,
    "title": str,
    "place": str,
    "url": str,
    "license": str,
    "attribution": str,
    "metric_crs": str,
    "reader": str,
    "endpoints": list,
    "token": str,
    "geocoder": str,
    "files": list,
    "not": dict,
    "conflate": dict,
    "ranges": dict,
    "classes": list,
    "layers": list,
}
CLASS_KEYS = {"code": int, "symbol": str, "name": str, "title": str}
MEASURES = {"range_m": MAX_RANGE_M, "height_m": MAX_HEIGHT_M, "height_sigma": MAX_HEIGHT_M}
MAX_MERGING_M = 100.0


@dataclass(frozen=True, repr=False, kw_only=True)
class Catalog(Displayed):
    """A source of open data: its classes, its layers and its licence.

    Parameters
    ----------
    name, title : str
        Short name, and the one to show to people.
    taxonomy : Taxonomy
        The paper's classes and the catalogue's own.
    layers : tuple of LayerSpec
        The layers.
    metric_crs : str, optional
        Coordinate reference system in metres in which distances are taken; by default the UTM zone
        of the data.
    place : str
        Where the data lies, such as ``"Vienna, Austria"``.
    url : str
        Where the data is published.
    reader : str
        Reader of `sources` for its files.
    endpoints : tuple of str
        Base addresses of the services that send the data, best first.
    token : str, optional
        Environment variable with the access token that they want.
    geocoder : str, optional
        Base address of the Nominatim service that knows places by name.
    conflate : tuple of (str, float)
        Classes whose objects from different layers are the same thing within so many metres.
    license, attribution : str
        What holds for every layer that does not say otherwise.

    Examples
    --------
    >>> catalog = load_catalog("montpellier")
    >>> catalog.layer("cameras").class_name
    'camera'
    >>> demo_objects.taxonomy.classes == catalog.taxonomy.classes[:11]
    True
    """

    name: str
    title: str
    taxonomy: Taxonomy
    layers: tuple[LayerSpec, ...]
    metric_crs: str | None = None
    place: str = ""
    url: str = ""
    reader: str = "vector_file"
    endpoints: tuple[str, ...] = ()
    token: str | None = None
    geocoder: str | None = None
    conflate: tuple[tuple[str, float], ...] = ()
    license: str = "unknown"
    attribution: str = ""

    def _facts(self) -> dict[str, object]:
        return {
            "name": self.name,
            "title": self.title,
            "layers": len(self.layers),
            "classes": len(self.taxonomy.classes),
            "licence": self.license,
        }

    @property
    def classes(self) -> tuple[ObjectClass, ...]:
        """The classes that its layers hold."""
        held = {name for spec in self.layers for name in spec.classes}
        return tuple(item for item in self.taxonomy.classes if item.name in held)

    def layer(self, name: str) -> LayerSpec:
        """Return the layer of that name; UnknownNameError, with the nearest, if there is none."""
        for spec in self.layers:
            if spec.name == name:
                return spec
        names = [spec.name for spec in self.layers]
        msg = (
            f"catalogue {self.name!r} has no layer {name!r}{nearest_name(name, names)}; "
            f"its layers are {', '.join(names)}."
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
    >>> paper_taxonomy().by_symbol("D").name
    'street_light'
    """
    source = data_folder() / "taxonomy.toml"
    content = parse_toml(source.read_text(encoding="utf-8"), "taxonomy.toml")
    check_keys(content, {"classes": list}, "taxonomy.toml")
    return Taxonomy(_classes(content["classes"], "taxonomy.toml"))


def catalog_names() -> tuple[str, ...]:
    """Return the names that `load_catalog` takes, sorted, with those that other packages bring."""
    return tuple(sorted(_sources()))


def _sources() -> dict[str, Path | Traversable]:
    """Return the file of every catalogue by name."""
    shipped = _shipped()
    return {**shipped, **installed_catalogs(taken=shipped)}


def _shipped() -> dict[str, Path | Traversable]:
    """Return the file of every built-in catalogue by name."""
    return {
        Path(item.name).stem: item
        for item in data_folder().iterdir()
        if item.name.endswith(".toml") and Path(item.name).stem not in NO_CATALOGS
    }


def built_in_taxonomy() -> Taxonomy:
    """Return the classes of all built-in catalogues."""
    return combine_catalogs([load_catalog(name) for name in sorted(_shipped())]).taxonomy


def load_catalog(name: str | Path) -> Catalog:
    """Read and check a catalogue.

    Parameters
    ----------
    name : str or Path
        Name of a built-in or installed catalogue, or path of a TOML file (it ends in ``.toml``).
        UnknownNameError if there is none of that name.

    Returns
    -------
    Catalog
        The catalogue; its taxonomy is the paper's classes followed by its own. CatalogError if the
        file is missing or not TOML, has a key that means nothing, lacks one that is needed, or
        names a class or CRS that does not exist.

    Examples
    --------
    >>> from semsig_gis import load_catalog
    >>> load_catalog("montpellier").layer("trees").class_name
    'alignment_tree'
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
        # A package may lie in an archive, whose members are no files.
        content = read_text(source) if isinstance(source, Path) else source.read_text("utf-8")
    except UnicodeDecodeError as error:
        msg = f"catalogue {text} is not UTF-8 text ({error}); save it as UTF-8."
        raise CatalogError(msg) from error
    except OSError as error:
        msg = f"catalogue {text} cannot be read ({error.strerror}); give a file that you can read."
        raise CatalogError(msg) from error
    return _catalog(parse_toml(content, text), text)


def combine_catalogs(catalogs: Sequence[Catalog]) -> Catalog:
    """Make one catalogue of several, so that their layers can be loaded and merged together.

    Parameters
    ----------
    catalogs : sequence of Catalog
        At least one, each once (else InputError); the first is trusted most when objects are
        merged.

    Returns
    -------
    Catalog
        With several, each layer's name begins with its catalogue's. The first of them that says
        a metric CRS, how far a class is seen, how tall it is, or within how many metres it is
        merged, decides that. CatalogError if they mean different classes by one name, code or
        symbol.

    Examples
    --------
    >>> from semsig_gis import combine_catalogs, load_catalog
    >>> both = combine_catalogs([load_catalog("montpellier"), load_catalog("openstreetmap")])
    >>> both.layers[0].name
    'montpellier/trees'
    """
    names = [catalog.name for catalog in catalogs]
    if not names or len(set(names)) < len(names):
        msg = f"the catalogues given are {names}; give one or more, each once."
        raise InputError(msg)
    if len(catalogs) == 1:
        return catalogs[0]
    classes = [item for catalog in catalogs for item in catalog.taxonomy.classes]
    # Catalogues that differ in how far a class is seen, or how tall it is, mean the same class.
    measures: dict[ObjectClass, dict[str, Any]] = {}
    for item in classes:
        kind = dataclasses.replace(item, range_m=None, height_m=None, height_sigma=None)
        said = {name: getattr(item, name) for name in MEASURES if getattr(item, name) is not None}
        measures[kind] = {**said, **measures.get(kind, {})}
    try:
        taxonomy = Taxonomy(
            tuple(dataclasses.replace(kind, **said) for kind, said in measures.items())
        )
    except CatalogError as error:
        msg = f"catalogues {' and '.join(names)} do not go together: {error}"
        raise CatalogError(msg) from error
    return Catalog(
        name="+".join(names),
        title=" and ".join(catalog.title for catalog in catalogs),
        taxonomy=taxonomy,
        layers=tuple(
            dataclasses.replace(spec, name=f"{catalog.name}/{spec.name}")
            for catalog in catalogs
            for spec in catalog.layers
        ),
        metric_crs=next((item.metric_crs for item in catalogs if item.metric_crs), None),
        conflate=tuple(
            {name: radius for item in reversed(catalogs) for name, radius in item.conflate}.items()
        ),
    )


def _known() -> str:
    return ", ".join(repr(name) for name in catalog_names())


def data_folder() -> Traversable:
    """Return the folder ``data_sources``: in the wheel, or at the top of a checkout."""
    shipped = importlib.resources.files("semsig_gis") / "data_sources"
    if shipped.is_dir():
        return shipped
    return Path(__file__).resolve().parents[2] / "data_sources"


def _catalog(content: dict[str, Any], where: str) -> Catalog:
    where = f"catalogue {where}"
    check_keys(content, CATALOG_KEYS, where, ("name", "title", "layers"))
    own = _classes(content.get("classes", []), where)
    try:
        taxonomy = paper_taxonomy().extended(own)
        if "metric_crs" in content:
            require_metric_crs(content["metric_crs"])
    except (CatalogError, CrsError) as error:
        msg = f"{where}: {error}"
        raise CatalogError(msg) from error
    taxonomy = taxonomy.with_ranges(_ranges(content.get("ranges", {}), taxonomy, where))
    plain = {key: value for key, value in content.items() if CATALOG_KEYS[key] is str}
    shared: dict[str, Any] = {
        key: plain[key] for key in ("license", "attribution", "reader") if key in plain
    }
    shared["files"] = texts(content.get("files", []), "files", where)
    shared["exclusions"] = _conditions(content.get("not", {}), "not", where)
    layers = tuple(
        layer_of(item, where, taxonomy=taxonomy, shared=shared) for item in content["layers"]
    )
    names = [spec.name for spec in layers]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None or not names:
        what = f"two layers named {double!r}; rename one" if names else "no layer; add [[layers]]"
        msg = f"{where} has {what}."
        raise CatalogError(msg)
    radii = _metres_by_class(
        content.get("conflate", {}), taxonomy, f"{where}, conflate", most=MAX_MERGING_M
    )
    return Catalog(
        **plain,
        taxonomy=taxonomy,
        layers=layers,
        endpoints=texts(content.get("endpoints", []), "endpoints", where),
        conflate=tuple(radii.items()),
    )


def _classes(items: list[Any], where: str) -> tuple[ObjectClass, ...]:
    classes = []
    for number, item in enumerate(items, start=1):
        place = f"{where}, class {number}"
        if not isinstance(item, dict):
            msg = f"{place} is {item!r}; write a [[classes]] table."
            raise CatalogError(msg)
        check_keys(item, {**CLASS_KEYS, **dict.fromkeys(MEASURES, object)}, place, CLASS_KEYS)
        lengths = {
            key: metres(item[key], key, place, most=most)
            for key, most in MEASURES.items()
            if key in item
        }
        try:
            classes.append(ObjectClass(**{**item, **lengths}))
        except CatalogError as error:
            msg = f"{place}: {error}"
            raise CatalogError(msg) from error
    return tuple(classes)


def _ranges(item: dict[str, Any], taxonomy: Taxonomy, where: str) -> dict[str, float]:
    """Return the ranges that a catalogue gives to classes outside their own tables."""
    ranges = _metres_by_class(item, taxonomy, f"{where}, ranges", most=MAX_RANGE_M)
    double = next((name for name in ranges if taxonomy.by_name(name).range_m is not None), None)
    if double is not None:
        msg = f"{where} has a range_m of {double!r} and one in ranges; remove one of them."
        raise CatalogError(msg)
    return ranges


def _metres_by_class(
    item: dict[str, Any], taxonomy: Taxonomy, where: str, *, most: float
) -> dict[str, float]:
    for name in item:
        require_class(name, taxonomy, where)
    return {name: metres(value, name, where, most=most) for name, value in item.items()}
