"""All commands."""

from semsig_gis.cli.console import app

# The order of these imports is that of the help.
# isort: off
from semsig_gis.cli import (  # noqa: F401
    demo,
    load,
    build,
    maps,
    view,
    localize,
    route,
    suggest,
    serve,
    learn,
    evaluate,
    export,
)

__all__ = ["app"]
