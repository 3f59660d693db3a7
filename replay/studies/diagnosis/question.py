"""What a diagnosis is asked: the sessions to learn from and those to keep, as the twin takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ingest.catalogue.channels import ChannelData, load
from ingest.facts.events import BenchRegistered, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.configurations import refuse_other_rigs, whole_motor
from replay.engine.frame.observations import sensor_of
from replay.errors import ReplayDataError
from replay.studies.sessions.recorded import STEP_S, read_from, test_of
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.everyday import everyday
from twin.fitting.model import Model, Test
from twin.motor.features import Monomial
from twin.motor.network import Network
from twin.motor.sensor import Sensor

LEAST_S = 900.0  # of training: below, hardly anything of a motor's slow modes is in the data
RIPPLE = Monomial((("current", 2.0),))  # the law of the rotor's everyday heat at standstill


@dataclass(frozen=True)
class Question:
    """What is asked: the sessions to learn from and the kept ones, the model and level. `written`: SHA-256 of the files
    that answering it has sealed so far."""

    store: Store
    facts: Facts
    train: Sequence[SessionRecorded]
    kept: Sequence[SessionRecorded]
    model: str
    level: str
    written: list[str] = field(default_factory=list, compare=False)

    @property
    def benches(self) -> dict[str, BenchRegistered]:
        """The bench files of all sessions, as they are current, by their SHA-256."""
        found = (self.facts.bench_of(session) for session in (*self.train, *self.kept))
        return {bench.sha256: bench for bench in found if bench is not None}

    def seal(self, text: bytes) -> str:
        """The SHA-256 of a motor or bench file that an answer tries, sealed."""
        self.written.append(self.store.archive.seal(text))
        return self.written[-1]


def check(train: Sequence[SessionRecorded], kept: Sequence[SessionRecorded]) -> None:
    """Raises ReplayDataError where there is nothing to learn from, or what is learnt from is kept too."""
    if not train:
        raise ReplayDataError("no session to learn from: name some with --on. `whyhot sessions` lists them.")
    both = {s.session for s in train} & {s.session for s in kept}
    if both:
        named = ", ".join(s.name for s in kept if s.session in both)
        raise ReplayDataError(
            f"{named}: learnt from and kept at once: a kept session must be one that --on does not name."
        )
    refuse_other_rigs([*train, *kept])
    length_s = sum(s.end_ns - s.start_ns for s in train) / 1e9
    if length_s < LEAST_S:
        minutes, left_s = divmod(int(length_s), 60)  # rounded down: 899.9 s are not the 15 min that are needed
        raise ReplayDataError(
            f"the sessions of --on last {minutes} min {left_s} s together, too short to find a cause: at least "
            f"{LEAST_S / 60:.0f} min are needed. Add an S1 or S2 point or a drive cycle with --on."
        )


def key_of(question: Question, code: str) -> dict[str, Any]:
    """Everything that the answer may depend on, but for the environment. `code`: hash of the sources that answer."""
    return {
        "train": [session.session for session in question.train],
        "kept": [session.session for session in question.kept],
        **read_from(question.facts, [*question.train, *question.kept]),
        "model": question.model,
        "level": question.level,
        "settings": {"step_s": STEP_S},
        "code": code,
    }


@dataclass(frozen=True)
class Campaign:
    """The training sessions as the twin takes them. `beyond`: thermometers of theirs that the level leaves out."""

    network: Network
    tests: tuple[Test, ...]
    candidates: tuple[Candidate, ...]
    monomials: tuple[Monomial, ...]
    observed: tuple[Sensor, ...]
    inputs: tuple[InputChannel, ...]
    loaded: Sequence[Sequence[ChannelData]]
    beyond: tuple[Sensor, ...] = ()

    @property
    def healthy(self) -> Model:
        """As a diagnosis begins: everything that a healthy motor may do, and no cause."""
        return Model(self.network, self.tests, everyday(self.network, self.tests))


def campaign_of(question: Question) -> Campaign:
    """The training sessions, read. Raises ReplayDataError where one lacks what the model needs."""
    network = whole_motor(question.store, question.facts, question.model)
    loaded = [load(question.store, question.facts, session) for session in question.train]
    asked = without_tests(network, loaded, question.level, [session.name for session in question.train])
    tests = tuple(
        _test(question, session, network, asked.monomials, asked.candidates, own)
        for session, own in zip(question.train, loaded, strict=True)
    )
    return replace(asked, tests=tests)


def without_tests(
    network: Network, loaded: Sequence[Sequence[ChannelData]], level: str, sessions: Sequence[str] = ()
) -> Campaign:
    """What may be the cause by these channels of sessions, which are no tests yet; `sessions`: their names, where they
    will be those to learn from."""
    observed, beyond, inputs = _channels(loaded, network, level)
    candidates = generate(network, observed, inputs, sessions)
    ripple = [RIPPLE] if "current" in [i.name for i in inputs] and "current" in network.scale else []
    monomials = tuple(dict.fromkeys([*added_monomials(candidates), *ripple]))
    return Campaign(network, (), candidates, monomials, observed, inputs, loaded, beyond)


def _channels(
    loaded: Sequence[Sequence[ChannelData]], network: Network, level: str
) -> tuple[tuple[Sensor, ...], tuple[Sensor, ...], tuple[InputChannel, ...]]:
    """What is observed, what would be but for the level, and what drives, over all sessions."""
    nodes = {node.name for node in network.nodes}
    observed: dict[str, Sensor] = {}
    beyond: dict[str, Sensor] = {}
    inputs: dict[str, InputChannel] = {}
    for channel in (c for channels in loaded for c in channels):
        spec = channel.spec
        sensor = sensor_of(channel)
        if spec.role == "observed" and spec.quantity == "temperature" and set(sensor.weights) <= nodes:
            (observed if level in ("testing", spec.level) else beyond).setdefault(spec.name, sensor)
        elif spec.role == "input" or (spec.role == "observed" and spec.quantity == "temperature"):
            name = spec.node or spec.quantity if spec.quantity == "temperature" else spec.quantity
            inputs.setdefault(name, InputChannel(name, channel.buses[0]))
    return tuple(observed.values()), tuple(beyond.values()), tuple(inputs.values())


def kept_of(question: Question, campaign: Campaign) -> list[Test]:
    """The kept sessions, read."""
    return [
        _test(question, session, campaign.network, campaign.monomials, campaign.candidates) for session in question.kept
    ]


def _test(
    question: Question,
    session: SessionRecorded,
    network: Network,
    monomials: tuple[Monomial, ...],
    candidates: Sequence[Candidate],
    loaded: Sequence[ChannelData] | None = None,
) -> Test:
    """A session as a test with all that the candidates need; `loaded`: its channels, where they are there already."""
    store, facts, level = question.store, question.facts, question.level
    across = tuple(dict.fromkeys(c.cause.law for c in candidates if c.repeated))
    return test_of(store, facts, session, network, monomials, level, across, meters=True, loaded=loaded)
