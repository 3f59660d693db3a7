"""Reads a BLF file into Parquet several ways in one run, checks that all give the same values, and prints ratios.

    python benchmarks/ingest.py [--quick] [--json FILE] [--frames N]

- whyhot: child process, recording (MCAP), decoding and Parquet, all of it hashed, sealed and brought to the disk, as
  the verb does it.
- the whole verb: the same by `ingest` into a new store, with the ledger, and with what no other way here does: the
  session's quality, its clock and its kind.
- python-can + cantools: `BLFReader`, `decode_message` a frame, Parquet with the same encodings.
- asammdf: `extract_bus_logging`, Parquet with the same encodings. It cannot read BLF: it gets the same frames as an MF4
  file, and making that file is not counted. Without asammdf (`make bench` installs it) this way is left out and said.

The work that is the same is from frames in a file to Parquet of all signals, equal to the last bit. The others keep no
record of the frames, hash nothing, and wait for no disk.

Each way runs in a process of its own, so its cold start (Python, its imports, our child process) counts once. The ways
take turns, round by round, so that a busy machine slows all of them alike; each is given as the least of wall time and
of processor time (its child processes included) over the rounds, as what others do on the machine only adds to both.

Where the time goes: processor time of each stage of our way by itself, in this process, and as a share of their sum;
next to the floor, which inflates, hashes and writes the same bytes and does nothing else. And two such ingests at once,
each on a core of its own, against one on one core; next to two floors at once, against one: what the machine has for a
second process.

In the same run, what one `ingest` of many small things takes, from an empty store to a sealed one: logs of 1,400 rows,
and a table of checks of which each row is a session. With them, in turns, the same logs one by one: the child process,
the ledger and the grouping of each are then started anew.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from hashlib import sha256
from importlib.util import find_spec
from itertools import starmap
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else this file hides the package
sys.path[:0] = [str(HERE.parent)]

from benchmarks import asked

# What a way needs it imports itself: that is its cold start.

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


def log_of(count: int) -> Iterator[Any]:
    """`count` frames of python-can, 0.25 ms apart, identifiers and payloads drawn with a fixed seed."""
    import can

    random = np.random.default_rng(1)
    ids = (0x100 + random.integers(0, MESSAGES, count)).tolist()
    payloads = random.integers(0, 256, (count, 8)).astype(np.uint8)
    for i in range(count):
        yield can.Message(START_S + i / 4000, ids[i], is_extended_id=False, channel=0, data=payloads[i].tobytes())


# ---- the ways ------------------------------------------------------------------------------------------------------


def whyhot(log: Path, dbc: Path, folder: Path) -> Mapping[str, Path]:
    from ingest.facts.store import Store
    from ingest.log.databases import load
    from ingest.log.decode import RECORDING, decode_file
    from ingest.log.reading import Reader

    with Store.open(folder / "store", create=True) as store, closing(Reader()) as reader:
        raw = store.archive.seal(log)
        made = _made(store.work() / "made")
        reading = reader.record(log, made / RECORDING)
        event = decode_file(reading, raw, [load(dbc.read_bytes(), dbc.name)], None, [], made)
        store.publish(made, event.decode)
        return {group["name"]: store.decoded(event.decode) / group["file"] for group in event.groups}


def whole_verb(log: Path, dbc: Path, folder: Path) -> Mapping[str, Path]:
    from ingest.facts import facts
    from ingest.facts.sessions import Override
    from ingest.facts.store import Store
    from ingest.intake.intake import take_in
    from ingest.intake.setup import prepare

    with Store.open(folder / "store", create=True) as store:
        take_in(store, [log], prepare([log], None, [dbc], _no_motor), Override())
        (event,) = facts.at(store.ledger).decodes.values()
        return {group["name"]: store.decoded(event.decode) / group["file"] for group in event.groups}


def frame_by_frame(log: Path, dbc: Path, folder: Path) -> Mapping[str, Path]:
    import can
    import cantools

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


# ---- where the time goes -------------------------------------------------------------------------------------------


def stages(log: Path, dbc: Path, folder: Path) -> dict[str, float]:
    """Processor time of each stage [s], of the start of the child with what it imports, and of the `floor`."""
    import can

    from ingest.facts.durable import sync_tree
    from ingest.facts.events import DecodeCompleted
    from ingest.facts.store import Store
    from ingest.formats import open_log
    from ingest.log import samples
    from ingest.log.databases import load
    from ingest.log.decode import RECORDING, decode_file
    from ingest.log.reading import Reader
    from ingest.log.recording import write

    found, tiny, recorded = {}, folder / "tiny.blf", folder / RECORDING
    _write_log(can.BLFWriter(tiny), log_of(1))
    begun = clocks()
    with closing(Reader()) as reader:
        reader.record(tiny, folder / "tiny.mcap")
    found["start"] = (clocks() - begun)[1]
    found["read"] = _spent(lambda: deque(open_log(log).batches(), 0))
    found["recording"] = _spent(lambda: write(recorded, open_log(log))) - found["read"]
    with closing(Reader()) as reader:
        reading = reader.record(log, recorded)
    made: list[DecodeCompleted] = []
    databases = [load(dbc.read_bytes(), dbc.name)]
    decoded = _spent(lambda: made.append(decode_file(reading, "0" * 64, databases, None, [], folder)))
    products = [recorded, *(folder / group["file"] for group in made[0].groups)]
    hashed = _spent(lambda: [sha256(path.read_bytes()) for path in products])
    tables = [(folder / f"again {path.name}", samples.read(path)) for path in products[1:]]
    found["Parquet"] = _spent(lambda: deque(starmap(_written_again, tables), 0))
    found["decode"] = decoded - hashed - found["Parquet"]
    with Store.open(folder / "sealed", create=True) as store:
        found["sealing"] = hashed + _spent(lambda: store.archive.seal(log)) + _spent(lambda: sync_tree(folder))
    found["floor"] = _spent(lambda: _floor(log, products, folder))
    return found


def _spent(work: Callable[[], object]) -> float:
    """Processor time of this process [s]."""
    begun = time.process_time()
    work()
    return time.process_time() - begun


def _written_again(path: Path, table: pa.Table) -> None:
    """Samples written once more as they are written in an ingest."""
    from ingest.log import samples

    names = [name for name in table.column_names if name not in samples.FIXED]
    writer = samples.GroupWriter(path, "0" * 64, [samples.Column(name, name, None, None) for name in names])
    t_ns, record, *values = (table[name].to_numpy() for name in ("t_ns", "record", *names))
    writer.add(samples.Samples(t_ns, record, values))
    writer.close()


def _floor(log: Path, products: list[Path], folder: Path) -> None:
    """Inflate the log, hash it and what is made of it, and write that."""
    from ingest.formats._blf_containers import parts

    with log.open("rb") as file:
        deque(parts(file, 144, log.stat().st_size), 0)
    for path in (log, *products):
        data = path.read_bytes()
        sha256(data)
        (folder / "floor").write_bytes(data)


def at_once(log: Path, dbc: Path, folder: Path) -> dict[str, float]:
    """How many times as much two processes do as one, each on a core of its own, by wall time: take in the log, and the
    floor of it. Both have done so before."""
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:  # forks of what has threads may hang

        def wall(way: Way, name: str, count: int) -> float:
            places = [_made(folder / f"{way.__name__} {name} {k}") for k in range(count)]
            begun = time.perf_counter()
            deque(pool.map(on_one_core, range(count), [way] * count, [log] * count, [dbc] * count, places), 0)
            return time.perf_counter() - begun

        def times(way: Way) -> float:
            wall(way, "warm", 2)
            return 2 * wall(way, "alone", 1) / wall(way, "two", 2)

        return {"two_processes": times(whyhot), "two_floors": times(floor)}


def on_one_core(number: int, way: Way, log: Path, dbc: Path, folder: Path) -> None:
    """A way, on the core of this number among those that there are."""
    cores = sorted(os.sched_getaffinity(os.getppid()))
    os.sched_setaffinity(0, {cores[number % len(cores)]})
    way(log, dbc, folder)


def floor(log: Path, dbc: Path, folder: Path) -> Mapping[str, Path]:
    """The floor of a log, without what is made of it."""
    _floor(log, [], folder)
    return {}


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
    from ingest.facts import facts
    from ingest.facts.sessions import Override
    from ingest.facts.store import Store
    from ingest.intake.intake import take_in
    from ingest.intake.setup import prepare

    with Store.open(folder, create=True) as store:
        take_in(store, paths, prepare(paths, bench, [], _no_motor), Override())
        return len(facts.at(store.ledger).sessions)


def _no_motor(path: Path) -> Any:
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
    from ingest.log import samples

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


WAYS: dict[str, Way] = {
    "whyhot": whyhot,
    "the whole verb": whole_verb,
    "python-can + cantools": frame_by_frame,
    "asammdf": asammdf,
}


def make_inputs(folder: Path, count: int) -> tuple[Path, Path, list[str]]:
    """BLF, DBC and, with asammdf, MF4 of the same frames; the ways that can run here."""
    import can

    log, dbc = folder / "log.blf", folder / "bench.dbc"
    dbc.write_text(database())
    _write_log(can.BLFWriter(log), log_of(count))
    if find_spec("asammdf") is None:
        return log, dbc, [name for name in WAYS if name != "asammdf"]
    _write_log(can.MF4Writer(log.with_suffix(".mf4")), log_of(count))
    return log, dbc, list(WAYS)


def in_its_own_process(name: str, log: Path, dbc: Path, folder: Path) -> Mapping[str, Path]:
    """What a way gives, from a cold start on."""
    command = [sys.executable, "-c", "import sys; from benchmarks.ingest import say; say(*sys.argv[1:])"]
    words = [name, *(str(path) for path in (log, dbc, folder))]
    done = subprocess.run([*command, *words], cwd=HERE.parent, stdout=subprocess.PIPE, check=True)
    return {message: Path(path) for message, path in json.loads(done.stdout).items()}


def say(name: str, log: str, dbc: str, folder: str) -> None:
    """Print what a way gives."""
    print(json.dumps({message: str(path) for message, path in WAYS[name](Path(log), Path(dbc), Path(folder)).items()}))


def _write_log(writer: Any, frames: Iterable[Any]) -> None:
    with writer:
        for frame in frames:
            writer.on_message_received(frame)


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


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
            for name in ways:
                folder = _made(Path(place) / f"{i} {name}")
                begun = clocks()
                files[name] = in_its_own_process(name, log, dbc, folder)
                taken[name].append(clocks() - begun)
        wrong = differences(files)
        spent = stages(log, dbc, _made(Path(place) / "stages"))
        twice = at_once(log, dbc, _made(Path(place) / "at once"))
    if wrong:
        sys.exit(f"the ways do not agree: {', '.join(wrong[:5])}")
    sum_s = sum(spent.values()) - spent["floor"]
    least = {name: np.min(spent, axis=0).tolist() for name, spent in taken.items()}
    wall, processor = ({name: spent[i] for name, spent in least.items()} for i in range(2))
    return {
        "schema": "whyhot.benchmark-ingest/1",
        "frames": count,
        "rounds": rounds,
        "seconds": wall,
        "processor_seconds": processor,
        "frames_per_second": {name: round(count / spent) for name, spent in wall.items()},
        "times_whyhot": {name: spent / wall["whyhot"] for name, spent in wall.items()},
        "processor_times_whyhot": {name: spent / processor["whyhot"] for name, spent in processor.items()},
        "stages_s": spent,
        "shares": {name: one / sum_s for name, one in spent.items() if name != "floor"},
        "sum_over_floor": sum_s / spent["floor"],
        **twice,
        "values_equal": True,
        "asammdf": "from an MF4 of the same frames, made outside the clock" if "asammdf" in wall else "not installed",
    }


def main() -> None:
    words = asked.parser(__doc__, frames=(1_000_000, 500)).parse_args()
    files, sessions, rounds = (2, 50, 1) if words.quick else (20, 4800, 3)
    result = run(words.frames, rounds)
    result["many"] = run_many(files, sessions, rounds)
    asked.keep(result, words.json)
    of = f"{result['frames']:,} frames, least of {result['rounds']} rounds"
    print(f"BLF to Parquet, {of}, values equal to the last bit")
    print(f"{'':24}{'wall s':>9}{'x whyhot':>10}{'processor s':>13}{'x whyhot':>10}{'frames/s':>13}")
    for name, wall in result["seconds"].items():
        processor, rate = result["processor_seconds"][name], result["frames_per_second"][name]
        times, processor_times = result["times_whyhot"][name], result["processor_times_whyhot"][name]
        print(f"{name:24}{wall:9.2f}{times:10.2f}{processor:13.2f}{processor_times:10.2f}{rate:13,}")
    print(f"asammdf: {result['asammdf']}")
    print(f"{'stage':24}{'processor s':>13}{'share':>8}")
    for name, share in result["shares"].items():
        print(f"{name:24}{result['stages_s'][name]:13.2f}{share:8.0%}")
    print(f"{'floor':24}{result['stages_s']['floor']:13.2f}")
    print(
        f"sum_over_floor {result['sum_over_floor']:.1f}   two_processes {result['two_processes']:.2f} times one   "
        f"two_floors {result['two_floors']:.2f}"
    )
    print(f"{'one ingest of':28}{'count':>9}{'wall s':>9}{'processor s':>13}{'per second':>13}")
    for name, one in result["many"].items():
        print(
            f"{name:28}{one['count']:9,}{one['seconds']:9.2f}{one['processor_seconds']:13.2f}{one['per_second']:13,.1f}"
        )


if __name__ == "__main__":
    main()
