"""`semsig info`: the properties of a database."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from semsig_gis.commands.model import Reporter, Result, command
from semsig_gis.commands.options import Database, known_identifiability
from semsig_gis.core import Table

if TYPE_CHECKING:
    from semsig_gis.database import City
    from semsig_gis.evaluation import Identifiability


@command(
    "info", title="Properties of a database", group="Databases", order=4, returns=dict[str, Any]
)
@dataclass(frozen=True, kw_only=True)
class Info:
    """Print the properties of a database next to those in the paper."""

    database: Database

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
            return summary | {"beside": files}

        return Result(values=values, text=self._text(city, columns))

    def _text(self, city: City, columns: Identifiability | None) -> Iterator[str | Table]:
        from semsig_gis.database import companions
        from semsig_gis.output import (
            companion_table,
            database_tables,
            identifiability_tables,
        )

        counts = city.object_counts
        yield from database_tables(city.database, file_bytes=city.bytes, object_counts=counts)
        if columns is not None:
            yield from identifiability_tables(columns, object_counts=counts)
        if files := companions(self.database):
            yield companion_table("Files of the database", files)
        yield from city.licenses
