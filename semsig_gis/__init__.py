"""Find where in a city a view was taken, from the street objects in it.

The most used names are imported from here, the others from their package, such as
`semsig_gis.localization`.
The road in one glance::

    loaded = load("monaco.osm.pbf")
    city = build(loaded, "monaco.parquet")
    answer = localize(city, "bench at 40, tree at 120")
    answer.latlon, answer.chance, answer.place
"""

import importlib
import warnings

import lazy_loader

from semsig_gis.core import register_loader as _register_loader

__version__ = "0.1.0"  # CITATION.cff, codemeta.json, CHANGELOG.md and the QGIS plugin repeat it

# The names of `__init__.pyi` are imported when they are first used, so that the command line can
# print its help without loading a GIS stack.
_attached, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

_RENAMED = {"suggest_catalog": ("draft_catalog", "0.3.0")}
"""Names that were public, their new names, and the version without the old one."""

_MOVED = {
    name: package
    for package, names in {
        "core": "GridSpec ObjectClass Table wilson_interval",
        "sources": "Catalog LayerSpec PARIS_LIKE clip_layers find_files read_layer",
        "objects": "save_surroundings",
        "database": (
            "PartitionedDatabase TileSpec build_tiles database_summary open_dataset "
            "open_store update_database update_tiles"
        ),
        "localization": (
            "AnswerRule KnownPosition LikelihoodIndex LikelihoodMethod Localization "
            "NoiseMixture SearchRegions aged_noise area_prior fresh_noise named_drift "
            "next_questions open_drift open_posterior open_rule parse_method position_prior "
            "raster_prior save_rule search_regions weight_prior"
        ),
        "evaluation": (
            "ErrorField ExperimentSpec IdentifiabilityCheck error_field "
            "open_experiment_spec open_identifiability open_results run_experiments "
            "save_identifiability"
        ),
        "output": (
            "ambiguity_map drift_map ground_map identifiability_map localization_map "
            "objects_map posterior_map show_map "
            "GeopackageContents export_geotiff export_item read_geopackage plot_answer "
            "plot_database plot_evaluation plot_identifiability plot_objects write_page"
        ),
    }.items()
    for name in names.split()
}
"""Names that were public here, and the package that they are imported from now."""

_MOVED_END = "0.3.0"  # the version without them here


def _public(name: str) -> object:
    """Return a public name of this package, or of the one that it has moved to."""
    package = _MOVED.get(name)
    if package is None:
        return _attached(name)
    return getattr(importlib.import_module(f"{__name__}.{package}"), name)


_register_loader(_public)

_PACKAGES = (
    *("core", "sources", "objects", "observation", "database", "localization"),
    *("evaluation", "output"),
)
"""The packages that users may import from."""


def _advice(name: str) -> str:
    """Return what to write instead of a name that is not public here."""
    from semsig_gis.core import nearest_name  # noqa: PLC0415 - rarely needed

    lacks = f"semsig_gis has no name {name!r}"
    for package in _PACKAGES if not name.startswith("_") else ():
        if name in importlib.import_module(f"semsig_gis.{package}").__all__:
            return f"{lacks}; import it from semsig_gis.{package}."
    return f"{lacks}{nearest_name(name, __all__)}."


def __getattr__(name: str) -> object:
    """Return a public name; one that was renamed or moved, with a warning."""
    if name in _RENAMED:
        new, end = _RENAMED[name]
        change = f"is called {new} now"
    elif name in _MOVED:
        new, end = name, _MOVED_END
        change = f"is imported from semsig_gis.{_MOVED[name]} now"
    elif name in _PACKAGES:
        return importlib.import_module(f"{__name__}.{name}")
    elif name in __all__:
        return _attached(name)
    else:
        raise AttributeError(_advice(name), name=name, obj=None)
    warnings.warn(
        f"semsig_gis.{name} {change}; version {end} removes the old name.",
        DeprecationWarning,
        stacklevel=2,
    )
    return _public(new)
