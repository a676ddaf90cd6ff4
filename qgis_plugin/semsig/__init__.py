"""Semantic signatures in QGIS: a Processing provider that calls the `semsig` command."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from qgis.gui import QgisInterface

    from .plugin import SemsigPlugin


def classFactory(iface: QgisInterface) -> SemsigPlugin:  # noqa: N802 - as QGIS calls it
    """Return the plugin.

    Parameters
    ----------
    iface : QgisInterface
        The window of QGIS.

    Returns
    -------
    SemsigPlugin
        The plugin.
    """
    from .plugin import SemsigPlugin

    return SemsigPlugin(iface)
