"""A TOML text with other values: a changed one is replaced where it stands, new keys and tables join their own kind."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from ingest.texts.toml_spans import Path, spans

WIDTH = 110  # characters; an added line that would be longer is written as several

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_COMMA = re.compile(r"(?:\s|#[^\n]*\n)*,")
_KEYS_FIRST = 0  # at one place: keys of a table, then tables within it, then tables beside it
_TABLES = 100


def edited(text: str, before: Mapping[str, Any], after: Mapping[str, Any], says: str) -> str:
    """`text`, which says `before`, made to say `after`; comments and all that is equal in both stay as written.

    `before` and `after` hold texts, numbers, booleans, lists of these, tables (never empty) and lists of tables.
    `before` may hold values that the text leaves to their default. What `after` lacks is left alone. Tables are added
    after the last of their kind, else at the end, under the comment `# added: <says>`.
    """
    return _Edits(text, says).made(before, after)


def as_text(head: str, table: Mapping[str, Any]) -> str:
    """The lines of a table `[[head]]`, numbers to 7 digits."""
    return "\n".join([f"[[{head}]]", *(_pair(key, value) for key, value in table.items())])


def _line_end(text: str, at: int) -> int:
    """Where the line of a position ends, before its line break."""
    found = text.find("\n", at)
    end = len(text) if found < 0 else found
    return end - 1 if text[end - 1 : end] == "\r" else end


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else json.dumps(name)


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    return f"{value:.7g}"


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def _pair(key: str, value: Any) -> str:
    """`key = value`; tables in a list stand a line each where there are several, or one is long."""
    line = f"{_key(key)} = {_inline(value)}"
    if not _is_tables(value) or (len(value) == 1 and len(line) <= WIDTH):
        return line
    return "\n".join([f"{_key(key)} = [", *(f"  {_inline(one)}," for one in value), "]"])


class _Edits:
    """Collects replacements `(start, end, rank, new)` of pieces of one text; none overlaps another."""

    def __init__(self, text: str, says: str) -> None:
        self._text = text
        self._says = says
        self._spans = spans(text)
        self._edits: list[tuple[int, int, int, str]] = []

    def made(self, before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
        """The text that says `after`."""
        self._table((), before, after)
        line_break = "\r\n" if "\r\n" in self._text else "\n"
        parts, at = [], 0
        for start, end, _, new in sorted(self._edits, key=lambda edit: edit[:3]):
            parts += [self._text[at:start], new.replace("\n", line_break)]
            at = end
        return "".join([*parts, self._text[at:]])

    def _edit(self, start: int, end: int, new: str, rank: int = _KEYS_FIRST) -> None:
        self._edits.append((start, end, rank, new))

    def _table(self, path: Path, before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
        for key, value in after.items():
            here, old = (*path, key), before.get(key)
            if isinstance(value, Mapping) and isinstance(old, Mapping):
                self._table(here, old, value)
            elif _is_tables(value):
                was = old if isinstance(old, list) else []
                for i, (one, other) in enumerate(zip(was, value, strict=False)):
                    self._table((*here, i), one, other)
                if len(value) > len(was):
                    self._grow(here, len(was), value[len(was) :])
            elif old != value:
                self._set(path, key, old, value)

    def _set(self, path: Path, key: str, old: Any, value: Any) -> None:
        if (*path, key) in self._spans:
            self._replace((*path, key), old, value)
            return
        written = f"{_key(key)} = {_inline(value)}"
        while path not in self._spans:  # made by dotted keys: the new key is dotted like them
            path, written = path[:-1], f"{_key(str(path[-1]))}.{written}"
        span = self._spans[path]
        if self._text[span.start] == "{":
            content = self._text[: span.end - 1].rstrip()
            self._edit(len(content), span.end - 1, f", {written}")
        else:
            end = _line_end(self._text, span.end)
            self._edit(end, end, f"\n{self._indent(span.start)}{written}")

    def _replace(self, here: Path, old: Any, value: Any) -> None:
        if isinstance(old, list) and isinstance(value, list) and len(old) == len(value):
            for i, (one, other) in enumerate(zip(old, value, strict=True)):
                if one != other:
                    self._replace((*here, i), one, other)
        else:
            span = self._spans[here]
            self._edit(span.start, span.end, _inline(value))

    def _indent(self, at: int) -> str:
        """The white space that the line of a position begins with."""
        start = self._text.rfind("\n", 0, at) + 1
        return self._text[start : len(self._text) - len(self._text[start:].lstrip(" \t"))]

    def _grow(self, path: Path, count: int, added: Sequence[Mapping[str, Any]]) -> None:
        """Add tables to an array that has `count` of them."""
        if path in self._spans:
            self._grow_array(path, count, [_inline(one) for one in added])
            return
        own = [span.end for at, span in self._spans.items() if at[: len(path) + 1] == (*path, count - 1)]
        end = _line_end(self._text, max(own)) if own else len(self._text.rstrip())
        head = ".".join(_key(part) for part in path if isinstance(part, str))
        tables = [as_text(head, one) for one in added]
        self._edit(end, end, f"\n\n# added: {self._says}\n" + "\n\n".join(tables), _TABLES - len(path))

    def _grow_array(self, path: Path, count: int, added: Sequence[str]) -> None:
        """Every element of an array that stood in one line gets a line; in one of several lines the others stay."""
        span = self._spans[path]
        elements = [self._spans[*path, i] for i in range(count)]
        outer = self._indent(span.start)
        close, last = span.end - 1, elements[-1].end if elements else span.start + 1
        if "\n" in self._text[span.start : close] and elements:
            indent = self._indent(elements[-1].start)
        else:
            indent = outer + "  "
            starts = [span.start + 1, *(e.end for e in elements[:-1])]
            for i, (start, element) in enumerate(zip(starts, elements, strict=False)):
                self._edit(start, element.start, f"{',' * (i > 0)}\n{indent}")
        lines = f"\n{indent}# added: {self._says}" + "".join(f"\n{indent}{one}," for one in added)
        comma = _COMMA.match(self._text, last)
        behind = comma.end() if comma else last
        if not comma and elements:
            self._edit(last, last, ",")
        end = _line_end(self._text, behind)
        if end < close:
            self._edit(end, end, lines)
        else:
            self._edit(behind, close, f"{lines}\n{outer}")
