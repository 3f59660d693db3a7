"""Filters against the truth and against filterpy: delay, errors at kept magnets, time.

    python benchmarks/filters.py [--seeds N] [--first SEED] [--quick] [--json FILE]

Truth: motors of `tests/plant`, each with a magnet loss that its file does not know, driven through WLTC, written as
BLF, ingested and replayed. Every filter reads endwindings A and B and the rotor's surface and estimates the magnet
loss; the magnet sensor is kept. `rotor unread`: its error where the endwindings alone are read. Delays are shifts at
which two courses go together best (correlation), in a drive whose speed steps every five minutes and the hidden loss
with it: the magnet temperature and the kept sensor; the loss found, less what the same filter finds in the same motor
without the hidden one, and that. The loss error is rms, there.

Time: the reference motor, the same steps for both in turn, best of 3. filterpy is given the compiled step and its
derivative for nothing and spends its time on its own algebra alone, so the ratio is a lower bound. Last, the smallest
eigenvalue of the covariance after a million steps with almost perfect readings.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks import asked
from benchmarks.integrator import frame, initial_of, motor, wltp_like
from benchmarks.shared import stored
from ingest.catalogue.channels import load as load_channels
from ingest.facts import facts
from made.law_heats import law_heats
from made.paper_steps import at_the_start, predict, transition
from plant import Effect, Plant, Recording, drives, sessions, write_campaign
from plant.drives import Drive
from plant.geometry import Geometry
from plant.placement import weights
from replay.engine.files.motor_file import read_motor
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.frame_of import session_frame
from replay.engine.frame.observations import Observation
from replay.engine.results.filtered import (
    at_their_paces,
    filter_start,
    heats_elsewhere,
    mean_losses,
    reading_errors,
    reading_of,
    unknown_heat,
)
from replay.engine.results.kernel_cache import load, load_kernel
from replay.engine.results.open_loop import modelled
from replay.studies.motors.scale import sliced_file
from twin.compiled.kernel import compile_indexed
from twin.filters import ukf
from twin.filters.by_filterpy import Steps
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import FilterStart, Inputs, Reading, inputs_of
from twin.filters.smoother import smoothed
from twin.filters.ukf import filter_unscented
from twin.filters.unknowns import Unknown, UnknownHeat
from twin.motor.network import Network
from twin.motor.sensor import Sensor
from twin.paper.ekf import at_edges, filter_with_rates, sensor_row
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

# At 16,000 rpm, with speed squared: with what the file has wrong besides, the open loop is about 6 K off, as in the
# paper.
HIDDEN_W = 60.0
STEPS_W, STEPS_RPM, STEPS_MIN = 600.0, (3000.0, 9000.0) * 3, 5.0  # of the drive for delays
ENDS = ("EW_A_inner", "EW_B_inner")
SEEN, KEPT = (*ENDS, "RS"), "MAG"
SETTLE_S = 300.0  # of a session: the start is not the filter's
TOP_RPM = 16_000.0
SLICES, ROTOR = 3, ("rotor_surface", "magnet", "rotor_core")


@dataclass(frozen=True)
class Row:
    """One way of estimating, on one motor."""

    name: str
    seed: int
    magnet_mae_K: float
    magnet_max_K: float
    rotor_unread_K: float
    magnet_delay_s: float
    loss_delay_s: float | None
    loss_error_W: float | None


@dataclass(frozen=True)
class Case:
    """A driven motor as the product reads it, and what the filters are given."""

    network: Network
    recorded: InputFrame
    inputs: Frame
    start: FilterStart
    channels: list[Reading]
    open_loop: Floats

    @property
    def kept(self) -> Observation:
        (kept,) = (o for o in self.recorded.observations if o.sensor.name == KEPT)
        return kept


@dataclass(frozen=True)
class Form:
    """How the files of a bench see the rotor: `weights`, where its thermocouples stand (signal -> node -> share), and
    whether the motor is cut into `SLICES` there."""

    weights: Mapping[str, Mapping[str, float]]
    cut: bool = False

    def write(self, folder: Path, plant: Plant, recordings: Sequence[Recording], layout: str) -> list[Path]:
        """A campaign as a user has it; returns its logs."""
        logs = write_campaign(folder, plant, recordings, layout=layout, weights=self.weights)
        if self.cut:
            motor = folder / "motor.toml"
            motor.write_bytes(sliced_file(motor.read_bytes(), motor.name, ROTOR, SLICES, Geometry().stack)[0])
        return logs


DELIVERED = Form({})
PLACED = Form({"RS": weights("RS")})  # between surface and end plate, by the design
# the surface's thermocouple lies in the first third of the stack, the magnet's in the middle and the first one
CUT = Form({"RS": {"rotor_surface_1": 1.0}, "MAG": {"magnet": 0.7, "magnet_1": 0.3}}, cut=True)


def case_of(
    seed: int,
    drive: Drive,
    hidden_W: float,
    network: Network | None = None,
    form: Form = DELIVERED,
    corrections: Mapping[str, float] = MappingProxyType({}),
) -> Case:
    """The specimen with or without the hidden loss, its draws the same, and its own motor file's network or the one
    given.

    `corrections`: cause -> amount, what its bench file knows to be wrong.
    """
    plant = Plant(seed, *([Effect("loss.magnet.speed2", hidden_W)] if hidden_W else []))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = form.write(folder, plant, sessions(plant, [drive], layout="paper"), "paper")
        with (folder / "bench.toml").open("a", encoding="utf-8") as bench:
            bench.writelines(f'\n[[correction]]\ncause = "{c}"\namount = {x:.3f}\n' for c, x in corrections.items())
        with stored(folder, logs) as store:
            known = facts.at(store.ledger)
            (session,) = known.sessions
            network = network or read_motor((folder / "motor.toml").read_bytes(), "motor.toml")
            recorded = session_frame(session, load_channels(store, known, session), network)
    return with_network(recorded, network)


def with_network(recorded: InputFrame, network: Network, read: Sequence[str] = SEEN) -> Case:
    """The same drive by a network that differs in its numbers, or with other channels read."""
    inputs = Frame(recorded.step_s, recorded.features, recorded.boundaries)
    seen = tuple(o for o in recorded.observations if o.sensor.name in read)
    start = filter_start(network, replace(recorded, observations=seen), "testing")
    channels = [reading_of(o, recorded) for o in seen]
    open_loop = simulate(load_kernel(network), inputs, start.temperatures)
    return Case(network, recorded, inputs, start, channels, open_loop)


def estimates(case: Case, heat: Sequence[Unknown]) -> dict[str, tuple[Floats, Floats]]:
    """Filter -> temperatures (N + 1, n) and extra loss (N,)."""
    given = (case.network, case.inputs, case.start, heat, case.channels)
    both, unscented, paper = smoothed(*given), filter_unscented(*given), filter_with_rates(*given)
    return {
        "open loop": (case.open_loop, np.zeros(len(case.open_loop) - 1)),
        "EKF": (both.filtered.temperatures, both.filtered.found[1:, 0]),
        "UKF": (unscented.temperatures, unscented.found[1:, 0]),
        "paper's form": (paper.temperatures, paper.found[1:, 0]),
        "smoother": (both.temperatures, both.found[:-1, 0]),
    }


def delay_s(estimate: Floats, truth: Floats, step_s: float, most_s: float = 120.0) -> float:
    """The shift at which two courses over the same steps go together best."""
    most = round(most_s / step_s)
    middle = slice(most, len(truth) - most)

    def together(shift: int) -> float:
        moved = estimate[most + shift : len(estimate) - most + shift]
        return float(np.corrcoef(moved, truth[middle])[0, 1])

    return float(max(range(-most, most + 1), key=together)) * step_s


def paced(case: Case, asked: Unknown | None = None, errors: Sequence[Unknown] = ()) -> list[Unknown]:
    """What is asked for, a heat of the magnets if nothing else, heats in other parts where a channel is read, and
    `errors` of the readings; with the random walks that the readings ask for."""
    losses = mean_losses(case.network, case.inputs, case.open_loop)
    asked = asked or unknown_heat("magnet", losses)
    heats = heats_elsewhere(case.network, losses, [one.sensor for one in case.channels], [asked])
    return at_their_paces(case.network, case.inputs, case.start, [asked], [*heats, *errors], case.channels)


def as_replayed(case: Case) -> list[Unknown]:
    """The unknowns that a replay has."""
    return paced(case, errors=reading_errors([one.sensor for one in case.channels]))


def rows_of(seed: int, cycles: int) -> list[Row]:
    """Open loop and every filter on one motor."""
    cycle = case_of(seed, drives.wltp(cycles), HIDDEN_W)
    ladder = drives.join("ladder", "s1", [drives.hold(rpm, 40.0, STEPS_MIN) for rpm in STEPS_RPM])
    ill, healthy = (case_of(seed, ladder, hidden_W) for hidden_W in (STEPS_W, 0.0))
    heat = as_replayed(ill)
    with_it, without = estimates(ill, heat), estimates(healthy, heat)
    unread = with_network(cycle.recorded, cycle.network, ENDS)
    from_ends = estimates(unread, as_replayed(unread))
    rows = []
    for name, (edges, _) in estimates(cycle, as_replayed(cycle)).items():
        mean, largest = errors_K(cycle, edges)
        far, _ = errors_K(unread, from_ends[name][0])
        late, loss_late, wrong = delays(ill, *with_it[name], without[name][1])
        rows.append(Row(name, seed, mean, largest, far, late, loss_late, wrong))
    return rows


def errors_K(case: Case, edges: Floats) -> tuple[float, float]:
    """Mean and largest error at the kept sensor."""
    kept, nodes = case.kept, tuple(node.name for node in case.network.nodes)
    use = kept.good & case.recorded.live
    use[: round(SETTLE_S / case.inputs.step_s)] = False
    off = np.abs(kept.measured - modelled(kept, case.recorded, edges, nodes))[use]
    return float(off.mean()), float(off.max())


def delays(case: Case, edges: Floats, watts: Floats, without_W: Floats) -> tuple[float, float | None, float | None]:
    """Of the magnet temperature and of the loss [s], and the error of the loss [W]; None for the loss of the open
    loop."""
    kept, nodes, step_s = case.kept, tuple(node.name for node in case.network.nodes), case.inputs.step_s
    steps = min(len(watts), len(without_W))
    after = slice(round(SETTLE_S / step_s), steps)
    says = modelled(kept, case.recorded, edges, nodes)
    measured = np.interp(np.arange(len(says)), np.flatnonzero(kept.good), kept.measured[kept.good])
    late = delay_s(says[after], measured[after], step_s)
    if not watts.any():
        return late, None, None
    hidden = STEPS_W * (case.recorded.inputs["speed_rpm"][after] / TOP_RPM) ** 2
    extra = (watts[:steps] - without_W[:steps])[after]
    return late, delay_s(extra, hidden, step_s), float(np.sqrt(np.mean((extra - hidden) ** 2)))


# --- Time -------------------------------------------------------------------------------------------------------------


def timed_case(steps: int) -> tuple[Network, Frame, FilterStart, list[UnknownHeat], list[Reading]]:
    """The reference motor with the paper's sensors."""
    network = motor("reference_motor")
    whole = frame(network, wltp_like(), 0.5)
    inputs = Frame(0.5, whole.features[:steps], whole.boundaries[:steps])
    start = FilterStart(initial_of(network), np.full(len(network.nodes), 1.0))
    truth = simulate(compile_indexed(network, load=load), inputs, start.temperatures + 1.0)
    rng, names = np.random.default_rng(1), [node.name for node in network.nodes]
    channels = [
        Reading(
            Sensor(name, {name: 1.0}),
            truth[1:, names.index(name)] + rng.normal(0, 0.1, steps),
            np.ones(steps),
            np.full(steps, 0.01),
        )
        for name in ("endwinding_a_inner", "endwinding_b_inner", "rotor_surface")
    ]
    return network, inputs, start, [UnknownHeat("magnet", 50.0, 3.0)], channels


