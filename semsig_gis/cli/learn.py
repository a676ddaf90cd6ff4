"""`semsig learn` and `semsig calibrate`: noise models and answer rules from known places."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli.console import (
    AsJson,
    Database,
    app,
    keep_inputs,
    print_json,
    print_rows,
    progress,
    remark,
    say,
)
from semsig_gis.cli.options import (
    Day,
    DriftReport,
    Heading,
    MapAge,
    NoiseName,
    NorthName,
    Objects,
    OnGrid,
    Refine,
    SearchOptions,
    adapted_noise,
    north_sigma,
    object_store,
    query_north,
    read_drift,
)
from semsig_gis.core import InputError, percent

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database import City, SignatureDatabase
    from semsig_gis.localization import NoiseEstimate, Sample

SAMPLES = typer.Option(
    help="Detections of known places: a CSV or JSON lines file of views with x and y (metres) or "
    "cell_id (its centre)."
)


@app.command()
def learn(
    database: Database,
    *,
    samples: Annotated[Path | None, SAMPLES] = None,
    unlabelled: Annotated[
        Path | None,
        typer.Option(
            help="Views of one camera and detector at unknown places, instead of --samples: a CSV "
            "or JSON lines file, as of semsig localize --queries."
        ),
    ] = None,
    noise: Annotated[
        str, typer.Option(help="First noise model for --unlabelled, a name or a file.")
    ] = "photo",
    out: Annotated[Path, typer.Option(help="Noise model to write (.toml or .json), for --noise.")],
    map_age: MapAge = 0.0,
    drift_report: DriftReport = None,
    heading: Heading = "known",
    north: NorthName = "grid",
    date: Day = None,
    objects: Objects = None,
    as_json: AsJson = False,
) -> None:
    """Learn the errors of a detector from detections of known places, or only from its views.

    Missed and false objects that the age of the map explains do not count.
    """
    from dataclasses import replace

    from semsig_gis.database import open_city
    from semsig_gis.localization import ALL, check_map_age, fresh_noise, read_samples, save_noise

    keep_inputs(out, read=(database, samples, unlabelled, objects, drift_report))
    check_map_age(map_age)
    if (samples is None) == (unlabelled is None):
        raise InputError(
            "the noise is learnt either from --samples, views of known places, or from "
            "--unlabelled, views of unknown places; give one of the two."
        )
    change = read_drift(drift_report, map_age)
    city = open_city(database)
    if samples is None:
        _learn_unlabelled(city, unlabelled, noise, out, objects, heading, north, date, as_json)
        return
    bearing_north, sigma = query_north(city, north, date), north_sigma(heading)
    rows = [
        replace(sample, signature=bearing_north.to_grid(sample.signature))
        for sample in read_samples(
            samples, taxonomy=city.database.taxonomy, radius=city.database.spec.radius
        )
    ]
    with progress("learning"):
        estimate = estimate_noise(city, rows, objects, sigma)
    # The uncertainty of the sample places is not an error of the detector.
    learnt = replace(estimate.spec, position_sigma=0.0, name=out.stem)
    fresh = fresh_noise(learnt, map_age, database=city.database, drift=change)
    estimate = replace(estimate, spec=fresh)
    save_noise(estimate.noise, out)
    if as_json:
        print_json(estimate.to_dict())
        return
    skipped = estimate.skipped
    skipped_text = f"; {skipped} samples are at places that see nothing" if skipped else ""
    print_rows(
        f"Learnt from {estimate.detections:,} detections at {estimate.samples:,} places that see "
        f"{estimate.objects:,} objects{skipped_text}",
        ("quantity", "class", "value", "own samples only", "95% interval", "samples"),
        [
            _rate(row)
            for row in estimate.rates.to_dict("records")
            # Fading by class is only in the file.
            if row["quantity"] != "fading" or row["class"] == ALL
        ],
    )
    if map_age:
        say(
            f"Corrected for what a map of {map_age:g} years explains: detection "
            f"{fresh.detection:.3f} "
            f"(was {learnt.detection:.3f}), {fresh.clutter:.3f} false objects per full turn (was "
            f"{learnt.clutter:.3f})."
        )
    for note in bearing_north.notes:
        remark(note)
    say(_verdict(estimate))
    say(f"noise model: {out}")


def _learn_unlabelled(  # noqa: PLR0917 - the options of the command
    city: City,
    unlabelled: Path | None,
    noise: str,
    out: Path,
    objects: Path | None,
    heading: str,
    north: NorthName,
    date: Day,
    as_json: bool,  # noqa: FBT001 - as above
) -> None:
    """Write a noise model that is learnt from views of unknown places."""
    from dataclasses import replace

    from semsig_gis.localization import save_noise
    from semsig_gis.observation import read_queries

    database, bearing_north = city.database, query_north(city, north, date)
    views = []
    for line in read_queries(
        str(unlabelled), taxonomy=database.taxonomy, radius=database.spec.radius
    ):
        if isinstance(line.query, InputError):
            raise line.query
        views.append(bearing_north.to_grid(line.query))
    with progress("learning"):
        model = replace(adapted_noise(city, views, noise, objects, heading), name=out.stem)
    save_noise(model, out)
    if as_json:
        print_json(model.to_dict())
    else:
        say(f"noise model: {out}")


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
            f"given the values of all classes: {', '.join(few)}"
        )
    return f"{text}."


def estimate_noise(
    city: City, samples: Sequence[Sample], objects: Path | None, sigma: float = 0.0
) -> NoiseEstimate:
    """Estimate the noise from street objects if there are some, else from the cells."""
    import numpy as np

    from semsig_gis.localization import Sample, learn_noise

    database = city.database
    places = _places(database, samples)
    store = object_store(city, objects, needed=False)
    if store is None:
        # Each sample is compared with the centre of its cell, so this offset is an error as well.
        offsets = places - database.grid.viewpoints(*database.grid.cells_at(places))
        metres = math.sqrt(float(np.mean(offsets**2)))
        return learn_noise(samples, database, position_sigma=metres, north_sigma=sigma)
    placed = [
        Sample(signature=sample.signature, xy=(x, y))
        for sample, (x, y) in zip(samples, places.tolist(), strict=True)
    ]
    footprints = store.buildings_around(places, distance=database.reach)
    radius = database.spec.radius
    return learn_noise(
        placed, store.objects, radius=radius, north_sigma=sigma, footprints=footprints
    )


def _places(database: SignatureDatabase, samples: Sequence[Sample]) -> NDArray[Any]:
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


@app.command()
def calibrate(
    database: Database,
    *,
    samples: Annotated[Path, SAMPLES],
    out: Annotated[Path, typer.Option(help="Rule to write (.json), for --rule.")],
    precision: Annotated[
        float,
        typer.Option(min=0.01, max=0.9999, help="Share of the answers that should be right."),
    ] = 0.98,
    noise: NoiseName = "generic",
    map_age: MapAge = 0.0,
    drift_report: DriftReport = None,
    heading: Heading = "known",
    on_grid: OnGrid = False,
    refine: Refine = None,
    objects: Objects = None,
    as_json: AsJson = False,
) -> None:
    """Choose from which chance on a place is given as an answer."""
    from dataclasses import asdict

    import numpy as np

    from semsig_gis.database import open_city
    from semsig_gis.localization import calibrate, read_samples, save_rule

    keep_inputs(out, read=(database, samples, noise, drift_report, objects))
    city = open_city(database)
    rows = read_samples(samples, taxonomy=city.database.taxonomy, radius=city.database.spec.radius)
    options = SearchOptions(
        noise=noise,
        map_age=map_age,
        drift_report=drift_report,
        heading=heading,
        on_grid=on_grid,
        refine=refine,
        objects=objects,
    )
    locator = options.locator(city)
    radius = locator.rule.radius
    masses, errors = np.zeros(len(rows)), np.full(len(rows), np.inf)
    places = _places(city.database, rows)
    with progress("answering") as advance:
        for number, sample in enumerate(rows):
            if len(sample.signature):  # a view of nothing has no answer
                location = locator.locate(sample.signature)
                masses[number] = location.answer.mass
                position = location.estimate.x, location.estimate.y
                errors[number] = math.dist(position, places[number])
            advance(number + 1, len(rows))
    rule = calibrate(masses, errors <= radius, precision=precision, radius=radius)
    save_rule(rule, out)
    if as_json:
        threshold = rule.threshold if math.isfinite(rule.threshold) else None
        print_json({**asdict(rule), "threshold": threshold, "coverage": rule.coverage})
        return
    if rule.answered:
        say(
            f"Answers from a chance of {rule.threshold:.4f} that the place is within {radius:g} m: "
            f"{rule.answered:,} of {rule.queries:,} samples ({percent(rule.coverage, 1)}) are "
            f"answered, {rule.wrong:,} of them wrongly; {percent(precision, 0)} are right with a "
            f"confidence of {percent(rule.confidence, 0)}."
        )
    else:
        say(
            f"These {rule.queries:,} samples do not prove for any chance that "
            f"{percent(precision, 0)} of the answers are right, so nothing is answered; give more "
            "samples, or a lower --precision."
        )
    say(f"rule: {out}")
