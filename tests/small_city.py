"""A city of a few hundred cells, an evaluation of it and answers in it, for tests of exports."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING

from semsig_gis.database.build import build_database
from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.likelihood.index import build_index
from semsig_gis.likelihood.locate import locate
from semsig_gis.likelihood.noise.model import named_noise
from semsig_gis.matching.search import localize
from semsig_gis.objects.clean import build_objects
from semsig_gis.objects.table import Licence
from semsig_gis.sources.catalog import paper_taxonomy
from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.likelihood.locate import Location
    from semsig_gis.matching.search import Localization
    from semsig_gis.objects.table import StreetObjects


@functools.cache
def small_city() -> tuple[SignatureDatabase, StreetObjects]:
    layers = synthetic_city(CitySpec(size=300.0))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    named = dataclasses.replace(objects, licenses=(Licence("Town (CC0)", ("trees", "lamps")),))
    return build_database(named), named


@functools.cache
def small_evaluation() -> Evaluation:
    """Return an evaluation in which some queries are found, some missed and some empty."""
    return evaluate(small_city()[0], queries=60, distortion="strong")


@functools.cache
def small_location() -> Location:
    database, _ = small_city()
    return locate(build_index(database, named_noise("light")), database.signature(7), refined=False)


@functools.cache
def small_localization() -> Localization:
    database, _ = small_city()
    return localize(database, database.signature(7), top=20)
