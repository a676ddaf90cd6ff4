"""Layers of catalogues: the files and rows of a class of objects, of buildings or streets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import (
    TEXTS,
    Accepts,
    CatalogError,
    Flag,  # noqa: TC001 - of fields, as the next
    Parsed,
    Scalar,
    Text,
    Texts,
    file_key,
    length,
    metres,
    nearest_name,
    number,
    pairs,
)
from semsig_gis.sources.encodings import parse_encoding
from semsig_gis.sources.filters import COMPARES, Condition, Rules, Value  # noqa: TC001

if TYPE_CHECKING:
    from semsig_gis.core import Taxonomy


GeometryKind = Literal["point", "line", "polygon"]
ElementKind = Literal["node", "way", "relation"]
Role = Literal["objects", "buildings", "streets"]
AxisOrder = Literal["lat_lon", "lon_lat"]
Derivation = Literal["junctions", "dead_ends", "building_corners", "gaps"]
DERIVED: dict[Derivation, tuple[str, ...]] = {
    "junctions": ("t_junction", "crossroads", "large_junction", "roundabout"),
    "dead_ends": ("dead_end",),
    "building_corners": ("building_corner",),
    "gaps": ("building_gap",),
}
"""The classes that are computed from streets and buildings."""
# Plausible widths of a street; other numbers have another unit or another meaning.
MIN_WIDTH_M = 0.1
MAX_WIDTH_M = 200.0


def _conditions(table: dict[str, Any]) -> Rules:
    """Return the rules of a table of conditions; CatalogError if a condition is not valid."""
    rules = []
    for field, accepted in table.items():
        values = accepted if isinstance(accepted, list) else [accepted]
        try:
            Condition.parse(values)
        except CatalogError as error:
            raise CatalogError(f"{field} = {accepted!r} cannot be used: {error}") from error
        rules.append((field, tuple(values)))
    return tuple(rules)


def _tags(table: dict[str, Any]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return the tags of an alternative; CatalogError for a comparison, as tags are exact."""
    tags = tuple(
        (key, tuple(value) if isinstance(value, list) else (value,)) for key, value in table.items()
    )
    for key, values in tags:
        comparison = next(filter(COMPARES.match, values), None)
        if comparison is not None:
            raise CatalogError(
                f"the tag {key!r} = {comparison!r} is a comparison, and tags are exact; compare in "
                f"where = {{ {key} = {comparison!r} }}."
            )
    return tags


def _ordered(limits: tuple[int, int]) -> tuple[int, int]:
    if limits[0] > limits[1]:
        raise ValueError
    return limits


def _crs(code: str) -> str:
    try:
        CRS.from_user_input(code)
    except CRSError as error:
        raise ValueError from error
    return code


_Encoding = Annotated[
    str, Parsed(parse_encoding), Accepts("the name of an encoding such as 'cp1251' or 'utf-8'")
]
_Accepted = Annotated[
    Scalar | Annotated[list[Scalar], length(1)],
    Accepts("the accepted value, or a list of accepted values"),
]
Conditions = Annotated[Rules, Parsed(_conditions, dict[str, _Accepted])]
_Tag = Annotated[Text | list[Text], Accepts("a text or a list of texts")]
_Tags = Annotated[
    tuple[tuple[str, tuple[str, ...]], ...],
    Parsed(_tags, Annotated[dict[str, _Tag], length(1)]),
]
_Count = Annotated[int, number("a number of rows", 0, whole=True)]
_OfClasses = Annotated[bool, Accepts("the shape of its class", {"type": "none"})]
TextFields = Annotated[tuple[tuple[str, str], ...], pairs(Text)]
_Width = Annotated[float, metres(MAX_WIDTH_M)]


@dataclass(frozen=True, slots=True)
class ClassBy:
    """A field that decides the class of a row by its value.

    Values with an empty class are left out. Unlisted values are left out, too, or get the class of
    the layer with `otherwise`.
    """

    field: str
    classes: Annotated[tuple[tuple[Value, str], ...], pairs(str), file_key("values")]
    otherwise: Annotated[
        bool,
        Parsed(bool, Literal["class"]),
        Accepts(
            "'class', which gives other values the layer's class, or remove it, so that they are "
            "left out"
        ),
    ] = False


