"""CSV files in any encoding and with any usual separator."""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import itertools
import re
import unicodedata
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING

from charset_normalizer import from_bytes

from semsig_gis.core import SourceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

SEPARATORS = ";,\t"
# A geometry may be longer than the 128 KiB that Python's reader allows by default.
MOST_VALUE_CHARACTERS = 2**24
READ_BYTES = 2**20
# In this order: the marks of UTF-32 start with the marks of UTF-16.
MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
# Encodings of tables, the most frequent first; the first of equally good ones is chosen.
ENCODINGS = ("cp1252", "cp1250", "cp1251", "cp1253", "cp1254", "cp1255", "cp1256", "cp1257",
             "iso8859_2", "iso8859_5", "iso8859_7", "koi8_r", "mac_roman", "cp437", "cp850",
             "cp866", "cp932", "euc_jp", "gb18030", "big5", "cp949")  # fmt: skip
WIDE_ENCODINGS = ("utf_16_le", "utf_16_be", "utf_32_le", "utf_32_be")
SAMPLE_WORDS = 5_000
SYMBOLS = frozenset({"No", "Sc", "Sk", "Sm", "So"})
NO_WORDS = re.compile(rb'[\s;,"0-9]+')
DAMAGED = "\N{REPLACEMENT CHARACTER}"


@dataclass(frozen=True, slots=True)
class CsvFile:
    """A CSV file with its encoding and its possible separators.

    `what` is its name in messages, `errors` the error handler for bytes that are not text, `notes`
    are remarks for the user. `layouts` has the stripped column names by separator.
    """

    open: Callable[[], IO[bytes]]
    what: str
    encoding: str
    errors: str
    layouts: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...] = ()

    @property
    def separator(self) -> str:
        """The separator that gives the most columns."""
        return max(self.layouts, key=lambda separator: len(self.layouts[separator]))

    def rows(self, separator: str) -> Iterator[dict[str, str | None] | str]:
        """Yield every row as values by column name, or the text of its error.

        Missing values at the end are None; surplus blank values are left out.
        """
        names = self.layouts[separator]
        for values in itertools.islice(self._values(separator), 1, None):
            if isinstance(values, str):
                yield values
            elif any(value.strip() for value in values[len(names) :]):
                yield f"has {len(values)} values, and the header has {len(names)} names"
            elif values:
                missing = [None] * (len(names) - len(values))
                # Of columns with the same name, the first counts.
                pairs = zip(names, [*values[: len(names)], *missing], strict=True)
                yield dict(reversed(list(pairs)))

    def _values(self, separator: str) -> Iterator[list[str] | str]:
        before = csv.field_size_limit(MOST_VALUE_CHARACTERS)
        try:
            with io.TextIOWrapper(self.open(), self.encoding, self.errors, newline="") as stream:
                # Strict, because an unclosed quote would make all rows after it one value.
                rows = csv.reader(stream, delimiter=separator, strict=True)
                while True:
                    try:
                        yield next(rows)
                    except StopIteration:
                        return
                    except csv.Error as error:
                        yield f"cannot be read ({error})"
        except UnicodeDecodeError as error:
            raise _unknown_encoding(self.what) from error
        finally:
            csv.field_size_limit(before)


def open_csv(open_: Callable[[], IO[bytes]], what: str) -> CsvFile:
    """Detect encoding and separators of a CSV file.

    Without a byte order mark the encoding is UTF-8 if the text is valid, else the guess of
    charset-normalizer. SourceError if the file is empty, not text, or its encoding is unknown.
    """
    encoding, errors, notes = _encoding(open_, what)
    layouts: dict[str, tuple[str, ...]] = {}
    file = CsvFile(open_, what, encoding, errors, layouts, notes)
    for separator in SEPARATORS:
        names = next(file._values(separator), [])  # noqa: SLF001 - of this class
        layouts[separator] = () if isinstance(names, str) else tuple(map(str.strip, names))
    if not any(name for names in layouts.values() for name in names):
        raise SourceError(
            f"{what} is empty; give a file that begins with the names of its columns."
        )
    return file


def _encoding(open_: Callable[[], IO[bytes]], what: str) -> tuple[str, str, tuple[str, ...]]:
    """Return the encoding of a file, the handler of decoding errors, and notes."""
    with open_() as stream:
        head = stream.read(READ_BYTES)
        marked = (name for mark, name in MARKS.items() if head.startswith(mark))
        if (encoding := next(marked, None)) and encoding != "utf-8-sig":
            return encoding, "strict", ()
        decoder = codecs.getincrementaldecoder("utf-8-sig")("replace")
        # `wide` counts null bytes, of UTF-16 or UTF-32; `good` and `bad` count characters that are
        # not ASCII and valid in UTF-8, or not valid.
        wide = good = bad = 0
        words: dict[bytes, None] = {}
        for block in itertools.chain([head], iter(lambda: stream.read(READ_BYTES), b"")):
            wide += block.count(0)
            if not block.isascii():
                text = decoder.decode(block)
                damaged = text.count(DAMAGED)
                bad += damaged
                good += len(text) - len(text.encode("ascii", "ignore")) - damaged
                if len(words) < SAMPLE_WORDS:
                    parts = NO_WORDS.split(block)
                    words |= dict.fromkeys(part for part in parts if not part.isascii())
    bad += decoder.decode(b"", final=True).count(DAMAGED)
    if encoding or (not wide and (good > bad or not bad)):
        note = f"{bad:,} places are not UTF-8 and are read as {DAMAGED}"
        return "utf-8-sig", *(("replace", (note,)) if bad else ("strict", ()))
    # Guess from the words that are not ASCII, because the others are the same in any encoding.
    sample = head if wide else b" ".join(words)
    candidates = WIDE_ENCODINGS if wide else ENCODINGS
    matches = from_bytes(sample[: 2**16], cp_isolation=list(candidates), enable_fallback=False)
    # A match may list several encodings in which the sample is the same text.
    ranked = [
        (match.chaos + _symbol_share(str(match)), -match.coherence, number, name)
        for match in matches
        for number, name in enumerate(candidates)
        if name in match.could_be_from_charset
    ]
    *_, best = min(ranked, default=(None,))
    text = "\0" if wide else ""
    if wide and best is not None:
        with contextlib.suppress(UnicodeDecodeError):
            text = codecs.getincrementaldecoder(best)().decode(head)
    if best is None or "\0" in text:
        raise _unknown_encoding(what)
    return best, "strict", (f"the file is not in UTF-8; it is read as {best}",)


def _symbol_share(text: str) -> float:
    """Return the share of symbols in the characters that are not ASCII."""
    # Words consist of letters, so that symbols show a wrong encoding.
    foreign = [letter for letter in text if not letter.isascii()]
    symbols = sum(unicodedata.category(letter) in SYMBOLS or letter in "¿¡" for letter in foreign)
    return symbols / max(len(foreign), 1)


def _unknown_encoding(what: str) -> SourceError:
    return SourceError(f"{what} is in an unknown encoding; save it as CSV in UTF-8.")
