"""Tell where in a city a view was taken from the street objects in it.

The road in one glance::

    catalog = load_catalog("montpellier")
    layers, absent = read_files(choose_layers(catalog), ["montpellier/"])
    objects = assemble(layers, catalog).objects
    database = build_database(objects)
    query = Signature.parse("DDBB", [10, 80, 200, 310], taxonomy=database.taxonomy)
    localize(database, query).candidates
"""

import lazy_loader

__version__ = "0.1.0"

# The names of `__init__.pyi` are imported when they are first used, so that the command line can
# print its help without loading a GIS stack.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
