"""Object stores: the objects, buildings and streets that a database was built from.

A database has no object identifiers, exact positions or names. The object store has them: the
folder ``city.objects`` next to ``city.parquet``, or the copies of the inputs in a folder of parts.
It is needed for updates, and to compute visible objects at places off the grid.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import lazy_loader
import numpy as np

from semsig_gis import __version__
from semsig_gis.core import (
    HALF_WIDTH,
    HEIGHT,
    LICENSES,
    NAME,
    DatabaseError,
    Displayed,
    InputError,
    ObjectIndex,
    brief,
    crs_label,
    place_locked,
)
from semsig_gis.database.file import (
    INPUTS,
    damaged_files,
    is_folder,
    read_manifest,
    read_specs,
    require_file,
    save_database,
)
from semsig_gis.database.occlusion import TOLERANCE_M, NearbyFootprints, building_heights
from semsig_gis.database.place_names import FAR_M, PlaceNames
from semsig_gis.database.viewpoints import reproject, select_elements
from semsig_gis.objects import licenses_of, open_objects, save_objects
from semsig_gis.storage import (
    EMPTY_BOX,
    UNREADABLE,
    digest,
    move_folder,
    parse_json,
    read_whole,
    reason,
    whole_file,
    whole_folder,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    import geopandas as gpd
    import shapely
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.occlusion import Footprints
    from semsig_gis.objects import StreetObjects
else:
    gpd = lazy_loader.load("geopandas")
    shapely = lazy_loader.load("shapely")

STORE_KIND = "object store"
FORMAT = 1  # increased when older stores would be read incorrectly
STORE_SUFFIX = ".objects"
MANIFEST = "manifest.json"
OBJECTS = "objects.parquet"
FOOTPRINTS = "footprints.parquet"
STREETS = "streets.parquet"
BUILT_DIGEST = "built_digest"
SQUARE_M = 1000.0  # of a city in parts, for which names are read together
GROUND_M = 100.0  # margin of the ground that is drawn around the cells
NEXT = ".next"  # suffix of a new store until its database is in place


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ObjectStore(Displayed):
    """The data that a signature database was built from.

    Its buildings and streets are drawn and name places. They change what is seen only if the
    database was built with them: `SignatureDatabase.occlusion` and `viewpoints` say so.

    Parameters
    ----------
    objects : StreetObjects
        The objects.
    footprints, streets : GeoDataFrame, optional
        Buildings and centre lines in the CRS of the objects, if there are any.

    Examples
    --------
    >>> store = ObjectStore.of(demo_objects)
    >>> _, near = store.index.pairs_within(demo_objects.xy[:1], radius=0.0)
    >>> near.tolist()
    [0]
    """

    objects: StreetObjects
    footprints: gpd.GeoDataFrame | None = None
    streets: gpd.GeoDataFrame | None = None

    def _facts(self) -> dict[str, object]:
        return {
            "objects": len(self.objects),
            "buildings": "none" if self.footprints is None else len(self.footprints),
            "streets": "none" if self.streets is None else len(self.streets),
            "CRS": crs_label(self.objects.crs),
        }

    @classmethod
    def of(
        cls,
        objects: StreetObjects,
        *,
        footprints: gpd.GeoDataFrame | None = None,
        streets: gpd.GeoDataFrame | None = None,
    ) -> ObjectStore:
        """Make the store of a database from the arguments of `build_database`.

        It may have buildings or streets that the database was built without. CrsError if
        `footprints` or `streets` have no CRS.
        """
        houses = select_elements(footprints, "buildings")
        lines = select_elements(streets, "streets")
        return cls(
            objects=objects,
            footprints=None if houses is None else _stored(houses, objects.crs, NAME, HEIGHT),
            streets=None if lines is None else _stored(lines, objects.crs, HALF_WIDTH, NAME),
        )

    @cached_property
    def index(self) -> ObjectIndex:
        """R-tree over the objects, in their order, built at the first access."""
        return ObjectIndex(self.objects.xy)

    @property
    def ground(self) -> dict[str, gpd.GeoDataFrame]:
        """The ``buildings`` and the ``streets``, where there are some."""
        tables = {"buildings": self.footprints, "streets": self.streets}
        return {name: table for name, table in tables.items() if table is not None}

    @property
    def ground_licenses(self) -> tuple[str, ...]:
        """Attribution and licence of the buildings and streets."""
        return licenses_of(self.footprints, self.streets)

    def ground_around(self, xy: NDArray[np.float64]) -> dict[str, Any]:
        """Return the arguments of `ground_map` around places, (n, 2); empty without any ground."""
        box = ground_box(xy)
        tables = {
            name: table
            for name, table in self.ground.items()
            if len(table.sindex.intersection(box))
        }
        return {**tables, "box": box} if tables else {}

    @cached_property
    def _names(self) -> PlaceNames:
        return PlaceNames(self.streets, self.footprints)

    def place_name(self, x: float, y: float) -> str:
        """Return a place in words, by the streets and buildings around it; empty without any.

        For example ``on High Street, near Town Hall``. The position is in metres.
        """
        return self._names.of(x, y)

    @cached_property
    def _buildings(self) -> NearbyFootprints:
        if self.footprints is None:
            return NearbyFootprints(np.empty(0, object))
        # Heights matter only to landmarks.
        has_landmarks = bool(len(self.objects.taxonomy.tall_codes))
        heights = building_heights(self.footprints) if has_landmarks else None
        return NearbyFootprints(self.footprints.geometry.to_numpy(), heights)

    def buildings_around(
        self,
        places: NDArray[np.float64],
        *,
        distance: float,
        occlusion: float | None = TOLERANCE_M,
    ) -> Footprints | None:
        """Return at least the buildings that hide objects within `distance` of some places.

        Buildings joined to them are included. Places, shape (p, 2), are in metres. None if there
        are none, or `occlusion`, which is that of the database, is None: then the buildings are
        only for maps and names.
        """
        if self.footprints is None or occlusion is None:
            return None
        return self._buildings.around(places, distance=distance)


def ground_box(xy: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return the box of the streets and buildings that are drawn around places, shape (n, 2)."""
    low, high = xy.min(axis=0) - GROUND_M, xy.max(axis=0) + GROUND_M
    return (*low.tolist(), *high.tolist())


