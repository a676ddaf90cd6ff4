"""Which method ranks the cells: by text, and where nobody says one.

The command line, Python and the plugin of QGIS take the default from here.
"""

from __future__ import annotations

from typing import Final

LIKELIHOOD: Final = "likelihood"
"""What the text of a likelihood method begins with (see `likelihood.method`)."""
DEFAULT_METHOD: Final = LIKELIHOOD
PAPER_METHOD: Final = "edit+edit:5%"
"""The best method that the paper reports (see `matching.method`)."""
