"""CSV of Label Studio: a row per task, with its shapes as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.documents import Document
from semsig_gis.observation.detectors.formats import detection_format, label_studio
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.observation.detectors.pictures import AnnotatedPicture


def matches(content: Any) -> bool:  # noqa: ANN401 - rows of CSV
    """Return whether a row of a table has shapes of Label Studio."""
    return any(
        isinstance(value, str) and value.startswith("[{") and '"original_width"' in value
        for _, row in content
        if isinstance(row, dict)
        for value in row.values()
    )


@detection_format("CSV of Label Studio", ".csv", matches)
def pictures(document: Document, documents: Sequence[Document]) -> Iterable[AnnotatedPicture]:
    """Return the picture of each task."""
    tasks = []
    for _, row in document.content:
        if isinstance(row, Exception):
            raise row
        tasks.append(
            {
                name: parse_json(value) if str(value).startswith("[{") else value
                for name, value in row.items()
            }
        )
    return label_studio.pictures(Document(file=document.file, content=tasks), documents)
