"""Torque over speed that a motor bears for ever and for 10, 30 and 60 s, and how the recorded S1 and S2 sessions
ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.catalogue.kinds import LOADED
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.configurations import refuse_other_rigs, whole_motor
from replay.engine.frame.frame import InputFrame, column_name
from replay.engine.frame.frame_of import session_frame
from replay.engine.frame.observations import Observation
from replay.engine.results.kernel_cache import load_kernel
from replay.errors import ReplayDataError
from replay.studies.characterise.calibrate import common_model
from replay.studies.sessions.fitting import fitting
from replay.studies.sessions.recorded import test_of
from twin.calibration.calibrate import freedom
from twin.calibration.point_choice import information, prior
from twin.motor.features import evaluate, monomials, quantity, scale
from twin.motor.network import Network
from twin.run.envelope import Border, Motor, border, temperatures
from twin.run.operating_map import OperatingMap

Floats = NDArray[np.float64]
Tell = Callable[[str], None]

DURATIONS_S = (math.inf, 60.0, 30.0, 10.0)
LOADS = {"torque": "torque_Nm", "current": "current_A"}  # the load axis: the first that every session has
SPEEDS = 10
AT_LIMIT_K = 3.0  # a session that ended that near the limit ended for it: a thermocouple is not the hot spot
AT_MOST = 0.97  # of the largest current (or load) of all sessions: the inverter's or the battery's limit
LEAST_PULSE_s = 5.0  # shorter is no step of load
SLOPE_s = 2.0  # over which the rise of a lagging thermometer is taken: noise would make more of less


@dataclass(frozen=True)
class Ended:
    """How an S1 session, or one pulse of an S2 session, ended.

    `reason`: "temperature", "current limit" ("load limit" where a session has no current) or "time". Named is the
    limited node that was measured nearest to its limit, with how hot it was, its thermometer's known lag taken off.
    Mean `speed_rpm`, largest `load` and `current_A` (rms, None where it is not recorded) are of the minute before
    that moment, within the pulse. `pulse` counts from 1, None for a whole session; `seconds`: its length.
    """

    session: SessionRecorded
    pulse: int | None
    seconds: float
    speed_rpm: float
    load: float
    current_A: float | None
    node: str | None
    hottest_degC: float | None
    reason: str


@dataclass(frozen=True)
class Envelope:
    """What a motor bears: for each of `speeds_rpm` its `borders`, one for each of `DURATIONS_S`, in the unit of
    `load_column`, with `boundaries` held at these temperatures [degC]. `start_degC`: the hottest node at the start,
    at rest in equilibrium with them. `fitted`: the model was made from another one, and bands are as wide as the
    sessions leave its parameters unknown; else as wide as its file's `sd`."""

    network: Network
    model: str
    load_column: str
    speeds_rpm: tuple[float, ...]
    borders: tuple[tuple[Border, ...], ...]
    boundaries: dict[str, float]
    start_degC: float
    fitted: bool
    ended: tuple[Ended, ...]
    sessions: tuple[SessionRecorded, ...]


