"""Text logs that hold a frame a line: read line by line, told apart, counted and put into arrays in one way for all."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.formats import EARLIEST_NS, EXTENDED, LATE_NS, SHOWN, Frames, Log, Rejected
from ingest.formats._text import TextFile, place_of

LONGEST_CLASSIC, LONGEST_FD, HIGHEST_BUS = 8, 64, 255
HIGHEST_STANDARD, HIGHEST_ID = 0x7FF, 0x1FFF_FFFF
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # bytes, by data length code (ISO 11898-1)
ERROR_FRAME = "error frame"
ONLY_BUS = 1  # of a log that does not say on which bus its frames were
OCTETS = re.compile(r"(?:[0-9A-Fa-f]{2}(?: |$))*")
SECOND_DIGITS = 9  # of a second in nanoseconds


Ints = NDArray[np.int64]


class OneFrame(NamedTuple):
    """One frame as its line says it."""

    t_ns: int  # since 1970, or since the start of the log
    bus: int
    can_id: int  # bit 31: a 29-bit identifier
    flags: int
    data: bytes


def nanoseconds(decimal: str, digits: int = SECOND_DIGITS) -> int:
    """`1.5` s, or `1e-05` s, in whole nanoseconds; of a unit of 1e-3 s where `digits` is 6, and so on."""
    if "e" in decimal:
        decimal = f"{Decimal(decimal):f}"
    whole, _, fraction = decimal.partition(".")
    return int(whole + fraction[:digits].ljust(digits, "0"))


def frame_of(t_ns: int, bus: int, can_id: int | str, flags: int, data: bytes | str) -> OneFrame | str:
    """A frame, or why it is none, as its identifier or its data say."""
    if isinstance(can_id, str):
        return can_id
    return data if isinstance(data, str) else OneFrame(t_ns, bus, can_id, flags, data)


def identifier(number: int, extended: bool) -> int | str:
    """A `OneFrame.can_id`, or why `number` is none."""
    if number > (HIGHEST_ID if extended else HIGHEST_STANDARD):
        return f'has the identifier "{number:X}", which is no number of {29 if extended else 11} bits'
    return number | int(EXTENDED) if extended else number


def counted(data: bytes, length: int) -> bytes | str:
    """The `length` bytes of a frame that begin `data`, or why they are not there."""
    return data[:length] if len(data) >= length else f"holds {len(data)} of its {length} bytes"


def whole(data: bytes, length: int) -> bytes | str:
    """The data of a frame that says it holds `length` bytes, or why they are none."""
    if len(data) != length:
        return f"holds {len(data)} of its {length} bytes"
    return data if length <= LONGEST_FD else f"says it holds {length} bytes, more than the {LONGEST_FD} of a frame"


def octets(text: str) -> bytes:
    """The bytes that `text` begins with, of two hexadecimal digits each with a blank between."""
    match = OCTETS.match(text)
    return bytes.fromhex(match[0]) if match else b""


@dataclass
class FrameLines(Log):
    """A text of frames, read from front to back in bounded memory."""

    called: ClassVar[str]  # "a candump log"
    dated: ClassVar[bool] = True  # stamps are UTC where they are of a year that logs are from, else since a start
    tells_length: ClassVar[bool] = True  # a line says how many bytes its frame holds: one that is cut shows

    _start_ns: int | None = None  # that stamps without a date count from
    _lines: int = 0  # that were read
    _other: int = 0
    _errors: int = 0  # error frames

    @abstractmethod
    def parse(self, line: str) -> OneFrame | str | None:
        """The frame in a line that is not blank, or why it cannot be read; None for a line that is no record."""

    def batches(self) -> Iterator[Frames]:
        """Frames in file order. Raises UnreadableLogError where the file holds no frame at all."""
        self._start_ns = self.time.start_ns
        text = TextFile(self.path)
        for block in text.blocks():
            yield from self._batch(block, cut=text.open_line and not self.tells_length)
            frames = self.found - len(self.rejected)
            if self._lines > 1 and not frames + self._errors:  # an overlong line may come before the first frame
                break
        self._finish(text)

    def _batch(self, block: bytes, *, cut: bool) -> Iterator[Frames]:
        """The frames of some lines, the last of which may be `cut`."""
        lines = block.decode("latin-1").split("\n")  # any byte is a letter, so that a rejected line is shown as it is
        if not lines[-1]:
            lines.pop()
        frames: list[OneFrame] = []
        record: list[int] = []
        for number, raw in enumerate(lines, 1):
            line = raw.strip()
            parsed = self._record(line, cut=cut and number == len(lines)) if line else None
            if isinstance(parsed, OneFrame):
                frames.append(parsed)
                record.append(self.found)
                if self.found in self.sought:
                    self.places[self.found] = place_of(self.path, self._lines + number)
            elif parsed is not None:
                where = f"line {self._lines + number:,}"
                self.rejected.append(Rejected(self.found, where, parsed, raw.encode("latin-1")[:SHOWN]))
                self._errors += parsed == ERROR_FRAME
            self.found += parsed is not None
            self._other += parsed is None and bool(line)
        self._lines += len(lines)
        if frames:
            yield as_arrays(frames, record)

    def _record(self, line: str, *, cut: bool) -> OneFrame | str | None:
        """As `parse`, with its time."""
        frame = self.parse(line)
        if not isinstance(frame, OneFrame):
            return frame
        if cut:
            return "has no end"
        if frame.bus > HIGHEST_BUS:
            return "its channel is above 255"
        if self.dated and EARLIEST_NS <= frame.t_ns < LATE_NS:
            self.absolute = True
        elif self._start_ns:
            frame = frame._replace(t_ns=self._start_ns + frame.t_ns)
        return frame if frame.t_ns < LATE_NS else "has a stamp that no log can reach"

    def _finish(self, text: TextFile) -> None:
        self.absolute |= self._start_ns is not None
        self.settings.update(other_lines=self._other, gz=text.packed)
        says = text.ended or cut_line(text, self.rejected, self._lines)
        end_frames(self, says, f" ({self._lines:,} lines read)", f"or export it as {self.called}")


def end_frames(log: Log, ended: str | None, read: str, todo: str) -> None:
    """Mark a log of frames as cut where it `ended` early. Raises UnreadableLogError where it holds no frame at all:
    with what was `read` of it, and what there is `todo` but to copy it again."""
    frames = log.found - len(log.rejected)
    if not frames and all(one.why != ERROR_FRAME for one in log.rejected):
        says = f"{ended}: " if ended else ""
        raise UnreadableLogError(f"{log.path.name}: {says}no CAN frame is in it{read}. Copy the file again, {todo}.")
    if ended:
        log.mark_cut(ended, f"{frames:,} frames")


def cut_line(text: TextFile, rejected: Sequence[Rejected], lines: int) -> str | None:
    """How a text of so many lines says that it ends inside the last one, which is no record; None where it does not."""
    where = f"line {lines:,}"
    return f"ends inside {where}" if text.open_line and rejected and rejected[-1].where == where else None


def as_arrays(frames: list[OneFrame], record: list[int]) -> Frames:
    """One or more frames (N,) as arrays."""
    t_ns, bus, can_id, flags, data = zip(*frames, strict=True)
    offsets = np.zeros(len(frames) + 1, np.int64)
    np.cumsum([len(one) for one in data], out=offsets[1:])
    return Frames(
        np.array(t_ns, np.int64),
        np.array(bus, np.uint8),
        np.array(can_id, np.uint32),
        np.array(flags, np.uint8),
        offsets,
        np.frombuffer(b"".join(data), np.uint8),
        np.array(record, np.int64),
    )
