"""Evaluations among the results of the paper's experiments, and how alike its city is to ours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.evaluation import BEST
from semsig_gis.evaluation import published as paris
from semsig_gis.reports.shares import Share, share_values

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.evaluation import Evaluation, Reproduction
    from semsig_gis.reports.shares import Figure


def case_of(
    results: Reproduction, experiment: str, method: str, distortion: str = "", *, top: int = 1
) -> Evaluation:
    """Return an evaluation; the distortion is by default that of the experiment's name."""
    return results.experiments[experiment][f"{distortion or experiment}/{method}-top{top}"]


def level_case(results: Reproduction, name: str) -> Evaluation:
    """Return the evaluation of the recommended method at a level of distortion."""
    return case_of(results, name if name in results.experiments else "levels", BEST, name)


def is_alone(case: Evaluation) -> NDArray[np.bool_]:
    """Return which queries come from a cell that shares its types with no other."""
    return np.asarray(case.queries["type_group"] == 1)


def reweighted(case: Evaluation, figure: Figure) -> Share:
    """Return a share if as many queries were unambiguous as in the paper."""
    values, alone = share_values(case, figure), is_alone(case)
    if alone.all() or not alone.any():
        return Share.of(values)
    parts = ((paris.ALONE, values[alone]), (1.0 - paris.ALONE, values[~alone]))
    mean = sum(weight * float(some.mean()) for weight, some in parts)
    variance = sum(weight**2 * float(some.var()) / len(some) for weight, some in parts)
    off = 1.96 * float(np.sqrt(variance))
    return Share(mean, max(mean - off, 0.0), min(mean + off, 1.0))
