"""Messages of protobuf as numbers by name, by the descriptors that stand in an MCAP file: no generated code is needed.

How a message lies in its bytes: https://protobuf.dev/programming-guides/encoding/. Descriptors are messages themselves,
of https://github.com/protocolbuffers/protobuf, src/google/protobuf/descriptor.proto.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ingest.formats._flattened import DEEPEST, MOST_ELEMENTS, NotRead, Numbers

VARINT, FIXED64, LENGTH, FIXED32 = 0, 1, 2, 5  # how a field lies in the bytes
DOUBLE, FLOAT, STRING, GROUP, MESSAGE, BYTES = 1, 2, 9, 10, 11, 12  # types of fields, as descriptors number them
FIXED = {1: "<d", 2: "<f", 6: "<Q", 7: "<I", 15: "<i", 16: "<q"}  # type -> how its bytes are read
ZIGZAG, SIGNED = (17, 18), (3, 5, 14)  # types whose varint is folded, or of two's complement
REPEATED = 3  # of a field's label
PROTO3 = "proto3"
BAD = "is no message of its schema"


@dataclass(frozen=True)
class _Field:
    name: str
    type: int
    of: str  # full name of the message, where it is one
    repeated: bool
    zero: bool  # it is 0 where it is not written


Messages = Mapping[str, Mapping[int, _Field]]  # full name -> number -> field


def definitions(descriptors: bytes) -> Messages:
    """The messages of a FileDescriptorSet. Raises NotRead."""
    found: dict[str, Mapping[int, _Field]] = {}
    for number, file in _fields(descriptors):
        if number == 1 and isinstance(file, bytes):
            said = list(_fields(file))
            package = next((_text(one) for number, one in said if number == 2), "")
            proto3 = any(_text(one) == PROTO3 for number, one in said if number == 12)
            for number, message in said:
                if number == 4 and isinstance(message, bytes):
                    _define(found, package, message, proto3, 0)
    return found


def decoded(known: Messages, name: str, data: bytes) -> Numbers:
    """The numbers of a message of the type `name`. Raises NotRead."""
    found: Numbers = {}
    _add(found, known, name, data, "", 0)
    return found


def _define(found: dict[str, Mapping[int, _Field]], package: str, descriptor: bytes, proto3: bool, depth: int) -> None:
    said = list(_fields(descriptor))
    full = ".".join(filter(None, (package, next((_text(one) for number, one in said if number == 1), ""))))
    found[full] = dict(_field(one, proto3) for number, one in said if number == 2 and isinstance(one, bytes))
    for number, inner in said:
        if number == 3 and isinstance(inner, bytes) and depth < DEEPEST:
            _define(found, full, inner, proto3, depth + 1)


def _field(descriptor: bytes, proto3: bool) -> tuple[int, _Field]:
    said = dict(_fields(descriptor))
    kind, number = said.get(5, 0), said.get(3, 0)
    if not isinstance(kind, int) or not isinstance(number, int):
        raise NotRead("its schema is damaged")
    plain = kind not in (STRING, GROUP, MESSAGE, BYTES)
    alone = not {9, 17} & set(said)  # in no oneof, not `optional`
    repeated = said.get(4) == REPEATED
    zero = proto3 and plain and alone and not repeated
    return number, _Field(_text(said.get(1, b"")), kind, _text(said.get(6, b"")).lstrip("."), repeated, zero)


def _text(value: int | bytes) -> str:
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else ""


def _add(found: Numbers, known: Messages, name: str, data: bytes, at: str, depth: int) -> None:
    fields = known.get(name)
    if fields is None:
        raise NotRead(f"its schema does not say what {name[:60]} is")
    found |= {f"{at}{one.name}": 0.0 for one in fields.values() if one.zero}
    many: dict[str, list[float | bytes | None]] = {}
    for number, value in _fields(data):
        if (one := fields.get(number)) is None:
            continue
        if one.repeated:
            many.setdefault(f"{at}{one.name}", []).extend(_values(one, value))
        for single in () if one.repeated else _values(one, value):
            _put(found, known, one, single, f"{at}{one.name}", depth)
    kinds = {f"{at}{one.name}": one for one in fields.values()}
    for path, values in many.items():
        if len(values) > MOST_ELEMENTS:
            found[path] = None
            continue
        for i, single in enumerate(values):
            _put(found, known, kinds[path], single, f"{path}[{i}]", depth)


def _put(found: Numbers, known: Messages, one: _Field, value: float | bytes | None, path: str, depth: int) -> None:
    if one.type != MESSAGE or not isinstance(value, bytes):
        found[path] = None if isinstance(value, bytes) else value
    elif depth < DEEPEST:
        _add(found, known, one.of, value, f"{path}.", depth + 1)
    else:
        found[path] = None


def _values(one: _Field, value: int | bytes) -> list[float | bytes | None]:
    """What a field holds: one value, or those of a packed list."""
    if one.type in (MESSAGE, STRING, BYTES, GROUP):
        return [value if isinstance(value, bytes) else None]
    if isinstance(value, int):
        return [_number(one.type, value)]
    if form := FIXED.get(one.type):
        if len(value) % struct.calcsize(form):
            raise NotRead(BAD)
        return [float(number) for (number,) in struct.iter_unpack(form, value)]
    numbers: list[float | bytes | None] = []
    at = 0
    while at < len(value):
        number, at = _varint(value, at)
        numbers.append(_number(one.type, number))
    return numbers


def _number(kind: int, raw: int) -> float:
    """A varint as its type means it."""
    if kind in ZIGZAG:
        return float((raw >> 1) ^ -(raw & 1))
    return float(raw - (1 << 64) if kind in SIGNED and raw >> 63 else raw)


def _fields(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """(number, value) of each field as it lies in the bytes: a varint as a number, else bytes. Raises NotRead."""
    at = 0
    while at < len(data):
        tag, at = _varint(data, at)
        number, form = tag >> 3, tag & 7
        if form == VARINT:
            value: int | bytes
            value, at = _varint(data, at)
        else:
            if form == LENGTH:
                size, at = _varint(data, at)
            else:
                size = {FIXED64: 8, FIXED32: 4}.get(form, -1)
            value, at = data[at : at + size], at + size
            if size < 0 or at > len(data):
                raise NotRead(BAD)
        yield number, value


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A number of 7 bits a byte from `at` on, and where it ends."""
    found = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            break
        byte = data[at]
        at += 1
        found |= (byte & 0x7F) << shift
        if byte < 0x80:
            return found & ((1 << 64) - 1), at
    raise NotRead(BAD)
