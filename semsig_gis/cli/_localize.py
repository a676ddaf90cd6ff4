"""`semsig localize`: queries, and where they were seen from."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli._app import AsJson, Database, app, numbers, tell_if_online
from semsig_gis.console import print_json, print_rows, progress, remark
from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Localization
    from semsig_gis.location import Location
    from semsig_gis.signatures import Signature
    from semsig_gis.taxonomy import Taxonomy

LIKELIHOOD = "likelihood"


@app.command()
def localize(
    database: Database,
    *,
    types: Annotated[
        str | None,
        typer.Option(help="Symbols clockwise from north, such as DDBL; ? where one is unknown."),
    ] = None,
    bearings: Annotated[
        str | None, typer.Option(help="Degrees clockwise from north, such as 10,80,200,310.")
    ] = None,
    queries: Annotated[
        str | None,
        typer.Option(
            help="Many queries: a CSV or JSON lines file with types and bearings, or - for JSON "
            "lines from standard input; the answers are JSON lines."
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            help="likelihood; or TYPES+ANGLES (edit, histogram, jaccard), or one part as "
            "types:edit or angles:edit; add :5% for two stages, :alpha=0.7, :raw or "
            ":weights=INSERT/DELETE/SUBSTITUTE."
        ),
    ] = "edit+edit",
    noise: Annotated[
        str,
        typer.Option(
            help="With likelihood, how the detector fails: light, medium, strong, generic (which "
            "of them is not known), or a file."
        ),
    ] = "generic",
    heading: Annotated[
        str,
        typer.Option(
            help="With likelihood: known, unknown, or by how many degrees the north of the "
            "query may be off (standard deviation)."
        ),
    ] = "known",
    near: Annotated[
        str | None,
        typer.Option(help="With likelihood, the last known place: X,Y,SIGMA in metres."),
    ] = None,
    area: Annotated[
        Path | None, typer.Option(help="With likelihood: polygons that the place lies in.")
    ] = None,
    require: Annotated[
        str | None,
        typer.Option(help="What a cell must see: M (one), 2B (two or more), B=0, ?<=10 (in all)."),
    ] = None,
    top: Annotated[int, typer.Option(help="Number of candidates.")] = 10,
    map_: Annotated[Path | None, typer.Option("--map", help="Map to write (.html).")] = None,
    as_json: AsJson = False,
) -> None:
    """Rank the cells of a database for a query, or for many."""
    if queries is not None and (types is not None or bearings is not None or map_ is not None):
        msg = "--queries was given with --types, --bearings or --map; give a file or one query."
        raise InputError(msg)
    if method != LIKELIHOOD and (heading != "known" or near is not None or area is not None):
        msg = (
            f"--heading, --near and --area are for --method likelihood, not for {method!r}; give "
            "that method, or leave them out."
        )
        raise InputError(msg)
    answer: Callable[[Signature], Localization | Location]
    if method == LIKELIHOOD:
        prior = {"near": near, "area": area, "require": require}
        taxonomy, answer = _by_likelihood(database, noise, heading, top, **prior)
    else:
        taxonomy, answer = _by_distance(database, method, require, top)
    if queries is not None:
        for name, query in _read_queries(queries, taxonomy):
            print_json({"id": name, **answer(query).to_dict()}, indent=None)
        return
    from semsig_gis.signatures import Signature

    angles = None if bearings is None else numbers(bearings, "--bearings")
    found = answer(Signature.parse(types, angles, taxonomy=taxonomy))
    if map_ is not None:
        _draw(found, database, map_)
    if as_json:
        print_json(found.to_dict())
    else:
        _print(found.to_dict())
        if map_ is not None:
            typer.echo(f"map: {map_}")


def _by_distance(
    path: Path, method: str, require: str | None, top: int
) -> tuple[Taxonomy, Callable[[Signature], Localization]]:
    from semsig_gis import matching
    from semsig_gis.database_file import open_database
    from semsig_gis.dataset import open_dataset
    from semsig_gis.patterns import Requirement

    chosen = matching.Method.parse(method)
    opened = open_dataset(path) if path.is_dir() else open_database(path)
    wanted = None if require is None else Requirement.parse(require, opened.taxonomy)

    def answer(query: Signature) -> Localization:
        return matching.localize(opened, query, method=chosen, requirement=wanted, top=top)

    return opened.taxonomy, answer


def _by_likelihood(
    path: Path,
    noise: str,
    heading: str,
    top: int,
    **known: Any,  # noqa: ANN401 - as _prior takes them
) -> tuple[Taxonomy, Callable[[Signature], Location]]:
    from semsig_gis.database_file import open_database
    from semsig_gis.likelihood_file import index_path, ready_index
    from semsig_gis.locating import locate
    from semsig_gis.noise import NOISES, named_noise
    from semsig_gis.noise_file import open_noise

    north_sigma = _north_sigma(heading)
    model = open_noise(noise) if noise not in NOISES and Path(noise).suffix else named_noise(noise)
    opened = open_database(path)
    prior = _prior(opened, **known)
    with progress("building the likelihood index") as advance:
        index = ready_index(opened, model, index_path(path, model), note=remark, progress=advance)

    def answer(query: Signature) -> Location:
        return locate(index, query, north_sigma=north_sigma, log_prior=prior, top=top)

    return opened.taxonomy, answer


def _north_sigma(heading: str) -> float:
    if heading in {"known", "unknown"}:
        return 0.0 if heading == "known" else math.inf
    try:
        sigma = float(heading)
    except ValueError:
        sigma = -1.0
    if not sigma >= 0:
        msg = f"--heading was given as {heading!r}; give known, unknown, or degrees from 0 up."
        raise InputError(msg)
    return sigma


def _prior(
    opened: SignatureDatabase, *, near: str | None, area: Path | None, require: str | None
) -> NDArray[Any] | None:
    """Return the log-prior that the options ask for."""
    import numpy as np

    from semsig_gis.patterns import PatternIndex, Requirement
    from semsig_gis.priors import area_prior, position_prior, weight_prior
    from semsig_gis.surroundings import read_area

    parts = []
    if near is not None:
        place = numbers(near, "--near")
        if len(place) != 3:  # noqa: PLR2004 - x, y and sigma
            msg = f"--near was given as {near!r}; give X,Y,SIGMA in metres."
            raise InputError(msg)
        parts.append(position_prior(opened, (place[0], place[1]), sigma=place[2]))
    if area is not None:
        parts.append(area_prior(opened, read_area(area, crs=opened.crs)))
    if require is not None:
        wanted = Requirement.parse(require, opened.taxonomy)
        met = PatternIndex.build(opened.type_sequences).meeting(wanted)
        parts.append(weight_prior(opened, met.astype(np.float64)))
    return None if not parts else np.sum(parts, axis=0)


def _read_queries(source: str, taxonomy: Taxonomy) -> list[tuple[str | int, Signature]]:
    from semsig_gis.query_file import parse_queries, read_queries

    if source == "-":
        return parse_queries(sys.stdin.read(), "standard input", taxonomy=taxonomy)
    return read_queries(source, taxonomy=taxonomy)


def _draw(found: Localization | Location, database: Path, out: Path) -> None:
    from semsig_gis.database_file import open_database
    from semsig_gis.localization import Localization
    from semsig_gis.maps import localization_map, save_map

    if not isinstance(found, Localization):
        msg = "--map shows the answers of edit, histogram and jaccard; leave out --map."
        raise InputError(msg)
    with progress("drawing the map"):
        tell_if_online(save_map(localization_map(found, open_database(database)), out))


def _print(result: dict[str, Any]) -> None:
    """Print an answer as a table."""
    candidates = result["candidates"]
    by_chance = "noise" in result
    said = f"likelihood ({result['noise']} noise)" if by_chance else result["used"]
    score = ("chance",) if by_chance else ("distance",)
    print_rows(
        f"{len(candidates)} best of {result['cells']:,} cells, by {said}",
        ("rank", "cell", "x", "y", "lon", "lat", *score, "types"),
        (
            [
                row["rank"] if by_chance else _rank_text(row["rank_low"], row["rank_high"]),
                row["cell_id"],
                f"{row['x']:.1f}",
                f"{row['y']:.1f}",
                f"{row['lon']:.6f}",
                f"{row['lat']:.6f}",
                f"{row[score[0]]:.4f}",
                row["types"],
            ]
            for row in candidates
        ),
    )
    if not by_chance:
        if result["tied_beyond"]:
            typer.echo(f"{result['tied_beyond']:,} further cells tie with the last one.")
        return
    place, region = result["place"], result["region"]
    chance = f"within {place['within_m']:g} m with a chance of {place['chance']:.1%}"
    if result["answered"]:
        typer.echo(f"{place['lat']:.6f}, {place['lon']:.6f} (lat, lon), {chance}.")
    else:
        typer.echo(
            f"Cannot tell: the best place, {place['lat']:.6f}, {place['lon']:.6f} (lat, lon), is "
            f"{chance}."
        )
    typer.echo(
        f"{region['share']:.0%} of the chance is in {region['cells']:,} cells "
        f"({region['km2']:.3f} km²)."
    )


def _rank_text(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}-{high}"
