"""The settings of an evaluation as plain values, and the machine that it ran on."""

from __future__ import annotations

import functools
import json
import math
import os
import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow as pa

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.database.database import rows_of_result
from semsig_gis.evaluation.figures import (
    AMBIGUITIES,
    LENGTHS,
    ambiguity_labels,
    calibration_bins,
    coverage_curve,
    district_labels,
    figure_means,
    grouped_means,
    length_labels,
    percentile,
    plain_records,
    query_figures,
)
from semsig_gis.evaluation.methods import parse_method
from semsig_gis.likelihood.noise.model import noise_from_dict
from semsig_gis.matching.ties import NEAR_PLACES, THRESHOLDS, expected_recall
from semsig_gis.queries.chain import chain_text, parse_chain
from semsig_gis.queries.distortions import Detector
from semsig_gis.queries.draw import QuerySpec
from semsig_gis.storage.geoparquet import geo_metadata, read_geoparquet, write_geoparquet
from semsig_gis.storage.whole import whole_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.methods import AnyMethod
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.queries.chain import QueryDistortion


def machine() -> dict[str, Any]:
    """Return what decides how long things take here.

    Keys are ``system``, ``processor``, ``processors`` (how many there are) and ``memory_gb`` (None
    where the system does not tell).
    """
    pages = "SC_PHYS_PAGES" in getattr(os, "sysconf_names", ())
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9 if pages else None
    return {
        "system": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "processors": os.cpu_count() or 1,
        "memory_gb": None if memory is None else round(memory, 1),
    }


def used_noises(
    methods: Iterable[AnyMethod], distortions: Iterable[QueryDistortion]
) -> dict[str, Noise]:
    """Return the noise models of likelihood methods and detectors by name.

    Raises InputError if two models have one name, or a name has one of the signs ``, : / =`` that
    texts of methods and distortions use.
    """
    found: dict[str, Noise] = {}
    models = [one.noise for one in methods if one.noise is not None]
    models += [one.noise for one in distortions if isinstance(one, Detector)]
    for noise in models:
        if set(noise.name) & set(",:/="):
            msg = f"a noise model is called {noise.name!r}; give it a name without , : / and =."
            raise InputError(msg)
        if found.setdefault(noise.name, noise) != noise:
            msg = f"two noise models are called {noise.name!r}; give each a name of its own."
            raise InputError(msg)
    return found


def settings_to_dict(method: AnyMethod, asked: QuerySpec) -> dict[str, Any]:
    """Return a method and what it was asked as plain values for JSON.

    Keys are ``method``, ``asked`` and ``noises``: all noise models in full, so that nothing else is
    needed to read the texts. Raises InputError as `used_noises` does.
    """
    noises = used_noises([method], asked.distortions)
    return {
        "method": str(method),
        "asked": {
            "number": asked.number,
            "seeds": list(asked.seeds),
            "seen_from": asked.seen_from,
            "distortions": [chain_text([one]) for one in asked.distortions],
        },
        "noises": {name: noise.to_dict() for name, noise in noises.items()},
    }


def settings_from_dict(values: Mapping[str, Any]) -> tuple[AnyMethod, QuerySpec]:
    """Read a method and what it was asked, the inverse of `settings_to_dict`.

    Other values raise AttributeError, LookupError, TypeError or ValueError, which the caller turns
    into an error that names the file.
    """
    noises = {name: noise_from_dict(one) for name, one in values["noises"].items()}
    asked = dict(values["asked"])
    asked["seeds"] = tuple(asked["seeds"])
    asked["distortions"] = parse_chain(asked["distortions"], noises=noises)
    return parse_method(values["method"], noises=noises), QuerySpec(**asked)


SUCCESS_METRES = 50


SUCCESS_PROBABILITY = 0.5


_RECALLS = (1, 10)


_KIND = "localization evaluation"


