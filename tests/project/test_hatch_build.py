"""Test the build hooks with a fake npm that copies a local package."""

from __future__ import annotations

import hashlib
import io
import json
import re
import runpy
import sys
import tarfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from readme_renderer.markdown import render

ROOT = Path(__file__).parents[2]
FILES = {
    "thing.js": b"window.thing = 1;\n",
    "picture.png": b"\x89PNG not really",
    "thing.LICENSE.txt": b"Do as you like.\n",
}
SUMS = {name: hashlib.sha256(content).hexdigest() for name, content in FILES.items()}

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for npm is a shell script"),
    pytest.mark.skipif(
        not (ROOT / "hatch_build.py").is_file(), reason="the tests do not run from a checkout"
    ),
]


@pytest.fixture(scope="module")
def hook() -> SimpleNamespace:
    """Return the names that the build hook defines."""
    return SimpleNamespace(**runpy.run_path(str(ROOT / "hatch_build.py")))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder for the files of one package, in a new project."""
    lines = ["[[package]]", 'name = "thing"', 'version = "1.2.3"', 'license = "MIT"']
    for name, checksum in SUMS.items():
        lines += ["[[package.file]]", f'path = "dist/{name}"', f'target = "{name}"']
        lines += [f'sha256 = "{checksum}"']
    assets = tmp_path / "project" / "semsig_gis" / "assets"
    assets.mkdir(parents=True)
    (assets / "manifest.toml").write_text("\n".join(lines), encoding="utf-8")
    (tmp_path / "project" / "README.md").write_text("[How](docs/how.md)\n", encoding="utf-8")
    return assets


@pytest.fixture
def npm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put an npm with one package on the path, and return the log of its calls."""
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


