"""The public names and where each lives: the one table, read by `__init__` and by type checkers."""

from .core.errors import SemsigError as SemsigError
from .core.geometry import GridSpec as GridSpec
from .core.signature import Signature as Signature, SignatureSpec as SignatureSpec
from .core.symbology import class_signs as class_signs
from .core.statistics import wilson_interval as wilson_interval
from .observation.view import Photo as Photo, View as View
from .core.taxonomy import ObjectClass as ObjectClass, Taxonomy as Taxonomy
from .sources import RawLayer as RawLayer, find_files as find_files
from .sources.catalog import (
    Catalog as Catalog,
    combine_catalogs as combine_catalogs,
    load_catalog as load_catalog,
    paper_taxonomy as paper_taxonomy,
)
from .sources.clip import clip_layers as clip_layers
from .sources.layer_spec import LayerSpec as LayerSpec
from .sources.synthetic.city import (
    CitySpec as CitySpec,
    PARIS_LIKE as PARIS_LIKE,
    synthetic_city as synthetic_city,
    synthetic_surroundings as synthetic_surroundings,
)
from .sources.vector import read_layer as read_layer
from .objects.load import build_objects as build_objects
from .objects.conflation import conflate as conflate
from .objects.draft import draft_catalog as draft_catalog
from .sources.fetch import (
    fetch_layers as fetch_layers,
    find_area as find_area,
    open_cache as open_cache,
)
from .objects.from_geodataframe import objects_from_frame as objects_from_frame
from .objects.load import (
    Loaded as Loaded,
    assemble as assemble,
    choose_layers as choose_layers,
    read_files as read_files,
)
from .objects.quality import quality_report as quality_report
from .objects.surroundings import (
    read_surroundings as read_surroundings,
    save_surroundings as save_surroundings,
)
from .objects.table import (
    StreetObjects as StreetObjects,
    open_objects as open_objects,
    save_objects as save_objects,
)
from .database.build import build_database as build_database
from .database.city import City as City, open_city as open_city
from .database.database import SignatureDatabase as SignatureDatabase
from .database.file import (
    PartitionedDatabase as PartitionedDatabase,
    open_database as open_database,
    open_dataset as open_dataset,
    save_database as save_database,
)
from .observation.north import North as North
from .observation.sentences import parse_view as parse_view
from .database.occlusion import Footprints as Footprints
from .database.summary import database_summary as database_summary
from .localization.requirement import Requirement as Requirement
from .database.store import (
    ObjectStore as ObjectStore,
    open_store as open_store,
    save_with_store as save_with_store,
)
from .database.merge import merge_databases as merge_databases
from .database.tiles import TileSpec as TileSpec, build_tiles as build_tiles
from .database.update import (
    update_database as update_database,
    update_file as update_file,
    update_tiles as update_tiles,
)
from .database.viewpoints import ViewpointSpec as ViewpointSpec
from .localization.distance.method import Method as Method
from .localization.distance.scores import score_cells as score_cells
from .localization.distance.search import Localization as Localization
from .localization.likelihood.posterior import open_posterior as open_posterior
from .localization.likelihood.answer_rule import (
    AnswerRule as AnswerRule,
    calibrate as calibrate,
    open_rule as open_rule,
    save_rule as save_rule,
)
from .localization.likelihood.index import (
    LikelihoodIndex as LikelihoodIndex,
    build_index as build_index,
)
from .localization.likelihood.locate import (
    Location as Location,
    locate as locate,
    locate_route as locate_route,
)
from .localization.likelihood.method import LikelihoodMethod as LikelihoodMethod
from .localization.suggest import next_questions as next_questions
from .localization.noise.age import (
    Drift as Drift,
    aged_noise as aged_noise,
    fresh_noise as fresh_noise,
    named_drift as named_drift,
    open_drift as open_drift,
)
from .localization.noise.learn import learn_noise as learn_noise, read_samples as read_samples
from .localization.noise.model import (
    NoiseMixture as NoiseMixture,
    NoiseSpec as NoiseSpec,
    cell_noise as cell_noise,
    named_noise as named_noise,
)
from .localization.likelihood.posterior import Posterior as Posterior
from .localization.likelihood.priors import (
    KnownPosition as KnownPosition,
    area_prior as area_prior,
    position_prior as position_prior,
    raster_prior as raster_prior,
    weight_prior as weight_prior,
)
from .observation.leg import Leg as Leg
from .evaluation.queries.draw import QuerySpec as QuerySpec, draw_queries as draw_queries
from .evaluation.queries.distortions import (
    Distortion as Distortion,
    distort as distort,
    named_distortion as named_distortion,
)
from .evaluation.queries.true_view import Sight as Sight
from .evaluation.compare import compare_evaluations as compare_evaluations
from .evaluation.scoring import evaluate as evaluate
from .evaluation.error_maps import ErrorField as ErrorField, error_field as error_field
from .evaluation.file import open_evaluation as open_evaluation, save_evaluation as save_evaluation
from .evaluation.identifiability.check import (
    IdentifiabilityCheck as IdentifiabilityCheck,
    check_identifiability as check_identifiability,
)
from .evaluation.identifiability.analysis import identify as identify
from .evaluation.identifiability.result import (
    Identifiability as Identifiability,
    open_identifiability as open_identifiability,
    save_identifiability as save_identifiability,
)
from .evaluation.identifiability.trials import leave_class_out as leave_class_out
from .localization.locator import localize as localize, parse_method as parse_method
from .evaluation.result import Evaluation as Evaluation
from .evaluation.spec import (
    ExperimentSpec as ExperimentSpec,
    open_experiment_spec as open_experiment_spec,
)
from .maps.cells import ambiguity_map as ambiguity_map, identifiability_map as identifiability_map
from .maps.city import city_map as city_map
from .maps.drift import drift_map as drift_map
from .maps.evaluation import evaluation_map as evaluation_map
from .maps.location import localization_map as localization_map
from .maps.location import location_map as location_map, posterior_map as posterior_map
from .maps.objects import ground_map as ground_map, objects_map as objects_map
from .maps.page import save_map as save_map, show_map as show_map
from .exports.export import (
    export_answer as export_answer,
    export_database as export_database,
    export_item as export_item,
)
from .exports.geopackage import (
    GeopackageContents as GeopackageContents,
    read_geopackage as read_geopackage,
)
from .exports.rasters import export_geotiff as export_geotiff
from .localization.regions import SearchRegions as SearchRegions, search_regions as search_regions
from .reports.axes import (
    plot_answer as plot_answer,
    plot_database as plot_database,
    plot_evaluation as plot_evaluation,
    plot_identifiability as plot_identifiability,
    plot_objects as plot_objects,
)
from .reports.evaluation import evaluation_tables as evaluation_tables
from .reports.evaluation_html import evaluation_page as evaluation_page
from .reports.page import write_page as write_page
from .reports.report_model import Curve as Curve, Plot as Plot
from .reports.quality import quality_tables as quality_tables
from .reports.plots import draw_plot as draw_plot
from .reports.scenes import (
    cell_scene as cell_scene,
    draw_scene as draw_scene,
    draw_scenes as draw_scenes,
)
from .core.tables import Table as Table
from .evaluation.experiments.results import open_results as open_results
from .evaluation.paper.reproduction import Reproduction as Reproduction, reproduce as reproduce
from .evaluation.experiments.run import (
    run_experiment as run_experiment,
    run_experiments as run_experiments,
)

__version__: str