QUERY_COLUMNS = (
    *("seed", "number", "cell", "cell_id", "types", "length", "type_group", "angle_group"),
    *("query_types", "query_bearings", "query_length", "heading"),
    *("best_cell_id", "best_x", "best_y", "distance", "tied", "next_cell_ids", "error_m"),
    *(f"p{threshold}" for threshold in THRESHOLDS),
    *(f"near{count}" for count in NEAR_PLACES),
    *("rank_low", "rank_high", "chance", "right", "in_region", "heading_error"),
)
"""Columns of the table of queries, in their order; ``geometry`` comes last."""


_QUERIES_FILE = "queries.parquet"


_SUMMARY_FILE = "evaluation.json"


_TIMING_FILE = "timing.json"


@dataclass(frozen=True, eq=False, kw_only=True)
class Evaluation:
    """The outcome of many queries and all that is needed to repeat or redraw it.

    Parameters
    ----------
    queries : GeoDataFrame
        One row a query, in the database's CRS; `geometry` is the true place.

        - ``seed``, ``number``: its seed, and its number from 0;
        - ``cell``, ``cell_id``: row number in the database and id of the cell of that place; the
          row number is -1 where the database has no such cell;
        - ``types``: the symbols that the database says are seen there; ``length``: how many
          objects really are;
        - ``type_group``, ``angle_group``: cells with its type and with its angle sequence, 0
          where the database has no such cell;
        - ``query_types``, ``query_bearings``, ``query_length``: what was asked: symbols, degrees
          (text, comma-separated) and how many there are; ``heading``: degrees to add to the
          bearings to have them from true north;
        - ``best_cell_id``, ``best_x``, ``best_y``, ``distance``: the best candidate, drawn from
          the tied when several share the best score; missing when unlocalized. Of the likelihood
          method it is the answer, and the distance its negative log-likelihood; where the place
          was refined, it is the place in the cell;
        - ``tied``: cells that share the best score, 0 when unlocalized; ``next_cell_ids``: the
          four best of the other cells (text, comma-separated), equals in the order of the cells;
        - ``error_m``: expected smallest error among the top t in metres, infinite when
          unlocalized;
        - ``p0``, ``p5``, ... (`THRESHOLDS`): probability that this error is at most so many
          metres;
        - ``near1``, ``near5``, ...: probability that one of the N best cells (the answer first)
          is at most 25 m away;
        - ``rank_low``, ``rank_high``: first and last rank that ties allow for the true cell, from
          1; both the number of cells when unlocalized or when the database has no such cell;
        - ``chance``: by the likelihood method's own account, that its answer is right, within
          50 m; missing for other methods and when unlocalized, as the next two;
        - ``right``: probability that its answer was right;
        - ``in_region``: probability that its region of 90 % held the true cell; between 0 and 1
          only where the true cell ties with the last of the region;
        - ``heading_error``: by how many degrees the heading was off, where it was looked for.
    method : Method or LikelihoodMethod
        What ranked the cells.
    asked : QuerySpec
        Which queries were asked, and what happened to them.
    city : str, optional
        The city that was looked at, if not the one that was searched.
    top : int
        How many best candidates count (t).
    seconds_per_query : float
        Mean time of an answer, without distortion and statistics; NaN where it is not known.
    database : mapping
        What was searched, as plain values: ``cells``, ``mean_length``, ``step_m``, ``origin``,
        ``radius_m``, ``levels``, ``crs``, ``version``, ``mb_per_km2`` (or None).
    versions : mapping
        Versions of the software by name.
    machine : mapping
        What it ran on (see `evaluation.result.machine`).

    Notes
    -----
    A query is unlocalized when the distortion left nothing of it.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> from semsig_gis.evaluation.evaluate import evaluate
    >>> evaluation = evaluate(build_database(objects), queries=20, distortion="light")
    >>> bool(evaluation.cdf([50])[0] <= evaluation.cdf([100])[0])
    True
    """

    queries: gpd.GeoDataFrame
    method: AnyMethod
    asked: QuerySpec
    top: int
    seconds_per_query: float
    database: Mapping[str, Any]
    versions: Mapping[str, str]
    city: str | None = None
    machine: Mapping[str, Any] = field(default_factory=machine)

    @functools.cached_property
    def figures(self) -> pd.DataFrame:
        """What each query adds to each figure (see `evaluation.figures`)."""
        return query_figures(self.queries, cells=self.database["cells"])

    @property
    def query_bearings(self) -> list[list[float]]:
        """Bearings of what each query asked for, in degrees."""
        return [
            [float(part) for part in text.split(",") if part]
            for text in self.queries["query_bearings"]
        ]

    @property
    def next_cell_ids(self) -> list[list[int]]:
        """Ids of the best cells of each query after the answer."""
        return [
            [int(part) for part in text.split(",") if part]
            for text in self.queries["next_cell_ids"]
        ]

    @property
    def successful(self) -> NDArray[np.bool_]:
        """Whether each query has an error of at most 50 m with probability 0.5 or more."""
        within = self.queries[f"p{SUCCESS_METRES}"].to_numpy(dtype=np.float64)
        return np.asarray(within >= SUCCESS_PROBABILITY)

    @property
    def unlocalized(self) -> int:
        """Number of queries of which the distortion left nothing."""
        return int((self.queries["query_length"] == 0).sum())

    def rows_in(self, database: SignatureDatabase) -> NDArray[np.int64]:
        """Return where the true cells of the queries are in the database that was searched.

        Parameters
        ----------
        database : SignatureDatabase
            The database.

        Returns
        -------
        ndarray of int64, shape (queries,)
            Row numbers; -1 where the database has no such cell.

        Raises
        ------
        InputError
            If another database was searched.
        """
        if len(database) != self.database["cells"]:
            msg = (
                f"This evaluation searched {self.database['cells']:,} cells, but the database has "
                f"{len(database):,}; give the database that it was made with, or evaluate again."
            )
            raise InputError(msg)
        known = self.queries["cell"].to_numpy() >= 0
        rows = np.full(len(known), -1)
        rows[known] = rows_of_result(
            database,
            self.queries["cell_id"][known],
            self.queries["types"][known],
            what="evaluation",
        )
        return rows

    def cdf(self, thresholds: Sequence[float] = THRESHOLDS) -> NDArray[np.float64]:
        """Return the share of queries whose error is at most so many metres.

        Parameters
        ----------
        thresholds : sequence of float, optional
            Errors in metres, each one of `THRESHOLDS`.

        Returns
        -------
        ndarray of float64
            Mean probability over the queries, one value a threshold.

        Raises
        ------
        InputError
            If a threshold is not one of those kept.
        """
        for value in thresholds:
            if value not in THRESHOLDS:
                kept = ", ".join(str(one) for one in THRESHOLDS)
                msg = f"No probability is kept for an error of {value} m; give some of {kept} m."
                raise InputError(msg)
        columns = [f"p{int(value)}" for value in thresholds]
        return np.asarray(self.queries[columns].to_numpy(dtype=np.float64).mean(axis=0))

    def recall(self, percent: float) -> float:
        """Return the share of queries whose true cell ranks in the top so many per cent of cells.

        Parameters
        ----------
        percent : float
            Share of the cells kept, above 0 and at most 100. The number kept is rounded down.

        Returns
        -------
        float
            The recall in [0, 1]; the true cell's rank is uniform among the cells it ties with.

        Raises
        ------
        InputError
            If the percentage is out of range.
        """
        ranks = self.queries["rank_low"], self.queries["rank_high"]
        chances = expected_recall(*ranks, cells=self.database["cells"], percent=percent)
        return float(chances.mean())

    def means(self) -> pd.DataFrame:
        """Return all figures that are shares of queries.

        Returns
        -------
        DataFrame
            By figure ``value``, ``low`` and ``high`` (95 %) and ``n`` (see
            `evaluation.figures.query_figures`).
        """
        return figure_means(self.figures)

    def by_length(self) -> pd.DataFrame:
        """Return the figures by how many objects are really seen.

        Returns
        -------
        DataFrame
            One row a range: ``length`` (text), ``n``, the figures, ``p50_low`` and ``p50_high``.
            NaN where there is no query to tell.
        """
        return self._grouped(length_labels(self.queries), by="length", ranges=LENGTHS)

    def by_ambiguity(self) -> pd.DataFrame:
        """Return the figures by how many cells have the types of the true one.

        Returns
        -------
        DataFrame
            One row a range: ``cells_alike`` (text), ``n``, the figures, ``p50_low``,
            ``p50_high``; first comes ``"0"`` where some true cells are not in the database.
        """
        labels = ambiguity_labels(self.queries)
        return self._grouped(labels, by="cells_alike", ranges=AMBIGUITIES)

    def by_district(self, districts: gpd.GeoDataFrame, name: str) -> pd.DataFrame:
        """Return the figures by the district that was seen.

        Parameters
        ----------
        districts : GeoDataFrame
            Polygons in any CRS.
        name : str
            Their column that names them.

        Returns
        -------
        DataFrame
            One row a district with queries: ``district``, ``n``, the figures, ``p50_low``,
            ``p50_high``; ``elsewhere`` for those in none.
        """
        labels = district_labels(self.queries, districts, name)
        order = [*dict.fromkeys(districts[name].astype(str)), "elsewhere"]
        found = [one for one in order if one in labels]
        return grouped_means(self.figures, labels, by="district", order=found)

    def _grouped(self, labels: list[str], *, by: str, ranges: Sequence[str]) -> pd.DataFrame:
        order = [*(["0"] if "0" in labels else []), *ranges]
        return grouped_means(self.figures, labels, by=by, order=order)

    def answers(self) -> dict[str, float]:
        """Return how the likelihood method answers and declines.

        Returns
        -------
        dict of str to float
            ``coverage``, the share of the queries that are answered, those whose answer is right
            with a chance that `likelihood.answer_rule.DEFAULT_RULE` asks for; ``precision``, the
            share of these answers that are right; and ``in_region``, the share of the regions of
            90 % that hold the true cell. NaN where there is no query to tell; empty for other
            methods.
        """
        if self.method.noise is None:
            return {}
        means = self.means()["value"]
        return {
            name: float(means.get(name, math.nan))
            for name in ("coverage", "precision", "in_region")
        }

    def coverage_curve(self) -> pd.DataFrame:
        """Return how many queries are answered, and answered right, rule by rule.

        Returns
        -------
        DataFrame
            See `evaluation.figures.coverage_curve`.
        """
        return coverage_curve(self.queries)

    def calibration(self) -> pd.DataFrame:
        """Return how often stated chances come true.

        Returns
        -------
        DataFrame
            See `evaluation.figures.calibration_bins`.
        """
        return calibration_bins(self.queries)

    def summary(self) -> dict[str, Any]:
        """Return settings, figures and versions as plain values for JSON.

        Returns
        -------
        dict
            ``settings``, ``database``, ``results``, ``versions`` and ``timing``; all but the last
            are the same whenever it is repeated. No value is infinite or NaN: an error is None
            where it is infinite, and a figure where there is no query to tell.
        """
        errors = self.queries["error_m"].to_numpy(dtype=np.float64)
        turns = self.queries["heading_error"].to_numpy(dtype=np.float64)
        by_chance = self.method.noise is not None
        return {
            "settings": {
                "method": str(self.method),
                "distortions": [chain_text([one]) for one in self.asked.distortions],
                "seen_from": self.asked.seen_from,
                "city": self.city,
                "top": self.top,
                "seeds": list(self.asked.seeds),
                "queries": len(self.queries),
            },
            "database": dict(self.database),
            "results": {
                "p_error_within_m": {
                    str(x): float(value) for x, value in zip(THRESHOLDS, self.cdf(), strict=True)
                },
                "recall_at_percent": {str(k): self.recall(k) for k in _RECALLS},
                "recall_of_best_within_25_m": {
                    str(count): float(self.queries[f"near{count}"].mean()) for count in NEAR_PLACES
                },
                "median_error_m": _plain(percentile(errors, 50)[0]),
                "p90_error_m": _plain(percentile(errors, 90)[0]),
                "median_heading_error": _plain(percentile(turns, 50)[0]),
                "successful": float(self.successful.mean()),
                "unlocalized": self.unlocalized,
                **{name: _plain(value) for name, value in self.answers().items()},
                "intervals": plain_records(self.means().reset_index()),
                "by_length": plain_records(self.by_length()),
                "by_ambiguity": plain_records(self.by_ambiguity()),
                "coverage_curve": plain_records(self.coverage_curve()) if by_chance else [],
                "calibration": plain_records(self.calibration()) if by_chance else [],
            },
            "versions": dict(self.versions),
            "timing": self._timing(),
        }

    def _timing(self) -> dict[str, Any]:
        seconds = _plain(self.seconds_per_query)
        return {"seconds_per_query": seconds, "machine": dict(self.machine)}

    def save(self, folder: str | Path) -> None:
        """Write the evaluation to a folder.

        Parameters
        ----------
        folder : str or Path
            Folder to write to, made when missing. It gets ``queries.parquet`` (GeoParquet, with
            the settings in its metadata, so that it is enough to load and redraw everything),
            ``evaluation.json`` (`summary`, for reading) and ``timing.json``, the one file that
            differs when the same is done again.

        Raises
        ------
        InputError
            If the folder cannot be written to.
        """
        plain = pd.DataFrame(self.queries.drop(columns="geometry"))
        table = pa.Table.from_pandas(plain, preserve_index=False)
        points = self.queries.geometry
        table = table.append_column("geometry", pa.array(points.to_wkb()))
        specs = {
            "kind": _KIND,
            **settings_to_dict(self.method, self.asked),
            "city": self.city,
            "top": self.top,
            "database": dict(self.database),
            "versions": dict(self.versions),
        }
        geo = geo_metadata(points.crs, geometry_types=["Point"], bounds=points.total_bounds)
        write_geoparquet(table, Path(folder) / _QUERIES_FILE, geo=geo, specs=specs)
        values = self.summary()
        timing = values.pop("timing")
        for name, content in ((_SUMMARY_FILE, values), (_TIMING_FILE, timing)):
            with whole_file(Path(folder) / name) as partial:
                text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False)
                partial.write_text(text + "\n", encoding="utf-8")

    @classmethod
    def load(cls, folder: str | Path) -> Evaluation:
        """Read an evaluation that `save` wrote.

        Parameters
        ----------
        folder : str or Path
            Folder with ``queries.parquet``.

        Returns
        -------
        Evaluation
            The same evaluation.

        Raises
        ------
        DatabaseError
            If the file is missing, damaged or of another kind.
        """
        file = Path(folder) / _QUERIES_FILE
        table, specs, crs = read_geoparquet(file, kind=_KIND, columns=[*QUERY_COLUMNS, "geometry"])
        timing = Path(folder) / _TIMING_FILE
        try:
            frame = table.to_pandas()
            points = gpd.GeoSeries.from_wkb(frame.pop("geometry"), crs=crs)
            frame["best_cell_id"] = frame["best_cell_id"].astype("Int64")
            method, asked = settings_from_dict(specs)
            told = json.loads(timing.read_text("utf-8")) if timing.exists() else {}
            seconds = told.get("seconds_per_query")
            return cls(
                queries=gpd.GeoDataFrame(frame, geometry=points),
                method=method,
                asked=asked,
                city=specs["city"],
                top=specs["top"],
                seconds_per_query=math.nan if seconds is None else seconds,
                database=specs["database"],
                versions=specs["versions"],
                machine=told.get("machine", {}),
            )
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            msg = f"{file} is damaged ({error}); evaluate again."
            raise DatabaseError(msg) from error


def _plain(value: float) -> float | None:
    """Return a number, or None for what JSON cannot hold."""
    return value if math.isfinite(value) else None
