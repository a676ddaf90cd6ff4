"""`semsig sources`: which catalogues there are and what is in them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semsig_gis.cli._app import AsJson, app
from semsig_gis.console import print_json, print_rows
from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from semsig_gis.layer_spec import LayerSpec


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
