"""Strict reading of our TOML files: every refusal says file and line, entry, key, what was found and what is wanted.

root = read(path, "bench.toml", "whyhot.bench/1")
root.only({"motor", "channel"})
for channel in root.tables("channel"):
    signal = channel.need("signal", TEXT)
    noise = channel.get("noise", NOT_NEGATIVE)  # None where left out
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from datetime import date, datetime, time
from pathlib import Path
from typing import Any, Generic, TypeVar

from ingest.errors import TomlError
from ingest.texts import toml_lines, toml_spans
from ingest.texts.nearest import hint

LARGEST = 4_000_000  # bytes; a bench with 5,000 channels has about 1 MB
T = TypeVar("T")

_NAMES = ("name", "signal", "node", "between")  # what an entry is called in a message, first found
_HINTS = (  # words of tomllib -> what to do
    ("overwrite a value", "this key is written twice in the same table: keep one"),
    ("twice", "this table is opened twice: put its keys together, or open it as [[...]] where there are several"),
    ("Unescaped '\\'", "write a backslash twice, or put the text in single quotes"),
    ("Invalid value", 'text stands in quotes ("like this"), numbers and true or false do not'),
)


@dataclass(frozen=True)
class Kind(Generic[T]):
    """What a value must be: `wanted` in words; `read` makes a T of it or raises ValueError (what was found)."""

    wanted: str
    read: Callable[[Any], T]


def _check(value: Any, holds: bool) -> Any:
    if not holds:
        raise ValueError
    return value


def _text(value: Any) -> str:
    return str(_check(value, isinstance(value, str) and bool(value.strip())))


def _number(value: Any) -> float:
    _check(value, isinstance(value, int | float) and not isinstance(value, bool))
    try:
        return float(_check(value, math.isfinite(value)))
    except OverflowError:
        raise ValueError from None


def _range(value: Any) -> tuple[float, float]:
    low, high = map(_number, _check(value, isinstance(value, list) and len(value) == 2))
    _check(value, low < high)
    return low, high


def _named(value: Any, read_one: Callable[[Any], T]) -> dict[str, T]:
    """The values of a mapping, each read; where one cannot be read, the ValueError names it."""
    read_all: dict[str, T] = {}
    for key, one in dict(_check(value, isinstance(value, dict))).items():
        try:
            read_all[key] = read_one(one)
        except ValueError:
            raise ValueError(f'{_found(one)} for "{key}"') from None
    return read_all


TEXT = Kind("a text in quotes", _text)
NUMBER = Kind("a number", _number)
POSITIVE: Kind[float] = Kind("a number above 0", lambda value: _check(_number(value), value > 0))
NOT_NEGATIVE: Kind[float] = Kind("a number of 0 or more", lambda value: _check(_number(value), value >= 0))
BOOLEAN = Kind("true or false", lambda value: bool(_check(value, isinstance(value, bool))))
MOMENT: Kind[datetime] = Kind(
    "a date and time without quotes, such as 2024-03-01T08:00:00Z",
    lambda value: _check(value, isinstance(value, datetime)),
)
DAY: Kind[date] = Kind(  # a datetime is one
    "a date, or a date and time, without quotes, such as 2024-03-01 or 2024-03-01T08:00:00Z",
    lambda value: _check(value, isinstance(value, date)),
)
TEXTS: Kind[list[str]] = Kind(
    'a list of texts, such as ["a", "b"]', lambda value: [_text(x) for x in _check(value, isinstance(value, list))]
)
RANGE: Kind[tuple[float, float]] = Kind("two numbers, the lower first, such as [160, 180]", _range)
NAMED_TEXTS: Kind[Mapping[str, str]] = Kind(
    'texts by name, such as {inverter = "sw 4.2"}', lambda value: _named(value, _text)
)
NAMED_NUMBERS: Kind[Mapping[str, float]] = Kind(
    "numbers by name, such as {a = 0.7, b = 0.3}", lambda value: _named(value, _number)
)
NAME = Kind(  # of a node or boundary
    "a name of lower-case letters, digits and _ that begins with a letter, in quotes",
    lambda value: str(_check(value, bool(re.fullmatch(r"[a-z][a-z0-9_]*", _text(value))))),
)


@dataclass(frozen=True)
class TomlTable:
    """One table of the file: a mapping that knows where it stands. `path` as in `toml_spans`; the root has `()`."""

    file: str
    values: Mapping[str, Any]
    path: toml_spans.Path = ()
    lines: Mapping[toml_spans.Path, int] = field(default_factory=dict, repr=False)
    label: str = ""  # "[[channel]] 3 (signal "EW_A_3v")"

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def line(self, key: str | None = None) -> int:
        """Line of `key`, or of the table's own head where it has no such key."""
        path = self.path if key is None else (*self.path, key)
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def where(self, key: str | None = None) -> str:
        """ "bench.toml:14: [[channel]] 3 (signal "EW_A_3v")": how every message begins."""
        return f"{self.file}:{self.line(key)}:" + (f" {self.label}:" if self.label else "")

    def error(self, says: str, key: str | None = None) -> TomlError:
        """A refusal at `key` of this table, to be raised."""
        return TomlError(f"{self.where(key)} {says}")

    def only(self, keys: Collection[str], elsewhere: Mapping[str, str] | None = None) -> None:
        """Refuse every other key, with the nearest of `keys`; `elsewhere`: key -> where it belongs instead."""
        known = set(keys) if self.path else {*keys, "schema"}
        for key in self.values:
            if key in known:
                continue
            if elsewhere and key in elsewhere:
                raise self.error(f'key "{key}" does not belong here: it stands {elsewhere[key]}.', key)
            advice = hint(key, known) or f" Known here: {', '.join(sorted(known))}."
            raise self.error(f'unknown key "{key}".{advice}', key)

    def get(self, key: str, kind: Kind[T]) -> T | None:
        """The value of `key`, None where it is left out. Raises TomlError where it is not of `kind`."""
        if key not in self.values:
            return None
        try:
            return kind.read(self.values[key])
        except ValueError as error:
            found = str(error) or _found(self.values[key])
            raise self.error(f"{key} must be {kind.wanted}, found {found}.", key) from None

    def need(self, key: str, kind: Kind[T]) -> T:
        """As `get`, but refused where it is left out."""
        value = self.get(key, kind)
        if value is None:
            raise self.error(f"{key} is missing: it must be {kind.wanted}.")
        return value

    def one_of(self, key: str, choices: Collection[str]) -> str | None:
        """A text that must be one of `choices`, None where it is left out."""
        value = self.get(key, TEXT)
        if value is not None and value not in choices:
            raise self.error(f'{key} "{value}" is none of {", ".join(choices)}.{hint(value, choices)}', key)
        return value

    def table(self, key: str) -> TomlTable | None:
        """The table `[key]` or `key = {...}`, None where it is left out."""
        if key not in self.values:
            return None
        if not isinstance(self.values[key], dict):
            raise self.error(f"{key} must be a table, found {_found(self.values[key])}.", key)
        return self._child(key, None, self.values[key])

    def tables(self, key: str) -> list[TomlTable]:
        """The tables `[[key]]` or `key = [{...}, {...}]`; none where it is left out."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
            wanted = f"a list of tables ([[{key}]])" if not self.path else "a list of tables in braces: [{...}, {...}]"
            raise self.error(f"{key} must be {wanted}, found {_found(value)}.", key)
        return [self._child(key, index, entry) for index, entry in enumerate(value)]

    def _child(self, key: str, index: int | None, values: Mapping[str, Any]) -> TomlTable:
        path = (*self.path, key) if index is None else (*self.path, key, index)
        own = f"[{key}]" if index is None else f"[[{key}]] {index + 1}"
        if self.path:
            own = f"{self.label}, {key}" if index is None else f"{self.label}, {key} {index + 1}"
        return TomlTable(self.file, values, path, self.lines, own + _called(values))


def read(source: Path | bytes, name: str, schema: str) -> TomlTable:
    """The root table of a TOML file; `name` as in messages, `schema` such as "whyhot.bench/1".

    Raises TomlError where it cannot be read, is no TOML, is over `LARGEST` bytes or nested too deeply, or is of
    another schema.
    """
    text = _decode(_load(source, name), name)
    deep = toml_lines.too_deep(text)
    if deep is not None:
        raise TomlError(f"{name}:{deep}: is nested deeper than {toml_lines.DEEPEST} levels. Write it flatter.")
    root = TomlTable(name, _parse(text, name), (), toml_lines.lines(text))
    _check_schema(root, schema)
    return root


def _load(source: Path | bytes, name: str) -> bytes:
    try:
        size = len(source) if isinstance(source, bytes) else source.stat().st_size
        if size > LARGEST:
            raise TomlError(f"{name}: has {size:,} bytes, over the limit of {LARGEST:,}: is it the right file?")
        return source if isinstance(source, bytes) else source.read_bytes()
    except OSError as error:
        raise TomlError(f"{name}: cannot be read: {error.strerror or error}. Check path and permissions.") from None


def _decode(data: bytes, name: str) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise TomlError(f"{name}:1: is UTF-16, not UTF-8. Save it as UTF-8.")
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise TomlError(
            f"{name}:{line}: byte 0x{data[error.start]:02X} is not UTF-8 text. Save the file as UTF-8."
        ) from None


def _parse(text: str, name: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        says = str(error)
    except ValueError:  # Python's limit for integers
        raise TomlError(f"{name}: holds an integer of thousands of digits. Correct it.") from None
    at = re.search(r" \(at line (\d+), column (\d+)\)$", says)
    line, column = (int(at[1]), int(at[2])) if at else (text.rstrip().count("\n") + 1, 0)
    says = re.sub(r" \(at .*\)$", "", says)
    advice = next((todo for word, todo in _HINTS if word in says), "")
    rows = text.split("\n")
    if at and re.fullmatch(r"\d,", rows[line - 1][max(column - 2, 0) : column]):
        advice = "decimals take a point, not a comma"
    place = f" (column {column})" if at else ""
    raise TomlError(f"{name}:{line}: is not TOML: {says}{place}{': ' + advice if advice else ''}.")


def _check_schema(root: TomlTable, schema: str) -> None:
    found = root.get("schema", TEXT)
    if found is None or found == schema:
        return
    kind, _, version = schema.partition("/")
    its_kind, _, its_version = found.partition("/")
    if its_kind != kind:
        raise root.error(
            f'schema "{found}" is not that of this kind of file, "{schema}": is it the right file?', "schema"
        )
    newer = its_version.isdecimal() and int(its_version) > int(version)
    says = "is newer than this whyhot reads: install a newer whyhot" if newer else f'is unknown: write "{schema}"'
    raise root.error(f'schema "{found}" {says}.', "schema")


def _called(values: Mapping[str, Any]) -> str:
    for key in _NAMES:
        value = values.get(key)
        if isinstance(value, str):
            return f' ({key} "{value[:60]}")'
        if isinstance(value, list) and value and all(isinstance(x, str) for x in value):
            return f" ({'-'.join(value)[:60]})"
    return ""


def _found(value: Any) -> str:
    words: tuple[tuple[Any, str], ...] = (
        (bool, "{0} (true or false)"),
        (str, 'the text "{1}"'),
        (int | float, "the number {1}"),
        (list, "a list"),
        (dict, "a table"),
        (date | time, "the date or time {1}"),
    )
    shape = next(shape for kind, shape in words if isinstance(value, kind))
    return shape.format(str(value).lower(), _short(value))


def _short(value: Any) -> str:
    try:
        return str(value)[:60]
    except ValueError:  # an integer of thousands of digits
        return "of thousands of digits"
