"""Why a cause stays silent: the catalogue of `tests/plant` in three sessions, and what would show it better.

    python benchmarks/why_silent.py [--motors N] [--first SEED] [--hours H] [--quick] [--json FILE]

Healthy motors are run through three sessions (S1, S2, WLTP), and `whyhot plan` says of each effect of the catalogue how
far it stands out at its first size: d now, with the day that is proposed, with the one test that shows it best, with
the one thing more to observe that shows it best beside the day (a thermocouple, power, the coolant's heat, the
winding's resistance at rest, the flux without load), with all of these together, and, without the day, where the same
sessions had been run once before it came. Medians over the motors; of tests and observations, the most frequent. Last,
what a plan takes, the fit of the sessions included: processor time over the number of tests weighed, as a multiple of
one simulation of an hour of the motor at its step of 0.5 s.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from benchmarks.plan_power import amplitude, arguments, parser, planned, recorded, same
from plant import Effect, Plant
from plant.effects import CATALOGUE
from replay.engine.files.motor_file import read_motor
from replay.engine.results.kernel_cache import load
from twin.compiled.integrators import DEFAULT
from twin.compiled.kernel import compile_indexed
from twin.motor.configured import configured
from twin.motor.features import monomials
from twin.run.simulate import Frame, simulate

SILENT, SHOWS = 3.0, 5.0  # d


@dataclass(frozen=True)
class Row:
    """An effect: d now, with the day, and with the best test and observation; "" where nothing helps."""

    cause: str
    size: float
    now: float
    day: float
    test: str
    with_test: float
    observed: str
    with_observed: float
    all_observed: float
    since_before: float


def main() -> None:
    """Plan for the motors; print and write the table."""
    args = arguments(parser(__doc__, motors=(5, 1), first=(4100, 4100)))
    plans, took = [], []
    for seed in range(args.first, args.first + args.motors):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            sessions = recorded(folder, Plant(seed), args)
            began = time.process_time()
            plans.append(planned(folder, sessions, args))
            took.append(time.process_time() - began)
            simulation_s = simulated(folder / "before" / "motor.toml")
    rows = [row for hidden in CATALOGUE if (row := of(hidden.effects()[0], plans)) is not None]
    print("\n".join(table(rows)))
    tests = sum(plan["tests_weighed"] for plan in plans)
    print(
        f"a plan: {tests / len(plans):.0f} tests weighed in {np.mean(took):.0f} s of processor time, one in "
        f"{sum(took) / tests:.3f} s: {sum(took) / tests / simulation_s:.0f} simulations of an hour; "
        f"in a minute {60 * tests / sum(took):.0f}"
    )
    asked.keep([asdict(row) for row in rows], args.json)


def simulated(motor_file: Path) -> float:
    """Processor time [s] of an hour of a motor in its own step, the best of five."""
    network = configured(read_motor(motor_file.read_bytes(), motor_file.name), None)
    steps = round(3600.0 / DEFAULT.step_s)
    frame = Frame(
        DEFAULT.step_s,
        np.full((steps, len(monomials(network))), 0.3),
        np.full((steps, len(network.boundaries)), 60.0),
    )
    run, best = compile_indexed(network, load=load), np.inf
    for _ in range(5):
        began = time.process_time()
        simulate(run, frame, np.full(len(network.nodes), 60.0))
        best = min(best, time.process_time() - began)
    return float(best)


def of(effect: Effect, plans: Sequence[Mapping[str, Any]]) -> Row | None:
    """An effect over the plans; None where it is no candidate of theirs."""
    own = [one for plan in plans for one in plan["candidates"] if same(one["id"], effect.cause)]
    if not own:
        return None
    size = abs(amplitude(effect))

    def median(values: Sequence[tuple[Mapping[str, Any], float]]) -> float:
        return float(np.median([size * d / one["usual_amplitude"] for one, d in values]))

    now = median([(one, one["usual_d"]) for one in own])
    day = median([(one, one["usual_d_after"]) for one in own])
    best = [(one, one["best_test"] or {"what": "", "usual_d": one["usual_d"]}) for one in own]
    seen = [(one, one["best_observation"] or {"what": "", "usual_d": one["usual_d_after"]}) for one in own]
    return Row(
        effect.cause,
        effect.size,
        now,
        day,
        _most([what["what"] for _, what in best]),
        median([(one, what["usual_d"]) for one, what in best]),
        _most([what["what"] for _, what in seen]),
        median([(one, what["usual_d"]) for one, what in seen]),
        median([(one, one["usual_d_all_observed"]) for one in own]),
        median([(one, one["usual_d_since_before"]) for one in own]),
    )


def _most(words: Sequence[str]) -> str:
    return Counter(word.split(" at ")[0] if word.startswith("S") else word for word in words).most_common(1)[0][0]


def table(rows: Sequence[Row]) -> list[str]:
    """The effects that are silent now, those that nothing shows last."""
    head = f"{'effect':<44} {'size':>7} {'now':>5} {'day':>5} {'test':>5} {'observed':>8} {'all':>5} {'before':>6}"
    lines = [f"{head}  what to observe; which test"]
    silent = sorted((row for row in rows if row.now < SILENT), key=lambda row: -max(row.day, row.with_observed))
    for row in silent:
        d = f"{row.now:>5.1f} {row.day:>5.1f} {row.with_test:>5.1f} {row.with_observed:>8.1f} {row.all_observed:>5.1f}"
        by = f"{row.observed or '-'}; {row.test or '-'}"
        lines.append(f"{row.cause:<44} {row.size:>7g} {d} {row.since_before:>6.1f}  {by}")
    one = sum(max(row.day, row.with_observed) >= SHOWS for row in silent)
    every = sum(row.all_observed >= SHOWS for row in silent)
    since = sum(row.since_before >= SHOWS for row in silent)
    now = f"silent now: {len(silent)} of {len(rows)}"
    lines.append(f"{now}; shown by the day or one observation: {one}, by all together: {every}")
    lines.append(f"shown where the same sessions were run before it came: {since}")
    return lines


if __name__ == "__main__":
    main()
