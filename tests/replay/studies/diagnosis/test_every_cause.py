"""Every kind of candidate, as the generator makes them: its column is what a motor or bench that has it shows,
and a file says it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.bench.bench_file import read_bench
from ingest.bench.corrections import correct
from ingest.bench.laws import LAWS, MASKED
from made.caused import (
    AROUND_DEGC,
    BUSES,
    HUNDRED_HOURS,
    INITIAL,
    INPUT_BUS,
    SESSION,
    Readings,
    bench_text,
    bench_with,
    in_slower_time,
    shown,
    with_cause,
)
from made.motor import CHANNELS, SINGLE, every_law, recorded, smooth
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_text import written
from replay.engine.files.network_text import network_text
from twin.calibration.learned import network_of
from twin.differences.candidates import Candidate, InputChannel, added_monomials, generate
from twin.differences.proposals import Proposals
from twin.fitting.fit import Fit
from twin.fitting.model import Model
from twin.motor.causes import FIXED_LAWS, KINDS
from twin.motor.sensor import Sensor
from twin.motor.sensor_laws import SENSOR_LAWS

Floats = NDArray[np.float64]

DURATION_S = 300.0
NEAR = 0.002  # of the largest entry: steps of 2 s against steps of 0.5 s
ROUGH = {
    "sensor.winding.lag": 0.01,  # a prompt sensor begins to lag by the slope over a step of 2 s
    "clock.can3.drift": 0.03,  # the time of sensors that lag drifts along too
}
LINE = 0.3  # a motor file lets a link change with the temperature of one of its ends
INNER = slice(1, -1)  # of the blocks: nothing is known of what was before the first stamp and after the last
SHARE = 1e-2  # of the prior size: the step of a difference
CANDIDATES = {
    str(c.cause): c
    for c in generate(
        every_law(),
        [Sensor(name, weights, BUSES[name]) for name, (weights, _) in CHANNELS.items()],
        [InputChannel(name, INPUT_BUS) for name in (*SINGLE, *AROUND_DEGC)],
    )
}
LINEAR = {name: c for name, c in CANDIDATES.items() if not c.discrete}
OF_THE_BENCH = {name: c for name, c in CANDIDATES.items() if c.cause.kind in LAWS}
OF_THE_MOTOR = {name: c for name, c in CANDIDATES.items() if c.cause.kind not in LAWS}
DRIVE = smooth(DURATION_S)


@pytest.fixture(scope="module")
def proposals() -> Proposals:
    """The motor of the file on one test, nothing fitted."""
    hours = {c.cause.law: HUNDRED_HOURS for c in CANDIDATES.values() if c.cause.kind == "ageing"}
    more = added_monomials(list(CANDIDATES.values()))
    test = recorded(every_law(), DRIVE, INITIAL, more=more, buses=BUSES, course={"session": SESSION, **hours})
    return Proposals(Model(every_law(), [test], []), np.zeros(0))


@pytest.fixture(scope="module")
def columns(proposals: Proposals) -> dict[str, Readings]:
    """Candidate -> channel -> its column for a unit of the candidate's amplitude."""
    parameters = [proposals.parameter(c) for c in LINEAR.values()]
    per = [p.sd / c.sigma.value(proposals.scales) for p, c in zip(parameters, LINEAR.values(), strict=True)]
    parts = proposals.model.linearise(np.zeros(0), parameters)
    return {name: {p.series.channel: per[i] * p.extra[:, i] for p in parts} for i, name in enumerate(LINEAR)}


def test_every_kind_of_cause_is_among_them() -> None:
    assert {c.cause.kind for c in CANDIDATES.values()} == set(KINDS)


def test_ids_and_bench_files_know_the_same_errors_of_a_bench() -> None:
    assert {one.law for one in SENSOR_LAWS} == set(LAWS["sensor"]) - set(MASKED)
    for kind, laws in LAWS.items():
        assert set(laws) <= set(FIXED_LAWS[kind])
        assert {c.cause.law for c in LINEAR.values() if c.cause.kind == kind} == set(laws) - set(MASKED)


def _places(candidate: Candidate) -> list[list[str]]:
    return [place.split("-") for place in candidate.members or [candidate.cause.place]]


def _shown_with(candidate: Candidate, amount: float) -> Readings:
    """What the channels show where the cause is there: in the motor, or in the bench by a correction of its file."""
    cause = candidate.cause
    if str(cause) == f"clock.{INPUT_BUS}.drift":  # the twin moves all readings instead: the motor's time drifts along
        bench = bench_with(str(cause), amount)
        return shown(bench, every_law(), DRIVE, lambda motor, _: in_slower_time(motor, -1e-6 * amount))
    if cause.kind in LAWS:
        return shown(bench_with(str(cause), amount), every_law(), DRIVE)
    bench = read_bench(bench_text().encode(), "bench.toml")
    return shown(
        bench, every_law(), DRIVE, lambda motor, drive: with_cause(motor, cause, _places(candidate), amount, drive)
    )


