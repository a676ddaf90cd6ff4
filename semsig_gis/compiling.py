"""How number loops become machine code; the home of numba.

Importing this module takes a third of a second. Modules of kernels import it; whoever calls a
kernel imports its module when the first one is needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ParamSpec, TypeVar

import numba

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["compiled"]

_P = ParamSpec("_P")
_R = TypeVar("_R")


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a function that runs as machine code, and without the interpreter lock.

    Parameters
    ----------
    function : callable
        Loops over numbers and arrays that numba can compile. It takes no keywords.

    Returns
    -------
    callable
        The same function, compiled at its first call. The code is kept for later processes,
        beside the module or else in the user's cache folder; where neither can be written, it
        lives as long as the process.

    Examples
    --------
    >>> @compiled
    ... def double(number: int) -> int:
    ...     return 2 * number
    >>> double(21)
    42
    """
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # no folder for the code can be written
        return numba.njit(nogil=True, error_model="numpy")(function)
