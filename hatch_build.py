"""Build hook: brings the pinned map files (Leaflet, jQuery, heat layer) with ``npm pack``.

A map can then be opened without a network. The build never depends on it: where ``npm`` is
absent, the download fails or a file has the wrong SHA-256, the hook says so in one line and the
package is built without the files; its maps then link them.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tarfile
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

__all__ = ["AssetsBuildHook", "AssetsError", "bring_assets"]

ASSETS = Path("semsig_gis", "assets")
TEST_ASSETS = Path("tests", "assets")
NPM_SECONDS = 120


class AssetsError(Exception):
    """The files could not be brought; the message is one line."""


class AssetsBuildHook(BuildHookInterface):  # type: ignore[type-arg]  # its parameter is private to hatchling
    """Put the files of the manifest beside it before the wheel or sdist is made."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Bring the files; a failure is a warning, never an error.

        Parameters
        ----------
        version : str
            ``"standard"`` or ``"editable"``; both need the files, and who works on the package
            those of the tests, too.
        build_data : dict
            What other hooks may change; unused.
        """
        try:
            bring_assets(Path(self.root, ASSETS))
        except AssetsError as error:
            self.app.display_warning(f"Maps will link Leaflet instead of containing it: {error}")
        if version != "editable" or not Path(self.root, TEST_ASSETS).is_dir():
            return
        try:
            bring_assets(Path(self.root, TEST_ASSETS))
        except AssetsError as error:
            self.app.display_warning(f"Some tests in a browser will be skipped: {error}")


def bring_assets(folder: Path) -> tuple[str, ...]:
    """Bring the files that the manifest of a folder names and that are not there yet.

    Nothing is written before every missing file is there and has the right sum, and each file
    appears by rename.

    Parameters
    ----------
    folder : Path
        Folder with ``manifest.toml``; the files are put beside it.

    Returns
    -------
    tuple of str
        Names of the files that were written; empty when all were there.

    Raises
    ------
    AssetsError
        If ``npm`` is not on the machine, a package cannot be brought, or a file is missing from
        its package or has another SHA-256 than the manifest says.
    """
    manifest = tomllib.loads((folder / "manifest.toml").read_text(encoding="utf-8"))
    contents: dict[str, bytes] = {}
    for package in manifest["package"]:
        missing = [file for file in package["file"] if not _is_there(folder, file)]
        if missing:
            contents |= _from_npm(f"{package['name']}@{package['version']}", missing)
    for target, content in contents.items():
        _write_whole(folder / target, content)
    return tuple(contents)


def _is_there(folder: Path, file: dict[str, str]) -> bool:
    path = folder / file["target"]
    return path.is_file() and _sha256(path.read_bytes()) == file["sha256"]


def _from_npm(package: str, files: list[dict[str, str]]) -> dict[str, bytes]:
    """Return the wanted files of one package, each checked against its sum."""
    npm = shutil.which("npm")
    if npm is None:
        message = f"npm is not on this machine, so {package} was not brought."
        raise AssetsError(message)
    with tempfile.TemporaryDirectory() as folder:
        # `pack` only downloads the archive: no install, no lock file, no script of the package.
        command = [npm, "pack", package, "--pack-destination", folder, "--ignore-scripts"]
        try:
            subprocess.run(  # noqa: S603 - a fixed command, the package comes from the manifest
                command, cwd=folder, check=True, capture_output=True, timeout=NPM_SECONDS
            )
        except (OSError, subprocess.SubprocessError) as error:
            reason = f"{type(error).__name__}, {_last_line(getattr(error, 'stderr', None))}"
            message = f"npm pack {package} failed ({reason})."
            raise AssetsError(message) from error
        archives = list(Path(folder).glob("*.tgz"))
        if len(archives) != 1:
            message = f"npm pack {package} left {len(archives)} archives, not 1."
            raise AssetsError(message)
        return {file["target"]: _checked(archives[0], package, file) for file in files}


def _checked(archive: Path, package: str, file: dict[str, str]) -> bytes:
    """Read one member straight from the archive, so that no path in it is ever trusted."""
    try:
        with tarfile.open(archive) as tar:
            member = tar.extractfile(f"package/{file['path']}")
            content = None if member is None else member.read()
    except (KeyError, OSError, EOFError, tarfile.TarError) as error:
        message = f"{file['path']} cannot be read from {package}: {error}."
        raise AssetsError(message) from error
    if content is None or _sha256(content) != file["sha256"]:
        message = f"{file['path']} of {package} does not have the SHA-256 of the manifest; refused."
        raise AssetsError(message)
    return content


def _write_whole(path: Path, content: bytes) -> None:
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    partial = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        partial.chmod(0o644)  # mkstemp makes it private; the wheel keeps the mode
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _last_line(output: bytes | None) -> str:
    lines = (output or b"").decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "no message")
