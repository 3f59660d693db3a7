"""The next bench day: the test that tells most an hour, then given that the next, and what to observe besides then.

What a set of tests tells is the expected information on the candidates' sizes: sum of w ln(1 + J sigma^2) / 2 [nat],
with the prior masses w of `twin.diagnosis.evidence` and v'P v = J of all tests together. The chain is greedy, among the
tests that tell most an hour by themselves.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import reduce
from heapq import nlargest

import numpy as np

from twin.diagnosis.evidence import prior_masses
from twin.diagnosis.next_tests import Proposed
from twin.errors import DivergedError, PlanError
from twin.fitting.model import Floats, Test
from twin.motor.outputs import BLOCK_S
from twin.motor.sensor import Sensor
from twin.planning.courses import MINUTES, REST_MIN, BenchRange, blocks, courses, cut, joined, rest
from twin.planning.detectable import Prospect
from twin.planning.gathered import Gathered, Untried, sensor_parameters
from twin.planning.limits import Heated, first_over, heated, watched
from twin.planning.observed import observing

Tell = Callable[[str], None]

RESTS_MIN = (REST_MIN, 40, 60, 120)  # between tests: the first with which no limit is crossed
WORTH_nat = 0.01  # what tells less is not proposed
LEADING = 40  # tests that the chain is made of
OBSERVED = 5
RUNS_AWAY = "the model runs away"


@dataclass(frozen=True)
class Wanted:
    """What is asked for: prior sd (m,) of the candidates and their weights (m,), sum 1."""

    sigma: Floats
    weight: Floats

    @classmethod
    def of(cls, found: Prospect, only: Collection[str]) -> Wanted:
        """`only`: ids of the candidates that count; all where it is empty. Raises `PlanError` where one is none."""
        ids = [str(candidate.cause) for candidate in found.candidates]
        if strange := sorted(set(only) - set(ids)):
            near = difflib.get_close_matches(strange[0], ids, n=1, cutoff=0.6)
            nearest = f"; the nearest is {near[0]}" if near else ""
            raise PlanError(f"{strange[0]}: no candidate of this motor and bench that moves a reading{nearest}")
        masses = prior_masses([candidate.cause for candidate in found.candidates])
        weight = np.where([not only or one in only for one in ids], masses, 0.0)
        sigma = np.array([parameter.sd for parameter in found.ground.candidates])
        return cls(sigma, weight / weight.sum())

    def d(self, gathered: Gathered) -> Floats:
        """d (m,) of their prior sizes."""
        found: Floats = np.sqrt(gathered.information()) * self.sigma
        return found

    def worth(self, d: Floats) -> float:
        """What is told of them [nat] where their prior sizes have d (m,)."""
        return float(self.weight @ np.log1p(d**2)) / 2

    def told(self, gathered: Gathered) -> float:
        """What is told of them [nat]."""
        return self.worth(self.d(gathered))


@dataclass(frozen=True)
class DayStep:
    """A test of the day: what it adds to all before it [nat], and in how many hours with the rest before it."""

    proposed: Proposed
    gain_nat: float
    hours: float


@dataclass(frozen=True)
class ObservedStep:
    """One thing more to observe over the whole day, as a sensor at a `node`: what it adds to all before it [nat]."""

    what: str
    node: str | None
    gain_nat: float


@dataclass(frozen=True)
class Best:
    """For each candidate (m,) `what` raises d of its prior size most, and that `d`."""

    what: tuple[str, ...]
    d: Floats

    @classmethod
    def of(cls, each: Mapping[str, Floats], at_least: Floats) -> Best:
        """The best of `each` that raises d, by name; "" where none raises it above `at_least`."""
        names = ["", *each]
        ds = np.array([at_least * (1 + 1e-6), *each.values()])
        place = ds.argmax(axis=0)
        return cls(tuple(names[i] for i in place), ds.max(axis=0))


@dataclass(frozen=True)
class Promise:
    """What a day promises of each candidate (m,): d of its prior size `before` the day and `after` it; with the one
    test that shows it best, beside the recorded ones, with the one thing more to observe that shows it best, beside the
    day, and where all of them are observed. `since_before`: without the day, where the recorded tests had been run once
    before it came."""

    before: Floats
    after: Floats
    best_test: Best
    best_observed: Best
    all_observed: Floats
    since_before: Floats


@dataclass(frozen=True)
class Day:
    """The next bench day: its tests, one `course` of all with `rest_min` between them, how hot that becomes, what it
    promises, and what to observe besides would add most to it. `weighed`: how many tests were compared; `refused`: what
    cannot be run, and for which node's limit."""

    steps: tuple[DayStep, ...]
    course: Proposed
    rest_min: int
    heated: Heated
    promise: Promise
    observed: tuple[ObservedStep, ...]
    weighed: int
    refused: tuple[tuple[str, str], ...]


