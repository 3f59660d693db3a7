"""Reads a BLF file into Parquet three ways in one run, checks that all three give the same values, and prints ratios.

    python benchmarks/ingest.py [--quick] [--json FILE]

- whyhot: child process, recording (MCAP), decoding and Parquet, everything counted.
- python-can + cantools: `BLFReader`, `decode_message` a frame, Parquet with the same encodings.
- asammdf: `extract_bus_logging`, Parquet with the same encodings. It cannot read BLF: it gets the same frames as an MF4
  file, and making that file is not counted. Without asammdf (`make bench` installs it) this way is left out and said.

The ways take turns, round by round, so that a busy machine slows all of them alike; each is given as the median, of
wall time and of processor time (its child processes included).

In the same run, what one `ingest` of many small things takes, from an empty store to a sealed one: logs of 1,400 rows,
and a table of checks of which each row is a session. With them, in turns, the same logs one by one: the child process,
the ledger and the grouping of each are then started anew.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else this file hides the package
sys.path[:0] = [str(HERE.parent)]

from benchmarks import asked
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import MotorFile, prepare
from ingest.log import samples
from ingest.log.databases import load
from ingest.log.decode import RECORDING, decode_file
from ingest.log.reading import Reader

MESSAGES, SIGNALS = 20, 4
START_S = 1_700_000_000
Values = dict[str, NDArray[np.float64]]  # "message.signal" -> values in the order of the file
Way = Callable[[Path, Path, Path], Mapping[str, Path]]  # (log, DBC, folder) -> message -> Parquet file


def database() -> str:
    """A DBC of 20 messages of 8 bytes with 4 signals of 16 bits each, half of them Motorola, half of them signed."""
    lines = ['VERSION ""', "BU_: BENCH"]
    for m in range(MESSAGES):
        lines.append(f"BO_ {0x100 + m} Message{m}: 8 BENCH")
        for s in range(SIGNALS):
            motorola, sign = (m + s) % 2, "-" if s % 2 else "+"
            start = 16 * s + (7 if motorola else 0)
            lines.append(f' SG_ m{m}_s{s} : {start}|16@{1 - motorola}{sign} (0.{s + 1},-40) [0|0] "degC" BENCH')
    return "\n".join(lines) + "\n"


def log_of(count: int) -> list[can.Message]:
    """`count` frames, 0.25 ms apart, identifiers and payloads drawn with a fixed seed."""
    random = np.random.default_rng(1)
    ids = (0x100 + random.integers(0, MESSAGES, count)).tolist()
    payloads = random.integers(0, 256, (count, 8)).astype(np.uint8)
    return [
        can.Message(START_S + i / 4000, ids[i], is_extended_id=False, channel=0, data=payloads[i].tobytes())
        for i in range(count)
    ]


# ---- the ways ------------------------------------------------------------------------------------------------------


def whyhot(log: Path, dbc: Path, folder: Path) -> Mapping[str, Path]:
    with closing(Reader()) as reader:
        reading = reader.record(log, folder / RECORDING)
    event = decode_file(reading, "0" * 64, [load(dbc.read_bytes(), dbc.name)], None, [], folder)
    return {group["name"]: folder / group["file"] for group in event.groups}


def frame_by_frame(log: Path, dbc: Path, folder: Path) -> Mapping[str, Path]:
    known: Any = cantools.database.load_file(dbc)
    columns: dict[str, dict[str, list[Any]]] = {}
    for message in known.messages:
        columns[message.name] = {"t_s": [], **{signal.name: [] for signal in message.signals}}
    names = {message.frame_id: message.name for message in known.messages}
    with can.BLFReader(log) as frames:
        for frame in frames:
            rows = columns[names[frame.arbitration_id]]
            rows["t_s"].append(frame.timestamp)
            for name, value in known.decode_message(frame.arbitration_id, frame.data, decode_choices=False).items():
                rows[name].append(value)
    return {name: _write(folder / f"{name}.parquet", rows) for name, rows in columns.items() if rows["t_s"]}


def asammdf(log: Path, dbc: Path, folder: Path) -> Mapping[str, Path]:
    from asammdf import MDF

    columns: defaultdict[str, dict[str, Any]] = defaultdict(dict)
    with MDF(log.with_suffix(".mf4")) as logged, logged.extract_bus_logging({"CAN": [(dbc, 0)]}) as decoded:
        for group in range(len(decoded.groups)):
            channels = [(None, group, i) for i in range(1, len(decoded.groups[group].channels))]
            for signal in decoded.select(channels):
                rows = columns[f"Message{signal.name.split('_')[0].removeprefix('m')}"]
                rows["t_s"] = signal.timestamps
                rows[signal.name] = signal.samples.astype(np.float64)
    return {name: _write(folder / f"{name}.parquet", rows) for name, rows in columns.items()}


def _write(path: Path, columns: Mapping[str, Any]) -> Path:
    table = pa.table({name: pa.array(values, pa.float64()) for name, values in columns.items()})
    split = dict.fromkeys(columns, "BYTE_STREAM_SPLIT")
    pq.write_table(
        table,
        path,
        compression="zstd",
        compression_level=1,
        use_dictionary=False,
        column_encoding=split,
        write_page_checksum=True,
    )
    return path


# ---- many small things --------------------------------------------------------------------------------------------


LOGS = """\
schema = "whyhot.bench/1"
[time]
column = "time"
[[channel]]
signal = "T"
quantity = "temperature"
unit = "degC"
node = "ambient"
"""
CHECKS = """\
schema = "whyhot.bench/1"
kind = "insulation_check"
specimen_column = "specimen"
[time]
column = "time"
[[channel]]
signal = "R"
quantity = "insulation_resistance"
unit = "ohm"
"""
ROWS = 1400  # of a small log


def small_logs(folder: Path, count: int) -> tuple[list[Path], Path]:
    """`count` CSV logs of 1,400 rows, one a second, on different days, and their bench file."""
    random = np.random.default_rng(2)
    paths = [folder / f"log{k:03}.csv" for k in range(count)]
    for k, path in enumerate(paths):
        stamps = np.datetime64("2026-01-01T08:00:00") + np.timedelta64(k, "D") + np.arange(ROWS)
        values = 20 + np.arange(ROWS) / 70 + random.normal(0, 0.1, ROWS)
        rows = [f"{stamp},{value:.2f}" for stamp, value in zip(stamps, values, strict=True)]
        path.write_text("\n".join(["time,T", *rows]) + "\n")
    bench = folder / "logs.toml"
    bench.write_text(LOGS)
    return paths, bench


def checks(folder: Path, count: int) -> tuple[list[Path], Path]:
    """A table of `count` insulation checks of 40 specimens in turn, half an hour apart, and its bench file."""
    stamps = np.datetime64("2026-01-01T08:00:00") + np.arange(count) * np.timedelta64(30, "m")
    rows = [f"{stamp},S{k % 40:02},{1e9 + k:.0f}" for k, stamp in enumerate(stamps)]
    table, bench = folder / "checks.csv", folder / "checks.toml"
    table.write_text("\n".join(["time,specimen,R", *rows]) + "\n")
    bench.write_text(CHECKS)
    return [table], bench


def take(paths: list[Path], bench: Path, folder: Path) -> int:
    """Ingest into a store in `folder`, made where there is none; how many sessions it holds then."""
    with Store.open(folder, create=True) as store:
        take_in(store, paths, prepare(paths, bench, [], _no_motor), Override())
        return len(facts.at(store.ledger).sessions)


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(f"{path}: these bench files name no motor file")


def run_many(files: int, sessions: int, rounds: int) -> dict[str, dict[str, float]]:
    """Wall and processor time of the three, medians. Raises SystemExit where a store holds other sessions than were
    given."""
    taken: defaultdict[str, list[NDArray[np.float64]]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as place:
        logs, table = small_logs(Path(place), files), checks(Path(place), sessions)
        together = [(logs[0], logs[1])]
        one_by_one = [([path], logs[1]) for path in logs[0]]
        many = {
            "many small files": (files, together),
            "small files one by one": (files, one_by_one),
            "many sessions": (sessions, [table]),
        }
        for i in range(rounds):
            for name, (count, commands) in many.items():
                begun = clocks()
                held = [take(paths, bench, Path(place) / f"{i} {name}") for paths, bench in commands][-1]
                taken[name].append(clocks() - begun)
                if held != count:
                    sys.exit(f"{name}: {held} sessions, not {count}")
    found = {}
    for name, (count, _) in many.items():
        wall, processor = np.median(taken[name], axis=0).tolist()
        found[name] = {
            "count": count,
            "seconds": wall,
            "processor_seconds": processor,
            "per_second": count / wall,
        }
    return found


# ---- the run -------------------------------------------------------------------------------------------------------


def values_of(files: Mapping[str, Path]) -> Values:
    """Every signal of every message; whyhot's columns carry their unit behind the name."""
    found = {}
    for message, path in files.items():
        table = samples.read(path)
        for name in table.column_names:
            if name not in (*samples.FIXED, "t_s"):
                found[f"{message}.{name.removesuffix('_degC')}"] = table[name].to_numpy()
    return found


