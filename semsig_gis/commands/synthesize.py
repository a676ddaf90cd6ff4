"""`semsig synthesize`: a made-up city."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from typing_extensions import TypedDict

from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import Seed


class Synthesized(TypedDict):
    """The files of a made-up city, and the number of its street objects."""

    objects: int
    files: list[str]


@command(
    "synthesize",
    title="Make up a city",
    group="Prepare",
    order=11,
    returns=Synthesized,
    examples=(
        "semsig synthesize --out town --size 1000",
        "semsig synthesize --out paris",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Synthesize:
    """Make up a city: street objects, buildings and streets."""

    out: Annotated[Path, Option("Folder to write to.", title="Folder", metavar="FOLDER", writes="")]
    size: Annotated[
        float | None,
        Option(
            "Side of the square city.",
            title="Side of the city",
            unit="m",
            low=100,
            high=20_000,
            default="as many cells as Paris",
        ),
    ] = None
    seed: Seed = 0

    def run(self, reporter: Reporter) -> Result:
        """Write the city; return its files."""
        from semsig_gis.objects import build_objects, save_with_ground
        from semsig_gis.sources import (
            PARIS_LIKE,
            CitySpec,
            paper_taxonomy,
            synthetic_city,
            synthetic_surroundings,
        )

        spec = CitySpec(size=PARIS_LIKE.size if self.size is None else self.size, seed=self.seed)
        with reporter.progress("making up a city") as advance:
            advance(0, 2)
            layers = synthetic_city(spec)
            advance(1, 2)
            surroundings = synthetic_surroundings(spec)
        objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
        path = self.out / "objects.parquet"
        ground = save_with_ground(
            objects,
            path,
            **{layer.spec.role: layer.table for layer in surroundings},
            remark=reporter.remark,
        )
        files = {"street objects": path} | ground
        return Result(
            values=lambda: {"objects": len(objects), "files": [*map(str, files.values())]},
            summary=[f"A made-up city with {len(objects):,} street objects."],
            files=files,
        )
