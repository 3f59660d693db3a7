"""The filter agrees with filterpy on the reference motor, keeps its covariance positive and finds a heat that is
there."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from benchmarks.integrator import frame, motor, s2
from made.laws import law_frame, with_laws
from made.paper_form import constraints
from replay.engine.results.kernel_cache import load
from twin.compiled.kernel import Compiled, compile_indexed
from twin.errors import CauseError, FrameError
from twin.filters.by_filterpy import Steps, apart, by_filterpy
from twin.filters.ekf import Estimate, at_their_pace, courses, filter_unknowns, run_of, through
from twin.filters.inputs import AnyReading, FilterStart, HeatReading, Reading, inputs_of, with_walks
from twin.filters.smoother import smoothed
from twin.filters.ukf import filter_unscented
from twin.filters.unknowns import Unknown, UnknownBias, UnknownFactor, UnknownHeat
from twin.motor.network import Network, Term
from twin.motor.outputs import lagged
from twin.motor.sensor import Sensor
from twin.paper.ekf import filter_with_rates
from twin.run.simulate import Frame, simulate, source_heat

Floats = np.ndarray[Any, Any]

NODE = "magnet"
LAGS = {"endwinding_a_inner": 2.0, "endwinding_b_inner": 0.0, "rotor_surface": 2.0, "teeth": 5.0}
HEAT_W = 60.0
NOISE_K = 0.05


def indexed(network: Network) -> Compiled:
    return compile_indexed(network, load=load)


@pytest.fixture(scope="module")
def network() -> Network:
    return motor("reference_motor")


@pytest.fixture(scope="module")
def compiled(network: Network) -> Compiled:
    return indexed(network)


@pytest.fixture(scope="module")
def inputs(network: Network) -> Frame:
    return frame(network, s2(), 0.5)


def with_heat(network: Network, watts: float) -> Network:
    """The motor with a constant heat at the magnets that its file does not know."""
    sources = [replace(s, terms=(*s.terms, Term(watts))) if s.node == NODE else s for s in network.sources]
    return replace(network, sources=tuple(sources))


def start(network: Network, sd: float = 1.0, walk_K: float = 0.1) -> FilterStart:
    n = len(network.nodes)
    return FilterStart(np.full(n, 65.0), np.full(n, sd), walk_K)


def heat(walk_W: float, node: str = NODE, sd_W: float = 50.0) -> UnknownHeat:
    return UnknownHeat(node, sd_W, walk_W)


def readings(network: Network, inputs: Frame, temperatures: Floats, missing: float = 0.05) -> list[Reading]:
    """What sensors with lags and noise read of a run, some samples lost, their mean times anywhere in the step."""
    rng = np.random.default_rng(3)
    steps, nodes = len(inputs.features), [node.name for node in network.nodes]
    found = []
    for name, tau in LAGS.items():
        place = rng.uniform(0, 1, steps)
        edges = lagged(temperatures[:, nodes.index(name)], tau, inputs.step_s)
        value = edges[:-1] + place * np.diff(edges) + rng.normal(0, NOISE_K, steps)
        value[rng.random(steps) < missing] = np.nan
        found.append(Reading(Sensor(name, {name: 1.0}, time_constant_s=tau), value, place, np.full(steps, NOISE_K**2)))
    return found


def one_step(compiled: Compiled, inputs: Frame, k: int, start: Floats) -> Floats:
    """The temperatures one step on, by the open loop's own kernel."""
    part = Frame(inputs.step_s, inputs.features[k : k + 1], inputs.boundaries[k : k + 1])
    edges = simulate(compiled, part, start)
    return np.asarray(edges[1])


MIXED = (
    UnknownFactor("conductance.rotor_surface-magnet.scale", 0.2, 1e-3),
    UnknownHeat(NODE, 50.0, 3.0),
    UnknownFactor("loss.teeth.scale", 0.1, 1e-3),
    UnknownBias("teeth", 1.0, 0.01),
    UnknownHeat("yoke", 20.0, 1.0),
    UnknownBias("rotor_surface", 1.0),
)


