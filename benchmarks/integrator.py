"""Which integrator, at which step: error against a tight solution and time, for kinds of drive; of the default, for
every shipped motor, template and configuration.

    python benchmarks/integrator.py [--quick] [--json FILE]

Inputs are held over each step, as in a replay, so the error is the integrator's alone. Reference: scipy's DOP853 from
step to step, rtol 1e-10, with every temperature dependence, law and circuit as the motor file says it.
docs/integrator.md holds the answer.
"""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent)]

from benchmarks import asked
from replay.engine.files.motor_file import read_motor
from replay.engine.results.kernel_cache import load
from twin.compiled.integrators import DEFAULT, SDIRK2, Tableau
from twin.compiled.kernel import STATEMENTS, compile_indexed, compile_network, generate, load_in_memory, statements
from twin.motor.configured import configured
from twin.motor.features import evaluate, is_flow, monomial, monomials
from twin.motor.network import Fluid, Network, TemperatureFactor, Term
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

EXAMPLES = Path(__file__).parents[1] / "examples"
TEMPLATES = EXAMPLES.parent / "replay" / "templates"
MOTORS = (
    "reference_motor",
    "hust_motor",
)  # on which every method and step is measured; with --quick the small one alone
STEPS_S = (0.5, 1.0, 2.0)
RATE_HZ = 10  # of the drives, before they are averaged over steps
COOLANT_DEGC, AMBIENT_DEGC = 65.0, 25.0

EULER = Tableau("euler", 1, 1.0, ((),), (1.0,), math.nan, "implicit Euler")
MIDPOINT = Tableau(
    "midpoint", 2, 0.5, ((),), (1.0,), math.nan, "implicit midpoint, the trapezoidal rule of a linear system"
)
_G3 = 0.43586652150845899942  # the root of g^3 - 3 g^2 + 3 g / 2 - 1 / 6 that makes the method L-stable
_B3 = -1.5 * _G3**2 + 4 * _G3 - 0.25
SDIRK3 = Tableau(
    "sdirk3", 3, _G3, ((), ((1 - _G3) / 2,), (_B3, 1 - _G3 - _B3)), (_B3, 1 - _G3 - _B3, _G3), math.nan, "as SDIRK2"
)
METHODS = (EULER, MIDPOINT, SDIRK2, SDIRK3)


# --- Drives: speed and current as fractions of the motor's scale, at 10 Hz --------------------------------------------


def s1() -> dict[str, Floats]:
    """30 min at 40 % speed and half current, from rest."""
    t = np.arange(1800 * RATE_HZ) / RATE_HZ
    on = (t >= 20.3).astype(float)
    return {"speed": 0.4 * on, "current": 0.5 * on}


def s2() -> dict[str, Floats]:
    """Full current for 10, 30 and 60 s, with rests of 3 min, at two speeds."""
    t = np.arange(1200 * RATE_HZ) / RATE_HZ
    starts, lengths, speeds = (60.3, 250.3, 460.3, 700.3, 900.3), (10, 30, 60, 10, 30), (0.2, 0.2, 0.2, 0.8, 0.8)
    current, speed = np.full(t.size, 0.05), np.full(t.size, 0.1)
    for start, length, fraction in zip(starts, lengths, speeds, strict=True):
        inside = (t >= start) & (t < start + length)
        current[inside], speed[inside] = 1.0, fraction
    return {"speed": speed, "current": current}


def wltp_like() -> dict[str, Floats]:
    """30 min of trips with the lengths, top speeds and accelerations of the WLTC's four parts (UN GTR 15), from a fixed
    seed."""
    rng = np.random.default_rng(15)
    corners_t, corners_v = [0.0, 11.0], [0.0, 0.0]
    for end, top_kmh in ((589.0, 56.5), (1022.0, 76.6), (1477.0, 97.4), (1800.0, 131.3)):
        while corners_t[-1] < end - 60:
            for target in (*rng.uniform(0.4, 1.0, 3) * top_kmh, 0.0):
                rate = rng.uniform(1.5, 5.0)  # km/h per s, up to 1.4 m/s2
                corners_t += [corners_t[-1] + abs(target - corners_v[-1]) / rate + 0.1]
                corners_v += [target]
                corners_t, corners_v = [*corners_t, corners_t[-1] + rng.uniform(3, 25)], [*corners_v, target]
    t = np.arange(1800 * RATE_HZ) / RATE_HZ
    speed = np.interp(t, corners_t, corners_v) / 150.0
    wheel = 0.03 + 0.1 * speed**2 + 12.0 * np.gradient(speed, t)  # rolling, air, inertia of 1.8 t
    return {"speed": speed, "current": np.minimum(np.abs(wheel * (speed > 0)), 1.0)}


