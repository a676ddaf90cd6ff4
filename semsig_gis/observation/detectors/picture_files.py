"""Find the files of pictures, by the names that programs give them."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from semsig_gis.core import InputError, nearest_name

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from semsig_gis.observation.detectors.pictures import AnnotatedPicture

PICTURE_SUFFIXES = (
    *(".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff"),
    *(".heic", ".heif", ".avif", ".mpo"),
)


@dataclass(frozen=True, slots=True)
class PictureFiles:
    """The pictures in folders; None for the folders near the files of detections."""

    folders: Sequence[Path] | None
    _listings: dict[tuple[Path, bool], dict[str, list[Path]]] = field(
        default_factory=dict, init=False, repr=False
    )

    def find(self, picture: AnnotatedPicture) -> list[Path]:
        """Return the files that may be of a picture, best first, without regard to case and kind.

        InputError if folders in that of the pictures have several.
        """
        for folder in picture.folders if self.folders is None else self.folders:
            for path in (folder / name for name in picture.names):
                if path.is_file():
                    return [path]
                if files := self._listing(path.parent).get(_key(path.name)):
                    return files
            for name in picture.names if self.folders else ():
                files = self._listing(folder, deep=True).get(_key(name), [])
                if len(files) > 1:
                    raise InputError(
                        f"{picture.name} may be {files[0]} or {files[1]}; give the folder of the "
                        "right one as --images."
                    )
                if files:
                    return files
        return []

    def _listing(self, folder: Path, *, deep: bool = False) -> dict[str, list[Path]]:
        """Return the pictures of a folder by name, with and without suffix, without case.

        With `deep`, those of folders in it as well.
        """
        if (folder, deep) not in self._listings:
            listing: dict[str, list[Path]] = {}
            files = folder.rglob("*") if deep else folder.iterdir() if folder.is_dir() else ()
            pictures = [file for file in files if file.suffix.lower() in PICTURE_SUFFIXES]
            pictures.sort(key=lambda file: (PICTURE_SUFFIXES.index(file.suffix.lower()), file))
            for file in pictures:
                listing.setdefault(_key(file.name), []).append(file)
            for file in pictures:
                listing.setdefault(_key(file.stem), []).append(file)
            self._listings[folder, deep] = listing
        return self._listings[folder, deep]

    def searched(self, picture: AnnotatedPicture) -> str:
        """Return a note for messages on the folder where the file of a picture is missing."""
        folders = picture.folders if self.folders is None else self.folders
        if not folders or self.find(picture):
            return ""
        listing = self._listing(folders[0], deep=bool(self.folders))
        names = {file.name for files in listing.values() for file in files}
        nearest = nearest_name(PurePosixPath(picture.name.replace("\\", "/")).name, sorted(names))
        return f" ({picture.name} is not in {folders[0]}{nearest})"


def _key(name: str) -> str:
    """Return a name of a file for comparison, without case and forms of accents."""
    return unicodedata.normalize("NFC", name).casefold()