@pytest.mark.parametrize("unknowns", [(heat(3.0),), MIXED])
def test_it_agrees_with_filterpy_to_rounding(unknowns: tuple[Unknown, ...], network: Network, inputs: Frame) -> None:
    steps = 600
    inputs = Frame(inputs.step_s, inputs.features[:steps], inputs.boundaries[:steps])
    hot = simulate(indexed(with_heat(network, HEAT_W)), inputs, start(network).temperatures)
    channels = readings(network, inputs, hot)
    ours = filter_unknowns(network, inputs, start(network), unknowns, channels)
    of = inputs_of(network, inputs, start(network), unknowns, channels)
    n = len(network.nodes)
    unknown = [n + i for i in np.argsort(of.order)]
    for k, (x, P) in enumerate(by_filterpy(of), 1):
        assert np.abs(x[unknown] - ours.found[k]).max() < 1e-7, "unknowns [W or 1]"
        assert np.abs(np.sqrt(np.diag(P))[unknown] - ours.found_sd[k]).max() < 1e-7
    assert np.abs(P - ours.covariance).max() < 1e-7
    far = apart(of, ours)
    assert far.temperature_K < 1e-9
    assert far.sd_K < 1e-7


def test_a_reading_that_set_the_start_is_no_news_of_its_own_error(network: Network, inputs: Frame) -> None:
    nodes, share = [node.name for node in network.nodes], np.zeros(len(network.nodes))
    share[[nodes.index("teeth"), nodes.index("yoke")]] = 1.0, 0.5  # the yoke is interpolated from it
    steps, sd, noise = len(inputs.features), 0.3, 0.1
    begin = replace(start(network, sd), by_reading={"teeth": share})
    channel = Reading(Sensor("teeth", {"teeth": 1.0}), np.full(steps, 65.0), np.ones(steps), np.full(steps, noise**2))
    given = inputs_of(network, inputs, begin, [UnknownBias("teeth", 2.0)], [channel])
    drawn = np.random.default_rng(4).normal(size=(200_000, len(nodes) + 1)) * [*begin.sd, 2.0]
    drawn[:, :-1] -= share * drawn[:, -1:]  # as much too cold as it reads too much
    np.testing.assert_allclose(given.covariance, np.cov(drawn.T), atol=0.05)
    expected = {"once": sd**2 + 0.1**2 * inputs.step_s + noise**2}
    expected["twice"] = expected["once"] + 2.0**2
    for begun, many in ((begin, "once"), (start(network, sd), "twice")):
        found = filter_unknowns(network, inputs, begun, [UnknownBias("teeth", 2.0)], [channel])
        assert found.variances[0, 0] == pytest.approx(expected[many], rel=0.05)


def test_with_a_meter_of_losses_beside_it_agrees_with_filterpy_to_rounding(network: Network, inputs: Frame) -> None:
    steps = 200
    inputs = Frame(inputs.step_s, inputs.features[:steps], inputs.boundaries[:steps])
    truth = with_heat(network, HEAT_W)
    hot = simulate(indexed(truth), inputs, start(network).temperatures)
    watts = source_heat(truth, inputs, hot).sum(axis=1)
    watts[::7] = np.nan
    channels: list[AnyReading] = [
        HeatReading("losses", watts, np.full(steps, 3600.0)),
        *readings(network, inputs, hot)[:2],
    ]
    unknowns: list[Unknown] = [heat(0.3), UnknownBias("losses", 5.0)]
    of = inputs_of(network, inputs, start(network), unknowns, channels)
    far = apart(of, filter_unknowns(network, inputs, start(network), unknowns, channels))
    assert far.temperature_K < 1e-8
    assert far.sd_K < 1e-7


def test_a_filter_with_another_gain_is_told_apart_from_filterpys(network: Network, inputs: Frame) -> None:
    inputs = Frame(inputs.step_s, inputs.features[:50], inputs.boundaries[:50])
    hot = simulate(indexed(network), inputs, start(network).temperatures)
    channels = readings(network, inputs, hot)
    of = inputs_of(network, inputs, start(network), [heat(3.0)], channels)
    noisier = [replace(r, variance=4 * r.variance) for r in channels]
    far = apart(of, filter_unknowns(network, inputs, start(network), [heat(3.0)], noisier))
    assert far.temperature_K > 1e-3
    assert far.sd_K > 1e-3


