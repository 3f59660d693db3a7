"""What one session costs in bytes, events and seconds, and what 10^3, 10^5 and 10^7 of them would: on paper.

    python benchmarks/how_far.py [--sessions N] [--seconds N] [--quick] [--json FILE]

Sessions of a small motor on a CAN bench, N seconds each, are taken in and replayed in this process: a store of N + 1
of them less a store of one, after all is compiled. Bytes of one session: the log as it came, what the archive keeps
(log and run), what is decoded, its share of the ledger. `every_event_s`: what a command takes that reads all events
(`status`, `verify`, `sql` after something was written). Seconds are by the wall.

Everything else is multiplied: no store of 10^5 or 10^7 sessions was made. Money is by `PRICES`, which are nobody's
offer: put in your own.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from benchmarks.shared import stored
from ingest.facts import facts
from ingest.facts.store import Store
from made import can_bench
from replay.engine.runs.campaign import replay_sessions

SIZES = (10**3, 10**5, 10**7)
PRICES = {"disk": 0.02, "core": 0.05}  # a GB and month, a core and hour
HOUR_S, GB, DAY_S = 3600.0, 1e9, 86_400


def main() -> None:
    """Print what one costs, then what many would."""
    words = asked.parser(__doc__, sessions=(12, 2), seconds=(1800, 60)).parse_args()
    with TemporaryDirectory() as place:
        one = measured(Path(place), words.sessions, words.seconds)
    for name, value in one.items():
        print(f"{name:16} {value:16,.4f}")
    print(f"\n{'sessions':16}" + "".join(f"{size:>16,}" for size in SIZES))
    many = {size: of_many(one, size) for size in SIZES}
    for name in many[SIZES[0]]:
        print(f"{name:16}" + "".join(f"{many[size][name]:16,.2f}" for size in SIZES))
    asked.keep({"one": one, "many": many, "prices": PRICES}, words.json)


def measured(folder: Path, sessions: int, seconds: int) -> dict[str, float]:
    """What one session more of so many seconds costs."""
    can_bench.write_files(folder)
    logs = [folder / f"{i}.blf" for i in range(sessions + 1)]
    for i, log in enumerate(logs):
        can_bench.write_log(log, seconds=seconds, seed=i, start=can_bench.START + i * DAY_S)
    of_store(folder, logs[1:2])
    first, whole = of_store(folder, logs[:1]), of_store(folder, logs)
    return {name: (whole[name] - first[name]) / sessions for name in whole}


def of_store(folder: Path, logs: Sequence[Path]) -> dict[str, float]:
    """What a store of these logs costs, each of them replayed; the first store of all compiles, too."""
    began = time.perf_counter()
    with stored(folder, logs, folder / f"{logs[0].stem}-{len(logs)}") as store:
        ingested = time.perf_counter()
        outcomes = replay_sessions(store, facts.at(store.ledger).sessions, None, "testing")
        replayed = time.perf_counter()
        events, place = store.ledger.head().position, store.folder
    if len(outcomes) != len(logs) or not all(one.run for one in outcomes):
        raise RuntimeError(f"{len(outcomes)} of {len(logs)} sessions, {[one.refusal for one in outcomes]}")
    with Store.open(place) as store:
        again = time.perf_counter()
        store.ledger.events()
        every = time.perf_counter() - again
    return {
        "log_bytes": sum(log.stat().st_size for log in logs),
        "archive_bytes": under(place / "archive"),
        "decoded_bytes": under(place / "decoded"),
        "ledger_bytes": under(place, "ledger.sqlite"),
        "events": events,
        "ingest_s": ingested - began,
        "replay_s": replayed - ingested,
        "every_event_s": every,
    }


def under(folder: Path, names: str = "**/*") -> int:
    """Bytes of the files in a folder."""
    return sum(path.stat().st_size for path in folder.glob(names) if path.is_file())


def of_many(one: dict[str, float], sessions: int) -> dict[str, float]:
    """The same for so many sessions: GB, hours of one core, and money."""
    kept = (one["archive_bytes"] + one["decoded_bytes"] + one["ledger_bytes"]) * sessions / GB
    hours = (one["ingest_s"] + one["replay_s"]) * sessions / HOUR_S
    return {
        "events_millions": one["events"] * sessions / 1e6,
        "kept_GB": kept,
        "ledger_GB": one["ledger_bytes"] * sessions / GB,
        "every_event_h": one["every_event_s"] * sessions / HOUR_S,
        "ingest_core_h": one["ingest_s"] * sessions / HOUR_S,
        "replay_core_h": one["replay_s"] * sessions / HOUR_S,
        "disk_a_month": kept * PRICES["disk"],
        "cores_once": hours * PRICES["core"],
    }


if __name__ == "__main__":
    main()
