"""`semsig view`: the output of object detectors as queries for the other commands."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typing_extensions import TypedDict

from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.core import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.core import Taxonomy
    from semsig_gis.observation import AnnotatedPicture, Tally

MOST_NAMES = 8
NAME_SUFFIXES = frozenset({".txt", ".names", ".yaml", ".yml", ".json"})


def _label_maps() -> tuple[str, ...]:
    from semsig_gis.observation import label_maps

    return label_maps()


class LeftOut(TypedDict):
    """Why pictures were left out, and the numbers of boxes that were, some by label."""

    pictures: dict[str, str]
    below_min_score: int
    no_boxes: int
    faulty_boxes: int
    no_street_objects: dict[str, int]
    unknown_labels: dict[str, int]
    classes_not_in_city: dict[str, int]


class ViewCounts(TypedDict):
    """Counts of views, pictures and objects; files in no format, and why others were left out."""

    views: int
    photos: int
    objects: int
    with_range: int
    unknown_heading: int
    headings_from_north: dict[str, int]
    left_out: LeftOut
    unknown_files: list[str]
    damaged_files: dict[str, str]


@command(
    "view",
    title="Views from detections",
    group="Ask",
    order=5,
    returns=ViewCounts,
    examples=(
        "semsig view boxes.json --fov 70 --out views.jsonl",
        "semsig view photos --detector yolo.onnx --out views.jsonl",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Views:
    """Turn the boxes of an object detector into views for semsig localize."""

    files: Annotated[
        list[Path],
        Option(
            "Detections: COCO, Label Studio, LabelMe, VIA, Supervisely, Darwin, Datumaro, BDD100K, "
            "Mapillary, Panoramax, Ultralytics, Transformers or supervision JSON, answers of "
            "Rekognition, Vision or Roboflow, CVAT or Pascal VOC XML, YOLO .txt with data.yaml, "
            "KITTI .txt, CSV of Roboflow or Label Studio; or a folder. With --detector: "
            "photographs, or folders of them.",
            positional=True,
            reads=True,
        ),
    ]
    out: Annotated[
        Path,
        Option("Views to write (.jsonl), for --queries.", title="Views", writes=".jsonl"),
    ]
    detector: Annotated[
        Path | None,
        Option(
            "Object detector (.onnx) to run on photographs: YOLO, RT-DETR, DETR or torchvision.  "
            "(needs the extra detect)",
            title="Object detector",
            reads=True,
        ),
    ] = None
    labels: Annotated[
        list[str] | None,
        Option(
            "Map from labels to classes, by name or .toml file; repeat for several, best first. "
            "With --detector also the names of its classes: coco, or a .txt, .yaml or .json file "
            "(default: from the model).",
            title="Maps of labels",
            metavar="NAME|FILE",
            default="all built-in maps",
            reads=True,
            suggestions=_label_maps,
        ),
    ] = None
    database: Annotated[
        Path | None,
        Option(
            "Signature database to localize in; labels are mapped to its classes.",
            title="Signature database",
            default="the classes of all built-in catalogues",
            reads=True,
        ),
    ] = None
    images: Annotated[
        Path | None,
        Option(
            "Folder of the pictures, to read focal length and heading from EXIF.",
            title="Folder of the pictures",
            metavar="FOLDER",
            default="the folder of the files, or the one of images next to it",
        ),
    ] = None
    photos: Annotated[
        Path | None,
        Option(
            "Camera data of single pictures: a CSV or JSON lines file with image and any of "
            "camera, fov, heading, heading_error, pitch, roll and place.",
            title="Camera data",
            reads=True,
            advanced=True,
        ),
    ] = None
    camera: Annotated[
        Literal["pinhole", "equirectangular", "cylindrical", "fisheye"] | None,
        Option("Projection of the pictures.", title="Projection", default="pinhole"),
    ] = None
    fov: Annotated[
        float | None,
        Option(
            "Horizontal field of view.",
            title="Field of view",
            unit="°",
            low=0.1,
            high=360,
            default="from EXIF; 360 for a panorama",
        ),
    ] = None
    heading: Annotated[
        float | None,
        Option(
            "Direction of the camera, clockwise from north.",
            unit="°",
            low=-360,
            high=360,
            default="from EXIF",
        ),
    ] = None
    heading_error: Annotated[
        str | None,
        Option(
            "Standard deviation of the heading in degrees, or unknown.",
            title="Error of the heading",
            metavar="DEGREES|unknown",
            default="10 from EXIF; otherwise left to semsig localize",
            advanced=True,
        ),
    ] = None
    pitch: Annotated[
        float | None,
        Option("Angle that the camera points upwards.", unit="°", low=-90, high=90, advanced=True),
    ] = None
    roll: Annotated[
        float | None,
        Option(
            "Angle that the camera is rolled clockwise.",
            unit="°",
            low=-180,
            high=180,
            advanced=True,
        ),
    ] = None
    size: Annotated[
        str | None,
        Option(
            "Size of pictures where it is unknown, such as 1920x1080.",
            title="Size of the pictures",
            metavar="WIDTHxHEIGHT",
            advanced=True,
        ),
    ] = None
    place: Annotated[
        Literal["each", "gps", "all"],
        Option(
            "Pictures to join into one view: none (each), pictures with GPS positions within 5 m "
            "(gps), or all; a place in --photos takes precedence.",
            title="Pictures of one place",
        ),
    ] = "each"
    min_score: Annotated[
        float, Option("Leave out boxes with a lower score.", title="Lowest score", low=0, high=1)
    ] = 0.3

    def run(self, reporter: Reporter) -> Result:
        """Write the views; return their counts."""
        from semsig_gis.observation import LabelMap, Shot, ViewBuilder, north_sigma, read_shots
        from semsig_gis.storage import write_whole

        if self.images is not None and not self.images.is_dir():
            raise InputError(
                f"--images was given as {self.images}, which is not a folder; give the folder of "
                "the pictures."
            )
        maps, names = self._maps()
        taxonomy = self._taxonomy()
        shot = Shot(
            camera=self.camera,
            fov=self.fov,
            heading=self.heading,
            heading_error=None if self.heading_error is None else north_sigma(self.heading_error),
            pitch=self.pitch,
            roll=self.roll,
            size=_size(self.size),
        )
        builder = ViewBuilder(
            labels=LabelMap.open(maps, taxonomy),
            taxonomy=taxonomy,
            min_score=self.min_score,
            shot=shot,
            shots={} if self.photos is None else read_shots(self.photos),
            folders=None if self.images is None else [self.images],
        )
        pictures, left_out = self._pictures(names, reporter)
        views, tally = builder.views(pictures, places=self.place)
        rows: list[dict[str, Any]] = []
        for name, built_view in views:
            time = {"time": tally.times[name]} if name in tally.times else {}
            rows.append({"id": name, **time, **built_view.to_dict(taxonomy)})
        write_whole(self.out, "".join(json.dumps(row) + "\n" for row in rows))
        unknown = [str(file) for file, reason in left_out.items() if not reason]
        damaged = {str(file): reason for file, reason in left_out.items() if reason}
        sentence = (
            f"{_many(len(views), 'view')} of {_many(tally.photos, 'picture')} with "
            f"{_many(tally.objects, 'object')}, {tally.ranges:,} with a range."
        )
        return Result(
            values=lambda: {
                "views": len(views),
                **tally.to_dict(),
                "unknown_files": unknown,
                "damaged_files": damaged,
            },
            summary=[sentence],
            files={"views": self.out},
            notes=[*_notes(unknown, damaged, tally)],
        )

    def _maps(self) -> tuple[list[str], str | None]:
        """Return the label maps, and where the names of a detector's classes are."""
        maps = self.labels or []
        if self.detector is None:
            return maps, None
        files = [label for label in maps if Path(label).suffix.lower() in NAME_SUFFIXES]
        if len(files) > 1:
            raise InputError(
                f"--labels gives names of classes in {' and '.join(files)}; give one file."
            )
        maps = [label for label in maps if label not in files]
        return maps, next(iter(files), "coco" if "coco" in maps else None)

    def _taxonomy(self) -> Taxonomy:
        """Return the classes of the database, with default heights, or all built-in classes."""
        if self.database is None:
            from semsig_gis.sources import built_in_taxonomy

            return built_in_taxonomy()
        from semsig_gis.database import open_city
        from semsig_gis.observation import with_heights

        return with_heights(open_city(self.database).database.taxonomy)

    def _pictures(
        self, names: str | None, reporter: Reporter
    ) -> tuple[Sequence[AnnotatedPicture], dict[Path, str]]:
        """Return the pictures with their boxes, and why files were left out."""
        from semsig_gis.observation import detect_boxes, read_pictures

        if self.detector is None:
            return read_pictures(self.files)
        with reporter.progress("detecting objects") as advance:
            return detect_boxes(
                self.detector,
                self.files,
                names=names,
                min_score=self.min_score,
                progress=advance,
            )