def envelope(
    store: Store, facts: Facts, sessions: Sequence[SessionRecorded], model: str | None, level: str, tell: Tell
) -> Envelope:
    """The envelope of a model (None: the one that the sessions' bench files name). Currents and all other inputs at a
    torque and speed are as the sessions show them, bands as `Envelope.fitted` says.

    Raises ReplayDataError where no node of the motor has a limit, or the sessions know no speed or load.
    """
    refuse_other_rigs(sessions)
    model = model or common_model(facts, sessions)
    network = whole_motor(store, facts, model)
    limits = np.array([math.nan if n.limit_degC is None else n.limit_degC for n in network.nodes])
    if np.isnan(limits).all():
        raise ReplayDataError(
            f"no node of {network.name} has a limit: say limit_degC = 180.0 or so for its windings and magnets in the "
            "motor file."
        )
    tell("reading the sessions")
    channels = [load(store, facts, session) for session in sessions]
    frames = [session_frame(s, c, network) for s, c in zip(sessions, channels, strict=True)]
    column = load_column(frames)
    points, rest = operating_map(network, frames, column), _at_rest(network, frames)
    fitted = facts.models[model].parent is not None
    with fitting(f"envelope of {network.name}"):
        tell("weighing what the sessions know of the motor")
        precision = prior(freedom(network, ()))
        if fitted:
            for session, own in zip(sessions, channels, strict=True):
                test = test_of(store, facts, session, network, (), level, loaded=own)
                precision = precision + information(network, test, {})
        boundaries = np.concatenate([frame.boundaries for frame in frames]).mean(axis=0)
        covariance = np.asarray(np.linalg.inv(precision), np.float64)
        motor = Motor(load_kernel(network), limits, boundaries, covariance)
        start = temperatures(motor, rest, np.full(len(limits), boundaries.mean()), math.inf)
        if not np.isfinite(start).all():
            raise ReplayDataError(
                f"{network.name} has no steady state at rest: `whyhot motor check` says which node has no way out."
            )
        speeds = np.linspace(0.0, points.top_speed, SPEEDS + 1)[1:]
        borders = []
        for speed in speeds.tolist():
            tell(f"{speed:,.0f} rpm")
            most = points.most_load(speed)
            drive = _drive(network, points, speed)
            borders.append(tuple(border(motor, drive, start, s, most) for s in DURATIONS_S) if most > 0 else ())
    there = [i for i, of_speed in enumerate(borders) if of_speed]
    return Envelope(
        network=network,
        model=model,
        load_column=column,
        speeds_rpm=tuple(float(speeds[i]) for i in there),
        borders=tuple(borders[i] for i in there),
        boundaries=dict(zip((b.name for b in network.boundaries), map(float, boundaries), strict=True)),
        start_degC=float(start.max()),
        fitted=fitted,
        ended=ended(network, sessions, frames, column),
        sessions=tuple(sessions),
    )


def load_column(frames: Sequence[InputFrame]) -> str:
    """The column of the load that all sessions have. Raises ReplayDataError where they do not share a speed and a
    load."""
    for name in LOADS.values():
        if all({"speed_rpm", name} <= frame.inputs.keys() for frame in frames):
            return name
    raise ReplayDataError(
        "the sessions have no speed and torque (or current) in common: there is nothing to draw a curve over."
    )


def operating_map(network: Network, frames: Sequence[InputFrame], column: str) -> OperatingMap:
    """Every feature of the network's laws over speed and load."""
    needed = sorted({feature for m in monomials(network) for feature in m.features})
    columns = {feature: column_name(feature, quantity(feature) or feature) for feature in needed}
    for feature, name in columns.items():
        if not all(name in frame.inputs for frame in frames):
            raise ReplayDataError(f"{feature} is not an input of every session: no curve can be drawn with it.")
    joined = {f: np.abs(_joined(frames, name)) / scale(network, f) for f, name in columns.items()}
    return OperatingMap(np.abs(_joined(frames, "speed_rpm")), np.abs(_joined(frames, column)), joined)


def _joined(frames: Sequence[InputFrame], name: str) -> Floats:
    return np.concatenate([frame.inputs[name] for frame in frames])


def _drive(network: Network, points: OperatingMap, speed: float) -> Callable[[float], Floats]:
    """The features at a speed, as a function of the load."""

    def features(load: float) -> Floats:
        values = {name: np.array([value]) for name, value in points.inputs(speed, load).items()}
        return np.asarray(evaluate(monomials(network), values, 1)[0])

    return features


def _at_rest(network: Network, frames: Sequence[InputFrame]) -> Floats:
    """Features of a motor that stands still without current, its flows as usual."""
    needed = {feature for m in monomials(network) for feature in m.features}
    flows = {f: column_name(f, "flow") for f in needed if f.startswith("flow")}
    usual = {f: np.array([float(np.nanmedian(_joined(frames, name))) / scale(network, f)]) for f, name in flows.items()}
    return np.asarray(evaluate(monomials(network), {f: np.zeros(1) for f in needed} | usual, 1)[0])


