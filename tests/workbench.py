"""Requests to the server of the workbench, over HTTP."""

from __future__ import annotations

import contextlib
import http.client
import io
import json
import struct
import threading
import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from machine import PATIENCE_S
from PIL import Image
from PIL.ExifTags import IFD

from semsig_gis.serve import make_server, open_listener

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from semsig_gis.serve import Workbench

TOKEN = "the-token-of-the-tests"  # noqa: S105 - of a server that lives for a test


@dataclass(frozen=True, kw_only=True)
class Page:
    """The page of a workbench and its running server."""

    bench: Workbench
    port: int
    token: str = TOKEN
    headers: dict[str, str] = field(default_factory=dict)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    def send(
        self, path: str, body: bytes | None = None, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """Return status code, headers and body of the answer to a request."""
        own = {"X-Semsig-Token": self.token, **self.headers}
        own |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        connection.request("GET" if body is None else "POST", path, body, own)
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        return answer.status, {key.lower(): value for key, value in answer.getheaders()}, content

    def ask(self, path: str, body: object = None, **headers: str) -> Any:  # noqa: ANN401 - any JSON
        """Return the JSON of an answer that must succeed."""
        data = None if body is None else json.dumps(body).encode()
        code, _, content = self.send(path, data, **headers)
        assert code == 200, content
        return json.loads(content)

    def refused(
        self, path: str, body: object = None, *words: str, code: int = 422, **headers: str
    ) -> None:
        """Check that a request is refused with a code and one line with some words."""
        data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
        status, answer_headers, content = self.send(path, data, **headers)
        assert answer_headers["content-type"] == "application/json"
        text = json.loads(content)["error"]
        assert status == code, text
        assert text.endswith(".")
        assert "\n" not in text
        assert "/tmp" not in text  # noqa: S108 - no path of the server
        assert [word for word in words if word not in text] == [], text


@contextlib.contextmanager
def serving(bench: Workbench) -> Iterator[Page]:
    """Serve a workbench in a thread for as long as the block runs."""
    with open_listener(0) as listener:
        running = make_server(bench, listener, token=TOKEN)
        thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield Page(bench=bench, port=listener.getsockname()[1])
        finally:
            running.should_exit = True
            thread.join()


def decompression_bomb() -> bytes:
    """Return a small PNG with a header of 30,000 x 30,000 pixels."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(kind + body))
        return struct.pack(">I", len(body)) + kind + body + check

    header = struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)
    data = zlib.compress(bytes(1_000_000))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data)


def picture(
    kind: str = "JPEG",
    *,
    size: tuple[int, int] = (400, 300),
    xmp: Mapping[str, object] | None = None,
    **sections: Mapping[Any, Any],
) -> bytes:
    """Return a JPEG picture with EXIF tags in the sections ``image``, ``exif`` and ``gps``.

    `kind` is another format, `size` another size, and `xmp` are values of Google's panoramas.
    """
    exif = Image.Exif()
    exif.update(sections.get("image", {}))
    exif.get_ifd(IFD.Exif).update(sections.get("exif", {}))
    exif.get_ifd(IFD.GPSInfo).update(sections.get("gps", {}))
    content = io.BytesIO()
    more: dict[str, Any] = {}
    if xmp is not None:
        values = " ".join(f'GPano:{name}="{value}"' for name, value in xmp.items())
        more["xmp"] = f"<rdf:Description {values}/>".encode()
    Image.new("RGB", size).save(content, kind, exif=exif.tobytes(), **more)
    return content.getvalue()


def coco(name: str, size: tuple[int, int], *boxes: tuple[str, list[float], float]) -> str:
    """Return boxes of benches and dogs in a photo (class, box, score) as a COCO file."""
    labels = {"bench": 1, "dog": 2}
    return json.dumps(
        {
            "images": [{"id": 1, "file_name": name, "width": size[0], "height": size[1]}],
            "categories": [{"id": number, "name": label} for label, number in labels.items()],
            "annotations": [
                {"image_id": 1, "category_id": labels[label], "bbox": box, "score": score}
                for label, box, score in boxes
            ],
        }
    )
