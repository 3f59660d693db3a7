"""The blocks of an MDF file of version 2 or 3, as `ingest/formats/_mdf_blocks.py` gives those of version 4.

A block begins with two letters and its length, and names others by their place in the file. Records lie in one piece
for each data group. Laid out as in ASAM's MDF 3.3: https://www.asam.net/standards/detail/mdf/
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime
from typing import IO, Any

import numpy as np

from ingest.formats import TimeSpec
from ingest.formats._mdf_blocks import BrokenBlock, MdfChannel, MdfGroup
from ingest.formats._mdf_conversions import (
    FORMULA,
    IDENTITY,
    INTERPOLATED,
    LINEAR,
    NEAREST,
    RANGE_TEXTS,
    RATIONAL,
    TEXTS,
    MdfConversion,
    Named,
    as_stored,
    conversion,
)
from ingest.formats._mdf_records import FileBytes, Piece, Records, Stored, octets, unsorted_records

HEADER_AT = 64
ORDER_AT = 24  # of the file: 0 where numbers begin with their lowest byte
HEAD = "2sH"
HEADER, HEADER_STAMP = "3IH10s8s", "Qh"
STAMP_AT = 160  # of a header: since version 3.2
DATA_GROUP, CHANNEL_GROUP = "4I2H", "3I3HI"
CHANNEL, LONG_NAME_AT, BYTE_AT = "5IH32s128s3H", 214, 222
CONVERSION, CONVERSION_END = "H2d20s2H", 42
MASTER = 1
FORMS = {0: 0, 13: 0, 9: 1, 1: 2, 14: 2, 10: 3, 2: 4, 3: 4, 15: 4, 16: 4, 11: 5, 12: 5, 7: 6, 8: 10}  # as in version 4
BY_FILE = (0, 1, 2, 3)  # types whose order of bytes is the file's
KINDS = {0: LINEAR, 1: INTERPOLATED, 2: NEAREST, 6: RATIONAL, 9: RATIONAL, 10: FORMULA, 11: TEXTS, 12: RANGE_TEXTS}
POLYNOMIAL, NONE = 6, 65535
TEXT_ENTRY, RANGE_ENTRY = "d32s", "2dI"
MOST_PARAMETERS = 4096
DATE = re.compile(r"(\d\d):(\d\d):(\d{4}) (\d\d):(\d\d):(\d\d)")


@dataclass(frozen=True)
class OldBlock:
    """One block without its head."""

    at: int
    data: bytes


class Mdf3:
    """An open file of version 2 or 3. `waiting`: an empty file for records that are sorted."""

    def __init__(self, file: IO[bytes], size: int, waiting: IO[bytes]) -> None:
        self._file, self._size, self._waiting = file, size, waiting
        self._order = ">" if int.from_bytes(self._read(ORDER_AT, 2), "little") else "<"
        self._conversions: dict[int, tuple[MdfConversion, str]] = {}

    def start_ns(self, time: TimeSpec) -> tuple[int, bool]:
        """When the recording began [ns UTC], 0 where the file does not say it; whether by a wall clock without a zone,
        as before version 3.2."""
        block = self._block(HEADER_AT, b"HD")
        *_, date, clock = self._unpack(HEADER, block)
        if len(block.data) >= STAMP_AT + 10:
            stamp_ns, hours = self._unpack(HEADER_STAMP, block, STAMP_AT)
            return int(stamp_ns) - 3_600_000_000_000 * int(hours), False
        match = DATE.fullmatch(f"{_text(date)} {_text(clock)}")
        try:
            day, month, year, hour, minute, second = map(int, match.groups()) if match else (0,) * 6
            return time.wall_ns(datetime(year, month, day, hour, minute, second)) or 0, True
        except ValueError:
            return 0, True

    def data_groups(self) -> Iterator[OldBlock]:
        """All data groups. Raises BrokenBlock."""
        (first, *_) = self._unpack(HEADER, self._block(HEADER_AT, b"HD"))
        return self._chain(first, b"DG")

    def records(self, data_group: OldBlock) -> Records:
        """All records of a data group. Raises BrokenBlock where its description is none."""
        _, first, _, at, _, ids = self._unpack(DATA_GROUP, data_group)
        groups = tuple(self._group(block, ids == 2) for block in self._chain(first, b"CG"))
        if ids > 2 or (ids == 0 and len(groups) > 1):
            raise BrokenBlock(f"is damaged at byte {data_group.at:,}")
        wanted = sum(group.declared * (group.size + min(ids, 1)) for group in groups)
        part = FileBytes(self._file, at, max(0, min(wanted, self._size - at)) if at else 0)
        ended = f"ends at byte {self._size:,} of {at + wanted:,}" if part.length < wanted else None
        if ids:
            found = unsorted_records(groups, octets([part]), 1, ended, self._waiting)
            return replace(found, pieces=[Piece(0, at)])
        of = {}
        for group in groups:
            count = min(group.declared, part.length // group.size) if group.size else 0
            of[group.at] = Stored([part], count, group.size)
        return Records(groups, of, {}, ended, [Piece(0, at)])

    def _group(self, block: OldBlock, id_behind: bool) -> MdfGroup:
        _, first, comment, number, _, size, count = self._unpack(CHANNEL_GROUP, block)
        channels = tuple(self._channel(one) for one in self._chain(first, b"CN"))
        name = self._comment(comment).splitlines()[:1]
        return MdfGroup("".join(name), block.at, number, count, 0, size + id_behind, channels)

    def _channel(self, block: OldBlock) -> MdfChannel:
        _, law_at, _, parts, _, kind, short, _, start, bits, form = self._unpack(CHANNEL, block)
        has_long, has_byte = len(block.data) >= LONG_NAME_AT + 4, len(block.data) >= BYTE_AT + 2
        long = self._comment(self._unpack("I", block, LONG_NAME_AT)[0]) if has_long else ""
        further = self._unpack("H", block, BYTE_AT)[0] if has_byte else 0
        law, unit = self._conversion(law_at)
        known = FORMS.get(form)
        of_file = int(form in BY_FILE and self._order == ">")
        return MdfChannel(
            name=long or _text(short),
            kind=2 if kind == MASTER else 0,
            sync=1 if kind == MASTER else 0,
            form=10 if known is None else known + of_file,
            bit=start % 8,
            byte=start // 8 + further,
            bits=bits,
            values_at=0,
            conversion=law,
            unit=unit,
            is_array=parts != 0,
        )

    def _conversion(self, at: int) -> tuple[MdfConversion, str]:
        if not at:
            return as_stored(), ""
        if at not in self._conversions:
            block = self._block(at, b"CC")
            _, _, _, unit, kind, count = self._unpack(CONVERSION, block)
            self._conversions[at] = self._law(block, kind, count), _text(unit)
        return self._conversions[at]

    def _law(self, block: OldBlock, kind: int, count: int) -> MdfConversion:
        rest = block.data[CONVERSION_END:]
        if kind == NONE:
            return conversion(IDENTITY, np.empty(0), [])
        if kind == 10:
            return conversion(FORMULA, np.empty(0), [], _text(rest))
        if kind in (11, 12) and count <= MOST_PARAMETERS:
            return self._texts(block, kind, count)
        if kind not in KINDS:
            return as_stored(f"conversion of kind {kind} of MDF 3 is not read")
        values = np.frombuffer(rest[: len(rest) // 8 * 8], f"{self._order}f8").astype(np.float64)
        sizes = {0: 2, 1: 2 * count, 2: 2 * count, POLYNOMIAL: 6, 9: 6}
        values = values[: sizes[kind]]
        if kind == POLYNOMIAL and len(values) == 6:
            a, b, c, d, e, f = values
            values = np.array([0, -d, b + d * (e + f), 0, c, -c * (e + f) - a])
        return conversion(KINDS[kind], values, [])

    def _texts(self, block: OldBlock, kind: int, count: int) -> MdfConversion:
        """A table of texts; the first entry of one of ranges is for all other values."""
        form = struct.Struct(self._order + (TEXT_ENTRY if kind == 11 else RANGE_ENTRY))
        if len(block.data) < CONVERSION_END + count * form.size:
            raise BrokenBlock(f"is damaged at byte {block.at:,}")
        entries = [form.unpack_from(block.data, CONVERSION_END + i * form.size) for i in range(count)]
        named: list[Named]
        if kind == 11:
            keys, named = [key for key, _ in entries], [_text(text) or None for _, text in entries]
            return conversion(TEXTS, np.array(keys, float), [*named, None])
        named = [self._comment(place) or None for _, _, place in entries]
        ends = [end for low, high, _ in entries[1:] for end in (low, high)]
        return conversion(RANGE_TEXTS, np.array(ends, float), [*named[1:], *(named[:1] or [None])])

    def _comment(self, at: int) -> str:
        return _text(self._block(at, b"TX").data) if at else ""

    # ---- blocks ----------------------------------------------------------------------------------------------------

    def _chain(self, at: int, mark: bytes) -> Iterator[OldBlock]:
        seen = set[int]()
        while at:
            if at in seen:
                raise BrokenBlock(f"is damaged at byte {at:,}")
            seen.add(at)
            block = self._block(at, mark)
            yield block
            (at,) = self._unpack("I", block)

    def _block(self, at: int, mark: bytes) -> OldBlock:
        head = self._read(at, 4)
        if len(head) < 4:
            raise BrokenBlock(f"ends before byte {at:,}")
        found, length = struct.unpack(self._order + HEAD, head)
        data = self._read(at + 4, length - 4)
        if found != mark or len(data) < length - 4:
            raise BrokenBlock(f"is damaged at byte {at:,}")
        return OldBlock(at, data)

    def _unpack(self, form: str, block: OldBlock, at: int = 0) -> tuple[Any, ...]:
        try:
            return struct.unpack_from(self._order + form, block.data, at)
        except struct.error:
            raise BrokenBlock(f"is damaged at byte {block.at:,}") from None

    def _read(self, at: int, count: int) -> bytes:
        if not 0 <= at <= self._size or count <= 0:
            return b""
        self._file.seek(at)
        return self._file.read(min(count, self._size - at))


def _text(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode("latin-1").strip()
