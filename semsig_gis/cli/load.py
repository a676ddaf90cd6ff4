"""`semsig load`, `fetch`, `draft` and `sources`: street objects from open data."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal
from urllib.parse import urlsplit

import typer

from semsig_gis.cli.console import (
    AsJson,
    app,
    keep_inputs,
    print_json,
    print_rows,
    print_tables,
    progress,
    remark,
    require_suffix,
    say,
)
from semsig_gis.core import InputError

if TYPE_CHECKING:
    from semsig_gis.objects import Loaded, Selection
    from semsig_gis.sources import Catalog, LayerSpec, Rules


def _catalogs(incomplete: str) -> list[str]:
    """Return the names of catalogues with this beginning, for completion in a shell."""
    from semsig_gis.sources import catalog_names

    return [name for name in catalog_names() if name.startswith(incomplete)]


Objects = Annotated[Path, typer.Option(help="Street objects to write (.parquet).")]
Layers = Annotated[
    list[str] | None,
    typer.Option(help="Read only this layer, or with +NAME also this one; may be repeated."),
]
AllLayers = Annotated[
    bool, typer.Option("--all-layers", help="Read the optional layers of objects as well.")
]
PaperClasses = Annotated[
    bool, typer.Option("--paper-classes", help="Read only the eleven classes of the paper.")
]
MetricCrs = Annotated[
    str | None,
    typer.Option(help="CRS in metres to work in; default: the catalogue's or the UTM zone."),
]
MaxDistortion = Annotated[
    float,
    typer.Option(
        min=0,
        max=180,
        help="Largest distortion allowed for the CRS: degrees of bearings, percent of lengths.",
    ),
]
Filters = Annotated[
    bool, typer.Option("--filter/--no-filter", help="Apply the catalogue's filters.")
]
Collapse = Annotated[bool, typer.Option(help="Collapse objects of a class at the same place.")]
Merge = Annotated[
    bool, typer.Option(help="Merge objects of different layers within the catalogue's radii.")
]
Buildings = Annotated[
    Path | None, typer.Option(help="Building footprints to write as well (.parquet).")
]
Streets = Annotated[
    Path | None, typer.Option(help="Centre lines of streets to write as well (.parquet).")
]
AT_THE_EDGE = (
    "cells within sight of the edge of the clip see only a part of what is there; give `semsig "
    "build` an --area that is smaller by the visibility range"
)


@app.command()
def load(
    files: Annotated[list[Path], typer.Argument(help="Files, or a folder of files.")],
    *,
    names: Annotated[
        list[str] | None,
        typer.Option(
            "--catalog",
            autocompletion=_catalogs,
            help="Catalogue, by name or .toml file; not needed for OpenStreetMap and "
            "Overture. Repeat to merge several, best first.",
        ),
    ] = None,
    out: Objects,
    layer: Layers = None,
    all_layers: AllLayers = False,
    paper_classes: PaperClasses = False,
    crs: Annotated[
        str | None,
        typer.Option(help="CRS of files that do not state their own, such as EPSG:2154."),
    ] = None,
    metric_crs: MetricCrs = None,
    clip: Annotated[
        str | None,
        typer.Option(
            help="Keep only what is in WEST,SOUTH,EAST,NORTH in degrees, in the polygons of a "
            "file, or with 'box' in the area that OpenStreetMap files state."
        ),
    ] = None,
    max_distortion: MaxDistortion = 6.0,
    filters: Filters = True,
    collapse: Collapse = True,
    merge: Merge = True,
    buildings: Buildings = None,
    streets: Streets = None,
    as_json: AsJson = False,
) -> None:
    """Read files of open data into street objects."""
    from semsig_gis.objects import (
        assemble,
        choose_layers,
        layers_in_same_extracts,
        read_files,
        read_small_layers,
    )
    from semsig_gis.sources import (
        BOX,
        clip_layers,
        combine_catalogs,
        detect_catalogs,
        load_catalog,
        parse_area,
    )

    keep_inputs(out, buildings, streets, read=[*files, *(names or ()), clip])
    require_suffix(".parquet", out, buildings, streets)
    if not names:
        detected, lines = detect_catalogs(files)
        names = list(detected)
        for line in lines:
            remark(line)
    catalog = combine_catalogs([load_catalog(name) for name in names])
    specs = choose_layers(
        catalog,
        layer or (),
        selection=_selection(all_layers=all_layers, paper_classes=paper_classes),
        surroundings=bool(buildings or streets),
    )
    # Layers that are in files read anyway: their objects are counted, to say what is left out.
    others = layers_in_same_extracts(catalog, specs)
    with progress("reading") as advance:
        layers, absent = read_files(
            [*specs, *others],
            files,
            filters=filters,
            crs=crs,
            area=None if clip in {None, BOX} else parse_area(clip),
            progress=advance,
        )
        layers += read_small_layers(catalog, [*specs, *others], files, filters=filters, crs=crs)
    notes = [
        f"layer {spec.name!r} has no file here ({', '.join(spec.files) or 'it names none'}); it is "
        "left out"
        for spec in absent
        if spec not in others
    ]
    if clip is not None:
        layers = clip_layers(layers, clip)
        notes.append(AT_THE_EDGE)
    with progress("joining the objects"):
        loaded = assemble(
            [layer for layer in layers if layer.spec in specs],
            catalog,
            metric_crs=metric_crs,
            collapse=collapse,
            merge=merge,
            counted=[layer for layer in layers if layer.spec not in specs],
            max_distortion=max_distortion,
            notes=notes,
        )
    _save_loaded(loaded, out, buildings, streets, as_json=as_json)


@app.command()
def fetch(
    name: Annotated[
        str,
        typer.Argument(
            metavar="catalog",
            autocompletion=_catalogs,
            help="Catalogue with a service, by name or .toml.",
        ),
    ],
    *,
    area: Annotated[
        str,
        typer.Option(help="WEST,SOUTH,EAST,NORTH in degrees, a polygon file, or a place name."),
    ],
    out: Objects,
    layer: Layers = None,
    all_layers: AllLayers = False,
    paper_classes: PaperClasses = False,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of the cache; default: semsig's own.")
    ] = None,
    offline: Annotated[bool, typer.Option("--offline", help="Use the cache only.")] = False,
    timeout: Annotated[
        float,
        typer.Option(
            min=1.0,
            max=86_400.0,
            help="Give up a download after this many seconds, all attempts together.",
        ),
    ] = 600.0,
    server: Annotated[
        str | None, typer.Option(help="Address of a server to use instead of the catalogue's.")
    ] = None,
    metric_crs: MetricCrs = None,
    max_distortion: MaxDistortion = 6.0,
    filters: Filters = True,
    collapse: Collapse = True,
    merge: Merge = True,
    buildings: Buildings = None,
    streets: Streets = None,
    as_json: AsJson = False,
) -> None:
    """Download the street objects of an area."""
    from semsig_gis.objects import assemble, choose_layers
    from semsig_gis.sources import fetch_layers, find_area, load_catalog, open_cache

    keep_inputs(out, buildings, streets, read=(name, area))
    require_suffix(".parquet", out, buildings, streets)
    catalog = load_catalog(name)
    if server is not None:
        if not server.startswith(("http://", "https://")):
            raise InputError(f"--server is {server!r}; give an address that begins with https://.")
        catalog = replace(catalog, endpoints=(server,))
    specs = choose_layers(
        catalog,
        layer or (),
        selection=_selection(all_layers=all_layers, paper_classes=paper_classes),
        surroundings=bool(buildings or streets),
    )
    store, http = open_cache(cache, offline=offline, deadline_s=timeout, tell=remark)
    unit: Literal["steps", "bytes"] = "bytes" if catalog.reader == "opendatasoft" else "steps"
    hosts = ", ".join(dict.fromkeys(urlsplit(url).netloc for url in catalog.endpoints))
    if not offline:
        layers_ = f"{len(specs)} layer{'' if len(specs) == 1 else 's'}"
        remark(f"asking {hosts} for {layers_} of {area}, attempt 1 of {http.attempts}")
    with progress(f"fetching from {hosts}", unit=unit) as advance:
        place = find_area(area, catalog, cache=store, http=http)
        layers = fetch_layers(
            specs,
            catalog,
            area=place,
            cache=store,
            http=http,
            filters=filters,
            progress=advance,
            tell=remark,
        )
    with progress("joining the objects"):
        loaded = assemble(
            layers,
            catalog,
            metric_crs=metric_crs,
            collapse=collapse,
            merge=merge,
            max_distortion=max_distortion,
        )
    _save_loaded(loaded, out, buildings, streets, as_json=as_json)


def _selection(*, all_layers: bool, paper_classes: bool) -> Selection:
    if all_layers and paper_classes:
        raise InputError("--all-layers and --paper-classes are both given; give one of them.")
    return "all" if all_layers else "paper" if paper_classes else "default"


def _save_loaded(
    loaded: Loaded, out: Path, buildings: Path | None, streets: Path | None, *, as_json: bool
) -> None:
    from semsig_gis.objects import quality_report, save_objects, save_surroundings

    notes = list(loaded.notes)
    save_objects(loaded.objects, out)
    for what, table, path in (
        ("buildings", loaded.buildings, buildings),
        ("streets", loaded.streets, streets),
    ):
        if path is not None and table is None:
            notes.append(f"there are no {what} in what was loaded, so {path} is not written")
        elif path is not None:
            save_surroundings(table, path)
    report = quality_report(loaded.objects, loaded.report, loaded.conflation, notes=notes)
    if as_json:
        print_json(report.to_dict())
    else:
        from semsig_gis.output import quality_tables

        # The notes are printed below the tables only.
        print_tables(quality_tables(replace(report, notes=())))
        say(f"street objects: {out}")
    for note in notes:
        remark(note)


@app.command()
def draft(
    file: Annotated[Path, typer.Argument(help="Vector file to draft a catalogue for.")],
    *,
    crs: Annotated[
        str | None,
        typer.Option(help="CRS of a file that does not state its own, such as EPSG:2154."),
    ] = None,
) -> None:
    """Draft a catalogue for a vector file, for you to edit."""
    from semsig_gis.objects import draft_catalog

    say(draft_catalog(file, crs=crs), end="")


@app.command()
def sources(
    name: Annotated[
        str | None,
        typer.Argument(
            autocompletion=_catalogs, help="Catalogue, by name or .toml file; default: list all."
        ),
    ] = None,
    *,
    as_json: AsJson = False,
) -> None:
    """List the catalogues, or the layers of one."""
    import dataclasses

    from semsig_gis.core import installed_readers
    from semsig_gis.sources import READERS, catalog_names, load_catalog

    if name is None:
        catalogs = [load_catalog(catalog_name) for catalog_name in catalog_names()]
        readers = sorted({*READERS, *installed_readers(reserved=READERS)})
        if as_json:
            print_json({"catalogs": [_listed(c) for c in catalogs], "readers": readers})
            return
        print_rows(
            "Catalogues",
            ("name", "place", "needs", "classes", "layers", "reader", "licence"),
            (
                [
                    c.name,
                    c.place,
                    _needs_text(c),
                    "".join(item.symbol for item in c.classes),
                    len(c.layers),
                    c.reader,
                    c.license,
                ]
                for c in catalogs
            ),
        )
        symbols = {item.symbol: item.name for c in catalogs for item in c.classes}
        say(f"classes: {', '.join(f'{symbol} {name}' for symbol, name in symbols.items())}")
        say(f"readers: {', '.join(readers)}")
        return
    catalog = load_catalog(name)
    if as_json:
        print_json(dataclasses.asdict(catalog))
        return
    # An exclusion that all layers of objects share is printed once.
    rules = {spec.exclusions for spec in catalog.layers if spec.role == "objects"}
    common = rules.pop() if len(rules) == 1 else ()
    print_rows(
        f"{catalog.title} ({catalog.url})",
        ("layer", "class", "from", "filter", "licence", "note"),
        (
            [
                f"{spec.name} (optional)" if spec.optional else spec.name,
                _class_text(spec),
                _origin_text(spec),
                _filter_text(spec, common),
                spec.license,
                spec.note,
            ]
            for spec in catalog.layers
        ),
    )
    say(f"place: {catalog.place or 'not stated'}; needs {_needs_text(catalog)}")
    if common:
        say(f"left out of every layer of objects: {', '.join(_rules(common))}")
    print_rows(
        "Classes",
        ("symbol", "code", "class", "title"),
        ([c.symbol, c.code, c.name, c.title] for c in catalog.classes),
    )


def _listed(catalog: Catalog) -> dict[str, object]:
    """Return the row of a catalogue in `semsig sources --json`."""
    live = bool(catalog.endpoints)
    return {
        "name": catalog.name,
        "title": catalog.title,
        "place": catalog.place,
        "needs": {"files": not live, "network": live, "area": live, "token": catalog.token},
        "classes": [item.name for item in catalog.classes],
        "layers": len(catalog.layers),
        "reader": catalog.reader,
        "license": catalog.license,
    }


def _needs_text(catalog: Catalog) -> str:
    """Return the inputs that a catalogue needs, as text."""
    if not catalog.endpoints:
        return "files"
    if catalog.token is None:
        return "files, or an area and the network"
    state = "set" if os.environ.get(catalog.token) else "not set"
    return f"files, or an area, the network and a token ({catalog.token}, {state})"


def _class_text(spec: LayerSpec) -> str:
    by = f" (by {spec.class_by.field})" if spec.class_by else ""
    return f"{', '.join(spec.classes)}{by}" if spec.classes else spec.role


def _origin_text(spec: LayerSpec) -> str:
    """Return the origin of a layer: tags, a dataset of a portal, or files."""
    if spec.tags:
        tags = " or ".join(
            " and ".join(f"{key}={'/'.join(values)}" for key, values in tags) for tags in spec.tags
        )
        return tags if spec.dataset is None else f"{spec.dataset}: {tags}"
    files, dataset = ", ".join(spec.files), spec.dataset or spec.server_where
    return files if dataset is None else f"{dataset} ({files})"


def _filter_text(spec: LayerSpec, common: Rules) -> str:
    exclusions = spec.exclusions if spec.exclusions != common else ()
    return " and ".join([*_rules(spec.where), *(f"not {rule}" for rule in _rules(exclusions))])


def _rules(rules: Rules) -> list[str]:
    return [f"{field} = {' or '.join(map(str, accepted))}" for field, accepted in rules]
