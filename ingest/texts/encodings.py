"""In which encoding a text is written that is neither UTF-8 nor, as with a letter here and there, Windows-1252."""

from __future__ import annotations

import codecs
import re
from itertools import islice

UNMARKED = {rb"(?:[\t\r\n -~]\0){4}": "utf-16-le", rb"(?:\0[\t\r\n -~]){4}": "utf-16-be"}  # first letters
# Japanese, simplified and traditional Chinese, Korean and Cyrillic as loggers there write them, and what they are told
# from.
WRITTEN_IN = ("cp932", "gb18030", "big5", "cp949", "cp1251", "cp1252")
IN_UTF_8 = re.compile(rb"[\xc2-\xdf][\x80-\xbf]")  # a letter of two bytes
FOREIGN = re.compile(rb"[\x80-\xff]{3,}")  # which no word of a western language has: `größe` has two
OF_DOS = re.compile(rb"[A-Za-z][\x81\x82\x84\x94][a-z]")  # ü, é, ä, ö of code page 850; signs in Windows-1252
LOOKED_AT = 200  # lines with other letters than ASCII


def encoding_of(text: bytes) -> str | None:
    """The encoding of a text by its first bytes, as Python calls it: UTF-16; one of East Asia or of Cyrillic, which the
    frequencies of their letters tell (charset-normalizer); or that of DOS in Western Europe, by umlauts within words.
    None for any other."""
    if text.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if wide := next((encoding for letters, encoding in UNMARKED.items() if re.match(letters, text)), None):
        return wide
    whole = text.rpartition(b"\n")[0] or text  # the last line may be cut within a letter
    if b"\0" in whole or _is_utf_8(whole):  # what holds a NUL is no text
        return None
    words = FOREIGN.findall(whole)
    if 2 * sum(map(_is_utf_8, words)) >= len(words):  # damaged, or with western lines in it
        return "cp850" if OF_DOS.search(whole) and not (words or IN_UTF_8.search(whole)) else None
    from charset_normalizer import from_bytes

    lines = islice((line for line in whole.split(b"\n") if not line.isascii()), LOOKED_AT)
    best = from_bytes(b"\n".join(lines), cp_isolation=[*WRITTEN_IN]).best()
    return None if best is None or best.encoding == "cp1252" else best.encoding


def _is_utf_8(word: bytes) -> bool:
    try:
        word.decode()
    except UnicodeDecodeError:
        return False
    return True
