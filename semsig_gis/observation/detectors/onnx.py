"""Run object detectors in ONNX files on photographs."""

from __future__ import annotations

import ast
import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import InputError, cores, extra, one_line
from semsig_gis.observation.detectors.documents import INVALID
from semsig_gis.observation.detectors.exif import open_upright, read_exif
from semsig_gis.observation.detectors.formats.yolo import numbered_names, read_class_names
from semsig_gis.observation.detectors.layouts import (
    COCO_NAMES,
    RF_DETR_OUTPUTS,
    read_outputs,
    suppress_overlaps,
)
from semsig_gis.observation.detectors.picture_files import PICTURE_SUFFIXES
from semsig_gis.observation.detectors.pictures import AnnotatedPicture, box_of
from semsig_gis.storage import parse_json, read_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray
    from PIL import Image

    from semsig_gis.observation.detectors.layouts import ClassNames
    from semsig_gis.observation.detectors.pictures import Box, Shot

KINDS = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
PICTURES = 4
"""Dimensions of an input: picture, colour, row and column."""

SIZE_INPUT = "orig_target_sizes"
OTHER_INPUTS = frozenset({(SIZE_INPUT, 2), ("pixel_mask", 3)})
"""Names and numbers of dimensions of inputs in addition to the picture."""


STRIDE = 32
"""Variable sides of an input are multiples of this number of pixels."""

YOLO_SIDE, OTHER_SIDE = 640, 1280
"""Longer side of a variable input in pixels, for detectors with one output and for others."""

GREY = 114
SETTINGS = "preprocessor_config.json"
IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
EXPORT = "export the detector to ONNX again"


def detect_boxes(
    model: str | Path,
    photos: Iterable[str | Path],
    *,
    names: str | Path | None = None,
    min_score: float = 0.3,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[AnnotatedPicture], dict[Path, str]]:
    """Return photographs with the boxes that an object detector in an ONNX file finds in them.

    The second value is why photographs were left out, if others can be read.

    `photos` are files or folders. `names` is ``coco`` or a file with the names of the classes; by
    default they are from the model. Boxes with a score below `min_score` are left out. `progress`
    is called with the number of finished photographs and the total. InputError if the model or
    all photographs cannot be read, or if the layout of the model's inputs or outputs is unknown.
    """
    files = _photographs(photos)
    shots: dict[Path, Shot] = {}
    left_out: dict[Path, str] = {}
    for file in files:
        try:
            shots[file] = read_exif(file)
        except InputError as error:
            left_out[file] = str(error)
            if len(left_out) == len(files):
                raise
    detector = Detector.open(Path(model), names)
    pictures = []
    for count, (file, shot) in enumerate(shots.items(), start=1):
        try:
            picture = open_upright(file)
        except InputError as error:
            left_out[file] = str(error)
            if len(left_out) == len(files):
                raise
        else:
            boxes = detector.boxes(picture, file.name, min_score=min_score)
            pictures.append(AnnotatedPicture(name=file.name, boxes=boxes, shot=shot))
        if progress is not None:
            progress(count, len(shots))
    return pictures, left_out


def _photographs(photos: Iterable[str | Path]) -> list[Path]:
    """Return photographs, and those in folders, each once; InputError if a folder has none."""
    files: list[Path] = []
    for path in map(Path, photos):
        inside = [path]
        if path.is_dir():
            inside = sorted(
                file for file in path.iterdir() if file.suffix.lower() in PICTURE_SUFFIXES
            )
        if not inside:
            raise InputError(
                f"the folder {path} contains no photograph; give JPEG, PNG, WebP or TIFF files."
            )
        files += inside
    return list(dict.fromkeys(files))


