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
    from semsig_gis.catalog import Catalog, combine_catalogs, load_catalog, paper_taxonomy
    from semsig_gis.comparison import compare_evaluations
    from semsig_gis.conflation import conflate
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.database_file import open_database, save_database
    from semsig_gis.dataset import PartitionedDatabase, open_dataset
    from semsig_gis.distortion import Distortion
    from semsig_gis.distributed import build_tiles
    from semsig_gis.errors import SemsigError
    from semsig_gis.evaluation import evaluate
    from semsig_gis.evaluation_result import Evaluation
    from semsig_gis.experiment import ExperimentSpec, open_experiment_spec
    from semsig_gis.experiment_folder import open_results
    from semsig_gis.experiment_run import run_experiment, run_experiments
    from semsig_gis.exports import export_answer, export_database
    from semsig_gis.exports.geotiff import export_geotiff
    from semsig_gis.fetching import fetch_layers, find_area, open_cache
    from semsig_gis.geopackage_reading import GeopackageContents, read_geopackage
    from semsig_gis.grid import GridSpec
    from semsig_gis.identifiability import Identifiability
    from semsig_gis.identifiability_check import IdentifiabilityCheck, check_identifiability
    from semsig_gis.identifiability_file import open_identifiability, save_identifiability
    from semsig_gis.identifying import identify
    from semsig_gis.layer_spec import LayerSpec
    from semsig_gis.likelihood import LikelihoodIndex, build_index
    from semsig_gis.likelihood_file import ready_index
    from semsig_gis.loading import Loaded, assemble, choose_layers, read_files
    from semsig_gis.locating import locate, locate_route
    from semsig_gis.location import Location
    from semsig_gis.map_ambiguity import ambiguity_map
    from semsig_gis.map_drift import drift_map
    from semsig_gis.map_frame import show_map
    from semsig_gis.map_ground import ground_map
    from semsig_gis.map_identifiability import identifiability_map
    from semsig_gis.map_location import location_map
    from semsig_gis.map_objects import objects_map
    from semsig_gis.maps import evaluation_map, localization_map, save_map
    from semsig_gis.matching import Localization, Method, localize
    from semsig_gis.noise import NoiseMixture, NoiseSpec, named_noise
    from semsig_gis.objects import StreetObjects, build_objects, open_objects, save_objects
    from semsig_gis.occlusion import Footprints
    from semsig_gis.posterior import Posterior
    from semsig_gis.properties import database_summary
    from semsig_gis.quality import quality_report
    from semsig_gis.regions import SearchRegions, search_regions
    from semsig_gis.reproduction import Reproduction, reproduce
    from semsig_gis.signatures import Signature, SignatureSpec
    from semsig_gis.sources import RawLayer, find_files
    from semsig_gis.sources.synthetic import (
        PARIS_LIKE,
        CitySpec,
        synthetic_city,
        synthetic_surroundings,
    )
    from semsig_gis.sources.vector_file import read_layer
    from semsig_gis.store import ObjectStore, open_store, save_with_store
    from semsig_gis.suggest import suggest_catalog
    from semsig_gis.surroundings import read_surroundings, save_surroundings
    from semsig_gis.taxonomy import ObjectClass, Taxonomy
    from semsig_gis.tiles import TileSpec
    from semsig_gis.update import update_database, update_file
    from semsig_gis.viewpoints import ViewpointSpec

__version__ = "0.1.0"

