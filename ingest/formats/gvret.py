"""GVRET: CSV of frames as SavvyCAN and the loggers of that family write it, packed with gzip or not.

A line is `Time Stamp,ID,Extended,Dir,Bus,LEN,D1,...`, without `Dir` in older files; stamps are microseconds since the
logger began, or since 1970. Cells behind the last byte are filled with zeros, and dropped. A frame of more than 8 bytes
is one of CAN FD. Described by what writes it: https://github.com/collin80/SavvyCAN, framefileio.cpp.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from ingest.formats import FD, TRANSMIT
from ingest.formats._frame_lines import (
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

HEADER = re.compile(r"time stamp,id,extended,(dir,)?bus,len", re.IGNORECASE)
LINE = re.compile(
    r"(\d{1,18}(?:\.\d{1,9})?),([0-9a-f]{1,8}),(true|false|1|0),(?:([rt]x),)?(\d{1,4}),(\d{1,2})((?:,.*)?)",
    re.ASCII | re.IGNORECASE,
)
MICROSECOND_DIGITS = 3  # of a microsecond in nanoseconds


@dataclass
class GvretLog(FrameLines):
    """A log of SavvyCAN."""

    called = "a GVRET log of SavvyCAN"

    def parse(self, line: str) -> OneFrame | str | None:
        """See `FrameLines.parse`."""
        if HEADER.match(line):
            return None
        match = LINE.fullmatch(line)
        if match is None:
            return "is no line of a GVRET log"
        stamp, digits, extended, way, bus, said, cells = match.groups()
        length = int(said)
        if length > LONGEST_FD:
            return f"says it holds {length} bytes, more than the {LONGEST_FD} of a frame"
        can_id = identifier(int(digits, 16), extended.lower() in ("true", "1"))
        data = counted(octets(cells[1:].replace(",", " ")), length)
        flags = (FD if length > LONGEST_CLASSIC else 0) | (TRANSMIT if (way or "").lower() == "tx" else 0)
        return frame_of(nanoseconds(stamp, MICROSECOND_DIGITS), int(bus), can_id, flags, data)


reader = GvretLog
