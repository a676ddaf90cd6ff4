"""Fields that several commands share: the query, the noise and the prior knowledge."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from semsig_gis.commands.model import KNOW, OUTPUT, SAW, SEARCH, Option, Reporter
from semsig_gis.core import (
    DEFAULT_METHOD,
    PAPER_METHOD,
    CrsError,
    DatabaseError,
    EmptyResultError,
    InputError,
    percent,
)
from semsig_gis.localization import METRICS

if TYPE_CHECKING:
    import folium
    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.core import Signature, Taxonomy
    from semsig_gis.database import City, ObjectStore, PartitionedDatabase, SignatureDatabase
    from semsig_gis.evaluation import Identifiability
    from semsig_gis.localization import Drift, LikelihoodLocator, Noise
    from semsig_gis.observation import North, View

EXPLAINED = 3  # candidates
LEAST_SEEN = 0.5  # of what cells see, among the street objects of the database
MOST_TOP = 10_000
# The same limits as in `core` and the specs, which are slow to import.
MOST_SEED, MOST_METRES, MOST_WORKERS, MOST_QUERIES = 10**18, 1_000_000, 1024, 10_000_000


def noises() -> tuple[str, ...]:
    """Return the names of the noise models."""
    from semsig_gis.localization import NOISES

    return tuple(NOISES)


Database = Annotated[
    Path,
    Option(
        "Signature database written by `semsig build`.",
        title="Signature database",
        positional=True,
        reads=True,
    ),
]
Workers = Annotated[
    int,
    Option(
        "Number of processes on this machine.",
        title="Processes",
        low=0,
        high=MOST_WORKERS,
        advanced=True,
    ),
]
Scheduler = Annotated[
    str | None,
    Option("Address of a Dask scheduler.", metavar="tcp://HOST:PORT", advanced=True),
]
Seed = Annotated[int, Option("Seed of the random numbers.", low=0, high=MOST_SEED, advanced=True)]
MethodText = Annotated[
    str | None,
    Option(
        "Rank by likelihood, or by distance as TYPES+ANGLES "
        f"({', '.join(METRICS)}), types:edit or angles:edit; add :5% for two stages, "
        ":alpha=0.7, :raw or :weights=INSERT/DELETE/SUBSTITUTE.",
        title="Method",
        metavar="METHOD",
        default=DEFAULT_METHOD,
        advanced=True,
        panel=SEARCH,
    ),
]
Paper = Annotated[
    bool,
    Option(
        f"Rank as the paper does: --method {PAPER_METHOD}.",
        title="Method of the paper",
        advanced=True,
        panel=SEARCH,
    ),
]
Top = Annotated[
    int,
    Option(
        "Number of candidates.",
        title="Number of candidates",
        low=1,
        high=MOST_TOP,
        panel=OUTPUT,
    ),
]
Explain = Annotated[
    bool,
    Option(
        "Show which objects of the view match which street objects, which were missed and which "
        "look false.",
        title="Explain the best places",
        panel=OUTPUT,
    ),
]
Symbols = Annotated[
    bool,
    Option(
        "Print the letters of classes, such as DDBL for what a cell sees.",
        title="Letters of classes",
        advanced=True,
        panel=OUTPUT,
    ),
]
NorthText = Literal["grid", "true", "magnetic"]
NorthName = Annotated[
    NorthText,
    Option(
        "North from which bearings are measured; grid north is that of the database.",
        title="North of the bearings",
        advanced=True,
        panel=SAW,
    ),
]
Day = Annotated[
    str | None,
    Option(
        "Day of the view, for magnetic north.",
        title="Day of the view",
        metavar="YYYY-MM-DD",
        default="today",
        advanced=True,
        panel=SAW,
    ),
]
NoiseName = Annotated[
    str,
    Option(
        "Errors of the detector: light, medium, strong, generic (any of them), by-hand (a "
        "person, who leaves some out), photo, panorama, or a file written by `semsig learn`.",
        title="Errors of the detector",
        metavar="NAME|FILE",
        reads=True,
        suggestions=noises,
        panel=SEARCH,
    ),
]
MapAge = Annotated[
    float,
    Option(
        "Age of the map, from the survey of its objects to the query.",
        title="Age of the map",
        unit="years",
        low=0,
        high=100,
        advanced=True,
        panel=KNOW,
    ),
]
DriftReport = Annotated[
    Path | None,
    Option(
        "Rate at which the city changes, for --map-age: output of `semsig update --years N "
        "--json`, or a .toml file with the same keys.",
        title="Rate of change",
        default="that of Monaco in OpenStreetMap",
        reads=True,
        advanced=True,
        panel=KNOW,
    ),
]
Heading = Annotated[
    str,
    Option(
        "Whether north is known: known, unknown, or its standard deviation in degrees, 0.001 to "
        "360.",
        title="North is",
        metavar="known|unknown|DEGREES",
        advanced=True,
        panel=KNOW,
    ),
]
OnGrid = Annotated[
    bool,
    Option(
        "Assume that views are from the centre of a cell, as in the paper, instead of from "
        "anywhere in it.",
        title="From the centres of cells",
        advanced=True,
        panel=SEARCH,
    ),
]
Refine = Annotated[
    bool | None,
    Option(
        "Also search between the centres of cells.",
        title="Search between the centres of cells",
        default="where there are street objects and bearings",
        advanced=True,
        panel=SEARCH,
    ),
]
SurelyHere = Annotated[
    bool,
    Option(
        "Assume that views are from the area of the database. Otherwise the chance that they "
        "are from elsewhere is 50 % before their objects are compared.",
        title="Surely from this area",
        advanced=True,
        panel=KNOW,
    ),
]
Smooth = Annotated[
    float | None,
    Option(
        "Radius over which an evaluation is smoothed.",
        title="Radius of smoothing",
        unit="m",
        low=1,
        high=100_000,
        default="250, or more where queries are few",
        advanced=True,
    ),
]
Objects = Annotated[
    Path | None,
    Option(
        "Street objects: a file written by `semsig load`, or an object store.",
        title="Street objects",
        default="the store of the database",
        reads=True,
        advanced=True,
        panel=SEARCH,
    ),
]


def query_north(city: City, north: NorthText, date: str | None) -> North:
    """Return the north from which the bearings of a query are measured."""
    import datetime as dt

    from semsig_gis.observation import GRID_NORTH, North

    try:
        day = None if date is None else dt.date.fromisoformat(date)
    except ValueError as error:
        raise InputError(f"--date was given as {date!r}; give a day as 2024-05-31.") from error
    if day is not None and north != "magnetic":
        raise InputError(
            f"--date was given with --north {north}, but only magnetic north changes with "
            "time; leave it out."
        )
    if north == "grid":
        return GRID_NORTH
    dataset = city.dataset
    return North.of(north, dataset.crs, dataset.bounds, date=day)


@dataclass(frozen=True, kw_only=True)
class QueryOptions:
    """Options for the database and one query."""

    database: Database
    seen: Annotated[
        str | None,
        Option(
            "What was seen, such as 'bench at 40, two trees NE, no hydrant' or 'bench left, lamp "
            "behind near'; or letters of classes clockwise from north, such as DDBL.",
            title="What was seen",
            positional=True,
        ),
    ] = None
    types: Annotated[
        str | None,
        Option(
            "Symbols clockwise from north, such as DDBL; ? where one is unknown.",
            title="Types",
            metavar="LETTERS",
            panel=SAW,
        ),
    ] = None
    bearings: Annotated[
        str | None,
        Option(
            "Degrees clockwise from north, such as 10,80,200,310.",
            title="Bearings",
            metavar="DEGREES,...",
            panel=SAW,
        ),
    ] = None
    ranges: Annotated[
        str | None,
        Option(
            "Rough distances: metres, near, middle, far or ?, such as 12,?,near.",
            title="Rough distances",
            metavar="METRES,...",
            advanced=True,
            panel=SAW,
        ),
    ] = None
    fov: Annotated[
        float | None,
        Option(
            "Field of view of a photo, around --look.",
            title="Field of view",
            unit="°",
            low=0.001,
            high=360,
            advanced=True,
            panel=SAW,
        ),
    ] = None
    look: Annotated[
        float | None,
        Option(
            "Bearing of the middle of the photo.",
            title="Bearing of the photo",
            unit="°",
            low=-360,
            high=360,
            advanced=True,
            panel=SAW,
        ),
    ] = None
    sectors: Annotated[
        str | None,
        Option(
            "Sectors that were looked at, if not the full turn, such as 20-90,180-250.",
            title="Sectors",
            metavar="DEGREES-DEGREES,...",
            advanced=True,
            panel=SAW,
        ),
    ] = None
    north: NorthName = "grid"
    date: Day = None

    def query(self, dataset: SignatureDatabase | PartitionedDatabase, *, others: str = "") -> View:
        """Return the query of the options; `others` is for the message if there is none."""
        if not (self.seen or "").strip() and self.types is None and self.bearings is None:
            raise InputError(
                "nothing was asked; say what was seen, such as 'bench at 40, lamp at 80', or give "
                f"--types, --bearings or both{others}."
            )
        return self._seen(dataset)[0]

    def usual_noise(self, query: View, taxonomy: Taxonomy) -> str:
        """Return the default noise for a query, which may be in words."""
        from semsig_gis.localization import usual_noise
        from semsig_gis.observation import text_row

        text = self.seen if self.types is None else None
        return usual_noise(query, in_words=bool(text) and "see" in text_row(text or "", taxonomy))

    def unplaced(
        self, dataset: SignatureDatabase | PartitionedDatabase
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the class codes of objects seen without a direction, and of absent objects."""
        _, unplaced, absent = self._seen(dataset)
        return unplaced, absent

    def _seen(
        self, dataset: SignatureDatabase | PartitionedDatabase
    ) -> tuple[View, tuple[int, ...], tuple[int, ...]]:
        """Return the query, and the class codes of undirected and of absent objects."""
        from semsig_gis.observation import parse_seen, read_sentence, text_row

        taxonomy, radius = dataset.taxonomy, dataset.spec.radius
        row: dict[str, Any] = {
            "types": self.types,
            "bearings": None if self.bearings is None else numbers(self.bearings, "--bearings"),
            "ranges": self.ranges,
            "fov": self.fov,
            "heading": self.look,
            "sectors": self.sectors,
        }
        absent: tuple[int, ...] = ()
        if self.seen and self.types is not None:
            sentence = read_sentence(self.seen, taxonomy)
            if sentence.row["detections"]:
                raise InputError(
                    f"{self.seen!r} was given with --types; describe what was seen in one "
                    "of these ways."
                )
            absent = sentence.absent
        elif self.seen:
            row |= text_row(self.seen, taxonomy)
        view, unplaced, more = parse_seen(row, taxonomy=taxonomy, radius=radius)
        return view, unplaced, absent + more


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Options for the search: `require` for any method, the others for the likelihood."""

    require: Annotated[
        str | None,
        Option(
            "Search only cells that see this: M (one or more), 2B (two or more), B=0 (none), "
            "?<=10 (at most ten objects).",
            title="A cell must see",
            metavar="CONDITION",
            advanced=True,
            panel=KNOW,
        ),
    ] = None
    noise: Annotated[
        str | None,
        Option(
            "Errors of the detector or person: light, medium, strong, generic (any of "
            "them), by-hand, photo, panorama, or a file written by `semsig learn`.",
            title="Errors of the detector",
            metavar="NAME|FILE",
            default="by-hand for a view in words, photo for a view of sectors, panorama for a "
            "full turn with scores, otherwise generic",
            reads=True,
            suggestions=noises,
            panel=SEARCH,
        ),
    ] = None
    map_age: MapAge = 0.0
    drift_report: DriftReport = None
    heading: Heading = "known"
    on_grid: OnGrid = False
    near: Annotated[
        str | None,
        Option(
            "Last known place, in degrees or as X,Y,SIGMA in the CRS of the database, SIGMA in "
            "metres.",
            title="Last known place",
            metavar="LATITUDE,LONGITUDE,METRES",
            panel=KNOW,
        ),
    ] = None
    area: Annotated[
        Path | None,
        Option(
            "Search only in this box in degrees, or in the polygons of a file.",
            title="Area",
            metavar="WEST,SOUTH,EAST,NORTH|FILE",
            reads=True,
            panel=KNOW,
        ),
    ] = None
    popularity: Annotated[
        Path | None,
        Option(
            "Raster of how likely each place is beforehand, such as population.",
            title="Popularity of places",
            reads=True,
            advanced=True,
            panel=KNOW,
        ),
    ] = None
    rule: Annotated[
        Path | None,
        Option(
            "Rule for when to answer, written by `semsig calibrate`.",
            title="Rule for answers",
            default="from a chance of 0.9",
            reads=True,
            advanced=True,
            panel=SEARCH,
        ),
    ] = None
    surely_here: SurelyHere = False
    refine: Refine = None
    objects: Objects = None

    def locator(
        self,
        city: City,
        reporter: Reporter,
        north: North | None = None,
        *,
        usual_noise: str | Noise = "generic",
        top: int = 1,
        explain: bool = False,
    ) -> LikelihoodLocator:
        """Return the locator by likelihood for queries with bearings from `north`.

        The noise is `usual_noise` if it is a model or if --noise was not given.
        """
        from semsig_gis.localization import DEFAULT_RULE, LikelihoodMethod, make_locator, open_rule
        from semsig_gis.observation import GRID_NORTH

        if self.on_grid and self.refine:
            raise InputError(
                "--on-grid and --refine were given, which exclude each other; leave out one "
                "of them."
            )
        refined = False if self.on_grid else self.refine
        needs_objects = refined is not False or explain
        if self.objects is not None and not needs_objects:
            option = "--on-grid" if self.on_grid else "--no-refine"
            raise InputError(
                f"--objects and {option} were given, but street objects are not used then; "
                "leave out one."
            )
        sigma = north_sigma(self.heading)
        rule = DEFAULT_RULE if self.rule is None else open_rule(self.rule)
        noise = read_noise(
            (self.noise or usual_noise) if isinstance(usual_noise, str) else usual_noise,
            city.database,
            map_age=self.map_age,
            drift_report=self.drift_report,
        )
        method = LikelihoodMethod(
            noise=noise,
            refined=bool(refined),
            on_grid=self.on_grid,
            north_sigma=sigma,
            # A known place is in the area.
            surely_here=self.surely_here or self.near is not None or self.area is not None,
        )
        log_prior, knowledge = self._prior(city.database, reporter)
        needed = bool(self.refine)
        store, notes = None, tuple[str, ...]()
        if needs_objects:
            store, notes = find_store(city, self.objects, needed=needed)
            for note in notes:
                reporter.remark(note)
        return make_locator(
            city,
            method,
            log_prior=log_prior,
            rule=rule,
            top=top,
            store=store,
            refined=refined,
            explained=EXPLAINED if explain else 0,
            known=knowledge,
            north=north or GRID_NORTH,
            notes=notes,
        )

    def _prior(
        self, database: SignatureDatabase, reporter: Reporter
    ) -> tuple[NDArray[Any] | None, dict[str, Any]]:
        """Return the log prior of each cell, or None without a prior, and its plain values."""
        parts: list[NDArray[Any]] = []
        knowledge: dict[str, Any] = {}
        if self.near is not None:
            from semsig_gis.localization import KnownPosition, position_prior

            place = KnownPosition.parse(self.near, database)
            parts.append(position_prior(database, (place.x, place.y), sigma=place.sigma))
            knowledge["near"] = place.to_dict()
            if place.read_as == "LON,LAT":
                reporter.remark(
                    f"--near {self.near} is read as longitude,latitude, since only that is in the "
                    "city; latitude comes first"
                )
        if self.area is not None:
            from semsig_gis.localization import area_prior
            from semsig_gis.objects import read_area

            area = read_area(self.area, crs=database.crs, near=database.bounds.tolist())
            parts.append(area_prior(database, area))
            inside = int((parts[-1] > -math.inf).sum())
            knowledge["area"] = {"file": str(self.area), "cells": inside}
        if self.popularity is not None:
            from semsig_gis.localization import raster_prior

            parts.append(raster_prior(database, self.popularity))
            knowledge["popularity"] = {"file": str(self.popularity)}
        if self.require is not None:
            from semsig_gis.localization import Requirement, weight_prior

            requirement = Requirement.parse(self.require, database.taxonomy)
            allowed = requirement.met(database.type_sequences)
            parts.append(weight_prior(database, allowed.astype(float)))
            knowledge["require"] = {"text": self.require, "cells": int(allowed.sum())}
        return (sum(parts[1:], parts[0]) if parts else None), knowledge


def read_noise(
    noise: str | Noise,
    database: SignatureDatabase,
    *,
    map_age: float = 0.0,
    drift_report: Path | None = None,
) -> Noise:
    """Return a noise model, or that of a name or file, for a map of some age."""
    from semsig_gis.localization import NOISES, named_noise, open_noise

    if not isinstance(noise, str):
        model = noise
    elif noise not in NOISES and Path(noise).suffix:
        model = open_noise(noise)
    else:
        model = named_noise(noise)
    if map_age == 0 and drift_report is None:
        return model
    from semsig_gis.localization import aged_noise  # slow to import

    return aged_noise(model, map_age, database=database, drift=read_drift(drift_report, map_age))


def adapted_noise(
    city: City,
    views: Sequence[Signature],
    noise: str | Noise,
    *,
    objects: Path | None,
    heading: str,
    reporter: Reporter,
) -> Noise:
    """Return a noise model adapted to views from grid north; remark what the views show."""
    from semsig_gis.localization import adapt_noise

    store = object_store(city, objects, reporter, needed=True)
    if store is None:  # not with `needed`
        raise InputError("the noise cannot be adapted without street objects; give --objects.")
    adaptation = adapt_noise(
        views,
        city.database,
        read_noise(noise, city.database),
        store=store,
        north_sigma=north_sigma(heading),
    )
    reporter.remark(adaptation.sentence)
    return adaptation.noise


def read_drift(drift_report: Path | None, map_age: float) -> Drift | None:
    """Return the rates of change of --drift-report, None without it; it needs --map-age."""
    if drift_report is None:
        return None
    if map_age == 0:
        raise InputError(
            "--drift-report was given without --map-age; give the age of the map in years as well."
        )
    from semsig_gis.localization import open_drift

    return open_drift(drift_report)


def object_store(
    city: City, objects: Path | None, reporter: Reporter, *, needed: bool
) -> ObjectStore | None:
    """Return the street objects of a database; None with a remark if missing and not needed."""
    store, notes = find_store(city, objects, needed=needed)
    for note in notes:
        reporter.remark(note)
    return store


def find_store(
    city: City, objects: Path | None, *, needed: bool
) -> tuple[ObjectStore | None, tuple[str, ...]]:
    """Return the street objects of a database, None if missing and not needed, and notes on them.

    DatabaseError if they are needed.
    """
    from semsig_gis.database import ObjectStore, open_store, share_seen

    if objects is not None and not objects.is_dir():
        from semsig_gis.objects import open_objects

        store = ObjectStore.of(open_objects(objects))
        if store.objects.crs != city.database.crs:
            raise CrsError(
                f"{objects} is in {store.objects.crs.to_string()} and the database in "
                f"{city.database.crs.to_string()}; give the objects that it was built from."
            )
        share = share_seen(city.database, store.objects)
        if share >= LEAST_SEEN:
            return store, ()
        other = f"only {percent(share, 0)} of what cells of {city.path} see is in {objects}"
        return store, (f"{other}, so it has other street objects than those of the database.",)
    try:
        return (city.store if objects is None else open_store(city.path, objects)), ()
    except DatabaseError as error:
        if needed or objects is not None:
            raise
        return None, (f"no street objects found; answering at cell precision: {error}",)


def north_sigma(heading: str) -> float:
    """Return the standard deviation of north in degrees from --heading."""
    if heading in {"known", "unknown"}:
        return 0.0 if heading == "known" else math.inf
    try:
        sigma = float(heading)
    except ValueError:
        sigma = -1.0
    if sigma and not 0.001 <= sigma <= 360:  # noqa: PLR2004 - as `check_north` has it
        raise InputError(
            f"--heading was given as {heading!r}; give known, unknown, or 0.001 to 360 degrees."
        )
    return sigma


def chosen_method(method: str | None, *, paper: bool) -> str:
    """Return the name of the method from --method and --paper."""
    if method is not None and paper:
        raise InputError(f"--paper was given with --method {method}; give one of them.")
    return PAPER_METHOD if paper else method or DEFAULT_METHOD


def city_name(database: Path) -> str:
    """Return the name of a city for headings, from the name of its file."""
    return database.stem.replace("_", " ").capitalize()


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of an option that are separated by commas."""
    try:
        return [float(part) for part in text.split(",")] if text.strip() else []
    except ValueError as error:
        raise InputError(
            f"{option} was given as {text!r}; give numbers with commas between them."
        ) from error