def differences(files: Mapping[str, Mapping[str, Path]]) -> list[str]:
    """The signals in which a way differs from whyhot in any bit."""
    ours = values_of(files["whyhot"])
    return [
        f"{way}: {signal}"
        for way in files
        for signal, values in (values_of(files[way]) if way != "whyhot" else {}).items()
        if not np.array_equal(values, ours[signal])
    ] + [f"{way}: {len(values_of(files[way]))} signals" for way in files if len(values_of(files[way])) != len(ours)]


def make_inputs(folder: Path, count: int) -> tuple[Path, Path, dict[str, Way]]:
    """BLF, DBC and, with asammdf, MF4 of the same frames; the ways that can run here."""
    log, dbc = folder / "log.blf", folder / "bench.dbc"
    dbc.write_text(database())
    ways: dict[str, Way] = {"whyhot": whyhot, "python-can + cantools": frame_by_frame}
    frames = log_of(count)
    _write_log(can.BLFWriter(log), frames)
    if find_spec("asammdf") is None:
        return log, dbc, ways
    _write_log(can.MF4Writer(log.with_suffix(".mf4")), frames)
    return log, dbc, {**ways, "asammdf": asammdf}


def _write_log(writer: Any, frames: list[can.Message]) -> None:
    with writer:
        for frame in frames:
            writer.on_message_received(frame)


