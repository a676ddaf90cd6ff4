"""Measure methods on real photographs with known places."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NotRequired

import numpy as np
import pandas as pd
from typing_extensions import TypedDict

from semsig_gis.core import GridSpec, InputError, SignatureSpec, angular_distance, to_degrees
from semsig_gis.database import ObjectStore, build_database, open_city, save_with_store
from semsig_gis.evaluation.figures import CalibrationRecord, calibration_bins, range_labels
from semsig_gis.localization import DEFAULT_RULE, LikelihoodLocator, Location, UsualLocator, explain
from semsig_gis.objects import assemble, choose_layers, read_files
from semsig_gis.observation import RADIUS_M, parse_view
from semsig_gis.sources import load_catalog
from semsig_gis.storage import read_rows, row_value

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from semsig_gis.core import Taxonomy
    from semsig_gis.database import City
    from semsig_gis.localization import Answer, Locator
    from semsig_gis.observation import View
    from semsig_gis.storage import Row

DETECTIONS = ("3-5", "6-8", "9+")
"""Groups of views by their number of detections."""
ALL = "all"
SCENE = ("verdict", "query_class", "query_bearing", "object_class", "object_bearing", "distance")
WITHIN_M = (5, 10, 25, 50)
FAILURES = 6
TURN = 137.5  # degrees; each view without a compass is turned by another multiple of it


class MethodRecord(TypedDict):
    """A row of `photograph_table` as plain values."""

    method: str
    set: str
    detections: str
    n: int
    p5: float
    p10: float
    p25: float
    p50: float
    heading_error: float | None
    answered: float | None
    right: float | None
    brier: float | None
    calibration_error: float | None
    seconds: float


class BinRecord(CalibrationRecord):
    """A row of `photograph_calibration` as plain values."""

    method: str
    set: str


class FailuresRecord(TypedDict):
    """The worst failures of a method (see `photograph_failures`)."""

    method: str
    views: list[dict[str, Any]]


class PhotographRecord(TypedDict):
    """The result of methods on a data set of photographs, as plain values."""

    data: str
    radius: float
    cells: int
    limit: int | None
    classes: list[dict[str, Any]]
    table: list[MethodRecord]
    calibration: list[BinRecord]
    failures: NotRequired[FailuresRecord]


@dataclass(frozen=True, kw_only=True)
class PhotographData:
    """The files of a data set in its folder.

    `views` has the file of each set of views with known places, `learning` that of the views of
    other places, from which the errors of the detector are learnt.
    """

    catalog: str
    objects: str
    views: Mapping[str, str]
    learning: str | None = None


PHOTOGRAPHS: Mapping[str, PhotographData] = {
    "flatlandia": PhotographData(
        catalog="flatlandia.toml",
        objects="objects.csv",
        views={
            "single": "test_thin.jsonl",
            "places": "test_places.jsonl",
            "no compass": "test_no_compass.jsonl",
        },
        learning="learn.jsonl",
    ),
    "london-lights": PhotographData(
        catalog="london.toml",
        objects="objects.geojson",
        views={"panoramas": "learn_ranges_grid.jsonl"},
    ),
}
"""The data sets by name."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Photograph:
    """A view with its true place `xy`, in metres in the CRS of the city.

    The bearings of a view without a compass are turned by `turn` degrees from grid north.
    """

    name: str
    view: View
    xy: tuple[float, float]
    turn: float = 0.0

    @property
    def north_known(self) -> bool:
        """Whether the north of all its photos is known."""
        return not any(math.isinf(photo.north_sigma or 0.0) for photo in self.view.photos)


