"""`semsig info`: the properties of a database."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NotRequired

from typing_extensions import TypedDict

from semsig_gis import database as databases
from semsig_gis.commands.model import Reporter, Result, command
from semsig_gis.commands.options import Database, Symbols, known_identifiability
from semsig_gis.core import Table, Town

if TYPE_CHECKING:
    from semsig_gis.database import City
    from semsig_gis.evaluation import Identifiability


class ClassProperties(TypedDict):
    """How often a class is seen; `objects` is None if they are not known."""

    code: int
    symbol: str
    name: str
    title: str
    family: str
    range_m: float
    number: int
    share: float
    objects: int | None
    objects_per_km2: float
    entropy_bits: float


class Groups(TypedDict):
    """Statistics of the groups of cells with equal types, angles or both."""

    type: dict[str, float | None]
    angle: dict[str, float | None]
    both: dict[str, float | None]


class Viewpoints(TypedDict):
    """Where the viewpoints are."""

    mode: str
    half_width_m: float | None
    area_km2: float | None


class TypeGroup(TypedDict):
    """The types that most cells share, and their number."""

    types: str
    cells: int


class Properties(TypedDict):
    """The properties of a database, of `semsig identify`, and the files next to it."""

    signatures: int
    mean_length: float
    covered_km2: float
    radius_m: float
    step_m: float
    levels: int
    crs: str
    extent_degrees: list[float]
    town: Town
    distortion: dict[str, Any]
    file_mb: float | None
    mb_per_km2: float | None
    version: str
    licenses: list[str]
    notes: list[str]
    viewpoints: Viewpoints
    occlusion_m: float | None
    occurrences: list[ClassProperties]
    density_from: str
    cell_bits: float
    groups: Groups
    largest_type_group: TypeGroup
    identifiability: NotRequired[dict[str, Any]]
    files: list[databases.Companion]


@command(
    "info",
    title="Properties of a database",
    group="Look",
    order=2,
    returns=Properties,
    examples=(
        "semsig info city.parquet",
        "semsig info city.parquet --symbols --tables",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Info:
    """Print the properties of a database next to those in the paper."""

    database: Database
    symbols: Symbols = False

    def run(self, reporter: Reporter) -> Result:
        """Return the properties as values and as tables."""
        from semsig_gis.database import companions, database_summary, open_city

        city = open_city(self.database)
        columns = known_identifiability(city, reporter)

        def values() -> dict[str, Any]:
            counts = city.object_counts
            summary = database_summary(city.database, file_bytes=city.bytes, object_counts=counts)
            if columns is not None:
                summary["identifiability"] = columns.summary(object_counts=counts)
            files = [file.to_dict() for file in companions(self.database)]
            return summary | {"files": files}

        return Result(
            values=values, summary=self._summary(city, columns), tables=self._tables(city, columns)
        )

    def _summary(self, city: City, columns: Identifiability | None) -> Iterator[str]:
        from semsig_gis.database import database_summary
        from semsig_gis.output import database_sentences, identifiability_sentence

        yield from database_sentences(database_summary(city.database), symbols=self.symbols)
        if columns is not None:
            yield f"{identifiability_sentence(columns)}."
        holders = dict.fromkeys(line.partition(": ")[0] for line in city.licenses)
        yield f"Data: {', '.join(holders) or 'no licence stated'}."

    def _tables(self, city: City, columns: Identifiability | None) -> Iterator[str | Table]:
        from semsig_gis.database import companions
        from semsig_gis.output import (
            companion_table,
            database_tables,
            identifiability_tables,
        )

        counts = city.object_counts
        yield from database_tables(
            city.database,
            file_bytes=city.bytes,
            object_counts=counts,
            symbols=self.symbols,
        )
        if columns is not None:
            yield from identifiability_tables(columns, object_counts=counts)
        if files := companions(self.database):
            yield companion_table("Files of the database", files)
        yield from city.licenses