DRIVES: Mapping[str, Callable[[], dict[str, Floats]]] = {"s1": s1, "s2": s2, "wltp_like": wltp_like}


def motor(name: str) -> Network:
    """A shipped motor by the name of its folder."""
    return read_motor((EXAMPLES / name / "motor.toml").read_bytes(), f"{name}/motor.toml")


def shipped() -> dict[str, Network]:
    """Every motor that comes along and every template, each in all its configurations, by names such as `sliced`."""
    files = {path.parent.name: path for path in sorted(EXAMPLES.glob("*/motor.toml"))}
    others = (EXAMPLES / "reference_motor" / "sliced.toml", *sorted(TEMPLATES.glob("*.toml")))
    files |= {path.stem: path for path in others}
    motors = {name: read_motor(path.read_bytes(), path.name) for name, path in files.items()}
    rigs = {f"{name} {rig.name}": configured(m, rig.name) for name, m in motors.items() for rig in m.configurations}
    return {name: configured(m, None) for name, m in motors.items()} | rigs


def frame(network: Network, drive: Mapping[str, Floats], step_s: float) -> Frame:
    """The drive as a replay sees it: features at 10 Hz, averaged over each step. Torque goes with current, voltage with
    speed, and every fluid flows as it does at most."""
    samples = round(step_s * RATE_HZ)
    length = len(drive["speed"]) // samples * samples
    flows = {feature for m in monomials(network) for feature in m.features if is_flow(feature)}
    u = {name: values[:length] for name, values in drive.items()}
    u |= {"torque": u["current"], "voltage": u["speed"], **dict.fromkeys(flows, np.ones(length))}
    phi = evaluate(monomials(network), u, length)
    means = phi.reshape(-1, samples, phi.shape[1]).mean(axis=1)
    around = [AMBIENT_DEGC if b.name == "ambient" else COOLANT_DEGC for b in network.boundaries]
    return Frame(step_s, means, np.tile(around, (len(means), 1)))


def initial_of(network: Network) -> Floats:
    """A motor at the temperature of its coolant."""
    return np.full(len(network.nodes), COOLANT_DEGC)


# --- The tight solution -----------------------------------------------------------------------------------------------


