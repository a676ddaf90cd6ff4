"""`semsig view`: convert the output of object detectors to queries for the other commands."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from semsig_gis.cli.console import (
    AsJson,
    app,
    keep_inputs,
    print_json,
    progress,
    remark,
    require_suffix,
    say,
)
from semsig_gis.core import InputError

if TYPE_CHECKING:
    from semsig_gis.core import Taxonomy
    from semsig_gis.observation import Tally

MOST_NAMES = 8
NAME_SUFFIXES = frozenset({".txt", ".names", ".yaml", ".yml", ".json"})


@app.command()
def view(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Detections: COCO, Label Studio, LabelMe, VIA, Supervisely, BDD100K, Mapillary or "
            "Panoramax JSON, CVAT or Pascal VOC XML, YOLO .txt with data.yaml, KITTI .txt, CSV of "
            "Roboflow; or a folder. With --detector: photographs, or folders of them."
        ),
    ],
    *,
    out: Annotated[Path, typer.Option(help="Views to write (.jsonl), for --queries.")],
    detector: Annotated[
        Path | None,
        typer.Option(
            help="Object detector (.onnx) to run on photographs: YOLO, RT-DETR, DETR or "
            "torchvision.  (needs the extra detect)"
        ),
    ] = None,
    labels: Annotated[
        list[str] | None,
        typer.Option(
            help="Map from labels to classes: coco, mapillary_vistas, cityscapes, panoramax or a "
            ".toml file; repeat for several, best first.  [default: the four]  With --detector "
            "also the names of its classes: coco, or a .txt, .yaml or .json file.  [default: from "
            "the model]"
        ),
    ] = None,
    database: Annotated[
        Path | None,
        typer.Option(
            help="Signature database to localize in; labels are mapped to its classes.  "
            "[default: the classes of all built-in catalogues]"
        ),
    ] = None,
    images: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the pictures, to read focal length and heading from EXIF.  "
            "[default: the folder of the files, or the one of images next to it]"
        ),
    ] = None,
    photos: Annotated[
        Path | None,
        typer.Option(
            help="Camera data of single pictures: a CSV or JSON lines file with image and any of "
            "camera, fov, heading, heading_error, pitch, roll and place."
        ),
    ] = None,
    camera: Annotated[
        Literal["pinhole", "equirectangular", "cylindrical", "fisheye"] | None,
        typer.Option(help="Projection of the pictures.  [default: pinhole]"),
    ] = None,
    fov: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=360,
            help="Horizontal field of view in degrees.  [default: from EXIF; 360 for a panorama]",
        ),
    ] = None,
    heading: Annotated[
        float | None,
        typer.Option(
            min=-360,
            max=360,
            help="Direction of the camera, clockwise from north; default: from EXIF.",
        ),
    ] = None,
    heading_error: Annotated[
        str | None,
        typer.Option(
            help="Standard deviation of the heading in degrees, or unknown.  [default: 10 from "
            "EXIF; otherwise left to semsig localize]"
        ),
    ] = None,
    pitch: Annotated[
        float | None, typer.Option(min=-90, max=90, help="Degrees that the camera points upwards.")
    ] = None,
    roll: Annotated[
        float | None,
        typer.Option(min=-180, max=180, help="Degrees that the camera is rolled clockwise."),
    ] = None,
    size: Annotated[
        str | None, typer.Option(help="Size of pictures where it is unknown, such as 1920x1080.")
    ] = None,
    place: Annotated[
        Literal["each", "gps", "all"],
        typer.Option(
            help="Pictures to join into one view: none (each), pictures with GPS positions "
            "within 5 m (gps), or all; a place in --photos takes precedence."
        ),
    ] = "each",
    min_score: Annotated[
        float, typer.Option(min=0, max=1, help="Leave out boxes with a lower score.")
    ] = 0.3,
    as_json: AsJson = False,
) -> None:
    """Turn the boxes of an object detector into views for semsig localize."""
    from semsig_gis.observation import (
        LabelMap,
        Shot,
        ViewBuilder,
        detect_boxes,
        north_sigma,
        read_pictures,
        read_shots,
    )
    from semsig_gis.storage import write_whole

    keep_inputs(out, read=(*files, *(labels or ()), database, photos, detector))
    require_suffix(".jsonl", out)
    if images is not None and not images.is_dir():
        raise InputError(
            f"--images was given as {images}, which is not a folder; give the folder of the "
            "pictures."
        )
    maps = labels or []
    names = None
    if detector is not None:
        name_files = [label for label in maps if Path(label).suffix.lower() in NAME_SUFFIXES]
        if len(name_files) > 1:
            raise InputError(
                f"--labels gives names of classes in {' and '.join(name_files)}; give one file."
            )
        maps = [label for label in maps if label not in name_files]
        names = next(iter(name_files), "coco" if "coco" in maps else None)
    taxonomy = _taxonomy(database)
    shot = Shot(
        camera=camera,
        fov=fov,
        heading=heading,
        heading_error=None if heading_error is None else north_sigma(heading_error),
        pitch=pitch,
        roll=roll,
        size=_size(size),
    )
    builder = ViewBuilder(
        labels=LabelMap.open(maps, taxonomy),
        taxonomy=taxonomy,
        min_score=min_score,
        shot=shot,
        shots={} if photos is None else read_shots(photos),
        folders=None if images is None else [images],
    )
    unknown: list[Path] = []
    if detector is None:
        pictures, unknown = read_pictures(files)
    else:
        with progress("detecting objects") as advance:
            pictures = detect_boxes(
                detector, files, names=names, min_score=min_score, progress=advance
            )
    views, tally = builder.views(pictures, places=place)
    rows: list[dict[str, Any]] = []
    for name, built_view in views:
        time = {"time": tally.times[name]} if name in tally.times else {}
        rows.append({"id": name, **time, **built_view.to_dict(taxonomy)})
    lines = [json.dumps(row) + "\n" for row in rows]
    write_whole(out, "".join(lines))
    if as_json:
        passed = [str(file) for file in unknown]
        print_json({"views": len(views), **tally.to_dict(), "unknown_files": passed})
        return
    say(
        f"{out}: {_many(len(views), 'view')} of {_many(tally.photos, 'picture')} with "
        f"{_many(tally.objects, 'object')}, {tally.ranges:,} with a range."
    )
    if unknown:
        more = f" and {len(unknown) - 1:,} more" if len(unknown) > 1 else ""
        remark(f"left out: {unknown[0]}{more}, in no format of detections")
    _print_remarks(tally)


def _taxonomy(database: Path | None) -> Taxonomy:
    """Return the classes of a database, with default heights, or all built-in classes."""
    if database is None:
        from semsig_gis.sources import built_in_taxonomy

        return built_in_taxonomy()
    from semsig_gis.database import open_city
    from semsig_gis.observation import with_heights

    return with_heights(open_city(database).database.taxonomy)


def _size(text: str | None) -> tuple[int, int] | None:
    """Return width and height in pixels from a text such as 1920x1080."""
    if text is None:
        return None
    if not (match := re.fullmatch(r"(\d{1,7})[xX](\d{1,7})", text)):
        raise InputError(
            f"--size was given as {text!r}; give width and height in pixels, as 1920x1080."
        )
    return int(match[1]), int(match[2])


def _print_remarks(tally: Tally) -> None:
    """Print what was left out and which headings are unknown."""
    if tally.unusable:
        pictures = _many(len(tally.unusable), "picture")
        remark(f"left out: {pictures}: {next(iter(tally.unusable.values()))}")
    if tally.below_min_score:
        remark(f"left out: {_many(tally.below_min_score, 'box', 'boxes')} below --min-score")
    if tally.no_boxes:
        shapes = _many(tally.no_boxes, "shape")
        remark(f"left out: {shapes} without a box or an outline of one object")
    for what, labels in (
        ("with labels that are in no label map", tally.unknown),
        ("of things that are not street objects", tally.no_objects),
        ("of classes that the city does not have", tally.not_in_city),
    ):
        if labels:
            boxes = _many(labels.total(), "box", "boxes")
            frequent = labels.most_common(MOST_NAMES)
            names = ", ".join(f"{label} {count:,}" for label, count in frequent)
            more = f" and {len(labels) - MOST_NAMES:,} more" if len(labels) > MOST_NAMES else ""
            remark(f"left out: {boxes} {what}: {names}{more}")
    if tally.unknown_heading:
        pictures = _many(tally.unknown_heading, "picture")
        remark(
            f"the heading of {pictures} is unknown; bearings are measured from the viewing "
            "direction"
        )
    for north, count in tally.north.items():
        headings = _many(count, "heading")
        remark(f"measured from {north} north: {headings}; localize with --north {north}")


def _many(number: int, noun: str, plural: str = "") -> str:
    """Return a number with a noun: 1 box, 2 boxes."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"
