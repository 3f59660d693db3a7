"""Where each value and table of a TOML text stands, by character: to change one of them and leave the rest."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from dataclasses import dataclass

Path = tuple[str | int, ...]  # ("source", 2, "terms", 0, "coefficient"): the third [[source]], its first term

_BLANK = re.compile(r"(?:\s|#[^\n]*)*")
_QUOTED = r'"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\''
_KEY = re.compile(rf"{_QUOTED}|[A-Za-z0-9_-]+")
_SCALAR = re.compile(rf'"""(?:\\.|[^\\])*?"{{3,5}}|\'\'\'.*?\'{{3,5}}|{_QUOTED}|[^,\]}}#\n]+', re.DOTALL)


@dataclass(frozen=True)
class Span:
    """`text[start:end]`: a value; or a table from its `[head]` to the end of its last own value."""

    start: int
    end: int


def spans(text: str) -> dict[Path, Span]:
    """The place of every value, array element and headed table of a text that `tomllib` has accepted.

    A table that has neither braces nor a head of its own (made by dotted keys) has no place, nor has an array of headed
    tables. The root, `()`, ends with its last own value.
    """
    return _Scan(text).found


class _Scan:
    """Reads the statements once, in order."""

    def __init__(self, text: str) -> None:
        self.found: dict[Path, Span] = {(): Span(0, 0)}
        self._text = text
        self._at = 0
        self._elements: Counter[Path] = Counter()  # of arrays of headed tables
        table: Path = ()
        while self._peek():
            if self._peek() == "[":
                table = self._head()
            else:
                self._pair(table)
                self.found[table] = Span(self.found[table].start, self._at)

    def _peek(self) -> str:
        """The next character that says something, "" at the end."""
        first = self._text[self._at : self._at + 1]
        if first in " \t\r\n#" and (blank := _BLANK.match(self._text, self._at)):
            self._at = blank.end()
            first = self._text[self._at : self._at + 1]
        return first

    def _head(self) -> Path:
        start = self._at
        brackets = 2 if self._text.startswith("[[", start) else 1
        self._at += brackets
        path: Path = ()
        for part in self._keys():
            path = (*self._last(path), part)
        if brackets == 2:
            self._elements[path] += 1
        self._peek()
        self._at += brackets
        path = self._last(path)
        self.found[path] = Span(start, self._at)
        return path

    def _last(self, path: Path) -> Path:
        """The table that a path stands for: an array of headed tables stands for its last element."""
        return (*path, self._elements[path] - 1) if path in self._elements else path

    def _keys(self) -> list[str]:
        """The parts of a dotted key; the reader stands behind it then."""
        parts = []
        while True:
            self._peek()
            match = _KEY.match(self._text, self._at)
            word = match.group() if match else ""
            self._at += len(word)
            parts.append(next(iter(tomllib.loads(f"{word} = 0"))) if word[:1] in "\"'" else word)
            if self._peek() != ".":
                return parts
            self._at += 1

    def _pair(self, table: Path) -> None:
        path = (*table, *self._keys())
        self._at += 1  # =
        self._value(path)

    def _value(self, path: Path) -> None:
        first = self._peek()
        start = self._at
        if first == "[":
            self._inside("]", path)
        elif first == "{":
            self._inside("}", path)
        else:
            match = _SCALAR.match(self._text, start)
            self._at += len(match.group().rstrip()) if match else 0
        self.found[path] = Span(start, self._at)

    def _inside(self, end: str, path: Path) -> None:
        """Read the elements of an array, or the pairs of a table in braces, up to `end`."""
        self._at += 1
        index = 0
        while self._peek() != end:
            if end == "]":
                self._value((*path, index))
            else:
                self._pair(path)
            index += 1
            if self._peek() == ",":
                self._at += 1
        self._at += 1
