"""How number loops become machine code; the home of numba.

Importing this module takes a third of a second. Modules of kernels import it; whoever calls a
kernel imports its module when the first one is needed.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from semsig_gis.core.memory import require_address_space

# Where LLVM gets no memory, it ends the process without a word of ours.
COMPILER_BYTES = 400_000_000
require_address_space(COMPILER_BYTES, "the compiler of number loops")

import numba  # noqa: E402

# Where SciPy is, numba looks whether it has a linear algebra, which no kernel needs and which takes
# nearly as long to load as numba itself.
LINEAR_ALGEBRA = "scipy.linalg"
if LINEAR_ALGEBRA not in sys.modules:
    sys.modules[LINEAR_ALGEBRA] = None  # type: ignore[assignment] # importing it fails
    try:
        import numba.np.arraymath
    finally:
        del sys.modules[LINEAR_ALGEBRA]

# Sums of neighbouring numbers in one go.
numba.config.SLP_VECTORIZE = 1  # type: ignore[attr-defined]

if TYPE_CHECKING:
    from collections.abc import Callable

_P = ParamSpec("_P")
_R = TypeVar("_R")


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile loops over numbers and arrays to machine code that runs without the interpreter lock.

    The function takes no keywords and is compiled at its first call. The code is kept for later
    processes, beside the module or else in the user's cache folder; where neither can be written,
    it lives as long as the process.
    """
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # no folder for the code can be written
        return numba.njit(nogil=True, error_model="numpy")(function)