@pytest.fixture(autouse=True)
def _nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Build a project without an address, unless a test sets one."""
    monkeypatch.delenv("SEMSIG_REPOSITORY", raising=False)


def build_metadata(hook: SimpleNamespace, project: Path, **values: object) -> dict[str, Any]:
    """Return the metadata of a build, as changed by the hook."""
    metadata: dict[str, Any] = {"version": "1.2.3", **values}
    hook.ReleaseMetadataHook(str(project), {"license": "BSD-3-Clause"}).update(metadata)
    return metadata


def run_hook(hook: SimpleNamespace, project: Path, version: str, target: str) -> dict[str, Any]:
    """Run the build hook as hatchling does, and return the texts of the SBOMs."""
    package = SimpleNamespace(core=SimpleNamespace(name="project"), version="4.5.6")
    arguments: list[Any] = [str(project), {}, None, package, "", target, None]
    build, data = hook.AssetsBuildHook(*arguments), {"sbom_files": list[str]()}
    build.initialize(version, data)
    return {Path(name).name: Path(name).read_text("utf-8") for name in data["sbom_files"]}


def contents(folder: Path) -> dict[str, bytes]:
    """Return the contents of the files except the manifest."""
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    del files["manifest.toml"]
    return files


def test_files_are_downloaded_once_and_again_when_they_change(
    hook: SimpleNamespace, folder: Path, npm: Path
) -> None:
    assert hook.bring_assets(folder) == tuple(FILES)
    assert contents(folder) == FILES
    npm.unlink()
    assert hook.bring_assets(folder) == ()
    assert not npm.exists()  # npm was not called
    (folder / "thing.js").write_bytes(b"something else")
    assert hook.bring_assets(folder) == ("thing.js",)
    assert contents(folder) == FILES


@pytest.mark.usefixtures("npm")
@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (
            (hashlib.sha256(FILES["picture.png"]).hexdigest(), "0" * 64),
            r"png of thing@1\.2\.3 .* refused",
        ),
        (("dist/thing", "lib/thing"), r"lib/thing\.js cannot be read from thing@1\.2\.3"),
        (
            ("1.2.3", "9.9.9"),
            r"npm pack thing@9\.9\.9 .*\(CalledProcessError, no such package\)",
        ),
    ],
)
def test_failed_download_prints_one_line_and_writes_nothing(
    hook: SimpleNamespace,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    fault: tuple[str, str],
    reason: str,
) -> None:
    manifest = folder / "manifest.toml"
    text = manifest.read_text(encoding="utf-8")
    manifest.write_text(text.replace(*fault), encoding="utf-8")
    metadata = build_metadata(hook, folder.parents[1])
    (warning,) = capsys.readouterr().err.splitlines()
    assert warning.startswith("Maps will link Leaflet instead of containing it: ")
    assert re.search(reason, warning)
    assert contents(folder) == {}
    assert (metadata["license"], metadata["license-files"]) == ("BSD-3-Clause", ["LICENSE"])
    assert run_hook(hook, folder.parents[1], "standard", "wheel") == {}


@pytest.mark.usefixtures("npm")
def test_included_files_are_in_the_licences_and_the_bill_of_materials(
    hook: SimpleNamespace, folder: Path
) -> None:
    # Imported here, because jsonschema takes a second.
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    metadata = build_metadata(hook, folder.parents[1])
    assert contents(folder) == FILES
    assert metadata["license"] == "BSD-3-Clause AND MIT"
    assert metadata["license-files"] == ["LICENSE", "semsig_gis/assets/thing.LICENSE.txt"]
    assert run_hook(hook, folder.parents[1], "standard", "sdist") == {}
    (name, bill), *others = run_hook(hook, folder.parents[1], "standard", "wheel").items()
    assert (name, others) == ("assets.cdx.json", [])
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(bill) is None
    (thing,) = json.loads(bill)["components"]
    assert (thing["purl"], thing["licenses"]) == (
        "pkg:npm/thing@1.2.3",
        [{"license": {"id": "MIT"}}],
    )
    assert {file["name"]: file["hashes"][0]["content"] for file in thing["components"]} == SUMS


@pytest.mark.usefixtures("npm")
@pytest.mark.parametrize(("version", "files"), [("standard", {}), ("editable", FILES)])
def test_only_editable_builds_download_the_files_of_tests(
    hook: SimpleNamespace, folder: Path, version: str, files: dict[str, bytes]
) -> None:
    project = folder.parents[1]
    of_tests = project / "tests" / "assets"
    of_tests.mkdir(parents=True)
    (of_tests / "manifest.toml").write_bytes((folder / "manifest.toml").read_bytes())
    assert run_hook(hook, project, version, "wheel") == {}
    assert contents(of_tests) == files


def test_missing_npm_is_reported(
    hook: SimpleNamespace,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    build_metadata(hook, folder.parents[1])
    message = "npm is not on this machine, so thing@1.2.3 was not brought.\n"
    assert capsys.readouterr().err.endswith(message)
    assert contents(folder) == {}


@pytest.mark.usefixtures("npm")
def test_a_release_sets_the_addresses_of_the_project(
    hook: SimpleNamespace, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = folder.parents[1]
    without = build_metadata(hook, project)
    assert without["readme"]["text"] == "[How](docs/how.md)\n"
    assert list(without["urls"]) == ["Paper"]
    place = "https://forge.example/people/thing"
    monkeypatch.setenv("SEMSIG_REPOSITORY", f"{place}/")
    metadata = build_metadata(hook, project)
    assert metadata["readme"]["text"] == f"[How]({place}/blob/v1.2.3/docs/how.md)\n"
    assert metadata["urls"] == {
        **without["urls"],
        "Homepage": place,
        "Documentation": f"{place}/blob/v1.2.3/docs/index.md",
        "Repository": place,
        "Issues": f"{place}/issues",
        "Changelog": f"{place}/blob/v1.2.3/CHANGELOG.md",
    }
    # Values of an sdist are not changed when a wheel is built from it.
    values = {name: without[name] for name in ("readme", "urls")}
    assert values.items() <= build_metadata(hook, project, **values).items()
    for wrong in ("forge.example/people/thing", "https://forge.example", "https://a.b/c d"):
        monkeypatch.setenv("SEMSIG_REPOSITORY", wrong)
        with pytest.raises(ValueError, match=r"which is not the address of a project; give one"):
            build_metadata(hook, project)


def test_the_readme_of_a_release_has_no_relative_links(hook: SimpleNamespace) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    page = render(hook.absolute_links(text, "https://forge.example/people/thing", "v1.2.3"))
    assert page is not None
    linked = re.findall(r'(?:href|src)="([^"]*)"', page)
    assert [link for link in linked if not re.match(r"https?://|mailto:|#", link)] == []
    files = [link.partition("/v1.2.3/")[2].partition("#")[0] for link in linked]
    assert all((ROOT / name).exists() for name in files)
    pictures = re.findall(r'<img [^>]*src="([^"]*)"', page)
    assert [link for link in pictures if "/blob/" in link] == []
