"""Log formats. A new one is one file here and one row in `FORMATS`.

A reader turns a file into batches of records *as they stand in the file*: CAN frames (`Frames`) or table rows (`Rows`).
Nothing is decoded, converted or interpolated here. Every record of the file comes out exactly once: in a batch, or in
`Log.rejected` with the reason.
"""

from __future__ import annotations

import codecs
import json
import os
import re
import weakref
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from importlib import import_module
from itertools import islice
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, overload
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError
from ingest.texts.encodings import encoding_of

EXTENDED = np.uint32(1 << 31)  # set in `Frames.can_id` for 29-bit identifiers
REMOTE, FD, TRANSMIT = 2, 4, 8  # bits of `Frames.flags`
SERIES = "series"  # setting of a table with several: name -> columns, "" of those without a name
RASTERS = "rasters"  # setting of a table that was joined of several: the columns of each
GZIP = b"\x1f\x8b"
RATIO, ALWAYS = 200, 256 << 20  # a packed file may unpack to this many times its size, or to this many bytes
BATCH_ROWS = 100_000  # at most
SHOWN = 64  # first bytes, or characters, of what cannot be read
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
WALL_CLOCK = "the recorder's wall clock"  # setting "time" of a log whose date is one, without a zone
YEARS = (1971, 2200)  # of a log: in 1970 no clock was set, and int64 nanoseconds end in 2262


@dataclass(frozen=True)
class Frames:
    """N CAN frames in the order of the file. Shapes (N,) but for the payloads: `data[offsets[i]:offsets[i + 1]]`."""

    t_ns: NDArray[np.int64]  # UTC; from 0 where the file has no absolute time
    bus: NDArray[np.uint8]  # the channel number stored in the file; Vector's formats count from 1
    can_id: NDArray[np.uint32]  # bit 31: a 29-bit identifier
    flags: NDArray[np.uint8]
    offsets: NDArray[np.int64]  # (N + 1,)
    data: NDArray[np.uint8]
    record: NDArray[np.int64]  # position among the file's frames, from 0

    def taken(self, at: NDArray[np.intp]) -> Frames:
        """The frames at these positions."""
        offsets, data = payloads(self.data, self.offsets[:-1][at], np.diff(self.offsets)[at])
        names = ("t_ns", "bus", "can_id", "flags", "record")
        return Frames(**{name: getattr(self, name)[at] for name in names}, offsets=offsets, data=data)


def rows_at_once(columns: int) -> int:
    """How many rows of so many columns a batch has: 4 million values at most, and 100,000 rows."""
    return max(1, min(BATCH_ROWS, 4_000_000 // max(1, columns)))


def payloads(
    data: NDArray[np.uint8], source: NDArray[np.int64], length: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """`Frames.offsets` and `Frames.data` of payloads that begin at `source` (N,) in `data`, of `length` (N,) bytes."""
    offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(length)])
    if len(length) and length[0] > 0 and (length == length[0]).all():  # most often 8: taken as words, not as bytes
        words = np.ndarray((len(data) - int(length[0]) + 1,), f"V{length[0]}", data, strides=(1,))
        return offsets, words[source].view(np.uint8)
    return offsets, data[np.repeat(source - offsets[:-1], length) + np.arange(offsets[-1])]


@dataclass(frozen=True)
class Rows:
    """N rows of a table, all (N,)."""

    t_ns: NDArray[np.int64]  # as in `Frames`
    columns: Mapping[str, NDArray[Any]]  # name -> float64 (NaN = empty cell), or str objects of a text column
    record: NDArray[np.int64]  # position among the file's data rows, from 0
    series: str | None = None  # whose stamps are its own, of a table with several


@dataclass(frozen=True)
class Rejected:
    """A record that could not be read. `where`: "line 12" or "byte 316,402"; `raw`: its first bytes."""

    record: int
    where: str
    why: str
    raw: bytes = b""


class Rejections(Sequence[Rejected]):
    """Records that could not be read, in the order in which they came; the last HELD in memory, others in a file."""

    HELD = 10_000

    def __init__(self) -> None:
        self._count = 0
        self._last: list[Rejected] = []
        self._file: IO[str] | None = None

    def append(self, entry: Rejected) -> None:
        """Add one. Raises OSError where the disk is full."""
        if len(self._last) == self.HELD:
            if self._file is None:
                self._file = TemporaryFile("w+")  # noqa: SIM115 -- closed when nobody has these records any more
                weakref.finalize(self, self._file.close)
            self._file.seek(0, os.SEEK_END)
            self._file.writelines(json.dumps(vars(one) | {"raw": one.raw.hex()}) + "\n" for one in self._last)
            self._last.clear()
        self._last.append(entry)
        self._count += 1

    def extend(self, entries: Iterable[Rejected]) -> None:
        """Add several."""
        for entry in entries:
            self.append(entry)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Rejected]:
        if self._file is not None:
            self._file.seek(0)
            for line in self._file:
                one = json.loads(line)
                yield Rejected(**one | {"raw": bytes.fromhex(one["raw"])})
        yield from self._last

    @overload
    def __getitem__(self, which: int) -> Rejected: ...
    @overload
    def __getitem__(self, which: slice) -> list[Rejected]: ...
    def __getitem__(self, which: int | slice) -> Rejected | list[Rejected]:
        if isinstance(which, slice):
            return [*islice(self, *which.indices(self._count))]
        if which == -1:
            return self._last[-1]
        return next(islice(self, range(self._count)[which], None))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)


