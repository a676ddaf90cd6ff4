"""What people read, in their language."""

from __future__ import annotations

from qgis.PyQt.QtCore import QCoreApplication

__all__ = ["tr"]


def tr(text: str) -> str:
    """Return a text in the language of QGIS.

    Parameters
    ----------
    text : str
        In English, as the files of translations have it.

    Returns
    -------
    str
        The same where there is no translation.
    """
    return str(QCoreApplication.translate("Semsig", text))
