"""Cache folder of downloaded files, checked by checksum and safe for several processes.

A request has a key. Its entry is a body ``KEY-SHA.suffix`` and a sidecar ``KEY.meta.json`` with the
name of the body, its checksum, date and validators. Bodies never change: a new body has another
name, and becomes the entry when a rename replaces the sidecar. So a reader gets the old pair or the
new one. A download in progress is ``KEY.part``. A lock of the operating system, which a crash
releases, lets only one process work on an entry.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import lock_descriptor

from semsig_gis.core import InputError
from semsig_gis.storage import parse_json, whole_file

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

SUPERSEDED_S = 86_400.0  # a superseded body is deleted this long after its last use


@dataclass(frozen=True, slots=True)
class FileVersion:
    """Version of a file by the headers of a response; empty where a header is absent.

    `encoding` is the compression for the transfer, such as ``"gzip"``; `content_type` is in lower
    case.
    """

    etag: str = ""
    last_modified: str = ""
    encoding: str = ""
    content_type: str = ""

    @classmethod
    def from_headers(cls, headers: Mapping[str, str]) -> FileVersion:
        """Return the version that the headers of a response describe."""
        encoding = headers.get("Content-Encoding", "").strip().lower()
        return cls(
            etag=headers.get("ETag", ""),
            last_modified=headers.get("Last-Modified", ""),
            encoding="" if encoding == "identity" else encoding,
            content_type=headers.get("Content-Type", "").partition(";")[0].strip().lower(),
        )

    @property
    def if_range(self) -> str:
        """Value of If-Range to resume this version; a weak tag does not identify the bytes."""
        return self.last_modified if self.etag.startswith("W/") else self.etag or self.last_modified


@dataclass(frozen=True, slots=True, kw_only=True)
class Fetched:
    """A file that was fetched now or earlier (`from_cache`): its path and its source.

    `fetched_at` is in UTC in ISO 8601; `url` is the address after redirects. The last three come
    from the server, empty where it sent none.
    """

    path: Path
    sha256: str
    fetched_at: str
    url: str
    from_cache: bool
    bytes: int
    content_type: str
    etag: str
    last_modified: str

    @property
    def condition(self) -> dict[str, str]:
        """Headers that request the file only if it has changed."""
        headers = {"If-None-Match": self.etag, "If-Modified-Since": self.last_modified}
        return {name: value for name, value in headers.items() if value}


# Fields of `Fetched` in the sidecar, in addition to the name of the file and the request.
SIDECAR_FIELDS = ("url", "sha256", "fetched_at", "bytes", "content_type", "etag", "last_modified")


@dataclass(frozen=True, slots=True)
class Cache:
    """A folder of fetched files, created when the first file is stored."""

    folder: Path

    def entry(self, key: str) -> CacheEntry:
        """Return the entry of a request, which may be empty."""
        return CacheEntry(Path(self.folder), key)

    def forget(self, file: Fetched) -> None:
        """Make a file invalid, so that it is fetched again; its readers can still read it."""
        self.entry(file.path.name.partition("-")[0]).sidecar.unlink(missing_ok=True)

    @contextlib.contextmanager
    def locked(self, key: str) -> Iterator[CacheEntry]:
        """Provide the entry of a request while no other process works on it."""
        try:
            Path(self.folder).mkdir(parents=True, exist_ok=True)
            lock = (Path(self.folder) / f"{key}.lock").open("ab")
        except OSError as error:
            raise InputError(
                f"cache folder {self.folder} cannot be written ({error.strerror}); "
                "choose a folder you can write to."
            ) from error
        with lock:
            lock_descriptor(lock.fileno())  # closing releases it
            yield self.entry(key)


@dataclass(frozen=True, slots=True)
class CacheEntry:
    """Files in a cache folder that belong to one request."""

    folder: Path
    key: str

    @property
    def sidecar(self) -> Path:
        """Path of the JSON file that describes the body."""
        return self.folder / f"{self.key}.meta.json"

    @property
    def part(self) -> Path:
        """Path of the bytes received until now, as they were sent."""
        return self.folder / f"{self.key}.part"

    @property
    def _part_info(self) -> Path:
        return self.folder / f"{self.key}.part.json"

    def temporary_path(self, suffix: str) -> Path:
        """Return a path for unpacking a body, for the process that has the lock."""
        return self.folder / f"{self.key}.tmp{suffix}"

    def cached_file(self) -> Fetched | None:
        """Return the cached file, or None if it is absent or damaged."""
        try:
            meta = parse_json(self.sidecar.read_text(encoding="utf-8"))
            path = self.folder / Path(meta["file"]).name
            fields = {name: meta[name] for name in SIDECAR_FIELDS}
            cached = Fetched(path=path, from_cache=True, **fields)
            if checksum(path) != cached.sha256:
                return None
        except (OSError, KeyError, TypeError, ValueError):
            return None
        with contextlib.suppress(OSError):  # a cache on a read-only disk can still be read
            path.touch()  # so that `store` does not delete a body in use
        return cached

    def store(
        self,
        body: Path,
        *,
        sha256: str,
        url: str,
        request: Mapping[str, object],
        version: FileVersion | None = None,
    ) -> Fetched:
        """Move a body from `temporary_path` into the entry, delete the part and return the file.

        `request` is stored for people who look into the cache.
        """
        version = version or FileVersion()
        fetched = Fetched(
            path=self.folder / f"{self.key}-{sha256[:16]}{body.suffix}",
            sha256=sha256,
            fetched_at=datetime.now(UTC).isoformat(timespec="seconds"),
            url=url,
            from_cache=False,
            bytes=body.stat().st_size,
            content_type=version.content_type,
            etag=version.etag,
            last_modified=version.last_modified,
        )
        body.replace(fetched.path)
        meta = {name: getattr(fetched, name) for name in SIDECAR_FIELDS}
        with whole_file(self.sidecar) as partial:
            content = {"request": request, "url": url, "file": fetched.path.name, **meta}
            partial.write_text(json.dumps(content, indent=1), encoding="utf-8")
        self.drop_part()
        # Another process may still read the previous body, so only old ones are deleted.
        for old in self.folder.glob(f"{self.key}-*"):
            if old != fetched.path and old.stat().st_mtime < time.time() - SUPERSEDED_S:
                old.unlink(missing_ok=True)
        return fetched

    def resumable(self) -> tuple[int, FileVersion]:
        """Return the number of bytes in the part and their version; 0 if it cannot be resumed."""
        try:
            size = self.part.stat().st_size
            version = FileVersion(**parse_json(self._part_info.read_text(encoding="utf-8")))
        except (OSError, TypeError, ValueError):
            return 0, FileVersion()
        return (size, version) if version.if_range else (0, FileVersion())

    def start_part(self, version: FileVersion) -> None:
        """Discard an incomplete download, and record the version of the one that begins."""
        self.drop_part()
        self._part_info.write_text(json.dumps(dataclasses.asdict(version)), encoding="utf-8")

    def drop_part(self) -> None:
        """Delete the bytes received until now."""
        self.part.unlink(missing_ok=True)
        self._part_info.unlink(missing_ok=True)


def cache_key(what: Sequence[object]) -> str:
    """Return the key of the entry for a request, given as values for JSON."""
    return hashlib.sha256(json.dumps(what).encode()).hexdigest()[:32]


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
