"""What a bench shows of a motor that has a cause: the motor's balance written out by hand, the bench's errors put on as
the `[[correction]]` that takes them off says. Nothing of the twin's compiled laws, columns or actions is used here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.channel import Channel
from ingest.bench.corrections import correct, logger_lag_s, true_times, true_values
from ingest.bench.laws import Surroundings
from made.motor import AMBIENT_DEGC, CHANNELS, COOLANT_DEGC, FINE_S, SINGLE, Drive
from replay.engine.files.bench_text import corrected
from twin.motor.causes import Cause
from twin.motor.network import Network, Term
from twin.motor.outputs import lagged

Floats = NDArray[np.float64]
Readings = Mapping[str, Floats]  # channel -> its means over blocks of 10 s (B,) [degC]

AROUND_DEGC = {"coolant": COOLANT_DEGC, "ambient": AMBIENT_DEGC}
BUSES = {"W_1": "can1", "Y_1": "can2", "R_1": "can2"}
INPUT_BUS = "can3"
UNITS = {"speed": "rpm", "current": "A", "flow": "l/min"}
ATTACHED = "_attached"
INITIAL = np.array([45.0, 42.0, 41.0, 35.0])
BLOCK = round(10.0 / FINE_S)
PUT_ON = 20  # rounds, until what is taken off a reading leaves the truth
SESSION, HUNDRED_HOURS = 1.0, 0.7  # what went before the test: sessions of its kind, and hours above any limit [100 h]


# --- A motor that has a cause -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Heat:
    """Heat into one node and, in a link, out of another: `strength` (N,) [W, or W/K times the difference of both],
    times copper's factor to the power `copper`, times 1 + slope (T - reference) of node `factor`, times the mean
    temperature less `tilt`."""

    place: tuple[str, ...]
    strength: Floats
    exponents: Mapping[str, float]
    copper: int = 0
    factor: tuple[str, float, float] | None = None
    tilt: float | None = None


@dataclass(frozen=True)
class Motor:
    """`capacity` [J/K] of every node, masses behind nodes included."""

    network: Network
    capacity: Mapping[str, float]
    heats: tuple[Heat, ...]

    @classmethod
    def of(cls, network: Network, drive: Drive) -> Motor:
        laws: list[tuple[tuple[str, ...], tuple[Term, ...]]] = [((one.a, one.b), one.terms) for one in network.links]
        laws += [((one.node,), one.terms) for one in network.sources]
        heats = [_heat(place, term, drive) for place, terms in laws for term in terms]
        return cls(network, {node.name: node.capacity for node in network.nodes}, tuple(heats))

    def at(self, place: Sequence[str]) -> list[Heat]:
        return [heat for heat in self.heats if set(heat.place) == set(place)]

    def run(self, around: Mapping[str, Floats], initial: Floats) -> dict[str, Floats]:
        """Temperature of every node at the edges of the steps (N + 1,) [degC],
        by the explicit midpoint rule in steps of 0.5 s."""
        nodes, boundaries = list(self.capacity), list(around)
        index = {name: i for i, name in enumerate([*nodes, *boundaries])}
        slope = self._slope(index, len(nodes))
        outside = np.column_stack(list(around.values()))
        edges = np.empty((len(outside) + 1, len(nodes)))
        begins = dict(zip((node.name for node in self.network.nodes), initial.tolist(), strict=False))
        edges[0] = [begins[name.removesuffix(ATTACHED)] for name in nodes]  # masses stand behind the nodes
        for k, out in enumerate(outside):
            middle = edges[k] + FINE_S / 2 * slope(k, np.append(edges[k], out))
            edges[k + 1] = edges[k] + FINE_S * slope(k, np.append(middle, out))
        return {name: edges[:, i] for name, i in index.items() if i < len(nodes)}

    def _slope(self, index: Mapping[str, int], nodes: int) -> Callable[[int, Floats], Floats]:
        """dT/dt (n,) in step k at temperatures (n + boundaries,)."""
        heats, copper = self.heats, self.network.copper
        a, b = (np.array([index[heat.place[i]] for heat in heats]) for i in (0, -1))
        strength = np.array([heat.strength for heat in heats]).T
        own = np.array([heat.copper for heat in heats])
        factors = [heat.factor or (heat.place[0], 0.0, 0.0) for heat in heats]
        at, per_K, reference = (np.array([f[i] if i else index[f[0]] for f in factors]) for i in range(3))
        tilted = np.array([heat.tilt is not None for heat in heats])
        tilt = np.array([heat.tilt or 0.0 for heat in heats])
        capacity = np.array(list(self.capacity.values()))

        def slope(k: int, t: Floats) -> Floats:
            heat = strength[k] * np.where(a == b, 1.0, t[b] - t[a])
            heat *= (1 + copper.alpha_per_K * (t[a] - copper.reference_degC)) ** own
            heat *= 1 + per_K * (t[at] - reference)
            heat *= np.where(tilted, (t[a] + t[b]) / 2 - tilt, 1.0)
            net = np.bincount(a, heat, len(index)) - np.bincount(b, np.where(a == b, 0.0, heat), len(index))
            return np.asarray(net[:nodes] / capacity)

        return slope


def _heat(place: tuple[str, ...], term: Term, drive: Drive) -> Heat:
    own = 1 if term.copper else term.resistance
    factor = term.temperature
    of_node = None if factor is None else (factor.node, factor.slope_per_K, factor.reference_degC)
    return Heat(place, term.coefficient * _product(term.exponents, drive), term.exponents, own, of_node)


def _product(exponents: Mapping[str, float], drive: Drive) -> Floats:
    ones = np.ones(len(drive["speed"]))
    return np.asarray(np.prod([ones, *(drive[feature] ** e for feature, e in exponents.items())], axis=0))


def with_cause(motor: Motor, cause: Cause, places: Sequence[Sequence[str]], amount: float, drive: Drive) -> Motor:
    """The motor with so much of a cause of its own: of `loss`, `conductance`, `capacity` or `ageing`."""
    own = [heat for place in places for heat in motor.at(place)]
    match cause.kind, cause.law:
        case "capacity", "scale":
            held = {place[0]: motor.capacity[place[0]] * np.exp(amount) for place in places}
            return replace(motor, capacity={**motor.capacity, **held})
        case "capacity", "attached":
            return _with_mass(motor, [place[0] for place in places], amount)
        case _, "scale":
            return _times(motor, own, np.exp(amount))
        case _, "session":
            return _times(motor, own, np.exp(amount * SESSION))
        case "ageing", _:
            return _times(motor, own, np.exp(amount * HUNDRED_HOURS))
        case _, "temperature":
            tilted = [tilt for place in places for tilt in _tilted(motor, place, amount / len(places))]
            return replace(motor, heats=(*motor.heats, *tilted))
        case _, _:
            product = _product(cause.exponents, drive)
            strength = amount * product / np.sqrt(np.mean(product**2))
            added = [Heat(tuple(place), strength, cause.exponents, _like(motor, place, cause)) for place in places]
            return replace(motor, heats=(*motor.heats, *added))


def in_slower_time(motor: Motor, share: float) -> Motor:
    """The motor with everything in it slower by a share."""
    return replace(motor, capacity={name: held * (1 + share) for name, held in motor.capacity.items()})


def _times(motor: Motor, those: Sequence[Heat], factor: float) -> Motor:
    heats = tuple(
        replace(h, strength=h.strength * factor) if any(h is one for one in those) else h for h in motor.heats
    )
    return replace(motor, heats=heats)


def _with_mass(motor: Motor, nodes: Sequence[str], amount: float, lag_s: float = 300.0) -> Motor:
    """So many J/K behind each node, which follow it with a time constant. There is no mass of 0."""
    if amount == 0.0:
        return motor
    strength = np.full(len(motor.heats[0].strength), amount / lag_s)
    added = tuple(Heat((node, f"{node}{ATTACHED}"), strength, {}) for node in nodes)
    held = {f"{node}{ATTACHED}": amount for node in nodes}
    return replace(motor, capacity={**motor.capacity, **held}, heats=(*motor.heats, *added))


def _like(motor: Motor, place: Sequence[str], cause: Cause) -> int:
    """Copper's power in the place's own law of the same product, which one more of it shares."""
    return next((h.copper for h in motor.at(place) if dict(h.exponents) == cause.exponents), 0)


def _tilted(motor: Motor, place: Sequence[str], amount: float) -> list[Heat]:
    """Heats at a place that grow with its temperature over its mean:
    together `amount` [W or W/K] in root mean square."""
    around = {name: np.full(len(motor.heats[0].strength), AROUND_DEGC[name]) for name in AROUND_DEGC}
    ran = motor.run(around, INITIAL)
    middle = {name: (t[:-1] + t[1:]) / 2 for name, t in ran.items()} | around
    mean = np.mean([middle[name] for name in place], axis=0)
    plain = sum((heat.strength for heat in motor.at(place)), np.zeros_like(mean))
    size = float(np.sqrt(np.mean((plain * (mean - mean.mean())) ** 2)))
    tilt = float(mean.mean())
    return [Heat(h.place, h.strength * amount / size, h.exponents, tilt=tilt) for h in motor.at(place)]


# --- A bench that has one ---------------------------------------------------------------------------------------------


def bench_text() -> str:
    """The bench of `made.motor`: its channels, inputs and boundaries."""
    tables = ['schema = "whyhot.bench/1"']
    for name in SINGLE:
        tables.append(f'[[channel]]\nsignal = "{name}"\nquantity = "{name}"\nunit = "{UNITS[name]}"')
    places = {name: (f"weights = {_table(weights)}", tau_s) for name, (weights, tau_s) in CHANNELS.items()}
    places |= {name: (f'node = "{name}"', 0.0) for name in AROUND_DEGC}
    for name, (where, tau_s) in places.items():
        tables.append(f'[[channel]]\nsignal = "{name}"\nquantity = "temperature"\nunit = "degC"\n{where}')
        tables[-1] += f"\ntime_constant_s = {tau_s}"
    return "\n".join(tables) + "\n"


def _table(weights: Mapping[str, float]) -> str:
    return "{" + ", ".join(f"{node} = {share}" for node, share in weights.items()) + "}"


def bench_with(cause: str, amount: float) -> Bench:
    """The bench file with a correction written into it, read again."""
    return read_bench(corrected(bench_text().encode(), "bench.toml", {cause: amount}, "A test."), "bench.toml")


def shown(bench: Bench, network: Network, drive: Drive, has: Callable[[Motor, Drive], Motor] | None = None) -> Readings:
    """What the channels show where the inputs are recorded as `drive`,
    all errors being those that the bench file takes off.

    `has`: the motor as it truly is, made from the one of the file and its true drive."""
    under = correct(bench.name, bench.channels, bench.corrections)
    by_name = {channel.name: (channel, steps) for channel, steps in zip(under.channels, under.steps, strict=True)}
    steps = len(drive["speed"])
    edges_s = FINE_S * np.arange(steps + 1, dtype=np.float64)
    middle_s = edges_s[:-1] + FINE_S / 2
    known = {"ambient": np.full(steps + 1, AROUND_DEGC["ambient"])}
    for name in ("speed", "current"):
        known[name] = np.interp(edges_s, middle_s, drive[name] * network.scale[name])

    def true(name: str, recorded: Floats, t_s: Floats) -> Floats:
        beside = Surroundings(t_s / 3600, {one: u[: recorded.size] for one, u in known.items()})
        return np.asarray(true_values(recorded, by_name[name][1], beside))

    stamps_s = _true_times_s(bench, INPUT_BUS, middle_s)
    inputs = {
        name: np.interp(middle_s, stamps_s, true(name, u * network.scale[name], middle_s)) / network.scale[name]
        for name, u in drive.items()
    }
    around = {name: true(name, np.full(steps, degC), middle_s) for name, degC in AROUND_DEGC.items()}
    motor = Motor.of(network, inputs)
    ran = (has(motor, inputs) if has else motor).run(around, INITIAL)
    found = {}
    for name, bus in BUSES.items():
        channel = by_name[name][0]
        tau_s = channel.time_constant_s + logger_lag_s(bench.corrections, bus)
        truth = lagged(_followed(channel, ran), tau_s, FINE_S)
        reading = truth
        for _ in range(PUT_ON):
            reading = reading + truth - true(name, reading, edges_s)
        stamped = np.interp(_true_times_s(bench, bus, edges_s), edges_s, reading)
        found[name] = ((stamped[:-1] + stamped[1:]) / 2).reshape(-1, BLOCK).mean(axis=1)
    return found


def _followed(channel: Channel, ran: Readings) -> Floats:
    shares = channel.weights or {str(channel.node): 1.0}
    return np.asarray(np.sum([share * ran[node] for node, share in shares.items()], axis=0))


def _true_times_s(bench: Bench, bus: str, t_s: Floats) -> Floats:
    return true_times(np.rint(t_s * 1e9).astype(np.int64), bench.corrections, bus, 0) / 1e9
