"""A campaign of WLTP sessions of a motor of 21 nodes, replayed with filter and smoother: sessions a second, and where
the time goes.

One session is ingested as any is: a drive like the WLTP at 10 Hz, with six thermometers that read a run of the
reference motor. The others are made from it through the library: facts of their own, their samples links to its.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.integrator import (
    AMBIENT_DEGC,
    COOLANT_DEGC,
    EXAMPLES,
    RATE_HZ,
    best_of,
    frame,
    initial_of,
    motor,
    wltp_like,
)
from benchmarks.shared import stored
from benchmarks.store import add_like
from ingest.facts import facts
from ingest.facts.store import Store
from ingest.units.each import Workers, processes
from replay.engine.results.kernel_cache import load_kernel
from replay.engine.runs import campaign, open_loop_run, runs
from replay.engine.runs.campaign import replay_sessions
from twin.run.side_by_side import simulate_all
from twin.run.simulate import simulate

Floats = NDArray[np.float64]

MOTOR = "reference_motor"
START = np.datetime64("2025-10-09T08:00:00", "ms")
STEP_S = 0.5
THERMOMETERS = ("winding_a", "endwinding_a_inner", "endwinding_b_outer", "teeth", "yoke", "magnet")
NOISE_K = 0.1
LANES, ROUNDS = 8, 5
PARTS: Mapping[str, tuple[tuple[ModuleType, str], ...]] = {
    "read": ((facts, "at"), (runs, "of_specimen"), (runs, "load"), (open_loop_run, "session_frame")),
    "run": ((open_loop_run, "_simulated"),),
    "filter": ((runs, "filter_session"),),
    "write": (
        (runs, "_tables"),
        (runs, "filtered_table"),
        (runs, "to_parquet"),
        (runs, "_written"),
        (campaign, "_append"),
    ),
}  # which functions are which part of a replay: none is called by another one of them


def wltp_campaign(folder: Path, sessions: int, seconds: int) -> dict[str, object]:
    """The figures of so many sessions of so many seconds each."""
    folder.mkdir()
    log = write_session(folder, seconds)
    with stored(folder, [log]) as store:
        (first,) = facts.at(store.ledger).sessions
        add_like(store, first, range(1, sessions))
        place = store.folder
    replayed(place, 1, None)  # compiles
    with timed() as spent:
        alone, wall_s, busy_s = replayed(place, sessions, None)
    two, two_s, _ = replayed(place, sessions, processes(2))
    kernel_s, lanes_s = kernels(seconds)
    figures = {
        "a_second_on_one_core": sessions / wall_s,
        "a_second_on_two_cores": sessions / two_s,
        "busy_ms": 1e3 * busy_s / sessions,
        **{f"{part}_share": spent_s / busy_s for part, spent_s in spent.items()},
        "other_share": 1.0 - sum(spent.values()) / busy_s,
        "kernel_ms": 1e3 * kernel_s,
        "kernel_in_lanes_ms": 1e3 * lanes_s,
        "lanes_would_save": (kernel_s - lanes_s) * sessions / busy_s,
    }
    equal = {"sessions": sessions, "equal_on_two_cores": two == alone}
    return {f"wltp_{name}": value for name, value in {**equal, **_rounded(figures)}.items()}


def _rounded(figures: Mapping[str, float]) -> dict[str, object]:
    return {name: float(f"{value:.3g}") for name, value in figures.items()}


def replayed(place: Path, count: int, workers: Workers | None) -> tuple[list[str], float, float]:
    """Digests of the first sessions, seconds by the clock and of the processor. Raises RuntimeError where one is
    refused."""
    with Store.open(place, write=True) as store:
        some = facts.at(store.ledger).sessions[:count]
        began, busy = time.perf_counter(), time.process_time()
        outcomes = replay_sessions(store, some, None, "testing", workers)
        wall_s, busy_s = time.perf_counter() - began, time.process_time() - busy
    if refused := [one.refusal for one in outcomes if one.refusal]:
        raise RuntimeError(refused[0])
    return [one.run.digest for one in outcomes if one.run], wall_s, busy_s


@contextmanager
def timed() -> Iterator[dict[str, float]]:
    """Processor seconds of each part of the replays in here."""
    spent = dict.fromkeys(PARTS, 0.0)

    def counted(part: str, function: Callable[..., Any], *given: Any, **named: Any) -> Any:
        began = time.process_time()
        try:
            return function(*given, **named)
        finally:
            spent[part] += time.process_time() - began

    with ExitStack() as until:
        for part, functions in PARTS.items():
            for module, name in functions:
                until.enter_context(patch.object(module, name, partial(counted, part, getattr(module, name))))
        yield spent


def kernels(seconds: int) -> tuple[float, float]:
    """Processor seconds of an open loop alone, and of one of `LANES` side by side."""
    network = motor(MOTOR)
    compiled, inputs = load_kernel(network), frame(network, drive_of(seconds), STEP_S)
    start = initial_of(network)
    best = best_of(
        ROUNDS,
        {
            "alone": lambda: simulate(compiled, inputs, start),
            "lanes": lambda: simulate_all(compiled, [inputs] * LANES, [start] * LANES),
        },
        time.process_time,
    )
    return best["alone"], best["lanes"] / LANES


def drive_of(seconds: int) -> dict[str, Floats]:
    """The beginning of a drive like the WLTP."""
    return {name: course[: seconds * RATE_HZ] for name, course in wltp_like().items()}


def write_session(folder: Path, seconds: int) -> Path:
    """Motor file, bench file and the log of one session."""
    network, drive = motor(MOTOR), drive_of(seconds)
    (folder / "motor.toml").write_bytes((EXAMPLES / MOTOR / "motor.toml").read_bytes())
    inputs = frame(network, drive, STEP_S)
    truth = simulate(load_kernel(network), inputs, initial_of(network))
    t_s = np.arange(len(drive["speed"])) / RATE_HZ
    nodes, random = [node.name for node in network.nodes], np.random.default_rng(1)
    columns = {
        "speed": network.scale["speed"] * drive["speed"],
        "current": network.scale["current"] * drive["current"],
        "flow": np.full(t_s.size, network.scale["flow"]),
        "coolant": np.full(t_s.size, COOLANT_DEGC),
        "ambient": np.full(t_s.size, AMBIENT_DEGC),
    }
    for node in THERMOMETERS:
        course = np.interp(t_s, np.arange(len(truth)) * STEP_S, truth[:, nodes.index(node)])
        columns[node] = course + NOISE_K * random.standard_normal(t_s.size)
    units = {"speed": ("speed", "rpm"), "current": ("current", "A"), "flow": ("flow", "l/min")}
    lines = ['schema = "whyhot.bench/1"', 'motor = "motor.toml"', 'kind = "wltp"', "[time]", 'column = "time"']
    for name in columns:
        quantity, unit = units.get(name, ("temperature", "degC"))
        lines += ["[[channel]]", f'signal = "{name}"', f'quantity = "{quantity}"', f'unit = "{unit}"']
        lines += [f'node = "{name}"'] if name not in units else []
    (folder / "bench.toml").write_text("\n".join(lines) + "\n")
    stamps = START + (1000 * t_s).astype("timedelta64[ms]")
    rows = np.stack(list(columns.values()), axis=1).round(3).tolist()
    log = folder / "log0.csv"
    with log.open("w") as to:
        print("time", *columns, sep=",", file=to)
        for stamp, row in zip(stamps, rows, strict=True):
            print(stamp, *row, sep=",", file=to)
    return log
