"""Find where in a city a view was taken, from the street objects in it.

Every public name is imported from here, whichever package defines it.
The road in one glance::

    catalog = load_catalog("montpellier")
    layers, absent = read_files(choose_layers(catalog), ["montpellier/"])
    objects = assemble(layers, catalog).objects
    database = build_database(objects)
    query = Signature.parse("DDBB", [10, 80, 200, 310], taxonomy=database.taxonomy)
    localize(database, query).candidates
"""

import warnings

import lazy_loader

from semsig_gis.core import register_loader as _register_loader

__version__ = "0.1.0"  # CITATION.cff, codemeta.json, CHANGELOG.md and the QGIS plugin repeat it

# The names of `__init__.pyi` are imported when they are first used, so that the command line can
# print its help without loading a GIS stack.
_attached, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_register_loader(_attached)

_RENAMED = {"suggest_catalog": ("draft_catalog", "0.3.0")}
"""Names that were public, as they are called now, and the version without the old one."""


def __getattr__(name: str) -> object:
    """Return a public name; one by its old name, too, with a warning."""
    if name in _RENAMED:
        new, end = _RENAMED[name]
        warnings.warn(
            f"semsig_gis.{name} is called {new} now; version {end} removes the old name.",
            DeprecationWarning,
            stacklevel=2,
        )
        name = new
    return _attached(name)
