"""What an evaluation found: a row a query, the figures of them, and the files.

Every figure is an expectation over all orders of the tied cells.
"""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow as pa

from semsig_gis.distortion import Distortion
from semsig_gis.errors import DatabaseError, InputError
from semsig_gis.locating import DEFAULT_RULE
from semsig_gis.method import LikelihoodMethod, Method
from semsig_gis.metrics import EditWeights
from semsig_gis.noise import noise_from_dict
from semsig_gis.scoring import THRESHOLDS, expected_recall
from semsig_gis.storage import geo_metadata, read_geoparquet, whole_file, write_geoparquet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

__all__ = ["SUCCESS_METRES", "SUCCESS_PROBABILITY", "Evaluation"]

SUCCESS_METRES = 50
SUCCESS_PROBABILITY = 0.5

_HEADLINE = (10, 25, 50, 100)
_RECALLS = (1, 10)
_LENGTHS = ((1, 4), (5, 9), (10, 19), (20, None))
_KIND = "localization evaluation"
_COLUMNS = (
    *("cell", "cell_id", "types", "length", "type_group", "angle_group"),
    *("query_types", "query_bearings", "query_length"),
    *("best_cell_id", "best_x", "best_y", "distance", "tied", "error_m"),
    *(f"p{threshold}" for threshold in THRESHOLDS),
    *("rank_low", "rank_high", "chance", "right", "in_region", "geometry"),
)
_QUERIES_FILE = "queries.parquet"
_SUMMARY_FILE = "evaluation.json"