def _stored(table: gpd.GeoDataFrame, crs: CRS, *names: str) -> gpd.GeoDataFrame:
    """Return the geometries and the named columns of a table, in a CRS."""
    geometry = table.geometry
    rows = reproject(table[~(geometry.isna() | geometry.is_empty)], crs)
    columns = {name: rows[name].to_numpy() for name in names if name in rows}
    if NAME in columns:  # a file of a user may have names that are not text
        texts = [name if isinstance(name, str) else "" for name in columns[NAME]]
        columns[NAME] = np.array(texts, dtype=object)
    if (heights := building_heights(rows)) is not None and HEIGHT in columns:
        columns[HEIGHT] = heights.astype(np.float32)
    stored = gpd.GeoDataFrame(columns, geometry=rows.geometry.to_numpy(), crs=rows.crs)
    stored.attrs[LICENSES] = list(licenses_of(table))
    return stored


def save_with_store(database: SignatureDatabase, store: ObjectStore, path: str | Path) -> None:
    """Save a database and its object store.

    Parameters
    ----------
    database : SignatureDatabase
        The database.
    store : ObjectStore
        Its object store.
    path : str or Path
        File of the database; the store is written next to it (see `store_path`).

    Raises
    ------
    InputError
        If the files cannot be written; existing files are then unchanged.

    Notes
    -----
    Both are first written to a hidden folder. Then the new store is moved next to the database
    under another name, the database is renamed to its final name, and last the store to its own.
    The store contains the digest of its database. So `open_store` opens the new store as soon as
    the new database is in place, and the old store before that, also after an interrupted run. Any
    number of programs may read at the same time; if two write, the later one wins.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "city.parquet")
    ...     save_with_store(demo_database, ObjectStore.of(demo_objects), file)
    ...     len(open_store(file).objects) == len(demo_objects)
    True
    """
    file, waiting = Path(path), waiting_store(path)
    try:
        _save_with_store(database, store, file)
    except InputError as error:
        if waiting.exists() and not _awaited(file):
            left = f"; {waiting} could not be removed, and is not needed."
            raise InputError(str(error).removesuffix(".") + left) from error
        raise


