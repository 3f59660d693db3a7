"""Logs that something is wrong with: samples of every format changed at random, and files that unpack to far more than
any log."""

from __future__ import annotations

import gzip
import os
import random
import resource
import signal
import struct
import sys
import time
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib import import_module
from itertools import chain
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.attack.children import Verb, ended, started
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.formats import FORMATS, Format
from ingest.log.reading import Limits
from made import mf4
from made.damaged import PATIENCE_S, read_damaged, sample

EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**63 - 1, 2**64 - 1)
MOST_BYTES = 512 << 20  # of memory, beyond what the imports take
BATCH = 200  # inputs of a child
TRACED = 20  # every so many-th input is read with its lines counted


def mutated(data: bytes, other: bytes, chance: random.Random) -> bytes:
    """A log changed in one to three places."""
    for _ in range(chance.choice((1, 1, 2, 3))):
        at = chance.randrange(len(data) or 1)
        width = chance.choice((1, 2, 4, 8))
        number = (chance.choice(EXTREMES) & (1 << 8 * width) - 1).to_bytes(width, chance.choice(("little", "big")))
        end = min(len(data), at + chance.choice((1, 8, 64, 512)))
        data = chance.choice(
            (
                data[:at] + bytes([chance.randrange(256)]) + data[at + 1 :],
                data[: at // width * width] + number + data[at // width * width + width :],
                data[:at] + data[end:],
                data[:end] + data[at:],
                data[:at] + other[: chance.randrange(len(other))] + data[at:],
                data[:at],
                data[:at] + chance.choice((b"\n", b"0", b"-", b",", b"1e999", b"\xff\xfe", b"nan")) + data[at:],
            )
        )
    return data


def fuzz(arena: Arena) -> Outcome:
    """T11: the formats in turn, read in children that may have so much memory and time and no more."""
    outcome, shares = Outcome(), []
    every = [entry for entry in FORMATS if sample(entry).exists()]
    for entry in every:
        count, lines = -(-arena.tries // len(every)), arena.folder / f"{entry.name}.lines"
        for first in range(0, count, BATCH):
            _one_child(arena, entry, range(first, min(first + BATCH, count)), lines, outcome)
        shares.append(_share(entry, lines))
    outcome.note = (
        f"lines of the readers that were run, median {sorted(shares)[len(shares) // 2]:.0%}, least {min(shares):.0%}"
    )
    return outcome


def _one_child(arena: Arena, entry: Format, numbers: range, lines: Path, outcome: Outcome) -> None:
    """Inputs of one format read in a child; where one ends it, a new child goes on behind that."""
    left = numbers
    while left:
        at, said = arena.folder / "at.txt", arena.folder / "said.txt"
        code = ended(started(partial(_read_all, arena, entry, left, at, lines), said))
        done = range(left.start, left.stop if code == 0 else int(at.read_text()) + 1)
        outcome.tried += len(done)
        if code:
            how = "took too long" if code == -signal.SIGALRM else f"exit code {code}"
            last = said.read_text(errors="replace").strip().splitlines()[-1:] or [""]
            outcome.failed.append(f"{entry.name}, input {done[-1]}: {how} {last[0][:200]}")
        left = range(done.stop, left.stop)


def _read_all(arena: Arena, entry: Format, numbers: range, at: Path, lines: Path) -> None:
    import_module(entry.module)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MOST_BYTES, resource.RLIM_INFINITY))
    whole = sample(entry).read_bytes()
    path = arena.folder / sample(entry).name
    for number in numbers:
        at.write_text(str(number))
        chance = random.Random(f"{arena.seed} {entry.name} {number}")
        other = sample(chance.choice(FORMATS)).read_bytes() or b"\0"
        path.write_bytes(mutated(whole, other, chance) if number else whole)
        signal.setitimer(signal.ITIMER_REAL, 3 * PATIENCE_S)
        if number % TRACED:
            read_damaged(path)
        else:
            _with_lines(partial(read_damaged, path), lines)
    signal.setitimer(signal.ITIMER_REAL, 0)


def _with_lines(work: Callable[[], Any], lines: Path) -> None:
    """Do `work`, and note which lines of readers it ran."""
    seen: set[str] = set()

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        if "/ingest/formats/" not in frame.f_code.co_filename:
            return None
        seen.add(f"{Path(frame.f_code.co_filename).stem}:{frame.f_lineno}")
        return trace

    sys.settrace(trace)
    try:
        work()
    finally:
        sys.settrace(None)
        with lines.open("a") as file:
            file.write("".join(f"{one}\n" for one in seen))


def _share(entry: Format, lines: Path) -> float:
    """Share of the reader's lines in functions that were run."""
    module = import_module(entry.module)
    path = Path(str(module.__file__))
    there = {f"{path.stem}:{line}" for line in _lines_of(compile(path.read_text(), str(path), "exec"))}
    return len(there & set(lines.read_text().split())) / len(there)


def _lines_of(code: CodeType) -> Iterator[int]:
    """The lines of all functions in a module."""
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            own = {line for _, _, line in inner.co_lines() if line and line != inner.co_firstlineno}
            yield from chain(own if inner.co_name[0] != "<" and inner.co_flags & 1 else (), _lines_of(inner))


