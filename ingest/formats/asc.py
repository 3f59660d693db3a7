"""ASC: Vector's text format for CAN logs, packed with gzip or not.

The date is a wall clock time without a zone: UTC unless `[time] zone` (without a column) says otherwise, or `[time]
start` replaces it. The date of the first trigger block beats that of the header; a later block counts from its own date
only where its stamps begin again, or are far before it. `timestamps relative`: each stamp counts from the line before.
Error frames are found and rejected, remote frames have no payload. Statistics, bus states, requests to send (TxRq) and
other events are no frames: they are counted in `settings["other_lines"]`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ingest.formats import EXTENDED, SHOWN, TRANSMIT, Frames, Log, Rejected, payloads
from ingest.formats._asc_lines import STAMP, Line, parse_date, parse_line
from ingest.formats._frame_lines import HIGHEST_BUS, HIGHEST_ID, cut_line, end_frames
from ingest.formats._text import TextFile, place_of

# A data frame as most lines hold it (hexadecimal, one blank between two bytes), or else any line: one match a line.
LINES = re.compile(
    rb"^[ \t]*(\d+\.\d+)[ \t]+(\d{1,3})[ \t]+([0-9A-Fa-f]{1,8})(x?)[ \t]+(Rx|Tx)[ \t]+d[ \t]+([0-8])"
    rb"((?:[ \t][0-9A-Fa-f]{2})*)(?:[ \t].*|\r?)$|^.*$",
    re.MULTILINE,
)
BLOCK_BEGINS = re.compile(rb"[Bb]egin[ \t]+[Tt]rigger[Bb]lock")
BLOCK_ENDS = re.compile(r"end\s+triggerblock", re.IGNORECASE)
HEADER_LINE = re.compile(r"(date|base|//|$|(?:no\s+)?internal\s+events)", re.IGNORECASE)
BASE_LINE = re.compile(r"base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?", re.IGNORECASE)
LONGEST_S = 1e9  # of a stamp; one that is longer is damaged
LONGEST_BEFORE_NS = 600 * 10**9  # that a trigger keeps of before: stamps that are further before its date begin anew
LONGEST_STEP_S = 1e7  # from one line to the next, where stamps are relative: a damaged one would move all that follow


@dataclass
class _Clock:
    """From the stamps of the lines to nanoseconds UTC."""

    stated_ns: int | None  # [time] start
    relative: bool = False
    origin_ns: int = 0
    last_ns: int | None = None  # counted from the origin
    date_ns: int | None = None  # a date that was read, until the next stamp says whether time begins there
    first_date_ns: int | None = None
    block_date_ns: int | None = None  # that the stamps count from now

    def place(self, stamps: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """(t_ns, late) of the stamps (N,) [s] of consecutive lines; NaN where a line has none. Late: beyond any log."""
        seconds = np.nan_to_num(stamps)
        late = seconds > (LONGEST_STEP_S if self.relative else LONGEST_S)
        if self.relative:
            late |= np.cumsum(np.where(late, 0.0, seconds)) > LONGEST_S
        ticks = np.rint(np.where(late, 0.0, seconds) * 1e9).astype(np.int64)
        timed = np.flatnonzero(~np.isnan(stamps) & ~late)
        if len(timed):
            self._begin(int(ticks[timed[0]]))
            if self.relative:
                ticks = (self.last_ns or 0) + np.cumsum(ticks)
            self.last_ns = int(ticks[timed[-1]])
        return self.origin_ns + ticks, late

    def _begin(self, first_ns: int) -> None:
        """Let the date that was read last count from `first_ns` on, where the stamps begin anew there."""
        if self.date_ns is None:
            return
        late = self.block_date_ns is not None and self.date_ns - self.block_date_ns - first_ns > LONGEST_BEFORE_NS
        if self.last_ns is None or self.relative or first_ns < self.last_ns or late:
            if self.first_date_ns is None:
                self.first_date_ns = self.date_ns
            self.origin_ns, self.last_ns, self.block_date_ns = self.date_ns, None, self.date_ns
            if self.stated_ns is not None:
                self.origin_ns = self.stated_ns + self.date_ns - self.first_date_ns
        self.date_ns = None


@dataclass
class AscLog(Log):
    """An ASC file, read from front to back in bounded memory."""

    _clock: _Clock = field(init=False)
    _base: int = 16
    _lines: int = 0  # that were read
    _other: int = 0
    _inside: bool = False  # of a trigger block

    def batches(self) -> Iterator[Frames]:
        """Frames in file order. Raises UnreadableLogError where the file holds no frame at all."""
        stated = self.time.start_ns
        self._clock = _Clock(stated, origin_ns=stated or 0)
        self.absolute = stated is not None
        text = TextFile(self.path)
        for number, block in enumerate(text.blocks()):
            header = self._read_header(block) if number == 0 else 0
            begins = _block_begins(block, header)
            for first, last in zip([header, *begins], [*begins, len(block)], strict=True):
                if first < last:
                    yield from self._segment(block[first:last])
            if number == 0 and self.found and self.found == len(self.rejected) and not self._other:
                break  # not one line of an ASC log
        self._finish(text)

    def _read_header(self, block: bytes) -> int:
        """The length of the header in bytes."""
        self.settings.update(base="hex", stamps="absolute")
        length = 0
        for raw in block.splitlines(keepends=True):
            line = _text_of(raw)
            if not HEADER_LINE.match(line):
                break
            length, self._lines = length + len(raw), self._lines + 1
            if line.lower().startswith("date"):
                self._take_date(line[len("date") :])
            if match := BASE_LINE.match(line):
                self.settings.update(base=match[1].lower(), stamps=(match[2] or "absolute").lower())
        self._base = 16 if self.settings["base"] == "hex" else 10
        self._clock.relative = self.settings["stamps"] == "relative"
        return length

    def _take_date(self, text: str) -> None:
        stamp = parse_date(text)
        date_ns = self.time.wall_ns(stamp) if stamp else None
        if date_ns is None:
            self.settings["date_not_understood"] = text.strip()[:SHOWN]
            return
        self.absolute, self._clock.date_ns = True, date_ns

    def _segment(self, text: bytes) -> Iterator[Frames]:
        """The frames of some lines, of which only the first may begin a trigger block."""
        if match := BLOCK_BEGINS.match(text):
            self._inside = True
            self._take_date(_text_of(text[match.end() :].split(b"\n", 1)[0]))
        lines = text.split(b"\n")
        table = _Table(len(lines))
        if self._base == 16:
            table.fill(LINES.findall(text))
        for index in np.flatnonzero(np.isnan(table.stamp)).tolist():
            line = _text_of(lines[index])
            table.set(index, line, parse_line(line, self._base))
            self._inside = self._inside and not BLOCK_ENDS.match(line)
        if not lines[-1]:
            lines.pop()
        yield from self._placed(table, lines)
        self._lines += len(lines)

    def _placed(self, table: _Table, lines: list[bytes]) -> Iterator[Frames]:
        """The frames among `lines` with numbers and times; what is rejected is noted."""
        t_ns, late = self._clock.place(table.stamp)
        for index in np.flatnonzero(late & table.frame).tolist():
            table.set(index, "", "has a stamp that no log can reach")
        found = table.frame.copy()
        found[list(table.why)] = True
        record = self.found + np.cumsum(found) - 1
        for index, why in sorted(table.why.items()):
            where = f"line {self._lines + index + 1:,}"
            self.rejected.append(Rejected(int(record[index]), where, why, lines[index][:SHOWN]))
        frame = np.flatnonzero(table.frame)
        self.found += int(found.sum())
        self._other += sum(map(bool, lines)) - int(found.sum())
        self.note_places(record[frame], lambda i: place_of(self.path, self._lines + int(frame[i]) + 1))
        if len(frame):
            yield table.frames(frame, t_ns[frame], record[frame])

    def _finish(self, text: TextFile) -> None:
        self.settings.update(other_lines=self._other, gz=text.packed)
        says = text.ended
        if says is None and self._inside:
            says = f"ends in line {self._lines:,}, before the end of its trigger block"
        says = says or cut_line(text, self.rejected, self._lines)
        end_frames(self, says, f" ({self._lines:,} lines read)", "or export it as an ASC log of CAN frames")


class _Table:
    """What the lines of a text hold: arrays (N,) over the lines, `why` for those that are rejected."""

    def __init__(self, count: int) -> None:
        self.stamp = np.full(count, np.nan)  # s
        self.frame = np.zeros(count, bool)
        self.bus = np.zeros(count, np.uint8)
        self.can_id = np.zeros(count, np.uint32)
        self.flags = np.zeros(count, np.uint8)
        self.source = np.zeros(count, np.int64)  # where the payload begins in `data`
        self.length = np.zeros(count, np.int64)
        self.data = bytearray()
        self.why: dict[int, str] = {}

    def fill(self, matches: list[tuple[bytes, ...]]) -> None:
        """Take the lines that LINES recognised and that are whole; the others keep no stamp."""
        stamps, buses, ids, marks, ways, codes, payloads = (np.array(group) for group in zip(*matches, strict=True))
        at = np.flatnonzero(stamps != b"")
        if not len(at):
            return
        length = np.char.str_len(payloads[at]) // 3
        bus = buses[at].astype(np.int64)
        can_id = np.array([int(text, 16) for text in ids[at].tolist()], np.uint32)
        whole = (length == codes[at].astype(np.int64)) & (bus <= HIGHEST_BUS) & (can_id <= HIGHEST_ID)
        at, bus, can_id, length = at[whole], bus[whole], can_id[whole], length[whole]
        self.stamp[at] = stamps[at].astype(np.float64)
        self.frame[at], self.bus[at] = True, bus
        self.can_id[at] = can_id | EXTENDED * (marks[at] == b"x")
        self.flags[at] = TRANSMIT * (ways[at] == b"Tx")
        self.source[at], self.length[at] = np.cumsum(length) - length, length
        self.data += bytes.fromhex(b"".join(payloads[at].tolist()).decode())

    def set(self, index: int, line: str, parsed: Line | str | None) -> None:
        """Take one line that was read by itself."""
        self.frame[index] = isinstance(parsed, Line)
        if match := STAMP.match(line):
            self.stamp[index] = float(match[0])
        if isinstance(parsed, str):
            self.why[index] = parsed
        elif parsed is not None:
            self.bus[index], self.can_id[index], self.flags[index] = parsed.bus, parsed.can_id, parsed.flags
            self.source[index], self.length[index] = len(self.data), len(parsed.data)
            self.data += parsed.data

    def frames(self, at: NDArray[np.int64], t_ns: NDArray[np.int64], record: NDArray[np.int64]) -> Frames:
        """The frames of the lines `at`."""
        offsets, data = payloads(np.frombuffer(bytes(self.data), np.uint8), self.source[at], self.length[at])
        return Frames(t_ns, self.bus[at], self.can_id[at], self.flags[at], offsets, data, record)


def _block_begins(block: bytes, first: int) -> list[int]:
    """Where lines begin, from byte `first`, that begin a trigger block."""
    if b"rigger" not in block:  # much the faster look, and most blocks hold none
        return []
    found = (match.start() for match in BLOCK_BEGINS.finditer(block, first))
    return [at for at in found if not block[block.rfind(b"\n", 0, at) + 1 : at].strip()]


def _text_of(line: bytes) -> str:
    """A line as text. Only dates hold letters beyond ASCII (Mär), in UTF-8 or in the code page of the machine."""
    try:
        return line.decode().strip()
    except UnicodeDecodeError:
        return line.decode("cp1252", errors="replace").strip()


reader = AscLog
