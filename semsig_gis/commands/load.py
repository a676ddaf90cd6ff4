"""`semsig load`: street objects from files of open data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from typing_extensions import TypedDict

from semsig_gis import objects as street_objects
from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.core import InputError, Table, Town


def catalogs() -> tuple[str, ...]:
    """Return the names of the catalogues."""
    from semsig_gis.sources import catalog_names

    return catalog_names()


Files = Annotated[list[Path], Option("Files, or a folder of files.", positional=True, reads=True)]
Catalogs = Annotated[
    list[str] | None,
    Option(
        "Catalogue, by name or .toml file; not needed for OpenStreetMap and Overture. Repeat "
        "to merge several, best first.",
        title="Catalogues",
        metavar="NAME|FILE",
        reads=True,
        suggestions=catalogs,
    ),
]
Crs = Annotated[
    str | None,
    Option(
        "CRS of files that do not state their own, such as EPSG:2154.",
        title="CRS of the files",
        metavar="CRS",
    ),
]


class LayerRows(TypedDict):
    """The rows of a layer: read, left out for a reason, and kept."""

    name: str
    read: int
    unreadable: int
    filtered: int
    excluded: int
    outside: int
    missing: int
    duplicates: int
    misplaced: int
    collapsed: int
    conflated: int
    kept: int
    role: str
    notes: list[str]


class Quality(TypedDict):
    """The quality report of a load."""

    objects: int
    classes: list[street_objects.ClassQuality]
    absent: list[str]
    sources: list[LayerRows]
    conflated: list[street_objects.ConflatedPair]
    crs: str
    extent: tuple[float, float, float, float]
    extent_degrees: tuple[float, float, float, float]
    town: Town
    distortion: dict[str, Any]
    hull_km2: float
    occupied_km2: float
    licenses: list[str]
    unread: list[street_objects.UnreadLayer]
    notes: list[str]
    fronts: int
    derived: int
    texts: list[street_objects.TextColumn]


@dataclass(frozen=True, kw_only=True)
class LoadOptions:
    """Fields of the commands that make street objects from a catalogue."""

    out: Annotated[
        Path,
        Option("Street objects to write (.parquet).", title="Street objects", writes=".parquet"),
    ]
    layer: Annotated[
        list[str] | None,
        Option(
            "Read only this layer, or with +NAME also this one; may be repeated.",
            title="Layers",
            metavar="NAME",
        ),
    ] = None
    all_layers: Annotated[bool, Option("Read the optional layers of objects as well.")] = False
    paper_classes: Annotated[
        bool,
        Option(
            "Read only the eleven classes of the paper.",
            title="Only the classes of the paper",
            advanced=True,
        ),
    ] = False
    ground: Annotated[
        bool,
        Option(
            "Write the buildings and streets of the source as well, next to --out.",
            title="Buildings and streets",
        ),
    ] = True
    buildings: Annotated[
        Path | None,
        Option(
            "Building footprints to write (.parquet).",
            default="the name of --out with .buildings",
            writes=".parquet",
            advanced=True,
        ),
    ] = None
    streets: Annotated[
        Path | None,
        Option(
            "Centre lines of streets to write (.parquet).",
            default="the name of --out with .streets",
            writes=".parquet",
            advanced=True,
        ),
    ] = None
    metric_crs: Annotated[
        str | None,
        Option(
            "CRS in metres to work in.",
            title="CRS to work in",
            metavar="CRS",
            default="the catalogue's or the UTM zone",
            advanced=True,
        ),
    ] = None
    max_distortion: Annotated[
        float,
        Option(
            "Largest distortion allowed for the CRS: degrees of bearings, percent of lengths.",
            title="Largest distortion of the CRS",
            low=0,
            high=180,
            advanced=True,
        ),
    ] = 6.0
    filter: Annotated[
        bool,
        Option("Apply the catalogue's filters.", title="Filters of the catalogue", advanced=True),
    ] = True
    collapse: Annotated[
        bool,
        Option(
            "Collapse objects of a class at the same place.",
            title="Collapse objects of a class",
            advanced=True,
        ),
    ] = True
    merge: Annotated[
        bool,
        Option(
            "Merge objects of different layers within the catalogue's radii.",
            title="Merge objects of layers",
            advanced=True,
        ),
    ] = True

    @property
    def with_ground(self) -> bool:
        """Whether buildings and streets are read."""
        return self.ground or self.buildings is not None or self.streets is not None

    @property
    def selection(self) -> street_objects.Selection:
        """The layers to read by default."""
        if self.all_layers and self.paper_classes:
            raise InputError("--all-layers and --paper-classes are both given; give one of them.")
        return "all" if self.all_layers else "paper" if self.paper_classes else "default"

    def save(self, loaded: street_objects.Loaded) -> Result:
        """Write the objects and their surroundings; return their quality report."""
        notes = list(loaded.notes)
        files, others = {"street objects": self.out}, {}
        for what, table, path in (
            ("buildings", loaded.buildings, self.buildings),
            ("streets", loaded.streets, self.streets),
        ):
            if path is not None and (table is None or table.empty):
                notes.append(f"there are no {what} in what was loaded, so {path} is not written")
            elif path is not None:
                others[path] = table
                files[what] = path
        files |= street_objects.save_with_ground(
            loaded.objects,
            self.out,
            buildings=loaded.buildings if self.ground and self.buildings is None else None,
            streets=loaded.streets if self.ground and self.streets is None else None,
            others=others,
            remark=notes.append,
        )
        report = street_objects.quality_report(
            loaded.objects, loaded.report, loaded.conflation, notes=notes
        )
        return Result(
            values=report.to_dict,
            summary=self._summary(report),
            tables=self._tables(report),
            files=files,
            notes=notes,
        )

    def _summary(self, report: street_objects.QualityReport) -> Iterator[str]:
        from semsig_gis.output import lost_sentence, quality_sentence

        yield quality_sentence(report)
        if sentence := lost_sentence(report):
            yield sentence

    def _tables(self, report: street_objects.QualityReport) -> Iterator[Table]:
        from semsig_gis.output import quality_tables

        # The notes are shown below the tables only.
        yield from quality_tables(replace(report, notes=()))


@command(
    "load",
    title="Load street objects",
    group="Prepare",
    order=1,
    returns=Quality,
    examples=(
        "semsig load monaco.osm.pbf --out objects.parquet",
        "semsig load trees.geojson --catalog city.toml --out objects.parquet",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Load(LoadOptions):
    """Read files of open data into street objects."""

    files: Files
    catalog: Catalogs = None
    crs: Crs = None
    clip: Annotated[
        str | None,
        Option(
            "Keep only what is in this box in degrees, in the polygons of a file, or with 'box' "
            "in the box that OpenStreetMap files state; with 'none' keep all.",
            title="Area to keep",
            metavar="WEST,SOUTH,EAST,NORTH|FILE|box|none",
            default="box where a file states one",
            reads=True,
        ),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the street objects; return their quality report."""
        with reporter.progress("loading") as advance:
            loaded = street_objects.load(
                self.files,
                catalog=self.catalog or (),
                layers=self.layer or (),
                selection=self.selection,
                surroundings=self.with_ground,
                clip=self.clip,
                crs=self.crs,
                metric_crs=self.metric_crs,
                filters=self.filter,
                collapse=self.collapse,
                merge=self.merge,
                max_distortion=self.max_distortion,
                progress=advance,
                remark=reporter.remark,
            )
        return self.save(loaded)
