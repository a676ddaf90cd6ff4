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
    from semsig_gis.core.errors import SemsigError
    from semsig_gis.core.grid import GridSpec
    from semsig_gis.core.signature import Signature, SignatureSpec
    from semsig_gis.core.taxonomy import ObjectClass, Taxonomy
    from semsig_gis.database.build import build_database
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.file import (
        PartitionedDatabase,
        open_database,
        open_dataset,
        save_database,
    )
    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.database.properties import database_summary
    from semsig_gis.database.store import ObjectStore, open_store, save_with_store
    from semsig_gis.database.tiles import TileSpec, build_tiles
    from semsig_gis.database.update import update_database, update_file
    from semsig_gis.database.viewpoints import ViewpointSpec
    from semsig_gis.evaluation.compare import compare_evaluations
    from semsig_gis.evaluation.evaluate import evaluate
    from semsig_gis.evaluation.identify.check import IdentifiabilityCheck, check_identifiability
    from semsig_gis.evaluation.identify.identify import identify
    from semsig_gis.evaluation.identify.result import (
        Identifiability,
        open_identifiability,
        save_identifiability,
    )
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.evaluation.spec import ExperimentSpec, open_experiment_spec
    from semsig_gis.experiments.folder import open_results
    from semsig_gis.experiments.paper.reproduce import Reproduction, reproduce
    from semsig_gis.experiments.run import run_experiment, run_experiments
    from semsig_gis.exports import export_answer, export_database
    from semsig_gis.exports.geopackage import GeopackageContents, read_geopackage
    from semsig_gis.exports.geotiff import export_geotiff
    from semsig_gis.exports.regions import SearchRegions, search_regions
    from semsig_gis.likelihood.index import LikelihoodIndex, build_index
    from semsig_gis.likelihood.index_file import ready_index
    from semsig_gis.likelihood.locate import locate, locate_route
    from semsig_gis.likelihood.noise.model import NoiseMixture, NoiseSpec, named_noise
    from semsig_gis.likelihood.posterior import Posterior
    from semsig_gis.likelihood.result import Location
    from semsig_gis.maps.cells import ambiguity_map, identifiability_map
    from semsig_gis.maps.drift import drift_map
    from semsig_gis.maps.evaluation import evaluation_map
    from semsig_gis.maps.localization import localization_map
    from semsig_gis.maps.location import location_map
    from semsig_gis.maps.objects import ground_map, objects_map
    from semsig_gis.maps.page import save_map, show_map
    from semsig_gis.matching.method import Method
    from semsig_gis.matching.result import Localization
    from semsig_gis.matching.search import localize
    from semsig_gis.objects.clean import build_objects
    from semsig_gis.objects.conflate import conflate
    from semsig_gis.objects.draft import suggest_catalog
    from semsig_gis.objects.load import (
        Loaded,
        assemble,
        choose_layers,
        fetch_layers,
        find_area,
        open_cache,
        read_files,
    )
    from semsig_gis.objects.quality import quality_report
    from semsig_gis.objects.surroundings import read_surroundings, save_surroundings
    from semsig_gis.objects.table import StreetObjects, open_objects, save_objects
    from semsig_gis.queries.paper_errors import Distortion
    from semsig_gis.sources import RawLayer, find_files
    from semsig_gis.sources.catalog import Catalog, combine_catalogs, load_catalog, paper_taxonomy
    from semsig_gis.sources.layers import LayerSpec
    from semsig_gis.sources.synthetic.city import (
        PARIS_LIKE,
        CitySpec,
        synthetic_city,
        synthetic_surroundings,
    )
    from semsig_gis.sources.vector.reader import read_layer

__version__ = "0.1.0"

