"""Equivalent hours over 100 million temperatures, and slopes over a million checks: SQL beside polars and pandas.

    python benchmarks/warehouse.py [--quick] [--json FILE]

The Parquet is made in a temporary folder by the store's own writer, a file a session of 100,000 rows (28 h at 1 s, an
oven cycle to about 230 degC, 0.1 K steps), and asked through the views and macros that the product ships, with the
memory that `whyhot sql` gives a query. The ways take turns, round by round, so that a busy machine slows all alike;
given are the medians of wall time and of processor time (all threads), and their ratios to reading the two columns that
the view reads (temperature and record) of the same files and doing nothing with them (pyarrow, as many threads). Every
way must give the same hours, session by session.

- `samples`, step known: `equivalent_hours(value, step, ...)` over the view, as for logs at one rate.
- files, step known: the same macro over the files themselves: what the join with the sessions costs.
- files held against their SHA-256: what is done before an answer goes out, for the files that it was read from.
- histogram: the same macro over hours by temperature, 0.1 K wide, one table for all sessions.
- `equivalent_hours_of` on one session: what takes each step from the stamps, per row. All logs, once: the same of every
  session, part by part, when the tables are made; `cycles` then only tells it.
- polars and pandas: the same sums; without them (`make bench` installs them) they are left out and said.

Slopes: ln R over dose a motor, `regr_slope` over the view of the latest assessment, over the file, and by polars,
pandas and numpy.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

THREADS = min(2, os.cpu_count() or 1)
os.environ.setdefault("POLARS_MAX_THREADS", str(THREADS))  # read when polars is imported

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path.append(str(HERE.parent))

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from analytics import scans, warehouse
from analytics.columns import AGEING
from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K, ZERO_DEGC_IN_K, Activation, equivalent_hours
from benchmarks import asked
from ingest.facts.durable import sha256_of
from ingest.log.samples import Column, GroupWriter, Samples

Floats = NDArray[np.float64]
Way = Callable[[], Floats]

SESSION_ROWS = 100_000
STEP_H = 1.0 / 3600.0
ABOVE, AT, EV = 180.0, 180.0, 1.0
BIN_K = 0.1
UNASKED = ("plain read", "files held against their SHA-256")  # ways that give no hours
STEPS_AGREE = 1e-3  # a straight line between samples instead of a step: at the threshold they differ
MOTORS = 2_000


@dataclass(frozen=True)
class Made:
    """What was written: the file of each session, and the open warehouse over them."""

    files: tuple[Path, ...]
    histogram: Path
    checks: Path
    connection: duckdb.DuckDBPyConnection
    filled: Taken  # the tables made, and in them the hours of every session, once for all questions


@dataclass(frozen=True)
class Taken:
    """Medians of wall time and processor time [s]."""

    wall_s: float
    busy_s: float

    def beside(self, base: Taken, share: float) -> dict[str, float]:
        """With its ratios to `share` of what `base` takes."""
        return {
            "wall_s": self.wall_s,
            "busy_s": self.busy_s,
            "wall_ratio": self.wall_s / base.wall_s / share,
            "busy_ratio": self.busy_s / base.busy_s / share,
        }


def main() -> None:
    chosen = asked.parser(__doc__).parse_args()
    sessions, checks, rounds = (2, 20_000, 1) if chosen.quick else (1_000, 1_000_000, 3)
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        made = _make(Path(folder), sessions, checks)
        size = sum(file.stat().st_size for file in made.files)
        print(
            f"{sessions:,} sessions, {sessions * SESSION_ROWS:,} rows, {size / 1e6:,.0f} MB:"
            f" written in {time.perf_counter() - began:.0f} s"
        )
        answer = {"rows": sessions * SESSION_ROWS, "threads": THREADS, "hours": _hours(made, rounds)}
        answer["checks"] = checks
        answer["slopes"] = _slopes(made, rounds)
    asked.keep(answer, chosen.json)


def _hours(made: Made, rounds: int) -> dict[str, dict[str, float]]:
    worth = f"sum(equivalent_hours(%s, {STEP_H!r}, {AT}, {EV}))"
    listed = ", ".join(f"'{file}'" for file in made.files)
    ask = made.connection

    def numbers(query: str) -> Floats:
        return np.array([row[0] for row in ask.execute(query).fetchall()], np.float64)

    ways: dict[str, Way] = {
        "plain read": lambda: _read(made.files),
        "samples, step known": lambda: numbers(
            f"SELECT {worth % 'value'} FROM samples WHERE quantity = 'temperature' AND value > {ABOVE}"
            " GROUP BY session ORDER BY session"
        ),
        "files, step known": lambda: numbers(
            f"SELECT {worth % 'T_degC'} FROM read_parquet([{listed}], filename = true)"
            f" WHERE T_degC > {ABOVE} GROUP BY filename ORDER BY filename"
        ),
        "files held against their SHA-256": lambda: _held(ask),
        "histogram": lambda: numbers(
            f"SELECT sum(equivalent_hours(degC, hours, {AT}, {EV})) FROM read_parquet('{made.histogram}')"
            f" WHERE degC > {ABOVE} GROUP BY session ORDER BY session"
        ),
    }
    if find_spec("polars"):
        ways["polars"] = lambda: _polars_hours(made.files)
    if find_spec("pandas"):
        ways["pandas"] = lambda: _pandas_hours(made.files)
    _left_out(ways)
    exact = _truth(made.files)
    seconds = _in_turn(ways, rounds, {name: (exact, 1e-9) for name in ways if name not in UNASKED})
    rows = len(made.files) * SESSION_ROWS
    base = seconds["plain read"]
    answer = _say("equivalent hours", seconds, base, rows)
    steps = {
        "equivalent_hours_of, one session": (
            SESSION_ROWS,
            "SELECT equivalent_h FROM equivalent_hours_of('s000000', 180, 180, 1.0)",
        ),
        "cycles": (rows, "SELECT equivalent_1eV_h FROM cycles ORDER BY session"),
    }
    for name, (of, query) in steps.items():
        taken = _in_turn({name: partial(numbers, query)}, 1, {name: (exact[: of // SESSION_ROWS], STEPS_AGREE)})[name]
        answer[name] = taken.beside(base, of / rows) | {"rows_per_s": of / taken.wall_s}
        _line(name, taken, base, of / rows, of)
    answer["all logs, once"] = made.filled.beside(base, 1.0) | {"rows_per_s": rows / made.filled.wall_s}
    _line("all logs, once", made.filled, base, 1.0, rows)
    return answer


def _slopes(made: Made, rounds: int) -> dict[str, dict[str, float]]:
    ask = made.connection

    def numbers(query: str) -> Floats:
        return np.array([row[0] for row in ask.execute(query).fetchall()], np.float64)

    slope = "SELECT regr_slope(ln(resistance_K_per_W), dose_h) FROM %s GROUP BY specimen ORDER BY specimen"
    columns = ["specimen", "dose_h", "resistance_K_per_W"]
    ways: dict[str, Way] = {
        "plain read": lambda: np.array([pq.read_table(made.checks, columns=columns).num_rows], np.float64),
        "conductivity_by_cycle": lambda: numbers(slope % "conductivity_by_cycle"),
        "file": lambda: numbers(slope % f"read_parquet('{made.checks}')"),
        "numpy": lambda: _numpy_slopes(made.checks),
    }
    if find_spec("polars"):
        ways["polars"] = lambda: _polars_slopes(made.checks)
    if find_spec("pandas"):
        ways["pandas"] = lambda: _pandas_slopes(made.checks)
    exact = _numpy_slopes(made.checks)
    seconds = _in_turn(ways, rounds, {name: (exact, 1e-8) for name in ways if name != "plain read"})
    return _say("slopes of the fleet", seconds, seconds["plain read"], pq.read_metadata(made.checks).num_rows)


def _in_turn(ways: Mapping[str, Way], rounds: int, expected: Mapping[str, tuple[Floats, float]]) -> dict[str, Taken]:
    """What each way takes; one round more at first, which warms caches and is not counted, and checks every answer."""
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in ways}
    for turn in range(rounds + 1):
        for name, way in ways.items():
            began, busy = time.perf_counter(), time.process_time()
            found = way()
            if turn:
                taken[name].append((time.perf_counter() - began, time.process_time() - busy))
            elif name in expected:
                np.testing.assert_allclose(found, expected[name][0], rtol=expected[name][1], err_msg=name)
    return {name: Taken(*(float(v) for v in np.median(each, axis=0))) for name, each in taken.items()}


def _say(what: str, taken: Mapping[str, Taken], base: Taken, rows: int) -> dict[str, dict[str, float]]:
    print(f"{what}, {rows:,} rows, {THREADS} threads: wall and processor seconds, each with its ratio")
    for name, of in taken.items():
        _line(name, of, base, 1.0, rows)
    return {name: of.beside(base, 1.0) | {"rows_per_s": rows / of.wall_s} for name, of in taken.items()}


def _line(name: str, of: Taken, base: Taken, share: float, rows: float) -> None:
    ratio = of.beside(base, share)
    print(
        f"  {name:34} {of.wall_s:8.3f} {ratio['wall_ratio']:7.2f} {of.busy_s:9.3f} {ratio['busy_ratio']:7.2f}"
        f"  {rows / of.wall_s / 1e6:8.1f} Mrows/s"
    )


def _left_out(ways: Mapping[str, Way]) -> None:
    for peer in ("polars", "pandas"):
        if peer not in ways:
            print(f"{peer} is not installed: left out")


# What is asked, and its truth.


def _held(connection: duckdb.DuckDBPyConnection) -> Floats:
    scans.check(connection, scans.named(connection))
    return np.zeros(0)


def _read(files: Sequence[Path]) -> Floats:
    with ThreadPoolExecutor(THREADS) as pool:
        tables = pool.map(
            lambda file: pq.read_table(file, columns=["record", "T_degC"], use_threads=False).num_rows, files
        )
        return np.array([sum(tables)], np.float64)


def _truth(files: Sequence[Path]) -> Floats:
    rule = Activation(EV)
    columns = (pq.read_table(file, columns=["T_degC"])["T_degC"].to_numpy() for file in files)
    return np.array([equivalent_hours(degC, STEP_H, AT, rule, ABOVE) for degC in columns])


def _factor(degC: Any, exp: Callable[[Any], Any]) -> Any:
    return exp(EV / BOLTZMANN_EV_PER_K * (1.0 / (AT + ZERO_DEGC_IN_K) - 1.0 / (degC + ZERO_DEGC_IN_K)))


def _polars_hours(files: Sequence[Path]) -> Floats:
    pl = import_module("polars")
    hot = pl.scan_parquet(list(files), include_file_paths="file").filter(pl.col("T_degC") > ABOVE)
    worth = _factor(pl.col("T_degC"), lambda e: e.exp()).sum() * STEP_H
    found = hot.group_by("file").agg(worth.alias("h")).sort("file").collect(engine="streaming")
    return np.asarray(found["h"].to_numpy())


def _pandas_hours(files: Sequence[Path]) -> Floats:
    pd = import_module("pandas")
    found = []
    for file in files:
        degC = pd.read_parquet(file, columns=["T_degC"])["T_degC"]
        hot = degC[degC > ABOVE]
        found.append(float(_factor(hot, np.exp).sum()) * STEP_H)
    return np.array(found)


def _numpy_slopes(file: Path) -> Floats:
    table = pq.read_table(file, columns=["specimen", "dose_h", "resistance_K_per_W"])
    which = table["specimen"].combine_chunks().dictionary_encode()
    order = np.argsort(np.array(which.dictionary.to_pylist()))
    place = np.empty(order.size, np.int64)
    place[order] = np.arange(order.size)
    group = place[which.indices.to_numpy()]
    x, y = table["dose_h"].to_numpy(), np.log(table["resistance_K_per_W"].to_numpy())
    n = np.bincount(group)
    x = x - (np.bincount(group, x) / n)[group]
    return np.asarray(np.bincount(group, x * y) / np.bincount(group, x * x))


def _polars_slopes(file: Path) -> Floats:
    pl = import_module("polars")
    x, y = pl.col("dose_h"), pl.col("resistance_K_per_W").log()
    found = (
        pl.scan_parquet(file).group_by("specimen").agg((pl.cov(x, y) / x.var()).alias("b")).sort("specimen").collect()
    )
    return np.asarray(found["b"].to_numpy())


def _pandas_slopes(file: Path) -> Floats:
    pd = import_module("pandas")
    table = pd.read_parquet(file, columns=["specimen", "dose_h", "resistance_K_per_W"])
    table["y"] = np.log(table["resistance_K_per_W"])
    by = table.groupby("specimen", sort=True)
    table["x"] = table["dose_h"] - by["dose_h"].transform("mean")
    table["xy"], table["xx"] = table["x"] * table["y"], table["x"] ** 2
    sums = table.groupby("specimen", sort=True)[["xy", "xx"]].sum()
    return np.asarray((sums["xy"] / sums["xx"]).to_numpy())


# What is asked about.


def _make(folder: Path, sessions: int, checks: int) -> Made:
    files, bins = [], []
    for i in range(sessions):
        degC = _oven(i)
        file = folder / f"s{i:06d}.parquet"
        _write(file, degC)
        files.append(file)
        values, counts = np.unique(np.round(degC / BIN_K).astype(np.int64), return_counts=True)
        bins.append((f"s{i:06d}", values * BIN_K, counts * STEP_H))
    histogram, fleet = folder / "hours.parquet", folder / "checks.parquet"
    names = pa.array(
        np.repeat([name for name, _, _ in bins], [v.size for _, v, _ in bins]).tolist()
    ).dictionary_encode()
    pq.write_table(
        pa.table(
            {
                "session": names,
                "degC": np.concatenate([v for _, v, _ in bins]),
                "hours": np.concatenate([h for *_, h in bins]),
            }
        ),
        histogram,
        compression="zstd",
        compression_level=1,
    )
    pq.write_table(_fleet(checks), fleet, compression="zstd", compression_level=1)
    connection = duckdb.connect(":memory:")
    spilled = f"temp_directory = '{folder / 'spilled'}'"
    for setting in (f"memory_limit = '{warehouse.MEMORY}'", f"threads = {THREADS}", spilled):
        connection.execute(f"SET {setting}")
    began, busy = time.perf_counter(), time.process_time()
    warehouse.fill(connection, {**_facts(files, fleet)})
    filled = Taken(time.perf_counter() - began, time.process_time() - busy)
    return Made(tuple(files), histogram, fleet, connection, filled)


def _oven(seed: int) -> Floats:
    """One session: up to about 230 degC, a soak of 12 h, down again; noise of 0.2 K, steps of 0.1 K."""
    random = np.random.default_rng(seed)
    s = np.arange(SESSION_ROWS)
    soak, up, down = random.uniform(220.0, 240.0), 7_200.0, 7_200.0 + 43_200.0
    rising = 25.0 + (soak - 25.0) * -np.expm1(-s / up * 3.0)
    falling = 25.0 + (rising[int(down)] - 25.0) * np.exp(-np.maximum(s - down, 0.0) / 9_000.0)
    return np.round(np.where(s < down, rising, falling) + 0.2 * random.standard_normal(s.size), 1)


def _write(file: Path, degC: Floats) -> None:
    t_ns = 1_760_000_000_000_000_000 + np.arange(degC.size) * 1_000_000_000
    writer = GroupWriter(file, file.stem, [Column("T_degC", "T", "degC", "temperature")])
    writer.add(Samples(t_ns, np.arange(degC.size), [degC]))
    writer.close()


def _fleet(checks: int) -> pa.Table:
    """Checks of 2,000 motors in order of time, as they come."""
    random = np.random.default_rng(0)
    motor = np.tile(np.arange(MOTORS), math.ceil(checks / MOTORS))[:checks]
    dose = np.repeat(np.arange(math.ceil(checks / MOTORS)) * 12.0, MOTORS)[:checks] + random.uniform(0.0, 1.0, checks)
    slope = 2e-4 * (1.0 + 0.3 * random.standard_normal(MOTORS))
    resistance = 0.02 * np.exp(slope[motor] * dose + 0.03 * random.standard_normal(checks))
    said: dict[str, Any] = {
        "session": pa.array([f"c{i}" for i in range(checks)]),
        "specimen": pa.array([f"M{i:04d}" for i in motor.tolist()]),
        "batch": pa.array([f"B{i % 20:02d}" for i in motor.tolist()]),
        "number": np.arange(checks) // MOTORS,
        "dose_h": dose,
        "resistance_K_per_W": resistance,
        "sd_K_per_W": 0.03 * resistance,
        "conductivity_percent": 100.0 * 0.02 / resistance,
    }
    kinds = {"VARCHAR": pa.string(), "BIGINT": pa.int64(), "DOUBLE": pa.float64(), "BOOLEAN": pa.bool_()}
    columns = {name: said.get(name, pa.nulls(checks, kinds[kind])) for name, kind in AGEING["ageing_checks"].items()}
    return pa.table(columns)


def _facts(files: Sequence[Path], checks: Path) -> dict[str, list[dict[str, Any]]]:
    """The rows of the warehouse's tables for these files: a decode and a session each, one assessment."""
    start, end = 1_760_000_000_000_000_000, 1_760_000_000_000_000_000 + SESSION_ROWS * 1_000_000_000
    rows: dict[str, list[dict[str, Any]]] = {"sessions": [], "session_files": [], "groups": [], "channels": []}
    for place, file in enumerate(files):
        own = {"decode": file.stem}
        rows["sessions"].append(
            {
                "session": file.stem,
                "place": place,
                "name": file.stem,
                "kind": "ageing",
                "specimen": file.stem,
                "absolute": True,
            }
            | {"start_ns": start, "end_ns": end}
        )
        rows["session_files"].append(
            own | {"session": file.stem, "raw": file.stem, "first_record": 0, "last_record": SESSION_ROWS}
        )
        rows["groups"].append(own | {"group_name": "rows", "file": str(file), "sha256": sha256_of(file)})
        rows["channels"].append(
            own
            | {"place": 0, "channel": "T", "group_name": "rows", "column_name": "T_degC", "quantity": "temperature"}
            | {"unit": "degC", "node": "winding", "region": "copper", "role": "observed", "derived": False}
        )
    rows["artefacts"] = [{"run": "a", "kind": "ageing_checks", "file": str(checks)}]
    return rows


if __name__ == "__main__":
    main()
