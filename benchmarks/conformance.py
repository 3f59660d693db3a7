"""Every log and signal database in a folder, read by us and by another reader, compared to the last value.

    python benchmarks/conformance.py [DIR] [--quick] [--json FILE]

Frames are compared in identifier, kind, payload and time (to a microsecond, but for an offset of the whole log) with
python-can's; columns of tables value by value with npTDMS, pyarrow and asammdf; messages of MCAP in number with
the mcap library; databases by random payloads with cantools. npTDMS, pyarrow, mcap and cantools also lie under our own
readers: there the comparison is of what we make of what they give. Without DIR, and with --quick, a few files are made
first. `equal` is what both say; `differ` what we say and they do not; `only theirs` what they say and we do not, as
records that we reject; `alone` files that they refuse, or for which they are not installed.
"""

from __future__ import annotations

import math
import random
import re
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import can
import cantools
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from mcap.reader import NonSeekingReader

from benchmarks import asked
from ingest.errors import DatabaseError, UnreadableLogError
from ingest.formats import ANY_TEXT, EXTENDED, FD, REMOTE, Frames, Log, no_table, open_log, recognise
from ingest.log.database_files import read_database
from ingest.log.databases import Message, load
from ingest.log.frames import FrameBatch
from made.databases import MULTIPLEXED_DBC, as_arxml, as_kcd, as_sym
from made.frames import messages, write
from made.places import LOGS

US = 1000  # ns
LATE_US = 1.6  # by which times may differ: python-can keeps seconds as floats, and files keep microseconds
DATABASES = (".dbc", ".kcd", ".sym", ".arxml")
PAYLOADS = 40  # random ones a message
AHEAD = 200  # how far what one says is sought in what the other says
SHOWN = 3  # reasons a format
FAILURE = Exception  # of another's reader, whatever it trips over
Said = list[tuple[Any, ...]]  # what a reader says of a file, in its order


@dataclass
class Row:
    """One format; `reasons`: why we refuse (and others do), `first`: what differs, the first of each file."""

    format: str
    files: int = 0
    compared: int = 0
    equal: int = 0
    differ: int = 0
    only_theirs: int = 0
    rejected: int = 0
    refused: int = 0
    alone: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    reasons_of_others: Counter[str] = field(default_factory=Counter)
    first: list[str] = field(default_factory=list)


# ---- frames --------------------------------------------------------------------------------------------------------


READERS: Mapping[str, Callable[[Path], Any]] = {
    "asc": lambda path: can.ASCReader(path, relative_timestamp=True),
    "blf": can.BLFReader,
    "trc": can.TRCReader,
    "candump": can.CanutilsLogReader,
    "can_csv": can.CSVReader,
    "can_db": can.SqliteReader,
    "mf4": can.MF4Reader,
}


def our_frames(path: Path, log: Log) -> Said:
    """(time [us], identifier, kind, payload) of each frame, the time from anywhere."""
    found: Said = []
    for batch in log.batches():
        assert isinstance(batch, Frames)
        ends = zip(batch.offsets[:-1].tolist(), batch.offsets[1:].tolist(), strict=True)
        payloads = [batch.data[a:b].tobytes() for a, b in ends]
        kinds = (batch.flags & (FD | REMOTE)).tolist()
        found += zip((batch.t_ns / US).tolist(), batch.can_id.tolist(), kinds, payloads, strict=True)
    return found


def their_frames(path: Path, log: Log) -> Said:
    """The same, as python-can reads them."""
    found: Said = []
    for one in READERS[recognise(path).name](path):
        if not one.is_error_frame:
            can_id = one.arbitration_id | int(EXTENDED) * one.is_extended_id
            payload = b"" if one.is_remote_frame else bytes(one.data)
            found.append((one.timestamp * 1e9 / US, can_id, FD * one.is_fd | REMOTE * one.is_remote_frame, payload))
    return found


