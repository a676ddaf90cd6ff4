"""How number loops become machine code; the home of numba.

Importing this module takes a quarter of a second. Modules of kernels import it; whoever calls a
kernel imports its module when the first one is needed.
"""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from semsig_gis.core.resources import require_address_space

# Where LLVM gets no memory, it ends the process without a word of ours.
COMPILER_BYTES = 400_000_000
require_address_space(COMPILER_BYTES, "the compiler of number loops")

# What numba imports wherever it is installed, and no kernel needs.
NEEDLESS = ("coverage", "scipy.linalg")
_hidden: dict[str, Any] = dict.fromkeys(name for name in NEEDLESS if name not in sys.modules)
sys.modules.update(_hidden)  # importing them fails
try:
    import numba
    import numba.np.arraymath
    from numba.core.caching import FunctionCache
    from numba.core.runtime import rtsys  # type: ignore[attr-defined]
finally:
    for _name in _hidden:
        del sys.modules[_name]

# Sums of neighbouring numbers in one go.
numba.config.SLP_VECTORIZE = 1  # type: ignore[attr-defined]

if TYPE_CHECKING:
    from collections.abc import Callable

_P = ParamSpec("_P")
_R = TypeVar("_R")


class _KeptCode(FunctionCache):
    """The machine code of a function for later processes.

    Loading it takes numba's memory alone. All that compiles, which numba would load before it, is
    loaded once something is compiled: it takes as long as importing numba.
    """

    def load_overload(self, sig: object, target_context: object) -> Any:  # noqa: ANN401 - numba's
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile loops over numbers and arrays to machine code that runs without the interpreter lock.

    The function takes no keywords and is compiled at its first call. The code is kept for later
    processes, beside the module or else in the user's cache folder; where neither can be written,
    it lives as long as the process.
    """
    kernel: Any = numba.njit(nogil=True, error_model="numpy")(function)
    with contextlib.suppress(RuntimeError):  # no folder for the code can be written
        # As `cache=True` does with the code of numba's own class.
        kernel._cache = _KeptCode(function)  # type: ignore[no-untyped-call] # noqa: SLF001
    return kernel  # type: ignore[no-any-return]
