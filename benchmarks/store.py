"""What a store's size costs: each verb on a store that grows, as a ratio to the smallest in the same run.

    python benchmarks/store.py [--quick] [--json FILE] [--rounds N]

One session is ingested as any is: a log of 200 rows with a bench file and a motor of three nodes. All others are made
from it through the library, a day after each other, on one of 50 motors: their facts are appended as an ingest would,
their samples are links to the first one's. What is measured is the whole command, in this process and warm: `sessions`,
`show`, `replay` and `ingest` of one session more, `sql` right after that (`sql_anew`: its tables are made again, once a
size) and again.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # the files here have the names of packages
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from ingest.facts import facts
from ingest.facts.events import DecodeCompleted, Event, RawFileSealed, SessionRecorded
from ingest.facts.sessions import session_id
from ingest.facts.store import Store
from made.places import on_disk
from replay.cli import main as whyhot
from replay.studies.motors.new import template

ROWS = 200  # of a log, one a second
DAY_NS = 86_400_000_000_000
SPECIMENS = 50
AT_ONCE = 500  # sessions appended in one transaction
LATER = 30_000  # day of the first session that is ingested to be measured
CHANNELS = {
    "speed": ("speed", "rpm", ""),
    "current": ("current", "A", ""),
    "inlet": ("temperature", "degC", 'node = "coolant"'),
    "room": ("temperature", "degC", 'node = "ambient"'),
    "T_winding": ("temperature", "degC", 'node = "winding"'),
}
QUESTION = "SELECT count(*), min(specimen) FROM sessions WHERE name = 'log0'"


def write_setup(folder: Path) -> None:
    """Motor file and bench file."""
    (folder / "motor.toml").write_bytes(template("three_node"))
    lines = ['schema = "whyhot.bench/1"', 'motor = "motor.toml"', 'kind = "drive"', "[time]", 'column = "time"']
    for signal, (quantity, unit, more) in CHANNELS.items():
        lines += ["[[channel]]", f'signal = "{signal}"', f'quantity = "{quantity}"', f'unit = "{unit}"', more]
    (folder / "bench.toml").write_text("\n".join(lines) + "\n")


def write_log(folder: Path, day: int) -> Path:
    """A log of a steady drive on the `day`-th day."""
    stamps = np.datetime64("1971-01-01T08:00:00") + np.timedelta64(day, "D") + np.arange(ROWS)
    warm = 25 + np.arange(ROWS) / 20
    rows = [f"{stamp},3000,100,20,22,{one:.2f}" for stamp, one in zip(stamps, warm, strict=True)]
    path = folder / f"log{day}.csv"
    path.write_text("\n".join(["time,speed,current,inlet,room,T_winding", *rows]) + "\n")
    return path


def first_session(store: Path, folder: Path) -> None:
    """A store with the one session that was measured, `log0`."""
    write_setup(folder)
    given = ("--bench", folder / "bench.toml", "--specimen", "M00")
    command(store, "ingest", write_log(folder, 0), *given)


def grow(folder: Path, size: int) -> None:
    """Append sessions like the first one, until there are `size`."""
    with Store.open(folder, write=True) as store:
        known = facts.at(store.ledger)
        add_like(store, known.session("log0"), range(len(known.sessions), size))


def add_like(store: Store, first: SessionRecorded, days: range) -> None:
    """Append a session like `first`, of one file, on each of some days; its samples are links to those of `first`."""
    known = facts.at(store.ledger)
    like = Like(known.files[first.files[0]["raw"]], known.decodes[first.files[0]["decode"]], first)
    for begin in range(days.start, days.stop, AT_ONCE):
        batch: list[tuple[str, Event]] = []
        for day in days[begin - days.start :][:AT_ONCE]:
            batch += like.on(day)
            copy = on_disk(store.decoded(name_of("decode", day)))
            copy.mkdir()
            for product in on_disk(store.decoded(like.decode.decode)).iterdir():
                os.link(product, copy / product.name)
        store.ledger.append_all(batch)


@dataclass(frozen=True)
class Like:
    """The facts of one session, and those of others like it."""

    file: RawFileSealed
    decode: DecodeCompleted
    session: SessionRecorded

    def on(self, day: int) -> list[tuple[str, Event]]:
        """What an ingest of the log of that day appends."""
        raw, decode, later = name_of("raw", day), name_of("decode", day), day * DAY_NS
        specimen = f"M{day % SPECIMENS:02}"
        file = replace(self.file, sha256=raw, name=f"log{day}.csv")
        times: dict[str, Any] = {"start_ns": self.session.start_ns + later, "end_ns": self.session.end_ns + later}
        decoded = replace(self.decode, decode=decode, raw=raw, **times)
        one = {**self.session.files[0], "raw": raw, "decode": decode}
        name = session_id([raw], specimen)
        session = replace(self.session, session=name, name=f"log{day}", specimen=specimen, files=[one], **times)
        return [(f"file-{raw}", file), (f"file-{raw}", decoded), (f"session-{name}", session)]


def name_of(what: str, day: int) -> str:
    return sha256(f"{what} {day}".encode()).hexdigest()


def command(store: Path, verb: str, *words: str | Path) -> float:
    """The seconds of one command. Raises SystemExit where it is refused."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        begun = time.perf_counter()
        code = whyhot([verb, *map(str, words), "--store", str(store)])
        took = time.perf_counter() - begun
    if code:
        sys.exit(f"whyhot {verb}: {said.getvalue()}")
    return took