# Where each public name lives. Names are imported when they are first used, so that the command
# line can print its help without loading a GIS stack.
_HOMES = {
    "Catalog": "catalog",
    "CitySpec": "sources.synthetic",
    "Distortion": "distortion",
    "Evaluation": "evaluation_result",
    "ExperimentSpec": "experiment",
    "Footprints": "occlusion",
    "GeopackageContents": "geopackage_reading",
    "GridSpec": "grid",
    "Identifiability": "identifiability",
    "IdentifiabilityCheck": "identifiability_check",
    "LayerSpec": "layer_spec",
    "LikelihoodIndex": "likelihood",
    "Loaded": "loading",
    "Localization": "matching",
    "Location": "location",
    "Method": "matching",
    "NoiseMixture": "noise",
    "NoiseSpec": "noise",
    "ObjectClass": "taxonomy",
    "ObjectStore": "store",
    "PARIS_LIKE": "sources.synthetic",
    "PartitionedDatabase": "dataset",
    "Posterior": "posterior",
    "RawLayer": "sources",
    "Reproduction": "reproduction",
    "SearchRegions": "regions",
    "SemsigError": "errors",
    "Signature": "signatures",
    "SignatureDatabase": "database",
    "SignatureSpec": "signatures",
    "StreetObjects": "objects",
    "Taxonomy": "taxonomy",
    "TileSpec": "tiles",
    "ViewpointSpec": "viewpoints",
    "ambiguity_map": "map_ambiguity",
    "assemble": "loading",
    "build_database": "building",
    "build_index": "likelihood",
    "build_objects": "objects",
    "build_tiles": "distributed",
    "check_identifiability": "identifiability_check",
    "choose_layers": "loading",
    "combine_catalogs": "catalog",
    "compare_evaluations": "comparison",
    "conflate": "conflation",
    "database_summary": "properties",
    "drift_map": "map_drift",
    "evaluate": "evaluation",
    "evaluation_map": "maps",
    "export_answer": "exports",
    "export_database": "exports",
    "export_geotiff": "exports.geotiff",
    "fetch_layers": "fetching",
    "find_area": "fetching",
    "find_files": "sources",
    "ground_map": "map_ground",
    "identifiability_map": "map_identifiability",
    "identify": "identifying",
    "load_catalog": "catalog",
    "localization_map": "maps",
    "localize": "matching",
    "locate": "locating",
    "locate_route": "locating",
    "location_map": "map_location",
    "named_noise": "noise",
    "objects_map": "map_objects",
    "open_cache": "fetching",
    "open_database": "database_file",
    "open_dataset": "dataset",
    "open_experiment_spec": "experiment",
    "open_identifiability": "identifiability_file",
    "open_objects": "objects",
    "open_results": "experiment_folder",
    "open_store": "store",
    "paper_taxonomy": "catalog",
    "quality_report": "quality",
    "read_files": "loading",
    "read_geopackage": "geopackage_reading",
    "read_layer": "sources.vector_file",
    "read_surroundings": "surroundings",
    "ready_index": "likelihood_file",
    "reproduce": "reproduction",
    "run_experiment": "experiment_run",
    "run_experiments": "experiment_run",
    "save_database": "database_file",
    "save_identifiability": "identifiability_file",
    "save_map": "maps",
    "save_objects": "objects",
    "save_surroundings": "surroundings",
    "save_with_store": "store",
    "search_regions": "regions",
    "show_map": "map_frame",
    "suggest_catalog": "suggest",
    "synthetic_city": "sources.synthetic",
    "synthetic_surroundings": "sources.synthetic",
    "update_database": "update",
    "update_file": "update",
}

__all__ = [
    "PARIS_LIKE",
    "Catalog",
    "CitySpec",
    "Distortion",
    "Evaluation",
    "ExperimentSpec",
    "Footprints",
    "GeopackageContents",
    "GridSpec",
    "Identifiability",
    "IdentifiabilityCheck",
    "LayerSpec",
    "LikelihoodIndex",
    "Loaded",
    "Localization",
    "Location",
    "Method",
    "NoiseMixture",
    "NoiseSpec",
    "ObjectClass",
    "ObjectStore",
    "PartitionedDatabase",
    "Posterior",
    "RawLayer",
    "Reproduction",
    "SearchRegions",
    "SemsigError",
    "Signature",
    "SignatureDatabase",
    "SignatureSpec",
    "StreetObjects",
    "Taxonomy",
    "TileSpec",
    "ViewpointSpec",
    "__version__",
    "ambiguity_map",
    "assemble",
    "build_database",
    "build_index",
    "build_objects",
    "build_tiles",
    "check_identifiability",
    "choose_layers",
    "combine_catalogs",
    "compare_evaluations",
    "conflate",
    "database_summary",
    "drift_map",
    "evaluate",
    "evaluation_map",
    "export_answer",
    "export_database",
    "export_geotiff",
    "fetch_layers",
    "find_area",
    "find_files",
    "ground_map",
    "identifiability_map",
    "identify",
    "load_catalog",
    "localization_map",
    "localize",
    "locate",
    "locate_route",
    "location_map",
    "named_noise",
    "objects_map",
    "open_cache",
    "open_database",
    "open_dataset",
    "open_experiment_spec",
    "open_identifiability",
    "open_objects",
    "open_results",
    "open_store",
    "paper_taxonomy",
    "quality_report",
    "read_files",
    "read_geopackage",
    "read_layer",
    "read_surroundings",
    "ready_index",
    "reproduce",
    "run_experiment",
    "run_experiments",
    "save_database",
    "save_identifiability",
    "save_map",
    "save_objects",
    "save_surroundings",
    "save_with_store",
    "search_regions",
    "show_map",
    "suggest_catalog",
    "synthetic_city",
    "synthetic_surroundings",
    "update_database",
    "update_file",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
    if name not in _HOMES:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
