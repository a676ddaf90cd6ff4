"""The public names and the package of each: read by `__init__` and by type checkers."""

from .core import (
    SemsigError as SemsigError,
    Signature as Signature,
    SignatureSpec as SignatureSpec,
    Taxonomy as Taxonomy,
    class_signs as class_signs,
)
from .observation import (
    Leg as Leg,
    North as North,
    Photo as Photo,
    View as View,
    parse_view as parse_view,
)
from .sources import (
    CitySpec as CitySpec,
    RawLayer as RawLayer,
    combine_catalogs as combine_catalogs,
    fetch_layers as fetch_layers,
    find_area as find_area,
    load_catalog as load_catalog,
    open_cache as open_cache,
    paper_taxonomy as paper_taxonomy,
    synthetic_city as synthetic_city,
    synthetic_surroundings as synthetic_surroundings,
)
from .objects import (
    Loaded as Loaded,
    StreetObjects as StreetObjects,
    assemble as assemble,
    build_objects as build_objects,
    choose_layers as choose_layers,
    conflate as conflate,
    draft_catalog as draft_catalog,
    load as load,
    objects_from_frame as objects_from_frame,
    open_objects as open_objects,
    quality_report as quality_report,
    read_files as read_files,
    read_surroundings as read_surroundings,
    save_objects as save_objects,
)
from .database import (
    City as City,
    Footprints as Footprints,
    ObjectStore as ObjectStore,
    SignatureDatabase as SignatureDatabase,
    ViewpointSpec as ViewpointSpec,
    build as build,
    build_database as build_database,
    merge_databases as merge_databases,
    open_city as open_city,
    open_database as open_database,
    save_database as save_database,
    save_with_store as save_with_store,
    update_file as update_file,
)
from .localization import (
    Drift as Drift,
    Location as Location,
    Method as Method,
    NoiseSpec as NoiseSpec,
    Posterior as Posterior,
    Requirement as Requirement,
    build_index as build_index,
    calibrate as calibrate,
    cell_noise as cell_noise,
    learn_noise as learn_noise,
    localize as localize,
    localize_many as localize_many,
    locate as locate,
    locate_route as locate_route,
    named_noise as named_noise,
    read_samples as read_samples,
    score_cells as score_cells,
)
from .evaluation import (
    Distortion as Distortion,
    Evaluation as Evaluation,
    Identifiability as Identifiability,
    QuerySpec as QuerySpec,
    Reproduction as Reproduction,
    Sight as Sight,
    check_identifiability as check_identifiability,
    compare_evaluations as compare_evaluations,
    distort as distort,
    draw_queries as draw_queries,
    evaluate as evaluate,
    identify as identify,
    leave_class_out as leave_class_out,
    named_distortion as named_distortion,
    open_evaluation as open_evaluation,
    reproduce as reproduce,
    run_experiment as run_experiment,
    save_evaluation as save_evaluation,
)
from .output import (
    city_map as city_map,
    evaluation_map as evaluation_map,
    location_map as location_map,
    save_map as save_map,
)
from .output import (
    export_answer as export_answer,
    export_database as export_database,
)
from .output import (
    Curve as Curve,
    Plot as Plot,
    cell_scene as cell_scene,
    draw_plot as draw_plot,
    draw_scene as draw_scene,
    draw_scenes as draw_scenes,
    evaluation_page as evaluation_page,
    evaluation_tables as evaluation_tables,
    quality_tables as quality_tables,
)

__version__: str