def round_of(store: Path, folder: Path, day: int) -> dict[str, float]:
    """Seconds of each verb on the store as it is; one more session is in it afterwards."""
    log = write_log(folder, day)
    given = ("--bench", folder / "bench.toml", "--specimen", f"M{day % SPECIMENS:02}")
    return {
        "ingest": command(store, "ingest", log, *given),
        "sessions": command(store, "sessions"),
        "show": command(store, "show", f"log{day}"),
        "replay": command(store, "replay", f"log{day}"),
    }


def questions(store: Path, rounds: int) -> dict[str, float]:
    """Seconds of a question after an ingest, for which the tables are made anew, and least seconds of it after that."""
    anew = command(store, "sql", QUESTION)
    return {"sql": min(command(store, "sql", QUESTION) for _ in range(rounds)), "sql_anew": anew}


def run(sizes: Sequence[int], rounds: int) -> dict[str, Any]:
    """Least seconds of each verb at each size. The first round of all warms up and is thrown away."""
    seconds: dict[int, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        store = folder / "store"
        first_session(store, folder)
        new = count(LATER)
        round_of(store, folder, next(new))
        questions(store, 1)
        for size in sizes:
            grow(store, size)
            found = [round_of(store, folder, next(new)) for _ in range(rounds)]
            seconds[size] = {verb: min(one[verb] for one in found) for verb in found[0]} | questions(store, rounds)
    least = seconds[sizes[0]]
    return {
        "schema": "whyhot.benchmark-store/1",
        "rounds": rounds,
        "seconds": seconds,
        "times": {size: {verb: spent / least[verb] for verb, spent in one.items()} for size, one in seconds.items()},
    }


def main() -> None:
    words = asked.parser(__doc__, rounds=(5, 1)).parse_args()
    result = run([10, 20] if words.quick else [100, 1000, 10_000, 20_000], words.rounds)
    asked.keep(result, words.json)
    sizes = [*result["seconds"]]
    print(f"times the smallest store, least of {result['rounds']} (its seconds)")
    print(f"{'sessions':12}" + "".join(f"{size:>12,}" for size in sizes))
    for verb, least in result["seconds"][sizes[0]].items():
        print(f"{verb:12}" + "".join(f"{result['times'][size][verb]:12.2f}" for size in sizes) + f"   ({least:.3f} s)")


if __name__ == "__main__":
    main()
