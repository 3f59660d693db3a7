"""How many times faster the filters are than filterpy, in one run, with the largest difference between the two.

    python benchmarks/filter_speed.py [--quick] [--json FILE]

The reference motor: 21 nodes, eight thermometers, a drive like the WLTP at 2 Hz. Both forms find the magnets' loss and
three conductances: 25 numbers in the small form, 46 in the paper's. filterpy is used as its documentation has it, its
model of the motor written in vectorised numpy: the network's step and its derivative in each step of the filter. Beside
it, the same filterpy that is given our compiled step, derivative included, and has its own algebra alone to do. Times
are processor times of the whole call, the best of all rounds, the ways taken in turn; differences are of every
temperature at every edge of filterpy's run.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks import asked
from benchmarks.integrator import Physics, frame, initial_of, motor, wltp_like
from made.law_heats import law_heats, shares
from made.paper_steps import at_the_start, heats_of, predict, transition
from replay.engine.results.kernel_cache import load
from twin.compiled.integrators import SDIRK2
from twin.compiled.kernel import compile_indexed
from twin.filters.by_filterpy import Steps
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import FilterStart, Inputs, Reading, inputs_of
from twin.filters.unknowns import Unknown, UnknownFactor, UnknownHeat
from twin.motor.network import Network
from twin.motor.sensor import Sensor
from twin.paper.ekf import at_edges, filter_with_rates, sensor_row
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]
Case = tuple[Network, Frame, FilterStart, list[Any], list[Reading]]

STEPS = 10_800  # of ours, three WLTC; filterpy's are fewer, as its time a step does not change
STEP_S, NOISE_K = 0.5, 0.1
SENSORS = (
    "endwinding_a_inner",
    "endwinding_b_inner",
    "winding_a",
    "winding_b",
    "teeth",
    "yoke",
    "rotor_surface",
    "housing",
)
HEAT = UnknownHeat("magnet", 50.0, 3.0)
FACTORS = tuple(
    UnknownFactor(f"conductance.{link}.scale", 0.1, 1e-4) for link in ("teeth-yoke", "yoke-jacket", "magnet-rotor_core")
)


def case_of(unknowns: tuple[Unknown, ...], cut: int = STEPS) -> Case:
    """What every filter is given, cut to its first steps: readings at the end of each step."""
    network, steps = motor("reference_motor"), STEPS
    cycle = frame(network, wltp_like(), STEP_S)
    part = np.resize(np.arange(len(cycle.features)), steps)
    inputs, start = (
        Frame(STEP_S, cycle.features[part], cycle.boundaries[part]),
        FilterStart(initial_of(network), np.ones(21)),
    )
    truth = simulate(compile_indexed(network, load=load), inputs, start.temperatures + 1.0)
    rng, names = np.random.default_rng(1), [node.name for node in network.nodes]
    read = [truth[1:, names.index(name)] + rng.normal(0, NOISE_K, steps) for name in SENSORS]
    noise = np.full(steps, NOISE_K**2)
    channels = [
        Reading(Sensor(n, {n: 1.0}), value, np.ones(steps), noise) for n, value in zip(SENSORS, read, strict=True)
    ]
    inputs = Frame(STEP_S, inputs.features[:cut], inputs.boundaries[:cut])
    channels = [replace(r, value=r.value[:cut], place=r.place[:cut], variance=r.variance[:cut]) for r in channels]
    return network, inputs, start, list(unknowns), channels


# --- filterpy, with a model in numpy ----------------------------------------------------------------------------------


class Model:
    """The motor in numpy: heat of every term and its slopes with temperatures, into the matrix of a step by their
    places."""

    def __init__(self, network: Network, inputs: Inputs) -> None:
        self.physics = physics = Physics(network)
        self.n, self.heats, self.factors = len(physics.capacity), inputs.parts.heats, inputs.parts.unknown_factors
        self.linked = np.arange(len(physics.a)) < physics.links
        self.power = np.where(self.linked, 0, np.append(np.zeros(physics.links, dtype=np.int64), physics.power))
        self.far = np.where(self.linked, np.append(physics.b[: physics.links], physics.a[physics.links :]), physics.a)
        self.factor_of = inputs.parts.factor_of
        terms = np.arange(len(physics.a))
        self.into = np.zeros((self.n, len(terms)))
        self.into[physics.a[physics.a < self.n], terms[physics.a < self.n]] = 1.0
        leaves = self.linked & (self.far < self.n)
        self.into[self.far[leaves], terms[leaves]] -= 1.0
        signs, ends = zip(*(((row[row != 0]), np.flatnonzero(row)) for row in self.into.T), strict=True)
        cells, which, sign = [], [], []
        for t in terms:
            by = [(physics.a[t], 0), (self.far[t], 1), (physics.other[t], 2)]
            for end, one in zip(ends[t], signs[t], strict=True):
                for node, slope in by:
                    if node < self.n and not (slope == 1 and not self.linked[t]):
                        cells.append(end * self.n + node)
                        which.append(slope * len(terms) + t)
                        sign.append(one)
        self.cells, self.which, self.sign = np.array(cells), np.array(which), np.array(sign)
        self.multiplied = np.flatnonzero(self.factor_of >= 0)
        self.by_factor = np.eye(self.factors)[self.factor_of[self.multiplied]]
        self.into_multiplied = self.into[:, self.multiplied]
        self.at_heats = np.zeros((self.n, len(self.heats)))
        self.at_heats[self.heats, np.arange(len(self.heats))] = 1.0

    def heats_of(self, temperatures: Floats, phi: Floats, around: Floats, logs: Floats) -> tuple[Floats, Floats]:
        """Heat of every term (K,) and its slopes (3, K) with the temperatures of a, b and the factor's node."""
        p, every = self.physics, np.concatenate([temperatures, around])
        at_a = every[p.a]
        strength = p.coefficient * np.append(phi, 1.0)[p.column] * np.append(np.exp(logs), 1.0)[self.factor_of]
        drop = np.where(self.linked, every[self.far] - at_a, 1.0)
        copper = 1 + p.copper.alpha_per_K * (at_a - p.copper.reference_degC)
        scaled = strength * copper**self.power
        amount = scaled * (1 + p.slope * (every[p.other] - p.reference))
        heat = amount * drop
        own = heat * self.power * p.copper.alpha_per_K / copper
        return heat, np.stack([np.where(self.linked, own - amount, own), amount, scaled * drop * p.slope])

    def jacobian(self, slopes: Floats) -> Floats:
        found: Floats = np.bincount(self.cells, slopes.ravel()[self.which] * self.sign, self.n**2).astype(np.float64)
        return found.reshape(self.n, self.n)