def _save_with_store(database: SignatureDatabase, store: ObjectStore, file: Path) -> None:
    final, waiting = store_path(file), waiting_store(file)
    with contextlib.ExitStack() as stack:
        with whole_file(file) as partial:
            save_database(database, partial)
            new = partial.with_name(final.name)
            _write(store, new, fingerprint=digest(partial))
            stack.enter_context(place_locked(final))
            # Until the new database is in place, the old one may need a store that still waits.
            _settle(file)
            stack.callback(_remove_unneeded, file)
            move_folder(new, waiting)
        try:
            move_folder(waiting, final)
        except InputError as error:
            if not _awaited(file):
                raise
            cause = error.__cause__
            why = reason(cause) if isinstance(cause, OSError) else str(error)
            raise InputError(
                f"{file} is written, but its street objects are in {waiting}, because {final} "
                f"could not be replaced ({why}); they are read there, and the next build or update "
                "moves them."
            ) from error


def open_store(database: str | Path, folder: str | Path | None = None) -> ObjectStore:
    """Open the object store of a database.

    Parameters
    ----------
    database : str or Path
        File of the database, or folder of its parts.
    folder : str or Path, optional
        Folder of the store, if it is not next to the database; not for a database in parts.

    Returns
    -------
    ObjectStore
        The store.

    Raises
    ------
    DatabaseError
        If there is no database or no store, the store is damaged, or belongs to another database.

    Notes
    -----
    An interrupted `save_with_store` is completed, if the folder is writable. Reading does not
    change the files of a store.

    Examples
    --------
    >>> open_store("nowhere.parquet")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere.parquet does not exist;
    give a signature database file.
    """
    if is_folder(database):
        if folder is not None:
            raise DatabaseError(
                f"{database} is a folder with an object store in it; give no other store."
            )
        return _read_inputs(Path(database))
    require_file(database)
    file = Path(database)
    while True:
        place = current_store(file) if folder is None else Path(folder)
        before = file_state(file), file_state(place)
        # If another program has replaced the files in the meantime, they are read again.
        try:
            store = _read(place, file)
        except DatabaseError:
            if before == (file_state(file), file_state(place)):
                raise
        else:
            if before == (file_state(file), file_state(place)):
                return store


def store_path(database: str | Path) -> Path:
    """Return the folder of the object store of a database file, next to the file.

    Links are followed. InputError if the name of the database has the suffix of a store.
    """
    file = Path(os.path.realpath(database))
    if file.suffix == STORE_SUFFIX:
        raise InputError(
            f"{database} is the name of an object store; give the database a name with another "
            "suffix."
        )
    return file.with_suffix(STORE_SUFFIX)


def waiting_store(database: str | Path) -> Path:
    """Return the folder of a new object store while its database is not in place yet."""
    return _waiting(store_path(database))


