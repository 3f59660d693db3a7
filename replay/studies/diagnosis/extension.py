"""New versions with a parent: the motor file and the bench file that say together what a diagnosis found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import assert_never

from ingest.bench.corrections import in_order, spelt
from replay.engine.files.bench_text import corrected
from replay.engine.files.motor_text import written
from replay.studies.diagnosis.answer_parts import place_of
from replay.studies.diagnosis.question import Campaign, Question
from twin.calibration.learned import network_of, size
from twin.diagnosis.expressible import expressible, readings
from twin.diagnosis.naming import Refit
from twin.diagnosis.swaps import Swap
from twin.differences.candidates import sensor_place
from twin.fitting import actions
from twin.fitting.fit import Fit
from twin.motor.causes import OF_THE_MOTOR
from twin.motor.network import Network
from twin.motor.sensor import Sensor
from twin.motor.sensor_laws import Lag, Misreading

DIGITS = 3  # of a healthy difference in a bench file


@dataclass(frozen=True)
class Version:
    """SHA-256 of a motor file and of the bench file that goes with it; None where no bench file is known, or it says
    all already."""

    motor: str
    bench: str | None


def version(
    question: Question, campaign: Campaign, found: Fit, named: Sequence[Refit], swaps: Sequence[Swap], note: str
) -> Version:
    """Motor and bench file with what a fit learnt, sealed: a replay of both gives what the fit gives, less what belongs
    to one session. `named`: the fit's terms; `swaps`: channels that were exchanged for it; `note` stands in both."""
    store, facts = question.store, question.facts
    driving = {i.bus for i in campaign.inputs}
    places = {place_of(found, refit): refit for refit in named}
    fit = expressible(found, places, {o.name for o in campaign.observed if o.bus in driving})
    network = network_of(fit, campaign.monomials)
    data, name = store.archive.read(question.model), facts.models[question.model].file
    motor = store.archive.seal(written(data, name, network, note))
    parent = facts.bench_of(question.train[0])
    if parent is None:
        return Version(motor, None)
    own = readings(fit, places)
    learnt = [replace(c, weights=own.weights.get(c.name, c.weights)) for c in campaign.observed]
    sensors = _sensors(learnt, swaps)
    amounts = {_exchange(swap, learnt): 1.0 for swap in swaps}
    for place, refit in places.items():
        if refit.candidate.cause.kind not in OF_THE_MOTOR:
            action = fit.model.parameters[place].action
            assert isinstance(action, actions.OnBench)
            amounts[_cause(action, network, campaign, sensors)] = size(fit, place, refit.candidate.unit).value
    healthy = {_cause(action, network, campaign, sensors): amount for action, amount in own.errors.items()}
    amounts |= {cause: float(f"{amount:.{DIGITS}g}") for cause, amount in healthy.items()}
    before = store.archive.read(parent.sha256)
    text = corrected(before, parent.name, in_order(amounts), note, own.weights)
    return Version(motor, store.archive.seal(text) if text != before else None)


def _exchange(swap: Swap, learnt: Sequence[Sensor]) -> str:
    """The id of the correction that exchanges two sensors, by the places that their channels have before."""
    places = {c.name: sensor_place(c, learnt) for c in learnt}
    return f"sensor.{places[swap.pair.channel]}.swap_{places[swap.pair.other]}"


def _sensors(learnt: Sequence[Sensor], swaps: Sequence[Swap]) -> dict[str, str]:
    """Channel -> place in the ids of corrections, below those of the exchanges: what was learnt of a sensor's place is
    then read by the other channel. `learnt`: the sensors with the weights that the new bench file gives them, as a
    correction is found by what a sensor follows there."""
    other = {c.name: c.name for c in learnt}
    for swap in swaps:
        other |= {swap.pair.channel: swap.pair.other, swap.pair.other: swap.pair.channel}
    crossed = {c.name: replace(c, name=other[c.name]) for c in learnt}
    return {name: sensor_place(c, list(crossed.values())) for name, c in crossed.items()}


def _cause(action: actions.OnBench, network: Network, campaign: Campaign, sensors: Mapping[str, str]) -> str:
    """The id of the correction that takes off what an action does."""
    match action:
        case Misreading(channel) | Lag(channel):
            return f"sensor.{sensors[channel]}.{action.law}"
        case actions.Late(channels):
            bus = next(o.bus for o in campaign.observed if o.name in channels)
            return f"clock.{spelt(bus)}.{action.law}"
        case actions.BoundaryBias(boundary):
            return f"boundary.{network.boundaries[boundary].name}.bias"
        case actions.InputGain(name):
            return f"input.{name}.gain"
        case actions.InputBias(name):
            return f"input.{name}.bias"
        case _:
            assert_never(action)