class StepModel(Model):
    """One step of the network's integrator, and its derivative."""

    def __init__(self, network: Network, inputs: Inputs) -> None:
        super().__init__(network, inputs)
        self.storage = self.physics.capacity / (SDIRK2.gamma * STEP_S)
        self.share = SDIRK2.a[1][0] / SDIRK2.gamma

    def step(self, x: Floats, phi: Floats, around: Floats) -> tuple[Floats, Floats]:
        n, share, heats = self.n, self.share, self.n + len(self.heats)
        T = x[:n]
        heat, slopes = self.heats_of(T, phi, around, x[heats:])
        jacobian = self.jacobian(slopes)
        right = self.into @ heat - jacobian @ T
        right[self.heats] += x[n:heats]
        inverse = np.linalg.inv(np.diag(self.storage) - jacobian)
        onward, known = inverse * self.storage, inverse @ right
        first = onward @ T + known
        last = onward @ (T + share * (first - T)) + known
        ahead, F = x.copy(), np.eye(len(x))
        ahead[:n] = last
        F[:n, :n] = (1 - share) * onward + share * (onward @ onward)
        terms, p = self.multiplied, self.physics
        driven = []
        for stage in (first, last):
            beyond = np.concatenate([stage - T, np.zeros(len(around))])
            own = heat[terms] + slopes[0, terms] * beyond[p.a[terms]] + slopes[2, terms] * beyond[p.other[terms]]
            own += np.where(self.linked[terms], slopes[1, terms] * beyond[self.far[terms]], 0.0)
            driven.append(
                np.concatenate([self.at_heats, self.into_multiplied @ (own[:, None] * self.by_factor)], axis=1)
            )
        F[:n, n:] = inverse @ driven[1] + share * (onward @ (inverse @ driven[0]))
        return ahead, F