@dataclass(frozen=True)
class TimeSpec:
    """How a log's own stamps are to be understood, as `[time]` of a bench file says it, checked there."""

    column: str | None = None  # with `format` or `unit`; or else `rate_hz`
    format: str | None = None  # strptime
    unit: str | None = None  # "s", "ms" ... counted from the start
    zone: str = "UTC"  # IANA zone of local stamps
    rate_hz: float | None = None
    start_ns: int | None = None  # ns UTC that a relative time counts from
    untimed: bool = False  # rows may have no time at all, as in a table with a row a check
    skip_rows: int = 0  # lines of a text file above the header of its table
    sheet: str | None = None  # of a workbook

    @property
    def local(self) -> ZoneInfo:
        """The zone of local stamps."""
        return ZoneInfo(self.zone)

    def wall_ns(self, stamp: datetime) -> int | None:
        """Nanoseconds UTC of the wall clock `stamp` of a file; None for a year that no log is from.

        A zone that explains the column of a table says nothing of files with a date of their own: they are UTC then.
        """
        zone = self.local if self.column is None else UTC
        return utc_ns(stamp.replace(tzinfo=zone)) if YEARS[0] <= stamp.year <= YEARS[1] else None


def most_unpacked(size: int) -> int:
    """Bytes that a packed file of `size` bytes may unpack to, in all: what holds more is no log."""
    return max(ALWAYS, RATIO * size)


def utc_ns(stamp: datetime) -> int:
    """Nanoseconds since 1970 of a stamp with a zone."""
    return (stamp - EPOCH) // timedelta(microseconds=1) * 1000


EARLIEST_NS, LATE_NS = (utc_ns(EPOCH.replace(year=year)) for year in YEARS)  # a log is from the first on


@dataclass
class Log(ABC):
    """An opened log. The counters are final once `batches()` is exhausted."""

    path: Path
    time: TimeSpec
    absolute: bool = False  # stamps are UTC, not counted from an unknown start
    units: dict[str, str] = field(default_factory=dict)  # column -> unit text, where the file says it
    settings: dict[str, Any] = field(default_factory=dict)  # what was recognised: delimiter, decimal, encoding ...
    found: int = 0  # records in the file, counted apart from what became of them
    rejected: Rejections = field(default_factory=Rejections)
    cut: str | None = None  # the file ends before its end: one clause, where, how much is missing, and what to do
    sought: Sequence[int] = ()  # records whose place in the file is asked for
    places: dict[int, str] = field(default_factory=dict)  # of these, as `Rejected.where`, where the format can tell

    @abstractmethod
    def batches(self) -> Iterator[Frames] | Iterator[Rows]:
        """Every readable record, in file order, about 100,000 at once. Raises UnreadableLogError where none is."""

    def note_places(self, record: NDArray[np.int64], where: Callable[[int], str | None]) -> None:
        """Keep the places of those of these records that are sought; `where` of the i-th record, if that is told."""
        for i in np.flatnonzero(np.isin(record, self.sought)).tolist() if self.sought else ():
            if (place := where(i)) is not None:
                self.places[int(record[i])] = place

    def mark_cut(self, how: str, kept: str) -> None:
        """Say in `cut` how the file ends before its end ("ends at byte 316,402") and what was read ("12 frames")."""
        self.cut = f"{how}: {kept} were read and kept; copy the file again if the original is whole."

    def end_rows(self, ended: str | None, why_none: str) -> None:
        """Mark a table as cut where it `ended` early. Raises UnreadableLogError where no row of it could be read."""
        if len(self.rejected) == self.found:
            raise UnreadableLogError(
                f"{self.path.name}: no row of it can be read: {why_none}. Look at the file, or export it again."
            )
        if ended is not None:
            self.mark_cut(ended, f"{self.found - len(self.rejected):,} rows")


