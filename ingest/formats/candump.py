"""candump: what `candump -l` of Linux' can-utils writes, or `candump` with any `-t` shows, packed with gzip or not.

`(1436509052.249713) vcan0 044#2A366C2BBA` is a frame; `##` marks CAN FD, `#R` a remote frame, and ` T` at the end one
that was sent. The number at the end of a bus's name is its number, `can1` is bus 1; a name without one, or with that of
another name, gets the least from 100 on that is free (`settings["buses"]`). A line does not say how long its frame is:
a last line without its line feed is rejected. Shown, the same frame is ` (1436509052.249713)  vcan0  044   [5]  2A 36
6C 2B BA`, with two digits for the length of one of CAN FD (`[05]`), and `RX - -` before its identifier where -x asked
for it. The stamps of `-tA` are dates of a local clock, UTC unless `[time] zone` says another; those of `-td`, which go
up and down, tell the time since the frame before. Described in https://github.com/linux-can/can-utils, lib.h.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from itertools import chain, count, pairwise

from ingest.formats import FD, REMOTE, TRANSMIT, WALL_CLOCK, Frames
from ingest.formats._frame_lines import (
    ERROR_FRAME,
    LONGEST_CLASSIC,
    LONGEST_FD,
    FrameLines,
    OneFrame,
    counted,
    frame_of,
    identifier,
    nanoseconds,
    octets,
)
from ingest.formats._text import TextFile

LINE = re.compile(
    r"\((\d{1,12}\.\d{1,9})\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(\S*)(?:\s+([RT]))?", re.ASCII | re.IGNORECASE
)
SHOWN_LINE = re.compile(
    r"\(((?:\d{1,12}|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)\.\d{1,9})\)\s+(\S+)\s+"
    r"(?:([RT])X \S \S\s+)?([0-9A-F]{3}|[0-9A-F]{8})\s+\[(\d{1,2})\]"
    r"(?:\s+(remote request|ERRORFRAME|(?:[0-9A-F]{2}(?: |$))*).*)?",
    re.ASCII,
)
XL_LINE = re.compile(r"\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,5}#[0-9A-Fa-f]{2}:")
SHORT_STAMP = re.compile(r"\s*\((\d{3}\.\d{6})\)", re.ASCII)  # of -tz and -td
NUMBER_AT_END = re.compile(r"\d{1,3}$")
ERROR_BIT = 0x2000_0000  # of an identifier of 8 digits
EXTENDED_DIGITS = 8
FIRST_UNSAID = 100  # number of a bus whose name says none


@dataclass
class CandumpLog(FrameLines):
    """A log of candump."""

    called = "a log of candump"
    tells_length = False
    _buses: dict[str, int] = field(default_factory=dict)
    _before_ns: int | None = None  # of the frame before, where stamps count from it

    def batches(self) -> Iterator[Frames]:
        """See `FrameLines.batches`."""
        begin = next(TextFile(self.path).blocks(), b"").decode("latin-1").split("\n")
        short = [float(match[1]) for match in map(SHORT_STAMP.match, begin) if match]
        if 10 * sum(b < a for a, b in pairwise(short)) > len(short):
            self._before_ns = 0
            self.settings["time"] = "s since the frame before"
        return super().batches()

    def parse(self, line: str) -> OneFrame | str | None:
        """See `FrameLines.parse`."""
        if line.startswith("#"):
            return None
        if shown := SHOWN_LINE.fullmatch(line):
            return self._shown(shown)
        match = LINE.fullmatch(line)
        if match is None:
            return "is a CAN XL frame" if XL_LINE.match(line) else "is no line of a candump log"
        stamp, name, digits, body, way = match.groups()
        t_ns = self._seconds(stamp)
        number, extended = int(digits, 16), len(digits) == EXTENDED_DIGITS
        if extended and number & ERROR_BIT:
            return ERROR_FRAME
        flags, data = _payload(body)
        flags |= TRANSMIT if way in ("T", "t") else 0
        return frame_of(t_ns, self._bus(name), identifier(number, extended), flags, data)

    def _shown(self, match: re.Match[str]) -> OneFrame | str:
        stamp, bus, way, digits, count, body = match.groups()
        t_ns = self._dated(stamp) if "-" in stamp else self._seconds(stamp)
        if t_ns is None:
            return f'has the stamp "{stamp}", which is no date of a log'
        number, extended = int(digits, 16), len(digits) == EXTENDED_DIGITS
        if extended and number & ERROR_BIT:
            return ERROR_FRAME
        flags = (FD if len(count) > 1 else 0) | (TRANSMIT if way == "T" else 0)
        data: bytes | str = counted(octets(body or ""), int(count))
        if body == "remote request":
            flags, data = flags | REMOTE, b""
        return frame_of(t_ns, self._bus(bus), identifier(number, extended), flags, data)

    def _dated(self, stamp: str) -> int | None:
        """A stamp that is a date [ns]; None where there is no such date, or no log is from it."""
        date, _, part = stamp.partition(".")
        try:
            whole = self.time.wall_ns(datetime.fromisoformat(date))
        except ValueError:
            return None
        self.settings["time"] = WALL_CLOCK
        return None if whole is None else whole + nanoseconds(f"0.{part}")

    def _seconds(self, stamp: str) -> int:
        """A stamp in seconds [ns], added up where it tells the time since the frame before."""
        if self._before_ns is None:
            return nanoseconds(stamp)
        self._before_ns += nanoseconds(stamp)
        return self._before_ns

    def _bus(self, name: str) -> int:
        if name not in self._buses:
            said, taken = NUMBER_AT_END.search(name), self._buses.values()
            numbers = chain([int(said[0])] if said else [], count(FIRST_UNSAID))
            self._buses[name] = next(number for number in numbers if number not in taken)
            self.settings["buses"] = dict(self._buses)
        return self._buses[name]


def _payload(body: str) -> tuple[int, bytes | str]:
    """(flags, payload) of what stands behind the first `#`; or instead of the payload why there is none."""
    if body[:1] in ("R", "r"):
        return REMOTE, b""
    fd = body.startswith("#")
    text = body[2:] if fd else body.partition("_")[0]  # behind _ stands a data length code above 8
    longest = LONGEST_FD if fd else LONGEST_CLASSIC
    flags = FD if fd else 0
    try:
        data = bytes.fromhex(text.replace(".", ""))
    except ValueError:
        return flags, "its data are no bytes of two hexadecimal digits each"
    if len(data) > longest:
        return flags, f"holds {len(data)} bytes, more than the {longest} of a frame"
    return flags, data


reader = CandumpLog
