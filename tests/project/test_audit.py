"""Test the check of pinned versions, with a local service of known vulnerabilities."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from machine import PATIENCE_S
from servers import Answer, Server

if TYPE_CHECKING:
    from collections.abc import Container

    from servers import Request

AUDIT = Path(__file__).parents[2] / ".ci" / "audit"
PROBE = ("jinja2", "2.11.2")
NOT_CHECKED = (
    "No service of known vulnerabilities could be asked, so the pinned versions were not checked.\n"
)

pytestmark = [
    pytest.mark.skipif(not AUDIT.is_file(), reason="the tests do not run from a checkout"),
    pytest.mark.skipif(sys.platform == "win32", reason="the check is a script for bash"),
]


def audit(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    vulnerable: Container[tuple[str, str]],
    *,
    status: int = 200,
) -> subprocess.CompletedProcess[str]:
    """Check two pins with a service that reports vulnerabilities in some versions of packages."""
    pins = folder / "constraints.txt"
    pins.write_text("jinja2==3.1.6\nnumpy==2.4.0\n")

    def answer(request: Request) -> Answer:
        query = json.loads(request.body)
        name = query["package"]["name"]
        package = {"name": name, "ecosystem": "PyPI"}
        ranges = [{"type": "ECOSYSTEM", "events": [{"introduced": "0"}, {"fixed": "999"}]}]
        finding = {"id": f"X-{name}", "affected": [{"package": package, "ranges": ranges}]}
        body = {"vulns": [finding]} if (name, query["version"]) in vulnerable else {}
        return Answer(json.dumps(body).encode(), status=status)

    with Server() as server:
        server.on("/query", answer)
        monkeypatch.setenv("PIP_AUDIT_VULNERABILITY_SERVICE", "osv")
        monkeypatch.setenv("PIP_AUDIT_OSV_URL", f"{server.url}/query")
        return subprocess.run(
            [AUDIT, sys.executable, pins],
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )


@pytest.mark.parametrize("status", [200, 503], ids=["mirror", "down"])
def test_a_service_without_data_or_answer_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int
) -> None:
    result = audit(tmp_path, monkeypatch, vulnerable=(), status=status)
    assert (result.returncode, result.stdout) == (0, NOT_CHECKED)


def test_a_finding_in_a_pinned_version_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert audit(tmp_path, monkeypatch, [PROBE]).returncode == 0
    result = audit(tmp_path, monkeypatch, [PROBE, ("numpy", "2.4.0")])
    assert result.returncode == 1
    assert "X-numpy" in result.stdout
    assert "jinja2" not in result.stdout