class Motor(ExtendedKalmanFilter):  # type: ignore[misc]
    """filterpy's filter with the motor's own step."""

    x: Floats
    model: Callable[[Floats, int], tuple[Floats, Floats]]

    def predict_x(self, u: int = 0) -> None:
        self.x, self.F = self.model(self.x, u)


def filterpys(inputs: Inputs, model: Callable[[Floats, int], tuple[Floats, Floats]]) -> Floats:
    """The states (N, S) at the ends of steps."""
    steps, m, size = len(inputs.values), inputs.values.shape[1], inputs.parts.sought
    peer = Motor(size, m)
    peer.model = model
    peer.x, peer.P = inputs.x[:size].copy(), inputs.covariance[:size, :size].copy()
    peer.Q, peer.R = np.diag(inputs.parts.process[:size]), NOISE_K**2 * np.eye(m)
    H = np.zeros((m, size))
    H[:, : inputs.parts.program.n] = inputs.parts.weights
    found = np.empty((steps, size))
    for k in range(steps):
        peer.predict(k)
        peer.update(inputs.values[k], lambda _: H, lambda x: H @ x)
        found[k] = peer.x
    return found


def small_form(network: Network, inputs: Inputs) -> Floats:
    """filterpy with the model in numpy."""
    model = StepModel(network, inputs)
    return filterpys(inputs, lambda x, k: model.step(x, inputs.features[k], inputs.boundaries[k]))


def small_form_given(inputs: Inputs) -> Floats:
    """filterpy with our compiled step and its derivative."""
    steps = Steps(inputs)
    return filterpys(inputs, lambda x, k: (steps.moved(k, x), steps.matrix(k, x)))


def paper_form(network: Network, inputs: Inputs, given: bool) -> Floats:
    """filterpy on [z, zdot, rho], perfect measurements and sensors of a step at once; the model in numpy, or, if
    `given`, our own."""
    laws, model, n, h = law_heats(network), Model(network, inputs), len(network.nodes), STEP_S
    m, first, last = len(inputs.parts.weights), 2 * n + len(model.heats), 2 * n + len(inputs.order)
    phi, around, capacity = at_edges(inputs.features), at_edges(inputs.boundaries), model.physics.capacity
    fixed, *driven = (
        at_edges(inputs.features @ own[:-1] + own[-1])
        for own in (
            shares(network, np.where(model.factor_of == p, inputs.parts.nominal, 0.0)) for p in range(-1, model.factors)
        )
    )
    F, Q, _ = transition(inputs, h)
    start, P = at_the_start(inputs, laws, laws.amounts(inputs.features[0]), around[0], capacity, inputs.parts.state)
    size = len(start)
    peer = ExtendedKalmanFilter(size, n + m)
    peer.x, peer.P, peer.Q, peer.F = start[:, 0], P, Q, F
    peer.R = np.diag([*np.zeros(n), *np.full(m, NOISE_K**2)])
    H = np.zeros((n + m, size))
    H[:n, n : 2 * n] = np.eye(n)
    H[model.heats, np.arange(2 * n, first)] = -1 / capacity[model.heats]
    for j in range(m):
        sensor_row(inputs.parts.weights[j], 0.0, -1, 0.0, n, H[n + j])
    found, heat, slope = np.empty((len(inputs.values), size)), np.empty(n), np.empty((n, n))
    multiplied, unread = np.empty((n, model.factors)), np.empty((n, n))
    for k in range(len(inputs.values)):
        logs = peer.x[first:last]
        if given:
            own = [scale * one[k : k + 2] for scale, one in zip(np.exp(logs), driven, strict=True)]
            amounts, ahead = fixed[k : k + 2] + sum(own), peer.x[:, None].copy()
            predict(laws, capacity, model.heats, F, h, amounts, around[k : k + 2], 0, ahead, heat, slope)
            peer.x = ahead[:, 0]
            for p in range(model.factors):
                one = np.empty(n)
                heats_of(laws, own[p][1], peer.x[:n].copy(), around[k + 1], one, unread)
                multiplied[:, p] = one
        else:
            rate = peer.x[n : 2 * n]
            terms, slopes = model.heats_of(peer.x[:n], phi[k + 1], around[k + 1], logs)
            jacobian, heat = model.jacobian(slopes), model.into @ terms
            heat[model.heats] += peer.x[2 * n : first]
            right = heat + h * (jacobian @ rate) - capacity * rate
            more = np.linalg.solve(np.diag(capacity) - h / 2 * jacobian, right)
            peer.x = F @ peer.x
            peer.x[:n] += h / 2 * more
            peer.x[n : 2 * n] += more
            terms, slopes = model.heats_of(peer.x[:n], phi[k + 1], around[k + 1], logs)
            slope, heat = model.jacobian(slopes), model.into @ terms
            heat[model.heats] += peer.x[2 * n : first]
            multiplied = model.into_multiplied @ (terms[model.multiplied][:, None] * model.by_factor)
        peer.P = F @ peer.P @ F.T + Q
        H[:n, :n], H[:n, first:last] = -slope / capacity[:, None], -multiplied / capacity[:, None]
        perfect = H[:n] @ peer.x + heat / capacity - peer.x[n : 2 * n]
        peer.update(np.concatenate([perfect, inputs.values[k]]), lambda _: H, lambda x: H @ x)
        found[k] = peer.x
    return found


