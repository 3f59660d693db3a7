"""A fleet whose insulation ages: tables of checks that were evaluated elsewhere, checks of many motors as arrays.

ln R of a motor is its start + its rate x dose; a check reads it with the error of its day, whose tails are Student's,
and with the step of a sensor that was exchanged. Motors of a batch share a little of start and rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

FIRST_DAY = datetime(2024, 1, 8, 8, tzinfo=UTC)


@dataclass(frozen=True)
class Population:
    """What motors are like. Starts and errors: standard deviations of ln R; rates: change of ln R per 100 h of dose."""

    start_K_per_W: float = 0.0213
    start_sd: float = 0.06
    rate: float = 0.03
    rate_sd: float = 0.012
    batch_start_sd: float = 0.01
    batch_rate_sd: float = 0.002
    bad_batch_rate: float = 0.05  # more than the others
    bad_motor_rate: float = 0.12
    repeatability: float = 0.03
    tails: float = 5.0  # degrees of freedom of the errors; infinite: normal
    step_sd: float = 0.06  # of an exchanged sensor


@dataclass(frozen=True)
class Checks:
    """Rows of checks, motor by motor and in the order of time. `motor` (N,) is a place among the motors."""

    motor: NDArray[np.int32]
    dose_h: Floats
    resistance_K_per_W: Floats
    day: Floats  # since the first
    arrived: Floats  # day on which it was handed in

    def some(self, rows: Flags | Ints) -> Checks:
        """Those of these rows."""
        return Checks(
            self.motor[rows], self.dose_h[rows], self.resistance_K_per_W[rows], self.day[rows], self.arrived[rows]
        )


@dataclass(frozen=True)
class Fleet:
    """What is true of each motor (M,). `stepped`: the first check after its sensor was exchanged, the number of its
    checks where it never was; `step`: what that changed ln R by. `checks`: what was measured."""

    serial: tuple[str, ...]
    batch: tuple[str, ...]
    start: Floats
    rate: Floats
    stepped: Ints
    step: Floats
    bad_motors: tuple[str, ...]
    bad_batches: tuple[str, ...]
    population: Population
    checks: Checks

    @property
    def true_resistance_K_per_W(self) -> Floats:
        """Resistance [K/W] at each row of the checks, without errors."""
        rows = self.checks
        return np.exp(self.start[rows.motor] + self.rate[rows.motor] * rows.dose_h / 100.0)

    def dose_at(self, factor: float) -> Floats:
        """Dose [h] at which R of each motor is `factor` times its start (M,); infinite where it never gets worse."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.where(self.rate > 0.0, 100.0 * np.log(factor) / np.maximum(self.rate, 0.0), np.inf))


def fleet(
    seed: int,
    motors: int = 2000,
    cycles: int | tuple[int, int] = 500,
    *,
    batches: int = 20,
    bad_batches: int = 0,
    bad_motors: int = 0,
    missing: float = 0.05,
    exchanged: float = 0.03,
    late: float = 0.05,
    hours_a_cycle: float = 0.6,
    population: Population | None = None,
) -> Fleet:
    """Motors and a check after each cycle, as arrays. `cycles`: of every motor, or the fewest and the most;
    `missing`, `late`: shares of checks that were not made and that were handed in weeks after; `exchanged`: share of
    motors whose sensor was exchanged. A million rows take a second."""
    people = population or Population()
    random = np.random.default_rng([seed, 51])
    counts = np.full(motors, cycles) if isinstance(cycles, int) else random.integers(cycles[0], cycles[1] + 1, motors)
    of_batch = np.sort(random.integers(batches, size=motors))
    some_batches = random.permutation(batches)[:bad_batches]
    others = np.flatnonzero(~np.isin(of_batch, some_batches))
    some_motors = random.permutation(others)[:bad_motors]
    start = np.log(people.start_K_per_W) + people.start_sd * random.standard_normal(motors)
    start += people.batch_start_sd * random.standard_normal(batches)[of_batch]
    rate = people.rate + people.rate_sd * random.standard_normal(motors)
    rate += people.batch_rate_sd * random.standard_normal(batches)[of_batch]
    rate[np.isin(of_batch, some_batches)] += people.bad_batch_rate
    rate[some_motors] += people.bad_motor_rate
    is_stepped = random.random(motors) < exchanged
    stepped = np.where(is_stepped, (counts * random.uniform(0.2, 0.8, motors)).astype(np.int64), counts)
    step = np.where(is_stepped, people.step_sd * random.standard_normal(motors), 0.0)

    motor = np.repeat(np.arange(motors, dtype=np.int32), counts)
    number = np.arange(len(motor)) - np.repeat(np.cumsum(counts) - counts, counts)
    hours = np.where(number == 0, 0.0, hours_a_cycle * random.gamma(9.0, 1.0 / 9.0, len(motor)))
    dose = sums_by_motor(hours, counts)
    days = sums_by_motor(
        np.where(number == 0, random.integers(0, 60, motors)[motor], random.uniform(1, 4, len(motor))), counts
    )
    true = start[motor] + rate[motor] * dose / 100.0 + np.where(number >= stepped[motor], step[motor], 0.0)
    read = np.exp(true + people.repeatability * _errors(random, len(motor), people.tails))
    kept = random.random(len(motor)) >= missing
    arrived = days + np.where(random.random(len(motor)) < late, random.gamma(4.0, 15.0, len(motor)), 0.0)
    checks = Checks(motor, dose, read, days, arrived).some(kept)
    serials = tuple(f"M{k + 1:04d}" for k in range(motors))
    names = tuple(f"B{k + 1:02d}" for k in range(batches))
    return Fleet(
        serials, tuple(names[k] for k in of_batch), start, rate, stepped, step,
        tuple(sorted(serials[k] for k in some_motors)), tuple(sorted(names[k] for k in some_batches)), people, checks,
    )  # fmt: skip


