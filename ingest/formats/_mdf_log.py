"""What all logs in MDF files have in common: their head, their start, and one data group after another up to damage."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import timedelta
from tempfile import SpooledTemporaryFile
from typing import IO, TypeVar

from ingest.formats import EARLIEST_NS, EPOCH, LATE_NS, WALL_CLOCK, Log
from ingest.formats._mdf3_blocks import Mdf3
from ingest.formats._mdf_blocks import BrokenBlock
from ingest.formats._mdf_records import Mdf, Records

FILE_HEAD = struct.Struct("<8s8s8s4xH30xHH")  # mark, version, program, version, what is not written yet
START = struct.Struct("<QhhB")  # ns, offsets [min], flags
HEADER_AT = 64
IN_MEMORY = 64 << 20  # unpacked bytes; where there are more they wait in a file
LOCAL_TIME = 1  # flag of a start
UNFINISHED = b"UnFinMF "

DataGroup = TypeVar("DataGroup")


@dataclass
class MdfLog(Log):
    """An MDF file. `_problems`: what is wrong with it, a clause each."""

    _start_ns: int = 0
    _problems: list[str] = field(default_factory=list)

    @contextmanager
    def _opened(self) -> Iterator[Iterator[tuple[Mdf | Mdf3, Records]]]:
        """The records of each data group, to be read as long as the file is open."""
        with self.path.open("rb") as file, SpooledTemporaryFile(IN_MEMORY) as waiting:
            yield self._records(file, waiting)

    def _records(self, file: IO[bytes], waiting: IO[bytes]) -> Iterator[tuple[Mdf | Mdf3, Records]]:
        """The records of each data group; one that is damaged is noted, and the next is read."""
        size = self.path.stat().st_size
        head = file.read(FILE_HEAD.size)
        if len(head) < FILE_HEAD.size:
            self._problems.append(f"ends inside its header ({size:,} bytes)")
            return
        mark, version, _, _, open_parts, _ = FILE_HEAD.unpack(head)
        self.settings["version"] = version.split(b"\0")[0].decode("latin-1").strip()
        self.settings["finalised"] = mark != UNFINISHED
        try:
            if self.settings["version"] < "4":
                yield from self._of_version_3(Mdf3(file, size, waiting))
            else:
                yield from self._of_version_4(Mdf(file, size, open_parts if mark == UNFINISHED else 0, waiting))
        except BrokenBlock as broken:
            self._problems.append(str(broken))

    def _of_version_4(self, mdf: Mdf) -> Iterator[tuple[Mdf, Records]]:
        try:
            header = mdf.block(HEADER_AT, b"##HD")
        except BrokenBlock:
            raise BrokenBlock(f"its first block, at byte {HEADER_AT}, is damaged or encrypted") from None
        self._take_start(*self._start_of(header.data))
        groups = mdf.chain(header.links[0] if header.links else 0, b"##DG")
        yield from ((mdf, records) for records in self._each(groups, mdf.records))

    def _of_version_3(self, mdf: Mdf3) -> Iterator[tuple[Mdf3, Records]]:
        self._take_start(*mdf.start_ns(self.time))
        yield from ((mdf, records) for records in self._each(mdf.data_groups(), mdf.records))

    def _each(self, groups: Iterator[DataGroup], records_of: Callable[[DataGroup], Records]) -> Iterator[Records]:
        """The records of data groups; one that is damaged is noted, and the next is read."""
        for data_group in groups:
            try:
                records = records_of(data_group)
            except BrokenBlock as broken:
                self._problems.append(str(broken))
                continue
            yield records
            if records.ended:
                self._problems.append(records.ended)

    def _start_of(self, data: bytes) -> tuple[int, bool]:
        """(ns UTC, whether it is that of a wall clock without a zone)."""
        start_ns, _, _, flags = START.unpack_from(data.ljust(START.size, b"\0"))
        local = bool(flags & LOCAL_TIME)
        if local and start_ns < LATE_NS:
            start_ns = self.time.wall_ns((EPOCH + timedelta(microseconds=start_ns // 1000)).replace(tzinfo=None)) or 0
        return int(start_ns), local

    def _take_start(self, start_ns: int, local: bool) -> None:
        if local:
            self.settings["time"] = WALL_CLOCK
        dated = EARLIEST_NS <= start_ns < LATE_NS
        self.absolute = dated or self.time.start_ns is not None
        self._start_ns = self.time.start_ns if self.time.start_ns is not None else start_ns if dated else 0
