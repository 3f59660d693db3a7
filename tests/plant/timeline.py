"""What a campaign plans and when it happens: oven cycles, and a DC check before the first and after each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from plant import oven
from plant.bare_stator import Rig
from plant.deterioration import FORMS, Faster, Form, OVEN_degC, draw

Floats = NDArray[np.float64]

FIRST_CHECK = datetime(2025, 10, 13, 6, tzinfo=UTC)
CHECK_HOUR = 8.0  # local time
OVEN_AFTER_h, COLD_AFTER_h = 9.0, 2.0  # from a check to the oven, from the end of the oven's log to a check
BATCHES = ("B1", "B2")


@dataclass(frozen=True)
class Plan:
    """What a campaign does and hides.

    forms: of deterioration.FORMS, one for each stator, taken in turn; drawn where left out. bad_batch: the second
    half of the stators, batch B2, ages by `bad_rate` per 100 h on top. repeatability: standard deviation of ln R of a
    check. repeats: more checks before the first cycle, two on each day. darkening: 1 as surfaces in an oven do, 0 not
    at all. swing_K: of the room over a day. early_stops, dead: shares of the checks whose log ends early, and in
    which a thermocouple fails. oven_degC: one for each cycle, in turn. breaks: share of the cycles in which the oven
    fails and is switched on again. oven_sensors: without, an oven log holds the oven alone. electrical: with checks
    of the insulation. activation_eV: drawn from 0.9 to 1.1 where left out. test_V, test_h: rms voltage on the winding
    in each cycle, in turn, and for how long, each stator `test_shift` cycles further on; none where left out.
    discharge_rate: what 100 h of it above the inception voltage add to ln of the resistance.
    """

    stators: int = 6
    cycles: int = 16
    forms: Sequence[str] | None = None
    bad_batch: bool = False
    bad_rate: float = 0.35
    iron: bool = True
    repeatability: float = 0.008
    repeats: int = 0
    darkening: float = 1.0
    swing_K: float = 2.5
    early_stops: float = 0.1
    dead: float = 0.05
    oven_degC: Sequence[float] = (OVEN_degC,)
    soak_h: float = 12.0
    last_soak_h: float | None = None
    breaks: float = 0.0
    cycles_a_log: int = 1
    oven_sensors: bool = True
    electrical: bool = True
    check_style: str = "english"
    oven_style: str = "german"
    period_s: float = 10.0
    activation_eV: float | None = None
    rig: Rig = field(default_factory=Rig)
    configuration: str | None = None
    test_V: Sequence[float] = ()
    test_h: Sequence[float] = (4.0,)
    test_shift: int = 0
    discharge_rate: float = 0.0

    def tests(self, place: int) -> list[tuple[float, float]]:
        """Voltage and hours of each cycle of the stator at `place`; empty without voltage tests."""
        at = [cycle + place * self.test_shift for cycle in range(self.cycles)] if self.test_V else []
        return [(self.test_V[k % len(self.test_V)], self.test_h[k % len(self.test_h)]) for k in at]


# Twenty cycles of 12 h and one of 60 h, thermocouples in the winding heads only.
PAPER = Plan(
    stators=1, cycles=21, last_soak_h=60.0, forms=("paper",), iron=False,
    repeatability=0.02, repeats=3, early_stops=0.0, dead=0.0,
)  # fmt: skip


@dataclass(frozen=True)
class Course:
    """A stator's way through the ovens. `done`: cycles before each check; `checks`, `ovens`: when each starts."""

    name: str
    batch: str
    form: Form
    traces: tuple[oven.Trace, ...]
    done: NDArray[np.int64]
    checks: tuple[datetime, ...]
    ovens: tuple[datetime, ...]

    @property
    def hours_above(self) -> list[float]:
        """Hours of the copper above 180 degC in each cycle."""
        return [trace.hours_above() for trace in self.traces]

    def before_checks(self, cycles: Sequence[float]) -> Floats:
        """What the cycles before each check add up to."""
        return np.concatenate([[0.0], np.cumsum(cycles)])[self.done]


def course(seed: int, plan: Plan, place: int, activation_eV: float) -> Course:
    """The course of the stator at `place`; stators follow each other on one rig."""
    random = np.random.default_rng([seed, 62, place])
    between, copper, iron = np.exp(0.1 * random.standard_normal(3)).tolist()
    traces = tuple(
        oven.run(random, [_soak(random, plan, cycle)], stator=(between, copper, iron)) for cycle in range(plan.cycles)
    )
    damages = [trace.damage_h(activation_eV, OVEN_degC) for trace in traces]
    names = plan.forms or FORMS[:4]
    drawn = int(random.integers(len(names)))
    form = draw(names[place % len(names) if plan.forms else drawn], random, sum(damages), float(np.median(damages)))
    second = 2 * place >= plan.stators
    done, checks, ovens = _when(plan, place, traces)
    if plan.bad_batch and second:
        form = Faster(form, plan.bad_rate)
    return Course(f"S{place + 1:02d}", BATCHES[second], form, traces, done, checks, ovens)


def _soak(random: np.random.Generator, plan: Plan, cycle: int) -> oven.Soak:
    hours = plan.soak_h if plan.last_soak_h is None or cycle < plan.cycles - 1 else plan.last_soak_h
    offset, room = float(random.normal(0.0, 2.0)), float(random.normal(22.0, 1.5))
    fails, fails_at = bool(random.random() < plan.breaks), float(random.uniform(0.3, 0.7)) * hours
    degC = plan.oven_degC[cycle % len(plan.oven_degC)]
    return oven.Soak(degC, hours, offset_K=offset, room_degC=room, break_h=fails_at if fails else None)


def _when(
    plan: Plan, place: int, traces: Sequence[oven.Trace]
) -> tuple[NDArray[np.int64], tuple[datetime, ...], tuple[datetime, ...]]:
    now = FIRST_CHECK + timedelta(days=(2 * plan.cycles + plan.repeats + 5) * place)
    done, checks, ovens = [], [], []
    for repeat in range(plan.repeats):
        done.append(0)
        checks.append(now)
        now += timedelta(hours=7 if repeat % 2 == 0 else 17)
    for cycle in range(plan.cycles + 1):
        done.append(cycle)
        checks.append(now)
        if cycle < plan.cycles:
            ovens.append(now + timedelta(hours=OVEN_AFTER_h))
            cold = OVEN_AFTER_h + float(traces[cycle].t_s[-1]) / 3600.0 + COLD_AFTER_h
            now += timedelta(days=int(np.ceil(cold / 24.0)))
    return np.array(done), tuple(checks), tuple(ovens)