class Physics:
    """dT/dt of a network by the definitions of `twin.motor.network` and `docs/motor_file.md`, term by term: nothing is
    shared with the kernels."""

    def __init__(self, network: Network) -> None:
        self.index = {name: i for i, name in enumerate(network.names)}
        self.capacity = np.array([node.capacity for node in network.nodes])
        self.copper = network.copper
        links = [(link.a, link.b, term) for link in network.links for term in link.terms]
        sources = [(source.node, source.node, term) for source in network.sources for term in source.terms]
        self.links = len(links)
        self.a = np.array([self.index[a] for a, _, _ in links + sources])
        self.b = np.array([self.index[b] for _, b, _ in links + sources])
        terms = [term for _, _, term in links + sources]
        column = {m: j for j, m in enumerate(monomials(network))}
        self.coefficient = np.array([term.coefficient for term in terms])
        self.column = np.array([column.get(monomial(term), -1) for term in terms])  # -1: the 1 behind the features
        self.power = np.array([1 if t.copper else t.resistance for _, _, t in sources])
        factors = [t.temperature or TemperatureFactor(network.nodes[0].name, 0.0, 0.0) for t in terms]
        self.other = np.array([self.index[f.node] for f in factors])
        self.slope = np.array([f.slope_per_K for f in factors])
        self.reference = np.array([f.reference_degC for f in factors])
        self.radiating, self.convecting = (
            np.array([i for i, (_, _, term) in enumerate(links) if term.law == law], dtype=np.intp)
            for law in ("radiation", "free_convection")
        )
        self.streams = [
            (
                column[monomial(Term(1.0, {c.flow: 1.0}))],
                network.scale[c.flow.partition("_")[0]] / 60_000,
                c,
                before,
                node,
            )
            for c in network.circuits
            for before, node in zip((c.inlet, *c.nodes), c.nodes, strict=False)
        ]

    def _drops(self, a: Floats, b: Floats) -> Floats:
        """(links,) [K]: what drives the heat of each link's term from b to a."""
        found = b - a
        radiating, convecting = self.radiating, self.convecting
        hot, cold = b[radiating] + 273.15, a[radiating] + 273.15
        found[radiating] = (hot**4 - cold**4) / (4 * 293.15**3)
        found[convecting] *= ((found[convecting] ** 2 + 0.01) / 100.01) ** 0.125
        return found

    def rate(self, phi: Floats, around: Floats) -> Callable[[float, Floats], Floats]:
        """The function of (t, T (n,)) [K/s] at features (m,) and boundaries (b,)."""
        strength = self.coefficient * np.append(phi, 1.0)[self.column]
        n, k = self.capacity.size, self.links

        def rate(_: float, T: Floats) -> Floats:
            every = np.concatenate([T, around])
            q = strength * (1 + self.slope * (every[self.other] - self.reference))
            q[:k] *= self._drops(every[self.a[:k]], every[self.b[:k]])
            q[k:] *= (1 + self.copper.alpha_per_K * (every[self.a[k:]] - self.copper.reference_degC)) ** self.power
            into = np.bincount(self.a, q, every.size) - np.bincount(self.b[:k], q[:k], every.size)
            for j, m3_per_s, circuit, before, node in self.streams:
                come, here = every[self.index[before]], self.index[node]
                into[here] += _volume(circuit.fluid, come) * phi[j] * m3_per_s * (come - every[here])
            result: Floats = into[:n] / self.capacity
            return result

        return rate


def _volume(fluid: Fluid, degC: float) -> float:
    """rho cp [J/(m3 K)], linear between the temperatures of both tables."""
    knots = sorted({*fluid.density.degC, *fluid.heat_capacity.degC})
    return float(np.interp(degC, knots, [fluid.at(knot) for knot in knots]))


def tight(network: Network, inputs: Frame) -> Floats:
    """(N + 1, n) [degC] to about 1e-8 K: DOP853 over each step."""
    physics, out = Physics(network), [initial_of(network)]
    for phi, around in zip(inputs.features, inputs.boundaries, strict=True):
        done = solve_ivp(physics.rate(phi, around), (0, inputs.step_s), out[-1], method="DOP853", rtol=1e-10, atol=1e-9)
        out.append(done.y[:, -1])
    return np.array(out)


def bdf2(network: Network, inputs: Frame) -> Floats:
    """The paper's integrator (its section 4), by Newton's method with a difference Jacobian; first step implicit
    Euler."""
    initial = initial_of(network)
    physics, n, h = Physics(network), initial.size, inputs.step_s
    out, before = [initial], initial
    for phi, around in zip(inputs.features, inputs.boundaries, strict=True):
        rate = physics.rate(phi, around)
        first = len(out) == 1
        known, weight = (out[-1], h) if first else ((4 * out[-1] - before) / 3, 2 * h / 3)
        T = out[-1].copy()
        at = rate(0.0, T)
        jacobian = np.stack([rate(0.0, T + e) - at for e in np.eye(n)], axis=1)
        matrix = np.linalg.inv(np.eye(n) - weight * jacobian)
        for _ in range(3):
            T = T - matrix @ (T - known - weight * rate(0.0, T))
        before = out[-1]
        out.append(T)
    return np.array(out)


# --- The measurement --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Error:
    """Largest error over all nodes and steps [K], `node` where it is, of one method and step on one drive of one
    motor."""

    motor: str
    drive: str
    method: str
    step_s: float
    error_K: float
    node: str


