"""Where two runs that were driven alike read differently, and whether that is more than sensors and repeats explain.

A motor whose laws did not change answers a warmer coolant, a larger load and a warmer start by temperatures between
bounds: each is a mean of what surrounds it, with weights that sum to 1, and a rise that follows its losses. A
difference of two runs is explained as far as it lies within these bounds, and exceeds the floor where it lies further
outside than the floor. The bounds are wide on purpose: what is called a
difference is none of what was driven differently.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.operating_points import COLUMNS, ROWS, round_edges
from ingest.catalogue.power import METERS
from ingest.morning.matching import LEAST_s, Matched, RunBlocks

SIGMAS = 2.0  # of the sensors' own uncertainty that a floor stands for
BIAS_K = 0.5  # one sigma, constant within a session: of a temperature of which no bench file says more
ANSWERS = (
    "torque",
    "power",
    "heat",
    *(f"{kind}{of}" for kind in ("current", "voltage") for of in ("", "_d", "_q", "_dc")),
)
"""Quantities that follow speed and load: where these differ within what counts as alike, so do they."""
ROOM_degC = 20.0  # what a motor rises over where nothing around it is recorded
FORGETS_s = 3600.0  # the time constant with which the slowest parts, rotor and housing, forget how warm they began
FOLLOWS: Mapping[str, float] = {"speed": 2.0, "torque": 2.0, "current": 2.0, "voltage_dc": 2.0, "flow": -1.0}
"""Quantity -> the steepest power of it that a temperature rise goes with: joule heat with the square of the current,
eddy currents with that of speed and voltage; a film becomes no better than in proportion to its flow."""

LEAST_RANGE = 10.0  # over which a channel must have moved for its offset to be called the same everywhere
SAME = 0.3  # of an offset, that it may differ by between cold, warm and the beginning
VERDICTS = ("exceeds", "explained", "within")

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CellDifference:
    """A cell of operating points: its edges by quantity ("speed": (low, high)), in stored units. `first`, `second`: the
    mean of each run there."""

    cell: Mapping[str, tuple[float, float]]
    minutes: float
    first: float
    second: float
    explained: tuple[float, float]

    @property
    def difference(self) -> float:
        return self.second - self.first

    @property
    def beyond(self) -> float:
        """How far the difference lies outside what is explained, signed; 0 within."""
        low, high = self.explained
        return self.difference - min(max(self.difference, low), high)


@dataclass(frozen=True)
class ChannelDifference:
    """One channel in both runs, second minus first, in `unit`: over all matched blocks and where it is furthest off.

    `floor`: SIGMAS of the sensors' uncertainty, or the largest difference between `repeats` earlier runs of the test
    where that is larger. `verdict`: "exceeds", "explained" by what was driven differently, or "within" the floor.
    """

    channel: str
    quantity: str
    unit: str | None
    place: str | None  # of the sensor
    first: float
    second: float
    difference: float
    worst: CellDifference
    floor: float
    repeats: int
    verdict: str  # one of VERDICTS
    around: bool  # a temperature of what surrounds the motor
    constant: bool  # whether it is off by the same where it is cold, where it is warm, and from the beginning on

    @property
    def off(self) -> float:
        """How far it is off in its worst place: beyond what is explained where that counts."""
        return self.worst.beyond if self.verdict == "exceeds" else self.worst.difference


def differences(
    first: Sequence[ChannelData],
    second: Sequence[ChannelData],
    runs: tuple[RunBlocks, RunBlocks],
    matched: Matched,
    earlier: Sequence[Mapping[str, float]] = (),
) -> list[ChannelDifference]:
    """Every channel that both runs hold, those that exceed their floor first, the furthest off before others.

    `earlier`: for each earlier run of the test, by channel, how far it lay beyond what is explained (`beyond_of`).
    """
    there = {one.spec.name: one for one in second}
    causes = _Causes.of(first, second, runs, matched)
    found: list[ChannelDifference] = []
    for one in first:
        if (other := there.get(one.spec.name)) and one.spec.role != "ignored" and one.spec.quantity:
            found += _difference(one, other, runs, matched, causes, [run.get(one.spec.name, 0.0) for run in earlier])
    return sorted(found, key=lambda one: (VERDICTS.index(one.verdict), -abs(one.off) / one.floor))


def beyond_of(found: Sequence[ChannelDifference]) -> dict[str, float]:
    """By channel, how far each lies beyond what is explained where it is furthest off."""
    return {one.channel: abs(one.worst.beyond) for one in found}


def is_around(channel: ChannelData) -> bool:
    """Whether a temperature is of what surrounds the motor, and not of the motor."""
    name = (channel.place or channel.spec.name).lower()
    given = channel.spec.role == "input" and channel.place is not None
    return channel.spec.quantity == "temperature" and (
        given or any(word in name for word in ("ambient", "cool", "oven"))
    )


def _difference(
    one: ChannelData,
    other: ChannelData,
    runs: tuple[RunBlocks, RunBlocks],
    matched: Matched,
    causes: _Causes,
    earlier: Sequence[float],
) -> Iterator[ChannelDifference]:
    name = one.spec.name
    a, b = runs[0].means[name][matched.first], runs[1].means[name][matched.second]
    known = np.isfinite(a) & np.isfinite(b)
    if known.sum() * matched.block_s < LEAST_s:
        return
    observed = one.spec.quantity == "temperature" and not is_around(one)
    low, high = causes.bounds(a) if observed else (np.zeros(len(a)), np.zeros(len(a)))
    if one.spec.quantity in ANSWERS and one.spec.quantity not in matched.by:
        low, high = -causes.slack * np.abs(a), causes.slack * np.abs(a)
    floor = max(_floor(one, other, float(np.nanmax(np.abs(runs[0].means[name])))), max(earlier, default=0.0))
    places = list(_places(runs[0], matched, known, (a, b, low, high)))
    worst, verdict = max(places, key=lambda place: abs(place.beyond)), "exceeds"
    if abs(worst.beyond) <= floor:
        worst = max(places, key=lambda place: abs(place.difference))
        verdict = "explained" if abs(worst.difference) > floor else "within"
    yield ChannelDifference(
        channel=name,
        quantity=one.spec.quantity,
        unit=one.unit,
        place=one.place,
        first=float(a[known].mean()),
        second=float(b[known].mean()),
        difference=float((b - a)[known].mean()),
        worst=worst,
        floor=floor,
        repeats=len(earlier),
        verdict=verdict,
        around=is_around(one),
        constant=_constant(a[known], (b - a)[known], int(LEAST_s / matched.block_s)),
    )


def _constant(value: Array, off: Array, early: int) -> bool:
    """Whether the coldest and the warmest quarter of `value` (P,) and the `early` first are off by the same, as a
    sensor is and no motor."""
    if np.ptp(value) < LEAST_RANGE:
        return False
    cold, warm = value <= np.quantile(value, 0.25), value >= np.quantile(value, 0.75)
    means = [float(part.mean()) for part in (off[cold], off[warm], off[:early])]
    return max(means) - min(means) < SAME * abs(float(np.mean(means)))


def _floor(one: ChannelData, other: ChannelData, largest: float) -> float:
    """SIGMAS of the difference of two sessions, of each of which the sensor's error is its own."""
    bias = [each.spec.bias_sd or (BIAS_K if each.spec.quantity == "temperature" else 0.0) for each in (one, other)]
    step = [(each.spec.resolution or 0.0) / np.sqrt(12.0) for each in (one, other)]
    own = SIGMAS * float(np.sqrt(np.sum(np.square(bias + step))))
    return max(own, 0.0 if one.spec.quantity == "temperature" else METERS * largest, 1e-9)


