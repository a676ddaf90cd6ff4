"""The experiments of the source paper, as experiments of ours.

The paper does not say how it normalised, whether sequences were sorted again after the noise, nor
which class a false object has. The readings that come nearest to its figures are taken (distances
from 0 to 1, order kept, any class), and an experiment of its own tells what each of the others
would change.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.evaluation.methods import parse_method
from semsig_gis.evaluation.spec import ExperimentSpec
from semsig_gis.queries.chain import parse_chain

if TYPE_CHECKING:
    from collections.abc import Mapping

MEASURES = ("jaccard", "histogram", "edit")
LEVELS = ("light", "medium", "strong")  # of distortion
RANGES = (20.0, 30.0, 40.0)  # of sight, in metres
SCALES = (8, 16, 24, 32)  # numbers of angle levels
QUERIES = 10_000
MANY = 100  # so many candidates count where the paper does not look at the first alone
READ = 1_000  # queries of each reading of what the paper leaves open, unless fewer are asked
FEWER = 500  # queries of the likelihood method, unless fewer are asked

# Names of methods in the experiments: measures of one part, fusions of the edit distance of types
# with a measure of angles, fusions of edit distances by the share of the types, and the same in two
# stages by the percentage that the first one keeps.
SINGLES: Mapping[str, str] = {
    f"{part}-{measure}": f"{part}:{measure}" for measure in MEASURES for part in ("types", "angles")
}
FUSIONS: Mapping[str, str] = {f"fusion-{measure}": f"edit+{measure}" for measure in MEASURES}
WEIGHTS: Mapping[float, str] = {
    **{share: f"weights-{round(100 * share)}" for share in (0.1, 0.3)},
    0.5: "fusion-edit",
    **{share: f"weights-{round(100 * share)}" for share in (0.7, 0.9)},
}
PERCENTS: Mapping[int, str] = {
    **{percent: f"stages-{percent}" for percent in (1, 5, 10, 20, 50)},
    100: "fusion-edit",
}
BEST = "stages-5"  # the one that the paper recommends
FIRST_STAGE = "types-edit"  # its first stage alone
OURS = "likelihood"

# What the paper leaves open of the distortion.
READINGS: Mapping[str, str] = {
    "kept-uniform": "order kept, false objects of any class",
    "kept-frequency": "order kept, false objects as frequent as true ones",
    "sorted-uniform": "sorted again, false objects of any class",
    "sorted-frequency": "sorted again, false objects as frequent as true ones",
}


def paper_experiments(
    database: str,
    *,
    ranges: Mapping[float, str],
    scales: Mapping[int, str],
    queries: int = QUERIES,
    seed: int = 0,
) -> dict[str, ExperimentSpec]:
    """Return all experiments of the paper by name: ``"none"``, ``"medium"``, ``"levels"``, ...

    ``ranges`` and ``scales`` are the files of databases of the same city by their visibility range
    in metres and by their number of angle levels; each adds an experiment, such as ``"range-20"``
    or ``"levels-8"``.
    """
    stages = {name: f"edit+edit:{k}%" for k, name in PERCENTS.items() if name not in FUSIONS}
    weights = {name: f"edit+edit:alpha={w}" for w, name in WEIGHTS.items() if name not in FUSIONS}
    best = {BEST: stages[BEST]}
    stage_one = {FIRST_STAGE: SINGLES[FIRST_STAGE], **best}

    def spec(
        distortions: Mapping[str, str],
        methods: Mapping[str, str],
        *,
        file: str = database,
        number: int = queries,
        top: tuple[int, ...] = (1,),
    ) -> ExperimentSpec:
        return ExperimentSpec(
            database=file,
            queries=number,
            seeds=(seed,),
            top=top,
            methods={name: parse_method(text) for name, text in methods.items()},
            distortions={name: parse_chain(text) for name, text in distortions.items()},
        )

    kept = {level: f"{level}:resort=false" for level in LEVELS}
    medium = {"medium": kept["medium"]}
    both = (1, MANY)
    orders = {"kept": "medium:resort=false", "sorted": "medium"}
    readings = {
        f"{order}-{classes}": text + (":false_class=frequency" if classes == "frequency" else "")
        for order, text in orders.items()
        for classes in ("uniform", "frequency")
    }
    return {
        "none": spec({"none": ""}, {**SINGLES, **FUSIONS, **stages}, top=both),
        "medium": spec(medium, {**SINGLES, **FUSIONS, **weights, **stages}, top=both),
        "levels": spec({level: kept[level] for level in ("light", "strong")}, best),
        "readings": spec(readings, {**best, "raw": "edit+edit:5%:raw"}, number=min(queries, READ)),
        "ours": spec(kept, {OURS: "likelihood:generic:on_grid"}, number=min(queries, FEWER)),
        **{f"range-{r:g}": spec(medium, stage_one, file=file) for r, file in ranges.items()},
        **{f"levels-{q}": spec(medium, best, file=file) for q, file in scales.items()},
    }
