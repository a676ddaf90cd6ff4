"""An experiment with its input files, whose queries are answered in batches of a hundred.

The answers of each method to a batch are one file, so that little is lost if a run is interrupted,
and several processes can share the work.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import geopandas as gpd
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from semsig_gis.core import SourceError
from semsig_gis.database import City
from semsig_gis.evaluation.figures import district_labels
from semsig_gis.evaluation.queries.draw import check_count, draw_queries
from semsig_gis.evaluation.scoring import make_evaluation, score_queries, scored_tables
from semsig_gis.evaluation.spec import Case
from semsig_gis.localization import DistanceMemo, make_locator
from semsig_gis.storage import (
    VERIFY_CHECKSUMS,
    add_footer_checksum,
    check_footer_checksum,
    digest,
    whole_file,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.queries.draw import SimulatedQuery
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.evaluation.spec import ExperimentSpec
    from semsig_gis.localization import Answer, Locator

BATCH_QUERIES = 100
MEMO_BYTES = 256 << 20  # memory for the distances that the methods of an experiment share
_MEASURES = 3  # each of types and of angles
_STAGES = 2


class QueryBatch(NamedTuple):
    """Up to a hundred queries with one distortion, for all methods; numbers count from 0."""

    distortion: str
    number: int


class OpenExperiment:
    """An experiment and its input files, with paths relative to a folder."""

    def __init__(self, spec: ExperimentSpec, folder: Path) -> None:
        self.spec, self.folder = spec, folder
        self._cities: dict[str, City] = {}
        self._locators: dict[str, Locator[Answer]] = {}

    def digests(self) -> dict[str, str]:
        """Return a digest of each input file by name; SemsigError if a file is missing."""
        names = (self.spec.database, self._observed_city)
        digests = {name: self._city(name).digest for name in dict.fromkeys(names)}
        for name in self._store_names():
            store = self._city(name).store_path
            if store.is_dir():
                key = f"{name.removesuffix('.parquet')}{store.suffix}"
                digests[key] = digest(*sorted(store.glob("*.parquet")))
        if self.spec.districts is not None:
            file = self.folder / self.spec.districts.file
            if not file.is_file():
                raise SourceError(f"districts {file} do not exist; give a file of polygons.")
            digests[self.spec.districts.file] = digest(file)
        return digests

    def _store_names(self) -> dict[str, None]:
        """Return the distinct databases that need their street objects."""
        anywhere = [self._observed_city] if self.spec.seen_from == "anywhere" else []
        refined = any(method.refined for method in self.spec.methods.values())
        return dict.fromkeys([*anywhere, *([self.spec.database] if refined else [])])

    def prepare(self) -> None:
        """Open all files and build all indexes; raise SemsigError if one does not fit."""
        for top in self.spec.top:
            check_count("candidates", top, len(self.database))
        if self.districts is not None and self.spec.districts is not None:
            nowhere = gpd.GeoDataFrame(geometry=[], crs=self.database.crs)
            district_labels(nowhere, self.districts, self.spec.districts.name)
        for name in self._store_names():
            _ = self._city(name).store
        for distortion in self.spec.distortions:
            self._queries(distortion, slice(1))
        for name in self.spec.methods:
            self._locator(name)

    @property
    def database(self) -> SignatureDatabase:
        """The database to search."""
        return self._city(self.spec.database).database

    @property
    def _observed_city(self) -> str:
        """Name of the database of the city from which queries are seen."""
        return self.spec.city or self.spec.database

    @cached_property
    def districts(self) -> gpd.GeoDataFrame | None:
        """Polygons by which results are grouped, if any."""
        if self.spec.districts is None:
            return None
        file = self.folder / self.spec.districts.file
        try:
            return gpd.read_file(file)
        except Exception as error:  # GDAL's readers raise many kinds of errors
            raise SourceError(
                f"districts {file} cannot be read ({error}); give a file of polygons."
            ) from error

    @property
    def _query_count(self) -> int:
        """Number of queries with each distortion."""
        return self.spec.queries * len(self.spec.seeds)

    @property
    def batches(self) -> tuple[QueryBatch, ...]:
        """All batches of the experiment."""
        numbers = range(math.ceil(self._query_count / BATCH_QUERIES))
        return tuple(
            QueryBatch(name, number) for name in self.spec.distortions for number in numbers
        )

    def batch_size(self, batch: QueryBatch) -> int:
        """Return the number of queries in a batch; the last one may be smaller."""
        return min(BATCH_QUERIES, self._query_count - batch.number * BATCH_QUERIES)

    def answer(self, folder: Path, batch: QueryBatch) -> None:
        """Answer the queries of a batch with every method that has no complete file in a folder."""
        rows = self.batch_size(batch) * len(self.spec.top)
        files = {name: _batch_file(folder, batch, name) for name in self.spec.methods}
        missing = {name: file for name, file in files.items() if not _is_complete(file, rows=rows)}
        if not missing:
            return
        start = batch.number * BATCH_QUERIES
        queries = self._queries(batch.distortion, slice(start, start + BATCH_QUERIES))
        # Distance methods are answered together, because they share distances.
        by_distance = [name for name in missing if self.spec.methods[name].noise is None]
        for names in (by_distance, *([name] for name in missing if name not in by_distance)):
            for name, scored in self._scored(names, queries):
                with whole_file(missing[name]) as unfinished:
                    scored.to_parquet(unfinished, write_page_checksum=True)
                    add_footer_checksum(unfinished)

    def _scored(
        self, names: Sequence[str], queries: Sequence[SimulatedQuery]
    ) -> Iterator[tuple[str, pd.DataFrame]]:
        """Yield the name of each method and the table of its scored answers.

        Distances that several methods need are computed once.
        """
        scores: dict[str, dict[int, list[dict[str, Any]]]] = {
            name: {top: [] for top in self.spec.top} for name in names
        }
        step = len(queries)
        if len(names) > 1:
            # As many queries at once as have shared distances that fit into memory.
            database = self.database
            distinct = len(database.type_sequences) + len(database.angle_sequences)
            query_bytes = 4 * (_MEASURES * distinct + _STAGES * len(database))
            step = max(1, min(step, MEMO_BYTES // max(query_bytes, 1)))
        for start in range(0, len(queries), step):
            memo = DistanceMemo() if len(names) > 1 else None
            for name in names:
                outcomes = score_queries(
                    self.database,
                    self._locator(name),
                    queries[start : start + step],
                    tops=self.spec.top,
                    memo=memo,
                )
                for top, rows in outcomes.items():
                    scores[name][top] += rows
        for name, outcomes in scores.items():
            scored = scored_tables(self.database, queries, outcomes)
            tables = [table.assign(top=top) for top, table in scored.items()]
            yield name, pd.concat(tables, ignore_index=True)

    def evaluations(self, folder: Path) -> dict[str, Evaluation]:
        """Return all evaluations by the names of their cases; all batches must be in the folder."""
        size = sum(file.stat().st_size for file in self._city(self.spec.database).files)
        evaluations = {}
        for distortion, method in product(self.spec.distortions, self.spec.methods):
            batches = [batch for batch in self.batches if batch.distortion == distortion]
            files = [_batch_file(folder, batch, method) for batch in batches]
            tables = [pq.read_table(file, **VERIFY_CHECKSUMS) for file in files]
            scored = pa.concat_tables(tables, promote_options="default").to_pandas()
            for top in self.spec.top:
                case = Case(distortion=distortion, method=method, top=top)
                evaluations[case.name] = make_evaluation(
                    self.database,
                    self.spec.methods[method],
                    self.spec.asked(distortion),
                    scored[scored["top"] == top].reset_index(drop=True),
                    top=top,
                    city=self.spec.city,
                    file_bytes=size,
                )
        return evaluations

    def _queries(self, distortion: str, part: slice) -> list[SimulatedQuery]:
        """Draw some of the queries with a distortion."""
        city = self._city(self._observed_city)
        return draw_queries(
            self.database,
            self.spec.asked(distortion),
            store=city.store if self.spec.seen_from == "anywhere" else None,
            city=None if self.spec.city is None else city.database,
            part=part,
        )

    def _locator(self, name: str) -> Locator[Answer]:
        """Return the locator of a method, which is built once."""
        if name not in self._locators:
            method = self.spec.methods[name]
            store = self._city(self.spec.database).store if method.refined else None
            self._locators[name] = make_locator(self.database, method, store=store)
        return self._locators[name]

    def _city(self, name: str) -> City:
        return self._cities.setdefault(name, City(self.folder / name))


def _batch_file(folder: Path, batch: QueryBatch, method: str) -> Path:
    return folder / f"{batch.distortion}.{method}.{batch.number:05d}.parquet"


def _is_complete(file: Path, *, rows: int) -> bool:
    """Whether a file of answers exists, can be read and has all rows."""
    if not file.is_file():
        return False
    try:
        check_footer_checksum(file)
        return bool(pq.read_table(file, **VERIFY_CHECKSUMS).num_rows == rows)
    except (OSError, ValueError, pa.ArrowException):
        return False
