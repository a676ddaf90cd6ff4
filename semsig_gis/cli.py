"""The `semsig` command: argument parsing and printing, nothing else.

Results go to standard output, progress and remarks to standard error. The exit code is 0 when the
work is done, 2 when the input cannot be used (with one plain sentence), 1 when the fault is ours.
Heavy modules are imported by the commands that need them, so that the help appears at once.
"""

from __future__ import annotations

import enum
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis import __version__
from semsig_gis.console import print_json, print_rows, progress, remark
from semsig_gis.errors import InputError, SemsigError

if TYPE_CHECKING:
    from semsig_gis.catalog import LayerSpec
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.grid import GridSpec
    from semsig_gis.objects import LoadReport, StreetObjects
    from semsig_gis.report import Table
    from semsig_gis.signatures import SignatureSpec

__all__ = ["app", "main"]

app = typer.Typer(
    name="semsig",
    help="Tell where in a city a view was taken from the street objects in it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

DEMO_QUERIES = 200

Database = Annotated[Path, typer.Argument(help="Signature database that `semsig build` wrote.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
MethodText = Annotated[
    str,
    typer.Option(
        "--method",
        help="TYPES+ANGLES (edit, histogram, jaccard), or one part as types:edit or angles:edit; "
        "add :5% for two stages, :alpha=0.7, :raw or :weights=INSERT/DELETE/SUBSTITUTE.",
    ),
]


class CellGeometry(enum.StrEnum):
    """How `semsig export` draws a cell."""

    polygon = "polygon"
    point = "point"


class FalseClass(enum.StrEnum):
    """How the class of a false object is drawn."""

    uniform = "uniform"
    frequency = "frequency"


def main() -> None:
    """Run the command; an unusable input ends it with one sentence and exit code 2."""
    try:
        app()
    except SemsigError as error:
        remark(str(error))
        sys.exit(2)


def _version(wanted: bool) -> None:  # noqa: FBT001 - typer calls it so
    if wanted:
        typer.echo(f"semsig {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Tell where in a city a view was taken from the street objects in it."""


@app.command()
def demo(
    *,
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("demo"),
    queries: Annotated[int, typer.Option(help="Number of queries.")] = DEMO_QUERIES,
    seed: Annotated[int, typer.Option(help="Seed of the city and of the queries.")] = 0,
) -> None:
    """Run the whole road on the embedded synthetic city, without a network."""
    from semsig_gis.catalog import paper_taxonomy
    from semsig_gis.database import save_database
    from semsig_gis.evaluation import evaluate as run
    from semsig_gis.export import export_geopackage
    from semsig_gis.objects import build_objects, save_objects
    from semsig_gis.sources.synthetic import CitySpec, synthetic_city

    layers = synthetic_city(CitySpec(seed=seed))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
    save_objects(objects, out / "objects.parquet")
    remark(f"a synthetic city with {len(objects):,} street objects")
    database = _build(objects)
    save_database(database, out / "city.parquet")
    remark(f"its signature database: {len(database):,} cells")
    with progress("evaluating") as advance:
        evaluation = run(database, queries=queries, seed=seed, progress=advance)
    evaluation.save(out / "evaluation")
    with progress("drawing the map"):
        offline = _evaluation_map(evaluation, database, out / "map.html")
    with progress("writing the GeoPackage"):
        export_geopackage(database, out / "city.gpkg", objects=objects)
    _print_evaluation(evaluation)
    typer.echo(f"map:        {out / 'map.html'}  (open it in a browser)")
    typer.echo(f"GeoPackage: {out / 'city.gpkg'}  (open it in QGIS)")
    typer.echo(f"database:   {out / 'city.parquet'}")
    _tell_if_online(offline)


@app.command()
def sources(
    name: Annotated[str | None, typer.Argument(help="A catalogue, by name or .toml file.")] = None,
    *,
    as_json: AsJson = False,
) -> None:
    """List the catalogues, or the layers and classes of one."""
    import dataclasses

    from semsig_gis.catalog import catalog_names, load_catalog

    if name is None:
        catalogs = [load_catalog(known) for known in catalog_names()]
        if as_json:
            print_json(
                [{"name": c.name, "title": c.title, "layers": len(c.layers)} for c in catalogs]
            )
            return
        print_rows(
            "Catalogues",
            ("name", "title", "layers", "licence"),
            ([c.name, c.title, len(c.layers), c.license] for c in catalogs),
        )
        return
    catalog = load_catalog(name)
    if as_json:
        print_json(dataclasses.asdict(catalog))
        return
    print_rows(
        f"{catalog.title} ({catalog.url})",
        ("layer", "class", "files", "filter", "licence"),
        (
            [spec.name, _class_text(spec), ", ".join(spec.files), _filter_text(spec), spec.license]
            for spec in catalog.layers
        ),
    )
    used = {spec.class_name for spec in catalog.layers}
    used |= {
        value for spec in catalog.layers if spec.class_by for _, value in spec.class_by.classes
    }
    print_rows(
        "Classes",
        ("symbol", "code", "class", "title"),
        ([c.symbol, c.code, c.name, c.title] for c in catalog.taxonomy.classes if c.name in used),
    )


@app.command()
def load(
    files: Annotated[list[Path], typer.Argument(help="Files, or a folder that holds them.")],
    *,
    catalog: Annotated[str, typer.Option(help="Catalogue, by name or .toml file.")],
    out: Annotated[Path, typer.Option(help="Street objects to write (.parquet).")],
    layer: Annotated[
        list[str] | None, typer.Option(help="Only this layer; may be given several times.")
    ] = None,
    crs: Annotated[
        str | None, typer.Option(help="CRS of files that state none, such as EPSG:2154.")
    ] = None,
    filters: Annotated[
        bool, typer.Option("--filter/--no-filter", help="Apply the catalogue's filters.")
    ] = True,
    collapse: Annotated[
        bool, typer.Option(help="Collapse objects of a class at the same place.")
    ] = True,
    as_json: AsJson = False,
) -> None:
    """Read local files into one table of street objects."""
    from semsig_gis.catalog import load_catalog
    from semsig_gis.objects import build_objects, save_objects
    from semsig_gis.sources import find_files
    from semsig_gis.sources.vector_file import read_layer

    chosen = load_catalog(catalog)
    specs = [chosen.layer(name) for name in layer] if layer else list(chosen.layers)
    found, absent = find_files(specs, files)
    for spec in absent:
        remark(f"layer {spec.name!r} has no file here ({', '.join(spec.files)}); it is left out")
    with progress("reading") as advance:
        layers = []
        for number, (spec, file) in enumerate(found, start=1):
            layers.append(read_layer(file, spec, filters=filters, crs=crs))
            advance(number, len(found))
    objects, report = build_objects(
        layers, taxonomy=chosen.taxonomy, crs=chosen.metric_crs, collapse=collapse
    )
    save_objects(objects, out)
    if as_json:
        print_json(
            {"objects": len(objects), "crs": objects.crs.to_string(), "layers": report.to_list()}
        )
    else:
        _print_load(objects, report)
        typer.echo(f"street objects: {out}")


@app.command()
def build(
    objects: Annotated[Path, typer.Argument(help="Street objects that `semsig load` wrote.")],
    *,
    out: Annotated[Path, typer.Option(help="Signature database to write (.parquet).")],
    step: Annotated[float, typer.Option(help="Side of a cell in metres.")] = 10.0,
    radius: Annotated[float, typer.Option(help="Visibility range in metres.")] = 30.0,
    levels: Annotated[int, typer.Option(help="Number of angle levels.")] = 16,
    origin: Annotated[
        str, typer.Option(help="Corner of a cell as X,Y in metres, in the CRS of the objects.")
    ] = "0,0",
    as_json: AsJson = False,
) -> None:
    """Compute the signature of every cell that sees an object."""
    from semsig_gis.database import save_database
    from semsig_gis.grid import GridSpec
    from semsig_gis.objects import open_objects
    from semsig_gis.signatures import SignatureSpec

    corner = _numbers(origin, "--origin")
    grid = GridSpec(step, tuple(corner))  # type: ignore[arg-type] # GridSpec checks the length
    spec = SignatureSpec(radius, levels)
    database = _build(open_objects(objects), grid, spec)
    save_database(database, out)
    if as_json:
        print_json(_info(database, out))
    else:
        typer.echo(
            f"{len(database):,} cells of mean length {database.lengths.mean():.3f}, "
            f"{out.stat().st_size / 1e6:.1f} MB: {out}"
        )


@app.command()
def info(database: Database, *, as_json: AsJson = False) -> None:
    """Print the paper's tables of properties for a database."""
    from semsig_gis.database import open_database
    from semsig_gis.report import database_tables

    opened = open_database(database)
    if as_json:
        print_json(_info(opened, database))
        return
    for table in database_tables(opened, file_bytes=database.stat().st_size):
        _print_table(table)
    for line in opened.licenses:
        typer.echo(line)


@app.command()
def localize(
    database: Database,
    *,
    types: Annotated[
        str | None, typer.Option(help="Symbols clockwise from north, such as DDBL.")
    ] = None,
    bearings: Annotated[
        str | None, typer.Option(help="Degrees clockwise from north, such as 10,80,200,310.")
    ] = None,
    method: MethodText = "edit+edit",
    top: Annotated[int, typer.Option(help="Number of candidates.")] = 10,
    map_: Annotated[Path | None, typer.Option("--map", help="Map to write (.html).")] = None,
    as_json: AsJson = False,
) -> None:
    """Rank the cells of a database for one query."""
    from semsig_gis import matching
    from semsig_gis.database import open_database
    from semsig_gis.signatures import Signature

    chosen = matching.Method.parse(method)
    opened = open_database(database)
    angles = None if bearings is None else _numbers(bearings, "--bearings")
    query = Signature.parse(types, angles, taxonomy=opened.taxonomy)
    localization = matching.localize(opened, query, method=chosen, top=top)
    if map_ is not None:
        from semsig_gis.maps import localization_map, save_map

        with progress("drawing the map"):
            _tell_if_online(save_map(localization_map(localization, opened), map_))
    result = localization.to_dict()
    if as_json:
        print_json(result)
        return
    candidates = result["candidates"]
    print_rows(
        f"{len(candidates)} best of {localization.cells:,} cells, by {localization.used}",
        ("rank", "cell", "x", "y", "lon", "lat", "distance", "types"),
        (
            [
                _rank_text(row["rank_low"], row["rank_high"]),
                row["cell_id"],
                f"{row['x']:.1f}",
                f"{row['y']:.1f}",
                f"{row['lon']:.6f}",
                f"{row['lat']:.6f}",
                f"{row['distance']:.4f}",
                row["types"],
            ]
            for row in candidates
        ),
    )
    if localization.tied_beyond:
        typer.echo(f"{localization.tied_beyond:,} further cells tie with the last one.")
    if map_ is not None:
        typer.echo(f"map: {map_}")


@app.command()
def evaluate(
    database: Database,
    *,
    queries: Annotated[int, typer.Option(help="Number of queries.")] = 500,
    distortion: Annotated[str, typer.Option(help="none, light, medium or strong.")] = "medium",
    keep_order: Annotated[
        bool, typer.Option("--keep-order", help="Do not re-sort after the bearing noise.")
    ] = False,
    false_class: Annotated[
        FalseClass, typer.Option(help="How the class of a false object is drawn.")
    ] = FalseClass.uniform,
    method: MethodText = "edit+edit",
    top: Annotated[int, typer.Option(help="Number t of best candidates that count.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of all chances.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder for the results.")] = None,
    as_json: AsJson = False,
) -> None:
    """Query a database with distorted signatures of its own and measure the answers."""
    import dataclasses

    from semsig_gis.database import open_database
    from semsig_gis.distortion import named_distortion
    from semsig_gis.evaluation import evaluate as run
    from semsig_gis.matching import Method

    spec = dataclasses.replace(
        named_distortion(distortion), resort=not keep_order, false_class=false_class.value
    )
    chosen = Method.parse(method)
    with progress("evaluating") as advance:
        evaluation = run(
            open_database(database),
            queries=queries,
            method=chosen,
            distortion=spec,
            top=top,
            seed=seed,
            progress=advance,
        )
    if out is not None:
        evaluation.save(out)
    if as_json:
        print_json(evaluation.summary())
        return
    _print_evaluation(evaluation)
    if out is not None:
        typer.echo(f"results: {out}")


@app.command(name="map")
def map_(
    database: Database,
    *,
    evaluation: Annotated[Path, typer.Option(help="Folder that `semsig evaluate --out` wrote.")],
    out: Annotated[Path, typer.Option(help="Map to write (.html).")],
) -> None:
    """Draw the errors and the query locations of an evaluation."""
    from semsig_gis.database import open_database
    from semsig_gis.evaluation import Evaluation

    results = Evaluation.load(evaluation)
    with progress("drawing the map"):
        offline = _evaluation_map(results, open_database(database), out)
    typer.echo(f"map: {out}")
    _tell_if_online(offline)


@app.command()
def export(
    database: Database,
    *,
    out: Annotated[Path, typer.Option(help="GeoPackage to write (.gpkg).")],
    objects: Annotated[
        Path | None, typer.Option(help="Street objects to add as a second layer.")
    ] = None,
    geometry: Annotated[
        CellGeometry, typer.Option(help="How a cell is drawn.")
    ] = CellGeometry.polygon,
) -> None:
    """Write the cells, and the street objects, to a GeoPackage for QGIS."""
    from semsig_gis.database import open_database
    from semsig_gis.export import export_geopackage
    from semsig_gis.objects import open_objects

    opened = open_database(database)
    seen = None if objects is None else open_objects(objects)
    with progress("writing the GeoPackage"):
        export_geopackage(opened, out, objects=seen, geometry=geometry.value)
    typer.echo(f"GeoPackage: {out}")


def _build(
    objects: StreetObjects, grid: GridSpec | None = None, spec: SignatureSpec | None = None
) -> SignatureDatabase:
    from semsig_gis.database import build_database

    with progress("building") as advance:
        return build_database(objects, grid=grid, spec=spec, progress=advance)


def _evaluation_map(evaluation: Evaluation, database: SignatureDatabase, out: Path) -> bool:
    from semsig_gis.maps import evaluation_map, save_map

    return save_map(evaluation_map(evaluation, database), out)


def _info(database: SignatureDatabase, file: Path) -> dict[str, Any]:
    from semsig_gis.report import database_summary

    return database_summary(database, file_bytes=file.stat().st_size)


def _numbers(text: str, option: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")] if text.strip() else []
    except ValueError as error:
        msg = f"{option} was given as {text!r}; give numbers with commas between them."
        raise InputError(msg) from error


def _class_text(spec: LayerSpec) -> str:
    if spec.class_by is None:
        return spec.class_name
    others = dict.fromkeys(name for _, name in spec.class_by.classes)
    return f"{spec.class_name} ({', '.join(others)} by {spec.class_by.field})"


def _filter_text(spec: LayerSpec) -> str:
    return " and ".join(
        f"{field} = {' or '.join(map(str, accepted))}" for field, accepted in spec.where
    )


def _rank_text(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}-{high}"


def _tell_if_online(offline: bool) -> None:  # noqa: FBT001
    if not offline:
        remark("the map takes Leaflet from the web, so it needs a network to be seen")


def _print_load(objects: StreetObjects, report: LoadReport) -> None:
    print_rows(
        f"{len(objects):,} street objects in {objects.crs.name}",
        ("layer", "read", "unreadable", "filtered", "missing", "misplaced", "collapsed", "kept"),
        (
            [
                part.name,
                part.read,
                part.unreadable,
                part.filtered,
                part.missing,
                part.misplaced,
                part.collapsed,
                part.kept,
            ]
            for part in report.layers
        ),
    )
    for part in report.layers:
        for note in part.notes:
            remark(f"{part.name}: {note}")


def _print_evaluation(evaluation: Evaluation) -> None:
    from semsig_gis.report import evaluation_tables

    for table in evaluation_tables(evaluation):
        _print_table(table)


def _print_table(table: Table) -> None:
    print_rows(table.title, table.columns, table.rows)
    if table.note:
        typer.echo(table.note)


if __name__ == "__main__":
    main()