def filterpys_ekf(inputs: Inputs) -> Floats:
    """The temperatures at the end by filterpy, given F and the predicted state by the compiled step."""
    steps = Steps(inputs)
    peer = ExtendedKalmanFilter(steps.size, inputs.values.shape[1])
    (peer.x, peer.P), peer.Q, peer.R = steps.start, steps.process, 0.01 * np.eye(3)
    for k in range(len(inputs.values)):
        F = steps.matrix(k, peer.x)
        peer.x, peer.P = steps.moved(k, peer.x), F @ peer.P @ F.T + peer.Q
        peer.update(inputs.values[k], lambda _: steps.now, lambda x: steps.now @ x)
    return np.asarray(peer.x)


def filterpys_ukf(inputs: Inputs) -> Floats:
    steps = Steps(inputs)
    points = MerweScaledSigmaPoints(steps.size, ukf.ALPHA, ukf.BETA, ukf.KAPPA)
    peer = UnscentedKalmanFilter(
        steps.size, 3, 0.5, lambda x: steps.now @ x, lambda x, dt, k: steps.moved(k, x), points
    )
    (peer.x, peer.P), peer.Q, peer.R = steps.start, steps.process, 0.01 * np.eye(3)
    for k in range(len(inputs.values)):
        peer.predict(k=k)
        peer.sigmas_f = points.sigma_points(peer.x, peer.P)
        peer.update(inputs.values[k])
    return np.asarray(peer.x)