def build_photographed_city(
    data: PhotographData, folder: Path, out: Path, *, radius: float = 60.0
) -> City:
    """Build the database of the objects in `folder`, as they are, and write it to `out`.

    The cells are 10 m wide, and `radius` is the visibility range in metres. Objects are neither
    collapsed nor merged. Raises InputError if a file is missing, and SourceError if it is not as
    its catalogue says.
    """
    for name in (data.catalog, data.objects, *data.views.values()):
        if not (folder / name).is_file():
            raise InputError(
                f"{folder} has no file {name}; give the folder with the files of the data set."
            )
    catalog = load_catalog(folder / data.catalog)
    layers, _ = read_files(choose_layers(catalog), [folder / data.objects])
    objects = assemble(layers, catalog, collapse=False, merge=False).objects
    database = build_database(objects, grid=GridSpec(10.0), spec=SignatureSpec(radius, 16))
    save_with_store(database, ObjectStore.of(objects), out)
    return open_city(out)


def read_photographs(
    path: Path, *, taxonomy: Taxonomy, radius: float = RADIUS_M, limit: int | None = None
) -> list[Photograph]:
    r"""Read views with known places.

    Parameters
    ----------
    path : Path
        A CSV file or JSON lines, with ``x`` and ``y`` in metres, and perhaps ``id``; the other
        columns are those of `parse_view`.
    taxonomy : Taxonomy
        Classes of the objects.
    radius : float, default 30
        Visibility range of the city in metres; near, middle and far are thirds of it.
    limit : int, optional
        Use at most this many views, evenly spread over the file.

    Returns
    -------
    list of Photograph
        One for each row with an object. Where the heading is unknown, the bearings are turned by
        an angle that differs from row to row, so that they do not contain the true north.

    Raises
    ------
    InputError
        If the file cannot be read, has no rows, or a row cannot be used; with its number.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from semsig_gis import paper_taxonomy
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "seen.csv")
    ...     _ = path.write_text("id,x,y,types,bearings\na,500000,5400000,DB,200 350\n")
    ...     photograph = read_photographs(path, taxonomy=paper_taxonomy())[0]
    >>> photograph.name, photograph.xy, photograph.view.bearings.tolist()
    ('a', (500000.0, 5400000.0), [200.0, 350.0])
    """

    def read(row: Row) -> tuple[object, View, tuple[float, float]]:
        x, y = row_value(row, "x"), row_value(row, "y")
        if x is None or y is None:
            raise InputError("it has no true place; give x and y in metres")
        view = parse_view(row, taxonomy=taxonomy, radius=radius)
        return row_value(row, "id"), view, (float(x), float(y))

    photographs = []
    for line, (name, view, xy) in read_rows(path, read, what="view"):
        item = Photograph(name=str(line if name is None else name), view=view, xy=xy)
        if not item.north_known:
            turn = line * TURN % 360.0
            item = Photograph(name=item.name, view=view.turned(turn), xy=xy, turn=turn)
        if len(view):
            photographs.append(item)
    if limit is None or limit >= len(photographs):
        return photographs
    return [photographs[int(row)] for row in np.linspace(0, len(photographs) - 1, limit)]


