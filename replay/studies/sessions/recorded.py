"""Stored sessions as the diagnosis takes them: steps of 1 s, features of every candidate averaged at the native
rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue import quality
from ingest.catalogue.channels import ChannelData, load
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.frame import frame as frames
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.frame_of import as_fed
from replay.engine.frame.observations import Observation
from replay.engine.results.open_loop import initial_by_reading, initial_temperatures, referenced
from replay.engine.specimen.aged import hours_of
from replay.errors import ReplayDataError
from replay.studies.sessions.history import course_of
from twin.fitting.model import Test
from twin.fitting.recorded import RecordedChannel, RecordedMeter
from twin.motor.features import QUANTITY, Monomial, is_flow, monomials
from twin.motor.network import Network
from twin.motor.outputs import BLOCK_S
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

STEP_S = 1.0


def read_from(facts: Facts, sessions: Sequence[SessionRecorded]) -> dict[str, list[str]]:
    """What sessions are read from, as the keys of what is learnt from them name it."""
    decodes = [facts.decodes[file["decode"]] for session in sessions for file in session.files]
    return {
        "raw": sorted({d.raw for d in decodes}),
        "databases": sorted({sha for d in decodes for sha in d.databases}),
        "benches": sorted({facts.current(session.bench) for session in sessions if session.bench}),
        "decoder": sorted({d.decoder for d in decodes}),
        "decodes": sorted({d.decode for d in decodes}),  # which log is read with which of these files
    }


def test_of(
    store: Store,
    facts: Facts,
    session: SessionRecorded,
    network: Network,
    wanted: Sequence[Monomial],
    level: str,
    laws: Sequence[str] = (),
    meters: bool = False,
    loaded: Sequence[ChannelData] | None = None,
) -> Test:
    """A session with the products of features `wanted` besides the network's own, and what the `laws` across sessions
    multiply with; with `meters`, what observes power, heat, resistance or flux is learnt from too; `loaded`: its
    channels, where they are read already.

    Raises ReplayDataError where it lacks an input, or no channel of it observes a node.
    """
    channels = as_fed(session, load(store, facts, session) if loaded is None else loaded, network)
    good = [found.good for found in quality.assess(channels)]
    try:
        hours = hours_of(store, facts, session, network)
        test, frame = test_of_channels(session.name, session.kind, channels, good, network, wanted, level, hours)
    except ReplayDataError as error:
        raise ReplayDataError(f"session {session.name}: {error}") from None
    test = replace(test, course=course_of(store, facts, session, laws))
    return with_meters(test, frame, network, level) if meters else test


def test_of_channels(
    name: str,
    kind: str,
    channels: Sequence[ChannelData],
    good: Sequence[NDArray[np.bool_]],
    network: Network,
    wanted: Sequence[Monomial],
    level: str,
    hours: Mapping[str, float],
) -> tuple[Test, InputFrame]:
    """As `test_of`, of channels with their `good` samples, without meters; and the frame. `hours`: features that are
    one number. Raises ReplayDataError where an input lacks, or no channel observes a node."""
    own = monomials(network)
    single = [Monomial(((f, 1.0),)) for f in _single(network, channels)]
    every = tuple(dict.fromkeys([*own, *single, *wanted]))
    frame = frames.build(channels, good, network, every, STEP_S, hours)
    return _test(name, kind, frame, network, every, len(own), level), frame


def _single(network: Network, channels: Sequence[ChannelData]) -> list[str]:
    """The features that a session records, by themselves; of several flows those that the network tells apart."""
    given = [c.spec.quantity for c in channels if c.spec.role == "input"]
    recorded = [f for f, q in QUANTITY.items() if q in network.scale and f in given and not is_flow(f)]
    flows = {f for m in monomials(network) for f in m.features if is_flow(f)}
    if not flows and "flow" in network.scale and given.count("flow") == 1:
        flows = {"flow"}
    return [*recorded, *sorted(flows)]


def _test(
    name: str, kind: str, frame: InputFrame, network: Network, every: Sequence[Monomial], own: int, level: str
) -> Test:
    length = round(BLOCK_S / STEP_S)
    steps = len(frame.features) // length * length
    seen = [o for o in frame.observations if level in ("testing", o.sensor.level) and o.good[:steps].any()]
    if not seen:
        given = "node = ..." if level == "testing" else f'node = ... and level = "{level}"'
        raise ReplayDataError(
            f"no usable channel of level {level} observes a node of {network.name}: there is "
            f"nothing to learn from. Say {given} in the bench file, or leave the session out."
        )
    named = {m.name: np.ascontiguousarray(frame.features[:steps, j]) for j, m in enumerate(every)}
    of_network = replace(frame, features=frame.features[:, :own])
    initial, sd = initial_temperatures(network, of_network, level)
    return Test(
        name=name,
        kind=kind,
        frame=Frame(STEP_S, np.ascontiguousarray(frame.features[:steps, :own]), frame.boundaries[:steps]),
        inputs={
            m.powers[0][0]: named[m.name]
            for m in every
            if m.shape is None and len(m.powers) == 1 and m.powers[0][1] == 1.0
        },
        features=named,
        initial=initial,
        initial_sd=sd,
        channels=tuple(_channel(o, frame, steps) for o in seen),
        start_ns=int(frame.t_ns[0]),
        begins=initial_by_reading(network, of_network, level),
        load=_load(named, frame, steps),
    )


def _load(named: Mapping[str, Floats], frame: InputFrame, steps: int) -> Floats:
    """`Test.load`: that of a motor that does not say which way its power flows is never negative."""
    size = named.get("torque", named.get("current", np.empty(0)))
    if frame.mechanical_W is None:
        return size
    return np.where(frame.mechanical_W[:steps] < 0, -size, size) if size.size else size


def with_meters(test: Test, frame: InputFrame, network: Network, level: str) -> Test:
    """A test with the frame's meters of this level."""
    begins = dict(zip((node.name for node in network.nodes), test.initial.tolist(), strict=True))
    begins_sd = dict(zip(begins, test.initial_sd.tolist(), strict=True))
    steps = len(test.frame.features)
    found = []
    for meter in frame.meters:
        if level in ("testing", meter.seen.sensor.level) and meter.seen.good[:steps].any():
            what, sensor = referenced(meter, begins), meter.seen.sensor
            given = frame.mechanical_W if what.quantity == "power" else None
            seen = vars(_channel(meter.seen, frame, steps))
            own = RecordedMeter(**seen, what=what, given=0.0 if given is None else given[:steps])
            if what.law is not None and not meter.what.referenced:
                start_K = np.hypot.reduce([share * begins_sd[node] for node, share in sensor.weights.items()])
                own = replace(own, sensor=replace(sensor, bias_sd=float(np.hypot(sensor.bias_sd, start_K * own.row))))
            found.append(own)
    return replace(test, meters=tuple(found))


def _channel(o: Observation, frame: InputFrame, steps: int) -> RecordedChannel:
    samples = np.where(o.good & frame.live, o.samples, 0).astype(np.float64)[:steps]
    return RecordedChannel(o.sensor, o.measured[:steps], samples, o.place[:steps])
