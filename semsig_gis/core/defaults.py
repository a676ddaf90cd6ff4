"""Default localization methods of the command line, Python and the QGIS plugin."""

from __future__ import annotations

from typing import Final

LIKELIHOOD: Final = "likelihood"
"""First word of the text of a likelihood method."""
DEFAULT_METHOD: Final = LIKELIHOOD
PAPER_METHOD: Final = "edit+edit:5%"
"""The best method in the paper."""
