"""Evaluations of the paper's experiments by name, and shares that are adjusted to the paper's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.evaluation import BEST
from semsig_gis.evaluation import published as paris
from semsig_gis.output.figures.shares import Share, share_values

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.evaluation import Evaluation, Reproduction
    from semsig_gis.output.figures.shares import Figure


def case_of(
    results: Reproduction, experiment: str, method: str, distortion: str = "", *, top: int = 1
) -> Evaluation:
    """Return an evaluation; by default, the distortion is named like the experiment."""
    return results.experiments[experiment][f"{distortion or experiment}/{method}-top{top}"]


def level_case(results: Reproduction, name: str) -> Evaluation:
    """Return the evaluation of the recommended method at a level of distortion."""
    return case_of(results, name if name in results.experiments else "levels", BEST, name)


def is_unambiguous(case: Evaluation) -> NDArray[np.bool_]:
    """Whether no other cell has the types of the true cell, for each query."""
    return np.asarray(case.queries["type_group"] == 1)


def reweighted(case: Evaluation, figure: Figure) -> Share:
    """Return a share, weighted so that the share of unambiguous queries is that of the paper."""
    values, unambiguous = share_values(case, figure), is_unambiguous(case)
    if unambiguous.all() or not unambiguous.any():
        return Share.of(values)
    # The mean and the interval of a stratified sample.
    strata = (
        (paris.UNAMBIGUOUS, values[unambiguous]),
        (1.0 - paris.UNAMBIGUOUS, values[~unambiguous]),
    )
    mean = sum(weight * float(stratum.mean()) for weight, stratum in strata)
    variance = sum(weight**2 * float(stratum.var()) / len(stratum) for weight, stratum in strata)
    half_width = 1.96 * float(np.sqrt(variance))
    return Share(mean, max(mean - half_width, 0.0), min(mean + half_width, 1.0))
