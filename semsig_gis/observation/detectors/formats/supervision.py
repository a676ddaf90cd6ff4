"""JSON of supervision: a list of boxes with the columns of its CSV."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.documents import Document
from semsig_gis.observation.detectors.formats import detection_format, roboflow_csv

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.observation.detectors.pictures import AnnotatedPicture


def matches(content: Any) -> bool:  # noqa: ANN401 - any JSON
    """Return whether JSON is a list of boxes with labels and corners."""
    return isinstance(content, list) and roboflow_csv.matches(_rows(content))


@detection_format("JSON of supervision", ".json", matches)
def pictures(document: Document, documents: Sequence[Document]) -> Iterable[AnnotatedPicture]:
    """Return the picture of each file name; without names, the one that is named as the file."""
    rows = Document(file=document.file, content=_rows(document.content))
    return roboflow_csv.pictures(rows, documents)


def _rows(content: list[Any]) -> list[tuple[int, Any]]:
    return list(enumerate(content, start=1))