def plan_day(found: Prospect, hours: float, only: Collection[str], tell: Tell, beyond: Sequence[Sensor] = ()) -> Day:
    """The tests that tell most an hour, in the order in which they do, within so many hours. `beyond`: thermometers
    that are there and were not read. Raises `PlanError` where no test can be run or none tells anything."""
    base = found.ground.fit.model
    wanted, bench = Wanted.of(found, only), BenchRange.of(base.network, base.tests)
    tell("weighing tests")
    if hours < (least := _hours(blocks(MINUTES[0]))):
        raise PlanError(
            f"{hours:g} h are too few for a test of {MINUTES[0]} min and {REST_MIN} min of rest: "
            f"give {np.ceil(100 * least) / 100:g} h or more"
        )
    weighing = _Weighing(found, wanted, bench, hours)
    if not weighing.count:
        raise PlanError(_why_none(weighing.refused))
    steps = weighing.chain()
    if not steps:
        raise PlanError(f"no test of the menu tells anything new in {hours:g} h: give more hours, or more sensors")
    tell("running the whole day")
    course, rest_min, untried, hot = _within_limits(found, bench, steps)
    known = found.ground.known
    (told,) = untried.would_tell([len(course.speed)])
    before, after = wanted.d(known), wanted.d(known + told)
    tell("weighing what else could be observed")
    observing = _Observing(found, wanted, bench.test(course), told, beyond)
    promise = Promise(
        before,
        after,
        Best.of(weighing.alone(), before),
        Best.of(observing.alone, after),
        observing.together,
        wanted.d(found.ground.since_before),
    )
    return Day(steps, course, rest_min, hot, promise, observing.steps(), weighing.count, tuple(weighing.refused))


@dataclass(frozen=True)
class _Weighed:
    """A test at that of its `lengths` at which it tells most an hour (`rate`): what it `gathered`, and d (m,) of the
    candidates with it beside the recorded ones. `lengths`: how many cross no limit."""

    rate: float
    proposed: Proposed
    gathered: Gathered
    d: Floats
    lengths: int


class _Weighing:
    """What each test of the menu tells an hour beside the recorded ones, at the length at which that is most; the
    longest fits the day, too."""

    def __init__(self, found: Prospect, wanted: Wanted, bench: BenchRange, hours: float) -> None:
        self.found, self.wanted, self.bench, self.hours = found, wanted, bench, hours
        self.lengths = [n for n in map(blocks, MINUTES) if _hours(n) <= hours]
        self.known = found.ground.known
        self.told = wanted.told(self.known)
        self.leading, self.count, self.refused = list[_Weighed](), 0, list[tuple[str, str]]()
        menu = list(courses(bench))
        with ThreadPoolExecutor(2) as pool:
            for course, one in zip(menu, pool.map(self._weigh, menu), strict=True):
                if isinstance(one, str):
                    self.refused.append((course.words, one))
                else:
                    self.count += one.lengths
                    self.leading = nlargest(LEADING, [*self.leading, one], key=lambda one: one.rate)

    def _weigh(self, course: Proposed) -> _Weighed | str:
        """A course at the length at which it tells most an hour, one march for its limits and all lengths; or why it
        can be run at none."""
        untried = _untried(self.found, self.bench, cut(course, self.lengths[-1]))
        try:
            over = first_over(self.found.limits, untried)
        except DivergedError:
            return RUNS_AWAY
        lengths = [n for n in self.lengths if over is None or n <= over[0]]
        if over and not lengths:
            return _over(self.found, *over)
        told = untried.would_tell(lengths)
        ds = [self.wanted.d(self.known + more) for more in told]
        rates = [(self.wanted.worth(d) - self.told) / _hours(n) for d, n in zip(ds, lengths, strict=True)]
        best = int(np.argmax(rates))
        return _Weighed(rates[best], cut(course, lengths[best]), told[best], ds[best], len(lengths))

    def alone(self) -> Mapping[str, Floats]:
        """Each leading test in words -> d (m,) with it beside the recorded ones."""
        return {one.proposed.words: one.d for one in self.leading}

    def chain(self) -> tuple[DayStep, ...]:
        """The best of the leading tests, the best given that one, and so on; one may be run again."""
        steps: list[DayStep] = []
        known, told, ds = self.known, self.told, {i: one.d for i, one in enumerate(self.leading)}
        hours = [_hours(len(one.proposed.speed)) for one in self.leading]
        while True:
            left = self.hours - sum(step.hours for step in steps)
            gains = {i: self.wanted.worth(d) - told for i, d in ds.items() if hours[i] <= left}
            best = max(gains, key=lambda i: gains[i] / hours[i], default=None)
            if best is None or gains[best] < WORTH_nat:
                return tuple(steps)
            known, told = known + self.leading[best].gathered, told + gains[best]
            steps.append(DayStep(self.leading[best].proposed, gains[best], hours[best]))
            ds = {i: self.wanted.d(known + self.leading[i].gathered) for i in gains if hours[i] <= left - hours[best]}