def score_photographs(
    locators: Mapping[str, Locator[Any]],
    sets: Mapping[str, Sequence[Photograph]],
    *,
    progress: Callable[[int, int], None] | None = None,
) -> pd.DataFrame:
    """Locate photographs with several methods and score the answers.

    Parameters
    ----------
    locators : mapping of str to Locator
        The methods by name (see `make_locator`), for the same city.
    sets : mapping of str to sequence of Photograph
        The views by name of the set.
    progress : callable, optional
        Called with the number of finished views and their total.

    Returns
    -------
    DataFrame
        One row for each method and view: ``method``, ``set``, ``view`` (name), ``detections``,
        ``x`` and ``y`` of the answer, ``error_m``, ``p5`` to ``p50`` (whether the error is at most
        5 m, ...; a share where several cells are equally good), ``heading_error`` (degrees, where
        the heading was estimated), ``chance`` (stated, that the place is within 50 m; NaN without
        probabilities), ``right`` (as ``p50``) and ``seconds``. A distance is not asked for views
        without a compass, since it needs one.

    Examples
    --------
    >>> from semsig_gis import Method, View
    >>> from semsig_gis.localization import make_locator
    >>> x, y = demo_database.xy[0].tolist()
    >>> seen = Photograph(name="a", view=View.of(demo_database.signature(0)), xy=(x, y))
    >>> locator = make_locator(demo_database, Method.parse("edit+edit"))
    >>> score_photographs({"paper": locator}, {"single": [seen]})[["view", "p50"]].values.tolist()
    [['a', 1.0]]
    """
    tasks = [
        (method, name, photograph)
        for method in locators
        for name, photographs in sets.items()
        for photograph in photographs
    ]
    rows, warm = [], set()
    for count, (method, name, photograph) in enumerate(tasks, start=1):
        locator = locators[method]
        if photograph.north_known or isinstance(locator, LikelihoodLocator | UsualLocator):
            if method not in warm:  # kernels are loaded once
                locator.locate(photograph.view)
                warm.add(method)
            start = time.perf_counter()
            answer = locator.locate(photograph.view)
            seconds = time.perf_counter() - start
            rows.append(
                {
                    "method": method,
                    "set": name,
                    "view": photograph.name,
                    "detections": len(photograph.view),
                    **_outcome(_with_ties(locator, answer), photograph),
                    "seconds": seconds,
                }
            )
        if progress is not None:
            progress(count, len(tasks))
    return pd.DataFrame(rows)


def _with_ties(locator: Locator[Any], answer: Answer) -> Answer:
    """Return an answer that lists all cells that are as good as the best."""
    if isinstance(answer, Location) or answer.columns["tied"][0] <= len(answer.columns["tied"]):
        return answer
    longer: Answer = locator.locate(answer.query, top=int(answer.columns["tied"][0]))
    return longer


def _outcome(answer: Answer, photograph: Photograph) -> dict[str, Any]:
    """Return the columns of the answer to a view."""
    columns, chance, heading_error = answer.columns, math.nan, math.nan
    if isinstance(answer, Location):
        estimate, chance = answer.estimate, answer.answer.mass
        places = np.array([[estimate.x, estimate.y]])
        if estimate.heading is not None:
            heading_error = float(angular_distance(estimate.heading, -photograph.turn))
    else:
        best = slice(0, int(columns["tied"][0]))
        places = np.stack([columns["x"][best], columns["y"][best]], axis=1)
    errors = np.round(np.hypot(*(places - photograph.xy).T), 6)  # 50 m is within 50 m
    shares = {f"p{metres}": float((errors <= metres).mean()) for metres in WITHIN_M}
    return {
        "x": float(places[0, 0]),
        "y": float(places[0, 1]),
        "error_m": float(errors.mean()),
        **shares,
        "heading_error": heading_error,
        "chance": chance,
        "right": shares["p50"],
    }


def photograph_table(scored: pd.DataFrame) -> pd.DataFrame:
    """Return figures of photographs by method, by set and by number of detections.

    Parameters
    ----------
    scored : DataFrame
        The result of `score_photographs`.

    Returns
    -------
    DataFrame
        One row for each ``method``, ``set`` and group of ``detections`` (``"all"`` and those of
        `DETECTIONS`) with views: ``n``, ``p5`` to ``p50`` (shares), ``heading_error`` (median in
        degrees), ``answered`` (share with a chance of at least 0.9), ``right`` (share of the
        answers within 50 m), ``brier`` (mean square of chance minus outcome),
        ``calibration_error`` (mean distance of stated chance and share of right places, over ten
        bins of the chance, weighted by their number of views) and ``seconds`` (median). NaN
        where there is no such value.

    Examples
    --------
    >>> import pandas as pd
    >>> shares = {name: [1.0, 0.0] for name in ("p5", "p10", "p25", "p50", "right")}
    >>> views = {"method": "generic", "set": "single", "detections": [4, 5], "seconds": 0.1}
    >>> views |= {"heading_error": [2.0, 4.0], "chance": [0.95, 0.5]}
    >>> table = photograph_table(pd.DataFrame(views | shares))
    >>> table[["detections", "n", "p50", "answered", "right"]].values.tolist()
    [['all', 2, 0.5, 0.5, 1.0], ['3-5', 2, 0.5, 0.5, 1.0]]
    """
    rows = []
    for (method, name), views in scored.groupby(["method", "set"], sort=False):
        labels = np.array(range_labels(views["detections"].to_numpy(), DETECTIONS))
        for group in (ALL, *DETECTIONS):
            inside = views[labels == group] if group != ALL else views
            if len(inside):
                rows.append({"method": method, "set": name, "detections": group, **_row(inside)})
    return pd.DataFrame(rows)


