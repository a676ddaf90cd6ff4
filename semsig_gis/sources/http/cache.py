"""A folder of what was fetched: whole files, known by checksum, shared safely by processes.

A request is known by a key. Its entry is a body ``KEY-SHA.suffix`` and a sidecar ``KEY.meta.json``
that names the body, with its checksum, date and validators. Bodies never change: a new one has
another name, and becomes the entry when the sidecar is replaced by rename. So a reader meets the
old pair or the new one, nothing between. What is under way is ``KEY.part``; a lock of the operating
system, which a crash releases, lets one process at a time work on an entry.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import lock_descriptor

from semsig_gis.core import InputError
from semsig_gis.storage import parse_json, whole_file

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

KEPT_S = 86_400.0  # how long a superseded body stays after its last use


@dataclass(frozen=True, slots=True)
class Edition:
    """What a server says of the file that it sends; empty where it says nothing.

    `encoding` is how it is packed for sending, such as ``"gzip"``, `content_type` in lower case.
    """

    etag: str = ""
    last_modified: str = ""
    encoding: str = ""
    content_type: str = ""

    @classmethod
    def of(cls, headers: Mapping[str, str]) -> Edition:
        """Return the edition that the headers of a response describe."""
        encoding = headers.get("Content-Encoding", "").strip().lower()
        return cls(
            etag=headers.get("ETag", ""),
            last_modified=headers.get("Last-Modified", ""),
            encoding="" if encoding == "identity" else encoding,
            content_type=headers.get("Content-Type", "").partition(";")[0].strip().lower(),
        )

    @property
    def if_range(self) -> str:
        """Return what asks for the rest of this very edition; a weak tag does not promise that."""
        return self.last_modified if self.etag.startswith("W/") else self.etag or self.last_modified


@dataclass(frozen=True, slots=True, kw_only=True)
class Fetched:
    """A file that was fetched, now or earlier (`from_cache`): where it lies and came from.

    `fetched_at` is in UTC by ISO 8601; `url` is the address after redirects. The last three are the
    server's words, empty where it said nothing.
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
        """Return headers that ask for the file only if it is another edition."""
        headers = {"If-None-Match": self.etag, "If-Modified-Since": self.last_modified}
        return {name: value for name, value in headers.items() if value}


# What the sidecar keeps of it, beside the name of the file and the request.
KEPT = ("url", "sha256", "fetched_at", "bytes", "content_type", "etag", "last_modified")


@dataclass(frozen=True, slots=True)
class Cache:
    """A folder of fetched files, made when something is put in it."""

    folder: Path

    def entry(self, key: str) -> Entry:
        """Return the entry of a request, which may hold nothing yet."""
        return Entry(Path(self.folder), key)

    def forget(self, file: Fetched) -> None:
        """Have a file fetched anew the next time; it stays for those who read it."""
        Entry(Path(self.folder), file.path.name.partition("-")[0]).sidecar.unlink(missing_ok=True)

    @contextlib.contextmanager
    def locked(self, key: str) -> Iterator[Entry]:
        """Give the entry of a request while no other process works on it."""
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
class Entry:
    """What the cache in a folder holds for the request of one key."""

    folder: Path
    key: str

    @property
    def sidecar(self) -> Path:
        """Return the path of the description of the body."""
        return self.folder / f"{self.key}.meta.json"

    @property
    def part(self) -> Path:
        """Return the path of what has arrived so far, as it was sent."""
        return self.folder / f"{self.key}.part"

    @property
    def _part_info(self) -> Path:
        return self.folder / f"{self.key}.part.json"

    def scratch(self, suffix: str) -> Path:
        """Return a path to unpack a body to, for the holder of the lock."""
        return self.folder / f"{self.key}.tmp{suffix}"

    def copy(self) -> Fetched | None:
        """Return the cached copy, or None where there is none or it is damaged."""
        try:
            meta = parse_json(self.sidecar.read_text(encoding="utf-8"))
            path = self.folder / Path(meta["file"]).name
            copy = Fetched(path=path, from_cache=True, **{name: meta[name] for name in KEPT})
            if checksum(path) != copy.sha256:
                return None
        except (OSError, KeyError, TypeError, ValueError):
            return None
        with contextlib.suppress(OSError):  # a cache on a read-only disk serves all the same
            path.touch()  # still wanted, see `store`
        return copy

    def store(self, fetched: Fetched, request: Mapping[str, object]) -> Fetched:
        """Make a checked body, at `scratch`, the entry; forget what was under way; return its file.

        `request` is kept for people who look into the cache.
        """
        final = self.folder / f"{self.key}-{fetched.sha256[:16]}{fetched.path.suffix}"
        fetched.path.replace(final)
        meta = {name: getattr(fetched, name) for name in KEPT}
        with whole_file(self.sidecar) as partial:
            content = {"request": request, "url": fetched.url, "file": final.name, **meta}
            partial.write_text(json.dumps(content, indent=1), encoding="utf-8")
        self.drop_part()
        # Another process may have been given the path of the former body and has yet to read it.
        for old in self.folder.glob(f"{self.key}-*"):
            if old != final and old.stat().st_mtime < time.time() - KEPT_S:
                old.unlink(missing_ok=True)
        return dataclasses.replace(fetched, path=final)

    def resumable(self) -> tuple[int, Edition]:
        """Return how many bytes have arrived, and of what; 0 where the rest cannot be asked for."""
        try:
            size = self.part.stat().st_size
            edition = Edition(**parse_json(self._part_info.read_text(encoding="utf-8")))
        except (OSError, TypeError, ValueError):
            return 0, Edition()
        return (size, edition) if edition.if_range else (0, Edition())

    def start_part(self, edition: Edition) -> None:
        """Begin an empty part."""
        self.drop_part()
        self._part_info.write_text(json.dumps(dataclasses.asdict(edition)), encoding="utf-8")

    def drop_part(self) -> None:
        """Forget what has arrived so far."""
        self.part.unlink(missing_ok=True)
        self._part_info.unlink(missing_ok=True)


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
