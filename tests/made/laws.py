"""Random networks with circuits, radiation and free convection, and what they do by definition, term by term."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from twin.motor.features import Monomial, evaluate, monomial, monomials
from twin.motor.network import Fluid, FluidCircuit, Link, Network, Node, Property, TemperatureFactor, Term
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

GLYCOL = Fluid(Property((0.0, 40.0, 100.0), (1080.0, 1060.0, 1015.0)), Property((20.0, 60.0), (3300.0, 3550.0)))
OIL = Fluid(Property((20.0,), (850.0,)), Property((20.0,), (2000.0,)))


def with_laws(network: Network, seed: int) -> Network:
    """A network with nodes n0 ... and boundaries coolant and ambient, its flows of fluid and its bent laws added."""
    rng = np.random.default_rng(seed)
    bodies = [node.name for node in network.nodes]
    fluids = ("jacket_0", "jacket_1", "jacket_2")

    def some() -> float:
        return float(rng.uniform(0.5, 10.0))

    def factor() -> TemperatureFactor:
        return TemperatureFactor(bodies[int(rng.integers(len(bodies)))], 0.002, 40.0)

    films = [
        Link(fluid, bodies[int(rng.integers(len(bodies)))], (Term(5 * some(), {"flow": 0.8}), Term(some())))
        for fluid in fluids
    ]
    radiating = Link(bodies[0], "ambient", (Term(some(), law="radiation"), Term(some(), law="free_convection")))
    across = Link(
        bodies[-1],
        "jacket_1",
        (Term(some(), law="radiation"), Term(some(), {"speed": 0.5}, law="free_convection", temperature=factor())),
    )
    places = {frozenset((link.a, link.b)): link for link in (*network.links, *films, radiating, across)}
    return replace(
        network,
        name=f"{network.name}-laws",
        nodes=(*network.nodes, *(Node(name, float(rng.uniform(100, 400)), "fluid") for name in fluids)),
        links=tuple(places.values()),
        circuits=(
            FluidCircuit("jacket", "coolant", fluids, GLYCOL),
            FluidCircuit("oil", "ambient", (bodies[0], "jacket_2", bodies[-1]), OIL, "flow_oil"),
        ),
        scale={**network.scale, "flow": 0.05},
    )


def law_frame(network: Network, seed: int, steps: int, step_s: float) -> Frame:
    """Features that jump every few steps, boundaries that drift."""
    rng = np.random.default_rng(seed)
    names = ("speed", "current", "flow", "flow_oil")
    u = {name: np.repeat(rng.random(steps // 4 + 1), 4)[:steps] for name in names}
    around = 30 + np.cumsum(rng.normal(0, 0.2, (steps, len(network.boundaries))), axis=0)
    return Frame(step_s, evaluate(monomials(network), u, steps), around)


@dataclass(frozen=True)
class Heats:
    """Heat [W] by where it comes from: `losses`; `given` by boundaries through links; `carried` in by fluids, less
    what they take out. `into` (n,): all of it, and what flows between nodes, by the node that it flows into."""

    losses: float
    given: float
    carried: float
    into: Floats


def heats(network: Network, phi: Mapping[Monomial, float], at: Mapping[str, float]) -> Heats:
    """The heats at one moment. `phi`: monomial -> value; `at`: node or boundary -> degC."""
    nodes = {node.name: i for i, node in enumerate(network.nodes)}
    into = np.zeros(len(nodes))
    losses = given = carried = 0.0

    def amount(term: Term) -> float:
        found = term.coefficient * phi.get(monomial(term), 1.0)
        if term.temperature is not None:
            factor = term.temperature
            found *= 1 + factor.slope_per_K * (at[factor.node] - factor.reference_degC)
        return found

    for link in network.links:
        a, b = at[link.a], at[link.b]
        drops = {
            None: b - a,
            "radiation": ((b + 273.15) ** 4 - (a + 273.15) ** 4) / (4 * 293.15**3),
            "free_convection": (((b - a) ** 2 + 0.01) / 100.01) ** 0.125 * (b - a),
        }
        heat = sum(amount(term) * drops[term.law] for term in link.terms)
        for end, sign in ((link.a, 1), (link.b, -1)):
            if end in nodes:
                into[nodes[end]] += sign * heat
            else:
                given -= sign * heat
    for source in network.sources:
        resistance = 1 + network.copper.alpha_per_K * (at[source.node] - network.copper.reference_degC)
        heat = sum(amount(t) * resistance ** (1 if t.copper else t.resistance) for t in source.terms)
        losses += heat
        into[nodes[source.node]] += heat
    for circuit in network.circuits:
        flow = phi[monomial(Term(1.0, {circuit.flow: 1.0}))] * network.scale["flow"] / 60_000
        for before, node in zip((circuit.inlet, *circuit.nodes), circuit.nodes, strict=False):
            heat = _volume(circuit.fluid, at[before]) * flow * (at[before] - at[node])
            carried += heat
            into[nodes[node]] += heat
    return Heats(losses, given, carried, into)


def _volume(fluid: Fluid, degC: float) -> float:
    """rho cp [J/(m3 K)] of a fluid, linear between the knots of both tables."""
    knots = sorted({*fluid.density.degC, *fluid.heat_capacity.degC})
    rho = np.interp(knots, fluid.density.degC, fluid.density.value)
    cp = np.interp(knots, fluid.heat_capacity.degC, fluid.heat_capacity.value)
    return float(np.interp(degC, knots, rho * cp))


def rate(network: Network, phi: Floats, around: Floats) -> Callable[[float, Floats], Floats]:
    """dT/dt [K/s] at features (m,) and boundaries (b,)."""
    named = dict(zip(monomials(network), phi.tolist(), strict=True))
    capacity = np.array([node.capacity for node in network.nodes])

    def found(_: float, T: Floats) -> Floats:
        at = dict(zip(network.names, np.concatenate([T, around]).tolist(), strict=True))
        slopes: Floats = heats(network, named, at).into / capacity
        return slopes

    return found


def tight_laws(network: Network, inputs: Frame, initial: Floats) -> Floats:
    """Temperatures (N + 1, n) [degC], right to about 1e-8 K."""
    out = [initial]
    for phi, around in zip(inputs.features, inputs.boundaries, strict=True):
        f = rate(network, phi, around)
        done = solve_ivp(f, (0, inputs.step_s), out[-1], method="DOP853", rtol=1e-9, atol=1e-9)
        out.append(done.y[:, -1])
    return np.array(out)