def _row(views: pd.DataFrame) -> dict[str, Any]:
    """Return the figures of some views of a method."""
    chance, right = views["chance"], views["right"]
    answered = chance >= DEFAULT_RULE.threshold
    stated = chance.notna().any()
    bins = calibration_bins(views).query("n > 0") if stated else None
    return {
        "n": len(views),
        **{f"p{metres}": float(views[f"p{metres}"].mean()) for metres in WITHIN_M},
        "heading_error": float(views["heading_error"].median()),
        "answered": float(answered.mean()) if stated else math.nan,
        "right": float(right[answered].mean()),
        "brier": float(((chance - right) ** 2).mean()),
        "calibration_error": math.nan
        if bins is None
        else float(np.average((bins["stated"] - bins["true"]).abs(), weights=bins["n"])),
        "seconds": float(views["seconds"].median()),
    }


def photograph_calibration(scored: pd.DataFrame) -> pd.DataFrame:
    """Return `calibration_bins` of the views of `score_photographs`, by ``method`` and ``set``.

    A method without probabilities has no rows.
    """
    tables = [
        calibration_bins(views).assign(method=str(method), set=str(name))
        for (method, name), views in scored.groupby(["method", "set"], sort=False)
        if views["chance"].notna().any()
    ]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def photograph_failures(
    scored: pd.DataFrame,
    locator: LikelihoodLocator,
    photographs: Mapping[str, Sequence[Photograph]],
    city: City,
    *,
    method: str,
) -> list[dict[str, Any]]:
    """Return the views that a method located wrongly with the largest stated chances.

    Each has the ``set``, ``view``, ``chance`` and ``error_m``, and the scene at the true place
    (``true``) and at the answered one (``answered``): ``x``, ``y``, ``lon``, ``lat``, and ``rows``
    with the columns of `SCENE` of its explanation (see `explain`), without the objects outside of
    the photos.
    """
    wrong = scored[(scored["method"] == method) & (scored["right"] == 0)]
    store, failures = city.store, []
    for row in wrong.nlargest(FAILURES, "chance").to_dict("records"):
        photograph = next(item for item in photographs[row["set"]] if item.name == row["view"])
        turn = locator.locate(photograph.view).estimate.heading or 0.0
        scenes = {}
        for name, xy, heading in (
            ("true", photograph.xy, -photograph.turn),
            ("answered", (row["x"], row["y"]), turn),
        ):
            rows = explain(
                photograph.view,
                xy,
                locator.index.noise,
                objects=store.objects,
                index=store.index,
                radius=city.database.spec.radius,
                heading=heading,
            ).rows
            inside = [item for item in rows if item["verdict"] != "outside"]
            lon, lat = to_degrees(city.database.crs).transform(*xy)
            scenes[name] = {
                "x": xy[0],
                "y": xy[1],
                "lon": lon,
                "lat": lat,
                "rows": [{key: _rounded(item[key]) for key in SCENE} for item in inside],
            }
        failures.append({key: row[key] for key in ("set", "view", "chance", "error_m")} | scenes)
    return failures


def _rounded(value: Any) -> Any:  # noqa: ANN401 - a text, a number or None
    return round(value, 1) if isinstance(value, float) else value
