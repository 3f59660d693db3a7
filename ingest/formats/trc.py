"""TRC: trace files of PEAK's PCAN programs, versions 1.0 to 1.3, 2.0 and 2.1, packed with gzip or not.

The start is a wall clock time without a zone: UTC unless `[time]` names a zone and no column, or `[time] start`
replaces it; without either, time counts from 0. Version 1.0 has it in a comment. Error frames are found and rejected;
changes of status, error counters and events are no frames: they are counted in `settings["other_lines"]`. Described in
https://www.peak-system.com/produktcd/Pdf/English/PEAK_CAN_TRC_File_Format.pdf
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from decimal import Decimal, InvalidOperation

from ingest.errors import UnreadableLogError
from ingest.formats import FD, REMOTE, SHOWN, TRANSMIT
from ingest.formats._frame_lines import (
    ERROR_FRAME,
    FD_LENGTHS,
    LONGEST_CLASSIC,
    LONGEST_FD,
    ONLY_BUS,
    FrameLines,
    OneFrame,
    counted,
    frame_of,
    identifier,
    nanoseconds,
    octets,
)

# What the columns of a version hold, by the letters of $COLUMNS: number, offset [ms], type, bus, identifier, direction,
# reserved, data length code (l: data length), data. Version 2 says its own.
COLUMNS = {"1.0": "NOILD", "1.1": "NOdILD", "1.2": "NOBdILD", "1.3": "NOBdIRLD", "2.0": "NOTIdlD", "2.1": "NOTBIdRLD"}
NEEDED = "OTIdD"  # of version 2
WORDS = {
    "N": r"\d+\)?",
    "O": r"(?P<O>\d{1,12}(?:\.\d{1,9})?)",
    "T": r"(?P<T>DT|RR|FD|FB|FE|BI)",
    "B": r"(?P<B>\d{1,4})",
    "I": r"(?P<I>[0-9A-Fa-f]{1,8})",
    "d": r"(?P<d>Rx|Tx)",
    "L": r"(?P<L>\d{1,2})",
    "l": r"(?P<l>\d{1,2})",
}
BEGIN = re.compile(r"\d+\)?\s+\d{1,12}(?:\.\d{1,9})?\s", re.ASCII)
KEY_LINE = re.compile(r";\$(FILEVERSION|STARTTIME|COLUMNS)=(.*)", re.IGNORECASE)
START_LINE = re.compile(
    r";\s*Start time:\s*(?:(?P<d>\d\d)\.(?P<m>\d\d)\.(?P<y>\d{4})|(?P<Y>\d{4})-(?P<M>\d\d)-(?P<D>\d\d))\s+"
    r"(?P<clock>\d\d:\d\d:\d\d)(?:\.(?P<fraction>\d+))?",
    re.ASCII,
)
DAY_ZERO = datetime(1899, 12, 30)
DAY_US = 86_400_000_000
OFFSET_DIGITS = 6  # of a millisecond in nanoseconds
STANDARD_DIGITS = 4  # an identifier of more is one of 29 bits
NO_IDENTIFIER = "FFFFFFFF"  # of a line of version 1 that tells the state of the bus
CLASSIC_TYPES, FD_TYPES = ("DT", "RR", "Rx", "Tx"), ("FD", "FB", "FE", "BI")
OTHER_TYPES = ("ST", "EC", "EV", "Warng")  # status, error counter, event
ERROR_TYPES = ("ER", "Error")
CODED = {text: FD_LENGTHS[code] for code in range(len(FD_LENGTHS)) for text in (f"{code}", f"{code:02}")}


@dataclass
class TrcLog(FrameLines):
    """A trace file."""

    called = "a TRC file"
    dated = False
    _columns: str = COLUMNS["1.0"]
    _line: re.Pattern[str] = field(default_factory=lambda: _line(COLUMNS["1.0"]))
    _dated_by: str | None = None

    def parse(self, line: str) -> OneFrame | str | None:
        """See `FrameLines.parse`."""
        if line.startswith(";"):
            self._header(line)
            return None
        match = self._line.fullmatch(line)
        if match is None:
            return self._no_frame(line)
        word, text = match.groupdict(), match["D"] or ""
        if text.startswith("ERROR"):
            return ERROR_FRAME
        if word["I"] == NO_IDENTIFIER:
            return None
        kind = word.get("T")
        remote, fd = kind == "RR" or text.startswith("RTR"), kind in FD_TYPES
        length = 0 if remote else int(word["l"]) if "l" in word else CODED.get(word["L"], LONGEST_FD + 1)
        length = length if fd or "l" in word else min(length, LONGEST_CLASSIC)
        data: bytes | str = counted(octets(text), length)
        if length > (LONGEST_FD if fd else LONGEST_CLASSIC):
            data = f"says it holds more than the {LONGEST_FD if fd else LONGEST_CLASSIC} bytes of a frame"
        flags = (REMOTE if remote else 0) | (FD if fd else 0) | (TRANSMIT if word.get("d") == "Tx" else 0)
        can_id = identifier(int(word["I"], 16), len(word["I"]) > STANDARD_DIGITS)
        return frame_of(nanoseconds(word["O"], OFFSET_DIGITS), int(word.get("B", ONLY_BUS)), can_id, flags, data)

    def _no_frame(self, line: str) -> str | None:
        """Why a line holds no frame that can be read; None where it is none of a frame."""
        if not BEGIN.match(line):
            return "is no line of a TRC file"
        words = line.split()
        place = max(self._columns.find("T"), 0) or self._columns.find("d")
        kind = words[place] if 0 <= place < len(words) else ""
        if kind in ERROR_TYPES:
            return ERROR_FRAME
        if kind in OTHER_TYPES:
            return None
        if "T" in self._columns and kind not in (*CLASSIC_TYPES, *FD_TYPES):
            return f'has the type "{kind[:SHOWN]}", which is none of a frame'
        return "is a frame that is not complete"

    # ---- header ----------------------------------------------------------------------------------------------------

    def _header(self, line: str) -> None:
        if match := KEY_LINE.match(line):
            key, value = match[1].upper(), match[2].strip()
            if key == "FILEVERSION":
                self._take_version(value)
            elif key == "COLUMNS":
                self._take_columns(value)
            else:
                self._take_start(_day(value), value, "$STARTTIME")
        elif self._dated_by is None and (match := START_LINE.match(line)):
            self._take_start(_stamp(match), line, "comment")

    def _take_version(self, version: str) -> None:
        if version not in COLUMNS:
            raise UnreadableLogError(
                f'{self.path.name}: is a TRC file of version "{version[:SHOWN]}"; versions {", ".join(COLUMNS)} are '
                "read. Save it as one of these (PCAN-View, PEAK-Converter)."
            )
        self.settings["version"] = version
        self._columns, self._line = COLUMNS[version], _line(COLUMNS[version])

    def _take_columns(self, columns: str) -> None:
        letters = columns.replace(",", "")
        lacking = [letter for letter in NEEDED if letter not in letters]
        if lacking or not {"l", "L"} & set(letters):
            raise UnreadableLogError(
                f"{self.path.name}: its line ;$COLUMNS={columns[:SHOWN]} names no column "
                f"{', '.join(lacking) or 'l or L'}: its frames cannot be read. Save it with all columns."
            )
        if twice := [letter for letter in WORDS if letters.count(letter) > 1]:
            raise UnreadableLogError(
                f"{self.path.name}: its line ;$COLUMNS={columns[:SHOWN]} names column {', '.join(twice)} twice: its "
                "frames cannot be read. Copy the file again if the original is whole."
            )
        self._columns, self._line = letters, _line(letters)

    def _take_start(self, stamp: datetime | None, said: str, by: str) -> None:
        start_ns = self.time.wall_ns(stamp) if stamp else None
        if start_ns is None:
            self.settings["date_not_understood"] = said[:SHOWN]
            return
        self._dated_by = by
        if self.time.start_ns is None:
            self._start_ns = start_ns


def _line(columns: str) -> re.Pattern[str]:
    """What a frame looks like whose words these columns hold, the data last."""
    words = [WORDS.get(letter, r"\S+") for letter in columns if letter != "D"]
    return re.compile(r"\s+".join(words) + r"(?:\s+(?P<D>.*))?", re.ASCII)


def _day(text: str) -> datetime | None:
    """The moment that is so many days after 30 December 1899."""
    try:
        return DAY_ZERO + timedelta(microseconds=round(Decimal(text) * DAY_US))
    except (InvalidOperation, OverflowError, ValueError):
        return None


def _stamp(match: re.Match[str]) -> datetime | None:
    date = "-".join(match[low] or match[high] for low, high in ("yY", "mM", "dD"))
    micro = (match["fraction"] or "")[:6].ljust(6, "0")
    try:
        return datetime.fromisoformat(f"{date}T{match['clock']}.{micro}")
    except ValueError:
        return None


reader = TrcLog
