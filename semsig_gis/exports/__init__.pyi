# What other packages may import from here: name and module, read by `__init__.py`.

from .export import (
    ITEM as ITEM,
)
from .export import (
    LAYERS as LAYERS,
)
from .export import (
    RASTERS as RASTERS,
)
from .export import (
    export_answer as export_answer,
)
from .export import (
    export_database as export_database,
)
from .export import (
    export_item as export_item,
)
from .files import as_written as as_written
from .files import formula_safe as formula_safe
from .geopackage import read_geopackage as read_geopackage
from .hexagons import hexagons_layer as hexagons_layer
from .layers import (
    answer_layers as answer_layers,
)
from .layers import (
    cells_layer as cells_layer,
)
from .layers import (
    evaluation_layers as evaluation_layers,
)
from .layers import (
    figures_apart as figures_apart,
)
from .layers import (
    objects_layer as objects_layer,
)
from .project import (
    layer_fields as layer_fields,
)
from .project import (
    project_archive as project_archive,
)
from .project import (
    shown_layers as shown_layers,
)
from .rasters import (
    CLEAR as CLEAR,
)
from .rasters import (
    ERRORS as ERRORS,
)
from .rasters import (
    STYLES as STYLES,
)
from .rasters import (
    by_pixel as by_pixel,
)
from .rasters import (
    cell_errors as cell_errors,
)
from .rasters import (
    export_geotiff as export_geotiff,
)
from .styles import (
    AMBIGUITY as AMBIGUITY,
)
from .styles import (
    CLASS_MARKERS as CLASS_MARKERS,
)
from .styles import (
    IDENTIFIABILITY as IDENTIFIABILITY,
)
from .styles import (
    by_class as by_class,
)
from .styles import (
    by_outcome as by_outcome,
)
