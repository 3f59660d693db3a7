"""How much memory `ingest` and `show` of a long log take, next to the bound that the program keeps.

    python benchmarks/memory.py [--quick] [--json FILE] [--mb N] [--formats FORMAT,FORMAT]

One message at 4,000 frames a second, as a log of each format: `blf`, `asc`, `log` (candump's), `db` (python-can's) and
`frames.mf4`, or as a table with a row a frame: `csv`, `lvm`, `mf4`, `groups.mf4` (each signal a group with its times),
`unsorted.mf4` (their records one among the other), `mdf` (version 3), `tdms` and `xlsx` (a full sheet with as many
columns as it takes). It has as many megabytes as `--mb` says (2000 for 2 GB), and a bench file for its four signals.
Each verb is a command of its own. Of it is printed what all its processes held at once at most (`all`: what they share
is counted in each), and the largest of them (`largest`), as the system counts it: Linux only. What is held is looked at
50 times a second. The exit code is 1 where one is above the bound.
"""

from __future__ import annotations

import os
import resource
import sqlite3
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from functools import partial
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # the files here have the names of packages
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from made import mdf, mdf3, mf4
from made.blf import write_blf

BOUND_MIB = 1024
MOST_ROWS = 1_048_575  # of a sheet, without its header
MIB = 1 << 20
PROBE = 20_000  # frames that tell how many a megabyte holds
EVERY_S = 0.02
CODE = "import sys; from replay.cli import main; sys.exit(main())"
STEP_US = 250
TABLES = ("csv", "lvm", "mf4", "groups.mf4", "unsorted.mf4", "mdf", "tdms", "xlsx")
LINES = {  # of a frame: when, and its eight bytes in hexadecimal
    "asc": b"%d.%06d 1 100 Rx d 8 %s\n",
    "log": b"(%d.%06d) can0 100#%s\n",
    "csv": b"%d.%06d,%s\n",
    "lvm": b"%d.%06d\t%s\n",
}
BETWEEN = {"csv": b",", "lvm": b"\t"}  # cells
HEADS = {
    "asc": b"date Tue Mar 4 08:00:00.000 2025\nbase hex timestamps absolute\nno internal events logged\n",
    "log": b"",
    "csv": b"time,w0,w1,w2,w3\n",
    "lvm": b"LabVIEW Measurement\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\nChannels\t4\n"
    b"***End_of_Header***\nX_Value\tw0\tw1\tw2\tw3\tComment\n",
}
DATABASE = 'VERSION ""\nBU_: BENCH\nBO_ 256 Words: 8 BENCH\n' + "".join(
    f' SG_ w{k} : {16 * k}|16@1+ (0.1,-40) [0|0] "degC" BENCH\n' for k in range(4)
)
CHANNEL = '[[channel]]\nsignal = "%sw%d"\nquantity = "temperature"\nunit = "degC"\n'


def main() -> None:
    """Print the table."""
    line = asked.parser(__doc__, mb=(200, 2))
    line.add_argument("--formats", default="blf", help="which, with commas between; %(default)s")
    chosen = line.parse_args()
    found = [_one(form, chosen.mb * 1_000_000) for form in chosen.formats.split(",")]
    asked.keep({"bound_MiB": BOUND_MIB, "logs": found}, chosen.json)
    sys.exit(1 if any(verb["all_MiB"] > BOUND_MIB for one in found for verb in one["verbs"]) else 0)


def _one(form: str, size: int) -> dict[str, Any]:
    """A log of one format and about so many bytes, ingested and shown."""
    with tempfile.TemporaryDirectory(prefix="memory") as place:
        folder = Path(place)
        with ProcessPoolExecutor(1) as apart:  # the system counts what this process held as its children's
            frames = apart.submit(write_setup, folder, form, size).result()
        size = (folder / f"log.{form}").stat().st_size
        print(f"log.{form}: {size / 1e6:,.0f} MB, {frames:,} frames; bound {BOUND_MIB:,} MiB")
        print(f"{'':8} {'all MiB':>8} {'largest MiB':>12} {'of bound':>9} {'s':>6}")
        setup = ("--bench", "bench.toml", *(() if form in TABLES else ("--dbc", "bench.dbc")))
        verbs = [measured(folder, *words) for words in (("ingest", f"log.{form}", *setup), ("show", "log"))]
    return {"format": form, "bytes": size, "frames": frames, "verbs": verbs}