def _places(
    run: RunBlocks, matched: Matched, known: NDArray[np.bool_], courses: tuple[Array, Array, Array, Array]
) -> Iterator[CellDifference]:
    """The cells of operating points with LEAST_s of matched blocks, and all of them as one cell where none has;
    `courses` (P,): the first run, the second, and the least and greatest difference that is explained."""
    axes = [run.drive[name][matched.first] for name in matched.by]
    edges = [round_edges(axis, most) for axis, most in zip(axes, (COLUMNS, ROWS), strict=False)]
    number = np.zeros(len(known), np.int64)
    for axis, edge in zip(axes, edges, strict=True):
        number = number * (len(edge) + 1) + np.searchsorted(edge, axis)
    whole = CellDifference({}, known.sum() * matched.block_s / 60, *_means(courses, known))
    found = False
    for cell in np.unique(number[known]):
        here = known & (number == cell)
        if here.sum() * matched.block_s < LEAST_s:
            continue
        found, at = True, np.flatnonzero(here)[0]
        sides = {
            name: (float(edge[k - 1]), float(edge[k]))
            for name, axis, edge in zip(matched.by, axes, edges, strict=True)
            for k in [int(np.clip(np.searchsorted(edge, axis[at]), 1, len(edge) - 1))]
        }
        yield CellDifference(sides, here.sum() * matched.block_s / 60, *_means(courses, here))
    if not found:
        yield whole


def _means(
    courses: tuple[Array, Array, Array, Array], here: NDArray[np.bool_]
) -> tuple[float, float, tuple[float, float]]:
    first, second, low, high = (float(course[here].mean()) for course in courses)
    return first, second, (low, high)