def test_a_step_is_that_of_the_open_loop_with_the_heats_beside(
    network: Network, compiled: Compiled, inputs: Frame
) -> None:
    of = Steps(inputs_of(network, inputs, start(network), [heat(1.0)], []))
    n = len(network.nodes)
    x = np.append(np.linspace(60.0, 120.0, n), 40.0)
    for k in (0, 130, 500):
        ours = of.moved(k, x)
        more = of.matrix(k, x)[:n, n] * 40.0
        assert np.abs(ours[:n] - one_step(compiled, inputs, k, x[:n]) - more).max() < 1e-11


def test_what_a_channel_reads_is_what_the_open_loop_says_it_reads(network: Network, inputs: Frame) -> None:
    """Given the truth as start, a filter that may not move predicts every noiseless reading."""
    truth = simulate(indexed(network), inputs, start(network).temperatures)
    channels = readings(network, inputs, truth, missing=0.0)
    still = start(network, 1e-9, 1e-12)
    found = filter_unknowns(network, inputs, still, [heat(1e-12, sd_W=1e-9)], channels)
    noise = np.random.default_rng(3)
    for j in range(len(channels)):
        noise.uniform(0, 1, len(inputs.features))
        expected = noise.normal(0, NOISE_K, len(inputs.features))
        noise.random(len(inputs.features))
        settled = 200  # a lagging reading may start 0.1 K off, and is corrected
        assert np.abs(found.innovations[settled:, j] - expected[settled:]).max() < 0.02


def test_without_readings_it_is_the_open_loop(network: Network, compiled: Compiled, inputs: Frame) -> None:
    found = filter_unknowns(network, inputs, start(network), [heat(1.0)], [])
    assert np.abs(found.temperatures - simulate(compiled, inputs, start(network).temperatures)).max() < 1e-10
    assert not found.found.any()
    assert (np.diff(found.found_sd[:, 0]) > 0).all(), "what is not measured is forgotten"
    assert np.isnan(found.nis)


def test_it_agrees_with_filterpys_linear_filter_where_nothing_changes(make_network: Any, make_frame: Any) -> None:
    """Without inputs a linear network is x' = F x."""
    network: Network = make_network(4, n=5, linear=True)
    inputs: Frame = make_frame(network, 4, steps=80)
    inputs = Frame(inputs.step_s, np.zeros_like(inputs.features), np.zeros_like(inputs.boundaries))
    begin, steps = FilterStart(np.full(5, 40.0), np.linspace(0.5, 3.0, 5)), 80
    rng = np.random.default_rng(2)
    channels = [
        Reading(
            Sensor(name, {name: 1.0}, time_constant_s=tau),
            rng.normal(30, 1, steps),
            rng.uniform(0, 1, steps),
            np.full(steps, 0.01),
        )
        for name, tau in (("n0", 0.0), ("n1", 3.0))
    ]
    ours = filter_unknowns(network, inputs, begin, [heat(5.0, "n2")], channels)
    of = Steps(inputs_of(network, inputs, begin, [heat(5.0, "n2")], channels))
    size = of.size + of.channels
    x, P = of.start
    peer = KalmanFilter(size, 2)
    peer.x, peer.P = np.append(x, of.now @ x)[:, None], np.zeros((size, size))
    peer.P[: of.size, : of.size] = P
    peer.F, peer.Q, peer.R = np.zeros((size, size)), np.zeros((size, size)), 0.01 * np.eye(2)
    peer.F[:, : of.size] = of.extended(0, x)[1]
    peer.Q[: of.size, : of.size] = of.process
    likelihood = 0.0
    for k in range(steps):
        peer.predict()
        peer.update(of.inputs.values[k, :, None], H=np.array([of.row(j, of.inputs.places[k, j]) for j in range(2)]))
        likelihood += peer.log_likelihood
        assert np.abs(peer.x[:5, 0] - ours.temperatures[k + 1]).max() < 1e-10
        assert abs(peer.x[5, 0] - ours.found[k + 1, 0]) < 1e-8
    assert np.abs(peer.P[: of.size, : of.size] - ours.covariance).max() < 1e-9
    assert ours.log_likelihood == pytest.approx(likelihood, rel=1e-10)


