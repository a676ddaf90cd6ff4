"""`semsig learn`: a noise model from detections of known places, or from unlabelled views."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import (
    Database,
    Day,
    DriftReport,
    Heading,
    MapAge,
    NorthName,
    Objects,
    adapted_noise,
    noises,
    north_sigma,
    object_store,
    query_north,
    read_drift,
)
from semsig_gis.core import InputError, Table

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import City, SignatureDatabase
    from semsig_gis.localization import NoiseEstimate, NoiseSpec, Sample
    from semsig_gis.observation import North

SAMPLES = Option(
    "Detections of known places: a CSV or JSON lines file of views with x and y (metres) or "
    "cell_id (its centre).",
    title="Detections of known places",
    reads=True,
)


@command(
    "learn",
    title="Learn detector errors",
    group="Measure",
    order=4,
    returns="semsig_gis.localization:LearnRecord",
    examples=(
        "semsig learn city.parquet --samples known.csv --out camera.toml",
        "semsig learn city.parquet --unlabelled views.jsonl --out camera.toml",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Learn:
    """Learn the errors of a detector from detections of known places, or only from its views.

    Missed and false objects that the age of the map explains do not count.
    """

    database: Database
    samples: Annotated[Path | None, SAMPLES] = None
    unlabelled: Annotated[
        Path | None,
        Option(
            "Views of one camera and detector at unknown places, instead of --samples: a CSV "
            "or JSON lines file, as of semsig localize --queries.",
            title="Views of unknown places",
            reads=True,
        ),
    ] = None
    noise: Annotated[
        str,
        Option(
            "First noise model for --unlabelled, a name or a file.",
            title="First noise model",
            metavar="NAME|FILE",
            reads=True,
            suggestions=noises,
            advanced=True,
        ),
    ] = "photo"
    out: Annotated[
        Path,
        Option(
            "Noise model to write (.toml or .json), for --noise.",
            title="Noise model",
            writes=(".toml", ".json", ""),
        ),
    ]
    map_age: MapAge = 0.0
    drift_report: DriftReport = None
    heading: Heading = "known"
    north: NorthName = "grid"
    date: Day = None
    objects: Objects = None

    def run(self, reporter: Reporter) -> Result:
        """Write the noise model; return it, with its intervals if places are known."""
        from semsig_gis.database import open_city
        from semsig_gis.localization import check_map_age

        check_map_age(self.map_age)
        if self.samples is not None and self.unlabelled is None:
            return self._from_samples(open_city(self.database), self.samples, reporter)
        if self.samples is not None or self.unlabelled is None:
            raise InputError(
                "the noise is learnt either from --samples, views of known places, or from "
                "--unlabelled, views of unknown places; give one of the two."
            )
        if self.map_age or self.drift_report is not None:
            option = "--map-age" if self.map_age else "--drift-report"
            raise InputError(
                f"{option} was given with --unlabelled, from which no map can be corrected; leave "
                "it out, or give --samples."
            )
        return self._from_views(open_city(self.database), self.unlabelled, reporter)

    def _from_samples(self, city: City, samples: Path, reporter: Reporter) -> Result:
        from semsig_gis.localization import fresh_noise, save_noise

        drift = read_drift(self.drift_report, self.map_age)
        north = query_north(city, self.north, self.date)
        estimate = learnt_noise(
            city,
            read_grid_samples(samples, city, north),
            reporter,
            name=self.out.stem,
            objects=self.objects,
            sigma=north_sigma(self.heading),
        )
        learnt = estimate.spec
        fresh = fresh_noise(learnt, self.map_age, database=city.database, drift=drift)
        estimate = replace(estimate, spec=fresh)
        save_noise(estimate.noise, self.out)

        def summary() -> Iterator[str]:
            skipped = estimate.skipped
            nothing = f"; {skipped:,} samples are at places that see nothing" if skipped else ""
            yield (
                f"Learnt from {estimate.detections:,} detections at {estimate.samples:,} places "
                f"that see {estimate.objects:,} objects{nothing}."
            )
            if self.map_age:
                yield self._correction(learnt, fresh)
            yield _verdict(estimate)

        return Result(
            values=estimate.to_dict,
            summary=summary(),
            tables=[_rate_table(estimate)],
            files={"noise model": self.out},
            notes=north.notes,
        )

    def _from_views(self, city: City, views: Path, reporter: Reporter) -> Result:
        """Write a noise model that is learnt from views of unknown places."""
        from semsig_gis.localization import save_noise
        from semsig_gis.observation import read_queries

        database, north = city.database, query_north(city, self.north, self.date)
        signatures = []
        for line in read_queries(views, taxonomy=database.taxonomy, radius=database.spec.radius):
            if isinstance(line.query, InputError):
                raise line.query
            signatures.append(north.to_grid(line.query))
        with reporter.progress("learning"):
            noise = adapted_noise(
                city,
                signatures,
                self.noise,
                objects=self.objects,
                heading=self.heading,
                reporter=reporter,
            )
        noise = replace(noise, name=self.out.stem)
        save_noise(noise, self.out)
        return Result(
            values=noise.to_dict,
            summary=[f"Learnt from {len(signatures):,} views of unknown places."],
            files={"noise model": self.out},
        )

    def _correction(self, learnt: NoiseSpec, fresh: NoiseSpec) -> str:
        """Return a sentence on what the age of the map explains."""
        return (
            f"Corrected for what a map of {self.map_age:g} years explains: detection "
            f"{fresh.detection:.3f} (was {learnt.detection:.3f}), {fresh.clutter:.3f} false "
            f"objects per full turn (was {learnt.clutter:.3f})."
        )


def read_grid_samples(path: Path, city: City, north: North) -> list[Sample]:
    """Return the samples of a file with bearings from grid north."""
    from semsig_gis.localization import read_samples

    database = city.database
    samples = read_samples(path, taxonomy=database.taxonomy, radius=database.spec.radius)
    return [replace(sample, signature=north.to_grid(sample.signature)) for sample in samples]


def learnt_noise(
    city: City,
    samples: Sequence[Sample],
    reporter: Reporter,
    *,
    name: str,
    objects: Path | None = None,
    sigma: float = 0.0,
) -> NoiseEstimate:
    """Learn the noise from samples, with street objects if there are some, else with the cells."""
    import numpy as np

    from semsig_gis.localization import Sample, learn_noise

    database = city.database
    places = sample_places(database, samples)
    with reporter.progress("learning"):
        store = object_store(city, objects, reporter, needed=False)
        if store is None:
            # Each sample is compared with the centre of its cell, which adds an error as well.
            offsets = places - database.grid.viewpoints(*database.grid.cells_at(places))
            metres = math.sqrt(float(np.mean(offsets**2)))
            estimate = learn_noise(samples, database, position_sigma=metres, north_sigma=sigma)
        else:
            placed = [
                Sample(signature=sample.signature, xy=(x, y))
                for sample, (x, y) in zip(samples, places.tolist(), strict=True)
            ]
            estimate = learn_noise(
                placed,
                store.objects,
                radius=database.spec.radius,
                north_sigma=sigma,
                footprints=store.buildings_around(
                    places, distance=database.near_reach, occlusion=database.occlusion
                ),
            )
    # The uncertainty of the sample places is not an error of the detector.
    return replace(estimate, spec=replace(estimate.spec, position_sigma=0.0, name=name))


def sample_places(database: SignatureDatabase, samples: Sequence[Sample]) -> NDArray[Any]:
    """Return the true places in metres, shape (samples, 2)."""
    import numpy as np

    from semsig_gis.core import split_ids

    places = [
        sample.xy
        if sample.cell_id is None
        else database.grid.viewpoints(*split_ids([sample.cell_id]))[0]
        for sample in samples
    ]
    return np.array(places)


def _rate_table(estimate: NoiseEstimate) -> Table:
    from semsig_gis.localization import ALL

    return Table.of(
        "Errors of the detector",
        ("quantity", "class", "value", "own samples only", "95% interval", "samples"),
        [
            _rate(row)
            for row in estimate.rates.to_dict("records")
            # Fading by class is only in the file.
            if row["quantity"] != "fading" or row["class"] == ALL
        ],
    )


def _rate(row: dict[Hashable, Any]) -> list[str]:
    """Return a rate as a row of a table; own values are empty without samples."""
    samples = f"{row['samples']:.0f}"
    high = min(row["high_95"], 180.0)  # no error of a bearing is larger
    own = (
        [f"{row['own']:.3f}", f"{row['low_95']:.3f} to {high:.3f}"] if samples != "0" else ["", ""]
    )
    quantity, metres = row["quantity"], row["distance"]
    if quantity in {"detection", "fading"} and not math.isnan(metres):
        quantity = f"detection at {metres:g} m"
    return [quantity, row["class"], f"{row['value']:.3f}", *own, samples]


def _verdict(estimate: NoiseEstimate) -> str:
    """Return one sentence on whether the samples suffice."""
    verdicts = estimate.verdicts
    missing = [quantity for quantity, verdict in verdicts.items() if not verdict["enough"]]
    few = dict.fromkeys(name for verdict in verdicts.values() for name in verdict["few"])
    text = (
        f"Give more samples for {', '.join(missing)} (the 90% interval of all classes together is "
        "wider than a factor of 1.5)"
        if missing
        else "The samples suffice for all classes together"
    )
    if few:
        text += (
            f"; these classes have fewer than 8 samples for some quantity, where they are mostly "
            f"given the values of all classes: {', '.join(few).replace('_', ' ')}"
        )
    return f"{text}."