def ended(
    network: Network, sessions: Sequence[SessionRecorded], frames: Sequence[InputFrame], column: str
) -> tuple[Ended, ...]:
    """How each S1 session and each pulse of an S2 session ended. Whether it was at its load's limit is told by the
    current wherever every session knows it: in field weakening torque is far below its largest while the inverter gives
    all it can."""
    currents = [phase_current(frame) for frame in frames]
    driven = [current for current in currents if current is not None]
    by_current = len(driven) == len(frames)
    pushed = driven if by_current else [np.abs(frame.inputs[column]) for frame in frames]
    most = max(float(np.nanmax(of_session)) for of_session in pushed)
    limits = {node.name: node.limit_degC for node in network.nodes if node.limit_degC is not None}
    found = []
    for session, frame, current, push in zip(sessions, frames, currents, pushed, strict=True):
        if session.kind not in ("s1", "s2"):
            continue
        seen = [o for o in frame.observations if o.sensor.label in limits]
        limited = [(o.sensor.label, without_lag(o, frame.step_s)) for o in seen]
        of_pulses = pulses(push, frame.step_s) if session.kind == "s2" else []
        for number, (first, after) in enumerate(of_pulses or [(0, len(push))], start=1):
            hottest = [
                (float(np.nanmax(there)) - limits[label], label, first + int(np.nanargmax(there)))
                for label, course in limited
                if np.isfinite(there := course[first:after]).any()
            ]
            over, node, end = max(hottest, default=(-math.inf, None, after - 1))
            last = slice(max(first, end - round(60.0 / frame.step_s)), end + 1)
            at_limit = float(np.nanmax(push[last])) >= AT_MOST * most
            limit = "current limit" if by_current else "load limit"
            found.append(
                Ended(
                    session=session,
                    pulse=number if of_pulses else None,
                    seconds=(after - first) * frame.step_s,
                    speed_rpm=float(np.nanmean(np.abs(frame.inputs["speed_rpm"][last]))),
                    load=float(np.nanmax(np.abs(frame.inputs[column][last]))),
                    current_A=None if current is None else float(np.nanmax(current[last])),
                    node=node,
                    hottest_degC=None if node is None else over + limits[node],
                    reason="temperature" if over >= -AT_LIMIT_K else limit if at_limit else "time",
                )
            )
    return tuple(found)


def without_lag(o: Observation, step_s: float) -> Floats:
    """Where a thermometer is (N,) [degC], from what it shows, its known time constant and its rise: at the end of a
    pulse it shows several kelvins less. NaN where it has no good sample."""
    shown = np.where(o.good, o.measured, np.nan)
    back = max(1, round(SLOPE_s / step_s))
    rise = np.zeros_like(shown)
    rise[back:] = (shown[back:] - shown[:-back]) / (back * step_s)
    return np.asarray(shown + o.sensor.time_constant_s * np.nan_to_num(rise))


def phase_current(frame: InputFrame) -> Floats | None:
    """The phase current (N,) [A rms], from its components where it is not recorded itself; None where those are not
    either."""
    if "current_A" in frame.inputs:
        return np.abs(frame.inputs["current_A"])
    d, q = (frame.inputs.get(f"current_{axis}_A") for axis in "dq")
    return None if d is None or q is None else np.asarray(np.hypot(d, q))


def pulses(push: Floats, step_s: float) -> list[tuple[int, int]]:
    """First step and one past the last of each pulse of current or load (N,): of S2 with rests between them, all that
    is loaded."""
    loaded = push > LOADED * float(np.nanquantile(push, 0.995))
    edges = np.diff(np.r_[0, loaded.astype(np.int8), 0])
    both = zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True)
    return [(first, after) for first, after in both if (after - first) * step_s >= LEAST_PULSE_s]