def write_setup(folder: Path, form: str, size: int) -> int:
    """The log of about `size` bytes, bench file and database; how many frames it has."""
    writers = {
        "blf": write_blf,
        "db": _write_db,
        "mf4": _write_mf4,
        "frames.mf4": _write_frames_mf4,
        "groups.mf4": _write_groups_mf4,
        "unsorted.mf4": _write_unsorted_mf4,
        "mdf": _write_mdf,
        "tdms": _write_tdms,
        "xlsx": _write_xlsx,
    }
    path, write = folder / f"log.{form}", writers.get(form, partial(_write_lines, form))
    write(path, PROBE)
    frames = PROBE * size // path.stat().st_size
    if form == "xlsx" and frames > MOST_ROWS:
        write, frames = partial(_write_xlsx, channels=4 * frames // MOST_ROWS), MOST_ROWS
    write(path, frames)
    channels = [CHANNEL % ("" if form in TABLES else "Words.", k) for k in range(4)]
    (folder / "bench.toml").write_text('schema = "whyhot.bench/1"\n' + "".join(channels), encoding="utf-8")
    (folder / "bench.dbc").write_text(DATABASE, encoding="utf-8")
    return frames


def _write_lines(form: str, path: Path, count: int) -> None:
    """So many frames as lines; their values come again after each `PROBE`."""
    words = _words()
    if form in BETWEEN:
        values = [BETWEEN[form].join(b"%.1f" % value for value in row) for row in (0.1 * words - 40).tolist()]
    else:
        values = [row.tobytes().hex(*[" "] * (form == "asc")).encode() for row in words]
    with path.open("wb") as file:
        file.write(HEADS[form])
        for first in range(0, count, PROBE):
            stamps = (divmod(number * STEP_US, 1_000_000) for number in range(first, min(first + PROBE, count)))
            file.writelines(LINES[form] % (*stamp, value) for stamp, value in zip(stamps, values, strict=False))


def _write_db(path: Path, count: int) -> None:
    """A database as python-can writes it."""
    path.unlink(missing_ok=True)
    words = [row.tobytes() for row in _words()]
    rows = ((0x100, number * STEP_US / 1e6, words[number % PROBE]) for number in range(count))
    with closing(sqlite3.connect(path)) as database:
        database.execute(
            "CREATE TABLE messages(ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, "
            "dlc INTEGER, data BLOB)"
        )
        database.executemany("INSERT INTO messages VALUES (?2, ?1, 0, 0, 0, 8, ?3)", rows)
        database.commit()


def _words() -> NDArray[np.uint16]:
    """The four signals of `PROBE` frames, as the bus has them."""
    words = 400 + 10 * np.sin(np.arange(PROBE)[:, None] / np.array([600, 950, 1400, 3000]))
    noisy: NDArray[np.uint16] = np.round(words + np.random.default_rng(1).normal(0, 1, words.shape)).astype("<u2")
    return noisy


def _rows(count: int) -> Iterator[NDArray[np.float64]]:
    """So many rows of time [s] and four temperatures [degC], about `PROBE` at once."""
    for first in range(0, count, PROBE):
        number = np.arange(first, min(first + PROBE, count))
        yield np.column_stack([number * (STEP_US / 1e6), 0.1 * _words()[: len(number)] - 40])


def _write_mf4(path: Path, count: int) -> None:
    file = mdf.Mdf4()
    channels = [mdf.SECONDS, *(mdf.Channel(f"w{k}", mdf.FLOAT, 8 + 8 * k, 64, unit="degC") for k in range(4))]
    records = b"".join(rows.astype("<f8").tobytes() for rows in _rows(count))
    file.save(path, file.stored("table", channels, records, 40))


def _write_mdf(path: Path, count: int) -> None:
    file = mdf3.Mdf3File()
    channels = [mdf3.SECONDS, *(mdf3.Channel3(f"w{k}", mdf3.DOUBLE, 64 + 64 * k, 64) for k in range(4))]
    records = b"".join(rows.astype("<f8").tobytes() for rows in _rows(count))
    file.save(path, file.data_group(file.group("table", channels, count, 40), records))


def _write_frames_mf4(path: Path, count: int) -> None:
    """As loggers of a bus write it: an identifier, a length and eight bytes."""
    file = mdf.Mdf4()
    places = {"ID": (mdf.UNSIGNED, 8, 32), "DataLength": (mdf.UNSIGNED, 12, 8), "DataBytes": (mf4.BYTES, 13, 64)}
    parts = [mdf.Channel(f"CAN_DataFrame.{name}", *place) for name, place in places.items()]
    frames = np.zeros(count, np.dtype([("t", "<f8"), ("id", "<u4"), ("length", "u1"), ("words", "<u2", 4)]))
    frames["t"], frames["id"], frames["length"] = np.arange(count) * (STEP_US / 1e6), 0x100, 8
    frames["words"] = np.resize(_words(), (count, 4))
    file.save(path, file.stored("frames", [mdf.SECONDS, *parts], frames.tobytes(), frames.itemsize))


def _of_groups(count: int) -> Iterator[NDArray[np.void]]:
    """So many rows as records of four groups, a record of each after another, with its number before its time."""
    for rows in _rows(count):
        records = np.zeros((len(rows), 4), np.dtype([("number", "u1"), ("t", "<f8"), ("value", "<f8")]))
        records["number"], records["t"], records["value"] = range(4), rows[:, :1], rows[:, 1:]
        yield records


def _signal(k: int) -> list[mdf.Channel]:
    return [mdf.SECONDS, mdf.Channel(f"w{k}", mdf.FLOAT, 8, 64, unit="degC")]


def _write_groups_mf4(path: Path, count: int) -> None:
    file, after = mdf.Mdf4(), 0
    for k in range(4):
        records = b"".join(some[["t", "value"]][:, k].astype("<f8,<f8").tobytes() for some in _of_groups(count))
        after = file.stored(f"g{k}", _signal(k), records, 16, after=after)
    file.save(path, after)


def _write_unsorted_mf4(path: Path, count: int) -> None:
    file = mdf.Mdf4()
    groups = [file.measured(f"g{k}", _signal(k), count, 16, number=k) for k in range(4)]
    for one, other in pairwise(groups):
        file.follows(one, other)
    records = b"".join(some.tobytes() for some in _of_groups(count))
    file.save(path, file.data_group(groups[0], file.block(b"DT", (), records), id_size=1))


def _write_tdms(path: Path, count: int) -> None:
    from nptdms import ChannelObject, TdmsWriter

    step = {"wf_increment": STEP_US / 1e6}
    with TdmsWriter(path) as writer:
        for rows in _rows(count):
            writer.write_segment([ChannelObject("bench", f"w{k}", rows[:, k + 1], step) for k in range(4)])


def _write_xlsx(path: Path, count: int, channels: int = 4) -> None:
    """By openpyxl but for its rows, of which it writes too few a second."""
    from openpyxl import Workbook

    book, empty = Workbook(), BytesIO()
    book.active.append(["time", *(f"w{k}" for k in range(channels))])
    book.save(empty)
    words = _words()
    values = 0.1 * np.column_stack([np.roll(words[:, k % 4], 997 * k) for k in range(channels)]) - 40
    cells = ["".join(f"<c><v>{value:.1f}</v></c>" for value in row) for row in values.tolist()]
    with zipfile.ZipFile(empty) as small, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed:
        for name in small.namelist():
            before, end, after = small.read(name).partition(b"</sheetData>")
            with packed.open(name, "w", force_zip64=True) as file:
                file.write(before)
                for number in range(count if end else 0):
                    line = (
                        f'<row r="{number + 2}"><c><v>{number * STEP_US / 1e6:.6f}</v></c>{cells[number % PROBE]}</row>'
                    )
                    file.write(line.encode())
                file.write(end + after)


def measured(folder: Path, *words: str) -> dict[str, Any]:
    """One command, watched. Raises RuntimeError where it fails."""
    env = {**os.environ, "PYTHONPATH": str(HERE.parent), "WHYHOT_STORE": "store"}
    began, most, said = time.monotonic(), 0, folder / "said.txt"
    with said.open("w") as output:
        process = subprocess.Popen(
            [sys.executable, "-c", CODE, *words], cwd=folder, env=env, stdout=output, stderr=output
        )
        while not (ended := os.wait4(process.pid, os.WNOHANG))[0]:
            most = max(most, sum(map(_held, _family(process.pid))))
            time.sleep(EVERY_S)
    process.returncode = os.waitstatus_to_exitcode(ended[1])
    if process.returncode:
        raise RuntimeError(f"{words[0]}: {process.returncode}: {said.read_text()[-2000:]}")
    seconds, largest = time.monotonic() - began, ended[2].ru_maxrss * 1024
    found = {"verb": words[0], "all_MiB": max(most, largest) // MIB, "largest_MiB": largest // MIB, "seconds": seconds}
    share = 100 * max(most, largest) / MIB / BOUND_MIB
    print(f"{words[0]:8} {found['all_MiB']:8,} {found['largest_MiB']:12,} {share:7.0f} % {seconds:6.1f}", flush=True)
    return found


def _family(pid: int) -> list[int]:
    """A process and those that it started."""
    try:
        started = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [pid, *(one for child in started for one in _family(int(child)))]


def _held(pid: int) -> int:
    """Bytes of memory of a process, none where it has ended."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * resource.getpagesize()
    except OSError:
        return 0


if __name__ == "__main__":
    main()
