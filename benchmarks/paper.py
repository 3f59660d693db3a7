"""What the paper found on its bench, found again on motors of the independent truth.

    python benchmarks/paper.py [--seeds N] [--first SEED] [--quick] [--json FILE]

"Identification and Update of Thermal Models in Digital Twins of ePowertrain Motors", sections 3.1 and 4.2. What the
paper's numbers were off by is set for every motor of `tests/plant`, before anything is calibrated or filtered, by the
same rule:

- The first guess is too cold on a WLTC by as much as the paper's was off: the hottest endwinding by 5 K (calibration
  made it 3 K better, and under 2 K stayed), the magnets by 16 K (10 K better, about 6 K stayed). Each of its
  conductances is off by 35 % and each of its losses by 10 % (one standard deviation), all conductances besides by one
  factor, which sets the endwinding, as where a motor was scaled from another one; and it lacks a magnet loss, which
  sets the magnets.
- The filter's open loop is too cold by 6 K at the magnets: the motor, calibrated from a guess that lacks no magnet
  loss, has by as much more.

The motor is calibrated on two S1 points and an S2; no WLTC is learnt from. What each thermocouple was then found to
read too much, the mean of these sessions, goes into the bench file as a correction; the bench file also says where
between two nodes the rotor surface's is glued, as the design has it. A lump cannot say that magnets are hotter in the
middle of the stack than at its ends: the same is done with the rotor cut into three slices. Filters read endwindings A
and B and the rotor's surface and estimate the magnets' loss, as a heat or as a factor of what the model says; the
magnet sensor is kept. A statement is met where the worst of the motors meets it, else by how many it is met is printed.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from threadpoolctl import threadpool_limits

from benchmarks import asked
from benchmarks.filters import (
    CUT,
    PLACED,
    ROTOR,
    SEEN,
    SETTLE_S,
    SLICES,
    STEPS_MIN,
    STEPS_RPM,
    STEPS_W,
    Case,
    Form,
    case_of,
    delays,
    estimates,
    paced,
    with_network,
)
from benchmarks.shared import of_each, stored
from ingest.facts import facts
from plant import Effect, Plant, drives, points, sessions
from plant.drives import Drive
from plant.geometry import Geometry
from plant.thermocouples import SENSORS
from replay.engine.files.motor_text import written
from replay.engine.results.open_loop import modelled
from replay.studies.characterise.calibrate import calibrate_sessions
from twin.filters.smoother import smoothed
from twin.filters.unknowns import Unknown, UnknownFactor
from twin.motor.network import Network, Term
from twin.motor.slicing import sliced
from twin.run.simulate import source_heat

Floats = NDArray[np.float64]

GUESS_MAGNET_K, GUESS_HOT_SPOT_K = 10.0 + 6.0, 3.0 + 2.0  # what calibration won in the paper, and what stayed
OPEN_LOOP_K = 6.0  # the calibrated motor's magnets, before the filter
LINKS_SD, LOSSES_SD = 0.35, 0.1  # of the logarithm of what a first guess's coefficients are off by
FACTOR_BOUND = float(np.log(4.0))  # of the factor of all conductances
ENOUGH_K = 0.1  # of the errors that are set
ENDWINDINGS, MAGNET = ("EW_A_inner", "EW_B_inner"), "MAG"
FACTOR_SD, FACTOR_WALK = 0.7, 0.015  # of the magnets' loss: to a factor of two; the walk is sought about this
MAGNETS = ("magnet_1", "magnet", "magnet_3")
AS_FACTOR = ("EKF, as a factor", "smoother, as a factor")
IN_SLICES = tuple(f"{way}, rotor in slices" for way in AS_FACTOR)
WAYS = ("EKF", "UKF", "paper's form", "smoother", *AS_FACTOR, *IN_SLICES)


@dataclass(frozen=True)
class Statement:
    """A sentence of the paper with its bound: what is measured of every motor, and whether it must be under or over the
    bound."""

    says: str
    bound: float
    unit: str
    under: bool
    values: tuple[float, ...]

    @property
    def met(self) -> int:
        return sum(value < self.bound if self.under else value >= self.bound for value in self.values)

    def line(self) -> str:
        count = len(self.values)
        ended = "met" if self.met == count else f"met by {self.met} of {count}"
        worst = max(self.values) if self.under else min(self.values)
        bound = f"{'<' if self.under else '>='} {self.bound:g} {self.unit}"
        return f"{self.says:<67}{bound:>10}{float(np.median(self.values)):>9.1f}{worst:>9.1f}   {ended}"


def statements(of_motor: Sequence[dict[str, float]]) -> list[Statement]:
    """Every statement over motors, by what `measured` says of each."""

    def of(says: str, key: str, bound: float, unit: str = "K", under: bool = True) -> Statement:
        return Statement(says, bound, unit, under, tuple(one[key] for one in of_motor))

    result = []
    for way in WAYS:
        result += [
            of(f"{way}: magnets, mean error", f"{way} magnet mean", 1.6),
            of(f"{way}: magnets, largest error", f"{way} magnet largest", 6.0),
            of(f"{way}: endwindings, mean error", f"{way} endwinding mean", 2.0),
            of(f"{way}: endwindings, largest error", f"{way} endwinding largest", 8.0),
        ]
    return [
        *result,
        *(of(f"{way}: the loss is late by", f"{way} delay", 3.0, "s") for way in WAYS if f"{way} delay" in of_motor[0]),
        of("calibration: hottest endwinding, mean error falls by", "endwinding gain", 3.0, under=False),
        of("calibration: magnets, mean error falls by", "magnet gain", 10.0, under=False),
    ]


def measured(seed: int, cycles: int, longest_s: float) -> dict[str, float]:
    """Of one motor: what calibration gains, errors of the open loop and of every filter, delays of the loss that they
    find; of drives that end after `longest_s`."""
    with threadpool_limits(1, user_api="blas"):
        guess, lacked_W = first_guess(seed, longest_s)
        found, motor = calibrated(seed, guess, lacked_W, longest_s).gains, calibrated(seed, guess, 0.0, longest_s)
        cycle = wrong_by_the_paper_s(motor, cycles)
        found |= errors_by_way(cycle, {**estimates(cycle, paced(cycle)), **as_factor(cycle, paced_factor(cycle))})
        cut = calibrated(seed, sliced(guess, ROTOR, SLICES, Geometry().stack), 0.0, longest_s, CUT)
        profiled = wrong_by_the_paper_s(cut, cycles)
        by_factor = as_factor(profiled, paced_factor(profiled)).items()
        found |= errors_by_way(profiled, {f"{way}, rotor in slices": given for way, given in by_factor})
        return {**found, **late_s(motor)}


def errors_by_way(case: Case, ways: Mapping[str, tuple[Floats, Floats]]) -> dict[str, float]:
    """Mean and largest errors at magnets and endwindings."""
    found = {}
    for way, (edges, _) in ways.items():
        found[f"{way} magnet mean"], found[f"{way} magnet largest"] = errors_K(case, edges, (MAGNET,))
        found[f"{way} endwinding mean"], found[f"{way} endwinding largest"] = errors_K(case, edges, ENDWINDINGS)
    return found


def late_s(motor: Calibrated) -> dict[str, float]:
    """How late each way finds a loss that steps [s]."""
    ladder = drives.join("ladder", "s1", [drives.hold(rpm, 40.0, STEPS_MIN) for rpm in STEPS_RPM])
    ill, healthy = (motor.case(ladder, more_W) for more_W in (STEPS_W, 0.0))
    heat, factor = paced(ill), paced_factor(ill)
    given = [{**as_heat(case, heat), **as_factor(case, factor)} for case in (ill, healthy)]
    found = {}
    for way, (edges, watts) in given[0].items():
        late = delays(ill, edges, watts, given[1][way][1])[1]
        assert late is not None
        found[f"{way} delay"] = abs(late)
    return found


def as_heat(case: Case, heat: Sequence[Unknown]) -> dict[str, tuple[Floats, Floats]]:
    """As `estimates`, of the extended filter and the smoother."""
    both = smoothed(case.network, case.inputs, case.start, heat, case.channels)
    filtered = both.filtered
    return {"EKF": (filtered.temperatures, filtered.found[1:, 0]), "smoother": (both.temperatures, both.found[:-1, 0])}


def as_factor(case: Case, factor: Sequence[Unknown]) -> dict[str, tuple[Floats, Floats]]:
    """The same where what multiplies the model's magnet loss, in all slices alike, is unknown; the loss [W] is what
    that adds."""
    both = smoothed(case.network, case.inputs, case.start, factor, case.channels)
    at = [i for i, source in enumerate(case.network.sources) if source.node in MAGNETS]

    def added(edges: Floats, found: Floats) -> Floats:
        watts: Floats = source_heat(case.network, case.inputs, edges)[:, at].sum(axis=1) * np.expm1(found)
        return watts

    edges, filtered = both.temperatures, both.filtered
    return {
        "EKF, as a factor": (filtered.temperatures, added(filtered.temperatures, filtered.found[1:, 0])),
        "smoother, as a factor": (edges, added(edges, both.found[:-1, 0])),
    }


def paced_factor(case: Case) -> list[Unknown]:
    """As `paced`, of what multiplies the magnets' loss."""
    first, *others = (f"loss.{node.name}.scale" for node in case.network.nodes if node.name in MAGNETS)
    return paced(case, UnknownFactor(first, FACTOR_SD, FACTOR_WALK, tuple(others)))


