"""Rows that fiona reads or refuses."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterable

fiona = pytest.importorskip("fiona", reason="there is no fiona for this Python")
by_fiona = pytest.importorskip("semsig_gis.sources.vector.by_fiona")


class Source:
    """A source of features; an exception among them is raised, as GDAL may do."""

    def __init__(self, features: Iterable[Any]) -> None:
        self.features = iter(features)

    def __iter__(self) -> Source:
        return self

    def __next__(self) -> Any:  # noqa: ANN401 - a feature of fiona
        feature = next(self.features)
        if isinstance(feature, Exception):
            raise feature
        return feature


GEOMETRY = fiona.Geometry(coordinates=(1.0, 0.0), type="Point")
GOOD = fiona.Feature(geometry=GEOMETRY, id="1", properties=fiona.Properties())


def test_features_after_an_error_are_read() -> None:
    bad = ValueError("unlucky")
    source = Source([bad, *[GOOD] * 3, bad, *[GOOD] * 3, bad])
    rows = by_fiona._rows(source, [], 9, [])
    assert (rows.read, rows.numbers) == (9, [2, 3, 4, 6, 7, 8])
    assert rows.errors == dict.fromkeys((1, 5, 9), "cannot be read (unlucky)")


@pytest.mark.parametrize("size", [5, 5000])
def test_reader_stops_after_many_failures(size: int) -> None:
    features = itertools.chain([GOOD] * 3, itertools.repeat(OSError(5, "no more")))
    rows = by_fiona._rows(Source(features), [], size, [])
    assert rows.numbers == [1, 2, 3]
    assert rows.read == len(rows.numbers) + len(rows.errors) == max(size, 1003)