def built_digest(path: str | Path) -> str:
    """Return the SHA-256 digest of a database file before columns were added to it.

    Without added columns this is the digest of the file, even if the file is damaged.
    """
    try:
        return str(read_specs(path)[BUILT_DIGEST])
    except (DatabaseError, KeyError):
        return digest(Path(path))


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / MANIFEST
    try:
        manifest = parse_json(read_whole(path), finite=True)
        if manifest["kind"] != STORE_KIND or not isinstance(manifest["files"], dict):
            raise ValueError(manifest["kind"])  # noqa: TRY301
        readable: bool = manifest["format"] == FORMAT
        version, _ = manifest["version"], manifest["database"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatabaseError(f"{path} is missing or damaged; build the database again.") from error
    if not readable:
        raise DatabaseError(
            f"{folder} was written by another version of semsig ({version}); build the database "
            "again."
        )
    return dict(manifest)


def _read(folder: Path, database: Path) -> ObjectStore:
    if not is_folder(folder):
        raise DatabaseError(
            f"{database} has no object store ({folder.name} in the same folder); build the "
            "database again."
        )
    manifest = _manifest(folder)
    if manifest["database"] != built_digest(database):
        raise DatabaseError(
            f"{folder} belongs to another database than {database}; build the database again."
        )
    # Older stores have an R-tree too; it is not read, because a damaged one ends the program.
    names = [name for name in (OBJECTS, FOOTPRINTS, STREETS) if name in manifest["files"]]
    damaged = damaged_files(folder, {name: manifest["files"][name] for name in names})
    # A file that the manifest does not list may be of another run.
    damaged += [
        name for name in (FOOTPRINTS, STREETS) if name not in names and (folder / name).exists()
    ]
    if damaged or OBJECTS not in names:
        raise DatabaseError(
            f"{folder / min(damaged, default=OBJECTS)} is damaged; build the database again."
        )
    specs = read_specs(database)
    lacking = lacking_ground(
        houses=FOOTPRINTS in names or specs.get("occlusion") is None,
        lines=STREETS in names or dict(specs.get("viewpoints") or {}).get("mode") != "streets",
    )
    if lacking:
        raise DatabaseError(f"{folder} {lacking}")
    return ObjectStore(
        objects=open_objects(folder / OBJECTS),
        footprints=_read_shapes(folder / FOOTPRINTS) if FOOTPRINTS in names else None,
        streets=_read_shapes(folder / STREETS) if STREETS in names else None,
    )


def lacking_ground(*, houses: bool, lines: bool) -> str:
    """Return the end of a message on the buildings and streets that a store lacks, if any.

    `houses` and `lines` are whether they are there, or not needed.
    """
    lacking = [name for name, there in (("buildings", houses), ("streets", lines)) if not there]
    if not lacking:
        return ""
    what = " and ".join(lacking)
    return f"lacks the {what} that the database was built with; build the database again."


def stored_inputs(folder: Path) -> dict[str, Path]:
    """Return the files of objects, buildings and streets in a database in parts, by role.

    DatabaseError if there are no objects.
    """
    files = {path.stem: path for path in sorted((folder / INPUTS).glob("*.parquet"))}
    if "objects" not in files:
        read_manifest(folder)  # raises for a folder that is not a database
        raise DatabaseError(
            f"{folder} has no street objects in {INPUTS}; build the database again."
        )
    return files


def _read_inputs(folder: Path) -> ObjectStore:
    files, manifest = stored_inputs(folder), read_manifest(folder)
    changed = damaged_files(folder / INPUTS, manifest.inputs)
    changed += [file.name for file in files.values() if file.name not in manifest.inputs]
    if manifest.inputs and changed:
        raise DatabaseError(
            f"{folder / INPUTS / min(changed)} is not what the database was built from; build the "
            "database again."
        )
    objects = open_objects(files.pop("objects"))
    houses, lines = _read_ground(files, objects.crs)
    return ObjectStore.of(objects, footprints=houses, streets=lines)


def ground_licenses(folder: Path) -> tuple[str, ...]:
    """Return the attribution and licence of the buildings and streets of a database in parts."""
    files = stored_inputs(folder)
    crs = open_objects(files.pop("objects"), box=EMPTY_BOX).crs
    return licenses_of(*_read_ground(files, crs, EMPTY_BOX))


def names_in(folder: Path, square: tuple[int, int]) -> PlaceNames:
    """Return the names for places in a square, from the inputs of a database in parts.

    The square of `SQUARE_M` is numbered by its column and row from the origin of the CRS.
    """
    files = stored_inputs(folder)
    crs = open_objects(files.pop("objects"), box=EMPTY_BOX).crs
    west, south = (SQUARE_M * number for number in square)
    east, north = west + SQUARE_M + FAR_M, south + SQUARE_M + FAR_M
    houses, lines = _read_ground(files, crs, (west - FAR_M, south - FAR_M, east, north))
    return PlaceNames(lines, houses)


def _read_ground(
    files: dict[str, Path], crs: CRS, box: Sequence[float] | None = None
) -> tuple[gpd.GeoDataFrame | None, gpd.GeoDataFrame | None]:
    """Return the buildings and the streets in files by role, None without a file."""
    if not files:
        return None, None
    from semsig_gis.objects import read_surroundings  # noqa: PLC0415 - it takes 320 ms to load

    roles: tuple[Literal["buildings", "streets"], ...] = ("buildings", "streets")
    houses, lines = (
        read_surroundings(files[role], role=role, crs=crs, box=box) if role in files else None
        for role in roles
    )
    return houses, lines


def _read_shapes(path: Path) -> gpd.GeoDataFrame:
    try:
        return gpd.read_parquet(path)
    except (*UNREADABLE, shapely.errors.ShapelyError) as error:
        raise DatabaseError(
            f"{path} is damaged ({brief(error)}); build the database again."
        ) from error


def _write(store: ObjectStore, folder: Path, *, fingerprint: str) -> None:
    """Write a store to a folder, which appears complete and replaces another."""
    with whole_folder(folder) as partial:
        save_objects(store.objects, partial / OBJECTS, keep_order=True)
        for name, table in ((FOOTPRINTS, store.footprints), (STREETS, store.streets)):
            if table is not None:
                table.to_parquet(partial / name, compression="zstd")
        manifest = {
            "kind": STORE_KIND,
            "format": FORMAT,
            "version": __version__,
            "database": fingerprint,
            "objects": len(store.objects),
            "files": {file.name: digest(file) for file in sorted(partial.glob("*.parquet"))},
        }
        (partial / MANIFEST).write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")


def current_store(database: Path) -> Path:
    """Return the folder of the store of a database; complete an interrupted save if possible."""
    final = store_path(database)
    if not _awaited(database):
        return final
    with contextlib.suppress(InputError), place_locked(final) as is_locked:
        if is_locked:
            _settle(database)
    return _waiting(final) if _awaited(database) else final


def _settle(database: Path) -> None:
    """Move the waiting store of a database to its final folder, if there is one."""
    if _awaited(database):
        final = store_path(database)
        move_folder(_waiting(final), final)


def _remove_unneeded(database: Path) -> None:
    """Remove the waiting store of a database that is not in place."""
    if not _awaited(database):
        shutil.rmtree(waiting_store(database), ignore_errors=True)


def _awaited(database: Path) -> bool:
    """Whether the store of a database still waits to be moved to its final folder."""
    final = store_path(database)
    waiting = _waiting(final)
    if not (waiting.exists() and database.exists()):
        return False
    belongs = built_digest(database)
    return _database_of(waiting) == belongs != _database_of(final)


def _database_of(store: Path) -> str | None:
    """Return the digest of the database of a store, None if the store is missing or damaged."""
    try:
        return str(_manifest(store)["database"])
    except DatabaseError:
        return None


def file_state(path: Path) -> tuple[int, ...] | None:
    """Return device, inode, size and time of a file, to detect a change; None if it is missing."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def _waiting(final: Path) -> Path:
    return final.with_name(final.name + NEXT)
