"""`semsig load` and `semsig fetch`: open data become street objects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from semsig_gis.cli._app import AsJson, app, keep_inputs, print_report, require_suffix
from semsig_gis.console import progress, remark

if TYPE_CHECKING:
    from semsig_gis.loading import Loaded


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
    from semsig_gis.catalog import combine_catalogs, load_catalog
    from semsig_gis.loading import assemble, choose_layers, read_files

    keep_inputs(out, buildings, streets, read=[*files, *catalog])
    require_suffix(".parquet", out, buildings, streets)
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
    from semsig_gis.fetching import fetch_layers, find_area, open_cache
    from semsig_gis.loading import assemble, choose_layers

    keep_inputs(out, buildings, streets, read=(catalog, area))
    require_suffix(".parquet", out, buildings, streets)
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


def _save_loaded(
    loaded: Loaded, out: Path, buildings: Path | None, streets: Path | None, *, as_json: bool
) -> None:
    from semsig_gis.objects import save_objects
    from semsig_gis.quality import quality_report
    from semsig_gis.surroundings import save_surroundings

    report = quality_report(loaded.objects, loaded.report, loaded.conflation)
    save_objects(loaded.objects, out)
    for what, table, path in (
        ("buildings", loaded.buildings, buildings),
        ("streets", loaded.streets, streets),
    ):
        if path is not None and table is None:
            remark(f"there are no {what} in what was loaded, so {path} is not written")
        elif path is not None:
            save_surroundings(table, path)
    for note in loaded.notes:
        remark(note)
    print_report(report, as_json=as_json)
    if not as_json:
        typer.echo(f"street objects: {out}")
