"""Layers of catalogues: the files and rows of a class of objects, of buildings or streets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import CatalogError, UnknownNameError
from semsig_gis.sources.filters import COMPARES, Condition, Value
from semsig_gis.storage import check_keys, metres, one_of, texts

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.core import Taxonomy
    from semsig_gis.sources.filters import Rules


GeometryKind = Literal["point", "line", "polygon"]
ElementKind = Literal["node", "way", "relation"]
Role = Literal["objects", "buildings", "streets"]
# Plausible widths of a street; other numbers have another unit or another meaning.
MIN_WIDTH_M = 0.1
MAX_WIDTH_M = 200.0


@dataclass(frozen=True, slots=True)
class ClassBy:
    """A field that decides the class of a row by its value.

    Values with an empty class are left out. Unlisted values are left out, too, or get the class of
    the layer with `otherwise`.
    """

    field: str
    classes: tuple[tuple[Value, str], ...]
    otherwise: bool = False


@dataclass(frozen=True, slots=True)
class WidthBy:
    """A field that decides the width of a street by its value.

    Widths are in metres; `default` is the width for other values, None if it is unknown.
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
        Name of the layer in the catalogue, and class of its rows; empty where `class_by` decides
        the class of every row, and for surroundings.
    files : tuple of str
        Name patterns (``*``, ``?``) of the layer's file.
    layer : str, optional
        Layer inside a file that holds several.
    where, exclusions : tuple of (str, tuple)
        Fields or tags with accepted values. A row counts if it meets all conditions of `where` and
        no condition of `exclusions`. Values are exact, except texts between slashes (a regular
        expression for the whole value), comparisons such as ``">=0"``, ``"none"`` (absent or
        empty) and ``"*"`` (every value except ``"no"``).
    class_by : ClassBy, optional
        Field that decides the class row by row.
    width_by, width_field : WidthBy, str, optional
        For streets: the field that decides the width by its value, and the field of the width in
        metres, which has priority.
    name_field : str, optional
        For streets: the field of the name.
    id_field, unique_id : str, bool, optional
        Field that identifies a row in its source (by default the number of the feature), and
        whether rows with the same id are the same object, also in several files.
    geometry, crs, rows : {"point", "line", "polygon"}, str, tuple of (int, int), optional
        Expected geometry, CRS (used if the file states none), and minimum and maximum number of
        rows.
    x_field, y_field : str, optional
        Coordinate columns of a CSV file.
    aliases : tuple of (str, tuple of str)
        Fields and their names in other editions of the file (Opendatasoft only).
    dataset, server_where, select : str, str, tuple of str, optional
        Name of the dataset on its portal, filter in the query language of the portal, and fields
        to request.
    tags, elements : tuple of tuple of (str, tuple of str), tuple of {"node", "way", "relation"}
        Alternatives of OpenStreetMap tags, and kinds of element. An element counts if it has all
        tags of one alternative; the value ``"*"`` accepts every value except ``"no"``.
    role : {"objects", "buildings", "streets"}
        Street objects, footprints of buildings, or centre lines. Only objects have a class.
    optional, reader, note : bool, str, str
        Whether the layer is read only on request, the reader of its file, and a remark for
        users.
    license, attribution : str
        Licence of the data and the credit line that its publisher requires.

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
        """Whether a field gives the widths of streets."""
        return self.width_by is not None or self.width_field is not None

    @property
    def classes(self) -> tuple[str, ...]:
        """Classes that objects of the layer may have."""
        by = self.class_by
        if by is None:
            return (self.class_name,) if self.role == "objects" else ()
        names = [name for _, name in by.classes if name]
        return tuple(dict.fromkeys([self.class_name, *names] if by.otherwise else names))

    @property
    def terms(self) -> str:
        """Attribution and licence of the layer."""
        return f"{self.attribution or 'no attribution given'} ({self.license})"

    @property
    def fields(self) -> tuple[tuple[str, str], ...]:
        """Catalogue keys and the fields that they name, as pairs; coordinates are omitted."""
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
OTHERWISE = "class"  # the only value of the key `otherwise` of class_by
WIDTH_BY_KEYS = {"field": str, "values": dict, "default": object}


