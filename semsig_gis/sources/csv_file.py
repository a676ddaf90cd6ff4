"""CSV files in any encoding and with any usual separator."""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import itertools
import re
from collections import Counter
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from charset_normalizer import from_bytes

from semsig_gis.core import SourceError
from semsig_gis.sources.encodings import Guess, guess_encoding
from semsig_gis.sources.position_values import WELL_KNOWN

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

SEPARATORS = ";,\t|"
BLANK = " "  # one or several between two columns, if no other separator is there
# The first line that Excel writes and reads.
STATED_SEPARATOR = re.compile(r'\ufeff?"?sep=(.)"?\s*', re.IGNORECASE)
# Number of lines that show where the table begins.
FIRST_LINES = 100
MOST_SHOWN = 40
DIGITS_FIRST = re.compile(r"[^\W\d_]?\W*\d")
QUOTED = re.compile(r'["{}=]|\(-?\d|\d\)')  # not in names
# Values that are no names: a number with decimals, an angle, and a long whole number.
NO_NAME = re.compile(
    r"\s*[+-]?\d+(?:[.,]\d+)(?:\D.*)?|\s*\d+\s*[°º].*|\s*\d{5,}\s*|\s*\d+[;\t|][\d;].*", re.DOTALL
)
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
WIDE_ENCODINGS = ("utf_16_le", "utf_16_be", "utf_32_le", "utf_32_be")
SAMPLE_WORDS = 5_000
NO_WORDS = re.compile(rb'[\s;,"0-9]+')
DAMAGED = "\N{REPLACEMENT CHARACTER}"


@dataclass(frozen=True, slots=True)
class CsvFile:
    """A CSV file with its encoding and its possible separators.

    `what` is its name in messages, `errors` the error handler for bytes that are not text, `notes`
    are remarks for the user. `layouts` has the stripped column names by separator, the best first,
    and `starts` the number of lines before them. `guess` is the encoding if nothing states it, and
    the file is not in UTF-8.
    """

    open: Callable[[], IO[bytes]]
    what: str
    encoding: str
    errors: str
    layouts: Mapping[str, tuple[str, ...]]
    starts: Mapping[str, int]
    notes: tuple[str, ...] = ()
    guess: Guess | None = None

    @property
    def separator(self) -> str:
        """The separator that gives the most columns."""
        return next(iter(self.layouts))

    def rows(self, separator: str) -> Iterator[dict[str, str | None] | str]:
        """Yield every row as values by column name, or the text of its error.

        Missing values at the end are None; surplus blank values are left out.
        """
        names = self.layouts[separator]
        repeated = len({*names}) < len(names)
        for values in itertools.islice(self._values(separator), 1, None):
            if isinstance(values, str):
                yield values
            elif any(value.strip() for value in values[len(names) :]):
                yield f"has {len(values)} values, and the header has {len(names)} names"
            elif values:
                missing = [None] * (len(names) - len(values))
                pairs = [*zip(names, [*values[: len(names)], *missing], strict=True)]
                if repeated:  # the first that is not blank counts
                    pairs.reverse()
                    pairs += [pair for pair in pairs if (pair[1] or "").strip()]
                yield dict(pairs)

    def text(self) -> IO[str]:
        """Open the file as text, with its ends of lines."""
        return io.TextIOWrapper(self.open(), self.encoding, self.errors, newline="")

    def _values(self, separator: str) -> Iterator[list[str] | str]:
        before = csv.field_size_limit(MOST_VALUE_CHARACTERS)
        try:
            with self.text() as stream:
                # Strict, because an unclosed quote would make all rows after it one value.
                lines = itertools.islice(stream, self.starts[separator], None)
                rows = _parsed(lines, separator)
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


