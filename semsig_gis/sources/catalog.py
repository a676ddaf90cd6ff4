"""Catalogues: TOML files that describe the layers of a source and their classes."""

from __future__ import annotations

import dataclasses
import functools
import importlib.resources
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from semsig_gis.core import (
    MAX_RANGE_M,
    CatalogError,
    CrsError,
    Displayed,
    FileTable,
    InputError,
    ObjectClass,  # noqa: TC001 - of fields
    Taxonomy,
    Text,
    Texts,  # noqa: TC001 - of fields
    UnknownNameError,
    file_key,
    installed_catalogs,
    json_schema,
    length,
    metres,
    nearest_name,
    pairs,
    read_table,
    require_metric_crs,
)
from semsig_gis.sources.layer_spec import Conditions, LayerSpec, TextFields  # noqa: TC001
from semsig_gis.storage import parse_toml, read_text

if TYPE_CHECKING:
    from collections.abc import Sequence
    from importlib.resources.abc import Traversable


# TOML files in the same folder that are not catalogues: classes, keywords and more.
NO_CATALOGS = frozenset(
    {"drift", "geofabrik", "keywords", "phrases", "position_words", "street_words", "taxonomy"}
)
PAPER_CLASSES = 11
MEASURES = ("range_m", "height_m", "height_sigma")
MAX_MERGING_M = 100.0


_ByClass = tuple[tuple[str, float], ...]


class CatalogFile(FileTable):
    """The keys of a file that are not described by `Catalog`.

    Parameters
    ----------
    files : tuple of str
        Files of layers that name none.
    exclusions : mapping of str to values
        What leaves a row out of every layer of objects that has no ``not``.
    texts : mapping of str to str
        Columns of what is written on objects, and their fields, for layers that have no ``texts``.
    height_field, levels_field : str
        Fields of the height and of the storeys, for layers of objects and buildings that name none.
    ranges : mapping of str to float
        Distances in metres from which classes are visible.
    titles : mapping of str to str
        Titles of classes that fit the data better than the usual ones.
    classes : tuple of ObjectClass
        Classes that are not built in.
    """

    name: str
    title: str
    place: str = ""
    url: str = ""
    license: str = "unknown"
    attribution: str = ""
    metric_crs: str | None = None
    reader: str = "vector_file"
    endpoints: Texts = ()
    token: str | None = None
    geocoder: str | None = None
    files: Texts = ()
    exclusions: Annotated[Conditions, file_key("not")] = ()
    texts: TextFields = ()
    height_field: str | None = None
    levels_field: str | None = None
    conflate: Annotated[_ByClass, pairs(Annotated[float, metres(MAX_MERGING_M)])] = ()
    ranges: Annotated[_ByClass, pairs(Annotated[float, metres(MAX_RANGE_M)])] = ()
    titles: Annotated[tuple[tuple[str, str], ...], pairs(Text)] = ()
    classes: tuple[ObjectClass, ...] = ()
    layers: Annotated[tuple[LayerSpec, ...], length(1)]


@dataclass(frozen=True, repr=False, kw_only=True)
class Catalog(Displayed):
    """A source of open data: its classes, its layers and its licence.

    Parameters
    ----------
    name, title : str
        Short name, and the one to show to people.
    taxonomy : Taxonomy
        The paper's classes, the built-in classes that its layers use, and its own.
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
        Classes, and the distance in metres within which objects of different layers are merged.
    license, attribution : str
        Licence and attribution of the layers that have no own.

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
        """Classes of its layers."""
        names = {name for spec in self.layers for name in spec.classes}
        return tuple(item for item in self.taxonomy.classes if item.name in names)

    def layer(self, name: str) -> LayerSpec:
        """Return the layer of a name; UnknownNameError if there is none."""
        for spec in self.layers:
            if spec.name == name:
                return spec
        names = [spec.name for spec in self.layers]
        raise UnknownNameError(
            f"catalogue {self.name!r} has no layer {name!r}{nearest_name(name, names)}; "
            f"its layers are {', '.join(names)}."
        )


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
    return Taxonomy(built_in_taxonomy().classes[:PAPER_CLASSES])


def catalog_names() -> tuple[str, ...]:
    """Return the names of built-in and installed catalogues, sorted."""
    return tuple(sorted(_sources()))


def _sources() -> dict[str, Path | Traversable]:
    """Return the file of every catalogue by name."""
    shipped = _shipped()
    return {**shipped, **installed_catalogs(reserved=shipped)}


def _shipped() -> dict[str, Path | Traversable]:
    """Return the file of every built-in catalogue by name."""
    return {
        Path(item.name).stem: item
        for item in data_folder().iterdir()
        if item.name.endswith(".toml") and Path(item.name).stem not in NO_CATALOGS
    }


@functools.cache
def built_in_taxonomy() -> Taxonomy:
    """Return all classes that come with the package, by code: the paper's eleven first."""
    source = data_folder() / "taxonomy.toml"
    content = parse_toml(source.read_text(encoding="utf-8"), "taxonomy.toml")
    return Taxonomy.from_list(content["classes"])


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
        The catalogue; its taxonomy is the paper's classes, the built-in classes that its layers
        use, and its own. CatalogError if the file is missing or not TOML, has an unknown key,
        lacks a required key, or names an unknown class or CRS.

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
            raise CatalogError(
                f"catalogue {text} does not exist; give a TOML file or one of {_known()}."
            )
    else:
        sources = _sources()
        if text not in sources:
            raise UnknownNameError(
                f"catalogue {text!r} is unknown{nearest_name(text, sources)}; "
                f"give one of {_known()}, or the path of a .toml file."
            )
        source = sources[text]
    try:
        # The package may be imported from an archive; then `source` is not a Path.
        content = read_text(source) if isinstance(source, Path) else source.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise CatalogError(
            f"catalogue {text} is not UTF-8 text ({error}); save it as UTF-8."
        ) from error
    except OSError as error:
        raise CatalogError(
            f"catalogue {text} cannot be read ({error.strerror}); give a file that you can read."
        ) from error
    return _parse_catalog(content, text)


