"""The filter in the paper's form is that of the small form but for its integrator, and filterpy's to rounding."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter

from benchmarks.integrator import frame, motor, s2, wltp_like
from made.law_heats import law_heats, psi_at, shares
from made.paper_steps import at_the_start, heats_of, predict, transition
from replay.engine.results.kernel_cache import load
from twin.compiled.kernel import compile_indexed
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import AnyReading, FilterStart, HeatReading, Inputs, Reading, inputs_of
from twin.filters.unknowns import Unknown, UnknownBias, UnknownFactor, UnknownHeat
from twin.motor.network import Network
from twin.motor.outputs import lagged
from twin.motor.sensor import Sensor
from twin.paper.ekf import at_edges, filter_with_rates, sensor_row
from twin.run.simulate import Frame, simulate

Floats = np.ndarray[Any, Any]

SD_K = 0.1
STARTED = FilterStart(np.full(5, 40.0), np.full(5, 2.0))
HEATS: list[Unknown] = [UnknownHeat("n2", 40.0, 5.0), UnknownHeat("n4", 20.0, 1.0)]
MIXED: list[Unknown] = [  # a whole link and source, one term of two, a link to a boundary
    UnknownHeat("n2", 40.0, 5.0),
    UnknownFactor("loss.n0.scale", 0.3, 0.01, also=("loss.n3.scale",)),
    UnknownFactor("conductance.n0-n1.speed0.8", 0.3, 0.01),
    UnknownFactor("conductance.n0-n3.scale", 0.5, 0.0),
    UnknownFactor("conductance.coolant-n0.scale", 0.2, 0.0),
    UnknownBias("n1", 0.5),
    UnknownBias("n0", 0.3, 0.01),
]
OTHERS: list[Unknown] = [
    UnknownFactor("conductance.rotor_surface-teeth.scale", 0.3, 0.01),
    UnknownFactor("loss.teeth.scale", 0.3, 0.0),
    UnknownBias("endwinding_a_inner", 0.5),
]


def read(network: Network, truth: Floats, taus: dict[str, float], step_s: float) -> list[Reading]:
    rng, steps, names = np.random.default_rng(3), len(truth) - 1, [node.name for node in network.nodes]
    found = []
    for name, tau in taus.items():
        place = rng.uniform(0.3, 0.7, steps)
        edges = lagged(truth[:, names.index(name)], tau, step_s)
        value = edges[:-1] + place * np.diff(edges) + rng.normal(0, SD_K, steps)
        value[rng.random(steps) < 0.05] = np.nan
        found.append(Reading(Sensor(name, {name: 1.0}, time_constant_s=tau), value, place, np.full(steps, SD_K**2)))
    return found


def stronger(network: Network, scale: float) -> Network:
    """The same with every coefficient multiplied."""

    def scaled(place: Any) -> Any:
        return replace(place, terms=tuple(replace(t, coefficient=scale * t.coefficient) for t in place.terms))

    links, sources = (tuple(map(scaled, places)) for places in (network.links, network.sources))
    return replace(network, links=links, sources=sources)


class Dense:
    """A network's heats in dense matrices, x = [z, zdot, heats, factors, errors, ...]: the terms of each factor are a
    network of their own."""

    def __init__(self, network: Network, of: Inputs) -> None:
        parts, self.boundaries, self.names, self.laws = of.parts, of.boundaries, of.unknowns, law_heats(network)
        self.n, self.at, self.factors = len(network.nodes), parts.heats, parts.unknown_factors
        self.C, self.around = np.array([node.capacity for node in network.nodes]), at_edges(of.boundaries)
        own = [shares(network, np.where(parts.factor_of == p, parts.nominal, 0.0)) for p in range(-1, self.factors)]
        self.means = np.stack([of.features @ one[:-1] + one[-1] for one in own])
        self.edges = np.stack([at_edges(one) for one in self.means])
        self.unknowns, self.first = len(of.order), 2 * self.n + len(self.at)

    def own(self, amounts: Floats, k: int, x: Floats) -> Floats:
        """(1 + u, L) amounts that no factor multiplies, then those of each."""
        found: Floats = amounts[:, k] * np.exp(np.append(0.0, x[self.first : self.first + self.factors]))[:, None]
        return found

    def amounts(self, k: int, x: Floats) -> Floats:
        return np.asarray(self.own(self.edges, k, x).sum(axis=0))

    def heats(self, amounts: Floats, k: int, x: Floats, around: Floats) -> tuple[Floats, Floats]:
        """Into the capacitors [W], and their slopes with [z, rho], by means of steps or amounts at edges."""
        own, n = self.own(amounts, k, x), self.n
        heat, slope, by = np.empty(n), np.empty((n, n)), np.zeros((n, n + self.unknowns))
        for p in range(self.factors):
            heats_of(self.laws, own[1 + p], x[:n].copy(), around, heat, slope)
            by[:, n + len(self.at) + p] = heat
        heats_of(self.laws, own.sum(axis=0), x[:n].copy(), around, heat, slope)
        by[:, :n] = slope
        by[self.at, n + np.arange(len(self.at))] = 1.0
        heat[self.at] += x[2 * n : self.first]
        return heat, by

    def ahead(self, k: int, x: Floats, shift: Floats) -> Floats:
        """x one step on from edge k."""
        amounts = np.stack([self.amounts(k, x), self.amounts(k + 1, x)])
        found, heat, slope = x[:, None].copy(), np.empty(self.n), np.empty((self.n, self.n))
        predict(self.laws, self.C, self.at, shift, 0.5, amounts, self.around[k : k + 2], 0, found, heat, slope)
        return found[:, 0]

    def errors(self, channel: str) -> Floats:
        """1 for the unknown error of a channel, 0 for all other unknowns."""
        of = [isinstance(one, UnknownBias) and one.name == channel for one in self.names]
        return np.array(of, dtype=np.float64)

    def metered(self, meter: HeatReading, k: int, x: Floats) -> tuple[float, Floats]:
        """What a meter reads in step k, and its slopes with x."""
        laws, n, row = self.laws, self.n, np.zeros(len(x))
        own, found, ends = self.own(self.means, k, x), np.empty((len(laws.places), 4)), laws.places[:, 1]
        psi_at(laws.places, laws.numbers, laws.copper, np.concatenate([x[:n], self.boundaries[k]])[:, None], found)
        own *= np.where(ends == -1, 1.0, 0.0) if meter.boundary is None else np.where(ends == n, -1.0, 0.0)
        for place, column in ((0, 1), (1, 2), (3, 3)):
            inside = (laws.places[:, place] >= 0) & (laws.places[:, place] < n)
            np.add.at(row, laws.places[inside, place], (own.sum(axis=0) * found[:, column])[inside])
        row[2 * n : self.first] = meter.boundary is None
        row[self.first : self.first + self.factors] = own[1:] @ found[:, 0]
        return float(own.sum(axis=0) @ found[:, 0] + row[2 * n : self.first] @ x[2 * n : self.first]), row


def still(make_network: Any, make_frame: Any, step_s: float, seconds: float) -> tuple[Network, Frame, FilterStart]:
    """A network of any laws under inputs that do not change."""
    network: Network = make_network(4, n=5)
    one: Frame = make_frame(network, 4, steps=1)
    steps = round(seconds / step_s)
    inputs = Frame(step_s, np.repeat(one.features, steps, 0), np.repeat(one.boundaries, steps, 0))
    return network, inputs, FilterStart(np.full(5, 40.0), np.full(5, 2.0))


@pytest.mark.parametrize("others", [[], OTHERS])
@pytest.mark.parametrize(("drive", "worst_K", "mean_K"), [(s2, 0.7, 0.02), (wltp_like, 0.2, 0.01)])
def test_on_the_reference_motor_both_forms_estimate_the_same(
    drive: Any, worst_K: float, mean_K: float, others: list[Unknown]
) -> None:
    """The worst is at the endwindings where full current begins, for the length of a step: inputs are means of two
    steps here."""
    network = motor("reference_motor")
    inputs, unknowns = frame(network, drive(), 0.5), [UnknownHeat("magnet", 50.0, 3.0), *others]
    n = len(network.nodes)
    truth = simulate(compile_indexed(network, load=load), inputs, np.full(n, 66.0))
    taus = {"endwinding_a_inner": 2.0, "endwinding_b_inner": 2.0, "rotor_surface": 2.0}
    channels, start = read(network, truth, taus, 0.5), FilterStart(np.full(n, 65.0), np.full(n, 1.0))
    small, paper = (f(network, inputs, start, unknowns, channels) for f in (filter_unknowns, filter_with_rates))
    off = np.abs(small.temperatures - paper.temperatures)
    assert off.max() < worst_K
    assert off.mean() < mean_K
    apart = np.abs(small.found - paper.found) / small.found_sd
    assert apart.max() < 0.2, "of a standard deviation of what is found"
    assert apart.mean() < 0.03
    assert np.abs(paper.found_sd / small.found_sd - 1)[20:].max() < 0.02


@pytest.mark.parametrize(
    "others", [[], [UnknownFactor("conductance.coolant-n0.scale", 0.3, 0.01), UnknownBias("n0", 0.5)]]
)
def test_the_forms_come_together_as_the_step_gets_small(
    make_network: Any, make_frame: Any, others: list[Unknown]
) -> None:
    """The same readings, at the ends of steps of 1 s, in ever finer steps: what is left is the integrators', and half
    a step of the walks."""
    off = []
    for step_s in (0.5, 0.25, 0.125):
        network, inputs, start = still(make_network, make_frame, step_s, 60.0)
        steps, parts = len(inputs.features), round(1 / step_s)
        rng = np.random.default_rng(1)
        value = np.full(steps, np.nan)
        value[parts - 1 :: parts] = 45.0 + rng.normal(0, SD_K, 60)
        channels = [Reading(Sensor("n0", {"n0": 1.0}), value, np.ones(steps), np.full(steps, SD_K**2))]
        unknowns = [UnknownHeat("n2", 40.0, 5.0), *others]
        small, paper = (f(network, inputs, start, unknowns, channels) for f in (filter_unknowns, filter_with_rates))
        off.append(np.abs(small.temperatures - paper.temperatures)[parts * 5 :: parts].max())
    assert off[0] / off[1] > 2
    assert off[1] / off[2] > 2
    assert off[2] < 0.03
    assert (np.abs(small.found - paper.found)[-1] < 0.02 * small.found_sd[-1]).all()


def test_without_readings_it_is_the_trapezoidal_rule(make_network: Any, make_frame: Any) -> None:
    errors = []
    for step_s in (0.5, 0.25):
        network, inputs, start = still(make_network, make_frame, step_s, 40.0)
        fine = Frame(step_s / 32, np.repeat(inputs.features, 32, 0), np.repeat(inputs.boundaries, 32, 0))
        truth = simulate(compile_indexed(network, load=load), fine, start.temperatures)[::32]
        found = filter_with_rates(network, inputs, start, [UnknownHeat("n2", 40.0, 5.0)], [])
        errors.append(np.abs(found.temperatures - truth).max())
        assert np.abs(found.found).max() < 1e-12
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.6)
    assert errors[1] < 0.01


def test_the_capacitor_equation_holds_without_error(make_network: Any, make_frame: Any) -> None:
    """Gamma = 0 leaves as many free numbers as there are temperatures and unknowns; the rest of the covariance is
    rounding."""
    network, inputs, start = still(make_network, make_frame, 0.5, 60.0)
    channels = [Reading(Sensor("n0", {"n0": 1.0}), np.full(120, 45.0), np.ones(120), np.full(120, SD_K**2))]
    found = filter_with_rates(network, inputs, start, [UnknownHeat("n2", 40.0, 5.0)], channels)
    spread = np.linalg.eigvalsh(found.covariance)
    assert len(spread) == 2 * 5 + 1
    assert spread[5] > 1e-8
    assert np.abs(spread[:5]).max() < 1e-11 * spread[-1]
    assert (found.covariance == found.covariance.T).all()


@pytest.mark.parametrize("unknowns", [HEATS, MIXED])
def test_it_agrees_with_filterpy_to_rounding(make_network: Any, make_frame: Any, unknowns: list[Unknown]) -> None:
    """All measurements of a step at once, R singular, as the paper has it: filterpy is given F, Q, H, R and the
    predicted mean. It has the factors' terms as networks of their own."""
    network, inputs, start = make_network(4, n=5), make_frame(make_network(4, n=5), 4, steps=60), STARTED
    truth = simulate(compile_indexed(stronger(network, 1.5), load=load), inputs, start.temperatures + 1.0)
    channels = read(network, truth, {"n0": 0.0, "n1": 2.0, "n3": 1.0}, 0.5)
    ours = filter_with_rates(network, inputs, start, unknowns, channels)

    of = inputs_of(network, inputs, start, unknowns, channels)
    model = Dense(network, of)
    shift, process, state = transition(of, 0.5)
    x, covariance = at_the_start(
        of, model.laws, model.amounts(0, np.zeros(10 + len(unknowns))), model.around[0], model.C, state
    )
    places, variances = (np.broadcast_to(rows, of.values.shape) for rows in (of.places, of.variances))
    size, last = len(x), 10 + len(unknowns)
    peer = ExtendedKalmanFilter(dim_x=size, dim_z=5)
    peer.x, peer.P, peer.Q, peer.F = x[:, 0], covariance, process, shift
    worst = 0.0
    for k in range(60):
        peer.x, peer.P = model.ahead(k, peer.x, shift), shift @ peer.P @ shift.T + process
        rise, slope = model.heats(model.edges, k + 1, peer.x, model.around[k + 1])
        perfect = np.zeros((5, size))
        perfect[:, :5], perfect[:, 5:10], perfect[:, 10:last] = -slope[:, :5], np.diag(model.C), -slope[:, 5:]
        perfect /= model.C[:, None]
        seen = np.flatnonzero(np.isfinite(of.values[k]))
        sensors = np.empty((len(seen), size))
        for i, j in enumerate(seen):
            tau, place = channels[j].sensor.time_constant_s, places[k, j]
            sensor_row(of.parts.weights[j], tau, int(state[j]), (1 - place) * 0.5, 5, sensors[i])
            sensors[i, 10:last] = model.errors(channels[j].channel)
        H = np.concatenate([perfect, sensors])
        z = np.concatenate([perfect @ peer.x + rise / model.C - peer.x[5:10], of.values[k, seen]])
        R = np.diag(np.concatenate([np.zeros(5), variances[k, seen]]))
        peer.update(z, lambda _, H=H: H, lambda x, H=H: H @ x, R=R)
        worst = max(worst, np.abs(peer.x[:5] - ours.temperatures[k + 1]).max())
        assert np.abs(peer.x[10:last] - ours.found[k + 1]).max() < 1e-6, "heats [W], factors, errors [K]"
        assert np.abs(np.sqrt(np.diag(peer.P)[10:last]) - ours.found_sd[k + 1]).max() < 1e-6, "standard deviations"
    assert worst < 1e-9, "temperatures [K]"
    assert np.abs(peer.P - ours.covariance).max() < 1e-7
    assert (np.abs(ours.found[-1]) > 0.01).all(), "all are found, not left at 0"


