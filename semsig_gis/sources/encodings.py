"""Guess the encoding of a text from its words that are not ASCII."""

from __future__ import annotations

import codecs
import operator
import unicodedata
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

# Encodings of tables, the most frequent first; the first of equally good ones is chosen.
ENCODINGS = ("cp1252", "cp1250", "cp1251", "cp1253", "cp1254", "cp1255", "cp1256", "cp1257",
             "iso8859_2", "iso8859_5", "iso8859_7", "koi8_r", "mac_roman", "cp437", "cp850",
             "cp866", "cp932", "euc_jp", "gb18030", "big5", "cp949")  # fmt: skip
MOST_WORDS = 2_000
# A guess is sure if few words are implausible, and clearly more, as a share or a number, in any
# other encoding that does not give the same words.
LEAST_WORDS, SAME_SHARE = 1.9, 0.95
MOST_IMPLAUSIBLE, LEAST_DISTANCE, LEAST_LETTERS = 0.2, 0.2, 8
# Letters of languages beyond a to z.
ALPHABETS = tuple(map(frozenset, (
    "àâæçéèêëîïôœùûüÿ", "äöüß", "áéíñóúü", "áâãàçéêíóôõúü", "àèéìíîòóùú", "àçèéíïòóúü",
    "åäöéæøü", "áðéíóúýþæö", "ąćęłńóśźż", "áčďéěíňóřšťúůýž", "áäčďéíĺľňóôŕšťúýž",
    "áéíóöőúüű", "ăâîșțşţ", "čćđšž", "çğıöşüâîû", "ąčęėįšųūž", "āčēģīķļņšūžõ", "äõöüšž", "ëïéèóöü",
    "ġħżàèìòù", "áàéèíìóòúùâêîôûŵŷ", "ëç",
)))  # fmt: skip
VOWELS = frozenset("aeiouyаеёиоуыэюяіїєαεηιουωάέήίόύώϊϋ") | frozenset().union(*ALPHABETS)
# The more frequent letters of other scripts; of East Asia also those of streets and their things.
FREQUENT = {
    "CYRILLIC": frozenset("оеаинтсрвлкмдпу"),
    "GREEK": frozenset("αοιετσςνηυρπκμάίέόή"),
    "HEBREW": frozenset("יוהלארבתמשנסעפםןקדחכ"),
    "ARABIC": frozenset("اليمنرتوبعدسفهةشق"),
    "HANGUL": frozenset(
        "이다는에의가을로하고지도리사기인대나한시아자어서스정주수전장부보원일상동제해성구조그선신유국라오경화비공관"
        "교연미안과문우여모발드소용계세만단산생무반중요방치실회음등들터니식면위진행명강남북버류청벤쓰레통목종호길천읍"
        "역학마을표판번거량설간점재물질은현입출구편의집적급외내좌측우횡보호차고속"
    ),
    "CJK": frozenset(
        "的一是不了人在有中大来上国和地到以时要出会可生能子下自年后作用道行家事成方多经法学同动面定天分小部主理心本前"
        "开日者无力长长機十民第公工使明性全三正业外高由物手文体政美相利二新西月合回特代内信化老世位次度门任常先海通原东"
        "立比水名四总电安少场件计管期市直山金区區保形社空五白界光式色路记南品住类程北边交规街灯燈椅树樹站箱桶牌井亭杆座"
        "园園桥橋口号號六七八九東門長電車车車場線种種別类型型称稱名称垃圾公廁厕所消防栓信號红绿紅綠设施設施町丁目番村川"
        "池寺神社駅停留所街角木林森花草石竹松柳杨楊槐柏梧桐府省县縣镇鎮乡鄉州江湖河城乐樂和平建人民"
    ),
}
# The languages of the encodings of East Asia, most of them also with other letters.
EAST_ASIAN = {"cp932": "CJK", "euc_jp": "CJK", "gb18030": "CJK", "big5": "CJK", "cp949": "HANGUL"}
SIGNS = frozenset("'’‘-–.,:/()«»“”„\"°ºª№§&+_")
KANA = ("HIRAGANA", "KATAKANA")
# Letters of a word without a vowel, such as an abbreviation.
MOST_CONSONANTS = 2
# Accented letters that follow each other in a word of a Latin alphabet.
MOST_ACCENTS = 2


class Guess(NamedTuple):
    """An encoding, and whether it is certain."""

    encoding: str
    sure: bool


