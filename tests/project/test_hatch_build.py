"""The build hook, with a stand-in for npm that copies a package made here."""

from __future__ import annotations

import hashlib
import io
import re
import runpy
import sys
import tarfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
FILES = {"thing.js": b"window.thing = 1;\n", "picture.png": b"\x89PNG not really"}
SUMS = {name: hashlib.sha256(content).hexdigest() for name, content in FILES.items()}

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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder for two files of one package, in a project of its own."""
    lines = ["[[package]]", 'name = "thing"', 'version = "1.2.3"', 'license = "MIT"']
    for name, found in SUMS.items():
        lines += ["[[package.file]]", f'path = "dist/{name}"', f'target = "{name}"']
        lines += [f'sha256 = "{found}"']
    assets = tmp_path / "project" / "semsig_gis" / "assets"
    assets.mkdir(parents=True)
    (assets / "manifest.toml").write_text("\n".join(lines), encoding="utf-8")
    return assets


@pytest.fixture
def npm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put an npm on the path that knows one package, and return the log of its calls."""
    store = tmp_path / "registry"
    store.mkdir()
    with tarfile.open(store / "thing@1.2.3.tgz", "w:gz") as tar:
        for target, content in FILES.items():
            member = tarfile.TarInfo(f"package/dist/{target}")
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


def run_hook(hook: SimpleNamespace, project: Path, version: str = "standard") -> list[str]:
    """Run the hook as hatchling does and return the warnings it shows."""
    warnings: list[str] = []
    app = SimpleNamespace(display_warning=warnings.append)
    arguments: list[Any] = [str(project), {}, None, None, "", "wheel", app]
    hook.AssetsBuildHook(*arguments).initialize(version, {})
    return warnings


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files beside the manifest."""
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    del files["manifest.toml"]
    return files


def test_files_are_brought_once_and_again_when_they_change(
    hook: SimpleNamespace, folder: Path, npm: Path
) -> None:
    assert hook.bring_assets(folder) == ("thing.js", "picture.png")
    assert contents(folder) == FILES
    npm.unlink()
    assert hook.bring_assets(folder) == ()
    assert not npm.exists()  # nothing was asked for
    (folder / "thing.js").write_bytes(b"something else")
    assert hook.bring_assets(folder) == ("thing.js",)
    assert contents(folder) == FILES


@pytest.mark.usefixtures("npm")
@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (
            hashlib.sha256(FILES["picture.png"]).hexdigest(),
            "0" * 64,
            r"png of thing@1\.2\.3 .* refused",
        ),
        ("dist/thing", "lib/thing", r"lib/thing\.js cannot be read from thing@1\.2\.3"),
        ("1.2.3", "9.9.9", r"npm pack thing@9\.9\.9 .*\(CalledProcessError, no such package\)\.$"),
    ],
)
def test_what_cannot_be_brought_is_one_line_and_nothing_is_written(
    hook: SimpleNamespace, folder: Path, old: str, new: str, reason: str
) -> None:
    manifest = folder / "manifest.toml"
    manifest.write_text(manifest.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    (warning,) = run_hook(hook, folder.parents[1])
    assert warning.startswith("Maps will link Leaflet instead of containing it: ")
    assert re.search(reason, warning)
    assert "\n" not in warning
    assert contents(folder) == {}


@pytest.mark.usefixtures("npm")
@pytest.mark.parametrize(("version", "brought"), [("standard", {}), ("editable", FILES)])
def test_files_of_tests_are_for_who_works_on_it(
    hook: SimpleNamespace, folder: Path, version: str, brought: dict[str, bytes]
) -> None:
    project = folder.parents[1]
    of_tests = project / "tests" / "assets"
    of_tests.mkdir(parents=True)
    (of_tests / "manifest.toml").write_bytes((folder / "manifest.toml").read_bytes())
    assert run_hook(hook, project, version) == []
    assert (contents(folder), contents(of_tests)) == (FILES, brought)


def test_without_npm(
    hook: SimpleNamespace, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    (warning,) = run_hook(hook, folder.parents[1])
    assert warning.endswith("npm is not on this machine, so thing@1.2.3 was not brought.")
    assert contents(folder) == {}
