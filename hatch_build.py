"""Build hooks: the pinned map files (Leaflet, jQuery), and the metadata that depends on a build.

A map can be opened without a network if the package contains these files. They are downloaded with
``npm pack``. The build does not depend on it: if ``npm`` is missing, the download fails or a file
has the wrong SHA-256, one line is printed and the package is built without the files; its maps then
link them. The metadata contains the licences of the files, and, if the environment variable
``SEMSIG_REPOSITORY`` is the address of the project, all addresses.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

__all__ = [
    "AssetsBuildHook",
    "AssetsError",
    "ReleaseMetadataHook",
    "absolute_links",
    "bring_assets",
]

ASSETS = Path("semsig_gis", "assets")
TEST_ASSETS = Path("tests", "assets")
NPM_SECONDS = 120
PAPER = "https://doi.org/10.1007/s11042-020-08992-6"
# Relative addresses of links and pictures on a page in Markdown or HTML.
_RELATIVE_LINK = re.compile(r"""(\]\(|\b(?:src|href)=["'])(?![a-z]+:|[#/])([^)\s"'#]+)""")


class AssetsError(Exception):
    """The files could not be downloaded; the message is one line."""


class ReleaseMetadataHook(MetadataHookInterface):
    """Set the licences of the package and the addresses of its project."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Download the map files, and set their licences, the addresses and the README.

        Parameters
        ----------
        metadata : dict
            The table ``[project]``; in an unpacked sdist, with the values of its build.

        Raises
        ------
        ValueError
            If ``SEMSIG_REPOSITORY`` is not an address.
        """
        root = Path(self.root)
        _bring(root / ASSETS, "Maps will link Leaflet instead of containing it")
        packages = _carried(root / ASSETS)
        metadata["license"] = " AND ".join(
            [self.config["license"], *(package["license"] for package in packages)]
        )
        texts = [file["target"] for package in packages for file in package["file"]]
        metadata["license-files"] = [
            "LICENSE",
            *((ASSETS / name).as_posix() for name in texts if "LICENSE" in name),
        ]
        readme, urls = (root / "README.md").read_text(encoding="utf-8"), {"Paper": PAPER}
        if repository := os.environ.get("SEMSIG_REPOSITORY", "").rstrip("/"):
            if not re.fullmatch(r"https://[^\s/]+/\S+", repository):
                message = (
                    f"SEMSIG_REPOSITORY is {repository!r}, which is not the address of a project; "
                    "give one such as https://example.org/owner/semsig_gis."
                )
                raise ValueError(message)
            tag = f"v{metadata['version']}"
            readme = absolute_links(readme, repository, tag)
            urls |= {
                "Homepage": repository,
                "Documentation": f"{repository}/blob/{tag}/docs/index.md",
                "Repository": repository,
                "Issues": f"{repository}/issues",
                "Changelog": f"{repository}/blob/{tag}/CHANGELOG.md",
            }
        metadata.setdefault("readme", {"content-type": "text/markdown", "text": readme})
        metadata.setdefault("urls", urls)


class AssetsBuildHook(BuildHookInterface):  # type: ignore[type-arg]  # its parameter is private to hatchling
    """List the map files in a wheel; download the files of the tests for editable installs."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Do what the kind of build needs; a failure is a warning, never an error.

        Parameters
        ----------
        version : str
            ``"standard"`` or ``"editable"``.
        build_data : dict
            What the hook may change.
        """
        root = Path(self.root)
        if version == "editable":
            if (root / TEST_ASSETS).is_dir():
                _bring(root / TEST_ASSETS, "Some tests in a browser will be skipped")
        elif self.target_name == "wheel" and (packages := _carried(root / ASSETS)):
            bill = _bill(self.metadata.core.name, self.metadata.version, packages)
            place = tempfile.TemporaryDirectory()
            atexit.register(place.cleanup)  # hatchling reads the file after this
            path = Path(place.name, "assets.cdx.json")
            path.write_bytes(json.dumps(bill, indent=1).encode())
            build_data["sbom_files"].append(str(path))


def absolute_links(text: str, repository: str, tag: str) -> str:
    """Return a page with its links to files of the project pointing into a repository.

    Parameters
    ----------
    text : str
        The page, in Markdown.
    repository : str
        The address of the project.
    tag : str
        The version of the files.

    Returns
    -------
    str
        The page; links to its own sections, and to other sites, are not changed.
    """

    def link(match: re.Match[str]) -> str:
        kind = "raw" if Path(match[2]).suffix in {".gif", ".jpg", ".png", ".svg"} else "blob"
        return f"{match[1]}{repository}/{kind}/{tag}/{match[2]}"

    return _RELATIVE_LINK.sub(link, text)


def bring_assets(folder: Path) -> tuple[str, ...]:
    """Download the files that the manifest of a folder names, except files that are there.

    Nothing is written before every missing file is there and has the right sum, and each file
    appears by rename.

    Parameters
    ----------
    folder : Path
        Folder with ``manifest.toml``, into which the files are written.

    Returns
    -------
    tuple of str
        Names of the files that were written; empty when all were there.

    Raises
    ------
    AssetsError
        If ``npm`` is not on the machine, a package cannot be downloaded, or a file is missing from
        its package or does not have the SHA-256 of the manifest.
    """
    contents: dict[str, bytes] = {}
    for package in _packages(folder):
        missing = [file for file in package["file"] if not _is_there(folder, file)]
        if missing:
            contents |= _from_npm(f"{package['name']}@{package['version']}", missing)
    for target, content in contents.items():
        _write_whole(folder / target, content)
    return tuple(contents)


def _bring(folder: Path, otherwise: str) -> None:
    """Download the files of a folder, or print the consequence in one line."""
    try:
        bring_assets(folder)
    except AssetsError as error:
        sys.stderr.write(f"{otherwise}: {error}\n")


def _packages(folder: Path) -> list[dict[str, Any]]:
    """Return the packages that the manifest of a folder names."""
    manifest = tomllib.loads((folder / "manifest.toml").read_text(encoding="utf-8"))
    packages: list[dict[str, Any]] = manifest["package"]
    return packages


def _carried(folder: Path) -> list[dict[str, Any]]:
    """Return the packages with all their files in the folder."""
    return [
        package
        for package in _packages(folder)
        if all(_is_there(folder, file) for file in package["file"])
    ]


def _bill(name: str, version: str, packages: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a bill of materials (CycloneDX) of the files of other projects in a wheel."""

    def component(name: str, version: str, index: str) -> dict[str, Any]:
        address = f"pkg:{index}/{name}@{version}"
        library = {"type": "library", "bom-ref": address, "name": name, "version": version}
        return library | {"purl": address}

    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": component(name, version, "pypi")},
        "components": [
            component(package["name"], package["version"], "npm")
            | {"licenses": [{"license": {"id": package["license"]}}]}
            | {
                "components": [
                    {
                        "type": "file",
                        "name": file["target"],
                        "hashes": [{"alg": "SHA-256", "content": file["sha256"]}],
                    }
                    for file in package["file"]
                ]
            }
            for package in packages
        ],
    }


def _is_there(folder: Path, file: dict[str, str]) -> bool:
    path = folder / file["target"]
    return path.is_file() and _sha256(path.read_bytes()) == file["sha256"]


def _from_npm(package: str, files: list[dict[str, str]]) -> dict[str, bytes]:
    """Return files of a package, each checked against its SHA-256."""
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
    """Return a checked member of an archive, which is never unpacked to a path that it gives."""
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
