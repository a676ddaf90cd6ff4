"""Configuration of the documentation, built with ``make docs``."""

import semsig_gis

project = "semsig_gis"
author = "semsig_gis authors"
project_copyright = "2026, semsig_gis authors"
version = release = semsig_gis.__version__

extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
exclude_patterns = ["_build"]
templates_path = ["_templates"]
default_role = "py:obj"

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say the types, with shapes and units
numpydoc_show_class_members = False  # autodoc lists them

html_extra_path = ["../data_sources/catalog.schema.json"]  # editors ask for it
html_theme = "alabaster"
html_theme_options = {"description": "Semantic signatures from open data"}