# --- The measurement --------------------------------------------------------------------------------------------------


def ratios(rounds: int, peers_steps: int) -> dict[str, float]:
    """`ekf_vs_filterpy`, `ekf46_vs_filterpy`: filterpy's time a step over ours, its model in numpy;
    `..._given_our_step` the same of a filterpy that is given our step; `..._difference_K` between estimates; `..._us`
    ours a step."""
    case, of = case_of((HEAT, *FACTORS)), inputs_of(*case_of((HEAT, *FACTORS), peers_steps))
    network = case[0]
    ours: Mapping[str, Callable[[], Floats]] = {
        "ekf": lambda: filter_unknowns(*case).temperatures,
        "ekf46": lambda: filter_with_rates(*case).temperatures,
    }
    peers: Mapping[str, Mapping[str, Callable[[], Floats]]] = {
        "ekf": {"filterpy": lambda: small_form(network, of), "given": lambda: small_form_given(of)},
        "ekf46": {
            "filterpy": lambda: paper_form(network, of, False),
            "given": lambda: paper_form(network, of, True),
        },
    }
    found = {}
    for name, run in ours.items():
        own = run()[1:peers_steps]  # less the last edge: at the end of a run features are other ones
        best = dict.fromkeys(("ours", *peers[name]), np.inf)
        apart = [np.abs(own - peer()[:-1, : own.shape[1]]).max() for peer in peers[name].values()]
        for _ in range(rounds):
            for way, call, steps in (("ours", run, STEPS), *((w, c, peers_steps) for w, c in peers[name].items())):
                began = time.process_time()
                call()
                best[way] = min(best[way], (time.process_time() - began) / steps)
        found[f"{name}_vs_filterpy"] = best["filterpy"] / best["ours"]
        found[f"{name}_vs_filterpy_given_our_step"] = best["given"] / best["ours"]
        found[f"{name}_difference_K"] = float(max(apart))
        found[f"{name}_us"] = best["ours"] * 1e6
    return found


def main() -> None:
    said = asked.parser(__doc__).parse_args()
    with threadpool_limits(1):
        found = ratios(1, 60) if said.quick else ratios(5, 600)
    print("\n".join(f"{name:<36} {value:.3g}" for name, value in found.items()))
    asked.keep(found, said.json)


if __name__ == "__main__":
    main()
