"""`semsig map`: cells, evaluations, changes, answers and objects on a map."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typing_extensions import TypedDict

from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import (
    Database,
    Smooth,
    city_name,
    draw_ground,
    known_identifiability,
    online_notes,
)
from semsig_gis.core import InputError

if TYPE_CHECKING:
    from semsig_gis.database import City


class Drawn(TypedDict):
    """The file of a map."""

    map: str


@command(
    "map",
    title="Draw a map",
    group="Look",
    order=3,
    returns=Drawn,
    examples=(
        "semsig map city.parquet --ambiguity --out map.html",
        "semsig map city.parquet --evaluation results --out map.html",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Map:
    """Draw cells, evaluations, changes, answers or objects on a map."""

    database: Database
    out: Annotated[Path, Option("Map to write (.html).", title="Map page", writes=".html")]
    objects: Annotated[
        Path | None,
        Option("Draw street objects written by `semsig load`.", title="Street objects", reads=True),
    ] = None
    ambiguity: Annotated[bool, Option("Draw how many cells look the same.")] = False
    identifiability: Annotated[
        bool, Option("Draw how well cells can be found (after `semsig identify`).")
    ] = False
    evaluation: Annotated[
        Path | None,
        Option(
            "Folder written by `semsig evaluate --out`.",
            title="Folder of results",
            metavar="FOLDER",
            reads=True,
        ),
    ] = None
    smooth: Smooth = None
    drift: Annotated[
        Path | None,
        Option("Draw the changes up to this newer database.", title="Changes", reads=True),
    ] = None
    location: Annotated[
        Path | None,
        Option(
            "Draw an answer: the .tif file that `semsig localize --out` wrote.",
            title="Answer",
            reads=True,
        ),
    ] = None
    buildings: Annotated[
        Path | None,
        Option(
            "Footprints to draw below the map.",
            default="from the database",
            reads=True,
            advanced=True,
        ),
    ] = None
    streets: Annotated[
        Path | None,
        Option(
            "Centre lines to draw below the map.",
            default="from the database",
            reads=True,
            advanced=True,
        ),
    ] = None
    tiles: Annotated[
        str | None,
        Option(
            "Draw online tiles below the map, of a provider of xyzservices that needs no key, "
            "such as OpenStreetMap.Mapnik.",
            title="Online tiles",
            metavar="PROVIDER",
            advanced=True,
        ),
    ] = None
    title: Annotated[
        str | None,
        Option(
            "Write a title on the map, such as the city and the date of its data.",
            default="the name of the database's file",
        ),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the map; return its file."""
        from semsig_gis.database import open_city
        from semsig_gis.evaluation import open_evaluation
        from semsig_gis.output import city_map, save_map

        paths = (self.evaluation, self.drift, self.location, self.objects)
        if not (self.identifiability or self.ambiguity or any(path is not None for path in paths)):
            raise InputError(
                "there is nothing to show on the map; give --evaluation, --ambiguity, "
                "--identifiability, --drift, --location or --objects, or several of them."
            )
        if self.smooth is not None and self.evaluation is None:
            raise InputError(
                "--smooth works only with an evaluation; give --evaluation as well, or leave it "
                "out."
            )
        results = None if self.evaluation is None else open_evaluation(self.evaluation)
        city = open_city(self.database)
        columns = None
        if self.identifiability or self.ambiguity:
            columns = known_identifiability(city, reporter)
        if self.identifiability and columns is None:
            raise InputError(
                f"{self.database} has no columns of semsig identify; run semsig identify first."
            )
        shown = self._objects(city) | self._dates(city, reporter) | self._answer(city)
        with reporter.progress("drawing the map"):
            page = city_map(
                city.database,
                evaluation=results,
                smooth=self.smooth,
                ambiguity=self.ambiguity,
                identifiability=columns,
                tiles=self.tiles,
                **shown,
            )
            draw_ground(page, city, buildings=self.buildings, streets=self.streets)
            offline = save_map(page, self.out, title=self.title or city_name(self.database))
        return Result(
            values=lambda: {"map": str(self.out)},
            summary=[f"The map shows {', '.join(self._layers())}."],
            files={"map": self.out},
            notes=online_notes(offline, tiles=self.tiles),
        )

    def _layers(self) -> list[str]:
        """Return what the map shows, in words."""
        layers = {
            "how many cells look the same": self.ambiguity,
            "how well cells can be found": self.identifiability,
            "the views of an evaluation": self.evaluation,
            "what has changed": self.drift,
            "where a view may be from": self.location,
            "street objects": self.objects,
        }
        return [words for words, value in layers.items() if value]

    def _objects(self, city: City) -> dict[str, Any]:
        """Return the street objects, which lie where the database does."""
        import shapely

        from semsig_gis.database import require_same_place
        from semsig_gis.objects import open_objects

        if self.objects is None:
            return {}
        objects = open_objects(self.objects)
        table = objects.table.to_crs(city.database.crs)
        places = shapely.get_coordinates(table.geometry.array)
        require_same_place(city.database, places, "street objects")
        return {"objects": objects}

    def _dates(self, city: City, reporter: Reporter) -> dict[str, Any]:
        """Return the newer database and the street objects of both."""
        from semsig_gis.database import open_city

        if self.drift is None:
            return {}
        newer = open_city(self.drift)
        objects = {"objects_before": city.objects, "objects_after": newer.objects}
        if None in objects.values():
            reporter.remark("street objects of both databases were not found; drawing cells only")
            objects = {}
        return {"newer": newer.database, **objects}

    def _answer(self, city: City) -> dict[str, Any]:
        """Return the answer to draw."""
        from semsig_gis.localization import open_posterior
        from semsig_gis.output import RASTER_SUFFIXES

        if self.location is None:
            return {}
        if self.location.suffix.lower() in RASTER_SUFFIXES:
            return {"posterior": open_posterior(self.location, city.database)}
        return {"answer": self.location}