def layer_of(
    item: object, where: str, *, taxonomy: Taxonomy, shared: Mapping[str, Any]
) -> LayerSpec:
    """Return the layer of a ``[[layers]]`` table; CatalogError if it is not valid.

    `shared` has default files, reader, license, attribution and exclusions; the default exclusions
    do not apply to surroundings.
    """
    if not isinstance(item, dict):
        raise CatalogError(f"{where} has the layer {item!r}; write a [[layers]] table.")
    where = f"{where}, layer {item.get('name', '?')!r}"
    check_keys(item, LAYER_KEYS, where, ("name",))
    role = one_of(item.get("role", "objects"), "role", get_args(Role), where)
    class_by = _class_by(item, role, taxonomy, where)
    if "crs" in item:
        try:
            CRS.from_user_input(item["crs"])
        except CRSError as error:
            raise CatalogError(
                f"{where} has crs = {item['crs']!r}, which is unknown; "
                "write a code such as 'EPSG:4326'."
            ) from error
    if role != "streets" and (of_streets := {"width_by", "width_field", "name_field"} & set(item)):
        raise CatalogError(
            f"{where} has {min(of_streets)}, which only streets have; remove it or add its role."
        )
    if item.get("unique_id", False) and "id_field" not in item:
        raise CatalogError(
            f"{where} has unique_id = true without an id_field; name the field of the ids."
        )
    files = texts(item.get("files", list(shared["files"])), "files", where)
    if not files and ("files" in item or "dataset" not in item):
        raise CatalogError(f"{where} has files = []; write a list of file names or patterns.")
    kinds = texts(item.get("elements", list(get_args(ElementKind))), "elements", where)
    exclusions = shared["exclusions"] if role == "objects" else ()
    if "not" in item:
        exclusions = conditions_of(item["not"], "not", where)
    plain = {key: value for key, value in item.items() if LAYER_KEYS[key] in {str, bool}}
    parsed = {
        "class_name": plain.pop("class", ""),
        "role": role,
        "files": files,
        "where": conditions_of(item.get("where", {}), "where", where),
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
    return LayerSpec(**{**shared, **plain, **parsed})


def _class_by(
    layer: Mapping[str, Any], role: Role, taxonomy: Taxonomy, where: str
) -> ClassBy | None:
    """Check the classes of a layer; return its ``class_by`` or None."""
    by = None
    if "class_by" in layer:
        item, inner = layer["class_by"], f"{where}, class_by"
        check_keys(item, {**CLASS_BY_KEYS, "otherwise": str}, inner, CLASS_BY_KEYS)
        if item.get("otherwise", OTHERWISE) != OTHERWISE:
            raise CatalogError(
                f"{inner} has otherwise = {item['otherwise']!r}; write {OTHERWISE!r}, which gives "
                "other values the layer's class, or remove it, so that they are left out."
            )
        for value, name in item["values"].items():
            if not isinstance(name, str):
                raise CatalogError(f"{inner} has {value!r} = {name!r}; write the name of a class.")
            require_class(name, taxonomy, inner)
        by = ClassBy(item["field"], tuple(item["values"].items()), "otherwise" in item)
    if role == "objects" and "class" not in layer and (by is None or by.otherwise):
        raise CatalogError(f"{where} lacks the key 'class'; add it.")
    if role != "objects" and "class" in layer:
        raise CatalogError(f"{where} needs no class; remove it.")
    if "class" in layer:
        require_class(layer["class"], taxonomy, where)
    return by


def _tags(item: object, where: str) -> tuple[tuple[str, tuple[str, ...]], ...]:
    if not isinstance(item, dict) or not item:
        raise CatalogError(f"{where} has the tags {item!r}; write a table of keys and values.")
    tags = tuple(
        (key, texts(value if isinstance(value, list) else [value], f"tag {key!r}", where))
        for key, value in item.items()
    )
    for key, values in tags:
        comparison = next(filter(COMPARES.match, values), None)
        if comparison is not None:
            raise CatalogError(
                f"{where} has the tag {key!r} = {comparison!r}, and tags are exact; compare in "
                f"where = {{ {key} = {comparison!r} }}."
            )
    return tags


def require_class(name: str, taxonomy: Taxonomy, where: str) -> None:
    """Raise CatalogError for an unknown class, with the nearest name."""
    try:
        taxonomy.by_name(name)
    except UnknownNameError as error:
        raise CatalogError(f"{where}: {error}") from error


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


def conditions_of(item: dict[str, Any], key: str, where: str) -> Rules:
    """Check a TOML table of conditions, such as ``where`` or ``not``, and return its rules."""
    rules = []
    for field, accepted in item.items():
        values: list[Any] = accepted if isinstance(accepted, list) else [accepted]
        if not values or not all(isinstance(value, Value) for value in values):
            raise CatalogError(
                f"{where} filters {field!r} by {accepted!r}; "
                "write the accepted value, or a list of accepted values."
            )
        try:
            Condition.parse(values)
        except CatalogError as error:
            raise CatalogError(
                f"{where} has {key} = {{ {field} = {accepted!r} }}: {error}"
            ) from error
        rules.append((field, tuple(values)))
    return tuple(rules)


def _rows(item: list[Any], where: str) -> tuple[int, int]:
    match item:
        # True and False are integers in Python, but not in a catalogue
        case [int(least), int(most)] if 0 <= least <= most and bool not in map(type, item):
            return least, most
    raise CatalogError(f"{where} has rows = {item!r}; write [least, most].")
