"""Small and random databases, random queries and noise models."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from hypothesis import strategies as st
from pyproj import CRS
from worlds import CODES, random_town

from semsig_gis.core import BEARING_UNITS, GridSpec, ObjectClass, Signature, SignatureSpec
from semsig_gis.database import SignatureDatabase
from semsig_gis.evaluation import distort, named_distortion
from semsig_gis.localization import NoiseMixture, NoiseSpec, named_noise
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray
    from worlds import World

    from semsig_gis.core import Table
    from semsig_gis.localization import Noise

TAXONOMY = paper_taxonomy()
METHODS = [
    "edit+edit",
    "edit+jaccard:alpha=0.3",
    "histogram+edit:raw",
    "jaccard+histogram:alpha=0.9:raw",
    "edit+edit:weights=3/1/2",
    "types:edit",
    "angles:histogram",
]
NOTHING = Signature(np.empty(0, np.uint8), np.empty(0))


def random_database(
    seed: int, *, cells: int = 40, longest: int = 12, classes: int = 4
) -> SignatureDatabase:
    """Return cells with 1 to `longest` random objects of the first classes."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, longest + 1, cells)
    entries = int(lengths.sum())
    owner = np.repeat(np.arange(cells), lengths)
    units = rng.integers(0, BEARING_UNITS, entries)
    order = np.lexsort((units, owner))
    places = rng.choice(400, cells, replace=False)
    columns, rows = np.divmod(np.sort(places), 20)
    return SignatureDatabase(
        columns=columns.astype(np.int32),
        rows=rows.astype(np.int32),
        offsets=np.concatenate([[0], np.cumsum(lengths)]),
        codes=rng.integers(1, classes + 1, entries).astype(np.uint8),
        bearing_units=units[order].astype(np.uint16),
        distance_units=rng.integers(0, 256, entries).astype(np.uint8),
        grid=GridSpec(),
        spec=SignatureSpec(),
        taxonomy=TAXONOMY,
        crs=CRS("EPSG:2154"),
    )


def database_of(
    signatures: Sequence[tuple[str, Sequence[float]]], *, height: int = 1
) -> SignatureDatabase:
    """Return cells with these types and bearings, in columns of `height` cells."""
    bearings = np.array([angle for _, angles in signatures for angle in angles], dtype=float)
    columns, rows = np.divmod(np.arange(len(signatures), dtype=np.int32), np.int32(height))
    return SignatureDatabase(
        columns=columns,
        rows=rows,
        offsets=np.cumsum([0, *(len(types) for types, _ in signatures)]),
        codes=TAXONOMY.encode("".join(types for types, _ in signatures)),
        bearing_units=np.floor(bearings * (BEARING_UNITS / 360)).astype(np.uint16),
        distance_units=np.full(len(bearings), 100, np.uint8),
        grid=GridSpec(step=10.0, origin=(765200.3, 6275000.1)),
        spec=SignatureSpec(),
        taxonomy=TAXONOMY,
        crs=CRS("EPSG:2154"),
        licenses=("trees: the city (CC0)",),
    )


# Six cells: by type three DD, one DB and two B; by angle levels four and two equal ones.
SIX = [
    ("DD", [10, 100]),
    ("DD", [10, 100]),
    ("DD", [10, 200]),
    ("DB", [10, 100]),
    ("B", [300]),
    ("B", [300]),
]


def six_cells() -> SignatureDatabase:
    crossing = ObjectClass(code=40, symbol="z", name="crossing", title="Crossing | zebra")
    return replace(
        database_of(SIX, height=6),
        distance_units=np.full(10, 50, np.uint8),
        grid=GridSpec(),
        taxonomy=TAXONOMY.extended([crossing]),
        licenses=("trees: City <of> Paris (ODbL)",),
        version="0.1.0",
    )


def cells_at(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    *,
    longest: int = 1,
    **facts: Any,  # noqa: ANN401
) -> SignatureDatabase:
    """Return cells at places that see one object, or up to `longest` objects."""
    order = np.lexsort((rows, columns))
    lengths = np.random.default_rng(0).integers(1, longest + 1, len(order))
    objects = int(lengths.sum())
    return replace(
        six_cells(),
        columns=columns[order].astype(np.int32),
        rows=rows[order].astype(np.int32),
        offsets=np.append(0, np.cumsum(lengths)),
        codes=np.ones(objects, np.uint8),
        bearing_units=np.zeros(objects, np.uint16),
        distance_units=np.zeros(objects, np.uint8),
        **facts,
    )


