"""BLF: Vector's binary logging format. A header, then objects, most of them in containers packed with zlib.

The start of the file is a wall clock time without a zone: UTC unless `[time]` names a zone and no column, or `[time]
start` replaces it; without either, time counts from 0. Error frames are found and rejected; remote frames have the flag
REMOTE and no payload; objects that are no frames are counted by type in `settings["other_objects"]`. Nothing that the
file declares is believed before it is checked.
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from typing import IO

from ingest.errors import UnreadableLogError
from ingest.formats import Frames, Log, most_unpacked
from ingest.formats._blf_containers import parts
from ingest.formats._blf_objects import MARGIN, OURS, Objects, is_one, read_frames, split

HEADER = struct.Struct("<4sL8xQQLL8H8H")  # magic, header size, .., file size, unpacked size, objects, .., start, stop
BATCH = 4 << 20  # unpacked bytes that are read at once: about 90,000 classic frames
SHOWN_PROBLEMS = 3


@dataclass
class _Stream:
    """Unpacked bytes that are not read yet, `size` in all. `wanted`: how many hold a whole object; `aligned`: they
    begin with one."""

    pieces: list[bytes] = field(default_factory=list)
    size: int = 0
    wanted: int = 0
    aligned: bool = True
    begins: list[tuple[int, int]] = field(default_factory=list)  # (byte, byte of the file) of pieces, both ascending

    def add(self, at: int, piece: bytes) -> None:
        self.begins.append((self.size, at))
        self.pieces.append(piece)
        self.size += len(piece)

    def data(self) -> bytes:
        """All of it, with MARGIN spare bytes."""
        return b"".join([*self.pieces, bytes(MARGIN)])

    def keep(self, data: bytes, objects: Objects) -> None:
        """Drop what was read of `data`."""
        last = max(0, bisect_right(self.begins, (objects.rest, 1 << 63)) - 1)
        self.begins = [(byte - objects.rest, at) for byte, at in self.begins[last:]]
        self.pieces = [data[objects.rest : self.size]]
        self.size -= objects.rest
        self.wanted, self.aligned = objects.wanted, objects.aligned

    def lose(self) -> None:
        """Begin anew: the bytes that come next do not continue those that were there."""
        self.pieces.clear()
        self.begins.clear()
        self.size, self.wanted, self.aligned = 0, 0, False

    def where(self, byte: int) -> str:
        first, at = self.begins[max(0, bisect_right(self.begins, (byte, 1 << 63)) - 1)]
        return f"byte {at:,}, unpacked {byte - first:+,}"


@dataclass
class BlfLog(Log):
    """A BLF file, read from front to back in bounded memory."""

    _start_ns: int = 0
    _objects: int = 0  # that the header declares
    _declared_size: int = 0
    _problems: list[str] = field(default_factory=list)
    _other: Counter[int] = field(default_factory=Counter)

    def batches(self) -> Iterator[Frames]:
        """Frames in file order. Raises UnreadableLogError where the file holds no frame at all."""
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            first = self._read_header(file, size)
            stream = _Stream()
            left = most = most_unpacked(size)
            for part in parts(file, first, size):
                left -= len(part.data)
                if left < 0:
                    self._problems.append(f"unpacks to more than {most:,} bytes, from byte {part.at:,} on")
                    break
                for piece in range(0, len(part.data), BATCH):
                    stream.add(part.at, part.data[piece : piece + BATCH])
                    if stream.size >= max(BATCH, stream.wanted):
                        yield from self._batch(stream)
                if part.problem:
                    self._problems.append(part.problem)
                    yield from self._batch(stream)
                    stream.lose()
            yield from self._batch(stream)
        self._finish(size, bool(stream.data().strip(b"\0")))

    def _read_header(self, file: IO[bytes], size: int) -> int:
        """The first byte behind the header of the file."""
        head = file.read(HEADER.size)
        if len(head) < HEADER.size or not head.startswith(b"LOGG"):
            raise UnreadableLogError(
                f"{self.path.name}: is no BLF file, or ends inside its header ({size:,} bytes): nothing in it can be "
                "read. Copy the file again."
            )
        _, length, self._declared_size, _, self._objects, _, *stamps = HEADER.unpack(head)
        stated = self.time.start_ns
        recorded = self._system_time(stamps[:8])
        self.absolute = stated is not None or recorded is not None
        self._start_ns = next((ns for ns in (stated, recorded) if ns is not None), 0)
        self.settings["start"] = "bench file" if stated is not None else "file header" if self.absolute else "none"
        return length if HEADER.size <= length <= size else HEADER.size

    def _system_time(self, fields: list[int]) -> int | None:
        """Windows SYSTEMTIME: year, month, day of week, day, hour, minute, second, millisecond."""
        year, month, _, day, hour, minute, second, milli = fields
        try:
            stamp = datetime(year, month, day, hour, minute, second, milli * 1000)
        except ValueError:
            return None
        return self.time.wall_ns(stamp)

    def _batch(self, stream: _Stream) -> Iterator[Frames]:
        data = stream.data()
        objects = split(data, aligned=stream.aligned)
        frames, rejected = read_frames(data, objects, self._start_ns, self.found, stream.where, self.note_places)
        self.found += len(frames.record) + len(rejected)
        self.rejected.extend(rejected)
        self._other.update(objects.head["type"][~is_one(objects.head["type"], OURS)].tolist())
        stream.keep(data, objects)
        if len(frames.record):
            yield frames

    def _finish(self, size: int, unread: bool) -> None:
        self.settings["other_objects"] = {str(kind): count for kind, count in sorted(self._other.items())}
        if not self._problems and (size < self._declared_size or unread):
            self._problems.append(f"ends {'inside an object ' if unread else ''}at byte {size:,}")
        if self._problems and size < self._declared_size:
            self._problems[-1] += f" of {self._declared_size:,}"
        says = "; ".join(self._problems[:SHOWN_PROBLEMS])
        if not self.found:
            todo = "Copy the file again" if says else "Its recorder logged no CAN channel: switch one on"
            raise UnreadableLogError(
                f"{self.path.name}: {says or 'is whole'}: no CAN frame is in it ({self._other.total():,} other "
                f"objects). {todo}."
            )
        if self._problems:
            more = len(self._problems) - SHOWN_PROBLEMS
            kept, about = self.found - len(self.rejected), self._objects - self._other.total()
            of = f" of about {about:,}" if about > kept else ""
            self.mark_cut(says + (f"; and at {more:,} more places" if more > 0 else ""), f"{kept:,}{of} frames")


reader = BlfLog
