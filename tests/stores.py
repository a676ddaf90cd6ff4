"""An object store on the loopback interface, with the part of S3 that public buckets need."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import quote, unquote
from xml.sax.saxutils import escape

from servers import Answer

if TYPE_CHECKING:
    from pathlib import Path

    from servers import Request, Server

XML = "application/xml"


def keep_in_bucket(server: Server, bucket: str, folder: Path) -> str:
    """Publish the files of a folder in a bucket; return its address for a catalogue."""
    files = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}

    def listing(request: Request) -> Answer:
        prefix, end = request.query.get("prefix", ""), request.query.get("delimiter", "")
        keys = sorted(key for key in files if key.startswith(prefix))
        rest = {key: key.removeprefix(prefix) for key in keys}
        folders = sorted({r.partition(end)[0] + end for r in rest.values() if end and end in r})
        parts = [f"<CommonPrefixes><Prefix>{escape(prefix + f)}</Prefix></CommonPrefixes>"
                 for f in folders]  # fmt: skip
        parts += [
            f"<Contents><Key>{escape(key)}</Key><Size>{files[key].stat().st_size}</Size></Contents>"
            for key in keys
            if not (end and end in rest[key])
        ]
        count = f"<KeyCount>{len(parts)}</KeyCount><IsTruncated>false</IsTruncated>"
        body = f'<?xml version="1.0"?><ListBucketResult>{count}{"".join(parts)}</ListBucketResult>'
        return Answer(body.encode(), type=XML)

    def file(request: Request) -> Answer:
        body = files[unquote(request.path).removeprefix(f"/{bucket}/")].read_bytes()
        byte_range = request.headers.get("range", "").removeprefix("bytes=")
        if not byte_range:
            return Answer(body)
        start, last = (int(number) for number in byte_range.split("-"))
        span = f"bytes {start}-{min(last, len(body) - 1)}/{len(body)}"
        return Answer(body[start : last + 1], status=206, headers={"Content-Range": span})

    server.on(f"/{bucket}", listing)
    for key in files:
        server.on(f"/{bucket}/{quote(key)}", file)
    return f"s3://{bucket}?endpoint_override=127.0.0.1:{server.port}&scheme=http&region=us-west-2"
