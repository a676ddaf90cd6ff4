"""`semsig export`: files for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import Database, Smooth, ground_of, known_identifiability
from semsig_gis.core import InputError
from semsig_gis.output import export_suffixes, layer_names, raster_names


def _layers() -> tuple[str, ...]:
    """Return the names of layers and rasters."""
    from semsig_gis.output import LAYERS, RASTERS

    return (*LAYERS, *RASTERS)


class Exported(TypedDict):
    """The file, and the number of cells of the database unless they are only described."""

    exported: str
    cells: NotRequired[int]


@command(
    "export",
    title="Export to other programs",
    group="Look",
    order=4,
    returns=Exported,
    examples=(
        "semsig export city.parquet --out city.gpkg",
        "semsig export city.parquet --layer ambiguity --out ambiguity.tif",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Export:
    """Export cells, objects and queries for QGIS and other programs."""

    database: Database
    out: Annotated[
        Path,
        Option(
            f"File to write. Its suffix is the format: {', '.join(export_suffixes())} or .json. "
            "A .gpkg (for QGIS) has all layers, .pmtiles (for web maps) the cells, .tif a raster "
            "of the cells, .json a description (STAC item), and other formats one layer.",
            title="File",
            writes=(".gpkg", ""),
        ),
    ]
    objects: Annotated[
        Path | None, Option("Street objects to add as a layer.", title="Street objects", reads=True)
    ] = None
    evaluation: Annotated[
        Path | None,
        Option(
            "Folder written by `semsig evaluate --out`, to add its queries.",
            title="Folder of results",
            metavar="FOLDER",
            reads=True,
        ),
    ] = None
    layer: Annotated[
        list[str] | None,
        Option(
            f"Layer to write, by default cells, in a .gpkg all: {', '.join(layer_names())} (repeat "
            f"for several). In a .tif, by default ambiguity: {', '.join(raster_names())}.",
            title="Layers",
            metavar="NAME",
            suggestions=_layers,
        ),
    ] = None
    smooth: Smooth = None
    h3: Annotated[
        int | None,
        Option(
            "Write hexagons of this resolution of H3, such as 9, that sum up cells, objects and "
            "queries.",
            title="Resolution of hexagons",
            low=0,
            high=15,
        ),
    ] = None
    geometry: Annotated[
        Literal["polygon", "point"] | None,
        Option(
            "How a cell is drawn.",
            title="Shape of a cell",
            default="as a polygon, in CSV as a point",
        ),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the file."""
        from semsig_gis.database import open_city
        from semsig_gis.evaluation import open_evaluation
        from semsig_gis.objects import open_objects
        from semsig_gis.output import ITEM, export_database, export_item

        files = {"exported": self.out}
        values: Exported = {"exported": str(self.out)}
        if self.out.suffix.lower() == ITEM:
            others = (self.evaluation, self.layer, self.smooth, self.h3, self.geometry)
            if any(option is not None for option in others):
                raise InputError(
                    f"{self.out} describes the files of a database; give only --objects with it."
                )
            export_item(self.database, self.out, objects=self.objects)
            return Result(
                values=lambda: values,
                summary=["A description of the database (STAC item)."],
                files=files,
            )
        city = open_city(self.database)
        queries = None if self.evaluation is None else open_evaluation(self.evaluation)
        ground = ground_of(city) if self.out.suffix.lower() == ".gpkg" else {}
        if self.layer:
            ground = {name: table for name, table in ground.items() if name in self.layer}
        # Hexagons count the objects that the database was built from, if they are stored with it.
        stored = city.objects if self.h3 is not None and self.objects is None else None
        with reporter.progress(f"writing {self.out.name}") as advance:
            export_database(
                city.database,
                self.out,
                layers=self.layer or (),
                objects=stored if self.objects is None else open_objects(self.objects),
                evaluation=queries,
                **ground,
                identifiability=known_identifiability(city, reporter),
                geometry=self.geometry,
                smooth=self.smooth,
                h3=self.h3,
                progress=advance,
            )
        cells = len(city.database)
        return Result(
            values=lambda: {**values, "cells": cells},
            summary=[f"{cells:,} cells, for other programs."],
            files=files,
        )
