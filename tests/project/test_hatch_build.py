"""The build hook, with a stand-in for npm that copies a package made here."""

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
    (tmp_path / "project" / "README.md").write_text("[How](docs/how.md)\n", encoding="utf-8")
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


@pytest.fixture(autouse=True)
def _nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Build a project without an address, unless a test says so."""
    monkeypatch.delenv("SEMSIG_REPOSITORY", raising=False)


def told(hook: SimpleNamespace, project: Path, **known: object) -> dict[str, Any]:
    """Return the metadata that the hook tells for a build."""
    metadata: dict[str, Any] = {"version": "1.2.3", **known}
    hook.ReleaseMetadataHook(str(project), {"license": "BSD-3-Clause"}).update(metadata)
    return metadata


def run_hook(hook: SimpleNamespace, project: Path, version: str, target: str) -> dict[str, Any]:
    """Run the build hook as hatchling does, and return what it made of each SBOM."""
    package = SimpleNamespace(core=SimpleNamespace(name="project"), version="4.5.6")
    arguments: list[Any] = [str(project), {}, None, package, "", target, None]
    build, data = hook.AssetsBuildHook(*arguments), {"sbom_files": list[str]()}
    build.initialize(version, data)
    return {Path(name).name: Path(name).read_text("utf-8") for name in data["sbom_files"]}


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files beside the manifest."""
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    del files["manifest.toml"]
    return files


def test_files_are_brought_once_and_again_when_they_change(
    hook: SimpleNamespace, folder: Path, npm: Path
) -> None:
    assert hook.bring_assets(folder) == tuple(FILES)
    assert contents(folder) == FILES
    npm.unlink()
    assert hook.bring_assets(folder) == ()
    assert not npm.exists()  # nothing was asked for
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
def test_what_cannot_be_brought_is_one_line_and_nothing_is_written(
    hook: SimpleNamespace,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    fault: tuple[str, str],
    reason: str,
) -> None:
    manifest = folder / "manifest.toml"
    text = manifest.read_text(encoding="utf-8")
    manifest.write_text(text.replace(*fault), encoding="utf-8")
    metadata = told(hook, folder.parents[1])
    (warning,) = capsys.readouterr().err.splitlines()
    assert warning.startswith("Maps will link Leaflet instead of containing it: ")
    assert re.search(reason, warning)
    assert contents(folder) == {}
    assert (metadata["license"], metadata["license-files"]) == ("BSD-3-Clause", ["LICENSE"])
    assert run_hook(hook, folder.parents[1], "standard", "wheel") == {}


@pytest.mark.usefixtures("npm")
def test_what_is_carried_is_in_the_licences_and_in_a_bill_of_materials(
    hook: SimpleNamespace, folder: Path
) -> None:
    # Here, because jsonschema takes a second.
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    metadata = told(hook, folder.parents[1])
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
@pytest.mark.parametrize(("version", "brought"), [("standard", {}), ("editable", FILES)])
def test_files_of_tests_are_for_who_works_on_it(
    hook: SimpleNamespace, folder: Path, version: str, brought: dict[str, bytes]
) -> None:
    project = folder.parents[1]
    of_tests = project / "tests" / "assets"
    of_tests.mkdir(parents=True)
    (of_tests / "manifest.toml").write_bytes((folder / "manifest.toml").read_bytes())
    assert run_hook(hook, project, version, "wheel") == {}
    assert contents(of_tests) == brought


def test_without_npm(
    hook: SimpleNamespace,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    told(hook, folder.parents[1])
    message = "npm is not on this machine, so thing@1.2.3 was not brought.\n"
    assert capsys.readouterr().err.endswith(message)
    assert contents(folder) == {}


@pytest.mark.usefixtures("npm")
def test_a_project_has_the_addresses_that_its_release_tells(
    hook: SimpleNamespace, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = folder.parents[1]
    without = told(hook, project)
    assert without["readme"]["text"] == "[How](docs/how.md)\n"
    assert list(without["urls"]) == ["Paper"]
    place = "https://forge.example/people/thing"
    monkeypatch.setenv("SEMSIG_REPOSITORY", f"{place}/")
    metadata = told(hook, project)
    assert metadata["readme"]["text"] == f"[How]({place}/blob/v1.2.3/docs/how.md)\n"
    assert metadata["urls"] == {
        **without["urls"],
        "Homepage": place,
        "Documentation": f"{place}/blob/v1.2.3/docs/index.md",
        "Repository": place,
        "Issues": f"{place}/issues",
        "Changelog": f"{place}/blob/v1.2.3/CHANGELOG.md",
    }
    # What an sdist was built with is not changed by who builds a wheel from it.
    kept = {name: without[name] for name in ("readme", "urls")}
    assert {name: told(hook, project, **kept)[name] for name in kept} == kept
    for wrong in ("forge.example/people/thing", "https://forge.example", "https://a.b/c d"):
        monkeypatch.setenv("SEMSIG_REPOSITORY", wrong)
        with pytest.raises(ValueError, match=r"which is not the address of a project; give one"):
            told(hook, project)


def test_the_readme_renders_without_a_link_to_a_file_beside_it(hook: SimpleNamespace) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    page = render(hook.absolute_links(text, "https://forge.example/people/thing", "v1.2.3"))
    assert page is not None
    linked = re.findall(r'(?:href|src)="([^"]*)"', page)
    assert [link for link in linked if not re.match(r"https?://|mailto:|#", link)] == []
    files = [link.partition("/v1.2.3/")[2].partition("#")[0] for link in linked]
    assert all((ROOT / name).exists() for name in files)
    pictures = re.findall(r'<img [^>]*src="([^"]*)"', page)
    assert [link for link in pictures if "/blob/" in link] == []
