# What other packages may import from here: name and module, read by `__init__.py`.

from .checks import (
    MOST_METRES as MOST_METRES,
)
from .checks import (
    MOST_SEED as MOST_SEED,
)
from .checks import (
    MOST_WORKERS as MOST_WORKERS,
)
from .checks import (
    require_number as require_number,
)
from .defaults import (
    DEFAULT_METHOD as DEFAULT_METHOD,
)
from .defaults import (
    LIKELIHOOD as LIKELIHOOD,
)
from .defaults import (
    PAPER_METHOD as PAPER_METHOD,
)
from .display import (
    Axes as Axes,
)
from .display import (
    Displayed as Displayed,
)
from .display import (
    MapFrame as MapFrame,
)
from .display import (
    bounds_text as bounds_text,
)
from .errors import (
    CatalogError as CatalogError,
)
from .errors import (
    CrsError as CrsError,
)
from .errors import (
    DatabaseError as DatabaseError,
)
from .errors import (
    EmptyResultError as EmptyResultError,
)
from .errors import (
    InputError as InputError,
)
from .errors import (
    SemsigError as SemsigError,
)
from .errors import (
    SourceError as SourceError,
)
from .errors import (
    UnknownNameError as UnknownNameError,
)
from .errors import (
    extra as extra,
)
from .errors import (
    nearest_name as nearest_name,
)
from .geometry import (
    CLASS_CODE as CLASS_CODE,
)
from .geometry import (
    CLASS_NAME as CLASS_NAME,
)
from .geometry import (
    COUNT as COUNT,
)
from .geometry import (
    FULL_TURN as FULL_TURN,
)
from .geometry import (
    GEOMETRY as GEOMETRY,
)
from .geometry import (
    HALF_TURN as HALF_TURN,
)
from .geometry import (
    HALF_WIDTH as HALF_WIDTH,
)
from .geometry import (
    LICENSES as LICENSES,
)
from .geometry import (
    MERGED as MERGED,
)
from .geometry import (
    NAME as NAME,
)
from .geometry import (
    NOTES as NOTES,
)
from .geometry import (
    ROW_SPAN as ROW_SPAN,
)
from .geometry import (
    SOURCE as SOURCE,
)
from .geometry import (
    SOURCE_ID as SOURCE_ID,
)
from .geometry import (
    Bounds as Bounds,
)
from .geometry import (
    Distortion as Distortion,
)
from .geometry import (
    GridSpec as GridSpec,
)
from .geometry import (
    across_180 as across_180,
)
from .geometry import (
    angular_distance as angular_distance,
)
from .geometry import (
    cell_ids as cell_ids,
)
from .geometry import (
    cells_near as cells_near,
)
from .geometry import (
    consecutive as consecutive,
)
from .geometry import (
    crs_label as crs_label,
)
from .geometry import (
    degree_bounds as degree_bounds,
)
from .geometry import (
    grid_convergence as grid_convergence,
)
from .geometry import (
    plane_distortion as plane_distortion,
)
from .geometry import (
    require_metric_crs as require_metric_crs,
)
from .geometry import (
    require_step as require_step,
)
from .geometry import (
    signed_degrees as signed_degrees,
)
from .geometry import (
    split_ids as split_ids,
)
from .geometry import (
    to_degrees as to_degrees,
)
from .geometry import (
    wrap_degrees as wrap_degrees,
)
from .jit import compiled as compiled
from .memory import address_space_left as address_space_left
from .parallel import (
    Outcome as Outcome,
)
from .parallel import (
    check_workers as check_workers,
)
from .parallel import (
    finish_tasks as finish_tasks,
)
from .parallel import (
    run_tasks as run_tasks,
)
from .plugins import (
    CATALOGS as CATALOGS,
)
from .plugins import (
    READERS as READERS,
)
from .plugins import (
    installed_catalogs as installed_catalogs,
)
from .plugins import (
    installed_readers as installed_readers,
)
from .presentation import map_with as map_with
from .presentation import plot_with as plot_with
from .resources import (
    announce as announce,
)
from .resources import (
    free_address_space as free_address_space,
)
from .resources import (
    raise_if_short as raise_if_short,
)
from .resources import (
    require_address_space as require_address_space,
)
from .resources import (
    require_memory as require_memory,
)
from .rtree import ObjectIndex as ObjectIndex
from .rtree import PackedIndex as PackedIndex
from .signature import (
    BEARING_UNITS as BEARING_UNITS,
)
from .signature import (
    DISTANCE_UNITS as DISTANCE_UNITS,
)
from .signature import (
    Signature as Signature,
)
from .signature import (
    SignatureSpec as SignatureSpec,
)
from .signature import (
    distance_units_of as distance_units_of,
)
from .signature import (
    quantize as quantize,
)
from .signature import (
    wrapped_bearings as wrapped_bearings,
)
from .statistics import (
    binomial_tail as binomial_tail,
)
from .statistics import (
    fit_shares as fit_shares,
)
from .statistics import (
    log_interval as log_interval,
)
from .statistics import (
    poisson_interval as poisson_interval,
)
from .statistics import (
    quantile_ranks as quantile_ranks,
)
from .statistics import (
    wilson_interval as wilson_interval,
)
from .symbology import (
    ANSWERS as ANSWERS,
)
from .symbology import (
    CANDIDATE_RAMP as CANDIDATE_RAMP,
)
from .symbology import (
    CELL_CHANCES as CELL_CHANCES,
)
from .symbology import (
    CHANCES as CHANCES,
)
from .symbology import (
    COLOURS as COLOURS,
)
from .symbology import (
    DRIFT_COLOURS as DRIFT_COLOURS,
)
from .symbology import (
    ERROR_BREAKS as ERROR_BREAKS,
)
from .symbology import (
    FAILURES as FAILURES,
)
from .symbology import (
    FOUND_RAMP as FOUND_RAMP,
)
from .symbology import (
    GROUP_COLOURS as GROUP_COLOURS,
)
from .symbology import (
    OBJECT_COLOURS as OBJECT_COLOURS,
)
from .symbology import (
    OUTCOMES as OUTCOMES,
)
from .symbology import (
    RANK_RAMP as RANK_RAMP,
)
from .symbology import (
    SAME_LEVELS as SAME_LEVELS,
)
from .symbology import (
    SAME_TYPES as SAME_TYPES,
)
from .symbology import (
    SHADES as SHADES,
)
from .symbology import (
    SHAPES as SHAPES,
)
from .symbology import (
    VERDICTS as VERDICTS,
)
from .symbology import (
    WHITE as WHITE,
)
from .symbology import (
    ClassSign as ClassSign,
)
from .symbology import (
    Mark as Mark,
)
from .symbology import (
    class_signs as class_signs,
)
from .symbology import (
    group_labels as group_labels,
)
from .symbology import (
    mixed as mixed,
)
from .tables import (
    Table as Table,
)
from .tables import (
    figure as figure,
)
from .tables import (
    interval as interval,
)
from .tables import (
    markdown_rows as markdown_rows,
)
from .taxonomy import (
    MAX_CODE as MAX_CODE,
)
from .taxonomy import (
    MAX_HEIGHT_M as MAX_HEIGHT_M,
)
from .taxonomy import (
    MAX_RANGE_M as MAX_RANGE_M,
)
from .taxonomy import (
    WILDCARD as WILDCARD,
)
from .taxonomy import (
    ObjectClass as ObjectClass,
)
from .taxonomy import (
    Taxonomy as Taxonomy,
)
from .taxonomy import (
    check_height as check_height,
)
from .temporary import (
    ASIDE as ASIDE,
)
from .temporary import (
    HALF_DONE as HALF_DONE,
)
from .temporary import (
    MACHINE as MACHINE,
)
from .temporary import (
    OWNER as OWNER,
)
from .temporary import (
    is_abandoned as is_abandoned,
)
from .temporary import (
    locked as locked,
)
from .temporary import (
    own_folder as own_folder,
)
from .temporary import (
    remove_abandoned as remove_abandoned,
)
from .text import escaped as escaped
from .text import one_line as one_line
from .text import percent as percent
from .text import visible as visible
from .threads import (
    NotWantedError as NotWantedError,
)
from .threads import (
    cores as cores,
)
from .threads import (
    each_in_order as each_in_order,
)
from .threads import (
    share_rows as share_rows,
)
from .threads import (
    while_wanted as while_wanted,
)
