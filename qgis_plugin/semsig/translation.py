"""Translate texts into the language of QGIS."""

from __future__ import annotations

from pathlib import Path

from qgis.core import QgsApplication
from qgis.PyQt.QtCore import QCoreApplication, QTranslator

__all__ = ["install_translator", "tr"]

HERE = Path(__file__).parent


def install_translator() -> QTranslator | None:
    """Install the translations of the language of QGIS for `tr`, if there are some.

    Returns
    -------
    QTranslator or None
        The translator, to keep and to remove in the end; None without translations.
    """
    # The language that QGIS was started with takes precedence over the settings.
    application = QgsApplication.instance()
    started_with = application.translation() if application is not None else ""
    language = str(started_with or QgsApplication.locale()).split("_")[0].split("-")[0]
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
        The English text, as in the files of translations.

    Returns
    -------
    str
        The translation, or the English text without one.
    """
    return str(QCoreApplication.translate("Semsig", text))
