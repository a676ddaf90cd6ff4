"""All commands, registered by the imports below in the order of the help."""

from semsig_gis.cli.console import app

# isort: off
from semsig_gis.cli import (  # noqa: F401
    app as made,
    localize,
    route,
    suggest,
    serve,
    learn,
    evaluate,
    benchmark,
)

__all__ = ["app"]
