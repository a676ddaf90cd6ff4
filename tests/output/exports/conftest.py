"""Small blocks, so that the layers of the small test cities have several."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from semsig_gis.output.layers import model

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(autouse=True, scope="module")
def _several_blocks() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model, "ROWS_A_BLOCK", 100)
        yield