def known_identifiability(city: City, reporter: Reporter) -> Identifiability | None:
    """Return the columns of `semsig identify`; None if missing, with a remark if outdated."""
    database = city.database  # raises DatabaseError if the file is none
    try:
        if not city.has_columns:
            return None
        from semsig_gis.evaluation import open_identifiability

        return open_identifiability(database, city.path)
    except DatabaseError as error:
        reporter.remark(str(error))
        return None


def ground_of(city: City) -> dict[str, gpd.GeoDataFrame]:
    """Return the buildings and the streets in the object store of a city, where it has them."""
    try:
        return city.store.ground
    except DatabaseError:  # a map does not need them
        return {}


def draw_ground(
    map_: folium.Map, city: City, *, buildings: Path | None = None, streets: Path | None = None
) -> None:
    """Add streets and buildings to a map, from files or else from the object store."""
    from semsig_gis.database import ground_box
    from semsig_gis.objects import read_surroundings
    from semsig_gis.output import ground_map

    crs = city.database.crs
    houses = None if buildings is None else read_surroundings(buildings, role="buildings", crs=crs)
    lines = None if streets is None else read_surroundings(streets, role="streets", crs=crs)
    if houses is None or lines is None:
        stored = ground_of(city)
        houses = stored.get("buildings") if houses is None else houses
        lines = stored.get("streets") if lines is None else lines
    if houses is None and lines is None:
        return
    box = ground_box(city.database.xy)
    try:
        ground_map(buildings=houses, streets=lines, box=box, map_=map_)
    except EmptyResultError:
        if buildings is not None or streets is not None:
            raise


def online_notes(offline: bool, *, tiles: str | None = None) -> list[str]:  # noqa: FBT001
    """Return notes on a map that needs a network, or a web server for its tiles."""
    from semsig_gis.output import needs_server

    what = "Leaflet" if tiles is None else "its tiles"
    note = f"the map takes {what} from the web, so it needs a network to be displayed"
    notes = [] if offline else [note]
    if tiles is not None and needs_server(tiles):
        notes.append(
            f"the provider of {tiles} refuses its tiles to pages that are opened from disk; put "
            "the map on a web server, or give another provider, such as --tiles CyclOSM"
        )
    return notes
