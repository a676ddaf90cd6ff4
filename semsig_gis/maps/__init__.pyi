# What other packages may import from here: name and module, read by `__init__.py`.

from .answer import RASTERS as RASTERS
from .cells import (
    Cells as Cells,
)
from .cells import (
    ambiguity_legend as ambiguity_legend,
)
from .cells import (
    ambiguity_map as ambiguity_map,
)
from .cells import (
    identifiability_legend as identifiability_legend,
)
from .cells import (
    identifiability_map as identifiability_map,
)
from .city import city_map as city_map
from .drift import drift_legend as drift_legend
from .drift import drift_map as drift_map
from .evaluation import evaluation_legend as evaluation_legend
from .evaluation import evaluation_map as evaluation_map
from .image import (
    CellPixels as CellPixels,
)
from .image import (
    city_image as city_image,
)
from .image import (
    level_image as level_image,
)
from .image import (
    mercator as mercator,
)
from .image import (
    place_lattices as place_lattices,
)
from .image import (
    script_json as script_json,
)
from .location import (
    RAYS as RAYS,
)
from .location import (
    REGION_COLOURS as REGION_COLOURS,
)
from .location import (
    SECTOR as SECTOR,
)
from .location import (
    localization_legend as localization_legend,
)
from .location import (
    localization_map as localization_map,
)
from .location import (
    location_legend as location_legend,
)
from .location import (
    location_map as location_map,
)
from .location import (
    region_levels as region_levels,
)
from .objects import (
    ground_map as ground_map,
)
from .objects import (
    objects_legend as objects_legend,
)
from .objects import (
    objects_map as objects_map,
)
from .objects import (
    packed_ground as packed_ground,
)
from .page import (
    MapFrame as MapFrame,
)
from .page import (
    asset_text as asset_text,
)
from .page import (
    assets as assets,
)
from .page import (
    available as available,
)
from .page import (
    external_files as external_files,
)
from .page import (
    inline_assets as inline_assets,
)
from .page import (
    page_of_map as page_of_map,
)
from .page import (
    save_map as save_map,
)
from .page import (
    show_map as show_map,
)
from .page_elements import (
    MAX_ZOOM as MAX_ZOOM,
)
from .page_elements import (
    OUTLINES as OUTLINES,
)
from .page_elements import (
    corners_of as corners_of,
)
from .page_elements import (
    data_url as data_url,
)
from .page_elements import (
    exact_latlon as exact_latlon,
)
from .page_elements import (
    layers_of as layers_of,
)
from .page_elements import (
    mark_svg as mark_svg,
)
from .page_elements import (
    page_element as page_element,
)
from .page_elements import (
    panel_signs as panel_signs,
)
from .page_elements import (
    search_area as search_area,
)
from .page_elements import (
    to_latlon as to_latlon,
)
from .page_elements import (
    to_metres as to_metres,
)