def rows(table: Table) -> Mapping[str, tuple[str, ...]]:
    """Return the rows of a table by their first cell."""
    return {row[0]: row[1:] for row in table.rows}


def random_cells(count: int, *, seed: int = 0) -> list[tuple[str, list[float]]]:
    """Return short signatures of few classes; many are equal or tie."""
    rng = np.random.default_rng(seed)
    return [
        ("".join(rng.choice(list("DDDBG"), length)), np.sort(rng.uniform(0, 360, length)).tolist())
        for length in rng.integers(1, 6, count)
    ]


def asked(types: str | None, bearings: Sequence[float] | None = None) -> Signature:
    return Signature.parse(types, bearings, taxonomy=TAXONOMY)


def random_query(database: SignatureDatabase, seed: int, *, size: int) -> Signature:
    """Return a query of random objects, one in four near an object of the first cell."""
    rng = np.random.default_rng([seed, 7])
    possible = np.append(database.present_codes, 0)
    codes = rng.choice(possible, size)
    bearings = rng.uniform(0, 360, size)
    near = rng.random(size) < 0.25
    first = database.bearings[: database.offsets[1]]
    bearings[near] = (rng.choice(first, int(near.sum())) + 3.0) % 360.0
    return Signature(codes, bearings)


def distorted(database: SignatureDatabase, cell: int, rng: np.random.Generator) -> Signature:
    """Return the signature of a cell after the paper's light distortion."""
    light = named_distortion("light")
    return distort(database.signature(cell), light, classes=database.present_codes, rng=rng)


def turned_query(query: Signature, turn: float) -> Signature:
    """Return a query with `turn` degrees added to its bearings."""
    codes, bearings = parts_of(query)
    return Signature(codes, (bearings + turn) % 360.0)


def parts_of(query: Signature) -> tuple[np.ndarray, np.ndarray]:
    """Return the class codes and the bearings of a query that has both."""
    assert query.codes is not None
    assert query.bearings is not None
    return query.codes, query.bearings


def column(view: Signature, name: str) -> np.ndarray:
    """Return an array that a view has, such as its ranges."""
    values = getattr(view, name)
    assert isinstance(values, np.ndarray)
    return values


def noisy_town(seed: int) -> World:
    return random_town(seed, count=90, codes=CODES[:5])


def every_association(weights: np.ndarray) -> tuple[float, np.ndarray]:
    """Sum over all one-to-one associations: the logarithm, and the probabilities of pairs."""
    objects, detections = weights.shape
    total, chances = 0.0, np.zeros_like(weights)
    for choice in itertools.product(range(-1, detections), repeat=objects):
        pairs = [(row, column) for row, column in enumerate(choice) if column >= 0]
        if len(pairs) > len({column for _, column in pairs}):
            continue
        part = math.prod(weights[pair] for pair in pairs)
        total += part
        for pair in pairs:
            chances[pair] += part
    return math.log(total), chances / total


chances = st.floats(0.05, 0.95)


@st.composite
def noise_specs(draw: st.DrawFn) -> NoiseSpec:
    """Draw a noise model that uses every kind of field."""
    wrong = draw(st.floats(0.05, 0.5))
    names = {"street_light": 1 - wrong, "alignment_tree": wrong}
    shares = {"street_light": 0.5, "alignment_tree": 0.25, "indicator": 0.25}
    return NoiseSpec(
        detection=draw(chances),
        detection_by_class=draw(st.dictionaries(st.just("street_light"), chances)),
        misnamed=draw(st.floats(0.0, 0.5)),
        confusion=draw(st.sampled_from([{}, {"street_light": names}])),
        clutter=draw(st.floats(0.05, 8.0)),
        clutter_shares=draw(st.sampled_from([{}, shares])),
        bearing_sigma=draw(st.floats(1.0, 60.0)),
        bearing_sigma_by_class=draw(st.dictionaries(st.just("indicator"), st.floats(1.0, 30.0))),
        missed_each=draw(st.sampled_from([0.0, 1.5])),
        misnamed_each=draw(st.sampled_from([0.0, 0.5])),
    )


def mixtures() -> st.SearchStrategy[Noise]:
    """Draw a noise model, single or mixed."""
    pair = st.tuples(noise_specs(), noise_specs()).map(
        lambda specs: NoiseMixture(specs=specs, weights=(0.3, 0.7))
    )
    return st.one_of(noise_specs(), pair, st.just(named_noise("generic")))
