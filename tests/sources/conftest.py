"""What tests of sources share: a local server, a cache, and engines of vector files."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

import pytest
from machine import PATIENCE_S
from raw_layers import ENGINES

from semsig_gis.sources import Cache, HttpSpec, reader
from semsig_gis.sources.vector import file as vector_file

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.sources import LayerSpec, RawLayer


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return Cache(tmp_path / "cache")


@pytest.fixture
def slept() -> list[float]:
    return []


@pytest.fixture
def quick(slept: list[float]) -> HttpSpec:
    """Return a specification that does not sleep, but says in `slept` how long it would."""
    return HttpSpec(timeout=(PATIENCE_S, PATIENCE_S), attempts=3, backoff_s=1.0, sleep=slept.append)


@pytest.fixture
def read_as(tmp_path: Path) -> Callable[..., RawLayer]:
    """Read a layer from a file of this name and content: text, bytes, or what becomes JSON."""

    def call(
        name: str,
        content: object,
        spec: LayerSpec,
        *,
        by: str = "opendatasoft",
        **options: Any,  # noqa: ANN401
    ) -> RawLayer:
        text = content if isinstance(content, str | bytes) else json.dumps(content)
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        (layer,) = reader(by)(path, [spec], **options)
        assert layer.counts.kept == len(layer.table)
        return layer

    return call


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Run each test with pyogrio and fiona, with fiona for all rows, and without fiona."""
    engine: str = request.param
    if "fiona" in engine:
        pytest.importorskip("fiona", reason="there is no fiona for this Python")
    if engine == "fiona":
        monkeypatch.setattr(vector_file, "read_whole", lambda *_: None)
    if engine == "pyogrio":
        monkeypatch.delitem(sys.modules, "semsig_gis.sources.vector.by_fiona", raising=False)
        monkeypatch.setitem(sys.modules, "fiona", None)
    return engine
