"""The lines of an ASC log: which are frames, which are other events, and what is wrong with a line that is neither."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from itertools import takewhile

from ingest.formats import EXTENDED, FD, REMOTE, TRANSMIT
from ingest.formats._frame_lines import ERROR_FRAME, FD_LENGTHS, HIGHEST_BUS, HIGHEST_ID, LONGEST_CLASSIC, LONGEST_FD

RTR_BIT = 1 << 4  # of the flags at the end of a CANFD line
MONTHS = {name: number for number, names in enumerate(
    ("jan", "feb", "mar mär mrz", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov", "dec dez"), 1
) for name in names.split()}  # fmt: skip

DATE = re.compile(
    r"(?:\w+\.?\s+)?(?P<month>[^\W\d]{3})\w*\.?\s+(?P<day>\d{1,2})\s+(?P<hour>\d{1,2}):(?P<minute>\d\d):(?P<second>\d\d)"
    r"(?:[.,](?P<fraction>\d+))?\s*(?P<half>am|pm)?\s+(?P<year>\d{4})",
    re.IGNORECASE,
)
STAMP = re.compile(r"\d+\.\d+(?!\S)", re.ASCII)
CLASSIC_LINE = re.compile(
    r"\S+\s+(?P<bus>\d+)\s+(?P<id>\S+)\s+(?P<way>Rx|Tx)\s+(?P<kind>[dr])(?:\s+(?P<dlc>[0-9A-Fa-f]+)(?=\s|$))?(?P<rest>.*)",
    re.ASCII,
)
FD_LINE = re.compile(
    r"\S+\s+CANFD\s+(?P<bus>\d+)\s+(?P<way>Rx|Tx)\s+(?P<id>\S+)\s+(?:(?!\d\s)\S+\s+)?(?P<brs>[01])\s+(?P<esi>[01])\s+"
    r"(?P<dlc>[0-9A-Fa-f])\s+(?P<length>\d+)(?=\s|$)(?P<rest>.*)",
    re.ASCII,
)
OCTETS = re.compile(r"(?:\s+[0-9A-Fa-f]{2}(?!\S))*", re.ASCII)
LONGEST_NUMBER = 20  # digits; one that is longer is damaged, and Python takes long for it or refuses it
ERROR_LINE = re.compile(r"\S+\s+(?:\d+|CANFD\s+\d+\s+(?:Rx|Tx))\s+ErrorFrame\b", re.IGNORECASE)
FRAME_LINE = re.compile(r"\S+\s+(?:\d+\s+\S+\s+(?:Rx|Tx)\s|CANFD\s)", re.ASCII)
BODY = re.compile(
    r"\d{1,3}\s+[0-9A-Fa-f]{1,8}x?\s+(?:Rx|Tx)\s+[dr]\s|CANFD\s+\d+\s+(?:Rx|Tx)\s", re.ASCII
)  # of a frame
OTHER_LINE = re.compile(
    r"//|begin\s|end\s+trigger|(no\s+)?internal\s+events\s|date\s|base\s|\d+\.\d+\s+\S", re.IGNORECASE
)


@dataclass(frozen=True)
class Line:
    """One frame."""

    bus: int
    can_id: int
    flags: int
    data: bytes


def parse_date(text: str) -> datetime | None:
    """`Sam Sep 30 15:06:13.191 2017` or `Tue May 27 04:09:35 pm 2014`, English or German, without a zone."""
    match = DATE.match(text.strip())
    if match is None or (month := MONTHS.get(match["month"].lower())) is None:
        return None
    hour = int(match["hour"])
    if match["half"] and hour <= 12:
        hour = hour % 12 + (12 if match["half"].lower() == "pm" else 0)
    micro = int((match["fraction"] or "0")[:6].ljust(6, "0"))
    try:
        return datetime(
            int(match["year"]), month, int(match["day"]), hour, int(match["minute"]), int(match["second"]), micro
        )
    except ValueError:
        return None


def parse_line(line: str, base: int) -> Line | str | None:
    """The frame in `line`, or why it is none that can be read; None for another event, a comment or an empty line."""
    if ERROR_LINE.match(line):
        return ERROR_FRAME
    if FRAME_LINE.match(line) and STAMP.match(line):
        return _frame(line, base)
    if BODY.search(line) and not line.startswith("//"):
        return "has a damaged stamp"
    if not line or OTHER_LINE.match(line):
        return None
    return "is no line of an ASC log"


def _frame(line: str, base: int) -> Line | str:
    match = FD_LINE.match(line)
    fd = match is not None
    match = match or CLASSIC_LINE.match(line)
    if match is None:
        return "is a frame that is not complete"
    can_id = _number(match["id"].removesuffix("x"), base)
    if can_id is None or can_id > HIGHEST_ID:
        return f'has the identifier "{match["id"][:20]}", which is no number of 29 bits'
    bus = _number(match["bus"], 10)
    if bus is None or bus > HIGHEST_BUS:
        return "its channel is above 255"
    can_id |= int(EXTENDED) if match["id"].endswith("x") else 0
    flags = TRANSMIT if match["way"] == "Tx" else 0
    payload = _fd_payload(match, base) if fd else _classic_payload(match, base)
    if isinstance(payload, str):
        return payload
    return Line(bus, can_id, flags | payload[0], payload[1])


def _classic_payload(match: re.Match[str], base: int) -> tuple[int, bytes] | str:
    """Some writers put CAN FD frames on such lines too, with the code or the length, decimal or hexadecimal."""
    if match["kind"] == "r":
        return REMOTE, b""
    code = match["dlc"] or ""
    data = _octets(match["rest"], base)
    length = _number(code, base)
    if length is not None and length <= LONGEST_CLASSIC:
        return (0, data[:length]) if len(data) >= length else f"holds {len(data)} of its {length} bytes"
    meant = {meaning for radix in (10, 16) for meaning in _lengths(_number(code, radix))}
    if len(data) not in meant:
        return f'holds {len(data)} bytes, which does not fit its data length code "{code[:LONGEST_NUMBER]}"'
    return (FD if len(data) > LONGEST_CLASSIC else 0), data


def _lengths(code: int | None) -> tuple[int, ...]:
    """The lengths that `code` above 8 can stand for: of a classic frame, by the code of CAN FD, or as it is."""
    if code is None or code > LONGEST_FD:
        return ()
    return (LONGEST_CLASSIC, FD_LENGTHS[code]) if code < len(FD_LENGTHS) else (code,)


def _fd_payload(match: re.Match[str], base: int) -> tuple[int, bytes] | str:
    length = _number(match["length"], 10)
    if length is None or length > LONGEST_FD:
        return f"says it holds {match['length'][:LONGEST_NUMBER]} bytes, more than the {LONGEST_FD} of a frame"
    words = match["rest"].split()
    bits = _number(words[length + 2], 16) if len(words) > length + 2 else None
    data = _octets(match["rest"], base)[:length]
    if len(data) < length:
        return f"holds {len(data)} of its {length} bytes"
    return FD | (REMOTE if bits is not None and bits & RTR_BIT else 0), data


def _octets(text: str, base: int) -> bytes:
    """The bytes that `text` begins with: of two digits each where `base` is 16, decimal numbers where it is 10."""
    if base == 16:
        match = OCTETS.match(text)
        return bytes.fromhex(match[0]) if match else b""
    values = list(takewhile(lambda value: value is not None and value <= 0xFF, (_number(w, 10) for w in text.split())))
    return bytes(value for value in values if value is not None)


def _number(word: str, base: int) -> int | None:
    digits = "0123456789abcdef"[:base]
    return int(word, base) if 0 < len(word) <= LONGEST_NUMBER and not word.lower().strip(digits) else None