def test_a_meter_of_heat_is_differentiated_rightly_and_reads_what_flows(make_network: Any) -> None:
    """Losses and what each boundary takes, its circuit's fluid included, as the paper's form has them."""
    network = with_laws(make_network(3), 3)
    inputs, n = law_frame(network, 3, 1, 0.5), len(network.nodes)
    unknowns: list[Unknown] = [
        heat(1.0, "n1"),
        UnknownFactor(f"loss.{network.sources[0].node}.scale", 0.1, 0.0),
        UnknownFactor("conductance.coolant-n0.scale", 0.1, 0.0),
        UnknownBias("losses", 1.0),
    ]
    one = np.ones(1)
    meters = [HeatReading("losses", one, one), *(HeatReading(b.name, one, one, b.name) for b in network.boundaries)]
    of = Steps(inputs_of(network, inputs, start(network), unknowns, meters))

    def reads(meter: int, x: Floats) -> float:
        return of.meter(meter, 0, x)[0]

    x = np.concatenate([np.linspace(40.0, 120.0, n), [20.0, 0.1, -0.2, 7.0]])
    for meter in range(3):
        h = of.meter(meter, 0, x)[1]
        difference = [(reads(meter, x + d) - reads(meter, x - d)) / 2e-3 for d in 1e-3 * np.eye(of.size)]
        assert np.abs(h - difference).max() < 1e-6 * np.abs(h).max()
    x[n:] = 0.0
    form = constraints(network)
    q = form.at(x[:n], form.laws.amounts(inputs.features)[0], inputs.boundaries[0])
    flows = dict(zip(form.flows, q[form.temperatures : form.temperatures + len(form.flows)], strict=True))
    assert reads(0, x) == pytest.approx(sum(w for flow, w in flows.items() if flow.other is None))
    taken = {b.name: -sum(w for flow, w in flows.items() if flow.other == b.name) for b in network.boundaries}
    onward: dict[tuple[str, str | None], str] = {
        (node, before): c.inlet for c in network.circuits for before, node in pairwise(c.nodes)
    }
    for flow, watts in flows.items():  # what flows on between nodes is taken by the inlet's boundary too
        if flow.one_way and (flow.node, flow.other) in onward:
            taken[onward[flow.node, flow.other]] -= watts
    for meter, boundary in enumerate(network.boundaries, 1):
        assert reads(meter, x) == pytest.approx(taken[boundary.name])


def test_measured_losses_show_a_hidden_one_that_no_thermometer_is_near(network: Network, inputs: Frame) -> None:
    """Losses measured to 60 W with an unknown error of 5 W: the heat at the magnets is known better, and soon."""
    truth = with_heat(network, HEAT_W)
    hot = simulate(indexed(truth), inputs, start(network).temperatures)
    given = readings(network, inputs, hot)[:2]
    steps = len(inputs.features)
    noise = np.random.default_rng(4).normal(0, 60.0, steps)
    meter = HeatReading("losses", source_heat(truth, inputs, hot).sum(axis=1) + noise + 3.0, np.full(steps, 3600.0))
    unknowns: list[Unknown] = [heat(0.3), UnknownBias("losses", 5.0)]
    alone = filter_unknowns(network, inputs, start(network, 0.1, 1e-3), unknowns[:1], given)
    found = filter_unknowns(network, inputs, start(network, 0.1, 1e-3), unknowns, [meter, *given])
    assert (found.found_sd[1:, 0] < alone.found_sd[1:, 0]).all()
    assert found.found_sd[100, 0] < 0.5 * alone.found_sd[100, 0]
    assert (np.abs(found.found[100:, 0] - HEAT_W) < 4 * found.found_sd[100:, 0]).all()
    assert np.abs(found.innovations[100:, 0]).mean() == pytest.approx(60.0 * (2 / np.pi) ** 0.5, rel=0.1)
    assert np.isfinite(found.innovations[:, 0]).all(), "columns are in the order of the readings"