def test_with_meters_of_heat_it_agrees_with_filterpy_on_its_rank(make_network: Any, make_frame: Any) -> None:
    """The filter of z and unknowns that is left when w may be anything: the trapezoidal rule, linear at both edges.
    With rates, filterpy itself rounds the covariance of watts and of `RATE_SD` by more than is asked here."""
    network, inputs, start = make_network(4, n=5), make_frame(make_network(4, n=5), 4, steps=60), STARTED
    unknowns = [*MIXED, UnknownBias("losses", 9.0)]
    other = stronger(network, 1.5)
    truth = simulate(compile_indexed(other, load=load), inputs, start.temperatures + 1.0)
    channels: list[AnyReading] = [Reading(Sensor("n0", {"n0": 1.0}), truth[1:, 0], np.ones(60), np.full(60, SD_K**2))]
    channels += [Reading(Sensor("n1", {"n1": 1.0}), truth[1:, 1], np.ones(60), np.full(60, SD_K**2))]
    missing = np.where(np.arange(60) % 3 == 0, np.nan, 0.0)
    for name, boundary in (("losses", None), ("cooling", "coolant")):
        meter = HeatReading(name, missing, np.full(60, 81.0), boundary)
        true = Dense(other, inputs_of(other, inputs, start, [], [meter]))
        ends = [true.metered(meter, k, np.concatenate([truth[k + 1], np.zeros(5)]))[0] for k in range(60)]
        channels.append(replace(meter, value=missing + ends))
    ours = filter_with_rates(network, inputs, start, unknowns, channels)

    of = inputs_of(network, inputs, start, unknowns, channels)
    model, last, worst = Dense(network, of), 10 + len(unknowns), 0.0
    y = np.r_[0:5, 10:last]
    x = np.concatenate([start.temperatures, np.zeros(5 + len(unknowns))])
    rise, before = model.heats(model.edges, 0, x, model.around[0])
    x[5:10] = rise / model.C
    peer = KalmanFilter(len(y), 1)
    peer.P = of.covariance[: len(y), : len(y)]
    shift = transition(of, 0.5)[0]
    for k in range(60):
        x = model.ahead(k, x, shift)
        rise, after = model.heats(model.edges, k + 1, x, model.around[k + 1])
        matrix = np.diag(4 * model.C) - after[:, :5]  # 2 C / h
        more = np.linalg.solve(matrix, 4 * (rise - model.C * x[5:10]))
        x[:5] += 0.25 * more
        x[5:10] += more
        right = np.concatenate([np.diag(4 * model.C) + before[:, :5], before[:, 5:] + after[:, 5:]], axis=1)
        noise = np.concatenate([np.diag(4 * model.C), after[:, 5:]], axis=1)
        F, N = (np.concatenate([np.linalg.solve(matrix, top), np.eye(len(y))[5:]]) for top in (right, noise))
        P = F @ peer.P @ F.T + (N * of.parts.process[: len(y)]) @ N.T
        seen = np.flatnonzero(np.isfinite(of.values[k]))
        said, rows = np.empty(len(seen)), np.zeros((len(seen), last))
        for i, j in enumerate(seen):
            channel = channels[j]
            if isinstance(channel, HeatReading):
                said[i], rows[i] = model.metered(channel, k, x)
            else:
                said[i], rows[i, j] = x[j], 1.0
            rows[i, 10:] += model.errors(channel.channel)
            said[i] += model.errors(channel.channel) @ x[10:]
        peer.x, peer.P, peer.dim_z = np.zeros((len(y), 1)), P, len(seen)
        peer.update((of.values[k, seen] - said)[:, None], np.diag(of.variances[0, seen]), rows[:, y])
        x[y] += peer.x[:, 0]
        x[5:10] += after @ peer.x[:, 0] / model.C
        before = after
        worst = max(worst, np.abs(x[:5] - ours.temperatures[k + 1]).max())
        assert np.abs(x[10:] - ours.found[k + 1]).max() < 1e-7, "heats [W], factors, errors [K], [W]"
    assert worst < 1e-9, "temperatures [K]"
    assert np.abs(peer.P - ours.covariance[np.ix_(y, y)]).max() < 1e-7
    assert (np.abs(ours.found[-1]) > 0.01).all(), "all are found, not left at 0"


