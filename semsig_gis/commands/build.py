"""`semsig build`: a signature database from street objects."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from semsig_gis.commands.info import Info, Properties
from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import MOST_METRES, Scheduler, Workers, numbers
from semsig_gis.core import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pyproj import CRS

    from semsig_gis.objects import StreetObjects


Role = Literal["buildings", "streets"]
ROLES: tuple[Role, ...] = ("buildings", "streets")


Radius = Annotated[
    float,
    Option(
        "Visibility range for classes without a range in the catalogue.",
        title="Visibility range",
        unit="m",
        low=0.01,
        high=6000,
    ),
]


@command(
    "build",
    title="Build signature database",
    group="Prepare",
    order=6,
    returns=Properties,
    examples=(
        "semsig build objects.parquet --out city.parquet",
        "semsig build objects.parquet --out city.parquet --radius 50",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Build:
    """Build a signature database from street objects.

    The city is divided into square cells. For each it is stored which street objects are seen from
    its centre, clockwise from north: its signature. Cells that see nothing are left out. A folder
    with the street objects, ready to be searched, is written next to the database.
    """

    objects: Annotated[
        Path,
        Option(
            "Street objects written by `semsig load`.",
            title="Street objects",
            positional=True,
            reads=True,
        ),
    ]
    out: Annotated[
        Path,
        Option(
            "Signature database to write (.parquet), or a folder with tiles.",
            title="Signature database",
            writes=(".parquet", ""),
        ),
    ]
    step: Annotated[
        float, Option("Side of a cell.", title="Side of a cell", unit="m", low=0.01, high=100_000)
    ] = 10.0
    radius: Radius = 30.0
    levels: Annotated[
        int,
        Option(
            "Number of equal sectors in which the methods of the paper compare bearings.",
            title="Angle levels",
            low=1,
            high=255,
            advanced=True,
        ),
    ] = 16
    origin: Annotated[
        str,
        Option(
            "Corner of a cell in metres, in the CRS of the objects.", metavar="X,Y", advanced=True
        ),
    ] = "0,0"
    ground: Annotated[
        bool,
        Option(
            "Use the buildings and streets that `semsig load` wrote next to the street objects.",
            title="Buildings and streets of the street objects",
        ),
    ] = True
    buildings: Annotated[
        Path | None,
        Option(
            "Building footprints that hide what is behind them.",
            default="next to the street objects, if there are any",
            reads=True,
        ),
    ] = None
    streets: Annotated[
        Path | None,
        Option(
            "Centre lines of streets, for maps, names of places and viewpoints near streets.",
            default="next to the street objects, if there are any",
            reads=True,
        ),
    ] = None
    viewpoints: Annotated[
        Literal["all", "outdoor", "streets"] | None,
        Option(
            "Viewpoints: every cell, outdoor cells or cells near streets.",
            default="outdoor where there are buildings, otherwise all",
        ),
    ] = None
    street_width: Annotated[
        float,
        Option(
            "Default street width, where --streets has none.",
            unit="m",
            low=0.1,
            high=400,
            advanced=True,
        ),
    ] = 16.0
    area: Annotated[
        Path | None,
        Option(
            "Keep the cells in this box in degrees, or in polygons.",
            metavar="WEST,SOUTH,EAST,NORTH|FILE",
            reads=True,
        ),
    ] = None
    tile: Annotated[
        float | None,
        Option(
            "Tile size; 2000 with --workers or --scheduler.",
            title="Tile size",
            unit="m",
            low=1,
            high=MOST_METRES,
            advanced=True,
        ),
    ] = None
    workers: Workers = 0
    scheduler: Scheduler = None

    def run(self, reporter: Reporter) -> Result:
        """Write the database; return its properties."""
        import numpy as np

        from semsig_gis.core import GridSpec, SignatureSpec
        from semsig_gis.database import TileSpec, ViewpointSpec, build_tiles
        from semsig_gis.objects import ground_file, open_objects, other_run, read_area
        from semsig_gis.storage import EMPTY_BOX, bounds_by_group

        ground_files = {role: ground_file(self.objects, role) for role in ROLES}
        for role, path in ground_files.items():
            if os.path.realpath(path) == os.path.realpath(self.out):
                raise InputError(
                    f"{self.out} is where the {role} of {self.objects} are, so no database can be "
                    "written there; give another name."
                )
        defaults = {
            role: path
            for role, path in ground_files.items()
            if self.ground and getattr(self, role) is None
        }
        defaults = {role: path for role, path in defaults.items() if path.is_file()}
        in_tiles = self.tile is not None or self.workers or self.scheduler is not None
        if not in_tiles and self.out.suffix.lower() != ".parquet" and not self.out.is_dir():
            raise InputError(f"{self.out} cannot be written; the name must end in .parquet.")
        grid = GridSpec(self.step, tuple(numbers(self.origin, "--origin")))  # type: ignore[arg-type]
        spec = SignatureSpec(self.radius, self.levels)
        # The objects of tiles are read tile by tile; here only their CRS is needed.
        objects = open_objects(self.objects, box=EMPTY_BOX if in_tiles else None)
        boxes = np.concatenate([*bounds_by_group(self.objects), np.empty((0, 4))])
        near = (*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0)) if len(boxes) else None
        if near is not None:
            defaults = self._in_place(defaults, objects.crs, near, reporter)
        ground = {role: getattr(self, role) for role in ROLES} | defaults
        for role, path in ground.items():
            if path is not None and other_run(path, self.objects):
                reporter.remark(
                    f"the {role} of {path} are of another run of semsig load than "
                    f"{self.objects}; if that is not on purpose, load the street objects again"
                )
        mode = self.viewpoints or ("all" if ground["buildings"] is None else "outdoor")
        polygons = None
        if self.area is not None:
            polygons = read_area(self.area, crs=objects.crs, near=near)
        width = self.street_width / 2
        specs: dict[str, Any] = {
            "grid": grid,
            "spec": spec,
            "viewpoints": ViewpointSpec(mode=mode, width=width, area=polygons),
        }
        if not in_tiles:
            cells, entries = self._build_whole(objects, ground, specs, reporter)
        else:
            with reporter.progress("building tiles") as advance:
                manifest = build_tiles(
                    self.objects,
                    self.out,
                    tile=None if self.tile is None else TileSpec(self.tile),
                    **ground,
                    workers=self.workers,
                    scheduler=self.scheduler,
                    progress=advance,
                    remark=reporter.remark,
                    **specs,
                )
            cells, entries = manifest.cells, manifest.entries
        properties = Info(database=self.out).run(reporter)
        return replace(
            properties,
            summary=self._summary(cells, entries, mode),
            files={"signature database": self.out},
            notes=[self._found_note(defaults, mode)] if defaults else [],
        )

    def _in_place(
        self,
        defaults: dict[Role, Path],
        crs: CRS,
        box: Sequence[float],
        reporter: Reporter,
    ) -> dict[Role, Path]:
        """Return the files that were found and are where the street objects are; note others."""
        from semsig_gis.objects import covers_place

        own = {role: path for role in ROLES if (path := getattr(self, role)) is not None}
        elsewhere = {
            role: path
            for role, path in {**defaults, **own}.items()
            if not covers_place(path, crs=crs, box=box)
        }
        for role, path in elsewhere.items():
            used = ", and are not used" if role in defaults else ""
            reporter.remark(f"the {role} of {path} are not where the street objects are{used}")
        return {role: path for role, path in defaults.items() if role not in elsewhere}

    def _build_whole(
        self,
        objects: StreetObjects,
        ground: dict[Role, Path | None],
        specs: dict[str, Any],
        reporter: Reporter,
    ) -> tuple[int, int]:
        """Write a database in one file with its object store; return its cells and entries."""
        from semsig_gis.database import ObjectStore, build_database, save_with_store
        from semsig_gis.objects import read_surroundings, with_notes

        notes: list[str] = []
        read = partial(read_surroundings, crs=objects.crs, remark=notes.append)
        houses, lines = (
            None if path is None else read(path, role=role) for role, path in ground.items()
        )
        if houses is not None and (invalid := int((~houses.is_valid).sum())):
            notes.append(
                f"{invalid} building footprints in {ground['buildings']} are invalid polygons; "
                "they were repaired"
            )
        for note in notes:
            reporter.remark(note)
        objects = with_notes(objects, (*objects.notes, *notes))
        with reporter.progress("building") as advance:
            database = build_database(
                objects, footprints=houses, streets=lines, progress=advance, **specs
            )
        store = ObjectStore.of(objects, footprints=houses, streets=lines)
        save_with_store(database, store, self.out)
        return len(database), len(database.codes)

    def _found_note(self, defaults: Mapping[Role, Path], mode: str) -> str:
        """Return a sentence on the files that were used without being named."""
        files = " and ".join(map(str, defaults.values()))
        effect = ""
        if "buildings" in defaults:
            outdoor = "" if self.viewpoints else f", and the viewpoints are {mode}"
            effect = f"; buildings hide what is behind them{outdoor}"
        return f"with the {' and '.join(defaults)} of {files}{effect} (--no-ground: without them)"

    def _summary(self, cells: int, entries: int, mode: str) -> Iterator[str]:
        from semsig_gis.core import town_of
        from semsig_gis.database import PartitionedDatabase, landmark_costs, open_city

        where = {"all": "", "outdoor": " outside buildings", "streets": " along streets"}
        city = open_city(self.out)
        dataset = city.dataset
        town = town_of(dataset.bounds.reshape(2, 2), dataset.crs)
        reach = dataset.taxonomy.ranges(self.radius).max()
        yield (
            f"{cells:,} cells of {self.step:g} m{where[mode]} {town} see "
            f"{entries / cells:.1f} street objects on average, up to {reach:,g} m away."
        )
        parts = dataset.parts() if isinstance(dataset, PartitionedDatabase) else [dataset]
        costs = [
            f"{title.lower()} {count:,} ({size / 1e6:,.2f} MB)"
            for title, (count, size) in landmark_costs(parts, city.bytes).items()
        ]
        if costs:
            yield f"Sightings of landmarks, and their part of the file: {', '.join(costs)}."
