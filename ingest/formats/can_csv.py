"""CSV of frames as python-can's logger writes it (`can_logger -f log.csv`), packed with gzip or not.

A line is `timestamp,arbitration_id,extended,remote,error,dlc,data`, the data in base64. It tells no bus: all is bus 1.
Nor does it tell direction or CAN FD; a frame of more than 8 bytes is one of CAN FD. Described in
https://python-can.readthedocs.io/en/stable/file_io.html#csv-files
"""

from __future__ import annotations

import binascii
import re
from base64 import b64decode
from dataclasses import dataclass

from ingest.formats import FD, REMOTE
from ingest.formats._frame_lines import (
    ERROR_FRAME,
    LONGEST_CLASSIC,
    ONLY_BUS,
    FrameLines,
    OneFrame,
    frame_of,
    identifier,
    nanoseconds,
    whole,
)

HEADER = "timestamp,arbitration_id,extended,remote,error,dlc,data"
LINE = re.compile(
    r"(\d{1,12}\.\d{1,20}|\d(?:\.\d{1,20})?e-\d\d),0x([0-9a-f]{1,8}),([01]),([01]),([01]),(\d{1,2}),([A-Za-z0-9+/]*={0,2})",
    re.ASCII,
)


@dataclass
class CanCsvLog(FrameLines):
    """A CSV log of python-can."""

    called = "a CSV log of python-can"

    def parse(self, line: str) -> OneFrame | str | None:
        """See `FrameLines.parse`."""
        if line == HEADER:
            return None
        match = LINE.fullmatch(line)
        if match is None:
            return "is no line of a CSV log of python-can"
        stamp, digits, extended, remote, error, said, text = match.groups()
        if error == "1":
            return ERROR_FRAME
        data = b"" if remote == "1" else _payload(text, int(said))
        flags = (REMOTE if remote == "1" else 0) | (FD if len(data) > LONGEST_CLASSIC else 0)
        return frame_of(nanoseconds(stamp), ONLY_BUS, identifier(int(digits, 16), extended == "1"), flags, data)


def _payload(text: str, length: int) -> bytes | str:
    try:
        data = b64decode(text, validate=True)
    except binascii.Error:
        return "its data are no base64"
    return whole(data, length)


reader = CanCsvLog
