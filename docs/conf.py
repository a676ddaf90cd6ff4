"""Configuration of the documentation, built with ``make docs``."""

import os
import sys
from pathlib import Path

import semsig_gis

sys.path.insert(0, str(Path(__file__).parent))  # where the modules of the build are
from gallery import package_hash
from inventories import write_inventories

# For the commands that the tutorial and the gallery run.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])

project = "semsig_gis"
author = "semsig_gis authors"
project_copyright = "2026, semsig_gis authors"
version = release = semsig_gis.__version__

extensions = [
    "alternatives",
    "myst_nb",
    "numpydoc",
    "pages",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
exclude_patterns = ["_build"]
default_role = "py:obj"
nitpicky = True
smartquotes = False  # would turn the two hyphens of an option into a dash
nitpick_ignore_regex = [("py:obj", ".*")]  # in docstrings, names of parameters, too

myst_enable_extensions = ["attrs_block", "attrs_inline", "colon_fence", "deflist"]
nb_execution_mode = "cache"
nb_execution_cache_path = str(Path(__file__).parent / "_build/notebooks" / package_hash())
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "none"  # the docstrings give the types, with shapes and units
numpydoc_show_class_members = False  # autodoc lists them
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"  # only names of the packages below, or of this one, become links
intersphinx_mapping, numpydoc_xref_aliases = write_inventories(
    Path(__file__).parent / "_build/inventories"
)
copybutton_exclude = ".linenos, .gp, .go"  # prompts and output are not copied
copybutton_only_copy_prompt_lines = True
copybutton_prompt_text = "$ "

html_extra_path = ["../data_sources/catalog.schema.json"]  # editors ask for it
html_theme = "furo"
html_title = f"semsig_gis {version}"
if repository := os.environ.get("SEMSIG_REPOSITORY", "").rstrip("/"):  # as for the package
    html_theme_options = {
        "source_repository": repository,
        "source_branch": f"v{version}",
        "source_directory": "docs/",
    }
html_favicon = "../qgis_plugin/semsig/icon.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
