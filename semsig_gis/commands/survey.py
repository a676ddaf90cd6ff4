"""`semsig survey`: what a place's data can carry, before a database is built."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from semsig_gis.commands.build import Radius
from semsig_gis.commands.load import Catalogs, Crs, Files
from semsig_gis.commands.model import Option, Reporter, Result, command


@command(
    "survey",
    title="Survey a place's data",
    group="Prepare",
    order=5,
    returns="semsig_gis.database:SurveyRecord",
    examples=(
        "semsig survey monaco.osm.pbf",
        "semsig survey trees.geojson --catalog city.toml --area 7.41,43.73,7.42,43.74",
    ),
)
@dataclass(frozen=True, kw_only=True)
class SurveyPlace:
    """Say what the data of a place can carry, before you build.

    At places every 10 m along the streets, the objects in sight are counted, and then what optional
    layers add. Where few are seen, a view fits many places.
    """

    files: Files
    catalog: Catalogs = None
    area: Annotated[
        Path | None,
        Option(
            "Look only at places in this box in degrees, or in polygons.",
            metavar="WEST,SOUTH,EAST,NORTH|FILE",
            reads=True,
        ),
    ] = None
    radius: Radius = 30.0
    crs: Crs = None

    def run(self, reporter: Reporter) -> Result:
        """Return the numbers as values and as tables."""
        from semsig_gis.database import survey
        from semsig_gis.objects import load, read_area
        from semsig_gis.output import survey_sentence, survey_tables
        from semsig_gis.sources import combine_catalogs, detect_catalogs, load_catalog

        names, remarks = (self.catalog, ()) if self.catalog else detect_catalogs(self.files)
        for line in remarks:
            reporter.remark(line)
        catalog = combine_catalogs(list(map(load_catalog, names)))
        with reporter.progress("loading") as advance:
            loaded = load(
                self.files,
                catalog=catalog,
                selection="all",
                crs=self.crs,
                progress=advance,
            )
        area = None
        if self.area is not None:
            xy = loaded.objects.xy
            near = (*xy.min(axis=0).tolist(), *xy.max(axis=0).tolist())
            area = read_area(self.area, crs=loaded.objects.crs, near=near)
        with reporter.progress("looking around") as advance:
            optional = [spec.name for spec in catalog.layers if spec.optional]
            result = survey(
                loaded, optional=optional, radius=self.radius, area=area, progress=advance
            )
        first, *others = survey_tables(result)
        return Result(
            values=result.to_dict,
            summary=[survey_sentence(result), first],
            tables=others,
        )
