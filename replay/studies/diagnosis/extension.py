"""New versions with a parent: the motor file and the bench files that say together what a diagnosis found."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import assert_never

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.channel import Channel
from ingest.bench.corrections import in_order, spelt
from ingest.errors import BenchFileError
from replay.engine.files.bench_text import corrected
from replay.engine.files.motor_text import written
from replay.studies.diagnosis.answer_parts import place_of
from replay.studies.diagnosis.question import Campaign, Question
from twin.calibration.learned import network_of, size
from twin.diagnosis.expressible import expressible, readings
from twin.diagnosis.rounds import Refit
from twin.diagnosis.swaps import Swap
from twin.differences.candidates import sensor_place
from twin.fitting import actions
from twin.fitting.fit import Fit
from twin.fitting.model import Test
from twin.motor.causes import OF_THE_MOTOR
from twin.motor.network import Network
from twin.motor.sensor import Sensor
from twin.motor.sensor_laws import Lag, Misreading

DIGITS = 3  # of a healthy difference in a bench file


@dataclass(frozen=True)
class Version:
    """SHA-256 of a motor file and of the bench files that go with it: `benches`, file as it was -> its new version, of
    those that say something new; `bench`, the first of these versions, None without any."""

    motor: str
    bench: str | None
    benches: Mapping[str, str] = field(default_factory=dict)


def version(
    question: Question,
    campaign: Campaign,
    found: Fit,
    named: Sequence[Refit],
    swaps: Sequence[Swap],
    note: str,
    kept: Sequence[Test] = (),
) -> Version:
    """Motor and bench files with what a fit learnt, sealed: a replay of them gives what the fit gives, less what
    belongs to one session. Each bench file of the question says what was learnt of the signals that it has. `named`:
    the fit's terms; `swaps`: channels that were exchanged for it; `note` stands in all files; `kept`: the question's
    kept sessions, whose logs a correction of a clock is to reach, too."""
    store, facts = question.store, question.facts
    driving = {i.bus for i in campaign.inputs}
    places = {place_of(found, refit): refit for refit in named}
    fit = expressible(found, places, {o.name for o in campaign.observed if o.bus in driving})
    network = network_of(fit, campaign.monomials)
    data, name = store.archive.read(question.model), facts.models[question.model].file
    motor = question.seal(written(data, name, network, note))
    own = readings(found, fit, places)
    learnt = [replace(c, weights=own.weights.get(c.name, c.weights)) for c in campaign.observed]
    amounts: dict[actions.OnBench, float] = {}
    for place, refit in places.items():
        if refit.candidate.sayable and refit.candidate.cause.kind not in OF_THE_MOTOR:
            action = fit.model.parameters[place].action
            assert isinstance(action, actions.OnBench)
            amounts[action] = size(fit, place, refit.candidate.unit).value
    amounts |= {action: float(f"{amount:.{DIGITS}g}") for action, amount in own.errors.items()}
    benches = {}
    for sha256, parent in question.benches.items():
        before = store.archive.read(sha256)
        at_ns = _when(question, read_bench(before, parent.name))
        clocks = _clocks(question, [*campaign.tests, *kept], sha256)
        said = _Said(read_bench(before, parent.name).at(at_ns), learnt, swaps, network, clocks)
        weights = {c: shares for c, shares in own.weights.items() if said.has(c)}
        after = corrected(before, parent.name, in_order(said.corrections(amounts)), note, weights, at_ns)
        if after != before:
            benches[sha256] = question.seal(after)
    return Version(motor, next(iter(benches.values()), None), benches)


def _clocks(question: Question, tests: Sequence[Test], bench: str) -> dict[str, list[str]]:
    """Channel -> what stamps it in the sessions of a bench file (SHA-256): one clock, or as many as there are sessions
    where its logs are of no `[[logger]]` and each is called by its day. `tests`: the question's, kept ones last."""
    found: dict[str, list[str]] = {}
    for session, test in zip([*question.train, *question.kept], tests, strict=False):
        own = question.facts.bench_of(session)
        if own is not None and own.sha256 == bench:
            for one in test.channels:
                found.setdefault(one.name, []).append(one.sensor.bus)
    return found