def filterpys_paper_form(network: Network, inputs: Inputs) -> Floats:
    """With the perfect measurements and the sensors of a step at once, R singular."""
    laws, n, o = law_heats(network), len(network.nodes), len(inputs.order)
    amounts, around = at_edges(laws.amounts(inputs.features)), at_edges(inputs.boundaries)
    capacities = np.array([node.capacity for node in network.nodes])
    shift, process, state = transition(inputs, 0.5)
    x, covariance = at_the_start(inputs, laws, amounts[0], around[0], capacities, state)
    size, heat, slope = len(x), np.empty(n), np.empty((n, n))
    peer = ExtendedKalmanFilter(size, n + 3)
    peer.x, peer.P, peer.Q = x[:, 0].copy(), covariance, process
    peer.R = np.diag([*np.zeros(n), *np.full(3, 0.01)])
    H = np.zeros((n + 3, size))
    H[:n, n : 2 * n] = np.eye(n)
    H[inputs.parts.heats, 2 * n + np.arange(o)] = -1 / capacities[inputs.parts.heats]
    for j in range(3):
        sensor_row(inputs.parts.weights[j], 0.0, -1, 0.0, n, H[n + j])
    for k in range(len(inputs.values)):
        ahead = peer.x[:, None].copy()
        predict(laws, capacities, inputs.parts.heats, shift, 0.5, amounts, around, k, ahead, heat, slope)
        peer.x, peer.P = ahead[:, 0], shift @ peer.P @ shift.T + process
        H[:n, :n] = -slope / capacities[:, None]
        perfect = H[:n] @ peer.x + heat / capacities - peer.x[n : 2 * n]
        peer.update(np.concatenate([perfect, inputs.values[k]]), lambda _: H, lambda x: H @ x)
    return np.asarray(peer.x)


