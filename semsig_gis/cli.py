"""The `semsig` command: argument parsing and printing, nothing else.

Results go to standard output, progress and remarks to standard error. The exit code is 0 when the
work is done, 2 when the input cannot be used (with one plain sentence), 1 when the fault is ours.
Heavy modules are imported by the commands that need them, so that the help appears at once.
"""

from __future__ import annotations

import enum
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from semsig_gis import __version__
from semsig_gis.console import print_json, print_rows, progress, remark
from semsig_gis.errors import InputError, SemsigError

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.grid import GridSpec
    from semsig_gis.layer_spec import LayerSpec
    from semsig_gis.loading import Loaded
    from semsig_gis.objects import StreetObjects
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
Catalogs = Annotated[
    list[str],
    typer.Option(help="Catalogue, by name or .toml file; several are merged, best source first."),
]
Objects = Annotated[Path, typer.Option(help="Street objects to write (.parquet).")]
Layers = Annotated[
    list[str] | None,
    typer.Option(help="Only this layer, optional ones too; may be given several times."),
]
MetricCrs = Annotated[
    str | None,
    typer.Option(help="CRS in metres to work in; the catalogue's or the UTM zone by default."),
]
Filters = Annotated[
    bool, typer.Option("--filter/--no-filter", help="Apply the catalogue's filters.")
]
Collapse = Annotated[bool, typer.Option(help="Collapse objects of a class at the same place.")]
Merge = Annotated[
    bool, typer.Option(help="Merge objects of different layers within the catalogue's radii.")
]
Buildings = Annotated[
    Path | None, typer.Option(help="Building footprints to write too (.parquet).")
]
Streets = Annotated[
    Path | None, typer.Option(help="Centre lines of streets to write too (.parquet).")
]
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


class Viewpoints(enum.StrEnum):
    """Which cells `semsig build` looks from."""

    all = "all"
    outdoor = "outdoor"
    streets = "streets"


class FalseClass(enum.StrEnum):
    """How the class of a false object is drawn."""

    uniform = "uniform"
    frequency = "frequency"