def open_csv(open_: Callable[[], IO[bytes]], what: str, *, encoding: str | None = None) -> CsvFile:
    """Detect encoding and separators of a CSV file.

    Without a stated `encoding` or a byte order mark the encoding is UTF-8 if the text is valid,
    else a guess. SourceError if the file is empty, not text, has no header, or its encoding is
    unknown.
    """
    guess = None
    if encoding is not None:
        errors, notes = "replace", tuple[str, ...]()
    else:
        encoding, errors, notes, guess = _encoding(open_, what)
    layouts: dict[str, tuple[str, ...]] = {}
    starts: dict[str, int] = {}
    file = CsvFile(open_, what, encoding, errors, layouts, starts, notes, guess)
    try:
        with file.text() as stream:
            lines = [*itertools.islice(stream, FIRST_LINES)]
    except UnicodeDecodeError as error:
        raise _unknown_encoding(what) from error
    stated = STATED_SEPARATOR.fullmatch(lines[0]) if lines else None
    marks = stated[1] if stated else SEPARATORS
    first = int(bool(stated))
    # Titles and comments may stand before the table, and blanks between its columns.
    plain = [_layout(lines, mark, first) for mark in marks]
    titled = [_layout(lines, mark, first, titles=True) for mark in marks]
    tables = [b if b.fits and not a.fits else a for a, b in zip(plain, titled, strict=True)]
    blanks = _layout(lines, BLANK, first, titles=True)
    most = max((len(item.names) for item in tables if item.fits), default=0)
    if blanks.fits and len(blanks.names) > most:
        tables = [blanks]
    # At the same number of columns, the table that begins first counts.
    for item in sorted(tables, key=lambda item: (not item.fits, -len(item.names), item[:2][::-1])):
        layouts[item.separator], starts[item.separator] = item.names, item.start
    if not any(name for names in layouts.values() for name in names):
        raise SourceError(
            f"{what} is empty; give a file that begins with the names of its columns."
        )
    _require_names(file)
    return file


def _require_names(file: CsvFile) -> None:
    """Raise SourceError if values stand in place of the names of columns."""
    names = file.layouts[file.separator]
    values = [name for name in names if NO_NAME.fullmatch(name) or WELL_KNOWN.fullmatch(name)]
    # A single number may be the name of a column.
    if len(values) >= 2 or any(re.search(r"[^-+.\d]", value) for value in values):  # noqa: PLR2004 - a pair
        places = ["lon", "lat", *(f"column{number}" for number in range(3, len(names) + 1))]
        example = file.separator.join(places[: len(names)])
        raise SourceError(
            f"{file.what} has no header, for its first line holds values such as "
            f"{values[0][:MOST_SHOWN]!r}; write the names of its columns in a line before it, such "
            f"as {example!r}."
        )


class _Layout(NamedTuple):
    """The header of a table; `fits` is whether most rows have as many values as it has names."""

    separator: str
    start: int
    names: tuple[str, ...]
    fits: bool


def _layout(lines: Sequence[str], separator: str, first: int, *, titles: bool = False) -> _Layout:
    """Return the layout from line `first` on; with `titles`, lines before the header may be others.

    The header is then the first line with as many cells as the table, and no values in them.
    """
    parsed = [item for item in _rows(lines, separator) if item[0] >= first]
    bad = sum(row is None for _, row in parsed)
    rows = [(number, row) for number, row in parsed if row and any(map(str.strip, row))]
    blanks = separator == BLANK
    # A comment is before the names of columns, unless it has these itself.
    while len(rows) > 1 and rows[0][1][0].lstrip().startswith("#"):
        if any(_is_value(cell, blanks=blanks) for cell in rows[1][1]):
            break
        rows = rows[1:]
    if not rows:
        return _Layout(separator, first, (), fits=False)
    widths = Counter(len(_trimmed(row)) for _, row in rows)
    width = max(widths, key=lambda size: (widths[size], size))
    start, names = rows[0]
    for number, row in rows if titles else ():
        cells = [cell for cell in row if cell.strip()]
        size = len(_trimmed(row))
        enough = size == width if blanks else size >= width and 2 * len(cells) > width
        if enough and not any(_is_value(cell, blanks=blanks) for cell in cells):
            start, names = number, row
            if not blanks:  # where any sentence may have as many words, the last one counts
                break
        elif enough:
            break
    if names[0].lstrip().startswith("#") and len(names) > 1:  # a comment for some programs
        first_name = names[0].strip().removeprefix("#")
        names = [first_name, *names[1:]] if first_name else names[1:]
    others = [row for number, row in rows if number > start]
    # Last values may be blank in every row, but not last names.
    width = len(_trimmed(names))
    same = sum(
        width in {len(_trimmed(row)), len(row) if width == len(names) else 0} for row in others
    )
    need = (len(others) + bad) / (1 if blanks else 2)
    fits = len(names) > 1 and same >= need
    return _Layout(separator, start, tuple(name.strip() for name in names), fits)