def _slope(at: Callable[[float], Readings], step: float, one_sided: bool) -> Readings:
    """By a central difference about 0; of what can only be above 0, by one of the same order from there."""
    ends = at(step), at(2 * step if one_sided else -step)
    middle = at(0.0) if one_sided else None
    return {
        name: (4 * a - ends[1][name] - 3 * middle[name]) / (2 * step) if middle else (a - ends[1][name]) / (2 * step)
        for name, a in ends[0].items()
    }


@pytest.mark.parametrize("name", LINEAR)
def test_a_column_is_what_a_motor_or_bench_with_the_cause_shows(
    name: str, columns: dict[str, Readings], proposals: Proposals
) -> None:
    candidate = LINEAR[name]
    step = SHARE * candidate.sigma.value(proposals.scales)
    expected = _slope(lambda amount: _shown_with(candidate, amount), step, candidate.sign > 0)
    _assert_near(columns[name], expected, ROUGH.get(name, NEAR))


def _assert_near(found: Readings, expected: Readings, near: float) -> None:
    largest = max(np.abs(column).max() for column in expected.values())
    assert largest > 0
    for channel, column in expected.items():
        assert np.abs(found[channel] - column)[INNER].max() < near * largest, channel


# --- What a file says of it -------------------------------------------------------------------------------------------


def _twin(proposals: Proposals, candidate: Candidate, amount: float) -> tuple[Fit, Readings]:
    """The twin with so much of a cause [of the candidate's unit], and what that changes in its readings."""
    parameter = proposals.parameter(candidate)
    model = Model(every_law(), proposals.tests, [parameter])
    beta = np.array([amount * parameter.sd / candidate.sigma.value(proposals.scales)])
    ends = [model.residuals(at) for at in (np.zeros(1), beta)]
    changed = {without.channel: without.y - with_it.y for without, with_it in zip(*ends, strict=True)}
    return Fit(model, beta, 0.0, np.eye(1), (), 0.0, True, 1), changed


def _change(ends: tuple[Readings, Readings]) -> Readings:
    return {name: ends[1][name] - column for name, column in ends[0].items()}


@pytest.mark.parametrize("name", [name for name in OF_THE_BENCH if name in LINEAR])
def test_a_bench_file_takes_off_what_the_twin_puts_on(name: str, proposals: Proposals) -> None:
    candidate = OF_THE_BENCH[name]
    amount = 0.1 * candidate.sigma.value(proposals.scales)  # the gain of an input is a factor's logarithm in the twin
    bench = bench_with(name, amount)
    assert [one.cause for one in bench.corrections] == [name]
    expected = _change((_shown_with(candidate, 0.0), _shown_with(candidate, amount)))
    _assert_near(_twin(proposals, candidate, amount)[1], expected, 10 * ROUGH.get(name, NEAR))


@pytest.mark.parametrize("name", [name for name, c in CANDIDATES.items() if c.discrete])
def test_a_bench_file_exchanges_channels_back(name: str) -> None:
    bench = bench_with(name, 1.0)
    now = correct(bench.name, bench.channels, bench.corrections).channels
    moved = {old.name: new.weights for old, new in zip(bench.channels, now, strict=True) if old.weights != new.weights}
    a, b = moved
    assert moved == {a: CHANNELS[b][0], b: CHANNELS[a][0]}


@pytest.mark.parametrize("name", OF_THE_MOTOR)
def test_a_motor_file_that_writes_a_cause_reads_back_as_the_motor_that_has_it(name: str, proposals: Proposals) -> None:
    candidate = OF_THE_MOTOR[name]
    amount = 0.5 * candidate.sigma.value(proposals.scales)
    fit, changed = _twin(proposals, candidate, amount)
    before = network_text(every_law(), "A test.")
    after = written(before, "every-law.toml", network_of(fit, added_monomials([candidate])), "With a cause.")
    if candidate.repeated:  # what changes from session to session is said by no file
        assert after == before
        return
    bench = read_bench(bench_text().encode(), "bench.toml")
    ends = [shown(bench, read_motor(data, "every-law.toml"), DRIVE) for data in (before, after)]
    _assert_near(changed, _change((ends[0], ends[1])), LINE if candidate.cause.law == "temperature" else 2 * NEAR)
