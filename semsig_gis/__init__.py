"""Tell where in a city a view was taken from the street objects in it.

The road in one glance::

    catalog = load_catalog("montpellier")
    layers, absent = read_files(choose_layers(catalog), ["montpellier/"])
    objects = assemble(layers, catalog).objects
    database = build_database(objects)
    query = Signature.parse("DDBB", [10, 80, 200, 310], taxonomy=database.taxonomy)
    localize(database, query).candidates
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from semsig_gis.building import build_database
    from semsig_gis.catalog import Catalog, load_catalog, paper_taxonomy
    from semsig_gis.conflation import conflate
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.database_file import open_database, save_database
    from semsig_gis.distortion import Distortion
    from semsig_gis.errors import SemsigError
    from semsig_gis.evaluation import Evaluation, evaluate
    from semsig_gis.export import export_geopackage
    from semsig_gis.grid import GridSpec
    from semsig_gis.layer_spec import LayerSpec
    from semsig_gis.loading import (
        Loaded,
        assemble,
        choose_layers,
        combine_catalogs,
        fetch_layers,
        find_area,
        open_cache,
        read_files,
    )
    from semsig_gis.maps import evaluation_map, localization_map, save_map
    from semsig_gis.matching import Localization, Method, localize
    from semsig_gis.objects import StreetObjects, build_objects, open_objects, save_objects
    from semsig_gis.quality import quality_report
    from semsig_gis.signatures import Signature, SignatureSpec
    from semsig_gis.sources import RawLayer, find_files
    from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    from semsig_gis.sources.vector_file import read_layer
    from semsig_gis.suggest import suggest_catalog
    from semsig_gis.taxonomy import ObjectClass, Taxonomy

__version__ = "0.1.0"

# Where each public name lives. Names are imported when they are first used, so that the command
# line can print its help without loading a GIS stack.
_HOMES = {
    "Catalog": "catalog",
    "CitySpec": "sources.synthetic",
    "Distortion": "distortion",
    "Evaluation": "evaluation",
    "GridSpec": "grid",
    "LayerSpec": "layer_spec",
    "Loaded": "loading",
    "Localization": "matching",
    "Method": "matching",
    "ObjectClass": "taxonomy",
    "RawLayer": "sources",
    "SemsigError": "errors",
    "Signature": "signatures",
    "SignatureDatabase": "database",
    "SignatureSpec": "signatures",
    "StreetObjects": "objects",
    "Taxonomy": "taxonomy",
    "assemble": "loading",
    "build_database": "building",
    "build_objects": "objects",
    "choose_layers": "loading",
    "combine_catalogs": "loading",
    "conflate": "conflation",
    "evaluate": "evaluation",
    "evaluation_map": "maps",
    "export_geopackage": "export",
    "fetch_layers": "loading",
    "find_area": "loading",
    "find_files": "sources",
    "load_catalog": "catalog",
    "localization_map": "maps",
    "localize": "matching",
    "open_cache": "loading",
    "open_database": "database_file",
    "open_objects": "objects",
    "paper_taxonomy": "catalog",
    "quality_report": "quality",
    "read_files": "loading",
    "read_layer": "sources.vector_file",
    "save_database": "database_file",
    "save_map": "maps",
    "save_objects": "objects",
    "suggest_catalog": "suggest",
    "synthetic_city": "sources.synthetic",
}

__all__ = [
    "Catalog",
    "CitySpec",
    "Distortion",
    "Evaluation",
    "GridSpec",
    "LayerSpec",
    "Loaded",
    "Localization",
    "Method",
    "ObjectClass",
    "RawLayer",
    "SemsigError",
    "Signature",
    "SignatureDatabase",
    "SignatureSpec",
    "StreetObjects",
    "Taxonomy",
    "__version__",
    "assemble",
    "build_database",
    "build_objects",
    "choose_layers",
    "combine_catalogs",
    "conflate",
    "evaluate",
    "evaluation_map",
    "export_geopackage",
    "fetch_layers",
    "find_area",
    "find_files",
    "load_catalog",
    "localization_map",
    "localize",
    "open_cache",
    "open_database",
    "open_objects",
    "paper_taxonomy",
    "quality_report",
    "read_files",
    "read_layer",
    "save_database",
    "save_map",
    "save_objects",
    "suggest_catalog",
    "synthetic_city",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
    if name not in _HOMES:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