@dataclass(frozen=True, slots=True, kw_only=True)
class Detector:
    """An object detector with the possible names of its classes and the form of its input.

    The longer side of a picture gets `side` pixels if the input has no fixed size. Of the colours,
    as shares of 255, `mean` is subtracted, and the rest is divided by `deviation`.
    """

    model: Path
    session: Any
    choices: Sequence[ClassNames]
    side: int
    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]

    @classmethod
    def open(cls, model: Path, names: str | Path | None) -> Detector:
        """Load a detector; parameters and errors are those of `detect_boxes`."""
        with extra("detect", "a detector"):
            import onnxruntime  # noqa: PLC0415 - is an optional extra
        if not model.is_file():
            raise InputError(f"the detector {model} is not a file; give an .onnx file.")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = cores()
        options.log_severity_level = 4  # only fatal errors; the others are raised as well
        with _readable(f"{model} cannot be loaded as an ONNX model"):
            session = onnxruntime.InferenceSession(
                str(model), options, providers=["CPUExecutionProvider"]
            )
        _check_inputs(model, session)
        metadata = session.get_modelmeta().custom_metadata_map
        if (task := metadata.get("task", "detect")) != "detect":
            raise InputError(f"{model} is for the task {task!r}; give a model for 'detect'.")
        choices = _class_names(model, metadata, names)
        settings = _settings(model)
        outputs = session.get_outputs()
        widths = {item.shape[-1] for item in outputs if item.shape and "logits" in item.name}
        # DETR has one more class, for no object; its successors with these numbers of COCO as well.
        counts = {max(choice) + 2 for choice in choices} | {max(COCO_NAMES[1]) + 1}
        usual = {item.name for item in outputs} == RF_DETR_OUTPUTS or bool(widths & counts)
        try:
            size = ast.literal_eval(metadata.get("imgsz", "None")) or settings.get("size")
            sides = size.values() if isinstance(size, dict) else np.atleast_1d(size or 0)
            mean, deviation = np.zeros(3), np.ones(3)
            if settings.get("do_normalize", usual):
                mean = np.asarray(settings.get("image_mean", IMAGENET_MEAN), dtype=float)
                deviation = np.asarray(settings.get("image_std", IMAGENET_STD), dtype=float)
            return cls(
                model=model,
                session=session,
                choices=choices,
                side=int(max(sides)) or (YOLO_SIDE if len(outputs) == 1 else OTHER_SIDE),
                mean=mean.reshape(3),
                deviation=deviation.reshape(3),
            )
        except (SyntaxError, *INVALID) as error:
            raise InputError(
                f"the size or the colours of the input of {model} are not valid ({error}); correct "
                f"{SETTINGS}, or {EXPORT}."
            ) from error

    def boxes(self, picture: Image.Image, name: str, *, min_score: float) -> tuple[Box, ...]:
        """Return the boxes in an upright picture of this name, in pixels, without overlaps."""
        image, *others = sorted(self.session.get_inputs(), key=_is_no_picture)
        longer = max(picture.size)
        sides = [STRIDE * -(-side * self.side // (longer * STRIDE)) for side in picture.size[::-1]]
        height, width = _fixed_shape(image.shape[-2:], sides)
        pixels, scale, shift = letterbox(picture, (width, height))
        values = ((pixels / 255.0 - self.mean) / self.deviation).astype(KINDS[image.type])
        values = values.transpose(2, 0, 1)
        feed = {image.name: values[None] if len(image.shape) == PICTURES else values}
        for item in others:
            if item.name == SIZE_INPUT:
                feed[item.name] = np.array([[width, height]])
            else:
                shape = _fixed_shape(item.shape, (1, height, width))
                feed[item.name] = np.ones(shape, dtype=np.int64)
        with _readable(f"{self.model} cannot be run on {name}"):
            arrays = self.session.run(None, feed)
        outputs = {
            item.name: np.asarray(array)
            for item, array in zip(self.session.get_outputs(), arrays, strict=True)
        }
        detections = read_outputs(outputs, self.choices, (width, height))
        if detections is None:
            shapes = ", ".join(f"{key} {list(array.shape)}" for key, array in outputs.items())
            classes = " or ".join(str(max(choice) + 1) for choice in self.choices)
            raise InputError(
                f"{self.model} has the outputs {shapes}, which is no known layout for {classes} "
                "classes; export it as YOLO, RT-DETR, DETR or torchvision do, and give the names "
                "of its classes with --labels."
            )
        rows = np.flatnonzero(detections.scores >= min_score)
        if detections.overlapping:
            rows = rows[
                suppress_overlaps(
                    detections.corners[rows], detections.scores[rows], detections.numbers[rows]
                )
            ]
        last = max(detections.names)
        corners = (detections.corners[rows].reshape(-1, 2, 2) - shift) / scale
        boxes = []
        for number, corner, score in zip(
            detections.numbers[rows].tolist(),
            corners.reshape(-1, 4),
            detections.scores[rows],
            strict=True,
        ):
            if not 0 <= number <= last:
                raise InputError(
                    f"{self.model} found the class {number} on {name}, but the names end with "
                    f"{last}; give the names of all its classes with --labels."
                )
            label = detections.names.get(number, f"class {number}")
            boxes.append(box_of(label, corner, f"{self.model}, run on {name},", score=score))
        return tuple(boxes)


def letterbox(
    picture: Image.Image, size: tuple[int, int]
) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.float64]]:
    """Return a picture in the middle of a grey one of another size, and its scale and shift.

    Pixels have the shape (height, width, 3). A point (x, y) of the picture is at (x, y) * scale +
    shift.
    """
    ratio = min(wide / side for wide, side in zip(size, picture.size, strict=True))
    inner = [max(round(side * ratio), 1) for side in picture.size]
    left, top = ((wide - side) // 2 for wide, side in zip(size, inner, strict=True))
    pixels = np.full((size[1], size[0], 3), GREY, dtype=np.uint8)
    resized = np.asarray(picture.resize((inner[0], inner[1])))
    pixels[top : top + inner[1], left : left + inner[0]] = resized
    return pixels, np.array(inner) / picture.size, np.array([left, top], dtype=float)


def _fixed_shape(shape: Sequence[Any], sides: Iterable[int]) -> list[int]:
    """Return a shape with these sides where its own are variable."""
    pairs = zip(shape, sides, strict=True)
    return [own if isinstance(own, int) else side for own, side in pairs]


def _is_no_picture(item: Any) -> bool:  # noqa: ANN401 - onnxruntime has no types
    return item.type not in KINDS


def _check_inputs(model: Path, session: Any) -> None:  # noqa: ANN401 - onnxruntime has no types
    """Raise InputError if the inputs are not one picture and what is known in addition."""
    inputs = session.get_inputs()
    image, *others = sorted(inputs, key=_is_no_picture)
    shape = [1, *image.shape] if len(image.shape) == PICTURES - 1 else image.shape
    if (
        len(shape) != PICTURES
        or _fixed_shape(shape[:2], (1, 3)) != [1, 3]
        or _is_no_picture(image)
        or any((item.name, len(item.shape)) not in OTHER_INPUTS for item in others)
    ):
        types = ", ".join(f"{item.name} {item.type} {item.shape}" for item in inputs)
        raise InputError(
            f"{model} has the inputs {types}; give a detector of one RGB picture of floating-point "
            "numbers, [1, 3, height, width] or [3, height, width]."
        )


def _class_names(
    model: Path, metadata: Mapping[str, str], names: str | Path | None
) -> Sequence[ClassNames]:
    """Return the names of the classes that a detector may have."""
    model_names = None
    with contextlib.suppress(SyntaxError, MemoryError, RecursionError, *INVALID):
        model_names = numbered_names(ast.literal_eval(metadata["names"]))
    if names is None:
        if model_names is None:
            raise InputError(
                f"{model} does not contain the names of its classes; give --labels coco, or a "
                "file of names."
            )
        return (model_names,)
    if names != "coco" and not Path(names).is_file():
        raise InputError(f"{names} is not a file; give 'coco' or a file of class names.")
    choices: tuple[dict[int, str], ...] = COCO_NAMES
    if names != "coco":
        lines = read_class_names(Path(names)).items()
        choices = ({number: name for number, name in lines if name},)
    if model_names is not None and all(max(model_names) != max(choice) for choice in choices):
        raise InputError(
            f"{model} has {len(model_names)} classes, and {names} has {len(choices[0])}; give the "
            "names of its classes, or leave them out to use its own."
        )
    return choices


def _settings(model: Path) -> dict[str, Any]:
    """Return what Transformers wrote about the input of a model, in its folder or the one above."""
    files = [folder / SETTINGS for folder in model.parents[:2] if (folder / SETTINGS).is_file()]
    if not files:
        return {}
    try:
        settings = parse_json(read_text(files[0]))
    except (OSError, ValueError) as error:
        raise InputError(f"{files[0]} is not JSON ({error}); correct it or delete it.") from error
    if not isinstance(settings, dict):
        raise InputError(f"{files[0]} is not a table; correct it or delete it.")
    return settings


@contextlib.contextmanager
def _readable(what: str) -> Iterator[None]:
    """Raise InputError for an error of onnxruntime in the block."""
    try:
        yield
    except Exception as error:  # its errors have no other base class
        reason = one_line(str(error)).rpartition(" : ")[2].rpartition("failed:")[2]
        reason = reason.rstrip(".").replace(". ", "; ")
        raise InputError(f"{what} ({reason}); {EXPORT}.") from error
