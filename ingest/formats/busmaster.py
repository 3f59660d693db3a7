"""BUSMASTER: the logs of CAN frames that it writes, a frame a line.

`11:49:12:9420 Rx 1 0x023 s 2 40 0A` was received at 11:49:12.942 on channel 1; `x` marks 29-bit identifiers, an `r`
behind it a remote frame. The lines above say whether numbers are hexadecimal, and what a time is: of the day (SYSTEM
MODE), since the log was begun (ABSOLUTE) or since the frame before (RELATIVE). Its date, day:month:year, is that of a
local clock, UTC unless `[time] zone` says another. A file may hold several logs. Written by
https://github.com/rbei-etas/busmaster (FrameProcessor/LogObjectCAN.cpp).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime

from ingest.formats import FD, REMOTE, TRANSMIT, WALL_CLOCK
from ingest.formats._csv_stamps import DAY_NS, SECOND_NS
from ingest.formats._frame_lines import LONGEST_CLASSIC, LONGEST_FD, FrameLines, OneFrame, counted, frame_of, identifier

BEGUN = re.compile(r"\*{3}START DATE AND TIME (\d+):(\d+):(\d{4}) (\d+):(\d+):(\d+):(\d+)\*{3}", re.ASCII)
BASE = re.compile(r"\*{3}(HEX|DEC)\*{3}")
MODE = re.compile(r"\*{3}(SYSTEM|ABSOLUTE|RELATIVE) MODE\*{3}")
LINE = re.compile(
    r"(\d{1,4}):(\d{1,2}):(\d{1,2}):(\d{4}) ([RT]x) (\d{1,3}) (?:0x)?([0-9A-F]{1,10}) ([sx])(r?) (\d{1,2})"
    r"((?: [0-9A-F]{2,3})*)",
    re.ASCII | re.IGNORECASE,
)
TENTH_MS_NS = 100_000


@dataclass
class BusmasterLog(FrameLines):
    """A log of BUSMASTER."""

    called = "a log of BUSMASTER"
    _base: int = 16
    _mode: str = "SYSTEM"
    _day_ns: int = 0  # midnight of the frames to come, UTC
    _of_day_ns: int = 0  # of the frame before, at first of the beginning
    _begun_ns: int = 0  # UTC; 0 where no date is said
    _since_ns: int = 0  # the beginning, of the frame before

    def parse(self, line: str) -> OneFrame | str | None:
        """See `FrameLines.parse`."""
        if line.lstrip("-").startswith("***"):
            self._header(line)
            return None
        match = LINE.fullmatch(line)
        if match is None:
            return f"is no line of {self.called}"
        *clock, way, bus, digits, kind, remote, said, cells = match.groups()
        hour, minute, second, tenths = map(int, clock)
        length = int(said)
        if length > LONGEST_FD:
            return f"says it holds {length} bytes, more than the {LONGEST_FD} of a frame"
        try:
            number, octets = int(digits, self._base), bytes(int(cell, self._base) for cell in cells.split())
        except ValueError:  # hexadecimal digits, or a byte above 255
            return f"is no line of {self.called}"
        t_ns = self._stamp(_of_day_ns(hour, minute, second) + tenths * TENTH_MS_NS)
        flags = (REMOTE if remote else FD if length > LONGEST_CLASSIC else 0) | (TRANSMIT if way.lower() == "tx" else 0)
        data = b"" if remote else counted(octets, length)
        return frame_of(t_ns, int(bus), identifier(number, kind in "Xx"), flags, data)

    def _header(self, line: str) -> None:
        if mode := MODE.match(line):
            self._mode = self.settings["stamps"] = mode[1]
        if base := BASE.match(line):
            self._base = 16 if base[1] == "HEX" else 10
        if begun := BEGUN.match(line):
            day, month, year, hour, minute, second, ms = map(int, begun.groups())
            try:
                at_ns = self.time.wall_ns(datetime(year, month, day, hour, minute, second, ms % 1000 * 1000))
            except ValueError:  # no such day, or time
                at_ns = None
            self._begun_ns, self._since_ns = at_ns or 0, 0
            self.settings["time"] = WALL_CLOCK
            self._of_day_ns = _of_day_ns(hour, minute, second) if at_ns else 0
            self._day_ns = self._begun_ns // SECOND_NS * SECOND_NS - self._of_day_ns

    def _stamp(self, said_ns: int) -> int:
        """Since 1970, or since the log's own start where no date is said, of a time as a line says it."""
        if self._mode == "SYSTEM":
            if self._of_day_ns - said_ns > DAY_NS // 2:
                self._day_ns += DAY_NS
            self._of_day_ns = said_ns
            return self._day_ns + said_ns
        self._since_ns = said_ns + (self._since_ns if self._mode == "RELATIVE" else 0)
        return self._begun_ns + self._since_ns


def _of_day_ns(hour: int, minute: int, second: int) -> int:
    return ((hour * 60 + minute) * 60 + second) * SECOND_NS


reader = BusmasterLog