def same_origin(ours: Said, theirs: Said) -> Said:
    """Our frames with the time of theirs: logs are read from their date, or from their start. The offset is what most
    frames say that come as often in each."""
    our_times, their_times = _times(ours), _times(theirs)
    offsets: Counter[int] = Counter()
    for frame, times in our_times.items():
        told = their_times.get(frame, [])
        if len(told) == len(times):
            offsets.update(round(b - a) for a, b in zip(times, told, strict=True))
    offset = offsets.most_common(1)[0][0] if offsets else 0
    return [(t + offset, *rest) for t, *rest in ours]


def _times(frames: Said) -> dict[tuple[Any, ...], list[float]]:
    found: dict[tuple[Any, ...], list[float]] = {}
    for t, *rest in frames:
        found.setdefault(tuple(rest), []).append(t)
    return found


# ---- tables --------------------------------------------------------------------------------------------------------


def our_values(path: Path, log: Log) -> Said:
    """(column, value) of each number; texts are left to the tests."""
    found: dict[str, list[float]] = {}
    for batch in log.batches():
        assert not isinstance(batch, Frames)
        for name, cells in batch.columns.items():
            if cells.dtype != object:
                found.setdefault(name, []).extend(cells[np.isfinite(cells)].tolist())
    return [(name, value) for name in sorted(found) for value in found[name]]


def their_values(path: Path, log: Log) -> Said:
    """The same of the columns that we have, as another library reads them."""
    named: dict[str, list[list[float]]] = {}
    for names, cells in TABLES[recognise(path).name](path):
        numbers = np.asarray(cells)
        if numbers.dtype.kind in "iufb" and numbers.ndim == 1:
            for name in names:
                named.setdefault(name, []).append(numbers[np.isfinite(numbers)].astype(float).tolist())
    ours = {name for name, _ in our_values(path, open_log(path))}
    return [(name, value) for name in sorted(ours) for value in named.get(name, [[]])[0]]


Columns = Iterator[tuple[Sequence[str], Any]]  # (names under which we may have it, values) of each column


def _tdms(path: Path) -> Columns:
    import nptdms

    for group in nptdms.TdmsFile.read(path).groups():
        yield from (((channel.name, f"{group.name}/{channel.name}"), channel[:]) for channel in group.channels())


def _mdf(path: Path) -> Columns:
    import asammdf

    with asammdf.MDF(path) as mdf:
        for at, group in enumerate(mdf.groups):
            for place, channel in enumerate(group.channels):
                signal = mdf.get(group=at, index=place, ignore_invalidation_bits=False)
                yield (channel.name, f"{group.channel_group.acq_name}/{channel.name}"), signal.samples


def _arrow(path: Path, whole: Callable[[Path], pa.Table]) -> Columns:
    table = whole(path)
    for name in table.column_names:
        cells = table[name].to_pylist()
        yield (name,), [float(one) if isinstance(one, int | float) else math.nan for one in cells]


TABLES: Mapping[str, Callable[[Path], Columns]] = {
    "tdms": _tdms,
    "mdf": _mdf,
    "parquet": partial(_arrow, whole=pq.read_table),
    "arrow": partial(_arrow, whole=lambda path: pa.ipc.open_file(path).read_all()),
}


# ---- messages of MCAP ----------------------------------------------------------------------------------------------


def our_messages(path: Path, log: Log) -> Said:
    """(topic, number) of each message: of those with numbers, those that we reject, and those that we leave out."""
    with suppress(UnreadableLogError):  # of a file that is refused, what it holds is counted all the same
        list(log.batches())
    left = [re.fullmatch(r"(.*) \(([\d,]+) messages\)", one) for one in log.settings.get("left_out", ())]
    counts = log.settings["groups"] | {one[1]: int(one[2].replace(",", "")) for one in left if one}
    return [(topic, i) for topic in sorted(counts) for i in range(counts[topic])]


