"""The settings in QGIS: the command, the installation of the engine, the server, the proxy."""

from __future__ import annotations

import configparser
import os
from pathlib import Path

from processing.core.ProcessingConfig import ProcessingConfig, Setting
from qgis.core import QgsApplication, QgsNetworkAccessManager, QgsSettings
from qgis.PyQt.QtGui import QIcon

from .command import clean_environment, find_command
from .engine import Engine, Wishes, proxy_variables
from .translation import tr

__all__ = [
    "COMMAND",
    "GROUP",
    "OVERPASS",
    "PYTHON",
    "WHEELS",
    "add_settings",
    "command",
    "engine",
    "environment",
    "icon_path",
    "remove_settings",
    "set_value",
    "value",
    "wishes",
]

GROUP = "Semantic signatures"
COMMAND, PYTHON = "SEMSIG_COMMAND", "SEMSIG_PYTHON"
WHEELS, OVERPASS = "SEMSIG_WHEELS", "SEMSIG_OVERPASS"
"""Names of the settings."""

HERE = Path(__file__).parent


def icon_path() -> str:
    """Return the path of the icon."""
    return str(HERE / "icon.svg")


def add_settings() -> None:
    """Add the settings to those of Processing."""
    ProcessingConfig.settingIcons[GROUP] = QIcon(icon_path())
    for name, title, kind in (
        (COMMAND, tr("The semsig command (leave empty to look for it)"), Setting.FILE),
        (PYTHON, tr("Python for the engine (leave empty to look for it)"), Setting.FILE),
        (WHEELS, tr("Folder of wheels (leave empty to download them)"), Setting.FOLDER),
        (OVERPASS, tr("Overpass server (leave empty for the usual ones)"), Setting.STRING),
    ):
        ProcessingConfig.addSetting(Setting(GROUP, name, title, "", valuetype=kind))
    ProcessingConfig.readSettings()


def remove_settings() -> None:
    """Remove the settings."""
    for name in (COMMAND, PYTHON, WHEELS, OVERPASS):
        ProcessingConfig.removeSetting(name)


def value(name: str) -> str:
    """Return the value of a setting.

    Parameters
    ----------
    name : str
        Its name.

    Returns
    -------
    str
        The value without surrounding blanks; empty if not set.
    """
    return str(ProcessingConfig.getSetting(name) or "").strip()


def set_value(name: str, text: str) -> None:
    """Change a setting, also for later sessions.

    Parameters
    ----------
    name : str
        Its name.
    text : str
        The new value.
    """
    ProcessingConfig.setSettingValue(name, text)


def engine() -> Engine:
    """Return the engine of this profile."""
    metadata = configparser.ConfigParser()
    metadata.read(HERE / "metadata.txt", encoding="utf-8")
    root = Path(QgsApplication.qgisSettingsDirPath(), "semsig")
    return Engine(root, metadata["general"]["version"])


def command() -> str:
    """Return the path of the command; raise CommandError if there is none."""
    return find_command(value(COMMAND), os.environ, own=engine().command)


def environment() -> dict[str, str]:
    """Return the environment of the command, with the proxy of QGIS."""
    return {**clean_environment(os.environ), **_proxies()}


def wishes() -> Wishes:
    """Return the options for the installation of the engine."""
    return Wishes(python=value(PYTHON), wheels=value(WHEELS), proxies=_proxies())


def _proxies() -> dict[str, str]:
    """Return the environment variables for the proxy of QGIS."""
    settings = QgsSettings()
    names = ("proxyEnabled", "proxyType", "proxyHost", "proxyPort", "proxyUser", "proxyPassword")
    proxy_settings = {name: str(settings.value(f"proxy/{name}", "") or "") for name in names}
    if settings.value("proxy/authcfg", ""):  # the login is in the locked store of QGIS
        proxy = QgsNetworkAccessManager.instance().fallbackProxy()
        proxy_settings.update(proxyUser=proxy.user(), proxyPassword=proxy.password())
    excluded = settings.value("proxy/noProxyUrls", []) or []
    urls = [excluded] if isinstance(excluded, str) else map(str, excluded)
    return proxy_variables({**proxy_settings, "noProxyUrls": ",".join(urls)})