@dataclass(frozen=True, slots=True)
class WidthBy:
    """A field that decides the width of a street by its value.

    Widths are in metres; `default` is the width for other values, None if it is unknown.
    """

    field: str
    widths: Annotated[tuple[tuple[Value, float], ...], pairs(_Width), file_key("values")]
    default: _Width | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LayerSpec:
    """One layer of a source and the class of street object it holds.

    Parameters
    ----------
    name : str
        Name of the layer in the catalogue.
    class_name : str
        Class of its rows; empty where `class_by` decides the class of every row, and for
        surroundings.
    files : tuple of str
        Name patterns (``*``, ``?``) of the layer's file.
    layer : str, optional
        Layer inside a file that holds several.
    where : tuple of (str, tuple)
        Fields or tags with accepted values; a row counts if it meets all conditions. Values are
        exact, except texts between slashes (a regular expression for the whole value), comparisons
        such as ``">=0"``, ``"none"`` (absent or empty) and ``"*"`` (every value except ``"no"``).
    exclusions : tuple of (str, tuple)
        Conditions of the same form; a row that meets one is left out.
    class_by : ClassBy, optional
        Field that decides the class row by row.
    width_by : WidthBy, optional
        For streets: the field that decides the width by its value.
    width_field : str, optional
        For streets: the field of the width in metres, which has priority over `width_by`.
    name_field : str, optional
        For streets and buildings: the field of the name.
    texts : tuple of (str, str)
        For objects: columns of what is written on them (``name``, ``brand``, ``operator``, ``ref``,
        ``house_number``, ``street``), and the fields of these.
    height_field, levels_field : str, optional
        For objects and buildings: the field of the height in metres, and the field of the number of
        storeys, which gives the height where the first one does not.
    group_field : str, optional
        For extended things: a field with the same value in all rows of one thing.
    derive : {"junctions", "dead_ends", "building_corners", "gaps"}, optional
        What the objects of the layer are computed from, streets and buildings, instead of files.
    id_field : str, optional
        Field that identifies a row in its source; by default the number of the feature.
    unique_id : bool
        Whether rows with the same id are the same object, also in several files.
    geometry : {"point", "line", "polygon"}
        Expected geometry.
    crs : str, optional
        CRS if the file states none, such as ``EPSG:4326``.
    encoding : str, optional
        Encoding of the texts of a shapefile or CSV file, such as ``cp1251``, if it states none or
        a wrong one.
    rows : tuple of (int, int), optional
        Expected minimum and maximum number of rows.
    x_field, y_field : str, optional
        Fields of the coordinates (longitude and latitude, or easting and northing) of a table.
    geometry_field : str, optional
        Field of a table that holds the whole position: well-known text or binary, GeoJSON, latitude
        and longitude, and other notations.
    axis_order : {"lat_lon", "lon_lat"}, optional
        Order of two numbers in `geometry_field`, if they do not show it. With ``lat_lon``, its
        geometries have latitude first, too.
    aliases : tuple of (str, tuple of str)
        Fields and their names in other editions of the file (Opendatasoft only).
    dataset : str, optional
        Name of the dataset on its portal.
    server_where : str, optional
        Filter in the query language of the portal.
    select : tuple of str
        Fields to request; all by default.
    tags : tuple of tuple of (str, tuple of str)
        Alternatives of OpenStreetMap tags, or columns of Overture Maps. An element counts if it
        has all tags of one alternative; the value ``"*"`` accepts every value except ``"no"``.
    elements : tuple of {"node", "way", "relation"}
        Kinds of OpenStreetMap element.
    role : {"objects", "buildings", "streets"}
        Street objects, footprints of buildings, or centre lines. Only objects have a class.
    optional : bool
        Whether the layer is read only on request.
    reader : str
        The reader of its file; by default that of the catalogue.
    extended : bool
        Whether one of its classes is a line or an area.
    note : str
        A remark for users.
    license, attribution : str
        Licence of the data and the credit line that its publisher requires.

    Examples
    --------
    >>> LayerSpec(name="trees", class_name="alignment_tree", files=("trees.*",)).geometry
    'point'
    """

    name: str
    class_name: Annotated[str, file_key("class")] = ""
    files: Texts = ()
    layer: str | None = None
    where: Conditions = ()
    exclusions: Annotated[Conditions, file_key("not")] = ()
    class_by: ClassBy | None = None
    width_by: WidthBy | None = None
    width_field: str | None = None
    name_field: str | None = None
    texts: TextFields = ()
    height_field: str | None = None
    levels_field: str | None = None
    group_field: str | None = None
    derive: Derivation | None = None
    id_field: str | None = None
    geometry: GeometryKind = "point"
    crs: Annotated[str, Parsed(_crs), Accepts("a known code such as 'EPSG:4326'")] | None = None
    encoding: _Encoding | None = None
    rows: Annotated[tuple[_Count, _Count], Parsed(_ordered), Accepts("[least, most]")] | None = None
    x_field: str | None = None
    y_field: str | None = None
    geometry_field: str | None = None
    axis_order: AxisOrder | None = None
    aliases: Annotated[tuple[tuple[str, tuple[str, ...]], ...], pairs(Texts)] = ()
    unique_id: Flag = False
    dataset: str | None = None
    server_where: str | None = None
    select: Texts = ()
    tags: tuple[_Tags, ...] = ()
    elements: tuple[ElementKind, ...] = ("node", "way", "relation")
    role: Role = "objects"
    optional: Flag = False
    reader: str = "vector_file"
    extended: _OfClasses = False
    note: str = ""
    license: str = "unknown"
    attribution: str = ""

    @property
    def has_width(self) -> bool:
        """Whether a field gives the widths of streets."""
        return self.width_by is not None or self.width_field is not None

    @property
    def has_height(self) -> bool:
        """Whether a field gives the heights of objects or buildings."""
        return self.height_field is not None or self.levels_field is not None

    @property
    def classes(self) -> tuple[str, ...]:
        """Classes that objects of the layer may have."""
        if self.derive is not None:
            return DERIVED[self.derive]
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
        uses += [("texts", field) for _, field in self.texts]
        uses += [("height_field", self.height_field)] if self.height_field else []
        uses += [("levels_field", self.levels_field)] if self.levels_field else []
        uses += [("group_field", self.group_field)] if self.group_field else []
        uses += [("id_field", self.id_field)] if self.id_field else []
        return tuple(uses)

    def check(self, taxonomy: Taxonomy) -> None:
        """Raise CatalogError or UnknownNameError if the fields do not fit each other."""
        if self.derive is not None:
            self._check_derived(taxonomy)
            return
        by, is_objects = self.class_by, self.role == "objects"
        if is_objects and not self.class_name and (by is None or by.otherwise):
            raise CatalogError("the key 'class' is missing; add it.")
        if not is_objects and self.class_name:
            raise CatalogError(f"a layer of {self.role} needs no class; remove it.")
        names = [name for _, name in by.classes] if by else []
        for name in [self.class_name, *names] if self.class_name else names:
            taxonomy.by_name(name)
        self._check_roles()
        if self.unique_id and self.id_field is None:
            raise CatalogError("unique_id needs an id_field; name the field of the ids.")
        if self.geometry_field is not None and (self.x_field or self.y_field):
            raise CatalogError(
                "the position is in geometry_field or in x_field and y_field; remove one of them."
            )
        if self.axis_order is not None and self.geometry_field is None:
            raise CatalogError("axis_order needs a geometry_field; name the field of the position.")
        if not self.files and self.dataset is None:
            raise CatalogError("files = [] names no file; write file names or patterns.")

    def _check_derived(self, taxonomy: Taxonomy) -> None:
        """Raise CatalogError for keys that a layer without files cannot have."""
        keys = {"class": self.class_name, "class_by": self.class_by, "files": self.files,
                 "tags": self.tags, "where": self.where, "not": self.exclusions,
                 "dataset": self.dataset}  # fmt: skip
        useless = next((key for key, value in keys.items() if value), None)
        if useless is not None or self.role != "objects":
            raise CatalogError(
                f"derive computes objects from streets and buildings, without "
                f"{useless or f'the role {self.role!r}'}; remove one of them."
            )
        for name in self.classes:
            taxonomy.by_name(name)

    def _check_roles(self) -> None:
        """Raise CatalogError for fields that layers of its role do not have."""
        for key in ("width_by", "width_field"):
            if self.role != "streets" and getattr(self, key) is not None:
                raise CatalogError(f"only streets have {key}; remove it or add its role.")
        if self.role == "objects" and self.name_field is not None:
            raise CatalogError(
                "only streets and buildings have name_field; remove it or add its role."
            )
        if self.texts and self.role != "objects":
            raise CatalogError("only objects have texts; remove it, or use name_field.")
        if self.has_height and self.role == "streets":
            raise CatalogError("streets have no height; remove height_field and levels_field.")
        if self.group_field is not None and self.role != "objects":
            raise CatalogError("only objects have group_field; remove it or the role.")
        unknown = next((column for column, _ in self.texts if column not in TEXTS), None)
        if unknown is not None:
            raise CatalogError(
                f"texts has the unknown column {unknown!r}{nearest_name(unknown, TEXTS)}; "
                f"the columns are {', '.join(TEXTS)}."
            )