@dataclass(frozen=True, eq=False)
class _Causes:
    """What two runs were driven by differently, at each pair of blocks (P,)."""

    around: tuple[Array, Array]  # least and greatest difference of what surrounds the motor, 0 among them [K]
    coolest: Array  # of what surrounds it, in the first run [degC]; NaN where it is not known
    powers: tuple[Array, Array]  # by which factor less 1 a rise may be smaller and larger
    slack: Array  # share by which what follows speed and load may differ with them
    starts: tuple[Array, Array]  # what is left of the least and greatest difference in which a stretch began [K]

    @classmethod
    def of(
        cls,
        first: Sequence[ChannelData],
        second: Sequence[ChannelData],
        runs: tuple[RunBlocks, RunBlocks],
        matched: Matched,
    ) -> _Causes:
        common = {one.spec.name for one in second}
        both = [one for one in first if one.spec.name in common and one.spec.role != "ignored"]
        around = [one.spec.name for one in both if is_around(one)]
        temperatures = [one.spec.name for one in both if one.spec.quantity == "temperature"]
        off = {name: _both(runs, matched, name) for name in [*around, *temperatures]}
        size = len(matched.first)
        changes = [b - a for a, b in (off[name] for name in around)]
        begun = np.array([_begun(matched, b - a) for a, b in (off[name] for name in temperatures)]).reshape(-1, size)
        left = np.exp(-matched.since_s / FORGETS_s)
        amps = any(one.spec.quantity == "current" for one in both)
        drives = [one for one in both if one.spec.quantity in FOLLOWS and not (one.spec.quantity == "torque" and amps)]
        powers = np.array([np.zeros(size), *(_power(runs, matched, one) for one in drives)])
        least, most = _hull(list(begun), size)
        return cls(
            _hull(changes, size),
            np.fmin.reduce([off[name][0] for name in around]) if around else np.full(size, np.nan),
            (np.minimum(powers, 0.0).sum(axis=0), np.maximum(powers, 0.0).sum(axis=0)),
            np.nan_to_num(np.sum([_slack(runs, matched, name) for name in matched.by], axis=0)),
            (least * left, most * left),
        )

    def bounds(self, first: Array) -> tuple[Array, Array]:
        """Between which a temperature that was `first` (P,) [degC] may differ (P,) each [K]."""
        rise = np.nan_to_num(np.maximum(first - np.where(np.isfinite(self.coolest), self.coolest, ROOM_degC), 0.0))
        low, high = (self.around[side] + rise * self.powers[side] + self.starts[side] for side in (0, 1))
        return low, high


def _both(runs: tuple[RunBlocks, RunBlocks], matched: Matched, name: str) -> tuple[Array, Array]:
    return runs[0].means[name][matched.first], runs[1].means[name][matched.second]


def _hull(some: Sequence[Array], size: int) -> tuple[Array, Array]:
    """The least and the greatest of several (size,), 0 among them; what is not known is left out."""
    known = np.nan_to_num(np.array([*some, np.zeros(size)]))
    return known.min(axis=0), known.max(axis=0)


def _begun(matched: Matched, off: Array) -> Array:
    """For each pair of blocks the difference that its stretch began with (P,), in the mean of LEAST_s; NaN without."""
    early = np.isfinite(off) & (matched.since_s < LEAST_s)
    count = np.bincount(matched.stretch, early)
    total = np.bincount(matched.stretch, np.where(early, off, 0.0))
    return np.asarray(np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)[matched.stretch])


def _slack(runs: tuple[RunBlocks, RunBlocks], matched: Matched, name: str) -> Array:
    """Twice the share by which a quantity of the drive differs (P,): power goes with both, and heat with a square."""
    a, b = runs[0].drive[name][matched.first], runs[1].drive[name][matched.second]
    return np.asarray(2.0 * np.abs(b - a) / np.maximum(np.abs(a), 0.05 * np.nanmax(np.abs(a), initial=1e-9)))


def _power(runs: tuple[RunBlocks, RunBlocks], matched: Matched, one: ChannelData) -> Array:
    """By which factor less 1 a rise may have changed with this quantity, (P,); 0 at rest, where it brings no heat.

    A motor's temperatures follow the losses of the time before: the factor is that of all matched blocks up to each.
    """
    a, b = (np.abs(values) for values in _both(runs, matched, one.spec.name))
    driven = np.isfinite(a) & np.isfinite(b) & (a > 0.05 * np.nanmax(a, initial=0.0)) & (b > 0.0)
    before, after = (np.cumsum(np.where(driven, values, 0.0) ** 2) for values in (a, b))
    ratio = np.sqrt(np.divide(after, before, out=np.ones(len(a)), where=before > 0))
    return np.asarray(ratio ** FOLLOWS[one.spec.quantity] - 1.0)