def _when(question: Question, bench: Bench) -> int | None:
    """When the sessions were that were learnt from, where the bench file says that channels changed their meaning.

    Raises BenchFileError where they are from before and after a change: a correction would be of either.
    """
    benches = [(one, question.facts.bench_of(one)) for one in question.train]
    own = [one for one, found in benches if found is not None and found.sha256 == bench.sha256]
    starts = [one.start_ns if one.absolute else None for one in own]
    if len({bench.unchanged(one) for one in starts}) > 1:
        raise BenchFileError(
            f"{bench.name}: sessions from before and after a change of the bench were learnt from, so no correction "
            "can be written: learn from those of one side."
        )
    return starts[0] if starts else None


@dataclass(frozen=True)
class _Said:
    """What one bench file can say of what was learnt, and by which ids. `learnt`: the sensors with the weights that the
    new bench file gives them, as a correction is found by what a sensor follows there; `clocks`: channel -> what stamps
    it, session by session."""

    bench: Bench
    learnt: Sequence[Sensor]
    swaps: Sequence[Swap]
    network: Network
    clocks: Mapping[str, Collection[str]]

    def has(self, channel: str) -> bool:
        return any(channel in (c.name, c.signal) for c in self._used)

    @property
    def _used(self) -> list[Channel]:
        return [c for c in self.bench.channels if c.role != "ignored"]

    def corrections(self, amounts: Mapping[actions.OnBench, float]) -> dict[str, float]:
        """Cause id -> amount of what concerns this file."""
        here = [c for c in self.learnt if self.has(c.name)]
        swaps = [swap for swap in self.swaps if self.has(swap.pair.channel) and self.has(swap.pair.other)]
        before = {c.name: self._place(c, here) for c in here}
        found = {f"sensor.{before[s.pair.channel]}.swap_{before[s.pair.other]}": 1.0 for s in swaps}
        crossed = _crossed(here, swaps)
        sensors = {name: self._place(c, list(crossed.values())) for name, c in crossed.items()}
        for action, amount in amounts.items():
            late = amount * action.sign if isinstance(action, actions.Late) else amount
            for cause in self._causes(action, sensors):
                found[cause] = found.get(cause, 0.0) + late  # a clock may be late by itself and beside the inputs
        return found

    def _place(self, sensor: Sensor, among: Sequence[Sensor]) -> str:
        """Where a sensor is in ids; with its signal where the file has sensors there that nothing was learnt of."""
        known = {c.name for c in among}
        others = (c for c in self._used if c.quantity == "temperature" and not known & {c.name, c.signal})
        if any(sensor.node in (c.node, *c.weights) for c in others):
            return f"{sensor.node}@{spelt(sensor.name)}"
        return sensor_place(sensor, among)

    def _causes(self, action: actions.OnBench, sensors: Mapping[str, str]) -> list[str]:
        """The ids of the corrections that take off what an action does: none where this file has nothing of it, several
        for a clock whose logs have names of their own in each session."""
        match action:
            case Misreading(channel) | Lag(channel):
                return [f"sensor.{sensors[channel]}.{action.law}"] if channel in sensors else []
            case actions.Late(channels) | actions.Slowed(channels):
                clocks = dict.fromkeys(clock for c in channels for clock in self.clocks.get(c, ()))
                return [f"clock.{spelt(clock)}.{action.law}" for clock in clocks]
            case actions.BoundaryBias(boundary):
                name = self.network.boundaries[boundary].name
                there = any(c.node == name and c.quantity == "temperature" for c in self._used)
                return [f"boundary.{name}.bias"] if there else []
            case actions.InputGain(name):
                return [f"input.{name}.gain"] if self._gives(name) else []
            case actions.InputBias(name):
                return [f"input.{name}.bias"] if self._gives(name) else []
            case _:
                assert_never(action)

    def _gives(self, name: str) -> bool:
        return any(name in (c.quantity, c.name) or name.startswith(f"{c.quantity}_") for c in self._used if c.quantity)


def _crossed(learnt: Sequence[Sensor], swaps: Sequence[Swap]) -> dict[str, Sensor]:
    """Channel -> the sensor that it reads below the exchanges, by the name of the channel that has its place there."""
    other = {c.name: c.name for c in learnt}
    for swap in swaps:
        other |= {swap.pair.channel: swap.pair.other, swap.pair.other: swap.pair.channel}
    return {c.name: replace(c, name=other[c.name]) for c in learnt}
