"""Detections whose true place is known, read from a file: what noise models are learnt from."""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.errors import InputError, SemsigError
from semsig_gis.geometry import wrap_degrees
from semsig_gis.signatures import Signature
from semsig_gis.taxonomy import WILDCARD

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from semsig_gis.taxonomy import Taxonomy

__all__ = ["Sample", "read_samples"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Sample:
    """What was detected at a known place.

    Parameters
    ----------
    signature : Signature
        Types and bearings of the detections; there may be none.
    xy : tuple of float, optional
        The place in metres, in the CRS of the city.
    cell_id : int, optional
        The cell instead (see `semsig_gis.grid.cell_ids`).

    Raises
    ------
    InputError
        If neither or both are given, or the types or the bearings are missing.

    Examples
    --------
    >>> seen = Signature(np.array([3], np.uint8), np.array([90.0]))
    >>> Sample(signature=seen, xy=(500_000.0, 5_400_000.0)).cell_id is None
    True
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
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "seen.csv")
    ...     _ = path.write_text("x,y,types,bearings\n500000,5400000,DB,200 -10\n")
    ...     sample = read_samples(path, taxonomy=paper_taxonomy())[0]
    >>> sample.xy, sample.signature.bearings.tolist()
    ((500000.0, 5400000.0), [200.0, 350.0])
    """
    file = Path(path)
    samples = []
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        msg = f"samples file {file} cannot be read ({reason}); give a CSV or JSON lines file."
        raise InputError(msg) from error
    for line, row in _rows(text, json_lines=file.suffix.lower() != ".csv"):
        try:
            samples.append(_sample(row() if callable(row) else row, taxonomy))
        except (SemsigError, ValueError, TypeError, OverflowError) as error:
            reason = str(error).rstrip(".")
            msg = f"line {line} of {file} is not a sample ({reason}); correct it or take it out."
            raise InputError(msg) from error
    if not samples:
        msg = f"samples file {file} has no rows; give one row for each place."
        raise InputError(msg)
    return samples


def _rows(text: str, *, json_lines: bool) -> Iterator[tuple[int, Any]]:
    """Yield the number of each line and its values, or what gives them."""
    if not json_lines:
        reader = csv.DictReader(text.splitlines())
        for row in reader:
            yield reader.line_num, row
        return
    for line, part in enumerate(text.splitlines(), start=1):
        if part.strip():
            yield line, lambda part=part: json.loads(part)


def _sample(row: Mapping[str, Any], taxonomy: Taxonomy) -> Sample:
    if not isinstance(row, dict):
        msg = "it is not a table of names and values"
        raise InputError(msg)
    for name in ("types", "bearings"):
        if row.get(name) is None:
            msg = f"it has no {name}"
            raise InputError(msg)
    signature = _signature(str(row["types"]).strip(), row["bearings"], taxonomy)
    if row.get("x") not in {None, ""} and row.get("y") not in {None, ""}:
        return Sample(signature=signature, xy=(float(row["x"]), float(row["y"])))
    if row.get("cell_id") not in {None, ""}:
        return Sample(signature=signature, cell_id=int(row["cell_id"]))
    return Sample(signature=signature)


def _signature(types: str, bearings: Any, taxonomy: Taxonomy) -> Signature:  # noqa: ANN401
    parts = re.split(r"[\s,;]+", bearings.strip()) if isinstance(bearings, str) else bearings
    if not isinstance(parts, list):
        parts = [parts]
    angles = [float(part) for part in parts if part != ""]
    if not types and not angles:
        return Signature(np.empty(0, np.uint8), np.empty(0))
    wrong = [angle for angle in angles if not (math.isfinite(angle) and abs(angle) <= 360)]  # noqa: PLR2004
    if wrong:
        msg = f"bearing {wrong[0]:g} is not usable"
        raise InputError(msg)
    return Signature(taxonomy.encode(types), wrap_degrees(angles))