def seconds(ours: Callable[[], object], theirs: Callable[[], object], rounds: int) -> tuple[float, float]:
    """The best time of each, taken in turn."""
    best = [np.inf, np.inf]
    for _ in range(rounds):
        for i, run in enumerate((ours, theirs)):
            began = time.perf_counter()
            run()
            best[i] = min(best[i], time.perf_counter() - began)
    return best[0], best[1]


def times(steps: int, rounds: int) -> dict[str, dict[str, float]]:
    """Each filter beside filterpy's on the same steps: us a step, ratio, largest difference of the last temperatures
    [K]."""
    case = timed_case(steps)
    network = case[0]
    inputs = inputs_of(*case)
    n = len(network.nodes)
    pairs: Mapping[str, tuple[Callable[[], Floats], Callable[[], Floats]]] = {
        "EKF": (lambda: filter_unknowns(*case).temperatures[-1], lambda: filterpys_ekf(inputs)),
        "UKF": (lambda: filter_unscented(*case).temperatures[-1], lambda: filterpys_ukf(inputs)),
        "paper's form": (
            lambda: filter_with_rates(*case).temperatures[-1],
            lambda: filterpys_paper_form(network, inputs),
        ),
    }
    found = {}
    for name, (ours, theirs) in pairs.items():
        apart = float(np.abs(ours() - theirs()[:n]).max())
        own, peer = seconds(ours, theirs, rounds)
        found[name] = {"us_a_step": own / steps * 1e6, "filterpy_over_ours": peer / own, "largest_difference_K": apart}
    alone, both = seconds(lambda: filter_unknowns(*case), lambda: smoothed(*case), rounds)
    found["smoother"] = {"us_a_step": both / steps * 1e6, "over_filter_alone": both / alone}
    return found


