"""What people read, in their language."""

from __future__ import annotations

from pathlib import Path

from qgis.core import QgsApplication
from qgis.PyQt.QtCore import QCoreApplication, QTranslator

__all__ = ["speak", "tr"]

HERE = Path(__file__).parent


def speak() -> QTranslator | None:
    """Let `tr` speak the language of QGIS from now on, if it has it.

    Returns
    -------
    QTranslator or None
        What translates, to be kept, and removed in the end; None where there is nothing to do.
    """
    # The language that QGIS was started with goes before the one of the settings.
    running = QgsApplication.instance()
    named = running.translation() if running is not None else ""
    language = str(named or QgsApplication.locale()).split("_")[0].split("-")[0]
    file = HERE / "i18n" / f"semsig_{language}.qm"
    translator = QTranslator()
    if not file.is_file() or not translator.load(str(file)):
        return None
    QCoreApplication.installTranslator(translator)
    return translator


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