@dataclass(frozen=True)
class Format:
    """A row of the table: `module` holds a subclass of `Log` named `reader`."""

    name: str
    holds: str  # "frames" or "rows"
    suffixes: tuple[str, ...]  # usual ones, lower case, with the dot; they tell texts apart that look like no other
    magic: bytes  # the file begins so; b"" where it has no mark
    module: str
    looks: bytes = b""  # a regular expression that is found in the first bytes of such a file
    claims: bool = False  # several formats have its mark: `module.claims(path)` says whether a file is of this one


CANDUMP = (  # as it is written, and as it is shown
    rb"(?m)^ ?\((?:\d{4}-\d\d-\d\d \d\d:\d\d:\d\d|\d+)\.\d+\)\s+\S+\s+"
    rb"(?:[RT]X \S \S +)?[0-9A-Fa-f]{3,8}(?:#| +\[\d+\] )"
)
OBJECTS = rb'\A\s*\{\s*"[^\n]*\}\s*\n\s*\{\s*"'  # a line each
FRAME_WAY = rb"\s[RT]x\s"  # received or sent: on each line of a log of frames that is known by its name alone
FORMATS: tuple[Format, ...] = (
    Format("blf", "frames", (".blf",), b"LOGG", "ingest.formats.blf"),
    Format("asc", "frames", (".asc", ".asc.gz"), b"", "ingest.formats.asc", rb"(?im)^base\s+(hex|dec)\s+timestamps"),
    Format("trc", "frames", (".trc",), b"", "ingest.formats.trc", rb"(?m)^;\$FILEVERSION=|^;-+\+-.*\n *\d+\) +\d"),
    Format("candump", "frames", (), b"", "ingest.formats.candump", CANDUMP),
    Format("gvret", "frames", (), b"", "ingest.formats.gvret", rb"(?im)^time stamp,id,extended,"),
    Format("can_csv", "frames", (), b"", "ingest.formats.can_csv", rb"(?m)^timestamp,arbitration_id,extended,remote"),
    Format("css_csv", "frames", (), b"", "ingest.formats.css_csv", rb"\ATimestampEpoch.BusChannel.ID.IDE.DLC"),
    Format("busmaster", "frames", (), b"", "ingest.formats.busmaster", rb"\A\s*-?\*{3}BUSMASTER Ver"),
    Format("twincat", "rows", (), b"", "ingest.formats.twincat", rb'\AName.*\n(?:File.*\n)?"?Starttime of export'),
    Format("mf4", "frames", (".mf4",), b"MDF     4", "ingest.formats.mf4", rb"\AUnFinMF 4", claims=True),
    Format("mdf", "rows", (".mf4", ".mdf"), b"MDF     ", "ingest.formats.mdf", rb"\AUnFinMF "),
    Format("can_db", "frames", (".db",), b"SQLite format 3\0", "ingest.formats.can_db"),
    Format("tdms", "rows", (".tdms",), b"TDSm", "ingest.formats.tdms"),
    Format("mat", "rows", (".mat",), b"MATLAB 5.0 MAT", "ingest.formats.mat"),
    Format("parquet", "rows", (".parquet",), b"PAR1", "ingest.formats.parquet"),
    Format("arrow", "rows", (".arrow", ".feather"), b"ARROW1", "ingest.formats.arrow", rb"\A\xff{4}..\0\0\x10\0\0\0"),
    Format("mcap", "rows", (".mcap",), b"\x89MCAP0\r\n", "ingest.formats.mcap"),
    Format("atfx", "rows", (".atfx",), b"", "ingest.formats.atfx", rb"<atfx_file[\s>]"),
    Format("lvm", "rows", (".lvm",), b"LabVIEW Measurement", "ingest.formats.lvm"),
    Format("jsonl", "rows", (".jsonl", ".ndjson"), b"", "ingest.formats.jsonl", OBJECTS),
    Format("xlsx", "rows", (".xlsx", ".xlsm"), b"PK\x03\x04", "ingest.formats.xlsx"),
    Format("csv", "rows", (".csv", ".csv.gz", ".txt", ".tsv", ".log"), b"", "ingest.formats.csv"),
)
ANY_TEXT = FORMATS[-1]  # what a text is taken for that looks like no other
HEAD = 4096  # bytes that tell what a file is
LONGEST_FIRST = 64 << 20  # bytes of a first line, below which is looked
SECTOR = bytes(512)  # zeros, as a disk gives them back where nothing was written, or what was is lost
CONTROLS = bytes({*range(32)} - set(b"\t\n\r\f"))  # which a text does not hold
ENDS = dict.fromkeys(suffix for entry in FORMATS for suffix in entry.suffixes)  # of names, each once
SUFFIXES = " ".join(ENDS)  # as help and refusals list them