def errors_K(case: Case, edges: Floats, channels: Sequence[str]) -> tuple[float, float]:
    """Mean and largest error of these channels after the start; of the mean the larger one."""
    errors = [np.abs(off_K(case, edges, channel)) for channel in channels]
    return max(float(e.mean()) for e in errors), max(float(e.max()) for e in errors)


def off_K(case: Case, edges: Floats, channel: str) -> Floats:
    """Measured less estimated of a channel's good samples after the start."""
    nodes = tuple(node.name for node in case.network.nodes)
    (o,) = (o for o in case.recorded.observations if o.sensor.name == channel)
    use = o.good & case.recorded.live
    use[: round(SETTLE_S / case.inputs.step_s)] = False
    off: Floats = (o.measured - modelled(o, case.recorded, edges, nodes))[use]
    return off


# --- How far off ------------------------------------------------------------------------------------------------------


def too_cold_by(wanted_K: float, case_with: Callable[[float], Case], between_W: tuple[float, float]) -> float:
    """The hidden magnet loss [W at 16,000 rpm] with which the open loop's magnets are too cold by so much on average:
    by secants."""

    def off(hidden_W: float) -> float:
        case = case_with(hidden_W)
        return float(off_K(case, case.open_loop, MAGNET).mean()) - wanted_K

    (a, b), (at_a, at_b) = between_W, (off(between_W[0]), off(between_W[1]))
    while abs(at_b) > ENOUGH_K:
        a, b, at_a = b, b - at_b * (b - a) / (at_b - at_a), at_b
        at_b = off(b)
    return b


