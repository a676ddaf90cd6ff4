"""The build hook, with a stand-in for npm that copies a package made here."""

from __future__ import annotations

import hashlib
import io
import runpy
import sys
import tarfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = b"window.thing = 1;\n"
PICTURE = b"\x89PNG not really"

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for npm is a shell script"),
    pytest.mark.skipif(
        not (ROOT / "hatch_build.py").is_file(), reason="the tests do not run from a checkout"
    ),
]


@pytest.fixture(scope="module")
def hook() -> SimpleNamespace:
    """Return what the build hook defines."""
    return SimpleNamespace(**runpy.run_path(str(ROOT / "hatch_build.py")))


def write_manifest(folder: Path, **sums: str) -> None:
    """Write a manifest of two files of one package; `sums` replaces their sums."""
    right = {"thing.js": SCRIPT, "picture.png": PICTURE}
    lines = ["[[package]]", 'name = "thing"', 'version = "1.2.3"', 'license = "MIT"']
    for target, content in right.items():
        stem = target.partition(".")[0]
        lines += [
            "[[package.file]]",
            f'path = "dist/{target}"',
            f'target = "{target}"',
            f'sha256 = "{sums.get(stem, hashlib.sha256(content).hexdigest())}"',
        ]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "manifest.toml").write_text("\n".join(lines), encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder for the files, in a project of its own."""
    assets = tmp_path / "project" / "semsig_gis" / "assets"
    write_manifest(assets)
    return assets


@pytest.fixture
def npm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put an npm on the path that knows one package, and return the log of its calls."""
    store = tmp_path / "registry"
    store.mkdir()
    with tarfile.open(store / "thing@1.2.3.tgz", "w:gz") as tar:
        for path, content in {"dist/thing.js": SCRIPT, "dist/picture.png": PICTURE}.items():
            member = tarfile.TarInfo(f"package/{path}")
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    script = tmp_path / "bin" / "npm"
    script.parent.mkdir()
    script.write_text(
        "#!/bin/sh\n"
        f'echo "$*" >> "{tmp_path}/calls"\n'
        'test "$1 $3" = "pack --pack-destination" || exit 2\n'
        f'cp "{store}/$2.tgz" "$4/" || {{ echo "no such package" >&2; exit 1; }}\n',
        encoding="utf-8",
    )
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(script.parent), prepend=":")
    return tmp_path / "calls"


def run_hook(hook: SimpleNamespace, project: Path) -> list[str]:
    """Run the hook as hatchling does and return the warnings it shows."""
    warnings: list[str] = []

    class App:
        def display_warning(self, message: str) -> None:
            warnings.append(message)

    arguments: list[Any] = [str(project), {}, None, None, "", "wheel", App()]
    hook.AssetsBuildHook(*arguments).initialize("standard", {})
    return warnings


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_files_are_brought_once_and_again_when_they_change(
    hook: SimpleNamespace, folder: Path, npm: Path
) -> None:
    assert hook.bring_assets(folder) == ("thing.js", "picture.png")
    assert (folder / "thing.js").read_bytes() == SCRIPT
    assert (folder / "picture.png").read_bytes() == PICTURE
    assert names(folder) == {"manifest.toml", "thing.js", "picture.png"}
    npm.unlink()
    assert hook.bring_assets(folder) == ()
    assert not npm.exists()  # nothing was asked for
    (folder / "thing.js").write_bytes(b"something else")
    assert hook.bring_assets(folder) == ("thing.js",)
    assert (folder / "thing.js").read_bytes() == SCRIPT


@pytest.mark.usefixtures("npm")
def test_a_wrong_sum_is_refused_and_nothing_is_written(hook: SimpleNamespace, folder: Path) -> None:
    write_manifest(folder, picture="0" * 64)
    with pytest.raises(hook.AssetsError, match=r"dist/picture\.png of thing@1\.2\.3 .* refused"):
        hook.bring_assets(folder)
    assert names(folder) == {"manifest.toml"}
    (warning,) = run_hook(hook, folder.parents[1])
    assert "refused" in warning
    assert names(folder) == {"manifest.toml"}


@pytest.mark.usefixtures("npm")
def test_a_file_that_its_package_lacks(hook: SimpleNamespace, folder: Path) -> None:
    manifest = folder / "manifest.toml"
    manifest.write_text(manifest.read_text(encoding="utf-8").replace("dist/thing", "lib/thing"))
    with pytest.raises(hook.AssetsError, match=r"lib/thing\.js cannot be read from thing@1\.2\.3"):
        hook.bring_assets(folder)


@pytest.mark.usefixtures("npm")
def test_a_failing_download_is_one_line(hook: SimpleNamespace, folder: Path) -> None:
    manifest = folder / "manifest.toml"
    manifest.write_text(manifest.read_text(encoding="utf-8").replace("1.2.3", "9.9.9"))
    (warning,) = run_hook(hook, folder.parents[1])
    assert warning.startswith("Maps will link Leaflet instead of containing it: npm pack thing@9")
    assert warning.endswith("(CalledProcessError, no such package).")
    assert "\n" not in warning
    assert names(folder) == {"manifest.toml"}


def test_without_npm(
    hook: SimpleNamespace, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    (warning,) = run_hook(hook, folder.parents[1])
    assert warning.endswith("npm is not on this machine, so thing@1.2.3 was not brought.")
    assert names(folder) == {"manifest.toml"}
