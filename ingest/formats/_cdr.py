"""Messages of ROS 1 and ROS 2 (CDR) by the definitions that a file holds with them: their numbers by name.

Definitions: https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html; how they lie in bytes:
https://wiki.ros.org/ROS/Technical%20Overview and the OMG's CDR (formal/02-06-51, 15.3).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass

from ingest.formats._flattened import DEEPEST, MOST_ELEMENTS, NotRead, Numbers

NUMBERS = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
ROS1_TIMES = {"time": ("uint32", "uint32"), "duration": ("int32", "int32")}
FIELD = re.compile(r"([\w/]+)(?:<=\d+)?(\[(?:<=)?\d*\])?\s+([a-zA-Z]\w*)(\s*=)?")
SEPARATOR = re.compile(r"^=+\s*\nMSG:\s*(\S+)\s*$", re.MULTILINE)


@dataclass(frozen=True)
class Field:
    """A field of a message. `count`: None for one value, 0 for as many as the message says."""

    name: str
    kind: str
    count: int | None


Definitions = Mapping[str, tuple[Field, ...]]  # by the name of the type, "" for the message itself


def definitions(text: str) -> Definitions:
    """What a definition says. Raises NotRead."""
    parts = SEPARATOR.split(text)
    bodies = zip(["", *parts[1::2]], parts[::2], strict=True)
    return {name: tuple(_fields(body)) for name, body in bodies}


def _fields(body: str) -> list[Field]:
    found = []
    for line in body.splitlines():
        said = line.partition("#")[0].strip()
        match = FIELD.match(said)
        if match and not match[4]:  # with a "=" it is a constant; behind the name may stand what it is at first
            array = match[2]
            count = None if array is None else int(array[1:-1]) if array[1:-1].isdigit() else 0
            found.append(Field(match[3], match[1], count))
        elif said and not match:
            raise NotRead(f'its schema holds "{said[:60]}", which is no field')
    return found


def decoded(known: Definitions, data: bytes, *, ros1: bool) -> Numbers:
    """The numbers of a message. Raises NotRead."""
    reader = _Ros1(known, data) if ros1 else _Cdr(known, data)
    try:
        reader.fields("", "", 0)
    except struct.error:
        raise NotRead("ends before its schema does") from None
    return reader.found


class _Ros1:
    """Values one behind the other."""

    order = "<"

    def __init__(self, known: Definitions, data: bytes) -> None:
        self.known, self.data, self.at = known, data, 0
        self.found: Numbers = {}

    def number(self, kind: str) -> float:
        form = struct.Struct(self.order + NUMBERS[kind])
        self.at = self.aligned(form.size)
        (value,) = form.unpack_from(self.data, self.at)
        self.at += form.size
        return float(value)

    def aligned(self, size: int) -> int:
        return self.at

    def fields(self, kind: str, prefix: str, depth: int) -> None:
        """Read the fields of a type."""
        for field in self.known[kind]:
            self._field(field, kind, prefix + field.name, depth)

    def _field(self, field: Field, inside: str, name: str, depth: int) -> None:
        count = int(self.number("uint32")) if field.count == 0 else field.count
        if count is None:
            self._value(field.kind, inside, name, depth)
            return
        if count > len(self.data):
            raise NotRead(f"says that {name[:60]} has {count:,} elements, more than the message has bytes")
        if count > MOST_ELEMENTS and field.kind in NUMBERS:
            size = struct.calcsize(NUMBERS[field.kind])
            self.at = self.aligned(size) + size * count
            self.found[name] = None
            return
        for i in range(count):
            self._value(field.kind, inside, f"{name}[{i}]", depth)

    def _value(self, kind: str, inside: str, name: str, depth: int) -> None:
        if kind in NUMBERS:
            self.found[name] = self.number(kind)
        elif kind in ("string", "wstring"):
            size = int(self.number("uint32"))
            self.at += size * (2 if kind == "wstring" else 1)
            if self.at > len(self.data):
                raise NotRead("ends before its schema does")
        elif kind in ROS1_TIMES:
            for part, stored in zip(("sec", "nsec"), ROS1_TIMES[kind], strict=True):
                self.found[f"{name}.{part}"] = self.number(stored)
        elif depth >= DEEPEST:
            raise NotRead(f"its schema is nested deeper than {DEEPEST}")
        else:
            self.fields(self._type(kind, inside), f"{name}.", depth + 1)

    def _type(self, kind: str, inside: str) -> str:
        """The definition of a type: its name alone means one of the same package, `Header` that of std_msgs."""
        package = inside.rpartition("/")[0]
        for name in (kind, f"{package}/{kind}", f"std_msgs/{kind}"):
            if name in self.known:
                return name
        ends = [name for name in self.known if name.rpartition("/")[2] == kind.rpartition("/")[2]]
        if len(ends) != 1:
            raise NotRead(f'its schema does not say what "{kind[:60]}" is')
        return ends[0]


class _Cdr(_Ros1):
    """Values that lie at multiples of their size, behind four bytes that say in which order."""

    def __init__(self, known: Definitions, data: bytes) -> None:
        super().__init__(known, data)
        if len(data) < 4 or data[:1] != b"\0" or data[1] > 1:
            raise NotRead("does not begin as CDR does")
        self.order = "<" if data[1] else ">"
        self.at = 4

    def aligned(self, size: int) -> int:
        return 4 + -(-(self.at - 4) // size) * size