def _size(text: str | None) -> tuple[int, int] | None:
    """Return width and height in pixels from a text such as 1920x1080."""
    if text is None:
        return None
    if not (match := re.fullmatch(r"(\d{1,7})[xX](\d{1,7})", text)):
        raise InputError(
            f"--size was given as {text!r}; give width and height in pixels, as 1920x1080."
        )
    return int(match[1]), int(match[2])


def _notes(unknown: list[str], damaged: dict[str, str], tally: Tally) -> Iterator[str]:
    """Yield what was left out and which headings are unknown."""
    if unknown:
        more = f" and {len(unknown) - 1:,} more" if len(unknown) > 1 else ""
        yield f"left out: {unknown[0]}{more}, in no format of detections"
    if damaged:
        files = _many(len(damaged), "file")
        yield f"left out: {files}: {next(iter(damaged.values())).rstrip('.')}"
    if tally.unusable:
        pictures = _many(len(tally.unusable), "picture")
        yield f"left out: {pictures}: {next(iter(tally.unusable.values()))}"
    if tally.unread:
        pictures = _many(len(tally.unread), "picture")
        reason = next(iter(tally.unread.values()))
        yield f"not opened, as all is known without: {pictures}: {reason}"
    if tally.below_min_score:
        yield f"left out: {_many(tally.below_min_score, 'box', 'boxes')} below --min-score"
    if tally.faulty_boxes:
        boxes = _many(len(tally.faulty_boxes), "box", "boxes")
        yield f"left out: {boxes}: {tally.faulty_boxes[0]}"
    if tally.no_boxes:
        shapes = _many(tally.no_boxes, "shape")
        yield f"left out: {shapes} without a box or an outline of one object"
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
            yield f"left out: {boxes} {what}: {names}{more}"
    yield from _picture_notes(tally)
    yield from _heading_notes(tally)