def wrong_by_the_paper_s(motor: Calibrated, cycles: int) -> Case:
    """WLTC cycles with so much hidden magnet loss that the calibrated motor's open loop is off by the paper's error."""
    cycle = partial(motor.case, drives.wltp(cycles))
    return cycle(too_cold_by(OPEN_LOOP_K, cycle, (100.0, 300.0)))


def first_guess(seed: int, longest_s: float = math.inf) -> tuple[Network, float]:
    """The motor file's numbers before anything was measured, and the magnet loss that they lack for the paper's
    error."""
    drive = drives.wltp(1).first(longest_s)
    cycle = case_of(seed, drive, 0.0, form=PLACED)
    hottest, guess = hot_spot(cycle), drawn(cycle.network, np.random.default_rng(seed))

    def too_cold(log_factor: float) -> float:
        case = with_network(cycle.recorded, conducting(guess, float(np.exp(log_factor))))
        return float(off_K(case, case.open_loop, hottest).mean()) - GUESS_HOT_SPOT_K

    network = conducting(guess, float(np.exp(brentq(too_cold, -FACTOR_BOUND, FACTOR_BOUND, xtol=0.001))))

    def lacking(hidden_W: float) -> Case:
        return case_of(seed, drive, hidden_W, network, form=PLACED)

    return network, too_cold_by(GUESS_MAGNET_K, lacking, (0.0, 600.0))


def conducting(network: Network, factor: float) -> Network:
    """All conductances times a factor."""

    def times(terms: tuple[Term, ...]) -> tuple[Term, ...]:
        return tuple(replace(t, coefficient=t.coefficient * factor) for t in terms)

    return replace(network, links=tuple(replace(link, terms=times(link.terms)) for link in network.links))


def drawn(network: Network, rng: np.random.Generator) -> Network:
    """Every conductance and loss off by its own factor."""

    def off(terms: tuple[Term, ...], sd: float) -> tuple[Term, ...]:
        return tuple(replace(t, coefficient=t.coefficient * float(np.exp(rng.normal(0, sd)))) for t in terms)

    return replace(
        network,
        links=tuple(replace(link, terms=off(link.terms, LINKS_SD)) for link in network.links),
        sources=tuple(replace(source, terms=off(source.terms, LOSSES_SD)) for source in network.sources),
    )