# ---- files that unpack to far more than any log ----------------------------------------------------------------------

ZEROS = 600 << 20


def _blf(path: Path) -> None:
    data = zlib.compress(bytes(100 << 20), 1)
    one = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(data), 10, 2, 100 << 20) + data + bytes(len(data) % 4)
    start = (2025, 3, 0, 4, 8, 0, 0, 0)
    head = struct.pack("<4sL8xQQLL8H8H", b"LOGG", 144, 0, 0, 1, 0, *start, *start)
    path.write_bytes(head + bytes(144 - len(head)) + one * 6)


def _gz(first: bytes, fill: bytes) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        with gzip.open(path, "wb", compresslevel=1) as file:
            file.write(first)
            for _ in range(ZEROS // len(fill)):
                file.write(fill)

    return write


def _zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file, file.open("log.csv", "w") as log:
        for _ in range(ZEROS >> 20):
            log.write(bytes(1 << 20))


def _xlsx(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        file.writestr("[Content_Types].xml", "<Types/>")
        with file.open("xl/worksheets/sheet1.xml", "w") as sheet:
            for _ in range(ZEROS >> 20):
                sheet.write(b" " * (1 << 20))


def _mf4(path: Path) -> None:
    file = mf4.Mf4()
    group = file.group((*mf4.PARTS, mf4.IN_RECORD), ZEROS // mf4.SIZE)
    file.save(path, file.data_group(group, file.packed(bytes(ZEROS))))


def _parquet(path: Path) -> None:
    part = pa.table({name: np.zeros(1 << 23) for name in ("time", "T")})
    with pq.ParquetWriter(path, part.schema, compression="zstd") as file:
        for _ in range(10 * ZEROS // part.nbytes):
            file.write_table(part)


def _feather(path: Path) -> None:
    part = pa.table({name: np.zeros(1 << 20) for name in ("time", "T")})
    with pa.ipc.new_file(path, part.schema, options=pa.ipc.IpcWriteOptions(compression="zstd")) as file:
        for _ in range(10 * ZEROS // part.nbytes):
            file.write_table(part)


def _text(text: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_text(text, encoding="utf-8")

    return write


BOMBS: Mapping[str, tuple[str, Callable[[Path], None]]] = {
    "arrays in a TOML": ("motor.toml", _text("a = " + "[" * 100_000)),
    "tables in a TOML": ("motor.toml", _text("[" + ".".join("a" * 50_000) + "]\n")),
    "a text in a TOML": ("motor.toml", _text('a = """' + "x" * (5 << 20))),
    "a long line of a TOML": ("motor.toml", _text("a = " + "'" * 3_000_000)),
    "containers of a BLF": ("bomb.blf", _blf),
    "rows of a CSV": ("bomb.csv.gz", _gz(b"time,T\n", b"1,2\n" * (1 << 18))),
    "one line of a CSV": ("bomb.csv.gz", _gz(b"time,T\n", b"1" * (1 << 20))),
    "one line of an ASC": ("bomb.asc.gz", _gz(b"base hex timestamps absolute\n", b" " * (1 << 20))),
    "a log in a ZIP": ("bomb.zip", _zip),
    "a sheet of an XLSX": ("bomb.xlsx", _xlsx),
    "a packed block of an MF4": ("bomb.mf4", _mf4),
    "columns of a Parquet file": ("bomb.parquet", _parquet),
    "columns of a Feather file": ("bomb.feather", _feather),
}
BOMB_BYTES = 1 << 30
STARTING_S = 30.0  # beyond what reading a log of its size may take


def bombs(arena: Arena) -> Outcome:
    """T20: `inspect` or `motor check` of each, in time, in memory, and with the limit named."""
    outcome, slowest, largest = Outcome(), 0.0, 0
    for name, (file, write) in list(BOMBS.items())[: arena.tries]:
        write(arena.folder / file)
        longest = Limits.of(arena.folder / file).seconds + STARTING_S
        words = ["motor", "check", file] if file.endswith(".toml") else ["inspect", file]
        began = time.monotonic()
        verb = Verb(words, arena.folder)
        _, status, usage = os.wait4(verb.start(), 0)
        code, said = os.waitstatus_to_exitcode(status), verb.said.read_text(errors="replace")
        seconds, peak = time.monotonic() - began, usage.ru_maxrss << 10
        slowest, largest = max(slowest, seconds), max(largest, peak)
        right = code in (1, 2) and "Traceback" not in said and seconds < longest and peak < BOMB_BYTES
        says = f"{name}: exit code {code}, {seconds:.0f} s, {peak / 1e6:.0f} MB: {said[-200:]}"
        outcome.count(*[says] * (not right))
        (arena.folder / file).unlink()
    outcome.note = (
        f"at most {slowest:.0f} s and {largest / 1e6:.0f} MB (in the program; its child that reads has limits)"
    )
    return outcome


ATTACKS = (
    Attack("T11", "logs changed at random", "read and accounted for, or one line; 5 s, 512 MB", 50_000, 320, fuzz),
    Attack("T20", "bombs", "stopped at a limit in time, in less than 1 GB", len(BOMBS), 4, bombs),
)
