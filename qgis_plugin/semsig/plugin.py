"""What QGIS loads and unloads."""

from __future__ import annotations

from qgis.core import QgsApplication

from .provider import SemsigProvider

__all__ = ["SemsigPlugin"]


class SemsigPlugin:
    """The plugin: a Processing provider and nothing else."""

    def __init__(self) -> None:
        self.provider: SemsigProvider | None = None

    def initProcessing(self) -> None:  # noqa: N802 - the names are those of QGIS
        """Add the provider; all that `qgis_process` calls."""
        self.provider = SemsigProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:  # noqa: N802
        """Add the provider to a QGIS with a window."""
        self.initProcessing()

    def unload(self) -> None:
        """Take the provider away."""
        QgsApplication.processingRegistry().removeProvider(self.provider)