@pytest.mark.parametrize("seed", range(3))
def test_without_readings_it_is_the_open_loop_of_any_law(seed: int, make_network: Any) -> None:
    """With circuits, radiation and free convection."""
    network = with_laws(make_network(seed), seed)
    inputs, begins = law_frame(network, seed, 60, 0.5), np.full(len(network.nodes), 40.0)
    found = filter_unknowns(network, inputs, FilterStart(begins, np.ones(len(begins))), [], [])
    assert np.abs(found.temperatures - simulate(indexed(network), inputs, begins)).max() < 1e-10
    assert found.found.shape == (61, 0)


@pytest.mark.parametrize("linear", [True, False])
def test_the_step_is_differentiated_rightly(linear: bool, make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(4, linear=linear)
    inputs: Frame = make_frame(network, 4, steps=1)
    names, n = [node.name for node in network.nodes], len(network.nodes)
    link, source = network.links[0], network.sources[0]
    unknowns: list[Unknown] = [
        heat(1.0, names[0]),
        heat(1.0, names[3]),
        UnknownFactor(f"conductance.{link.a}-{link.b}.scale", 0.1, 0.0),
        UnknownFactor("conductance.coolant-n0.scale", 0.1, 0.0),
        UnknownFactor(f"loss.{source.node}.scale", 0.1, 0.0),
    ]
    of = Steps(inputs_of(network, inputs, start(network), unknowns, []))
    x = np.concatenate([np.linspace(40.0, 90.0, n), [20.0, -10.0, 0.1, -0.2, 0.3]])
    F, shift = of.matrix(0, x), 1e-3 * np.eye(len(x))
    differences = np.array([(of.moved(0, x + d) - of.moved(0, x - d)) / 2e-3 for d in shift]).T
    # what is left out where losses are not linear in temperature is a second derivative times half a second
    assert np.abs(F - differences)[:, :n].max() < (1e-9 if linear else 5e-3)
    assert np.abs(F - differences)[:, n:].max() < 1e-6 * np.abs(differences[:n, n:]).max()


def test_factors_of_any_law_are_differentiated_rightly(make_network: Any) -> None:
    """Radiation, free convection and links beside fluid that flows on."""
    network = with_laws(make_network(3), 3)
    inputs, n = law_frame(network, 3, 1, 0.5), len(network.nodes)
    bent = [link for link in network.links if any(term.law for term in link.terms)]
    films = [link for link in network.links if "jacket_0" in (link.a, link.b)]
    assert bent
    assert films
    unknowns = [UnknownFactor(f"conductance.{link.a}-{link.b}.scale", 0.1, 0.0) for link in (*bent, *films)]
    of = Steps(inputs_of(network, inputs, start(network), unknowns, []))
    x = np.concatenate([np.linspace(40.0, 120.0, n), np.linspace(-0.3, 0.3, len(unknowns))])
    F, shift = of.matrix(0, x), 1e-3 * np.eye(len(x))
    differences = np.array([(of.moved(0, x + d) - of.moved(0, x - d)) / 2e-3 for d in shift[n:]]).T
    assert np.abs(F[:, n:] - differences).max() < 1e-6 * np.abs(differences[:n]).max()


def test_a_hidden_heat_is_found_within_its_band(network: Network, inputs: Frame) -> None:
    hot = simulate(indexed(with_heat(network, HEAT_W)), inputs, start(network).temperatures)
    found = filter_unknowns(network, inputs, start(network, 0.1, 1e-3), [heat(0.3)], readings(network, inputs, hot))
    late = slice(len(inputs.features) // 2, None)
    watts, sd = found.found[1:, 0], found.found_sd[1:, 0]
    assert abs(watts[late].mean() - HEAT_W) < 5.0
    assert (np.abs(watts - HEAT_W) < 4 * sd)[late].all()
    assert sd[-1] < 15.0
    assert found.nis == pytest.approx(1.0, abs=0.05)
    magnet = [node.name for node in network.nodes].index(NODE)
    off = found.temperatures[1:, magnet] - hot[1:, magnet]
    assert np.abs(off[late]).max() < 0.5, "of a node that it never saw"
    assert (np.abs(off) < 4 * found.temperatures_sd[1:, magnet]).all()


def test_a_wrong_coefficient_and_a_hidden_heat_are_found_together(network: Network, inputs: Frame) -> None:
    """The link from rotor surface to magnets is 30 % weaker than its file says, the teeth lose 20 % more, and there
    is a heat."""
    link, loss = "conductance.rotor_surface-teeth.scale", "loss.teeth.scale"
    links = [
        replace(k, terms=tuple(replace(t, coefficient=0.7 * t.coefficient) for t in k.terms))
        if {k.a, k.b} == {"rotor_surface", "teeth"}
        else k
        for k in network.links
    ]
    sources = [
        replace(s, terms=tuple(replace(t, coefficient=1.2 * t.coefficient) for t in s.terms))
        if s.node == "teeth"
        else s
        for s in network.sources
    ]
    true = replace(with_heat(replace(network, links=tuple(links), sources=tuple(sources)), HEAT_W))
    hot = simulate(indexed(true), inputs, start(network).temperatures)
    unknowns: list[Unknown] = [UnknownFactor(link, 0.4, 0.0), UnknownFactor(loss, 0.4, 0.0), heat(0.1)]
    found = filter_unknowns(network, inputs, start(network, 0.1, 1e-3), unknowns, readings(network, inputs, hot))
    truth = np.array([np.log(0.7), np.log(1.2), HEAT_W])
    assert (np.abs(found.found[-1] - truth) < 3.5 * found.found_sd[-1]).all()
    assert (found.found_sd[-1] < [0.1, 0.1, 20.0]).all(), "and it knows them"


def test_the_error_of_a_sensor_is_told_from_heat_by_the_others(network: Network, inputs: Frame) -> None:
    """Two sensors at the teeth, one 2 K too high: with the error an unknown, the teeth and the hidden heat are as
    without it."""
    hot = simulate(indexed(with_heat(network, HEAT_W)), inputs, start(network).temperatures)
    good = readings(network, inputs, hot)
    wrong = replace(good[3], sensor=replace(good[3].sensor, name="second"), value=good[3].value + 2.0)
    unknowns: list[Unknown] = [UnknownBias("second", 3.0), heat(0.3)]
    found = filter_unknowns(network, inputs, start(network, 0.1, 1e-3), unknowns, [*good, wrong])
    assert found.found[-1, 0] == pytest.approx(2.0, abs=4 * found.found_sd[-1, 0])
    assert found.found_sd[-1, 0] < 0.05
    late = slice(len(inputs.features) // 2, None)
    assert (np.abs(found.found[1:, 1] - HEAT_W) < 4 * found.found_sd[1:, 1])[late].all()
    teeth = [node.name for node in network.nodes].index("teeth")
    assert np.abs(found.temperatures - hot)[late, teeth].max() < 0.2


def test_readings_may_come_at_any_rate(network: Network, inputs: Frame) -> None:
    """A channel with a sample every twentieth step says the same as one whose other samples are lost."""
    hot = simulate(indexed(with_heat(network, HEAT_W)), inputs, start(network).temperatures)
    fast = readings(network, inputs, hot, missing=0.0)
    slow = [replace(r, value=np.where(np.arange(r.value.size) % 20 == 7, r.value, np.nan)) for r in fast]
    found = filter_unknowns(network, inputs, start(network, 0.1, 1e-3), [heat(0.3)], [fast[0], *slow[1:]])
    assert np.isfinite(found.innovations).sum(axis=0).tolist() == [r.size for r in [fast[0].value]] + [
        np.isfinite(r.value).sum() for r in slow[1:]
    ]
    late = slice(len(inputs.features) // 2, None)
    assert (np.abs(found.found[1:, 0] - HEAT_W) < 4 * found.found_sd[1:, 0])[late].all()


def test_noise_and_place_that_are_those_of_every_step_may_be_said_once(network: Network, inputs: Frame) -> None:
    """One row stands for all; where nothing is read, another noise changes nothing but that."""
    truth = simulate(indexed(network), inputs, start(network).temperatures)
    channels = [replace(r, place=np.full(len(r.value), 0.7)) for r in readings(network, inputs, truth)]
    first, *others = channels
    unread = int(np.flatnonzero(np.isnan(first.value))[3])
    place, variance = first.place.copy(), first.variance.copy()
    place[unread], variance[unread] = 0.2, 1.0
    many = [replace(first, place=place, variance=variance), *others]
    of = [inputs_of(network, inputs, start(network), [heat(1.0)], given) for given in (channels, many)]
    assert [(len(i.places), len(i.variances)) for i in of] == [(1, 1), (len(inputs.features),) * 2]
    for filtered in (filter_unknowns, smoothed, filter_unscented, filter_with_rates):
        once, each = (filtered(network, inputs, start(network), [heat(1.0)], given) for given in (channels, many))
        assert np.array_equal(once.temperatures, each.temperatures)


def test_an_almost_perfect_reading_of_what_nothing_was_known_of_is_believed(make_network: Any, make_frame: Any) -> None:
    """A start known to 1000 K, readings good to 0.0001 K."""
    network: Network = make_network(7, n=5)
    inputs: Frame = make_frame(network, 7, steps=3)
    sharp = [Reading(Sensor(f"n{i}", {f"n{i}": 1.0}), np.full(3, 30.0), np.ones(3), np.full(3, 1e-8)) for i in (0, 2)]
    begin = FilterStart(np.full(5, 30.0), np.full(5, 1e3), 1e-6)
    found = filter_unknowns(network, inputs, begin, [heat(0.0, "n2", 1e3)], sharp)
    assert found.temperatures_sd[1:, [0, 2]] == pytest.approx(1e-4, rel=0.05)
    assert np.abs(found.temperatures[1:, [0, 2]] - 30.0).max() < 1e-3
    assert (found.covariance == found.covariance.T).all()
    assert np.linalg.eigvalsh(found.covariance).min() > 0


def test_the_covariance_stays_positive_definite_over_a_million_steps(make_network: Any, make_frame: Any) -> None:
    network: Network = make_network(7, n=5)
    inputs: Frame = make_frame(network, 7, steps=100_000)
    inputs = replace(inputs, boundaries=np.full_like(inputs.boundaries, 30.0))
    n, steps = len(network.nodes), len(inputs.features)
    at_rest = FilterStart(np.full(n, 30.0), np.full(n, 4.0), 1e-3)
    truth = simulate(indexed(network), inputs, at_rest.temperatures)
    exact = [
        Reading(Sensor(name, {name: 1.0}, time_constant_s=tau), truth[:-1, i], np.zeros(steps), np.full(steps, 1e-8))
        for i, (name, tau) in enumerate([("n0", 0.0), ("n1", 3.0)])
    ]
    of = inputs_of(network, inputs, at_rest, [heat(5.0, "n2")], exact)
    run, found = run_of(of), courses(of)
    run.begin(of)
    for _ in range(10):
        through(run.plan, run.readings, run.m, run.at, of.given(), found)
        assert (found.spreads > 0).all()
        covariance = run.covariance()
        assert (covariance == covariance.T).all()
        assert np.linalg.eigvalsh(covariance).min() > 0


def test_the_likelihood_chooses_a_slow_walk_for_a_steady_heat_and_a_fast_one_for_jumps(
    network: Network, inputs: Frame
) -> None:
    at_start, quarter = start(network, 0.1), len(inputs.features) // 4
    plain = simulate(indexed(network), inputs, at_start.temperatures)
    loss = float(source_heat(network, inputs, plain).sum(axis=1).mean())
    jumping = [at_start.temperatures[None, :]]
    for i in range(4):
        part = slice(i * quarter, (i + 1) * quarter)
        heated = indexed(with_heat(network, 300.0 if i % 2 else 1.0))
        inside = Frame(inputs.step_s, inputs.features[part], inputs.boundaries[part])
        jumping.append(simulate(heated, inside, jumping[-1][-1])[1:])
    walk = 0.001 * loss
    (steady,), (jumps,) = (
        at_their_pace(network, inputs, at_start, [heat(walk)], readings(network, inputs, truth))
        for truth in (plain, np.concatenate(jumping))
    )
    assert isinstance(steady, UnknownHeat)
    assert isinstance(jumps, UnknownHeat)
    assert steady.walk_W < 0.1 * walk
    assert jumps.walk_W > walk

    def likelihood(found: UnknownHeat, pace: float) -> float:
        slower = [replace(found, walk_W=found.walk_W * pace)]
        given = readings(network, inputs, np.concatenate(jumping))
        return filter_unknowns(network, inputs, at_start, slower, given).log_likelihood

    best = likelihood(jumps, 1.0)
    assert best > likelihood(jumps, 1.5)
    assert best > likelihood(jumps, 1 / 1.5)


def test_other_walks_are_taken_without_asking_the_network_again(network: Network, inputs: Frame) -> None:
    channels = readings(network, inputs, np.full((len(inputs.features) + 1, len(network.nodes)), 65.0))
    faster = [replace(u, walk_W=5.0) if isinstance(u, UnknownHeat) else u for u in MIXED]
    again = with_walks(inputs_of(network, inputs, start(network), MIXED, channels), faster)
    asked = inputs_of(network, inputs, start(network), faster, channels)
    assert again.unknowns == asked.unknowns
    assert np.array_equal(again.parts.process, asked.parts.process)


def test_what_cannot_be_filtered_is_refused(network: Network, inputs: Frame) -> None:
    steps = len(inputs.features)
    good = Reading(Sensor("T", {"teeth": 1.0}), np.full(steps, 60.0), np.zeros(steps), np.full(steps, 0.01))
    one, many = UnknownFactor("loss.magnet.scale", 0.1, 0.0), UnknownFactor("loss.magnet.tesla", 0.1, 0.0)
    cases: list[tuple[list[Unknown], Reading, FilterStart, type[Exception], str]] = [
        ([heat(1.0, "rotor")], good, start(network), FrameError, 'has no node "rotor": name one of'),
        ([heat(1.0), heat(2.0)], good, start(network), FrameError, "two unknown heats at magnet"),
        ([heat(-1.0)], good, start(network), FrameError, "a walk of at least 0"),
        ([heat(1.0, sd_W=0.0)], good, start(network), FrameError, "an sd above 0"),
        ([UnknownBias("U", 1.0)], good, start(network), FrameError, 'no channel "U" is read'),
        ([UnknownBias("T", 1.0)] * 2, good, start(network), FrameError, 'two unknown errors of channel "T"'),
        ([one, one], good, start(network), FrameError, "multiplies the same coefficient"),
        ([many], good, start(network), CauseError, '"tesla" is no law of a loss'),
        ([replace(one, of="loss.magnet.flow3")], good, start(network), FrameError, "its laws are"),
        ([replace(one, of="conductance.magnet-ambient.scale")], good, start(network), FrameError, "did you mean"),
        (
            [heat(1.0)],
            replace(good, sensor=Sensor("T", {"tooth": 1.0})),
            start(network),
            FrameError,
            'has no node "tooth"',
        ),
        ([heat(1.0)], replace(good, value=np.zeros(3)), start(network), FrameError, "give value, place and variance"),
        ([heat(1.0)], replace(good, variance=np.zeros(steps)), start(network), FrameError, "give it a noise"),
        ([heat(1.0)], good, start(network, 0.0), FrameError, "needs a standard deviation above 0"),
    ]
    for unknowns, channel, begin, error, message in cases:
        with pytest.raises(error, match=message):
            filter_unknowns(network, inputs, begin, unknowns, [channel])


def test_a_node_without_a_loss_of_its_own_can_take_the_heat(network: Network, inputs: Frame) -> None:
    truth = simulate(indexed(network), inputs, start(network).temperatures)
    none = replace(network, sources=tuple(s for s in network.sources if s.node != NODE))
    given = readings(none, inputs, truth)
    found: Estimate = filter_unknowns(none, frame(none, s2(), 0.5), start(network, 0.1, 1e-3), [heat(1.0)], given)
    assert found.found[len(found.found) // 2 :].mean() > 0