@dataclass(frozen=True, eq=False, kw_only=True)
class Evaluation:
    """The outcome of many queries and all that is needed to repeat or redraw it.

    Parameters
    ----------
    queries : GeoDataFrame
        One row a query, in the database's CRS; `geometry` is the true viewpoint.

        - ``cell``, ``cell_id``: row number in the database and id of the true cell;
        - ``types``, ``length``: its symbols and how many there are;
        - ``type_group``, ``angle_group``: cells with its type and with its angle sequence;
        - ``query_types``, ``query_bearings``, ``query_length``: what was asked: symbols, degrees
          (text, comma-separated) and how many there are;
    @@
        - ``tied``: cells that share the best score, 0 when unlocalized;
        - ``error_m``: expected smallest error among the top t in metres, infinite when
          unlocalized;
        - ``p0``, ``p5``, ... (`THRESHOLDS`): probability that this error is at most so many
          metres;
        - ``rank_low``, ``rank_high``: first and last rank that ties allow for the true cell, from
          1; both the number of cells when unlocalized;
        - ``chance``: by the likelihood method's own account, that its answer is right, within
          50 m; missing for other methods and when unlocalized, as the next two;
        - ``right``: probability that its answer was right;
        - ``in_region``: probability that its region of 90 % held the true cell; between 0 and 1
          only where the true cell ties with the last of the region.
    method : Method or LikelihoodMethod
        What ranked the cells.
    distortion : Distortion
        What was done to the queries.
    top : int
        How many best candidates count (t).
    seed : int
        Seed of the sample and of all chances.
    seconds_per_query : float
        Mean time of scoring all cells, without distortion and statistics.
    database : mapping
        What was searched, as plain values: ``cells``, ``mean_length``, ``step_m``, ``origin``,
        ``radius_m``, ``levels``, ``crs``, ``version``.
    versions : mapping
        Versions of the software by name.

    Notes
    -----
    A query is unlocalized when the distortion left nothing of it.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> from semsig_gis.evaluation import evaluate
    >>> evaluation = evaluate(build_database(objects), queries=20, distortion="light")
    >>> bool(evaluation.cdf([50])[0] <= evaluation.cdf([100])[0])
    True
    """

    queries: gpd.GeoDataFrame
    method: Method | LikelihoodMethod
    distortion: Distortion
    top: int
    seed: int
    seconds_per_query: float
    database: Mapping[str, Any]
    versions: Mapping[str, str]

    @property
    def successful(self) -> NDArray[np.bool_]:
        """Whether each query has an error of at most 50 m with probability 0.5 or more."""
        within = self.queries[f"p{SUCCESS_METRES}"].to_numpy(dtype=np.float64)
        return np.asarray(within >= SUCCESS_PROBABILITY)

    @property
    def unlocalized(self) -> int:
        """Number of queries of which the distortion left nothing."""
        return int((self.queries["query_length"] == 0).sum())

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
        return float(self._recalls(percent).mean())

    def by_length(self) -> pd.DataFrame:
        """Return the figures by the length of the true signature.

        Returns
        -------
        DataFrame
            One row a range of lengths: ``length`` (text), ``n``, ``p10``, ``p25``, ``p50``,
            ``p100``, ``recall1``, ``recall10``, and, of the likelihood method, ``coverage``,
            ``precision`` and ``in_region`` (see `answers`). NaN where there is no query to tell.
        """
        lengths = self.queries["length"].to_numpy()
        figures = {f"p{x}": self.queries[f"p{x}"].to_numpy() for x in _HEADLINE}
        figures |= {f"recall{k}": self._recalls(k) for k in _RECALLS}
        figures |= self._answers()
        rows: list[dict[str, Any]] = []
        for low, high in _LENGTHS:
            chosen = (lengths >= low) & (lengths <= (math.inf if high is None else high))
            row: dict[str, Any] = {
                "length": f"{low}+" if high is None else f"{low}-{high}",
                "n": int(chosen.sum()),
            }
            rows.append(row | {name: _mean(values[chosen]) for name, values in figures.items()})
        return pd.DataFrame(rows)

    def answers(self) -> dict[str, float]:
        """Return how the likelihood method answers and declines.

        Returns
        -------
        dict of str to float
            ``coverage``, the share of the queries that are answered, those whose answer is right
            with a chance that `semsig_gis.locating.DEFAULT_RULE` asks for; ``precision``, the
            share of these answers that are right; and ``in_region``, the share of the regions of
            90 % that hold the true cell. NaN where there is no query to tell; empty for other
            methods.
        """
        return {name: _mean(values) for name, values in self._answers().items()}

    def summary(self) -> dict[str, Any]:
        """Return settings, figures and versions as plain values for JSON.

        Returns
        -------
        dict
            ``settings``, ``database``, ``results`` and ``versions``. No value is infinite or
            NaN: ``median_error_m`` is None when half of the queries or more are unlocalized, and
            so are figures without a query to tell.
        """
        median = float(np.median(self.queries["error_m"].to_numpy(dtype=np.float64)))
        by_length = [_plain(row) for row in self.by_length().to_dict("records")]
        return {
            "settings": {
                "method": str(self.method),
                "distortion": dataclasses.asdict(self.distortion),
                "top": self.top,
                "seed": self.seed,
                "queries": len(self.queries),
            },
            "database": dict(self.database),
            "results": {
                "p_error_within_m": {
                    str(x): float(value) for x, value in zip(THRESHOLDS, self.cdf(), strict=True)
                },
                "recall_at_percent": {str(k): self.recall(k) for k in _RECALLS},
                "median_error_m": median if math.isfinite(median) else None,
                "successful": float(self.successful.mean()),
                "unlocalized": self.unlocalized,
                **_plain(self.answers()),
                "seconds_per_query": self.seconds_per_query,
                "by_length": by_length,
            },
            "versions": dict(self.versions),
        }

    def save(self, folder: str | Path) -> None:
        """Write the evaluation to a folder.

        Parameters
        ----------
        folder : str or Path
            Folder to write to, made when missing. It gets ``queries.parquet`` (GeoParquet, with
            the settings in its metadata, so that it is enough to load and redraw everything) and
            ``evaluation.json`` (`summary`, for reading).

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
            "method": _method_specs(self.method),
            "distortion": dataclasses.asdict(self.distortion),
            "top": self.top,
            "seed": self.seed,
            "seconds_per_query": self.seconds_per_query,
            "database": dict(self.database),
            "versions": dict(self.versions),
        }
        geo = geo_metadata(points.crs, geometry_types=["Point"], bounds=points.total_bounds)
        write_geoparquet(table, Path(folder) / _QUERIES_FILE, geo=geo, specs=specs)
        with whole_file(Path(folder) / _SUMMARY_FILE) as partial:
            text = json.dumps(self.summary(), indent=2, allow_nan=False, ensure_ascii=False)
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
        table, specs, crs = read_geoparquet(file, kind=_KIND, columns=list(_COLUMNS))
        try:
            frame = table.to_pandas()
            points = gpd.GeoSeries.from_wkb(frame.pop("geometry"), crs=crs)
            frame["best_cell_id"] = frame["best_cell_id"].astype("Int64")
            return cls(
                queries=gpd.GeoDataFrame(frame, geometry=points),
                method=_method_of(specs["method"]),
                distortion=Distortion(**specs["distortion"]),
                top=specs["top"],
                seed=specs["seed"],
                seconds_per_query=specs["seconds_per_query"],
                database=specs["database"],
                versions=specs["versions"],
            )
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            msg = f"{file} is damaged ({error}); evaluate again."
            raise DatabaseError(msg) from error

    def _recalls(self, percent: float) -> NDArray[np.float64]:
        """Return the chance of each query that its true cell is in the top `percent`."""
        ranks = self.queries["rank_low"], self.queries["rank_high"]
        return expected_recall(*ranks, cells=self.database["cells"], percent=percent)

    def _answers(self) -> dict[str, NDArray[np.float64]]:
        """Return what `answers` is the mean of, query by query; NaN where a query has no say."""
        if not isinstance(self.method, LikelihoodMethod):
            return {}
        columns = ("chance", "right", "in_region")
        chance, right, held = (self.queries[name].to_numpy(dtype=np.float64) for name in columns)
        answered = chance >= DEFAULT_RULE.threshold
        return {
            "coverage": answered.astype(np.float64),
            "precision": np.where(answered, right, np.nan),
            "in_region": held,
        }


def _mean(values: NDArray[np.float64]) -> float:
    """Return the mean of what is a number; NaN if nothing is."""
    told = values[~np.isnan(values)]
    return float(told.mean()) if told.size else math.nan


def _plain(figures: Mapping[Any, Any]) -> dict[Any, Any]:
    """Return figures with None for what JSON cannot hold."""
    return {key: None if value != value else value for key, value in figures.items()}  # noqa: PLR0124


def _method_specs(method: Method | LikelihoodMethod) -> dict[str, Any]:
    """Return a method as plain values."""
    if isinstance(method, LikelihoodMethod):
        return {"noise": method.noise.to_dict()}
    return dataclasses.asdict(method)


def _method_of(specs: Mapping[str, Any]) -> Method | LikelihoodMethod:
    """Return the method of plain values."""
    if "noise" in specs:
        return LikelihoodMethod(noise=noise_from_dict(specs["noise"]))
    return Method(**{**specs, "weights": EditWeights(**specs["weights"])})
