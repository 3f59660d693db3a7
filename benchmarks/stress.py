"""How surely discharge is told from heat and thermal cycles, on stators of the plant that go through voltage tests in
the oven.

    python benchmarks/stress.py [--seeds N] [--quick] [--json FILE]

A campaign: six stators, 16 cycles of 12 h, a check before the first and after each that repeats within 0.8 %; each
stator has a form of its own, half of which change without any discharge. In some cycles a test voltage is on for 8 h:
1,300 V, above the inception voltage of a new stator (980 V; it falls as the insulation wears, and an electrical check
before each cycle measures it to 2 %), or 700 V, below it. Discharge adds 0.3 per 100 h to ln of the resistance, or
nothing. Two plans of tests: `alike`, every stator in its first eight cycles; `crossed`, half of the stators in their
first eight, the others in their last eight.

Given are, over the campaigns: how often discharge is told from heat and cycles at all, and of these how often an effect
is seen (99 %), how often its interval of 95 % holds the hidden one, and its median sd in percent per 100 h. Hidden
nothing, `seen` is how often discharge is blamed for what it did not do.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path += [str(HERE.parent), str(HERE.parent / "tests")]

import numpy as np

from analytics.insulation.checks import repeatability
from analytics.insulation.courses import stress
from analytics.insulation.courses.stress import Stress
from benchmarks import asked
from plant import discharge, insulation_check, timeline
from plant.deterioration import OVEN_degC
from plant.timeline import Plan

PLAN = Plan(stators=6, cycles=16)
TEST_h, ABOVE_V, BELOW_V = 8.0, 1300.0, 700.0
SCATTER = 0.02  # of a measured inception voltage
ACTIVATION_eV = 1.0
HIDDEN_RATE = 0.3  # what 100 h of discharge add to ln R, where they do
PLANS = ("alike", "crossed")
SEEN_SD, INSIDE_SD = 2.576, 1.960


@dataclass(frozen=True)
class Rate:
    """Over campaigns: how many there were, in how many discharge was told from heat and cycles, of these in how many an
    effect was seen, and its interval held the hidden one; median sd [%/100 h]."""

    campaigns: int
    told: int
    seen: int
    inside: int
    sd_percent: float | None


def main() -> None:
    chosen = asked.parser(__doc__, seeds=(100, 2)).parse_args()
    answer = {
        f"{plan}, {'hidden' if rate else 'nothing'}": _rate(plan, rate, chosen.seeds)
        for plan in PLANS
        for rate in (HIDDEN_RATE, 0.0)
    }
    hidden = f"{100 * HIDDEN_RATE:g} % per 100 h where hidden"
    print(f"discharge beside heat and cycles, {chosen.seeds} campaigns each, {hidden}")
    for name, of in answer.items():
        sd = "-" if of.sd_percent is None else f"{of.sd_percent:.1f} % per 100 h"
        print(
            f"  {name:18} told apart in {of.told:4}, seen in {of.seen:4}, interval holds it in {of.inside:4}, sd {sd}"
        )
    asked.keep({name: vars(of) for name, of in answer.items()}, chosen.json)


def _rate(plan: str, rate: float, seeds: int) -> Rate:
    found = [one for seed in range(seeds) if not (one := _effect(seed, plan, rate)).not_told_from]
    effect = np.array([one.effect for one in found], np.float64)
    sd = np.array([one.sd for one in found], np.float64)
    return Rate(
        campaigns=seeds,
        told=len(found),
        seen=int((np.abs(effect) > SEEN_SD * sd).sum()),
        inside=int((np.abs(effect - rate / 100.0) < INSIDE_SD * sd).sum()),
        sd_percent=float(np.median(sd)) * 1e4 if found else None,
    )


def _effect(seed: int, plan: str, rate: float) -> Stress:
    """What the checks of a campaign say of discharge, per hour."""
    random = np.random.default_rng([seed, 91])
    names: list[str] = []
    columns: list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]] = []
    for place in range(PLAN.stators):
        course = timeline.course(seed, PLAN, place, ACTIVATION_eV)
        damage = np.cumsum([0.0, *(trace.damage_h(ACTIVATION_eV, OVEN_degC) for trace in course.traces)])
        alone = course.form.ln_factor(damage)
        early = np.arange(PLAN.cycles) < PLAN.cycles // 2
        tested = ~early if plan == "crossed" and place % 2 else early
        volts = np.where(tested, ABOVE_V, BELOW_V)
        true = np.cumsum([0.0, *discharge.hours(alone.tolist(), [(test_V, TEST_h) for test_V in volts], rate)])
        ln_r = alone + rate * true / 100.0
        inception = [insulation_check.inception_V(value) for value in ln_r[:-1]]
        measured = np.array(inception) * np.exp(SCATTER * random.standard_normal(PLAN.cycles))
        counted = np.cumsum([0.0, *np.where(volts > measured, TEST_h, 0.0)])
        seen = ln_r + PLAN.repeatability * random.standard_normal(len(ln_r))
        dose, cycles = np.cumsum([0.0, *course.hours_above]), np.arange(len(ln_r), dtype=np.float64)
        names += [course.name] * len(ln_r)
        columns.append(np.stack([seen, dose, cycles, counted]))
    seen, dose, cycles, counted = np.concatenate(columns, axis=1)
    sd = repeatability.estimate(names, dose, seen).of_checks(np.zeros(len(names)))
    return stress.effects(names, seen, sd, {"heat": dose, "thermal cycles": cycles, "discharge": counted})[2]


if __name__ == "__main__":
    main()
