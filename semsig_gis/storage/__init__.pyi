# What other packages may import from here: name and module, read by `__init__.py`.

from .geoparquet import (
    BBOX as BBOX,
)
from .geoparquet import (
    CHECKED_PAGES as CHECKED_PAGES,
)
from .geoparquet import (
    CHECKING_PAGES as CHECKING_PAGES,
)
from .geoparquet import (
    COVERING as COVERING,
)
from .geoparquet import (
    GROUP_ROWS as GROUP_ROWS,
)
from .geoparquet import (
    NOWHERE as NOWHERE,
)
from .geoparquet import (
    UNREADABLE as UNREADABLE,
)
from .geoparquet import (
    bounds_column as bounds_column,
)
from .geoparquet import (
    each_bounds as each_bounds,
)
from .geoparquet import (
    geo_metadata as geo_metadata,
)
from .geoparquet import (
    groups_meeting as groups_meeting,
)
from .geoparquet import (
    hilbert_order as hilbert_order,
)
from .geoparquet import (
    points_to_wkb as points_to_wkb,
)
from .geoparquet import (
    read_geoparquet as read_geoparquet,
)
from .geoparquet import (
    require_intact as require_intact,
)
from .geoparquet import (
    rows_meeting as rows_meeting,
)
from .geoparquet import (
    seal as seal,
)
from .geoparquet import (
    whole_numbers as whole_numbers,
)
from .geoparquet import (
    wkb_to_points as wkb_to_points,
)
from .geoparquet import (
    write_geoparquet as write_geoparquet,
)
from .geoparquet import (
    write_geoparquet_blocks as write_geoparquet_blocks,
)
from .raster import raster_at_cells as raster_at_cells
from .raster import write_cells as write_cells
from .rows import (
    Row as Row,
)
from .rows import (
    file_rows as file_rows,
)
from .rows import (
    json_rows as json_rows,
)
from .rows import (
    parse_rows as parse_rows,
)
from .rows import (
    read_rows as read_rows,
)
from .rows import (
    row_value as row_value,
)
from .rows import (
    scan_rows as scan_rows,
)
from .runs import (
    PARTIAL as PARTIAL,
)
from .runs import (
    RunKind as RunKind,
)
from .runs import (
    finish as finish,
)
from .runs import (
    partial_folder as partial_folder,
)
from .runs import (
    read_json as read_json,
)
from .runs import (
    write_json as write_json,
)
from .text import (
    MOST_BYTES as MOST_BYTES,
)
from .text import (
    parse_json as parse_json,
)
from .text import (
    read_text as read_text,
)
from .text import (
    read_whole as read_whole,
)
from .toml import (
    check_keys as check_keys,
)
from .toml import (
    metres as metres,
)
from .toml import (
    one_of as one_of,
)
from .toml import (
    parse_toml as parse_toml,
)
from .toml import (
    read_values as read_values,
)
from .toml import (
    texts as texts,
)
from .toml import (
    toml_text as toml_text,
)
from .whole import (
    alone_in as alone_in,
)
from .whole import (
    exchanged as exchanged,
)
from .whole import (
    move_folder as move_folder,
)
from .whole import (
    reason as reason,
)
from .whole import (
    whole_file as whole_file,
)
from .whole import (
    whole_folder as whole_folder,
)
from .whole import (
    write_whole as write_whole,
)