def _picture_notes(tally: Tally) -> Iterator[str]:
    """Yield which pictures are not those of the detector, or may be another file."""
    if tally.turned:
        pictures = _many(len(tally.turned), "picture")
        yield f"the boxes of {pictures} are turned as its camera was, because they are not upright"
    if tally.stretched:
        pictures = _many(len(tally.stretched), "picture")
        yield f"the boxes of {pictures} of Roboflow are stretched to the original picture"
    for name, file in list(tally.several.items())[:1]:
        more = f", and {len(tally.several) - 1:,} more" if len(tally.several) > 1 else ""
        yield f"several files may be the picture {name}; {file} is used{more}"


def _heading_notes(tally: Tally) -> Iterator[str]:
    """Yield which headings are unknown or not measured, and from which north the others are."""
    if tally.unknown_heading:
        pictures = _many(tally.unknown_heading, "picture")
        yield (
            f"the heading of {pictures} is unknown; bearings are measured from the viewing "
            "direction"
        )
    if tally.travels:
        headings = _many(tally.travels, "heading")
        yield (
            f"the direction of travel in the EXIF is taken as that of the camera: {headings}; give "
            "--heading if the camera did not look ahead"
        )
    for north, count in tally.north.items():
        headings = _many(count, "heading")
        yield f"measured from {north} north: {headings}; localize with --north {north}"


def _many(number: int, noun: str, plural: str = "") -> str:
    """Return a number with a noun: 1 box, 2 boxes."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"
