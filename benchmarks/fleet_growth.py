"""What a fleet costs as it grows: its table of checks taken in, assessed and asked, for 10^3, 10^4 and 10^5 motors.

    python benchmarks/fleet_growth.py [--motors N] [--assessed N] [--asked N] [--quick] [--json FILE]

Each fleet of `tests/plant` has 20 checks a motor in one table. `ingest` and `ageing` are commands of their own, by the
wall and by the processor, with the most memory that each held (`MiB`, as the system counts it: Linux only); `read_s`:
reading the same file, and doing nothing with it: the table for `ingest`, its decoded rows for `ageing`; `pages`:
bytes of the report and of what is printed, which do not grow. `--motors`: the largest of these fleets; `--assessed`:
the largest that `ageing` is asked of, on as many processes as there are processors.

Then the views over the tables of one assessment, written here row by row as `whyhot ageing` writes them: 20 checks and
100 cycles a motor, for fleets up to `--asked` motors, with the memory that `whyhot sql` gives a question. `times_read`:
by the wall, as a multiple of reading the same columns of the same file and doing nothing with them (pyarrow).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import csv

from analytics import warehouse
from benchmarks import asked
from plant import fleet
from replay.engine.results.artefacts import table_writer
from replay.studies.ageing.tables import schema_of

CODE = "import sys; from replay.cli import main; sys.exit(main())"
MIB = 1024  # KiB
CHECKS, CYCLES = 20, 100  # a motor
AT_ONCE = 1000  # motors written together
FIRST = 1000
ROUNDS = 3
PAGE = 50  # rows of an answer


def main() -> None:
    """Print the tables."""
    words = asked.parser(__doc__, motors=(100_000, 70), assessed=(100_000, 70), asked=(100_000, 70)).parse_args()
    found: dict[str, Any] = {"whole": [], "views": []}
    with tempfile.TemporaryDirectory() as place:
        for motors in sizes(words.motors):
            found["whole"].append(of_fleet(Path(place) / f"whole{motors}", motors, motors <= words.assessed))
        for motors in sizes(words.asked):
            found["views"].append(of_views(Path(place) / f"views{motors}", motors))
    asked.keep(found, words.json)


def sizes(most: int) -> list[int]:
    """Ten times as many each time, up to `most`."""
    return [*(size for size in (FIRST, 10 * FIRST) if size < most), most]


# ---- taken in and assessed -----------------------------------------------------------------------------------------


def of_fleet(folder: Path, motors: int, assessed: bool) -> dict[str, Any]:
    """What each command takes."""
    batches, bad = max(8, motors // FIRST), min(motors, 5)
    written = fleet.write_checks(
        folder, 1, motors, (CHECKS, CHECKS + 1), batches=batches, bad_batches=1, bad_motors=bad
    )
    store, report = folder / "store", folder / "report.html"
    found: dict[str, Any] = {"motors": motors}
    (table,) = written.tables
    for words in written.ingest:
        found["ingest"] = command(folder, *words, "--store", str(store))
    found["ingest"]["read_s"] = least(partial(csv.read_csv, table))
    print(f"{motors:,} motors, {CHECKS} checks each")
    if assessed:
        shared = ("--workers", str(os.cpu_count() or 1)) if motors > FIRST else ()
        found["ageing"] = command(folder, "ageing", "--store", str(store), "--report", str(report), *shared)
        (rows,) = store.glob("decoded/*/rows.parquet")
        found["ageing"]["read_s"] = least(partial(pq.read_table, rows))
        found["pages"] = {"printed": (folder / "said.txt").stat().st_size, "report": report.stat().st_size}
        print(f"  report {report.stat().st_size / 1e6:.1f} MB")
    for verb in ("ingest", "ageing") if assessed else ("ingest",):
        of = found[verb]
        each = 1e3 * of["busy_s"] / motors
        print(
            f"  {verb:8} {of['wall_s']:8.1f} s {of['busy_s']:8.1f} s busy {each:6.1f} ms a motor {of['MiB']:7,.0f} MiB"
            f"   plain read {of['read_s']:.3f} s"
        )
    sys.stdout.flush()
    return found


def command(folder: Path, *words: str) -> dict[str, float]:
    """One command. Raises RuntimeError where it fails."""
    began = time.perf_counter()
    with (folder / "said.txt").open("w") as said:
        env = {**os.environ, "PYTHONPATH": str(HERE.parent)}
        process = subprocess.Popen(
            [sys.executable, "-c", CODE, *words], env=env, stdout=said, stderr=subprocess.DEVNULL
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"whyhot {words[0]}: {(folder / 'said.txt').read_text()[-2000:]}")
    return {
        "wall_s": time.perf_counter() - began,
        "busy_s": used.ru_utime + used.ru_stime,
        "MiB": used.ru_maxrss / MIB,
    }


# ---- asked ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Question:
    """What is asked of a view over the table of one `kind`, and the columns that it reads."""

    view: str
    kind: str
    columns: tuple[str, ...]
    sql: str


QUESTIONS = (
    Question(
        "conductivity_by_cycle",
        "checks",
        ("specimen", "dose_h", "resistance_K_per_W"),
        "SELECT specimen, regr_slope(ln(resistance_K_per_W), dose_h) AS slope FROM conductivity_by_cycle "
        "GROUP BY specimen ORDER BY slope DESC LIMIT 50",
    ),
    Question(
        "oven_cycles",
        "cycles",
        ("specimen", "hours_above", "swing_K"),
        "SELECT specimen, sum(hours_above_180degC) AS hours, max(swing_K) FROM oven_cycles GROUP BY specimen "
        "ORDER BY hours DESC LIMIT 50",
    ),
    Question(
        "fleet_health",
        "specimens",
        ("specimen", "score", "outlying"),
        "SELECT specimen, score, outlying FROM fleet_health LIMIT 50 OFFSET 20",
    ),
)


def of_views(folder: Path, motors: int) -> dict[str, Any]:
    """What each question takes, next to the plain read. Every answer is checked against the table itself."""
    folder.mkdir()
    files = {kind: folder / f"{kind}.parquet" for kind in ("checks", "cycles", "specimens")}
    for kind, file in files.items():
        with table_writer(file, schema_of(kind)) as writer:
            for table in made(kind, motors):
                writer.write_table(table)
    artefacts = [{"run": "a", "kind": f"ageing_{kind}", "file": str(file)} for kind, file in files.items()]
    found: dict[str, Any] = {"motors": motors}
    print(f"{motors:,} motors, {CHECKS * motors:,} checks, {CYCLES * motors:,} cycles")
    with duckdb.connect(":memory:") as connection:
        warehouse.fill(connection, {"artefacts": artefacts})
        warehouse.confine(connection)
        for one in QUESTIONS:
            rows = asked_of(connection, one.sql)
            if len({name for name, *_ in rows} & set(names(0, motors))) != PAGE:
                raise RuntimeError(f"{one.view}: answers with other specimens than there are")
            read = least(partial(pq.read_table, files[one.kind], columns=list(one.columns)))
            took = least(partial(asked_of, connection, one.sql))
            found[one.view] = {"s": took, "read_s": read, "times_read": took / read}
            print(f"  {one.view:24} {took:8.3f} s {took / read:7.2f} times the plain read")
    sys.stdout.flush()
    return found


def asked_of(connection: duckdb.DuckDBPyConnection, sql: str) -> list[tuple[Any, ...]]:
    return connection.execute(sql).fetchall()


def least(ask: Callable[[], object]) -> float:
    """Least seconds of some rounds."""
    taken = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        ask()
        taken.append(time.perf_counter() - began)
    return min(taken)


def names(first: int, last: int) -> list[str]:
    return [f"M{k:06}" for k in range(first, last)]


def made(kind: str, motors: int) -> Iterator[pa.Table]:
    """The rows of a fleet, `AT_ONCE` motors at a time: some numbers of each, nothing where a question does not look."""
    for first in range(0, motors, AT_ONCE):
        some = names(first, min(first + AT_ONCE, motors))
        random, each = np.random.default_rng(first), {"checks": CHECKS, "cycles": CYCLES, "specimens": 1}[kind]
        count = each * len(some)
        number = np.tile(np.arange(each), len(some))
        said: dict[str, Any] = {
            "specimen": np.repeat(some, each).tolist(),
            "batch": np.repeat([f"B{k // AT_ONCE:03}" for k in range(first, first + len(some))], each).tolist(),
            "number": number,
            "dose_h": 12.0 * number,
            "resistance_K_per_W": 0.02 * np.exp(3e-4 * number + 0.03 * random.standard_normal(count)),
            "hours_above": 12.0 + random.standard_normal(count),
            "swing_K": 200.0 + random.standard_normal(count),
            "score": random.standard_normal(count),
            "outlying": np.zeros(count, np.bool_),
        }
        schema = schema_of(kind)
        columns = [said.get(field.name, pa.nulls(count, field.type)) for field in schema]
        yield pa.Table.from_arrays(
            [pa.array(column, field.type) for column, field in zip(columns, schema, strict=True)], schema=schema
        )


if __name__ == "__main__":
    main()
