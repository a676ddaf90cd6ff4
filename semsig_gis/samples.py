"""Detections whose true place is known, read from a file: what noise models are learnt from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError
from semsig_gis.row_file import given, read_rows, row_signature
from semsig_gis.signatures import Signature
from semsig_gis.taxonomy import WILDCARD

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.row_file import Row
    from semsig_gis.taxonomy import Taxonomy

__all__ = ["Sample", "read_samples"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Sample:
    """What was detected, perhaps nothing, at a known place.

    The place is either `xy`, in metres in the CRS of the city, or `cell_id` (see
    `semsig_gis.grid.cell_ids`). The signature must have types, all known, and bearings.
    """

    signature: Signature
    xy: tuple[float, float] | None = None
    cell_id: int | None = None

    def __post_init__(self) -> None:  # noqa: D105
        if (self.xy is None) == (self.cell_id is None):
            msg = "a sample needs its true place; give either its x and y or its cell_id."
            raise InputError(msg)
        if self.xy is not None and not np.isfinite(self.xy).all():
            msg = f"the place of a sample is {self.xy}; give two finite coordinates in metres."
            raise InputError(msg)
        if self.signature.codes is None or self.signature.bearings is None:
            msg = "a sample needs the types and the bearings of its detections; give both."
            raise InputError(msg)
        if (self.signature.codes == WILDCARD).any():
            msg = "a sample has a detection of unknown class; give its class, or leave it out."
            raise InputError(msg)


def read_samples(path: str | Path, *, taxonomy: Taxonomy) -> list[Sample]:
    r"""Read detections with their true places.

    Parameters
    ----------
    path : str or Path
        A CSV file with the columns ``types`` (symbols such as ``DDB``), ``bearings`` (degrees,
        with blanks, commas or semicolons between them) and either ``x`` and ``y`` or
        ``cell_id``; or JSON lines with the same names (suffix ``.jsonl``, ``.ndjson`` or
        ``.json``), where bearings may be a list. Other columns are left alone; a row without
        detections is a sample too.
    taxonomy : Taxonomy
        Classes that the symbols belong to.

    Returns
    -------
    list of Sample
        One a row.

    Raises
    ------
    InputError
        If the file cannot be read, has no rows, or a row cannot be used; with its number.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "seen.csv")
    ...     _ = path.write_text("x,y,types,bearings\n500000,5400000,DB,200 -10\n")
    ...     sample = read_samples(path, taxonomy=paper_taxonomy())[0]
    >>> sample.xy, sample.signature.bearings.tolist()
    ((500000.0, 5400000.0), [200.0, 350.0])
    """
    rows = read_rows(path, lambda row: _sample(row, taxonomy), what="sample")
    return [sample for _, sample in rows]


def _sample(row: Row, taxonomy: Taxonomy) -> Sample:
    for name in ("types", "bearings"):
        if row.get(name) is None:
            msg = f"it has no {name}"
            raise InputError(msg)
    signature = row_signature(row, taxonomy)
    if signature is None:
        signature = Signature(np.empty(0, np.uint8), np.empty(0))
    x, y, cell = (given(row, name) for name in ("x", "y", "cell_id"))
    if x is not None and y is not None:
        return Sample(signature=signature, xy=(float(x), float(y)))
    return Sample(signature=signature, cell_id=None if cell is None else int(cell))
