"""What a catalogue says of one layer: where it is, what it holds, and what is expected of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = [
    "ANY_VALUE",
    "MAX_WIDTH_M",
    "MIN_WIDTH_M",
    "ClassBy",
    "ElementKind",
    "GeometryKind",
    "LayerSpec",
    "Role",
    "Value",
    "WidthBy",
]

Value = str | int | float | bool
GeometryKind = Literal["point", "line", "polygon"]
ElementKind = Literal["node", "way", "relation"]
Role = Literal["objects", "buildings", "streets"]
# Stands for every value of a tag but "no".
ANY_VALUE = "*"
# No street is narrower or wider; the number is in another unit, or means something else.
MIN_WIDTH_M = 0.1
MAX_WIDTH_M = 200.0


@dataclass(frozen=True, slots=True)
class ClassBy:
    """A field whose value decides the class of a row.

    A row with a value that is not among `classes` keeps the class of its layer.
    """

    field: str
    classes: tuple[tuple[Value, str], ...]


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
    name : str
        Name of the layer in the catalogue.
    class_name : str
        Class of its rows.
    files : tuple of str
        File-name patterns (``*``, ``?``) by which the layer's file is recognised.
    layer : str, optional
        Layer inside a file that holds several.
    where : tuple of (str, tuple)
        Fields and the values of each that are accepted, compared exactly; all must hold. A text
        between slashes is a regular expression that the whole value must match.
    class_by : ClassBy, optional
        Field that decides the class row by row.
    width_by : WidthBy, optional
        Of streets: the field that says how wide they are by its class of street.
    width_field : str, optional
        Of streets: the field that holds their width in metres; where it says nothing usable,
        `width_by` holds.
    id_field : str, optional
        Field that identifies a row in its source; else the feature's number.
    geometry : {"point", "line", "polygon"}
        Geometry that is expected.
    crs : str, optional
        Coordinate reference system that is expected; it is used where the file states none.
    rows : tuple of (int, int), optional
        Least and largest number of rows that are plausible.
    x_field, y_field : str, optional
        Coordinate columns of a CSV file.
    aliases : tuple of (str, tuple of str)
        Fields and the names that they go by in other editions of the file (Opendatasoft only).
    unique_id : bool
        Whether rows of the same id are the same object, also across several files.
    dataset : str, optional
        Name of the dataset on its portal.
    server_where : str, optional
        Filter that the portal applies before it sends, in its own language.
    select : tuple of str
        Fields to ask the portal for; all by default.
    tags : tuple of tuple of (str, tuple of str)
        OpenStreetMap tags: alternatives, each of keys and accepted values that must all hold;
        the value ``"*"`` accepts every value but ``"no"``.
    elements : tuple of {"node", "way", "relation"}
        OpenStreetMap elements that count.
    role : {"objects", "buildings", "streets"}
        What the layer is for: street objects, footprints that hide them, or centre lines of
        streets. Only street objects have a class.
    optional : bool
        Whether the layer is read only when it is named.
    reader : str
        Reader of `semsig_gis.sources` for its file.
    note : str
        Remark for people, such as how sure a dataset name is.
    license, attribution : str
        Licence of the data and the line that its publisher asks for.

    Examples
    --------
    >>> LayerSpec(name="trees", class_name="alignment_tree", files=("*trees*.geojson",)).geometry
    'point'
    """

    name: str
    class_name: str
    files: tuple[str, ...] = ()
    layer: str | None = None
    where: tuple[tuple[str, tuple[Value, ...]], ...] = ()
    class_by: ClassBy | None = None
    width_by: WidthBy | None = None
    width_field: str | None = None
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
    def fields(self) -> tuple[tuple[str, str], ...]:
        """The keys that name a field of the file, but for coordinates, and the fields."""
        uses = [("where", field) for field, _ in self.where]
        uses += [("class_by", self.class_by.field)] if self.class_by else []
        uses += [("width_by", self.width_by.field)] if self.width_by else []
        uses += [("width_field", self.width_field)] if self.width_field else []
        uses += [("id_field", self.id_field)] if self.id_field else []
        return tuple(uses)