def their_messages(path: Path, log: Log) -> Said:
    """The same, as the mcap library reads them."""
    with path.open("rb") as file:
        reader = NonSeekingReader(file)
        counts = Counter(channel.topic for _, channel, _ in reader.iter_messages(log_time_order=False))
    return [(topic, i) for topic in sorted(counts) for i in range(counts[topic])]


# ---- one log -------------------------------------------------------------------------------------------------------


def compare_log(path: Path, row: Row) -> None:
    """Read a log in both ways and count."""
    form = row.format
    holds_frames = recognise(path).holds == "frames"
    ours_of, theirs_of = (our_frames, their_frames) if holds_frames else (our_values, their_values)
    if form == "mcap":
        ours_of, theirs_of = our_messages, their_messages
    log = open_log(path)
    try:
        ours = ours_of(path, log)
        if form == "mcap":
            list(open_log(path).batches())
    except UnreadableLogError as error:
        row.refused += 1
        row.reasons[_plain(str(error).removeprefix(f"{path.name}: "))] += 1
        if form != "mcap":
            return
    row.rejected += len(log.rejected)
    try:
        theirs = theirs_of(path, log)
    except FAILURE as error:
        row.alone += 1
        row.reasons_of_others[f"{type(error).__name__}: {_plain(str(error))}"] += 1
        return
    count(row, path, same_origin(ours, theirs) if form in READERS else ours, theirs)


def count(row: Row, path: Path, ours: Said, theirs: Said) -> None:
    """Count what both say in the same order, and what one of them says alone."""
    i, j, before = 0, 0, (row.differ, row.only_theirs)
    where = ""
    while i < len(ours) and j < len(theirs):
        if _same(ours[i], theirs[j]):
            row.equal, i, j = row.equal + 1, i + 1, j + 1
            continue
        where = where or f"at {i}: {ours[i]}, theirs {theirs[j]}"
        skipped = next((k for k in range(1, AHEAD) if j + k < len(theirs) and _same(ours[i], theirs[j + k])), 0)
        row.only_theirs, j = row.only_theirs + skipped, j + skipped
        if not skipped:
            row.differ, i = row.differ + 1, i + 1
    row.differ += len(ours) - i
    row.only_theirs += len(theirs) - j
    row.compared += len(ours)
    if before != (row.differ, row.only_theirs):
        more, less = row.differ - before[0], row.only_theirs - before[1]
        row.first.append(f"{path.name}: {more:,} differ, {less:,} only theirs; {where or 'at the end'}")


def _same(ours: tuple[Any, ...], theirs: tuple[Any, ...]) -> bool:
    if len(ours) == 4:  # a frame
        return abs(ours[0] - theirs[0]) < LATE_US and ours[1:] == theirs[1:]
    return ours == theirs


def _plain(says: str) -> str:
    """A refusal without the numbers in it."""
    return re.sub(r"\d[\d,]*", "N", says.partition(". ")[0])[:140]


# ---- one database --------------------------------------------------------------------------------------------------


def compare_database(path: Path, row: Row) -> None:
    """Decode random payloads of each message by our model and by cantools."""
    data, chance = path.read_bytes(), random.Random(1)
    try:
        known, told = load(data, path.name).messages, read_database(data, path.name, []).messages
    except DatabaseError as error:
        row.refused += 1
        row.reasons[_plain(re.sub(r"^[^ ]+: ", "", str(error)))] += 1
        return
    for message in told:
        ours = known.get(message.frame_id | int(EXTENDED) * message.is_extended_frame)
        if ours is not None and ours.name == message.name and message.length and not message.is_container:
            _count_values(path, row, ours, message, [chance.randbytes(message.length) for _ in range(PAYLOADS)])