def recognise(path: Path) -> Format:
    """The format of `path`, by what it holds; the end of its name only tells texts apart that look like no other.

    Raises UnreadableLogError for an empty file and for one that no format claims.
    """
    head = head_of(path)
    if not head:
        how = "when it is unpacked" if path.stat().st_size else "(0 bytes)"
        raise UnreadableLogError(f"{path.name}: is empty {how}: nothing to read. Copy the file again.")
    no_logs = import_module("ingest.formats._no_logs")
    if other := no_logs.no_log(head):
        raise UnreadableLogError(f"{path.name}: is {other}.")
    for entry in FORMATS:
        if entry.magic and head.startswith(entry.magic) and _claimed(entry, path):
            return entry
    if other := no_logs.locked(path):
        raise UnreadableLogError(f"{path.name}: is {other}.")
    seen = head if b"\n" in head or not is_text(head) else head + b"\n" + _below_first_line(path)
    for entry in FORMATS:
        if entry.looks and re.search(entry.looks, seen) and _claimed(entry, path):
            return entry
    if is_text(head):
        texts = (entry for entry in FORMATS if not entry.magic and path.name.lower().endswith(entry.suffixes))
        entry = next(texts, ANY_TEXT)
        return ANY_TEXT if entry.holds == "frames" and not re.search(FRAME_WAY, head) and not no_table(path) else entry
    if not head.strip(b"\0"):
        raise UnreadableLogError(
            f"{path.name}: begins with {len(head):,} bytes of 0: what stood there is lost. Copy the file again."
        )
    todo = no_logs.by_name(path) or "Export it as one of these"
    raise UnreadableLogError(f"{path.name}: is none of the known log formats ({SUFFIXES}). {todo}.")


def _claimed(entry: Format, path: Path) -> bool:
    return not entry.claims or bool(import_module(entry.module).claims(path))


def is_text(head: bytes) -> bool:
    """Whether the first bytes of a file are those of a text: at most one in a hundred is none, lost sectors apart."""
    sectors = (head[at : at + len(SECTOR)] for at in range(0, len(head), len(SECTOR)))
    kept = b"".join(sector for sector in sectors if sector != SECTOR).strip(b"\0")
    return 100 * len(kept.translate(None, delete=CONTROLS)) >= 99 * len(kept) > 0


def head_of(path: Path) -> bytes:
    """The first bytes of a file; of a packed text those of the text, in UTF-8."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head.startswith(GZIP):
        with suppress(zlib.error):
            head = zlib.decompressobj(wbits=31).decompress(head, HEAD)
    head = head.removeprefix(codecs.BOM_UTF8)
    if encoding := encoding_of(head):
        head = head.decode(encoding, errors="replace").encode(errors="replace")
    return head


def _below_first_line(path: Path) -> bytes:
    """The first bytes below a first line that is longer than HEAD, as damage makes one."""
    with path.open("rb") as file:
        file.readline(LONGEST_FIRST)
        return file.read(HEAD)


def no_table(path: Path) -> str | None:
    """Why a text that looks like no other format does not begin as a table does; None where it does."""
    why: str | None = import_module(ANY_TEXT.module).no_table(path)
    return why


def open_log(path: Path, time: TimeSpec | None = None) -> Log:
    """Open `path` with the reader of its format. Raises UnreadableLogError as `recognise`."""
    log: Log = import_module(recognise(path).module).reader(path, time or TimeSpec())
    return log
