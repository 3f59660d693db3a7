"""CSV of CAN frames as the converters of CSS Electronics (CANedge, CLX000) write it from MF4, packed with gzip or not.

A line is `TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes`, identifier and data in hexadecimal,
`Dir` 1 where the logger sent it, `EDL` 1 of CAN FD. Described by what writes it:
https://github.com/CSS-Electronics/mdf4-converters
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from ingest.formats import FD, TRANSMIT
from ingest.formats._frame_lines import FrameLines, OneFrame, frame_of, identifier, nanoseconds, whole

HEADER = re.compile(r"TimestampEpoch([;,])BusChannel\1ID\1IDE\1DLC\1DataLength\1Dir\1EDL\1BRS\1DataBytes", re.ASCII)
LINE = re.compile(
    r"(\d{1,12}(?:\.\d{1,20})?)([;,])(\d{1,4})\2([0-9A-F]{1,8})\2([01])\2\d{1,2}\2(\d{1,2})\2([01])\2([01])\2[01]\2"
    r"((?:[0-9A-F]{2})*)",
    re.ASCII | re.IGNORECASE,
)


@dataclass
class CssCsvLog(FrameLines):
    """A CSV log of CANedge's converter."""

    called = "a CSV log of CANedge's converter"

    def parse(self, line: str) -> OneFrame | str | None:
        """See `FrameLines.parse`."""
        if HEADER.fullmatch(line):
            return None
        match = LINE.fullmatch(line)
        if match is None:
            return "is no line of a CSV log of CANedge's converter"
        stamp, _, bus, digits, extended, said, way, fd, text = match.groups()
        flags = (TRANSMIT if way == "1" else 0) | (FD if fd == "1" else 0)
        can_id = identifier(int(digits, 16), extended == "1")
        return frame_of(nanoseconds(stamp), int(bus), can_id, flags, whole(bytes.fromhex(text), int(said)))


reader = CssCsvLog