def _count_values(path: Path, row: Row, ours: Message, message: Any, payloads: Sequence[bytes]) -> None:
    size, length = len(payloads), message.length
    arrays = np.ones(size, np.uint8), np.full(size, ours.can_id, np.uint32), np.zeros(size, np.uint8)
    data = np.frombuffer(b"".join(payloads), np.uint8)
    batch = FrameBatch(Frames(np.arange(size), *arrays, np.arange(size + 1) * length, data, np.arange(size)))
    said: tuple[Said, Said] = ([], [])
    found = batch.signals(ours, np.arange(size))
    none = batch.not_available + batch.errors  # which cantools has no word for
    for i, payload in enumerate(payloads):
        with suppress(cantools.database.DecodeError):  # of a page that the message does not have
            told = message.decode(payload, decode_choices=False, allow_truncated=True)
            names = [name for name in found if f"{ours.name}.{name}" not in none]
            said[0].extend((name, _number(found[name][i])) for name in names)
            said[1].extend((name, _number(told.get(name))) for name in names)
    count(row, path, *said)


def _number(value: Any) -> float | None:
    """A value to 15 digits; None for one that is not there or not finite."""
    return float(f"{value:.15g}") if value is not None and math.isfinite(value) else None


# ---- all of them ---------------------------------------------------------------------------------------------------


def made(folder: Path) -> Path:
    """A few files: those of the tests, and of python-can's and cantools' writers."""
    for entry in LOGS.iterdir():
        (folder / entry.name).write_bytes(entry.read_bytes())
    some = messages(2000, fd=False)
    for name in ("one.asc", "one.blf", "one.log", "one.csv"):
        write(can.Logger(folder / name), some)
    texts = {".dbc": MULTIPLEXED_DBC, ".kcd": as_kcd(), ".sym": as_sym(), ".arxml": as_arxml()}
    for suffix, text in texts.items():
        (folder / f"motor{suffix}").write_text(text, encoding="utf-8")
    return folder


def rows_of(folder: Path) -> list[Row]:
    """All files in a folder and in those below it."""
    found: dict[str, Row] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        is_database = path.suffix.lower() in DATABASES
        try:
            form = path.suffix.lower()[1:].upper() if is_database else recognise(path).name
            if form == ANY_TEXT.name and no_table(path) is not None:
                raise UnreadableLogError("is a text without a table")
        except UnreadableLogError as error:
            row = found.setdefault("no log", Row("no log"))
            row.files, row.refused = row.files + 1, row.refused + 1
            row.reasons[_plain(str(error).removeprefix(f"{path.name}: "))] += 1
            continue
        row = found.setdefault(form, Row(form))
        row.files += 1
        (compare_database if is_database else compare_log)(path, row)
    return [found[name] for name in sorted(found)]


def table(rows: Sequence[Row]) -> str:
    """A line a format, and below it what is refused and what differs."""
    names = ("files", "compared", "equal", "differ", "only theirs", "rejected", "refused", "alone")
    lines = [f"{'format':<10}" + "".join(f"{name:>13}" for name in names)]
    for row in rows:
        lines.append(f"{row.format:<10}" + "".join(f"{getattr(row, name.replace(' ', '_')):>13,}" for name in names))
    for row in rows:
        lines += [f"{row.format}: refused, {n:,} of them: {why}" for why, n in row.reasons.most_common(SHOWN)]
        lines += [f"{row.format}: alone, {n:,} of them: {why}" for why, n in row.reasons_of_others.most_common(SHOWN)]
        lines += [f"{row.format}: {one}"[:300] for one in row.first[:SHOWN]]
    return "\n".join(lines)


def main() -> None:
    """Compare and print."""
    line = asked.parser(__doc__)
    line.add_argument("folder", nargs="?", metavar="DIR", type=Path, help="logs and databases; else a few are made")
    args = line.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        rows = rows_of(args.folder or made(Path(folder)))
    print(table(rows))
    asked.keep([vars(row) for row in rows], args.json)


if __name__ == "__main__":
    main()