def long_run(steps: int) -> dict[str, float]:
    """The covariance after many steps with readings of 1e-4 K: its eigenvalues' range and whether it is symmetric."""
    network, short, start, heat, channels = timed_case(3600)
    part = np.resize(np.arange(len(short.features)), steps)
    inputs = Frame(0.5, short.features[part], short.boundaries[part])
    sharp = [replace(r, value=r.value[part], place=r.place[part], variance=np.full(steps, 1e-8)) for r in channels]
    began = time.perf_counter()
    found = filter_unknowns(network, inputs, start, heat, sharp)
    spread = np.linalg.eigvalsh(found.covariance)
    return {
        "steps": steps,
        "seconds": time.perf_counter() - began,
        "least_eigenvalue": float(spread[0]),
        "largest_eigenvalue": float(spread[-1]),
        "symmetric": bool((found.covariance == found.covariance.T).all()),
    }


# --- Words ------------------------------------------------------------------------------------------------------------


def table(rows: list[Row]) -> str:
    """Each way of estimating: means over the motors, and the worst of them."""
    lines = ["                magnet: mean    worst  max err  rotor unread    delay   loss: delay    error"]
    for name in dict.fromkeys(one.name for one in rows):
        own = [one for one in rows if one.name == name]
        errors = [one.magnet_mae_K for one in own]
        line = f"{name:<16}{np.mean(errors):9.2f} K{max(errors):8.2f} K{max(one.magnet_max_K for one in own):7.1f} K"
        line += f"{np.mean([one.rotor_unread_K for one in own]):12.2f} K"
        line += f"{np.mean([one.magnet_delay_s for one in own]):8.1f} s"
        late = [one.loss_delay_s for one in own if one.loss_delay_s is not None]
        wrong = [one.loss_error_W for one in own if one.loss_error_W is not None]
        lines.append(line + (f"{np.mean(late):12.1f} s{np.mean(wrong):8.1f} W" if late else ""))
    return "\n".join(lines)


def main() -> None:
    said = asked.parser(__doc__, seeds=(3, 1), first=(1, 1)).parse_args()
    cycles, timed, rounds, steps = (1, 40, 1, 10_000) if said.quick else (3, 600, 3, 1_000_000)
    with threadpool_limits(1):
        rows = [one for seed in range(said.first, said.first + said.seeds) for one in rows_of(seed, cycles)]
        print(f"{said.seeds} motors with a hidden magnet loss, {cycles} WLTC, after the first {SETTLE_S:.0f} s:")
        print(table(rows))
        took = times(timed, rounds)
        print(
            "\n"
            + "\n".join(f"{name:<14} {', '.join(f'{k} {v:.3g}' for k, v in of.items())}" for name, of in took.items())
        )
        long = long_run(steps)
        print("\nlong run       " + ", ".join(f"{k} {v:.4g}" for k, v in long.items()))
    asked.keep({"rows": [asdict(r) for r in rows], "times": took, "long_run": long}, said.json)


if __name__ == "__main__":
    main()
