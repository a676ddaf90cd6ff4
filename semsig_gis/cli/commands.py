"""Commands that are not made from the registry of `commands`, registered by these imports."""

# isort: off
from semsig_gis.cli import (  # noqa: F401
    localize,
    route,
    suggest,
    serve,
    learn,
    evaluate,
    benchmark,
)
