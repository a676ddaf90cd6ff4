"""Load street objects, buildings and streets from files: find the catalogue, read, clip, join."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import InputError
from semsig_gis.objects.extent import MAX_DISTORTION
from semsig_gis.objects.layers import assemble, choose_layers, read_files
from semsig_gis.objects.skipped_layers import layers_in_same_extracts, read_small_layers
from semsig_gis.sources import (
    BOX,
    NO_CLIP,
    Catalog,
    clip_layers,
    clip_to_extents,
    combine_catalogs,
    detect_catalogs,
    load_catalog,
    parse_area,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from semsig_gis.core import AnyCrs
    from semsig_gis.objects.layers import Loaded, Selection


AT_THE_EDGE = (
    "cells within sight of the edge of the clip see only a part of what is there; give `semsig "
    "build` an --area that is smaller by the visibility range"
)


def load(
    files: str | Path | Iterable[str | Path],
    *,
    catalog: str | Path | Catalog | Iterable[str | Path | Catalog] = (),
    layers: Sequence[str] = (),
    selection: Selection = "default",
    surroundings: bool = True,
    clip: str | None = None,
    crs: AnyCrs | None = None,
    metric_crs: AnyCrs | None = None,
    filters: bool = True,
    collapse: bool = True,
    merge: bool = True,
    max_distortion: float = MAX_DISTORTION,
    progress: Callable[[int, int], None] | None = None,
    remark: Callable[[str], None] | None = None,
) -> Loaded:
    """Load street objects, buildings and streets from files, as `semsig load` does.

    Parameters
    ----------
    files : str, Path or several of them
        Files, and folders with files.
    catalog : str, Path, Catalog or several of them, optional
        Name, ``.toml`` file or value of the catalogue that says what the files contain; of several,
        the best first. Files of OpenStreetMap and Overture need none.
    layers, selection : optional
        The layers to read, as in `choose_layers`.
    surroundings : bool, default True
        Whether buildings and streets are read as well, from files that have them.
    clip : str, optional
        Area to keep: ``west,south,east,north`` in degrees, the path of a file with polygons,
        ``"box"`` for the box that OpenStreetMap files state, or ``"none"`` for everything. By
        default, each of these files is cut to its box if it states one. Rows far from all others
        are left out, unless an area or ``"none"`` is given.
    crs : int, str or pyproj.CRS, optional
        CRS of files that do not state one, such as 2154, its EPSG code.
    metric_crs : int, str or pyproj.CRS, optional
        Metric CRS of the result; by default that of the catalogue, or else the UTM zone.
    filters : bool, default True
        Whether the filters of the layers are applied.
    collapse, merge, max_distortion : optional
        As in `assemble`.
    progress : callable, optional
        Called with the number of files read and the total.
    remark : callable, optional
        Called with a sentence on each file with a catalogue that was found by its contents.

    Returns
    -------
    Loaded
        The street objects, buildings and streets, with the counts of rows.

    Raises
    ------
    InputError
        If a file does not say what it contains and no catalogue is given, or the area is not valid.
    SourceError
        If a file does not exist, matches no layer, or cannot be read.
    UnknownNameError
        If there is no catalogue or layer of this name.
    CrsError
        As in `assemble`.
    EmptyResultError
        If no object remains.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> bench = '<node id="1" lat="48.85" lon="2.35"><tag k="amenity" v="bench"/></node>'
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "town.osm")
    ...     size = file.write_text(f'<osm version="0.6">{bench}</osm>')
    ...     loaded = load(file, metric_crs=32631)
    >>> len(loaded.objects), loaded.objects.crs.to_epsg()
    (1, 32631)
    """
    paths = [Path(files)] if isinstance(files, str | Path) else list(map(Path, files))
    if not paths:
        raise InputError("no file was given; give one or more.")
    several = [catalog] if isinstance(catalog, str | Path | Catalog) else list(catalog)
    if not several:
        names, lines = detect_catalogs(paths)
        several = list(names)
        if remark is not None:
            for line in lines:
                remark(line)
    merged = combine_catalogs(
        [item if isinstance(item, Catalog) else load_catalog(item) for item in several]
    )
    specs = choose_layers(merged, layers, selection=selection, surroundings=surroundings)
    # Layers in files read anyway: their objects are counted, to say what is left out.
    others = layers_in_same_extracts(merged, specs)
    raw, absent = read_files(
        [*specs, *others],
        paths,
        filters=filters,
        crs=crs,
        area=None if clip in {None, BOX, NO_CLIP} else parse_area(clip),
        progress=progress,
    )
    raw += read_small_layers(merged, [*specs, *others], paths, filters=filters, crs=crs)
    notes = [
        f"layer {spec.name!r} has no file here ({', '.join(spec.files) or 'it names none'}); "
        "it is left out"
        for spec in absent
        if spec not in others and spec.role == "objects"
    ]
    if clip is None:
        raw, clipped = clip_to_extents(raw)
        notes += [clipped] if clipped else []
    elif clip != NO_CLIP:
        raw = clip_layers(raw, clip)
        notes.append(AT_THE_EDGE)
    return assemble(
        [layer for layer in raw if layer.spec in specs],
        merged,
        metric_crs=metric_crs,
        collapse=collapse,
        merge=merge,
        counted=[layer for layer in raw if layer.spec not in specs],
        max_distortion=max_distortion,
        keep_far=clip not in {None, BOX},  # the user says where the data is
        notes=notes,
    )
