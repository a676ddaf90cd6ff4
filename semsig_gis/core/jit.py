"""Compilation of loops over arrays to machine code, the only module that imports numba.

Importing it takes 0.2 s. Only modules of kernels import it, and these are imported at their first
use.
"""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from semsig_gis.core.resources import require_address_space

# LLVM ends the process without an error message if it gets no memory.
COMPILER_BYTES = 400_000_000
require_address_space(COMPILER_BYTES, "the compiler of number loops")

# numba imports these if they are installed, and no kernel needs them: 0.16 s of 0.8 s at start.
# None in `sys.modules` makes such an import fail.
_unneeded = {"scipy.linalg", "coverage", "yaml"}
_hidden: dict[str, Any] = dict.fromkeys(_unneeded.difference(sys.modules))
sys.modules.update(_hidden)
try:
    import numba
    import numba.np.arraymath
    from numba.core.caching import FunctionCache
    from numba.core.runtime import rtsys  # type: ignore[attr-defined]
finally:
    for _name in _hidden:
        del sys.modules[_name]

# Vectorize sums of neighbouring numbers.
numba.config.SLP_VECTORIZE = 1  # type: ignore[attr-defined]

if TYPE_CHECKING:
    from collections.abc import Callable

_P = ParamSpec("_P")
_R = TypeVar("_R")


class _CodeCache(FunctionCache):
    """Machine code of a function, stored for later processes.

    numba's own class loads the whole compiler before it loads stored code; this class loads only
    the runtime that the code needs. That saves 0.1 s of 0.8 s at start.
    """

    def load_overload(self, sig: object, target_context: object) -> Any:  # noqa: ANN401 - numba's
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a function of numbers and arrays to machine code that releases the interpreter lock.

    The function takes no keywords and is compiled at its first call. The code is stored for later
    processes in the folder of the module, or else in the user's cache folder; if neither can be
    written, it is compiled again in each process.
    """
    return _compiled(function)


def compiled_sums(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a function as `compiled`; numbers are added in any order, so that sums vectorize."""
    return _compiled(function, fastmath={"reassoc", "contract", "nsz"})


def _compiled(function: Callable[_P, _R], **options: Any) -> Callable[_P, _R]:  # noqa: ANN401 - numba's
    kernel: Any = numba.njit(nogil=True, error_model="numpy", **options)(function)
    with contextlib.suppress(RuntimeError):  # no folder for the code can be written
        # The same as `cache=True`, but with the class above.
        kernel._cache = _CodeCache(function)  # type: ignore[no-untyped-call] # noqa: SLF001
    return kernel  # type: ignore[no-any-return]
