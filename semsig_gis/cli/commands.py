"""All commands: importing this module registers them, in the order of the help."""

from importlib import import_module

from semsig_gis.cli.console import app
from semsig_gis.cli.run import MODULES

__all__ = ["app"]

for module in MODULES:
    import_module(f"semsig_gis.cli.{module}")