def _hours(length: int) -> float:
    """Bench time of a test of so many blocks, with the rest after it."""
    return length * BLOCK_S / 3600 + REST_MIN / 60


def _over(found: Prospect, block: int, node: int) -> str:
    """Which limit is crossed when."""
    limit, minutes = found.limits.degC[node], block * BLOCK_S / 60
    name = found.limits.nodes[node].replace("_", " ")
    return f"the {name} may be above its {limit:.0f} °C after {minutes:.0f} min"


def _why_none(refused: Sequence[tuple[str, str]]) -> str:
    words, why = refused[0]
    return (
        f"no test of {MINUTES[0]} min stays below the limits: {words}: {why}. A higher limit_degC, colder coolant, or "
        "recorded sessions at smaller loads would relax it"
    )


def _untried(found: Prospect, bench: BenchRange, course: Proposed) -> Untried:
    """A course, the limited nodes watched."""
    return found.ground.untried(replace(bench.test(course), supposed=watched(found.limits.nodes, len(course.speed))))


def _within_limits(
    found: Prospect, bench: BenchRange, steps: Sequence[DayStep]
) -> tuple[Proposed, int, Untried, Heated]:
    """The whole day with the shortest rests at which no limit is crossed: its course, the rests [min], the course as a
    test, and how hot that becomes."""
    why = ""
    for minutes in RESTS_MIN:
        course = joined([part for step in steps for part in (step.proposed, rest(minutes))])
        untried = _untried(found, bench, course)
        try:
            hot = heated(found.limits, untried)
        except DivergedError:
            why = RUNS_AWAY
            continue
        over = hot.first_over()
        if over is None:
            return course, minutes, untried, hot
        why = _over(found, *over)
    raise PlanError(
        f"{why} even with rests of {RESTS_MIN[-1]} min: fewer hours, colder coolant or a higher limit_degC "
        "would relax it"
    )


class _Observing:
    """What each thing more to observe over the whole day tells, beside the recorded tests and the day."""

    def __init__(self, found: Prospect, wanted: Wanted, test: Test, told: Gathered, beyond: Sequence[Sensor]) -> None:
        base = found.ground.fit.model
        more = observing(base.network, test, base.tests, beyond)
        self.wanted, self.known = wanted, found.ground.known + told
        self.nodes = {channel.name: channel.sensor.node for channel in more.channels}
        self.left = found.ground.untried(more, sensor_parameters(base, more)).each_would_tell()
        self.alone = {what: wanted.d(self.known + one) for what, one in self.left.items()}
        self.together = wanted.d(reduce(Gathered.__add__, self.left.values(), self.known))

    def steps(self) -> tuple[ObservedStep, ...]:
        """What tells most, given that what tells most besides, and so on."""
        steps: list[ObservedStep] = []
        known, left, ds = self.known, dict(self.left), dict(self.alone)
        so_far = self.wanted.told(known)
        while left and len(steps) < OBSERVED:
            gains = {what: self.wanted.worth(d) - so_far for what, d in ds.items()}
            what = max(gains, key=lambda one: gains[one])
            if gains[what] < WORTH_nat:
                break
            known, so_far = known + left.pop(what), so_far + gains[what]
            steps.append(ObservedStep(what, self.nodes.get(what), gains[what]))
            ds = {other: self.wanted.d(known + one) for other, one in left.items()}
        return tuple(steps)
