# What other packages may import from here: name and module, read by `__init__.py`.

from .build import (
    build_cells as build_cells,
)
from .build import (
    build_database as build_database,
)
from .build import (
    visible_objects as visible_objects,
)
from .city import City as City
from .city import open_city as open_city
from .companion_files import (
    Companion as Companion,
)
from .companion_files import (
    companions as companions,
)
from .companion_files import (
    remove_companions as remove_companions,
)
from .database import (
    SequenceTable as SequenceTable,
)
from .database import (
    SignatureDatabase as SignatureDatabase,
)
from .database import (
    checked_sequence as checked_sequence,
)
from .database import (
    join_databases as join_databases,
)
from .database import (
    require_same_place as require_same_place,
)
from .database import (
    rows_of_result as rows_of_result,
)
from .database import (
    views_in as views_in,
)
from .file import (
    INPUTS as INPUTS,
)
from .file import (
    MANIFEST as MANIFEST,
)
from .file import (
    Manifest as Manifest,
)
from .file import (
    Part as Part,
)
from .file import (
    PartitionedDatabase as PartitionedDatabase,
)
from .file import (
    database_of as database_of,
)
from .file import (
    database_specs as database_specs,
)
from .file import (
    digest as digest,
)
from .file import (
    open_database as open_database,
)
from .file import (
    open_dataset as open_dataset,
)
from .file import (
    part_files as part_files,
)
from .file import (
    part_name as part_name,
)
from .file import (
    read_manifest as read_manifest,
)
from .file import (
    save_database as save_database,
)
from .merge import merge_databases as merge_databases
from .occlusion import (
    GAP_M as GAP_M,
)
from .occlusion import (
    TOLERANCE_M as TOLERANCE_M,
)
from .occlusion import (
    Footprints as Footprints,
)
from .occlusion import (
    buildings_near as buildings_near,
)
from .occlusion import (
    hidden as hidden,
)
from .sightings import (
    Mode as Mode,
)
from .sightings import (
    Sightings as Sightings,
)
from .sightings import (
    ViewpointSpec as ViewpointSpec,
)
from .sightings import (
    Views as Views,
)
from .sightings import (
    bearings as bearings,
)
from .sightings import (
    clockwise_order as clockwise_order,
)
from .sightings import (
    views_at as views_at,
)
from .store import (
    ObjectStore as ObjectStore,
)
from .store import (
    built_digest as built_digest,
)
from .store import (
    open_store as open_store,
)
from .store import (
    save_with_store as save_with_store,
)
from .store import (
    store_path as store_path,
)
from .summary import database_summary as database_summary
from .table import CellGeometry as CellGeometry
from .table import CellTable as CellTable
from .tiles import (
    TilePlan as TilePlan,
)
from .tiles import (
    TileSpec as TileSpec,
)
from .tiles import (
    begin as begin,
)
from .tiles import (
    build_tile as build_tile,
)
from .tiles import (
    build_tiles as build_tiles,
)
from .tiles import (
    describe as describe,
)
from .tiles import (
    finished_tiles as finished_tiles,
)
from .tiles import (
    plan_tiles as plan_tiles,
)
from .tiles import (
    publish as publish,
)
from .tiles import (
    touched_tiles as touched_tiles,
)
from .update import (
    CellChanges as CellChanges,
)
from .update import (
    UpdateReport as UpdateReport,
)
from .update import (
    compare_cells as compare_cells,
)
from .update import (
    update_database as update_database,
)
from .update import (
    update_file as update_file,
)
from .update import (
    update_tile as update_tile,
)
from .update import (
    update_tiles as update_tiles,
)
from .viewpoints import choose_viewpoints as choose_viewpoints