def main() -> None:
    """Run the command; an unusable input ends it with one sentence and exit code 2."""
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        try:
            app()
        except SemsigError as error:
            remark(str(error))
            sys.exit(2)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Show a warning as one sentence, without the line of code that it comes from."""
    remark(str(message))


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
    from semsig_gis.database_file import save_database
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
    name: Annotated[
        str | None, typer.Argument(help="A catalogue, by name or .toml file; or `suggest`.")
    ] = None,
    file: Annotated[
        Path | None, typer.Argument(help="With `suggest`: a file to draft a catalogue for.")
    ] = None,
    *,
    as_json: AsJson = False,
) -> None:
    """List the catalogues and readers, or the layers of one; `suggest FILE` drafts a new one."""
    import dataclasses

    from semsig_gis.catalog import catalog_names, load_catalog
    from semsig_gis.plugins import installed_readers
    from semsig_gis.sources import READERS

    if name == "suggest":
        from semsig_gis.suggest import suggest_catalog

        if file is None:
            msg = "`semsig sources suggest` needs a file; give the path of a vector file."
            raise InputError(msg)
        typer.echo(suggest_catalog(file), nl=False)
        return
    if file is not None:
        msg = f"{file} was given after {name!r}; only `semsig sources suggest` takes a file."
        raise InputError(msg)
    if name is None:
        catalogs = [load_catalog(known) for known in catalog_names()]
        readers = sorted({*READERS, *installed_readers(taken=READERS)})
        listed = [
            {"name": c.name, "title": c.title, "layers": len(c.layers), "reader": c.reader}
            for c in catalogs
        ]
        if as_json:
            print_json({"catalogs": listed, "readers": readers})
            return
        print_rows(
            "Catalogues",
            ("name", "title", "layers", "reader", "licence"),
            ([*row.values(), c.license] for row, c in zip(listed, catalogs, strict=True)),
        )
        typer.echo(f"readers: {', '.join(readers)}")
        return
    catalog = load_catalog(name)
    if as_json:
        print_json(dataclasses.asdict(catalog))
        return
    print_rows(
        f"{catalog.title} ({catalog.url})",
        ("layer", "class", "from", "filter", "licence", "note"),
        (
            [
                f"{spec.name} (optional)" if spec.optional else spec.name,
                _class_text(spec),
                _origin_text(spec),
                _filter_text(spec),
                spec.license,
                spec.note,
            ]
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
    catalog: Catalogs,
    out: Objects,
    layer: Layers = None,
    crs: Annotated[
        str | None, typer.Option(help="CRS of files that state none, such as EPSG:2154.")
    ] = None,
    metric_crs: MetricCrs = None,
    filters: Filters = True,
    collapse: Collapse = True,
    merge: Merge = True,
    buildings: Buildings = None,
    streets: Streets = None,
    as_json: AsJson = False,
) -> None:
    """Read local files into one table of street objects."""
    from semsig_gis.catalog import load_catalog
    from semsig_gis.loading import assemble, choose_layers, combine_catalogs, read_files

    chosen = combine_catalogs([load_catalog(name) for name in catalog])
    specs = choose_layers(chosen, layer or (), surroundings=bool(buildings or streets))
    with progress("reading") as advance:
        layers, absent = read_files(specs, files, filters=filters, crs=crs, progress=advance)
    for spec in absent:
        remark(f"layer {spec.name!r} has no file here ({', '.join(spec.files)}); it is left out")
    loaded = assemble(layers, chosen, metric_crs=metric_crs, collapse=collapse, merge=merge)
    _save_loaded(loaded, out, buildings, streets, as_json=as_json)


@app.command()
def fetch(
    catalog: Annotated[str, typer.Argument(help="Catalogue with a service, by name or .toml.")],
    *,
    area: Annotated[
        str,
        typer.Option(help="WEST,SOUTH,EAST,NORTH in degrees, a polygon file, or a place name."),
    ],
    out: Objects,
    layer: Layers = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of the cache; semsig's own by default.")
    ] = None,
    offline: Annotated[
        bool, typer.Option("--offline", help="Take everything from the cache.")
    ] = False,
    metric_crs: MetricCrs = None,
    filters: Filters = True,
    collapse: Collapse = True,
    merge: Merge = True,
    buildings: Buildings = None,
    streets: Streets = None,
    as_json: AsJson = False,
) -> None:
    """Download an area from the service of a catalogue into one table of street objects."""
    from semsig_gis.catalog import load_catalog
    from semsig_gis.loading import assemble, choose_layers, fetch_layers, find_area, open_cache

    chosen = load_catalog(catalog)
    specs = choose_layers(chosen, layer or (), surroundings=bool(buildings or streets))
    kept, http = open_cache(cache, offline=offline)
    unit: Literal["steps", "bytes"] = "steps" if chosen.reader == "osm_file" else "bytes"
    with progress("fetching", unit=unit) as advance:
        place = find_area(area, chosen, cache=kept, http=http)
        layers = fetch_layers(
            specs,
            chosen,
            area=place,
            cache=kept,
            http=http,
            filters=filters,
            progress=advance,
            tell=remark,
        )
    loaded = assemble(layers, chosen, metric_crs=metric_crs, collapse=collapse, merge=merge)
    _save_loaded(loaded, out, buildings, streets, as_json=as_json)


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
    buildings: Annotated[
        Path | None, typer.Option(help="Building footprints: what they hide is not seen.")
    ] = None,
    streets: Annotated[Path | None, typer.Option(help="Centre lines of streets.")] = None,
    viewpoints: Annotated[
        Viewpoints,
        typer.Option(help="Every cell, those outside --buildings, or those along --streets."),
    ] = Viewpoints.all,
    street_width: Annotated[
        float, typer.Option(help="How far from a centre line a street reaches, in metres.")
    ] = 8.0,
    area: Annotated[Path | None, typer.Option(help="Polygons that the cells must lie in.")] = None,
    as_json: AsJson = False,
) -> None:
    """Compute the signature of every cell that sees an object."""
    from semsig_gis.database_file import save_database
    from semsig_gis.grid import GridSpec
    from semsig_gis.objects import open_objects
    from semsig_gis.signatures import SignatureSpec
    from semsig_gis.surroundings import read_area, read_surroundings
    from semsig_gis.viewpoints import ViewpointSpec

    corner = _numbers(origin, "--origin")
    grid = GridSpec(step, tuple(corner))  # type: ignore[arg-type] # GridSpec checks the length
    spec = SignatureSpec(radius, levels)
    if streets is not None and viewpoints is not Viewpoints.streets:
        msg = "--streets was given, which only --viewpoints streets uses; give both or none."
        raise InputError(msg)
    opened = open_objects(objects)
    crs = opened.crs
    where = ViewpointSpec(
        mode=viewpoints.value,
        width=street_width,
        area=None if area is None else read_area(area, crs=crs),
    )
    houses = None if buildings is None else read_surroundings(buildings, role="buildings", crs=crs)
    lines = None if streets is None else read_surroundings(streets, role="streets", crs=crs)
    if houses is not None and (invalid := int((~houses.is_valid).sum())):
        remark(f"{invalid} building footprints in {buildings} are invalid polygons; repaired here")
    database = _build(opened, grid, spec, viewpoints=where, footprints=houses, streets=lines)
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
    from semsig_gis.database_file import open_database
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
    from semsig_gis.database_file import open_database
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

    from semsig_gis.database_file import open_database
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
    from semsig_gis.database_file import open_database
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
    from semsig_gis.database_file import open_database
    from semsig_gis.export import export_geopackage
    from semsig_gis.objects import open_objects

    opened = open_database(database)
    seen = None if objects is None else open_objects(objects)
    with progress("writing the GeoPackage"):
        export_geopackage(opened, out, objects=seen, geometry=geometry.value)
    typer.echo(f"GeoPackage: {out}")


def _build(
    objects: StreetObjects,
    grid: GridSpec | None = None,
    spec: SignatureSpec | None = None,
    **surroundings: Any,  # noqa: ANN401 - as build_database takes them
) -> SignatureDatabase:
    from semsig_gis.building import build_database

    with progress("building") as advance:
        return build_database(objects, grid=grid, spec=spec, progress=advance, **surroundings)


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
        return spec.class_name or spec.role
    others = dict.fromkeys(name for _, name in spec.class_by.classes)
    return f"{spec.class_name} ({', '.join(others)} by {spec.class_by.field})"


def _origin_text(spec: LayerSpec) -> str:
    """Say what a layer is made from: tags, a dataset of a portal, or files."""
    if spec.tags:
        return " or ".join(
            " and ".join(f"{key}={'/'.join(values)}" for key, values in tags) for tags in spec.tags
        )
    files = ", ".join(spec.files)
    return files if spec.dataset is None else f"{spec.dataset} ({files})"


def _filter_text(spec: LayerSpec) -> str:
    return " and ".join(
        f"{field} = {' or '.join(map(str, accepted))}" for field, accepted in spec.where
    )


def _rank_text(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}-{high}"


def _tell_if_online(offline: bool) -> None:  # noqa: FBT001
    if not offline:
        remark("the map takes Leaflet from the web, so it needs a network to be seen")


def _save_loaded(
    loaded: Loaded, out: Path, buildings: Path | None, streets: Path | None, *, as_json: bool
) -> None:
    from semsig_gis.objects import save_objects
    from semsig_gis.quality import quality_report
    from semsig_gis.storage import whole_file

    report = quality_report(loaded.objects, loaded.report, loaded.conflation)
    save_objects(loaded.objects, out)
    for table, path in ((loaded.buildings, buildings), (loaded.streets, streets)):
        if table is not None and path is not None:
            with whole_file(path) as partial:
                table.to_parquet(partial)
    for note in loaded.notes:
        remark(note)
    if as_json:
        print_json(report.to_dict())
        return
    for title, columns, rows, remarks in report.tables():
        print_rows(title, columns, rows)
        if remarks:
            typer.echo(remarks)
    typer.echo(f"street objects: {out}")


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
