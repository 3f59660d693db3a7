"""The outer layer of a BLF file: objects one behind the other, most of them containers packed with zlib."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

from ingest.formats._blf_objects import BASE_BYTES, LONGEST_OBJECT, MAGIC, PADDING

BASE = struct.Struct("<4sHHLL")  # magic, header size, header version, object size, type
CONTAINER = struct.Struct("<H6xL4x")  # compression, unpacked size
CONTAINER_TYPE = 10
STORED, DEFLATED = 0, 2
LARGEST = LONGEST_OBJECT  # bytes of a container, packed or unpacked
WINDOW = 1 << 20  # bytes that are searched at once for the next container
STEP = 256  # bytes that are unpacked at once once a container has turned out to be damaged


@dataclass(frozen=True)
class Part:
    """What one outer object holds. `problem`: why it is not whole, as a clause; then `data` is what came before."""

    at: int  # its first byte in the file
    data: bytes
    problem: str | None = None


def parts(file: IO[bytes], first: int, size: int) -> Iterator[Part]:
    """The outer objects of a file of `size` bytes, from byte `first`; every byte of it is read at most twice.

    After damage it goes on at the next container that is there.
    """
    at = first
    while at < size:
        at += max(0, _peek(file, at).find(MAGIC))
        head = _read(file, at, BASE.size)
        if len(head) < BASE.size or not head.startswith(MAGIC):
            if not head.strip(b"\0") and size - at <= BASE.size:  # padding at the very end
                return
            says = "ends inside an object" if size - at < BASE.size else "is damaged: no object begins"
            resume = _next_container(file, at + 1, size)
            yield Part(at, b"", f"{says} at byte {at:,}")
            at = resume
            continue
        length, kind = BASE.unpack(head)[3:]
        end, problem = at + length, None
        resume = end
        if not BASE.size <= length <= LARGEST or not _leads_on(file, end, size):
            resume = _next_container(file, at + BASE.size, size)
            problem = _broken(at, length, resume, size)
        part = _unpack(at, _read(file, at, min(end, resume) - at) if length <= LARGEST else b"", kind)
        yield Part(at, part.data, problem or part.problem)
        at = resume


def _leads_on(file: IO[bytes], end: int, size: int) -> bool:
    """Whether another object, or the end of the file, follows at `end`."""
    rest = _peek(file, end)
    return end <= size and (MAGIC in rest or (size - end < BASE.size and not rest.strip(b"\0")))


def _broken(at: int, length: int, resume: int, size: int) -> str:
    if resume == size and length <= LARGEST and at + length > size:
        return f"ends inside a container at byte {size:,}"
    return f"is damaged at byte {at:,} (an object that says it is {length:,} bytes long)"


def _read(file: IO[bytes], at: int, count: int) -> bytes:
    file.seek(at)
    return file.read(max(0, count))


def _peek(file: IO[bytes], at: int) -> bytes:
    return _read(file, at, PADDING + len(MAGIC))


def _next_container(file: IO[bytes], at: int, size: int) -> int:
    """First byte of the next container at or after byte `at`; `size` where there is none."""
    while at < size:
        window = _read(file, at, WINDOW + BASE.size)
        found = window.find(MAGIC)
        while 0 <= found <= len(window) - BASE.size:
            _, header, _, length, kind = BASE.unpack_from(window, found)
            if kind == CONTAINER_TYPE and header == BASE_BYTES and BASE.size <= length <= LARGEST:
                return at + found
            found = window.find(MAGIC, found + 1)
        at += WINDOW
    return size


def _unpack(at: int, body: bytes, kind: int) -> Part:
    """The bytes of the outer object `body`: those of a frame as they are, those of a container unpacked."""
    if kind != CONTAINER_TYPE:
        return Part(at, body)
    if len(body) < BASE.size + CONTAINER.size:
        return Part(at, b"", f"is damaged at byte {at:,} (a container without contents)")
    method, declared = CONTAINER.unpack_from(body, BASE.size)
    packed = body[BASE.size + CONTAINER.size :]
    if method == STORED:
        return Part(at, packed)
    if method != DEFLATED or declared > LARGEST:
        says = f"{declared:,} bytes unpacked" if method == DEFLATED else f"unknown compression {method}"
        return Part(at, b"", f"is damaged at byte {at:,} (a container of {says})")
    data, says = _inflate(packed, declared)
    return Part(at, data, f"is damaged at byte {at:,} (a container that {says})" if says else None)


def _inflate(packed: bytes, declared: int) -> tuple[bytes, str]:
    """At most `declared` bytes of `packed`, and what is wrong with them ("" where nothing is)."""
    unpacker = zlib.decompressobj()
    try:
        data = unpacker.decompress(packed, declared + 1)
    except zlib.error:
        return _before_damage(packed, declared), "cannot be unpacked"
    if len(data) > declared:
        return data[:declared], f"unpacks to more than the {declared:,} bytes it declares"
    if len(data) < declared:
        return data, f"unpacks to {len(data):,} of {declared:,} bytes"
    return data, ""


def _before_damage(packed: bytes, declared: int) -> bytes:
    unpacker, data = zlib.decompressobj(), bytearray()
    try:
        for first in range(0, len(packed), STEP):
            data += unpacker.decompress(packed[first : first + STEP], declared + 1 - len(data))
            if len(data) > declared:
                break
    except zlib.error:
        pass
    return bytes(data[:declared])
