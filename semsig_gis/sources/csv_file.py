"""CSV files as they come: in any encoding, with any usual separator, and blanks around names."""

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
# A shape may be longer than the 128 KiB that Python's reader allows.
LONGEST_VALUE = 2**24
BLOCK = 2**20
# Those of 32 bits begin like those of 16.
MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
# What tables are saved in, those of most tables first, which decides between equals.
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
    """A CSV file whose encoding is known.

    `what` is its name in messages, `errors` what becomes of bytes that are no text, `notes` what
    was found out. `layouts` has the names of the columns by separator, without blanks around them.
    """

    open: Callable[[], IO[bytes]]
    what: str
    encoding: str
    errors: str
    layouts: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...] = ()

    @property
    def separator(self) -> str:
        """The separator that makes the most columns."""
        return max(self.layouts, key=lambda separator: len(self.layouts[separator]))

    def rows(self, separator: str) -> Iterator[dict[str, str | None] | str]:
        """Yield every row by the names of its columns, or what is wrong with it.

        Values that a row lacks at its end are None; blank ones that it has too many are left out.
        """
        names = self.layouts[separator]
        for values in itertools.islice(self._values(separator), 1, None):
            if isinstance(values, str):
                yield values
            elif any(value.strip() for value in values[len(names) :]):
                yield f"has {len(values)} values, and the header has {len(names)} names"
            elif values:
                missing = [None] * (len(names) - len(values))
                # Of two columns of one name, the first counts.
                pairs = zip(names, [*values[: len(names)], *missing], strict=True)
                yield dict(reversed(list(pairs)))

    def _values(self, separator: str) -> Iterator[list[str] | str]:
        before = csv.field_size_limit(LONGEST_VALUE)
        try:
            with self._text() as stream:
                # Strict, because a quote that is never closed would swallow all the rows below it.
                rows = csv.reader(stream, delimiter=separator, strict=True)
                while True:
                    try:
                        yield next(rows)
                    except StopIteration:
                        return
                    except csv.Error as error:
                        yield f"cannot be read ({error})"
        except UnicodeDecodeError as error:
            raise _unknown(self.what) from error
        finally:
            csv.field_size_limit(before)

    def _text(self) -> io.TextIOWrapper:
        return io.TextIOWrapper(self.open(), self.encoding, self.errors, newline="")


def open_csv(open_: Callable[[], IO[bytes]], what: str) -> CsvFile:
    """Look at a CSV file; SourceError if it is empty, no text, or in no encoding that can be told.

    Without a byte order mark it is UTF-8 if it can be, else what charset-normalizer takes it for.
    """
    encoding, errors, notes = _encoding(open_, what)
    file = CsvFile(open_, what, encoding, errors, {}, notes)
    layouts = {}
    for separator in SEPARATORS:
        names = next(file._values(separator), [])  # noqa: SLF001 - of this very class
        layouts[separator] = () if isinstance(names, str) else tuple(map(str.strip, names))
    if not any(name for names in layouts.values() for name in names):
        raise SourceError(
            f"{what} is empty; give a file that begins with the names of its columns."
        )
    return CsvFile(open_, what, encoding, errors, layouts, notes)


def _encoding(open_: Callable[[], IO[bytes]], what: str) -> tuple[str, str, tuple[str, ...]]:
    """Return the encoding of a file, what becomes of bytes that are not in it, and a note."""
    with open_() as stream:
        head = stream.read(BLOCK)
        marked = (name for mark, name in MARKS.items() if head.startswith(mark))
        if (encoding := next(marked, None)) and encoding != "utf-8-sig":
            return encoding, "strict", ()
        decoder = codecs.getincrementaldecoder("utf-8-sig")("replace")
        wide = good = bad = 0
        words: dict[bytes, None] = {}
        for block in itertools.chain([head], iter(lambda: stream.read(BLOCK), b"")):
            wide += block.count(0)
            if not block.isascii():
                text = decoder.decode(block)
                damaged = text.count(DAMAGED)
                bad += damaged
                good += len(text) - len(text.encode("ascii", "ignore")) - damaged
                if len(words) < SAMPLE_WORDS:
                    some = NO_WORDS.split(block)
                    words |= dict.fromkeys(word for word in some if not word.isascii())
    bad += decoder.decode(b"", final=True).count(DAMAGED)
    if encoding or not (wide or bad):
        return "utf-8-sig", "replace" if bad else "strict", _damage(bad)
    if good > bad and not wide:
        return "utf-8", "replace", _damage(bad)
    sample = head if wide else b" ".join(words)
    candidates = WIDE_ENCODINGS if wide else ENCODINGS
    matches = from_bytes(sample[: 2**16], cp_isolation=list(candidates), enable_fallback=False)
    # Some matches stand for several encodings, in which the sample is the same text.
    ranked = [
        (match.chaos + _strangeness(str(match)), -match.coherence, number, name)
        for match in matches
        for number, name in enumerate(candidates)
        if name in match.could_be_from_charset
    ]
    *_, best = min(ranked, default=(None,))
    if best is None or (wide and not _is_text(head, best)):
        raise _unknown(what)
    return best, "strict", (f"the file is not in UTF-8; it is read as {best}",)


def _strangeness(text: str) -> float:
    """Return the share of symbols in what is not ASCII: words are made of letters."""
    foreign = [letter for letter in text if not letter.isascii()]
    symbols = sum(unicodedata.category(letter) in SYMBOLS or letter in "¿¡" for letter in foreign)
    return symbols / max(len(foreign), 1)


def _damage(characters: int) -> tuple[str, ...]:
    told = f"{characters:,} places are not UTF-8 and are read as {DAMAGED}"
    return (told,) if characters else ()


def _is_text(head: bytes, encoding: str) -> bool:
    with contextlib.suppress(UnicodeDecodeError):
        text = codecs.getincrementaldecoder(encoding)().decode(head)
        return "\0" not in text
    return False


def _unknown(what: str) -> SourceError:
    return SourceError(f"{what} is in an unknown encoding; save it as CSV in UTF-8.")