def errors(motors: Sequence[str], of: Callable[[Frame], Frame]) -> list[Error]:
    """Every method, step, drive and motor against the tight solution on the same held inputs; `of`: which part of
    them."""
    found = []
    for name in motors:
        network = motor(name)
        methods: dict[str, Callable[[Frame], Floats]] = {t.name: _method(network, t) for t in METHODS}
        methods["bdf2"] = partial(bdf2, network)
        for drive, make in DRIVES.items():
            for step_s in STEPS_S:
                inputs = of(frame(network, make(), step_s))
                truth = tight(network, inputs)
                for method, run in methods.items():
                    off = np.abs(run(inputs) - truth)
                    node = network.nodes[int(off.max(axis=0).argmax())].name
                    found.append(Error(name, drive, method, step_s, float(off.max()), node))
    return found


def default_errors(motors: Mapping[str, Network], of: Callable[[Frame], Frame]) -> list[Error]:
    """The default integrator at its own step; of motors without a kernel of their own, the window alone."""
    found = []
    for name, network in motors.items():
        large = statements(generate(network)) > STATEMENTS
        run = compile_indexed(network, load=load) if large else compile_network(network, load=load)
        for drive, make in DRIVES.items():
            inputs = (window if large else of)(frame(network, make(), DEFAULT.step_s))
            off = np.abs(simulate(run, inputs, initial_of(network)) - tight(network, inputs))
            node = network.nodes[int(off.max(axis=0).argmax())].name
            found.append(Error(name, drive, DEFAULT.name, DEFAULT.step_s, float(off.max()), node))
    return found


def whole(inputs: Frame) -> Frame:
    return inputs


def window(inputs: Frame, until_s: float = 570.0) -> Frame:
    """From 450 s on: in s2 the pulse of 60 s."""
    part = slice(round(450 / inputs.step_s), round(until_s / inputs.step_s))
    return Frame(inputs.step_s, inputs.features[part], inputs.boundaries[part])


def _method(network: Network, tableau: Tableau) -> Callable[[Frame], Floats]:
    compiled = compile_network(network, tableau, load)
    return lambda inputs: simulate(compiled, inputs, initial_of(network))


def held(motor_name: str) -> list[dict[str, object]]:
    """What holding the mean input over a step costs [K] at the ends of steps, against the same method at 0.1 s."""
    network, rows = motor(motor_name), []
    run = _method(network, DEFAULT)
    for drive, make in DRIVES.items():
        fine = run(frame(network, make(), 1 / RATE_HZ))
        for step_s in STEPS_S:
            coarse = run(frame(network, make(), step_s))
            off = np.abs(coarse - fine[:: round(step_s * RATE_HZ)][: len(coarse)]).max()
            rows.append({"drive": drive, "step_s": step_s, "error_K": float(off)})
    return rows