def combine_catalogs(catalogs: Sequence[Catalog]) -> Catalog:
    """Combine catalogues, so that their layers can be loaded and merged together.

    Parameters
    ----------
    catalogs : sequence of Catalog
        At least one, each once (else InputError); the first is trusted most when objects are
        merged.

    Returns
    -------
    Catalog
        With several, the name of a layer begins with the name of its catalogue. Metric CRS,
        merging radii, and title, range and height of a class come from the first catalogue that
        gives them. CatalogError if one name, code or symbol means different classes.

    Examples
    --------
    >>> from semsig_gis import combine_catalogs, load_catalog
    >>> both = combine_catalogs([load_catalog("montpellier"), load_catalog("openstreetmap")])
    >>> both.layers[0].name
    'montpellier/trees'
    """
    names = [catalog.name for catalog in catalogs]
    if not names or len(set(names)) < len(names):
        raise InputError(f"the catalogues given are {names}; give one or more, each once.")
    if len(catalogs) == 1:
        return catalogs[0]
    classes = [item for catalog in catalogs for item in catalog.taxonomy.classes]
    # Classes that differ only in title, range or height are the same class.
    measures: dict[ObjectClass, dict[str, Any]] = {}
    for item in classes:
        kind = dataclasses.replace(item, range_m=None, height_m=None, height_sigma=None)
        values = {name: getattr(item, name) for name in MEASURES}
        values = {name: value for name, value in values.items() if value is not None}
        measures[kind] = {**values, **measures.get(kind, {})}
    try:
        taxonomy = Taxonomy(
            tuple(dataclasses.replace(kind, **values) for kind, values in measures.items())
        )
    except CatalogError as error:
        raise CatalogError(
            f"catalogues {' and '.join(names)} do not go together: {error}"
        ) from error
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


def _checked_catalog(content: dict[str, Any], where: str) -> Catalog:
    where = f"catalogue {where}"
    file = read_table(CatalogFile, _with_inherited(content), where)
    place = where
    try:
        taxonomy = _classes_used(file)
        place = f"{where}, titles"
        taxonomy = taxonomy.with_titles(dict(file.titles))
        place = where
        if file.metric_crs is not None:
            require_metric_crs(file.metric_crs)
        place = f"{where}, conflate"
        for name, _ in file.conflate:
            taxonomy.by_name(name)
        place = f"{where}, ranges"
        ranges = dict(file.ranges)
        own = [item.name for item in file.classes if item.range_m is not None]
        double = next((name for name in own if name in ranges), None)
        taxonomy = taxonomy.with_ranges(ranges)
        for spec in file.layers:
            place = f"{where}, layer {spec.name!r}"
            spec.check(taxonomy)
    except (CatalogError, CrsError, UnknownNameError) as error:
        raise CatalogError(f"{place}: {error}") from error
    if double is not None:
        raise CatalogError(
            f"{where} has a range_m of {double!r} and one in ranges; remove one of them."
        )
    names = [spec.name for spec in file.layers]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None:
        raise CatalogError(f"{where} has two layers named {double!r}; rename one.")
    keys = file.model_fields_set & {field.name for field in dataclasses.fields(Catalog)}
    values = {key: getattr(file, key) for key in keys} | {
        "taxonomy": taxonomy,
        "layers": tuple(
            dataclasses.replace(
                spec,
                extended=any(
                    item.shape != "point" for item in taxonomy.classes if item.name in spec.classes
                ),
            )
            for spec in file.layers
        ),
    }
    return Catalog(**values)


def _classes_used(file: CatalogFile) -> Taxonomy:
    """Return the paper's classes, the built-in classes of a file's layers by code, and its own."""
    own = {item.name for item in file.classes}
    used = {name for spec in file.layers for name in spec.classes} - own
    built_in = built_in_taxonomy().classes[PAPER_CLASSES:]
    more = [item for item in built_in if item.name in used]
    return paper_taxonomy().extended([*more, *file.classes])


def catalog_schema() -> dict[str, Any]:
    """Return the JSON Schema of catalogues, ``catalog.schema.json``."""
    schema = json_schema(CatalogFile, described_by=Catalog)
    layer = schema["$defs"]["LayerSpec"]["properties"]
    # A layer has the shapes of its classes.
    del layer["extended"]
    layer["class"]["examples"] = [item.name for item in built_in_taxonomy().classes]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _with_inherited(content: dict[str, Any]) -> dict[str, Any]:
    """Return a catalogue, its layers with the values that they inherit from it."""
    layers: object = content.get("layers")
    if not isinstance(layers, list):
        return content
    return content | {
        "layers": [
            {key: content[key] for key in _inherited_keys(item) if key in content} | item
            if isinstance(item, dict)
            else item
            for item in layers
        ]
    }


def _inherited_keys(layer: dict[str, Any]) -> tuple[str, ...]:
    """Return the keys that a layer has from its catalogue if it lacks them."""
    role = layer.get("role", "objects")
    if "derive" in layer:
        return "reader", "license", "attribution"
    keys: tuple[str, ...] = ("reader", "files", "license", "attribution")
    keys += ("not", "texts") if role == "objects" else ()
    return (*keys, "height_field", "levels_field") if role in ("objects", "buildings") else keys


# The same text is parsed only once.
_parse_catalog = functools.lru_cache(
    lambda text, where: _checked_catalog(parse_toml(text, where), where)
)
