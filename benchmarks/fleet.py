"""Fleets of `tests/plant`, fresh seeds: what is listed where something is hidden and where nothing is, and whether
remaining dose lies in its interval.

    python benchmarks/fleet.py [--seeds N] [--first SEED] [--quick] [--json FILE]

A trial is a fleet of 400 motors in eight batches with 3 to 21 checks each (errors of 3 % with the tails of Student's
with five degrees of freedom, 3 % of the checks missing), once as it is, once with a bad batch, once with five bad
motors, and each with 3 % of the sensors exchanged; further rows change one thing each. A bad motor with few checks
cannot be told: `ceiling` is the share that a test would list that knows the fleet's rates and errors exactly, at the
same rate of false discoveries.

Campaigns: six stators in two batches, 17 checks, of random forms (a quarter of them none) and 0.8 % repeatability.
Remaining dose to half the conductivity: how often the true one is below, in, and above the interval of 95 %.
Large: 2,000 motors of 500 checks, one fit and one assessment. Rates with Clopper-Pearson bounds of 95 %.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from threadpoolctl import threadpool_limits

from analytics.insulation.fleet import mixed
from analytics.insulation.fleet.outlying import FleetAssessment, assess
from analytics.insulation.fleet.remaining import remaining
from benchmarks import asked
from benchmarks.shared import clopper_pearson
from plant.deterioration import FORMS, Faster, draw
from plant.fleet import Fleet, Population, fleet

Floats = NDArray[np.float64]

SD = 0.03
INSULATION_SHARE = 0.6
STATOR_SD, STATORS, CYCLES = 0.008, 6, 16
BAD_RATE = 0.35  # per 100 h, of a bad batch of stators


@dataclass(frozen=True)
class Kind:
    name: str
    bad_batches: int = 0
    bad_motors: int = 0
    exchanged: float = 0.0
    checks: tuple[int, int] = (3, 21)
    population: Population | None = None
    skewed: bool = False  # rates are log-normal instead of normal, with the same mean and twice the spread


KINDS = (
    Kind("healthy"),
    Kind("a bad batch", bad_batches=1),
    Kind("five bad motors", bad_motors=5),
    Kind("five bad motors and a bad batch", bad_batches=1, bad_motors=5),
    Kind("healthy, sensors exchanged", exchanged=0.03),
    Kind("a bad batch, sensors exchanged", bad_batches=1, exchanged=0.03),
    Kind("five bad motors, sensors exchanged", bad_motors=5, exchanged=0.03),
    Kind("healthy, batches differ three times as much", population=Population(batch_rate_sd=0.006)),
    Kind("a batch 0.02 / 100 h worse", bad_batches=1, population=Population(bad_batch_rate=0.02)),
    Kind("healthy, tails of three degrees", population=Population(tails=3.0)),
    Kind("healthy, rates log-normal", skewed=True),
)


def share(found: int, of: int) -> str:
    if not of:
        return "-"
    low, high = clopper_pearson(found, of)
    return f"{found:4}/{of:<4} ({100 * low:.0f}-{100 * high:.0f} %)"


def made(kind: Kind, seed: int, motors: int) -> tuple[Fleet, Floats]:
    """The fleet, and ln R of its checks."""
    one = fleet(
        seed, motors, kind.checks, batches=8, hours_a_cycle=12.0, missing=0.03, exchanged=kind.exchanged,
        bad_batches=kind.bad_batches, bad_motors=kind.bad_motors, population=kind.population,
    )  # fmt: skip
    y = np.log(one.checks.resistance_K_per_W)
    if kind.skewed:
        people = one.population
        spread = np.sqrt(np.log1p((2.0 * people.rate_sd / people.rate) ** 2))
        drawn = np.random.default_rng([seed, 81]).lognormal(-(spread**2) / 2, spread, len(one.rate))
        y = y + ((people.rate * drawn - one.rate) / 100.0)[one.checks.motor] * one.checks.dose_h
    return one, y


def judged(one: Fleet, y: Floats) -> FleetAssessment:
    motors = one.checks.motor
    return assess([one.serial[m] for m in motors], [one.batch[m] for m in motors], one.checks.dose_h, y, SD)


def ceiling(one: Fleet) -> int:
    """Bad motors that a test of known rates and normal errors would list."""
    rows, people = one.checks, one.population
    count = np.bincount(rows.motor, minlength=len(one.serial))
    mean = np.bincount(rows.motor, rows.dose_h, len(one.serial)) / count.clip(1)
    square = np.bincount(rows.motor, (rows.dose_h - mean[rows.motor]) ** 2, len(one.serial))
    error = 100.0 * people.repeatability / np.sqrt(square.clip(1e-9))
    z = people.bad_motor_rate / np.hypot(people.rate_sd, error)
    limit = norm.isf(0.05 * max(len(one.bad_motors), 1) / len(one.serial))
    return int(sum(z[one.serial.index(name)] > limit for name in one.bad_motors))


def fleets(kind: Kind, seeds: range, motors_each: int) -> dict[str, object]:
    false_motors = false_batches = motors = batches = could = listed = 0
    shares, spent = [], 0.0
    for seed in seeds:
        one, y = made(kind, seed, motors_each)
        began = time.process_time()
        found = judged(one, y)
        spent += time.process_time() - began
        specimens = {s.specimen for s in found.specimens if s.outlying}
        of_batches = {b.batch for b in found.batches if b.outlying}
        wrong = specimens - set(one.bad_motors)
        false_motors += bool(wrong)
        false_batches += bool(of_batches - set(one.bad_batches))
        motors += len(specimens & set(one.bad_motors))
        batches += len(of_batches & set(one.bad_batches))
        listed += len(specimens)
        shares.append(len(wrong) / max(len(specimens), 1))
        could += ceiling(one)
    n = len(seeds)
    row: dict[str, object] = {
        "fleet": kind.name,
        "with a false motor": share(false_motors, n),
        "with a false batch": share(false_batches, n),
        "false share of listed motors": f"{np.mean(shares):.3f}",
        "bad motors found": share(motors, n * kind.bad_motors),
        "ceiling": could if kind.bad_motors else "-",
        "bad batches found": share(batches, n * kind.bad_batches),
        "s": f"{spent / n:.2f}",
    }
    print("; ".join(f"{key}: {value}" if key != "fleet" else f"{value}" for key, value in row.items()), flush=True)
    return row


def campaign(seed: int, bad: bool) -> FleetAssessment:
    random = np.random.default_rng([seed, 82])
    who, batch, dose, y = [], [], [], []
    for k in range(STATORS):
        doses = np.concatenate([[0.0], np.cumsum(12.0 + 0.2 * random.standard_normal(CYCLES))])
        form = draw(str(random.choice(FORMS[:4])), random, float(doses[-1]), 12.0)
        hidden = Faster(form, BAD_RATE) if bad and 2 * k >= STATORS else form
        true = np.log(1.0 - INSULATION_SHARE + INSULATION_SHARE * np.exp(hidden.ln_factor(doses)))
        who += [f"S{k + 1:02d}"] * len(doses)
        batch += [f"B{1 + (2 * k >= STATORS)}"] * len(doses)
        dose += doses.tolist()
        y += (true + STATOR_SD * random.standard_normal(len(doses))).tolist()
    return assess(who, batch, dose, y, STATOR_SD)


def campaigns(seeds: range) -> dict[str, object]:
    healthy, bad = [campaign(seed, False) for seed in seeds], [campaign(seed, True) for seed in seeds]
    n = len(seeds)
    row: dict[str, object] = {
        "healthy: with a false batch": share(sum(any(b.outlying for b in a.batches) for a in healthy), n),
        "with a false stator": share(sum(any(s.outlying for s in a.specimens) for a in healthy), n),
        "bad batch: found": share(sum([b.batch for b in a.batches if b.outlying] == ["B2"] for a in bad), n),
        "with a stator beside it": share(sum(any(s.outlying for s in a.specimens) for a in bad), n),
    }
    print("six stators:", "; ".join(f"{key}: {value}" for key, value in row.items()), flush=True)
    return row


def lives(name: str, seeds: range, make: Callable[[int], Fleet]) -> dict[str, object]:
    below = above = total = without = 0
    widths = []
    for seed in seeds:
        one = make(seed)
        rows = one.checks
        found = remaining(
            [one.serial[m] for m in rows.motor], [one.batch[m] for m in rows.motor], rows.dose_h,
            np.log(rows.resistance_K_per_W), SD,
        )  # fmt: skip
        true = dict(zip(one.serial, one.dose_at(2.0), strict=True))
        for life in found:
            low, high = life.end_ci95_dose_h
            below += true[life.specimen] < (np.inf if low is None else low)
            above += high is not None and true[life.specimen] > high
            without += high is None
            total += 1
            if low is not None and high is not None:
                widths.append(high / low)
    row: dict[str, object] = {
        "fleet": name,
        "motors": total,
        "inside": f"{1.0 - (below + above) / total:.3f}",
        "ends before": f"{below / total:.3f}",
        "ends after": f"{above / total:.3f}",
        "no upper end": f"{without / total:.3f}",
        "median upper / lower": f"{np.median(widths):.2f}",
    }
    print("remaining dose:", "; ".join(f"{key}: {value}" for key, value in row.items()), flush=True)
    return row


def large(motors: int, checks: int) -> dict[str, object]:
    one = fleet(0, motors, checks, bad_batches=1, bad_motors=5)
    rows = one.checks
    y = np.log(one.checks.resistance_K_per_W)
    batch = np.unique(one.batch, return_inverse=True)[1]
    began = time.process_time()
    fit = mixed.fit(rows.motor, rows.dose_h, y, SD, batch=batch)
    fitted = time.process_time() - began
    began = time.process_time()
    found = judged(one, y)
    row: dict[str, object] = {
        "rows": len(y),
        "fit s": f"{fitted:.1f}",
        "slope": f"{1e4 * fit.fixed[1]:.2f}",
        "assessment s": f"{time.process_time() - began:.1f}",
        "batches": sorted(b.batch for b in found.batches if b.outlying) == sorted(one.bad_batches),
        "motors": sorted(s.specimen for s in found.specimens if s.outlying) == list(one.bad_motors),
    }
    print(
        f"{motors:,} motors of {checks} checks:", "; ".join(f"{key}: {value}" for key, value in row.items()), flush=True
    )
    return row


def main() -> None:
    words = asked.parser(__doc__, seeds=(100, 1), first=(0, 0)).parse_args()
    motors, checks = (48, 20) if words.quick else (400, 500)
    seeds, few = range(words.first, words.first + words.seeds), range(words.first, words.first + -(-words.seeds // 5))
    with threadpool_limits(1):
        answer = {
            "fleets": [fleets(kind, seeds, motors) for kind in KINDS],
            "six stators": campaigns(seeds),
            "remaining": [
                lives(f"{motors} motors", few, lambda seed: made(Kind(""), seed, motors)[0]),
                lives(
                    f"{motors} motors, a bad batch", few, lambda seed: made(Kind("", bad_batches=1), seed, motors)[0]
                ),
                lives(
                    "12 motors",
                    seeds,
                    lambda seed: fleet(seed, 12, (3, 21), batches=2, hours_a_cycle=12.0, exchanged=0.0),
                ),
            ],
            "large": large(5 * motors, checks),
        }
    asked.keep(answer, words.json)


if __name__ == "__main__":
    main()
