"""Log formats. A new one is one file here and one row in `FORMATS`.

A reader turns a file into batches of records *as they stand in the file*: CAN frames (`Frames`) or table rows (`Rows`).
Nothing is decoded, converted or interpolated here. Every record of the file comes out exactly once: in a batch, or in
`Log.rejected` with the reason.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from ingest.errors import UnreadableLogError

EXTENDED = np.uint32(1 << 31)  # set in `Frames.can_id` for 29-bit identifiers
ERROR, REMOTE, FD, TRANSMIT = 1, 2, 4, 8  # bits of `Frames.flags`


@dataclass(frozen=True)
class Frames:
    """N CAN frames in the order of the file.

    `t_ns` int64 [ns, UTC; from 0 where the file has no absolute time]; `bus` uint8, the channel number stored in the
    file; `can_id` uint32 (bit 31 = 29-bit identifier); `flags` uint8; payload of frame i is
    `data[offsets[i]:offsets[i + 1]]` (uint8; int64 offsets, N + 1); `record` int64, position among the file's frames
    from 0. Shapes (N,) otherwise.
    """

    t_ns: NDArray[np.int64]
    bus: NDArray[np.uint8]
    can_id: NDArray[np.uint32]
    flags: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    data: NDArray[np.uint8]
    record: NDArray[np.int64]


@dataclass(frozen=True)
class Rows:
    """N rows of a table. `columns`: name -> float64 (N,) (NaN = empty cell) or object (N,) of str for text columns.

    `t_ns` int64 [ns] as in `Frames`; `record` int64, position among the file's data rows from 0.
    """

    t_ns: NDArray[np.int64]
    columns: Mapping[str, NDArray[Any]]
    record: NDArray[np.int64]


@dataclass(frozen=True)
class Rejected:
    """A record that could not be read. `where`: "line 12" or "byte 316,402"; `raw`: its first bytes."""

    record: int
    where: str
    why: str
    raw: bytes = b""


@dataclass(frozen=True)
class TimeSpec:
    """How a log's own stamps are to be understood (`[time]` of a bench file).

    `column` with `format` (strptime) or `unit` ("s", "ms", ... counted from start), or `rate_hz` [1/s]; `zone` is the
    IANA zone of local stamps; `start` an ISO 8601 UTC stamp that a relative time counts from. `untimed`: rows may
    have no time at all, as in a table with a row a check.
    """

    column: str | None = None
    format: str | None = None
    unit: str | None = None
    zone: str = "UTC"
    rate_hz: float | None = None
    start: str | None = None
    untimed: bool = False

    @property
    def local(self) -> ZoneInfo:
        """The zone of local stamps."""
        return ZoneInfo(self.zone)


@dataclass
class Log(ABC):
    """An opened log. The counters are final once `batches()` is exhausted."""

    path: Path
    time: TimeSpec
    absolute: bool = False  # stamps are UTC, not counted from an unknown start
    units: dict[str, str] = field(default_factory=dict)  # column -> unit text, where the file says it
    settings: dict[str, Any] = field(default_factory=dict)  # what was recognised: delimiter, decimal, encoding ...
    found: int = 0  # records in the file, counted apart from what became of them
    rejected: list[Rejected] = field(default_factory=list)
    cut: str | None = None  # the file ends before its end: one clause, where, how much is missing, and what to do

    @abstractmethod
    def batches(self) -> Iterator[Frames] | Iterator[Rows]:
        """Every readable record, in file order, in batches of bounded size (about 100,000 records).

        Raises UnreadableLogError where nothing can be read.
        """

    def mark_cut(self, how: str, kept: str) -> None:
        """Say in `cut` how the file ends before its end ("ends at byte 316,402") and what was read ("12 frames")."""
        self.cut = f"{how}: {kept} were read and kept; copy the file again if the original is whole."


@dataclass(frozen=True)
class Format:
    """A row of the table: `module` holds a subclass of `Log` named `reader`."""

    name: str
    holds: str  # "frames" or "rows"
    suffixes: tuple[str, ...]  # lower case, with the dot; matched on the whole end of the name (".csv.gz")
    magic: bytes  # the file begins so; b"" where it has no mark
    module: str


FORMATS: tuple[Format, ...] = (
    Format("blf", "frames", (".blf",), b"LOGG", "ingest.formats.blf"),
    Format("asc", "frames", (".asc", ".asc.gz"), b"", "ingest.formats.asc"),
    Format("tdms", "rows", (".tdms",), b"TDSm", "ingest.formats.tdms"),
    Format("csv", "rows", (".csv", ".csv.gz", ".txt", ".tsv"), b"", "ingest.formats.csv"),
)
SUFFIXES = " ".join(suffix for entry in FORMATS for suffix in entry.suffixes)  # as help and refusals list them


def recognise(path: Path) -> Format:
    """The format of `path`, by its first bytes where the format marks them, else by the end of its name.

    Raises UnreadableLogError for an empty file and for one that no format claims.
    """
    with path.open("rb") as file:
        head = file.read(16)
    if not head:
        raise UnreadableLogError(f"{path.name}: is empty (0 bytes): nothing to read. Copy the file again.")
    for entry in FORMATS:
        if entry.magic and head.startswith(entry.magic):
            return entry
    for entry in FORMATS:
        if path.name.lower().endswith(entry.suffixes) and not entry.magic:
            return entry
    raise UnreadableLogError(f"{path.name}: is none of the known log formats ({SUFFIXES}). Export it as one of these.")


def open_log(path: Path, time: TimeSpec | None = None) -> Log:
    """Open `path` with the reader of its format.

    Raises UnreadableLogError as `recognise`, and for a zone that is not in the IANA data base.
    """
    spec = time or TimeSpec()
    try:
        ZoneInfo(spec.zone)
    except (OSError, ValueError, KeyError):
        raise UnreadableLogError(
            f'{path.name}: zone = "{spec.zone}" under [time] of the bench file is no IANA time zone. '
            "Write it as Europe/Rome."
        ) from None
    log: Log = import_module(recognise(path).module).reader(path, spec)
    return log
