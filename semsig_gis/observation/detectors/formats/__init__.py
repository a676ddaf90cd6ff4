"""Formats of detections: files with the boxes of objects in pictures.

Each module of this package is a format, registered by the decorator `detection_format`. To add one,
add its module: `read_pictures`, messages and the tests in
``tests/observation/detectors/test_formats.py`` find it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from semsig_gis.core import InputError, Registry
from semsig_gis.observation.detectors.documents import (
    INVALID,
    PARSERS,
    Document,
    read_document,
    text_of,
)
from semsig_gis.observation.detectors.pictures import AnnotatedPicture, scored

Pictures = Callable[[Document, Sequence[Document]], Iterable[AnnotatedPicture]]


@dataclass(frozen=True, slots=True)
class Format:
    """A format of files with the suffix `suffix`; its `name` is for messages.

    `matches` is whether the content of such a file (JSON, XML, CSV or words of lines) is in the
    format. `pictures` returns the pictures of a file, given all files; an error about a missing key
    or a wrong type becomes an InputError.
    """

    name: str
    suffix: str
    matches: Callable[[Any], bool]
    pictures: Pictures


FORMATS: Registry[Format] = Registry("format", __name__, __path__)
"""Every format, by the name of its module."""


def detection_format(
    name: str, suffix: str, matches: Callable[[Any], bool]
) -> Callable[[Pictures], Pictures]:
    """Return a decorator that registers a function `Format.pictures` as a format."""

    def register(pictures: Pictures) -> Pictures:
        FORMATS.register(Format(name, suffix, matches, pictures), pictures.__module__)
        return pictures

    return register


NAME_SUFFIXES = frozenset({".yaml", ".yml", ".names", ".data"})


def read_pictures(
    paths: Iterable[str | Path],
) -> tuple[list[AnnotatedPicture], dict[Path, str]]:
    """Read pictures and boxes from files of detections; the format is found by the content.

    A folder means the files of all formats in it and in its folders, a file of class names without
    labels (.yaml, .names, classes.txt) its folder. YOLO labels need such a file among the files, in
    the same folder or up to two above. COCO results need a file of images and categories among the
    files. A box that cannot be used has a `fault`.

    Returns the pictures, and why files were left out if others can be read: an empty text for the
    files of folders that are in no format. InputError if there is no file to read, no file can be
    read, or no box can be used.
    """
    left_out: dict[Path, str] = {}
    documents = [document for path in paths for document in _documents(Path(path), left_out)]
    labels = [document for document in documents if not _has_class_names(document.file)]
    if documents and not labels and not left_out:  # only names of classes
        labels = _labels_near(documents, left_out)
    pictures: list[AnnotatedPicture] = []
    for document in labels:
        try:
            pictures += _pictures(document, documents)
        except InputError as error:
            left_out[document.file] = str(error)
    if not pictures and any(left_out.values()):
        raise InputError(next(filter(None, left_out.values())))
    boxes = [box for picture in pictures for box in picture.boxes]
    if boxes and all(box.fault for box in boxes):
        raise InputError(f"{boxes[0].fault}; correct the file, or export it again.")
    return pictures, left_out


def _documents(path: Path, left_out: dict[Path, str]) -> list[Document]:
    """Return a file, or the files of detections in a folder; add why others cannot be read."""
    if path.is_dir():
        files = _files_in(path)
        documents = _read(files, left_out)
        labels = [document for document in documents if _format(document)]
        if not labels and left_out.keys().isdisjoint(files):
            raise InputError(f"the folder {path} contains no file of detections; {_accepted()}.")
        left_out |= {item.file: "" for item in documents if not _format(item)}
        return labels
    if _has_class_names(path):
        return [Document(file=path, content=None)]
    if path.suffix.lower() not in PARSERS:
        raise InputError(f"{path} is not in a supported format; {_accepted()}.")
    return _read([path], left_out) if path.is_file() else [read_document(path)]


def _labels_near(names: Sequence[Document], left_out: dict[Path, str]) -> list[Document]:
    """Return the labels in the folders of files of class names, or next to them."""
    folders = {folder for item in names for folder in _folders_of(item.file)}
    files = {file for folder in folders for file in _files_in(folder)}
    labels = [item for item in _read(sorted(files), left_out) if _format(item)]
    if not labels and not left_out:
        raise InputError(f"{names[0].file} has names of classes, and no labels; {_accepted()}.")
    return labels


def _read(files: Iterable[Path], left_out: dict[Path, str]) -> list[Document]:
    """Return the files that can be read, and add why others cannot to `left_out`."""
    documents = []
    for file in files:
        try:
            documents.append(read_document(file))
        except InputError as error:
            left_out[file] = str(error)
    return documents


def _folders_of(names: Path) -> list[Path]:
    """Return the folders where the labels of a file of class names are: its own and its `path`."""
    path = re.search(r"(?m)^path *: *['\"]?([^'\"#\n]+)", text_of(names))
    stated = [names.parent / path[1].strip()] if path else []
    return [names.parent, *(folder for folder in stated if folder.is_dir())]


def _accepted() -> str:
    return f"give {', '.join(form.name for form in FORMATS.values())}, or a folder of them"


def _pictures(document: Document, documents: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the pictures of a file of labels; InputError if it is in no format."""
    file, form = document.file, _format(document)
    if form is None:
        raise InputError(f"{file} contains no detections in a known format; {_accepted()}.")
    try:
        pictures = scored([*form.pictures(document, documents)])
        return [replace(picture, folder=file.parent) for picture in pictures]
    except INVALID as error:
        if isinstance(error, InputError):
            raise
        lacks = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(
            f"{file} does not follow its format, {form.name} ({lacks}); export it again."
        ) from error


def _files_in(folder: Path) -> list[Path]:
    """Return the files of a folder that may contain detections, without hidden files."""
    return sorted(
        file
        for file in folder.rglob("*")
        if file.suffix.lower() in PARSERS
        and not _has_class_names(file)
        and not any(part.startswith(".") for part in file.relative_to(folder).parts)
        and file.is_file()
    )


def _has_class_names(file: Path) -> bool:
    if file.suffix.lower() in NAME_SUFFIXES or file.name == "classes.txt":
        return True
    # It may be the labels of a picture of this name.
    return file.name == "labels.txt" and not any(map(_format, _read([file], {})))


def _format(document: Document) -> Format | None:
    """Return the format of a document by its suffix and content."""
    suffix = document.file.suffix.lower()
    fitting = (form for form in FORMATS.values() if suffix == form.suffix)
    return next((form for form in fitting if form.matches(document.content)), None)
