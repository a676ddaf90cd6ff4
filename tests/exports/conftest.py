"""Layers in several blocks, though the cities of tests are small."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from semsig_gis.exports import layers

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(autouse=True, scope="module")
def _several_blocks() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layers, "ROWS_A_BLOCK", 100)
        yield