@pytest.mark.parametrize(
    "others", [[], [UnknownFactor("conductance.coolant-n0.scale", 0.5, 0.0), UnknownBias("n0", 0.5)]]
)
@pytest.mark.parametrize("tau", [0.0, 2.0])
def test_what_is_not_singular_stays_positive_definite_over_many_steps(
    make_network: Any, make_frame: Any, tau: float, others: list[Unknown]
) -> None:
    """Good to 0.0001 K after a start known to 1000 K: of the covariance of z, heats and lagging readings 14 digits
    cancel at once."""
    steps = 100_000
    network, inputs, start = still(make_network, make_frame, 0.5, steps / 2)
    unsure = FilterStart(start.temperatures, np.full(5, 1000.0))
    value, place = 45.0 + np.random.default_rng(2).normal(0, 1e-4, steps), np.full(steps, 0.4)
    for cut in (1, 100, steps):
        some = Frame(0.5, inputs.features[:cut], inputs.boundaries[:cut])
        channels = [
            Reading(Sensor("n0", {"n0": 1.0}, time_constant_s=tau), value[:cut], place[:cut], np.full(cut, 1e-8))
        ]
        found = filter_with_rates(network, some, unsure, [UnknownHeat("n2", 40.0, 0.0), *others], channels)
        free = [*range(5), *range(10, len(found.covariance))]
        spread = np.linalg.eigvalsh(found.covariance[np.ix_(free, free)])
        assert spread[0] > 0
        assert (found.temperatures_sd > 0).all()
        assert (found.found_sd > 0).all()