def clocks() -> NDArray[np.float64]:
    """Wall time, and processor time of this process and the children that it waited for [s]."""
    spent = os.times()
    return np.array([spent.elapsed, spent.user + spent.system + spent.children_user + spent.children_system])


def run(count: int, rounds: int) -> dict[str, Any]:
    """Time every way `rounds` times, in turns. Raises SystemExit where they do not give the same values."""
    taken: defaultdict[str, list[NDArray[np.float64]]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as place:
        log, dbc, ways = make_inputs(Path(place), count)
        files: dict[str, Mapping[str, Path]] = {}
        for i in range(rounds):
            for name, way in ways.items():
                folder = Path(place) / f"{i} {name}"
                folder.mkdir()
                begun = clocks()
                files[name] = way(log, dbc, folder)
                taken[name].append(clocks() - begun)
        wrong = differences(files)
    if wrong:
        sys.exit(f"the ways do not agree: {', '.join(wrong[:5])}")
    median = {name: np.median(spent, axis=0).tolist() for name, spent in taken.items()}
    wall, processor = ({name: spent[i] for name, spent in median.items()} for i in range(2))
    return {
        "schema": "whyhot.benchmark-ingest/1",
        "frames": count,
        "rounds": rounds,
        "seconds": wall,
        "processor_seconds": processor,
        "frames_per_second": {name: round(count / spent) for name, spent in wall.items()},
        "times_whyhot": {name: spent / wall["whyhot"] for name, spent in wall.items()},
        "processor_times_whyhot": {name: spent / processor["whyhot"] for name, spent in processor.items()},
        "values_equal": True,
        "asammdf": "from an MF4 of the same frames, made outside the clock" if "asammdf" in wall else "not installed",
    }


def main() -> None:
    words = asked.parser(__doc__).parse_args()
    frames, files, sessions, rounds = (500, 2, 50, 1) if words.quick else (300_000, 20, 4800, 3)
    result = run(frames, rounds)
    result["many"] = run_many(files, sessions, rounds)
    asked.keep(result, words.json)
    of = f"{result['frames']:,} frames, median of {result['rounds']} rounds"
    print(f"BLF to Parquet, {of}, values equal to the last bit")
    print(f"{'':24}{'wall s':>9}{'x whyhot':>10}{'processor s':>13}{'x whyhot':>10}{'frames/s':>13}")
    for name, wall in result["seconds"].items():
        processor, rate = result["processor_seconds"][name], result["frames_per_second"][name]
        times, processor_times = result["times_whyhot"][name], result["processor_times_whyhot"][name]
        print(f"{name:24}{wall:9.2f}{times:10.2f}{processor:13.2f}{processor_times:10.2f}{rate:13,}")
    print(f"asammdf: {result['asammdf']}")
    print(f"{'one ingest of':28}{'count':>9}{'wall s':>9}{'processor s':>13}{'per second':>13}")
    for name, one in result["many"].items():
        print(
            f"{name:28}{one['count']:9,}{one['seconds']:9.2f}{one['processor_seconds']:13.2f}{one['per_second']:13,.1f}"
        )


if __name__ == "__main__":
    main()
