"""A motor of four nodes that uses every law, and tests of it as a bench would record them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from twin.compiled.kernel import Compiled, compile_network
from twin.compiled.structure import described
from twin.fitting import actions
from twin.fitting.actions import Place
from twin.fitting.model import Test
from twin.fitting.recorded import RecordedChannel
from twin.motor.features import Monomial, evaluate, monomials, product
from twin.motor.network import Boundary, Link, Network, Node, Source, TemperatureFactor, Term
from twin.motor.outputs import lagged
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

COOLANT_DEGC, AMBIENT_DEGC = 40.0, 25.0
STEP_S, FINE_S = 2.0, 0.5
WHITE_SD, RESOLUTION, BIAS_SD = 0.05, 0.01, 0.3
SINGLE = ("speed", "current", "flow")
CHANNELS = {"W_1": ({"winding": 1.0}, 0.0), "Y_1": ({"yoke": 1.0}, 3.0), "R_1": ({"magnet": 0.7, "case": 0.3}, 6.0)}
Drive = Mapping[str, Floats]

WINDING, YOKE, MAGNET, CASE, COOLANT, AMBIENT = range(6)  # of `every_law`
# what may differ in its tests but for readings -> the action and a size of its number
ON_MOTOR: Mapping[str, tuple[actions.Action, float]] = {
    "scale of a link": (actions.Scale((0,)), 0.3),
    "scale of copper and AC loss": (actions.Scale((8, 9)), 0.2),
    "scale of a loss with a temperature factor": (actions.Scale((10,)), 0.2),
    "scale of a film with a temperature factor": (actions.Scale((5, 6)), 0.3),
    "exponent of a film": (actions.Power((2,), "flow"), 0.3),
    "exponent of a loss": (actions.Power((10, 11), "speed"), 0.3),
    "tent": (actions.Tent((10, 11), (0.0, 0.5, 1.0), 1, False), 0.2),
    "tent with current": (actions.Tent((8, 9), (0.0, 0.5, 1.0), 2, True), 0.2),
    "course": (actions.Course((12,), "session"), 0.2),
    "gain of the current": (actions.InputGain("current"), 0.02),
    "gain of the flow": (actions.InputGain("flow"), 0.05),
    "bias of the speed": (actions.InputBias("speed", 10000.0), 200.0),
    "heat that is not there": (actions.Added((Place(CASE),), "speed2_current2", 0.3), 20.0),
    "heat in copper": (actions.Added((Place(WINDING),), "current2", 0.4, 1), 20.0),
    "heat in inverse copper": (actions.Added((Place(WINDING),), "current2", 0.4, -1), 20.0),
    "heat at two nodes": (actions.Added((Place(YOKE), Place(MAGNET)), "constant", 1.0), 15.0),
    "path between nodes": (actions.Added((Place(WINDING, CASE),), "speed", 0.6), 2.0),
    "path to a boundary": (actions.Added((Place(MAGNET, AMBIENT),), "constant", 1.0), 1.0),
    "loss with temperature": (actions.Tilt((Place(YOKE),), ((10, 11),), (50.0,)), 0.003),
    "copper with temperature": (actions.Tilt((Place(WINDING),), ((8, 9),), (60.0,)), 0.001),
    "link with temperature": (actions.Tilt((Place(YOKE, MAGNET),), ((3, 4),), (50.0,)), 0.004),
    "film with temperature": (actions.Tilt((Place(YOKE, COOLANT),), ((1, 2),), (45.0,)), 0.004),
    "two laws with temperature": (
        actions.Tilt((Place(MAGNET), Place(CASE, AMBIENT)), ((12,), (6, 7)), (50.0, 35.0)),
        0.002,
    ),
    "capacity": (actions.Capacity((YOKE,)), 0.2),
    "capacity of two": (actions.Capacity((WINDING, CASE)), 0.2),
    "mass that follows": (actions.Attached((YOKE,), 120.0), 300.0),
    "start": (actions.Start(MAGNET), 3.0),
    "coolant bias": (actions.BoundaryBias(0), 1.0),
    "ambient bias": (actions.BoundaryBias(1), 2.0),
}


def every_law() -> Network:
    """Copper, its inverse, temperature factors on a source and on a link, links to two boundaries, several terms."""
    iron = TemperatureFactor("yoke", -0.001, 40.0)
    film = TemperatureFactor("case", 0.002, 30.0)
    return Network(
        name="every-law",
        nodes=(
            Node("winding", 900.0, "copper"),
            Node("yoke", 2500.0, "iron"),
            Node("magnet", 600.0, "magnet"),
            Node("case", 1500.0, "housing"),
        ),
        boundaries=(Boundary("coolant"), Boundary("ambient")),
        links=(
            Link("winding", "yoke", (Term(12.0),)),
            Link("yoke", "coolant", (Term(15.0), Term(10.0, {"flow": 0.8}))),
            Link("yoke", "magnet", (Term(1.5), Term(3.0, {"speed": 0.8}))),
            Link("yoke", "case", (Term(6.0, temperature=film),)),
            Link("ambient", "case", (Term(2.0, temperature=film), Term(1.0, {"speed": 0.5}))),
        ),
        sources=(
            Source(
                "winding",
                (
                    Term(500.0, {"current": 2.0}, sd=0.05, copper=True),
                    Term(150.0, {"current": 2.0, "speed": 2.0}, sd=0.15, resistance=-1),
                ),
            ),
            Source(
                "yoke",
                (
                    Term(200.0, {"speed": 1.5}, sd=0.15, temperature=iron),
                    Term(60.0, {"speed": 1.0, "current": 1.0}, sd=0.15),
                ),
            ),
            Source("magnet", (Term(80.0, {"speed": 2.0}, sd=0.3),)),
        ),
        scale={"speed": 10000.0, "current": 200.0, "flow": 10.0},
    )


def smooth(duration_s: float, step_s: float = FINE_S) -> Drive:
    """Inputs that swing in minutes."""
    t = step_s * (np.arange(round(duration_s / step_s)) + 0.5)
    return {
        "speed": 0.55 + 0.35 * np.sin(t / 170),
        "current": 0.5 + 0.3 * np.cos(t / 110),
        "flow": 0.8 + 0.2 * np.sin(t / 260),
    }


def slow(duration_s: float) -> Drive:
    """Inputs that keep each level for 15 minutes, the flow alone for 5."""
    rng = np.random.default_rng(3)
    steps = round(duration_s / FINE_S)

    def level(low: float, high: float, held_s: float) -> Floats:
        return np.repeat(rng.uniform(low, high, 200), round(held_s / FINE_S))[:steps]

    return {"speed": level(0.1, 1.0, 900), "current": level(0.1, 0.9, 900), "flow": level(0.4, 1.0, 300)}


def pulses(duration_s: float, seed: int = 0, step_s: float = FINE_S) -> Drive:
    """Inputs that jump every 40 s."""
    rng = np.random.default_rng(seed)
    steps, held = round(duration_s / step_s), round(40 / step_s)

    def jump(low: float, high: float) -> Floats:
        return np.repeat(rng.uniform(low, high, steps // held + 1), held)[:steps]

    return {"speed": jump(0.1, 1.0), "current": jump(0.1, 1.0), "flow": jump(0.5, 1.0)}


@cache
def _compiled(name: str) -> Compiled:
    return compile_network(_known[name])


_known: dict[str, Network] = {}  # name -> the first network of its laws, which stands for all that differ in numbers


def compiled(network: Network) -> Compiled:
    """The kernel of a network, compiled once for each name: networks of one name differ in coefficients and
    capacities only."""
    _known.setdefault(network.name, network)
    return replace(_compiled(network.name), network=network, parameters=described(network)[1])


def truth(network: Network, drive: Drive, initial: Floats) -> Floats:
    """Temperatures at the edges of steps of 0.5 s (N + 1, n) [degC]."""
    steps = len(drive["speed"])
    around = np.tile([COOLANT_DEGC, AMBIENT_DEGC], (steps, 1))
    return simulate(compiled(network), Frame(FINE_S, evaluate(monomials(network), drive, steps), around), initial)


def _step_means(x: Floats) -> Floats:
    """Means over steps of 2 s, of values (N, ...) at 0.5 s."""
    k = round(STEP_S / FINE_S)
    found: Floats = x[: len(x) // k * k].reshape(-1, k, *x.shape[1:]).mean(axis=1)
    return np.ascontiguousarray(found)


def recorded(
    network: Network,
    drive: Drive,
    initial: Floats,
    *,
    true: Network | None = None,
    more: Sequence[Monomial] = (),
    seed: int | None = None,
    samples: Mapping[str, Floats] | None = None,
    buses: Mapping[str, str] | None = None,
    off_K: Mapping[str, float] | None = None,
    white_sd: float = WHITE_SD,
    name: str = "test",
    course: Mapping[str, float] = MappingProxyType({"session": 1.0}),
) -> Test:
    """A test of `true` (else of `network`) as `network`'s model takes it: means over steps of 2 s of what 0.5 s steps
    gave, white noise where there is a seed; `samples` (N,) of a channel's steps, `off_K` its bias."""
    rng = None if seed is None else np.random.default_rng(seed)
    own = monomials(network)
    every = tuple(dict.fromkeys([*own, *(Monomial(((f, 1.0),)) for f in SINGLE), *more]))
    fine = _step_means(evaluate(every, drive, len(drive["speed"])))
    named = {m.name: np.ascontiguousarray(fine[:, j]) for j, m in enumerate(every)}
    steps = len(fine)
    edges = truth(true or network, drive, initial)
    channels = []
    for channel, (weights, tau_s) in CHANNELS.items():
        held = np.ones(steps) if samples is None else samples.get(channel, np.ones(steps))
        shown = lagged(edges @ [weights.get(n.name, 0.0) for n in network.nodes], tau_s, FINE_S)
        measured = _step_means((shown[:-1] + shown[1:]) / 2) + (off_K or {}).get(channel, 0.0)
        if rng is not None:
            measured = measured + rng.normal(0, white_sd / 2, steps)
        sensor = Sensor(
            channel,
            weights,
            bus=(buses or {}).get(channel, "can1"),
            noise=white_sd,
            resolution=RESOLUTION,
            bias_sd=BIAS_SD,
            time_constant_s=tau_s,
        )
        channels.append(RecordedChannel(sensor, measured, 4.0 * held, np.full(steps, 0.5)))
    return Test(
        name=name,
        kind="drive",
        frame=Frame(
            STEP_S, np.ascontiguousarray(fine[:, : len(own)]), np.tile([COOLANT_DEGC, AMBIENT_DEGC], (steps, 1))
        ),
        inputs={f: named[f] for f in SINGLE},
        features=named,
        initial=initial.copy(),
        initial_sd=np.full(len(initial), 0.3),
        channels=tuple(channels),
        course=course,
    )


def rotor_unread(test: Test) -> Test:
    """The test as a bench without the rotor's telemetry records it: no sensor follows magnet or case."""
    return replace(test, channels=tuple(c for c in test.channels if c.sensor.node in ("winding", "yoke")))


def with_copper_loss(network: Network, factor: float) -> Network:
    """The winding's loss by direct current times a factor."""
    winding, *others = network.sources
    first, *rest = winding.terms
    stronger = Source(winding.node, (replace(first, coefficient=factor * first.coefficient), *rest))
    return replace(network, sources=(stronger, *others))


def law(**exponents: float) -> Monomial:
    """A product of features."""
    return product(Term(1.0, exponents))