def hot_spot(case: Case) -> str:
    """The hottest of the measured endwindings."""
    highest = {o.sensor.name: float(o.measured[o.good].max()) for o in case.recorded.observations}
    return max(ENDWINDINGS, key=lambda channel: highest[channel])


# --- Calibration ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Calibrated:
    """A network after calibration. `corrections`: cause -> what a sensor was found to
    read too much. `guessed`, `checked`: a WLTC by the guess and by the fitted network."""

    seed: int
    longest_s: float
    form: Form
    fitted: Network
    corrections: dict[str, float]
    guessed: Case
    checked: Case

    def case(self, drive: Drive, hidden_W: float) -> Case:
        """A drive by the fitted network."""
        return case_of(self.seed, drive.first(self.longest_s), hidden_W, self.fitted, self.form, self.corrections)

    @property
    def gains(self) -> dict[str, float]:
        """How far mean errors on the WLTC fall [K]."""
        hottest = hot_spot(self.guessed)
        was, now = (
            {c: errors_K(case, case.open_loop, (c,))[0] for c in (hottest, MAGNET)}
            for case in (self.guessed, self.checked)
        )
        return {"endwinding gain": was[hottest] - now[hottest], "magnet gain": was[MAGNET] - now[MAGNET]}


def calibrated(
    seed: int, guess: Network, lacked_W: float, longest_s: float = math.inf, form: Form = PLACED
) -> Calibrated:
    """The guess fitted to two S1 points and an S2, of a motor with more magnet loss than it has; checked on a WLTC."""
    plant = Plant(seed, *([Effect("loss.magnet.speed2", lacked_W)] if lacked_W else []))
    plan = [points.s1(plant, 6000.0, 30.0, 0), points.s1(plant, 10_000.0, 30.0, 1), points.s2(plant, 8000.0, 20.0, 2)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = form.write(folder, plant, sessions(plant, [drive.first(longest_s) for drive in plan]), "six")
        file = folder / "motor.toml"
        file.write_bytes(written(file.read_bytes(), file.name, guess, "A first guess."))
        with stored(folder, logs) as store:
            known = facts.at(store.ledger)
            result = calibrate_sessions(store, known, known.sessions, None, "testing")
    cycle, fitted, corrections = (
        drives.wltp(1).first(longest_s),
        result.calibration.network,
        found_too_much(result.event.errors, form),
    )
    before = case_of(seed, cycle, lacked_W, guess, form)
    after = case_of(seed, cycle, lacked_W, fitted, form, corrections)
    return Calibrated(seed, longest_s, form, fitted, corrections, before, after)


def found_too_much(errors: Sequence[Mapping[str, Any]], form: Form) -> dict[str, float]:
    """The mean bias [K] of each sensor that a filter's bench has, over the sessions of a calibration."""
    found = {}
    for sensor in SENSORS:
        biases = [float(one["bias_K"]) for one in errors if one["channel"] == sensor.signal]
        if sensor.signal in (*SEEN, MAGNET):
            shares = form.weights.get(sensor.signal, {sensor.node: 1.0})
            place = max(shares, key=lambda node: shares[node])
            found[f"sensor.{place}.bias"] = float(np.mean(biases))
    return found


def main() -> None:
    """Run and print."""
    args = asked.parser(__doc__, seeds=(5, 1), first=(200, 200)).parse_args()
    cycles, longest_s = (1, 600.0) if args.quick else (3, math.inf)
    of_motor, every = partial(measured, cycles=cycles, longest_s=longest_s), []
    seeds = range(args.first, args.first + args.seeds)
    for seed, one in zip(seeds, of_each(of_motor, seeds), strict=True):
        print(f"motor {seed}: measured", file=sys.stderr, flush=True)
        every.append(one)
    found = statements(every)
    print(f"{'':<67}{'paper':>10}{'median':>9}{'worst':>9}   {args.seeds} motors")
    print("\n".join(one.line() for one in found))
    rows = [{"says": s.says, "bound": s.bound, "unit": s.unit, "values": s.values, "met": s.met} for s in found]
    asked.keep(rows, args.json)


if __name__ == "__main__":
    main()
