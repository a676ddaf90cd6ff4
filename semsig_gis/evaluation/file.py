"""Read and write evaluations; convert their settings to and from JSON values."""

from __future__ import annotations

import contextlib
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import shapely

from semsig_gis.core import DatabaseError, InputError, brief
from semsig_gis.evaluation.queries.distortion_text import chain_text, parse_chain
from semsig_gis.evaluation.queries.distortions import SimulatedDetector
from semsig_gis.evaluation.queries.draw import QuerySpec
from semsig_gis.evaluation.result import QUERY_COLUMNS, Evaluation
from semsig_gis.localization import noise_from_dict, parse_method
from semsig_gis.storage import (
    UNREADABLE,
    digest,
    geo_metadata,
    parse_json,
    read_geoparquet,
    read_whole,
    require_kinds,
    whole_files,
    write_geoparquet,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from semsig_gis.evaluation.queries.distortion_text import QueryDistortion
    from semsig_gis.localization import AnyMethod, Noise
    from semsig_gis.storage import ColumnKind

KIND = "localization evaluation"
TEXTS = ("types", "query_types", "query_bearings", "query_ranges", "query_sectors", "next_cell_ids")
WHOLE = (
    *("seed", "number", "cell", "cell_id", "length", "type_group", "angle_group", "query_length"),
    *("tied", "rank_low", "rank_high"),
)
QUERY_KINDS: dict[str, ColumnKind] = {
    **dict.fromkeys(QUERY_COLUMNS, "number"),
    **dict.fromkeys(TEXTS, "text"),
    "best_cell_id": "whole",
}
CHANCES = (
    *(name for name in QUERY_COLUMNS if name[0] == "p" or name.startswith("near")),
    *("chance", "right", "in_region"),
)
RUN = "run"
"""Key of the digest of the queries in the other files."""
QUERIES, SUMMARY, TIMING = "queries.parquet", "evaluation.json", "timing.json"


def save_evaluation(evaluation: Evaluation, folder: str | Path) -> None:
    """Write an evaluation to a folder.

    Parameters
    ----------
    evaluation : Evaluation
        The evaluation.
    folder : str or Path
        Folder to write to, created if missing. It gets ``queries.parquet`` (GeoParquet with the
        settings in its metadata; this file is enough to open the evaluation again),
        ``evaluation.json`` (`Evaluation.summary`, for people and other programs) and
        ``timing.json``, the only file that differs if the evaluation is repeated.

    Raises
    ------
    InputError
        If the folder is not writable.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import evaluate
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_evaluation(evaluate(demo_database, queries=5), f"{folder}/results")
    ...     len(open_evaluation(f"{folder}/results").queries)
    5
    """
    plain = pd.DataFrame(evaluation.queries.drop(columns="geometry"))
    points = evaluation.queries.geometry
    table = pa.Table.from_pandas(plain, preserve_index=False)
    table = table.append_column("geometry", pa.array(points.to_wkb()))
    specs = {
        "kind": KIND,
        **settings_to_dict(evaluation.method, evaluation.asked),
        "city": evaluation.city,
        "top": evaluation.top,
        "database": dict(evaluation.database),
        "versions": dict(evaluation.versions),
    }
    geo = geo_metadata(points.crs, geometry_types=["Point"], bounds=points.total_bounds)
    summary: dict[str, Any] = {**evaluation.summary()}
    timing = summary.pop("timing")
    files = [Path(folder) / name for name in (QUERIES, SUMMARY, TIMING)]
    with whole_files(*files) as (queries, *others):
        write_geoparquet(table, queries, geo=geo, specs=specs)
        run = digest(queries)
        for partial, content in zip(others, (summary, timing), strict=True):
            text = json.dumps({**content, RUN: run}, indent=2, allow_nan=False, ensure_ascii=False)
            partial.write_text(text + "\n", encoding="utf-8")


def open_evaluation(folder: str | Path) -> Evaluation:
    """Read an evaluation that `save_evaluation` wrote.

    Parameters
    ----------
    folder : str or Path
        Folder with ``queries.parquet``; without ``timing.json`` the time is NaN.

    Returns
    -------
    Evaluation
        The same evaluation.

    Raises
    ------
    DatabaseError
        If the file is missing, damaged or not an evaluation.

    Examples
    --------
    >>> from semsig_gis import SemsigError
    >>> try:
    ...     open_evaluation("nowhere")
    ... except SemsigError as error:
    ...     print("nowhere" in str(error))
    True
    """
    file = Path(folder) / QUERIES
    table, specs, crs = read_geoparquet(file, kind=KIND, columns=[*QUERY_COLUMNS, "geometry"])
    times = Path(folder) / TIMING
    try:
        _check(table, specs)
        frame = table.to_pandas()
        points = gpd.GeoSeries.from_wkb(frame.pop("geometry"), crs=crs)
        frame["best_cell_id"] = frame["best_cell_id"].astype("Int64")
        method, query_spec = settings_from_dict(specs)
        timing = _of_run(times, run := digest(file))
        with contextlib.suppress(OSError, TypeError, ValueError):  # only people read it
            _of_run(file.with_name(SUMMARY), run)
        seconds = timing.get("seconds_per_query")
        return Evaluation(
            queries=gpd.GeoDataFrame(frame, geometry=points),
            method=method,
            asked=query_spec,
            city=specs["city"],
            top=specs["top"],
            seconds_per_query=math.nan if seconds is None else seconds,
            database=specs["database"],
            versions=specs["versions"],
            machine=timing.get("machine", {}),
        )
    except (*UNREADABLE, shapely.errors.ShapelyError) as error:
        raise DatabaseError(f"{file} is damaged ({brief(error)}); evaluate again.") from error


def _of_run(path: Path, run: str) -> dict[str, Any]:
    """Return the values of a file next to the queries, if it exists.

    DatabaseError if it is of another run, TypeError or ValueError if it cannot be read.
    """
    values = dict(parse_json(read_whole(path), finite=True)) if path.exists() else {}
    if values.get(RUN, run) != run:
        raise DatabaseError(
            f"{path} is of another run than {QUERIES} next to it, perhaps of one that was "
            "interrupted; evaluate again, or remove it."
        )
    return values


def _check(table: pa.Table, specs: dict[str, Any]) -> None:
    """Raise LookupError, TypeError or ValueError if columns or specs cannot be of an evaluation."""
    require_kinds(table, QUERY_KINDS, may_lack=[*QUERY_KINDS])
    require_kinds(table, dict.fromkeys(WHOLE, "whole"))
    for name in CHANCES:
        limits = pc.min_max(table[name]).as_py()
        if limits["min"] is not None and not 0 <= limits["min"] <= limits["max"] <= 1:
            raise ValueError(f"its column {name} has values that are not from 0 to 1")
    low, high = table["rank_low"].to_numpy(), table["rank_high"].to_numpy()
    if not ((low >= 1) & (high >= low)).all():
        raise ValueError("its ranks do not fit each other")
    if not isinstance(specs["database"]["cells"], int):
        raise TypeError("its number of cells is no number")


def settings_to_dict(method: AnyMethod, query_spec: QuerySpec) -> dict[str, Any]:
    """Return a method, its queries and all noise models in full, as values for JSON."""
    noises = used_noises([method], query_spec.distortions)
    return {
        "method": str(method),
        "asked": {
            "number": query_spec.number,
            "seeds": list(query_spec.seeds),
            "seen_from": query_spec.seen_from,
            "distortions": [chain_text([distortion]) for distortion in query_spec.distortions],
        },
        "noises": {name: noise.to_dict() for name, noise in noises.items()},
    }


def settings_from_dict(values: Mapping[str, Any]) -> tuple[AnyMethod, QuerySpec]:
    """Return the method and the queries of `settings_to_dict`.

    Other values raise AttributeError, LookupError, TypeError or ValueError.
    """
    noises = {name: noise_from_dict(noise) for name, noise in values["noises"].items()}
    spec = dict(values["asked"])
    spec["seeds"] = tuple(spec["seeds"])
    spec["distortions"] = parse_chain(spec["distortions"], noises=noises)
    return parse_method(values["method"], noises=noises), QuerySpec(**spec)


def used_noises(
    methods: Iterable[AnyMethod], distortions: Iterable[QueryDistortion]
) -> dict[str, Noise]:
    """Return the noise models of likelihood methods and detectors by name.

    InputError if two models have the same name, or a name has one of the characters , : / and =.
    """
    noises: dict[str, Noise] = {}
    models = [method.noise for method in methods if method.noise is not None]
    models += [item.noise for item in distortions if isinstance(item, SimulatedDetector)]
    for noise in models:
        if set(noise.name) & set(",:/="):
            raise InputError(
                f"a noise model is called {noise.name!r}; give it a name without , : / and =."
            )
        if noises.setdefault(noise.name, noise) != noise:
            raise InputError(
                f"two noise models are called {noise.name!r}; give each a name of its own."
            )
    return noises
