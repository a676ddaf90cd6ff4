"""Numbers of very many things in a page: compressed arrays, which a script unpacks."""

from __future__ import annotations

import base64
import json
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

SCRIPT = """\
semsig.arrays = async (packed) => {
  const kinds = {
    u1: Uint8Array, u2: Uint16Array, i4: Int32Array, f8: Float64Array,
  };
  const read = async ([kind, text]) => {
    const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const response = new Response(stream);
    if (kind === "json") return response.json();
    if (kind !== "steps") return new kinds[kind](await response.arrayBuffer());
    // The four bytes of all numbers one after the other; each number is what it is more than the
    // one before.
    const planes = new Uint8Array(await response.arrayBuffer());
    const values = new Int32Array(planes.length / 4);
    const size = values.length;
    for (let at = 0, sum = 0; at < size; at += 1) {
      sum += planes[at] | planes[at + size] << 8 | planes[at + 2 * size] << 16
        | planes[at + 3 * size] << 24;
      values[at] = sum;
    }
    return values;
  };
  const names = Object.keys(packed);
  const arrays = await Promise.all(names.map((name) => read(packed[name])));
  return Object.fromEntries(names.map((name, at) => [name, arrays[at]]));
};
"""


def packed(values: NDArray[Any] | Sequence[str]) -> list[str]:
    """Return an array of u1, u2, i4 or f8, or a list of text, for `semsig.arrays`."""
    if not isinstance(values, np.ndarray):
        return ["json", _text(json.dumps(values).encode())]
    kind = values.dtype.newbyteorder("<")
    text = _text(np.ascontiguousarray(values, kind).tobytes())
    return [f"{kind.kind}{kind.itemsize}", text]


def steps(values: NDArray[np.int32]) -> list[str]:
    """Return numbers that change little from one to the next, for `semsig.arrays`."""
    change = np.diff(values.astype("<i4"), prepend=np.int32(0))
    return ["steps", _text(change.view(np.uint8).reshape(-1, 4).T.tobytes())]


def _text(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content)).decode("ascii")
