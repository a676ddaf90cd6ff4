"""All commands, registered by the imports below in the order of the help."""

from semsig_gis.cli.console import app

# isort: off
from semsig_gis.cli import (  # noqa: F401
    app as made,
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
    benchmark,
    export,
)

__all__ = ["app"]