# Where each public name lives. Names are imported when they are first used, so that the command
# line can print its help without loading a GIS stack.
_HOMES = {
    "Catalog": "sources.catalog",
    "CitySpec": "sources.synthetic.city",
    "Distortion": "queries.paper_errors",
    "Evaluation": "evaluation.result",
    "ExperimentSpec": "evaluation.spec",
    "Footprints": "database.occlusion",
    "GeopackageContents": "exports.geopackage",
    "GridSpec": "core.grid",
    "Identifiability": "evaluation.identify.result",
    "IdentifiabilityCheck": "evaluation.identify.check",
    "LayerSpec": "sources.layers",
    "LikelihoodIndex": "likelihood.index",
    "Loaded": "objects.load",
    "Localization": "matching.result",
    "Location": "likelihood.result",
    "Method": "matching.method",
    "NoiseMixture": "likelihood.noise.model",
    "NoiseSpec": "likelihood.noise.model",
    "ObjectClass": "core.taxonomy",
    "ObjectStore": "database.store",
    "PARIS_LIKE": "sources.synthetic.city",
    "PartitionedDatabase": "database.file",
    "Posterior": "likelihood.posterior",
    "RawLayer": "sources",
    "Reproduction": "experiments.paper.reproduce",
    "SearchRegions": "exports.regions",
    "SemsigError": "core.errors",
    "Signature": "core.signature",
    "SignatureDatabase": "database.database",
    "SignatureSpec": "core.signature",
    "StreetObjects": "objects.table",
    "Taxonomy": "core.taxonomy",
    "TileSpec": "database.tiles",
    "ViewpointSpec": "database.viewpoints",
    "ambiguity_map": "maps.cells",
    "assemble": "objects.load",
    "build_database": "database.build",
    "build_index": "likelihood.index",
    "build_objects": "objects.clean",
    "build_tiles": "database.tiles",
    "check_identifiability": "evaluation.identify.check",
    "choose_layers": "objects.load",
    "combine_catalogs": "sources.catalog",
    "compare_evaluations": "evaluation.compare",
    "conflate": "objects.conflate",
    "database_summary": "database.properties",
    "drift_map": "maps.drift",
    "evaluate": "evaluation.evaluate",
    "evaluation_map": "maps.evaluation",
    "export_answer": "exports",
    "export_database": "exports",
    "export_geotiff": "exports.geotiff",
    "fetch_layers": "objects.load",
    "find_area": "objects.load",
    "find_files": "sources",
    "ground_map": "maps.objects",
    "identifiability_map": "maps.cells",
    "identify": "evaluation.identify.identify",
    "load_catalog": "sources.catalog",
    "localization_map": "maps.localization",
    "localize": "matching.search",
    "locate": "likelihood.locate",
    "locate_route": "likelihood.locate",
    "location_map": "maps.location",
    "named_noise": "likelihood.noise.model",
    "objects_map": "maps.objects",
    "open_cache": "objects.load",
    "open_database": "database.file",
    "open_dataset": "database.file",
    "open_experiment_spec": "evaluation.spec",
    "open_identifiability": "evaluation.identify.result",
    "open_objects": "objects.table",
    "open_results": "experiments.folder",
    "open_store": "database.store",
    "paper_taxonomy": "sources.catalog",
    "quality_report": "objects.quality",
    "read_files": "objects.load",
    "read_geopackage": "exports.geopackage",
    "read_layer": "sources.vector.reader",
    "read_surroundings": "objects.surroundings",
    "ready_index": "likelihood.index_file",
    "reproduce": "experiments.paper.reproduce",
    "run_experiment": "experiments.run",
    "run_experiments": "experiments.run",
    "save_database": "database.file",
    "save_identifiability": "evaluation.identify.result",
    "save_map": "maps.page",
    "save_objects": "objects.table",
    "save_surroundings": "objects.surroundings",
    "save_with_store": "database.store",
    "search_regions": "exports.regions",
    "show_map": "maps.page",
    "suggest_catalog": "objects.draft",
    "synthetic_city": "sources.synthetic.city",
    "synthetic_surroundings": "sources.synthetic.city",
    "update_database": "database.update",
    "update_file": "database.update",
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