def best_of(
    rounds: int, runs: Mapping[str, Callable[[], object]], clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """Shortest time [s] of each, interleaved so that a noisy machine is noisy to all."""
    best = dict.fromkeys(runs, math.inf)
    for _ in range(rounds):
        for name, run in runs.items():
            start = clock()
            run()
            best[name] = min(best[name], clock() - start)
    return best


def times(motor_name: str, rounds: int) -> dict[str, float]:
    """Time a simulated second of each method and step, WLTP-like drive, times that of sdirk2 at 0.5 s."""
    network = motor(motor_name)
    runs: dict[str, Callable[[], object]] = {}
    for tableau in METHODS:
        run = _method(network, tableau)
        for step_s in STEPS_S:
            inputs = frame(network, wltp_like(), step_s)
            runs[f"{tableau.name} {step_s:g} s"] = partial(run, inputs)
    best = best_of(rounds, runs)
    return {name: value / best["sdirk2 0.5 s"] for name, value in best.items()}


def speed(motor_name: str, rounds: int) -> dict[str, float]:
    """The default run: time a step, against the index program and scipy's LSODA, and the processor time of a first and
    a later start."""
    network = motor(motor_name)
    inputs = frame(network, wltp_like(), DEFAULT.step_s)
    start = initial_of(network)
    source = generate(network)
    straight, indexed = compile_network(network, load=load), compile_indexed(network, load=load)
    best = best_of(
        rounds,
        {"straight": lambda: simulate(straight, inputs, start), "indexed": lambda: simulate(indexed, inputs, start)},
    )
    slow = best_of(1, {"lsoda": lambda: lsoda(network, inputs, start)})["lsoda"]
    steps = len(inputs.features)
    return {
        "statements": statements(source),
        "us_per_step": best["straight"] / steps * 1e6,
        "indexed_over_straight": best["indexed"] / best["straight"],
        "lsoda_over_straight": slow / best["straight"],
        "compile_s": _processor_time(lambda: load_in_memory(source)),
        **_later_start(motor_name),
    }


def lsoda(network: Network, inputs: Frame, initial: Floats) -> None:
    """scipy's LSODA, begun anew at each step, as inputs jump there."""
    physics, T = Physics(network), initial
    for phi, around in zip(inputs.features, inputs.boundaries, strict=True):
        T = solve_ivp(physics.rate(phi, around), (0, inputs.step_s), T, method="LSODA", max_step=inputs.step_s).y[:, -1]


def _processor_time(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def _later_start(motor_name: str) -> dict[str, float]:
    """A new process with a warm cache: processor seconds to import numba, and from there to a kernel ready."""
    code = (
        "import time; start = time.process_time()\n"
        "import numba; imported = time.process_time()\n"
        "from benchmarks.integrator import motor\n"
        "from replay.engine.results.kernel_cache import load_kernel\n"
        f"network = motor({motor_name!r}); began = time.process_time()\n"
        "load_kernel(network)\n"
        "print(imported - start, time.process_time() - began)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=EXAMPLES.parent)
    imported, loaded = (float(value) for value in done.stdout.split())
    return {"import_numba_s": imported, "later_start_s": loaded}


def _table(motors: Sequence[str], found: list[Error], ratio: Mapping[str, float]) -> str:
    rows = [
        "| method | step | time | "
        + " | ".join(f"{m.removesuffix('_motor')} {d}" for m in motors for d in DRIVES)
        + " |"
    ]
    rows.append("|---" * (3 + len(motors) * len(DRIVES)) + "|")
    for method in (*(t.name for t in METHODS), "bdf2"):
        for step_s in STEPS_S:
            cells = [
                e.error_K
                for m in motors
                for d in DRIVES
                for e in found
                if (e.motor, e.drive, e.method, e.step_s) == (m, d, method, step_s)
            ]
            relative = ratio.get(f"{method} {step_s:g} s")
            shown = f"{relative:.2f}" if relative else ""
            rows.append(f"| {method} | {step_s:g} s | {shown} | " + " | ".join(f"{c:.4f}" for c in cells) + " |")
    return "\n".join(rows)


def main() -> None:
    arguments = asked.parser(__doc__).parse_args()
    quick = arguments.quick
    motors, rounds = (MOTORS[1:], 1) if quick else (MOTORS, 15)
    every = {name: motor(name) for name in motors} if quick else shipped()
    part = partial(window, until_s=480.0) if quick else whole
    found, others, holding = errors(motors, part), default_errors(every, part), held(motors[0])
    ratio, default = times(motors[0], rounds), speed(motors[0], rounds)
    print("Largest error [K] over all nodes, and time a simulated second (sdirk2 at 0.5 s = 1)\n")
    print(_table(motors, found, ratio), end="\n\n")
    for e in others:
        print(f"{e.method} at {e.step_s:g} s, {e.motor}, {e.drive}: {e.error_K:.4f} K ({e.node})")
    for row in holding:
        print(f"held means, {row['drive']}, {row['step_s']} s: {row['error_K']:.3f} K at the ends of steps")
    print("\n".join(f"{name} {value:.3g}" for name, value in default.items()))
    errors_K = [asdict(e) for e in (*found, *others)]
    asked.keep({"errors": errors_K, "held": holding, "time_ratio": ratio, "default": default}, arguments.json)
    worst = max(e.error_K for e in (*found, *others) if (e.method, e.step_s) == (DEFAULT.name, DEFAULT.step_s))
    print(f"{DEFAULT.name} at {DEFAULT.step_s:g} s: largest error {worst:.4f} K")
    if worst > 0.01:
        sys.exit("the default integrator is off by more than 0.01 K")


if __name__ == "__main__":
    main()
