"""A TDMS file opened up to its first damage.

nptdms reads it: https://nptdms.readthedocs.io (LGPL, installed separately). The format is described at
https://www.ni.com/en/support/documentation/supplemental/07/tdms-file-format-internal-structure.html

A file is a row of segments, each a lead-in of 28 bytes, what it says of its channels, and their values.
"""

from __future__ import annotations

import io
import logging
import struct
from bisect import bisect_right
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError, not_installed

TAG = b"TDSm"
LEAD_IN = 28  # bytes
BIG_ENDIAN = 1 << 6  # of the lead-in's flags
OPEN_END = 0xFFFF_FFFF_FFFF_FFFF  # where the recorder did not come to write how long its last segment is
EPOCH_1904_S = 2_082_844_800  # from TDMS' own epoch to 1970
SECOND_NS = 1_000_000_000
START = "wf_start_time"
JITTER_NS, DRIFT = 0.1 * SECOND_NS, 1e-4  # of the clock that says when a segment begins: beyond, a recorder paused
MOST_LOOKED_AT = 300  # segments of a file whose recorder paused
MOST_SCALINGS = 1000  # of a channel: files hold a few, and nptdms looks for each that one claims

DAMAGE = Exception  # nptdms raises whatever a damaged byte leads to, plain Exceptions among them

Ints = NDArray[np.int64]


@dataclass
class TdmsFile:
    """An open file, to be closed. `channels`: nptdms', in the order of the file; `ended`: how it ends early; `edges`:
    bytes where each segment begins, and where the last ends."""

    channels: list[Any]
    ended: str | None
    _file: IO[bytes]
    _path: Path
    edges: Sequence[int] = ()
    _known: dict[int, dict[str, tuple[int, int | None]]] = field(default_factory=dict)

    def where(self, channel: Any, number: int) -> str:
        """The segment in which value `number` (from 0) of a channel stands, and its number there: how its bytes lie in
        it nptdms does not tell."""
        edge = bisect_right(self.edges, number, 1, key=lambda end: self._held(channel, end))
        before = self._held(channel, self.edges[edge - 1])
        return f'byte {self.edges[edge - 1]:,}, value {number - before + 1:,} of "{channel.name}" in the segment there'

    def starts(self, channel: Any, step_ns: float) -> tuple[tuple[int, int], ...]:
        """(number of its first value, ns) of each stretch of a channel that begins at a time of its own, as a recorder
        that goes on in a file says it. One stretch where the times that segments say follow each other; none where
        there is no time. Raises UnreadableLogError where too many segments would have to be looked at."""
        last = stamp_ns(channel.properties.get(START))
        if last is None or len(self.edges) == 2:
            return () if last is None else ((0, last),)
        begin = bisect_right(self.edges, 0, 1, key=lambda end: self._held(channel, end))
        first = self._start(channel, self.edges[begin])
        before = self._held(channel, self.edges[-2])
        lag_ns = last - (last if first is None else first) - before * step_ns
        if first is None or last == first or abs(lag_ns) < max(step_ns, JITTER_NS + DRIFT * before * step_ns):
            return ((0, last if first is None else first),)
        if len(self.edges) > MOST_LOOKED_AT:
            raise UnreadableLogError(
                f'{self._path.name}: its {len(self.edges) - 1:,} segments say several times at which "{channel.name}" '
                "begins: too many to be read. Export each recording as a file of its own (DIAdem, LabVIEW)."
            )
        said = [(self._held(channel, a), self._start(channel, b)) for a, b in pairwise(self.edges[begin - 1 :])]
        news = [(number, ns) for (number, ns), (_, old) in zip(said, [(0, None), *said], strict=False) if ns != old]
        return tuple((number, ns) for number, ns in news if ns is not None)

    def _held(self, channel: Any, end: int) -> int:
        """How many values of a channel stand in the first `end` bytes."""
        return self._said(end).get(channel.path, (0, None))[0]

    def _start(self, channel: Any, end: int) -> int | None:
        """When the last waveform of a channel began in the first `end` bytes [ns UTC]."""
        return self._said(end).get(channel.path, (0, None))[1]

    def _said(self, end: int) -> dict[str, tuple[int, int | None]]:
        """Path of each channel -> its values in the first `end` bytes, and when the last waveform began."""
        if end not in self._known:
            found = _opened(_library(self._path.name), self._path, end) if end else None
            self._known[end] = {}
            if found is not None:
                with closing(found):
                    said = {one.path: (len(one), stamp_ns(one.properties.get(START))) for one in found.channels}
                self._known[end] = said
        return self._known[end]

    def close(self) -> None:
        self._file.close()


def open_tdms(path: Path) -> TdmsFile:
    """Open a file up to its first damage. Raises UnreadableLogError where nothing can be read, or nptdms is missing."""
    nptdms = _library(path.name)
    edges, ended = _segments(path)
    readable, damaged = 0, len(edges)  # segments that can be read, and that cannot
    while damaged - readable > 1:
        count = len(edges) - 1 if damaged == len(edges) else (readable + damaged) // 2
        found = _opened(nptdms, path, edges[count])
        if found is not None:
            found.close()
        readable, damaged = (readable, count) if found is None else (count, damaged)
    found = _opened(nptdms, path, edges[readable]) if readable else None
    if found is None:
        raise UnreadableLogError(
            f"{path.name}: is no whole TDMS file: its first segment cannot be read. Copy the file again."
        )
    found.edges = edges[: readable + 1]
    found.ended = ended if readable == len(edges) - 1 else f"is damaged at byte {edges[readable]:,}"
    return found


