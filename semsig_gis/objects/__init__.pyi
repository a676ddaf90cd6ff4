# What other packages may import from here: name and module, read by `__init__.py`.

from .changes import (
    ClassChange as ClassChange,
)
from .changes import (
    ObjectChanges as ObjectChanges,
)
from .changes import (
    compare_objects as compare_objects,
)
from .changes import (
    joined_taxonomy as joined_taxonomy,
)
from .changes import (
    replace_layers as replace_layers,
)
from .conflation import (
    ConflatedPair as ConflatedPair,
)
from .conflation import (
    ConflationReport as ConflationReport,
)
from .conflation import (
    conflate as conflate,
)
from .draft import draft_catalog as draft_catalog
from .extent import settle_extent as settle_extent
from .fetch import fetch_layers as fetch_layers
from .fetch import find_area as find_area
from .fetch import open_cache as open_cache
from .from_geodataframe import objects_from_frame as objects_from_frame
from .guesses import (
    Column as Column,
)
from .guesses import (
    Sample as Sample,
)
from .guesses import (
    columns_of as columns_of,
)
from .guesses import (
    guess_class as guess_class,
)
from .guesses import (
    guess_class_by as guess_class_by,
)
from .guesses import (
    guess_position as guess_position,
)
from .load import (
    LayerReport as LayerReport,
)
from .load import (
    Loaded as Loaded,
)
from .load import (
    LoadReport as LoadReport,
)
from .load import (
    Selection as Selection,
)
from .load import (
    UnreadLayer as UnreadLayer,
)
from .load import (
    assemble as assemble,
)
from .load import (
    build_objects as build_objects,
)
from .load import (
    choose_layers as choose_layers,
)
from .load import (
    read_files as read_files,
)
from .quality import (
    SQUARE_M as SQUARE_M,
)
from .quality import (
    ClassQuality as ClassQuality,
)
from .quality import (
    QualityReport as QualityReport,
)
from .quality import (
    quality_report as quality_report,
)
from .skipped_layers import passed_by as passed_by
from .skipped_layers import read_small as read_small
from .surroundings import (
    elements_in as elements_in,
)
from .surroundings import (
    read_area as read_area,
)
from .surroundings import (
    read_surroundings as read_surroundings,
)
from .surroundings import (
    save_surroundings as save_surroundings,
)
from .table import (
    Licence as Licence,
)
from .table import (
    StreetObjects as StreetObjects,
)
from .table import (
    join_licences as join_licences,
)
from .table import (
    licenses_of as licenses_of,
)
from .table import (
    objects_of as objects_of,
)
from .table import (
    objects_specs as objects_specs,
)
from .table import (
    open_objects as open_objects,
)
from .table import (
    save_objects as save_objects,
)