def _is_value(cell: str, *, blanks: bool) -> bool:
    """Whether a cell is a value; with `blanks` between the columns, also if digits are first."""
    if blanks and DIGITS_FIRST.match(cell):
        return True
    return bool(NO_NAME.fullmatch(cell) or QUOTED.search(cell) or WELL_KNOWN.fullmatch(cell))


def _trimmed(row: Sequence[str]) -> Sequence[str]:
    """Return a row without blank cells at its end."""
    size = max((number for number, cell in enumerate(row, 1) if cell.strip()), default=0)
    return row[:size]


def _rows(lines: Sequence[str], separator: str) -> Iterator[tuple[int, list[str] | None]]:
    """Yield the rows of lines, None for bad ones, each with the number of lines before it."""
    reader = _parsed(lines, separator)
    while True:
        number = reader.line_num
        try:
            yield number, next(reader)
        except StopIteration:
            return
        except csv.Error:
            yield number, None


def _parsed(lines: Iterable[str], separator: str) -> Any:  # noqa: ANN401 - a type without name
    """Return the reader of lines."""
    if separator == BLANK:
        lines = (
            re.sub(r"[ \t]+", BLANK, line.strip()) + line[len(line.rstrip("\r\n")) :]
            for line in lines
        )
    return csv.reader(lines, delimiter=separator, strict=True)


def _encoding(
    open_: Callable[[], IO[bytes]], what: str
) -> tuple[str, str, tuple[str, ...], Guess | None]:
    """Return the encoding of a file, the handler of decoding errors, notes and a guess."""
    with open_() as stream:
        head = stream.read(READ_BYTES)
        marked = (name for mark, name in MARKS.items() if head.startswith(mark))
        if (encoding := next(marked, None)) and encoding != "utf-8-sig":
            return encoding, "strict", (), None
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
        return "utf-8-sig", *(("replace", (note,)) if bad else ("strict", ())), None
    guess = Guess(_wide_encoding(head), sure=True) if wide else guess_encoding(words)
    if guess is None or not guess.encoding:
        raise _unknown_encoding(what)
    doubt = "" if guess.sure else ", which is not sure: state the right one as encoding"
    note = f"the file is not in UTF-8; it is read as {guess.encoding}{doubt}"
    return guess.encoding, "strict", (note,), guess


def _wide_encoding(head: bytes) -> str:
    """Return the encoding of two or four bytes for a character, or an empty text."""
    matches = from_bytes(head[: 2**16], cp_isolation=list(WIDE_ENCODINGS), enable_fallback=False)
    # A match may list several encodings in which the sample is the same text.
    ranked = [
        (match.chaos, -match.coherence, number, name)
        for match in matches
        for number, name in enumerate(WIDE_ENCODINGS)
        if name in match.could_be_from_charset
    ]
    *_, best = min(ranked, default=("",))
    with contextlib.suppress(UnicodeDecodeError):
        if best and "\0" not in codecs.getincrementaldecoder(best)().decode(head):
            return best
    return ""


def _unknown_encoding(what: str) -> SourceError:
    return SourceError(f"{what} is in an unknown encoding; save it as CSV in UTF-8.")