def _opened(nptdms: Any, path: Path, end: int) -> TdmsFile | None:
    """The first `end` bytes of a file as nptdms reads them; None where it cannot."""
    file = io.BufferedReader(_Head(path, end))
    try:
        whole = nptdms.TdmsFile.open(file, raw_timestamps=True)
        channels = [channel for group in whole.groups() for channel in group.channels() if len(channel)]
        scalings = [one.properties.get("NI_Number_Of_Scales", 0) for one in (whole, *whole.groups(), *channels)]
        believable = all(len(channel) <= end for channel in channels)  # each value takes a byte at least
        if believable and all(int(count) <= MOST_SCALINGS for count in scalings):
            return TdmsFile(channels, None, file, path)
    except DAMAGE:
        file.close()
        return None
    file.close()
    return None


def values(channel: Any, start: int, count: int) -> NDArray[Any] | None:
    """At most `count` values (N,) from `start` on: raw where no scaling can be used, None where they cannot be read."""
    with np.errstate(all="ignore"):
        try:
            return np.asarray(channel.read_data(start, count))
        except DAMAGE:
            return _raw(channel, start, count)


def is_scaled(channel: Any) -> bool:
    """Whether `values` are what its scaling says, if it has one."""
    with np.errstate(all="ignore"):
        try:
            channel.read_data(0, 1)
        except DAMAGE:
            return _raw(channel, 0, 1) is None
    return True


def _raw(channel: Any, start: int, count: int) -> NDArray[Any] | None:
    try:
        found = channel.read_data(start, count, scaled=False)
    except DAMAGE:
        return None
    return np.asarray(next(iter(found.values())) if isinstance(found, dict) else found)


def is_time(channel: Any) -> bool:
    """Whether its values are stamps."""
    return _kind(channel) == "TimeStamp"


def is_number(channel: Any) -> bool:
    """Whether its values are numbers, of which a double can hold the value."""
    return _kind(channel) not in ("TimeStamp", "String", "Void", "ComplexSingleFloat", "ComplexDoubleFloat", "NoneType")


def is_text(channel: Any) -> bool:
    return _kind(channel) == "String"


def stamps_ns(stamps: NDArray[Any]) -> Ints:
    """Nanoseconds UTC of stamps as they stand in the file, seconds since 1904 and fractions of 2^-64 s (N,)."""
    seconds = np.asarray(stamps["seconds"], np.int64) - EPOCH_1904_S
    fractions = np.asarray(stamps["second_fractions"], np.uint64) >> np.uint64(32)
    nanoseconds = (fractions * np.uint64(SECOND_NS)) >> np.uint64(32)
    held = np.clip(seconds, -SECOND_NS * 9, SECOND_NS * 9)  # what int64 holds in nanoseconds
    return np.asarray(held * SECOND_NS + nanoseconds.astype(np.int64), np.int64)


def stamp_ns(stamp: Any) -> int | None:
    """Nanoseconds UTC of a property; None where it is no stamp."""
    try:
        return (int(stamp.seconds) - EPOCH_1904_S) * SECOND_NS + (int(stamp.second_fractions) * SECOND_NS >> 64)
    except AttributeError:
        return None


def _kind(channel: Any) -> str:
    return channel.data_type.__name__ if channel.data_type is not None else "NoneType"


def _library(log: str) -> Any:
    try:
        import nptdms
        from nptdms.log import log_manager
    except ImportError:
        raise UnreadableLogError(f"{log}: {not_installed('the reader of TDMS files')}") from None
    log_manager.set_level(logging.CRITICAL)  # what it would warn of is said in `ended`
    return nptdms


def _segments(path: Path) -> tuple[list[int], str | None]:
    """(bytes where each segment begins, and where the last ends; how the file ends early), from lead-in to lead-in."""
    size = path.stat().st_size
    edges = [0]
    with path.open("rb") as file:
        while edges[-1] < size:
            file.seek(edges[-1])
            lead = file.read(LEAD_IN)
            if not lead.startswith(TAG):
                return edges, f"is damaged at byte {edges[-1]:,}"
            if len(lead) < LEAD_IN:
                return edges, f"ends at byte {size:,}, inside a segment"
            (flags,) = struct.unpack("<I", lead[4:8])
            (length,) = struct.unpack(">Q" if flags & BIG_ENDIAN else "<Q", lead[12:20])
            if length == OPEN_END:
                return [*edges, size], f"was not closed by its recorder and ends at byte {size:,}"
            edges.append(edges[-1] + LEAD_IN + length)
    whole = edges[-1] == size
    return [*edges[:-1], size], None if whole else f"ends at byte {size:,}, inside a segment"


class _Head(io.RawIOBase):
    """The first `end` bytes of a file."""

    def __init__(self, path: Path, end: int) -> None:
        self._file, self._end = path.open("rb"), end

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        if whence == io.SEEK_END:
            return self._file.seek(self._end + offset)
        return self._file.seek(offset, whence)

    def readinto(self, buffer: Any) -> int:
        data = self._file.read(max(0, min(len(buffer), self._end - self._file.tell())))
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()