def guess_encoding(words: Iterable[bytes]) -> Guess | None:
    """Return the likely encoding of words, or None if no encoding gives words.

    A word may end within a character, as in a field that was cut.
    """
    sample = [word for word in dict.fromkeys(words) if not word.isascii()][:MOST_WORDS]
    scores: list[tuple[float, int, str, list[str]]] = []
    for number, encoding in enumerate(ENCODINGS):
        decoded = (_decoded(word, encoding) for word in sample)
        readable = [text for text in decoded if text is not None]
        # Single words may be damaged.
        if readable and 20 * len(readable) >= 19 * len(sample):
            score = _implausibility(readable, encoding) + 1 - len(readable) / len(sample)
            scores.append((score, number, encoding, readable))
    if not scores:
        return None
    score, _, encoding, texts = min(scores)
    # The least distance of an encoding in which more than a few words are others.
    distance = min(
        (
            other - score
            for other, *_, others in scores
            if SAME_SHARE * len(texts) > sum(map(operator.eq, texts, others))
        ),
        default=1.0,
    )
    enough = distance >= LEAST_DISTANCE or distance * len(texts) >= LEAST_WORDS
    letters = sum(len(_foreign(text)) for text in texts)
    return Guess(encoding, score <= MOST_IMPLAUSIBLE and enough and letters >= LEAST_LETTERS)


def is_utf8(words: Iterable[bytes]) -> bool:
    """Whether words are valid UTF-8; one may end within a character."""
    return all(_decoded(word, "utf-8") is not None for word in words)


def parse_encoding(name: str) -> str:
    """Return Python's name of an encoding; ValueError if it is unknown."""
    try:
        return codecs.lookup(name).name
    except LookupError as error:
        raise ValueError(name) from error


def gdal_name(encoding: str) -> str:
    """Return GDAL's name of an encoding."""
    name = codecs.lookup(encoding).name.replace("_", "-").upper()
    return "MACINTOSH" if name == "MAC-ROMAN" else name


def _decoded(word: bytes, encoding: str) -> str | None:
    try:
        return codecs.getincrementaldecoder(encoding)().decode(word)
    except UnicodeDecodeError:
        return None


def _implausibility(words: Sequence[str], encoding: str) -> float:
    """Return the mean implausibility of words, from 0 to about 1."""
    latin = [word for word in words if _scripts(word) <= {"LATIN"}]
    letters = [
        frozenset(letter for letter in word.lower() if not letter.isascii() and letter.isalpha())
        for word in latin
    ]
    # The language with the letters of most words; the words of others are implausible.
    foreign = min(sum(not own <= alphabet for own in letters) for alphabet in ALPHABETS)
    return (foreign + sum(_oddness(word, encoding) for word in words)) / len(words)


def _scripts(word: str) -> set[str]:
    """Return the scripts of the letters of a word that are not ASCII."""
    names = (unicodedata.name(letter, "?").split()[0] for letter in _foreign(word))
    return {"CJK" if name in KANA else name for name in names if name.isupper()}


def _foreign(word: str) -> str:
    """Return the letters of a word that are not ASCII."""
    return "".join(letter for letter in word if not letter.isascii() and letter.isalpha())


def _oddness(word: str, encoding: str) -> float:
    """Return 1 for a word that nobody writes, less for a rare one, and 0 for others."""
    scripts = _scripts(word)
    strange = any(
        not (
            letter.isalnum() or letter.isspace() or letter in SIGNS or unicodedata.combining(letter)
        )
        for letter in word
        if not letter.isascii()
    )
    if strange or len(scripts) != 1:
        return 1.0
    (script,) = scripts
    if script in {"CJK", "HANGUL"}:
        return _east_asian_oddness(word, script, encoding)
    return _alphabetic_oddness(word, script)


def _east_asian_oddness(word: str, script: str, encoding: str) -> float:
    if EAST_ASIAN.get(encoding) != script or max(word) > "\uff00":  # letters of half the width
        return 1.0
    letters = _foreign(word)
    kana = sum(unicodedata.name(letter, "").startswith(KANA) for letter in letters)
    if kana and encoding not in {"cp932", "euc_jp"}:
        return 1.0
    frequent = sum(letter in FREQUENT[script] for letter in letters)
    return 0.5 * (1 - (kana + frequent) / len(letters))


def _alphabetic_oddness(word: str, script: str) -> float:
    letters = [letter for letter in word if letter.isalpha()]
    parts = "".join(letter if letter.isalpha() else " " for letter in word).split()
    # Capitals begin a word, or are all of it.
    cases = any(
        part not in {part.lower(), part.upper()} and part[1:] != part[1:].lower() for part in parts
    )
    mute = script not in {"HEBREW", "ARABIC"} and any(
        len(part) > MOST_CONSONANTS and not VOWELS & {*part.lower()} for part in parts
    )
    if cases or mute:
        return 1.0
    if script == "LATIN":
        runs = "".join(" " if letter.isascii() else letter for letter in word).split()
        return float(max(map(len, runs)) > MOST_ACCENTS)
    if any(letter.isascii() for letter in letters) or script not in FREQUENT:
        return 1.0
    rare = sum(letter.lower() not in FREQUENT[script] for letter in letters)
    # Encodings exchange small letters and capitals, which fewer words consist of.
    return 0.5 * rare / len(letters) + 0.1 * word.isupper()
