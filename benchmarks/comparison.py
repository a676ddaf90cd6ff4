"""Compare a measurement of the package with a peer."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Comparison", "compare"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One line of the results.

    Parameters
    ----------
    name : str
        What was measured.
    unit : str
        Unit of `ours` and `peer`.
    ours, peer : float
        Medians over the repeats, lower is better.
    peer_name : str
        What ours is compared with.
    bar : float or None
        The ratio to reach; None if the time is only for information.
    paper : float, optional
        What the source paper prints, in the same unit.
    """

    name: str
    unit: str
    ours: float
    peer: float
    peer_name: str
    bar: float | None
    paper: float | None = None

    @property
    def ratio(self) -> float:
        """How many times better ours is than the peer."""
        return self.peer / self.ours

    @property
    def met(self) -> bool | None:
        """Whether the ratio reaches the bar; None without a bar."""
        return None if self.bar is None else self.ratio >= self.bar

    def at_most(self, limit: float) -> Comparison:
        """Return the line with a limit for ours; its bar is the ratio of the peer to the limit."""
        return replace(self, bar=self.peer / limit)

    def to_dict(self) -> dict[str, Any]:
        """Return the line as plain values."""
        return {
            "name": self.name,
            "unit": self.unit,
            "ours": float(f"{self.ours:.4g}"),
            "peer": float(f"{self.peer:.4g}"),
            "peer_name": self.peer_name,
            "ratio": float(f"{self.ratio:.4g}"),
            "bar": self.bar,
            "met": self.met,
            "paper": self.paper,
        }

    def __str__(self) -> str:
        """Return the line as text."""
        line = (
            f"{self.name}: {self.ours:.3g} {self.unit}; {self.peer_name}: {self.peer:.3g} "
            f"{self.unit}; ratio {self.ratio:.3g}"
        )
        if self.paper is not None:
            line += f"; the paper: {self.paper:.3g} {self.unit}"
        if self.bar is not None:
            line += f", at least {self.bar:.3g} wanted: {'met' if self.met else 'not met'}"
        return line


def compare(
    name: str,
    ours: Callable[[int], object],
    peer: Callable[[int], object],
    *,
    peer_name: str,
    repeats: int,
    bar: float | None = None,
    paper: float | None = None,
    warm_up: bool = True,
) -> Comparison:
    """Time two callables in turns and return the median of each, in milliseconds.

    Parameters
    ----------
    name : str
        What is measured.
    ours, peer : callable
        Called with the number of the repeat, so that each repeat may take another query.
    peer_name : str
        What the peer is.
    repeats : int
        How often each is timed.
    bar : float, optional
        The ratio to reach.
    paper : float, optional
        The milliseconds that the source paper prints.
    warm_up : bool, optional
        Call each once before it is timed.
    """
    times: tuple[list[float], list[float]] = ([], [])
    for repeat in range(-1 if warm_up else 0, repeats):
        for work, seconds in zip((ours, peer), times, strict=True):
            start = time.perf_counter()
            work(max(repeat, 0))
            if repeat >= 0:
                seconds.append(time.perf_counter() - start)
    ours_ms, peer_ms = (1e3 * statistics.median(seconds) for seconds in times)
    return Comparison(
        name=name,
        unit="ms",
        ours=ours_ms,
        peer=peer_ms,
        peer_name=peer_name,
        bar=bar,
        paper=paper,
    )