def sums_by_motor(values: Floats, counts: Ints) -> Floats:
    """Running sums of values within each motor; the first `counts[0]` are the first motor's, and so on."""
    total = np.cumsum(values)
    before = np.concatenate([[0.0], total])[np.cumsum(counts) - counts]
    return np.asarray(total - np.repeat(before, counts))


def _errors(random: np.random.Generator, size: int, tails: float) -> Floats:
    """Errors of standard deviation 1. Raises ValueError where the tails have none."""
    if tails <= 2.0:
        raise ValueError("Student's errors have a standard deviation from above 2 degrees of freedom on")
    if np.isinf(tails):
        return random.standard_normal(size)
    return np.asarray(random.standard_t(tails, size) * np.sqrt((tails - 2.0) / tails))


# ---- a table of evaluated checks -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class WrittenChecks:
    """A fleet and the files that hold its checks, in the order in which they arrived."""

    truth: Fleet
    tables: tuple[Path, ...]
    bench: Path

    @property
    def ingest(self) -> list[list[str]]:
        """The words of each command that takes the tables in."""
        return [["ingest", str(path), "--bench", str(self.bench)] for path in self.tables]


def write_checks(
    folder: Path,
    seed: int,
    motors: int = 400,
    checks: tuple[int, int] = (3, 21),
    *,
    batches: int = 8,
    bad_batches: int = 0,
    bad_motors: int = 0,
    missing: float = 0.03,
    exchanged: float = 0.0,
    late: float = 0.0,
    dates: bool = False,
    hours_a_cycle: float = 12.0,
    population: Population | None = None,
) -> WrittenChecks:
    """Write `checks.csv` (serial, batch, hours of dose, K/W; rows in no order), `checks_late.csv` with the rows that
    were handed in later, where `late` makes any, and `bench.toml`. `checks`: fewest and most of a motor. `dates`: a
    column with the day of the check; without, rows have no time of their own."""
    truth = fleet(
        seed, motors, checks, batches=batches, bad_batches=bad_batches, bad_motors=bad_motors, missing=missing,
        exchanged=exchanged, late=late, hours_a_cycle=hours_a_cycle, population=population,
    )  # fmt: skip
    random = np.random.default_rng([seed, 52])
    order = random.permutation(len(truth.checks.motor))
    is_late = (truth.checks.arrived > truth.checks.day)[order]
    folder.mkdir(parents=True, exist_ok=True)
    bench = folder / "bench.toml"
    bench.write_text(checks_bench(dates), encoding="utf-8")
    tables = []
    for name, rows in (("checks.csv", order[~is_late]), ("checks_late.csv", order[is_late])):
        if len(rows):
            tables.append(folder / name)
            tables[-1].write_text(_table(truth, truth.checks.some(rows), dates), encoding="utf-8")
    return WrittenChecks(truth, tuple(tables), bench)


def checks_bench(dates: bool) -> str:
    """The bench file of the tables."""
    time = 'column = "date"\nformat = "%Y-%m-%d %H:%M"\nzone = "UTC"\n' if dates else "rate_hz = 1.0\n"
    return (
        'schema = "whyhot.bench/1"\nspecimen_column = "serial"\nbatch_column = "batch"\nkind = "dc_check"\n\n[time]\n'
        + time
        + '\n[[channel]]\nsignal = "dose_h"\nquantity = "dose"\nunit = "h"\n'
        + '\n[[channel]]\nsignal = "R_th"\nquantity = "thermal_resistance"\nunit = "K/W"\n'
    )


def _table(truth: Fleet, rows: Checks, dates: bool) -> str:
    lines = ["serial,batch,dose_h,R_th" + ",date" * dates]
    columns = (rows.motor.tolist(), rows.dose_h.tolist(), rows.resistance_K_per_W.tolist(), rows.day.tolist())
    for motor, dose, resistance, day in zip(*columns, strict=True):
        when = f",{FIRST_DAY + timedelta(days=day):%Y-%m-%d %H:%M}" if dates else ""
        lines.append(f"{truth.serial[motor]},{truth.batch[motor]},{dose:.2f},{resistance:.6f}{when}")
    return "\n".join([*lines, ""])
