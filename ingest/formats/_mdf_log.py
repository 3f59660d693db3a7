"""What all logs in MF4 files have in common: their head, their start, and one data group after another up to damage."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import timedelta
from typing import IO

from ingest.formats import EARLIEST_NS, EPOCH, LATE_NS, Log
from ingest.formats._mdf_blocks import BrokenBlock, Mdf, Records

FILE_HEAD = struct.Struct("<8s8s8s4xH30xHH")  # mark, version, program, version, what is not written yet
START = struct.Struct("<QhhB")  # ns, offsets [min], flags
HEADER_AT = 64
LOCAL_TIME = 1  # flag of a start
UNFINISHED = b"UnFinMF "


@dataclass
class MdfLog(Log):
    """An MF4 file. `_problems`: what is wrong with it, a clause each."""

    _start_ns: int = 0
    _problems: list[str] = field(default_factory=list)

    def _records(self, file: IO[bytes]) -> Iterator[tuple[Mdf, Records]]:
        """The records of each data group; one that is damaged is noted, and the next is read."""
        size = self.path.stat().st_size
        head = file.read(FILE_HEAD.size)
        if len(head) < FILE_HEAD.size:
            self._problems.append(f"ends inside its header ({size:,} bytes)")
            return
        mark, version, _, _, open_parts, _ = FILE_HEAD.unpack(head)
        self.settings["version"] = version.split(b"\0")[0].decode("latin-1").strip()
        self.settings["finalised"] = mark != UNFINISHED
        mdf = Mdf(file, size, open_parts if mark == UNFINISHED else 0)
        try:
            header = mdf.block(HEADER_AT, b"##HD")
            self._take_start(header.data)
            for data_group in mdf.chain(header.links[0] if header.links else 0, b"##DG"):
                try:
                    records = mdf.records(data_group)
                except BrokenBlock as broken:
                    self._problems.append(str(broken))
                    continue
                yield mdf, records
                if records.ended:
                    self._problems.append(records.ended)
        except BrokenBlock as broken:
            self._problems.append(str(broken))

    def _take_start(self, data: bytes) -> None:
        start_ns, _, _, flags = START.unpack_from(data.ljust(START.size, b"\0"))
        if flags & LOCAL_TIME and start_ns < LATE_NS:
            start_ns = self.time.wall_ns((EPOCH + timedelta(microseconds=start_ns // 1000)).replace(tzinfo=None)) or 0
        dated = EARLIEST_NS <= start_ns < LATE_NS
        self.absolute = dated or self.time.start_ns is not None
        self._start_ns = self.time.start_ns if self.time.start_ns is not None else start_ns if dated else 0
