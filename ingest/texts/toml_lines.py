"""Line numbers of the tables, keys and elements of a TOML text, which `tomllib` does not keep; a bound on its depth."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

Path = tuple[str | int, ...]  # ("channel", 2, "signal"): the third [[channel]], its key `signal`
DEEPEST = 32

# A text that nothing ends is one token to the end, and `tomllib` refuses it: looked for again from each of its quotes,
# it would take time by the square of its length.
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"{3,5}|\\?\Z)'
    r"|'''.*?(?:'{3,5}|\Z)"
    r'|"(?:\\.|[^"\\\n])*(?:"|(?=\n)|\\?\Z)'
    r"|'[^'\n]*(?:'|(?=\n)|\Z)"
    r"|\#[^\n]*|\n|[\[\]{}=,.]|[^\s\[\]{}=,.\#\"']+",
    re.DOTALL,
)


def too_deep(text: str) -> int | None:
    """The line where brackets or the parts of a dotted key nest deeper than `DEEPEST`, None where nowhere."""
    brackets = parts = 0
    for token, line in _tokens(text):
        brackets = max(brackets + (token in ("[", "{")) - (token in ("]", "}")), 0)
        parts = parts + (token == ".") if token not in ("\n", "=", ",") else 0
        if max(brackets, parts) > DEEPEST:
            return line
    return None


def lines(text: str) -> dict[Path, int]:
    """Line (from 1) of every table, key and array element of a text that `tomllib` has accepted."""
    return _Walk(text).found


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    line = 1
    for match in _TOKEN.finditer(text):
        token = match.group()
        if not token.startswith("#"):
            yield token, line
        line += token.count("\n")


def _statements(text: str) -> Iterator[tuple[str, int]]:
    """The tokens; a line feed is one only where it ends a statement."""
    depth = 0
    for token, line in _tokens(text):
        depth += (token in ("[", "{")) - (token in ("]", "}"))
        if depth == 0 or token != "\n":
            yield token, line
    yield "\n", text.count("\n") + 1


class _Walk:
    """Walks the statements once; knows only where things begin, not what they are worth."""

    def __init__(self, text: str) -> None:
        self.found: dict[Path, int] = {(): 1}
        self._tokens = [*_statements(text)]
        self._at = 0
        self._elements: Counter[Path] = Counter()  # of arrays of tables
        self._walk()

    def _peek(self) -> str:
        return self._tokens[self._at][0]

    def _line(self) -> int:
        return self._tokens[self._at][1]

    def _next(self) -> str:
        self._at += 1
        return self._tokens[self._at - 1][0]

    def _walk(self) -> None:
        table: Path = ()
        while self._at < len(self._tokens):
            if self._peek() == "[":
                table = self._header()
            elif self._peek() != "\n":
                self._pair(table)
            self._next()  # the end of the line

    def _header(self) -> Path:
        line = self._line()
        self._next()
        array = self._peek() == "["
        if array:
            self._next()
        path: Path = ()
        for part in self._key(end="]"):
            path = (*self._within(path), part)
            self.found.setdefault(path, line)
        if array:
            self._next()
            self._elements[path] += 1
            path = self._within(path)
        self.found.setdefault(path, line)
        return path

    def _within(self, path: Path) -> Path:
        """The path of a key inside the tables above it; an array of tables stands for its last element."""
        return (*path, self._elements[path] - 1) if path in self._elements else path

    def _key(self, end: str) -> list[str]:
        parts = []
        while (token := self._next()) != end:
            if token != ".":
                parts.append(token[1:-1] if token[0] in "\"'" else token)
        return parts

    def _pair(self, table: Path) -> None:
        line = self._line()
        for part in self._key(end="="):
            table = (*table, part)
            self.found.setdefault(table, line)
        self._value(table)

    def _value(self, path: Path) -> None:
        if self._peek() == "[":
            self._array(path)
        elif self._peek() == "{":
            self._inline(path)
        else:
            while self._peek() not in (",", "]", "}", "\n"):  # a stamp with a blank is two tokens
                self._next()

    def _array(self, path: Path) -> None:
        self._next()
        index = 0
        while self._peek() != "]":
            self.found[*path, index] = self._line()
            self._value((*path, index))
            index += 1
            self._separator()
        self._next()

    def _inline(self, path: Path) -> None:
        self._next()
        while self._peek() != "}":
            self._pair(path)
            self._separator()
        self._next()

    def _separator(self) -> None:
        if self._peek() == ",":
            self._next()
