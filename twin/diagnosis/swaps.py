"""Exchanged channels, wrong units and signs: found before anything is calibrated.

Such a fault is no small linear term: once coefficients have bent to fit exchanged channels, a linear score looks at the
wrong point. So the uncalibrated simulation is compared with the data as recorded and as they would be read without the
fault, its parameters integrated out in one linear step,

    ln p(data) = -(ln|R| + ln|A'A + Lambda| - ln|Lambda| + e'e - e'A (A'A + Lambda)^-1 A'e) / 2,

A, e whitened under noise as wide as what a file's own error leaves (Rasmussen and Williams 2006, 2.7). An exchange must
also be ahead once the motor is calibrated to both readings, by more than any other cause explains: before, a mass or a
loss that the file lacks at one of two like places looks like an exchange.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from twin.diagnosis.next_tests import read_throughout
from twin.diagnosis.rounds import weighed
from twin.differences.candidates import Candidate
from twin.errors import DivergedError
from twin.fitting.fit import Fit, fit_from_file
from twin.fitting.model import Floats, Index, Model, Test
from twin.fitting.noise import ChannelNoise, Series, log_det, whiten
from twin.fitting.recorded import RecordedChannel
from twin.motor.sensor_laws import Exchange

COARSE = ChannelNoise(ar_sd=1.0, ar_tau_s=60.0, ou_sd=2.0, ou_tau_s=600.0)  # [K], what one linear step leaves
MARGIN = 8.0  # ln BF that a fault must exceed, before calibration and after


@dataclass(frozen=True)
class Swap:
    """An accepted exchange of two channels: ln evidence of their records exchanged less as they are, uncalibrated."""

    candidate: Candidate
    log_bayes_factor: float

    @property
    def pair(self) -> Exchange:
        assert isinstance(self.candidate.action, Exchange)
        return self.candidate.action


@dataclass(frozen=True)
class _Misreading:
    """A channel that shows `factor` x degC + `offset`: what that is, and what to do about it."""

    factor: float
    offset: float
    says: str
    remedy: str


RIGHT = _Misreading(1.0, 0.0, "", "")
MISREADINGS = (
    _Misreading(1.8, 32.0, "degF (1.8 x degC + 32)", 'give unit = "degF" in the bench file'),
    _Misreading(
        -1.0, 0.0, "degC with the sign reversed", "turn its plug, or derive it with a minus sign in the bench file"
    ),
)


def scan(model: Model, candidates: Sequence[Candidate]) -> list[Swap]:
    """The exchanged pairs among the swaps of `candidates`, the clearest first. A channel is in one pair at most; each
    further pair is sought with those before it exchanged. Raises `DivergedError` where the model runs away."""
    uncalibrated = _Uncalibrated(model)
    recorded = {name: name for name in uncalibrated.sheet}
    pairs = [(c, c.action) for c in candidates if isinstance(c.action, Exchange)]
    found: list[Swap] = []
    as_recorded = _AsRecorded(model, candidates)
    while pairs:
        base = uncalibrated.log_evidence(recorded)
        gains = [uncalibrated.log_evidence(_crossed(recorded, at)) - base for _, at in pairs]
        best = int(np.argmax(gains))
        if gains[best] <= MARGIN:
            break
        candidate, at = pairs[best]
        if not as_recorded.is_behind(at):
            del pairs[best]
            continue
        found.append(Swap(candidate, gains[best]))
        recorded = _crossed(recorded, at)
        as_recorded = _AsRecorded(as_recorded.exchanged(at), candidates)
        taken = {at.channel, at.other}
        pairs = [(c, p) for c, p in pairs if taken.isdisjoint((p.channel, p.other))]
    return found


@dataclass(frozen=True, eq=False)
class _AsRecorded:
    """The tests with the channels that are taken for exchanged so far, calibrated once for all further pairs."""

    model: Model
    candidates: Sequence[Candidate]

    def exchanged(self, pair: Exchange) -> Model:
        own = self.model
        return Model(own.network, exchanged(own.tests, pair.channel, pair.other), own.parameters, own.noise)

    def is_behind(self, pair: Exchange) -> bool:
        """Whether the motor calibrated to the tests with a pair exchanged is ahead of the one calibrated to them as
        they are, by more than any other cause would be. A motor that cannot be calibrated is behind."""
        crossed = _calibrated(self.exchanged(pair))
        if self._calibrated is None or crossed is None:
            return crossed is not None
        ahead = crossed.log_evidence - self._calibrated.log_evidence
        return ahead > MARGIN and ahead - self._by_another_cause > MARGIN

    @cached_property
    def _calibrated(self) -> Fit | None:
        return _calibrated(self.model)

    @cached_property
    def _by_another_cause(self) -> float:
        """The largest ln BF of a candidate that exchanges nothing, 0 where there is none."""
        others = [c for c in self.candidates if not c.discrete]
        if self._calibrated is None or not others:
            return 0.0
        return float(weighed(self._calibrated, others).scores.log_bayes_factor.max(initial=0.0))


def _calibrated(model: Model) -> Fit | None:
    try:
        return fit_from_file(model)
    except DivergedError:
        return None


def _crossed(recorded: Mapping[str, str], pair: Exchange) -> dict[str, str]:
    return {**recorded, pair.channel: recorded[pair.other], pair.other: recorded[pair.channel]}


def exchanged(tests: Sequence[Test], channel: str, other: str) -> tuple[Test, ...]:
    """The tests with what two channels recorded exchanged: values, usable samples, their times, the step that they are
    rounded to, and the starts that they measured. Place, lag, noise and bias stay with the name, as these are the
    sensor's own. Where a test has only one of the two, its record becomes the other's."""
    sheet = _sheet(tests)
    to = {channel: other, other: channel}

    def crossed(test: Test) -> Iterator[RecordedChannel]:
        own = {c.name: c for c in test.channels}
        for c in test.channels:
            name = to.get(c.name, c.name)
            yield _recorded(c, own[name]) if name in own else _recorded(sheet[name], c)

    def begins(test: Test) -> dict[str, Floats]:
        return {to.get(name, name): moved for name, moved in test.begins.items()}

    return tuple(replace(test, channels=tuple(crossed(test)), begins=begins(test)) for test in tests)


def _sheet(tests: Sequence[Test]) -> dict[str, RecordedChannel]:
    """Every channel by its name, as the first test that has it knows it."""
    return {c.name: c for test in reversed(tests) for c in test.channels}


def _recorded(channel: RecordedChannel, record: RecordedChannel) -> RecordedChannel:
    """The channel with what another one recorded."""
    return replace(record, sensor=replace(channel.sensor, resolution=record.sensor.resolution))


def misread(model: Model) -> list[str]:
    """A line for every channel whose values follow the motor in another unit or with the other sign, the clearest
    first: what, where, why and what to do. Each further one is sought with those before it put right. Raises
    `DivergedError` where the model runs away."""
    uncalibrated = _Uncalibrated(model)
    recorded = {name: name for name in uncalibrated.sheet}
    wrong: dict[str, _Misreading] = {}
    lines: list[str] = []
    while True:
        base = uncalibrated.log_evidence(recorded, wrong)
        others = [(name, each) for name in recorded if name not in wrong for each in MISREADINGS]
        tried = [(name, each) for name, each in others if uncalibrated.is_nearer(name, each)]
        gains = [uncalibrated.log_evidence(recorded, {**wrong, name: each}) - base for name, each in tried]
        best = int(np.argmax(gains)) if gains else 0
        if not gains or gains[best] <= MARGIN:
            return lines
        name, each = tried[best]
        wrong[name] = each
        line = f'channel "{name}": its values follow the motor as {each.says}, not as degC (ln Bayes factor '
        lines.append(f"{line}{gains[best]:.0f}): {each.remedy}")


# --- Evidence ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Record:
    """What a channel recorded in a test: blocks that are `there` (B,), their means and times."""

    there: NDArray[np.bool_]
    means: Floats
    t_s: Floats


@dataclass(frozen=True)
class _Piece:
    """A record read as one channel's: whitened columns A of the parameters `at`, A'A, A'e, e'e, ln|R|."""

    at: Index
    white: Floats
    gram: Floats
    right: Floats
    square: float
    log_r: float


class _Uncalibrated:
    """The simulation of the motor file at every block of every channel, and the records to be read with it."""

    def __init__(self, model: Model) -> None:
        self.precision = 1 / model.sd**2
        self.sheet = _sheet(model.tests)
        self.numbers = range(len(model.tests))
        every = self.sheet.values()
        tests = [replace(t, channels=read_throughout(every, len(t.frame.features))) for t in model.tests]
        whole = Model(model.network, tests, model.parameters)
        self.simulated = {
            (part.series.session, part.series.channel): part  # measured as 0: its residual is minus what is shown
            for part in whole.linearise(np.zeros(len(model.parameters)))
        }
        self.records: dict[tuple[int, str], _Record] = {}
        for s, test in enumerate(model.tests):
            for c in test.channels:
                cut = c.blocks(test.frame.step_s)
                self.records[s, c.name] = _Record(cut.there, cut.measured(c.measured), cut.times_s(test.frame.step_s))
        self._own: dict[tuple[int, str], _Piece] = {}
        for s, name in self.records:
            self._own[s, name] = self._piece(s, name, name, RIGHT)

    def log_evidence(self, recorded: Mapping[str, str], wrong: Mapping[str, _Misreading] | None = None) -> float:
        """ln p(data), without -N ln(2 pi) / 2, where channel `name` shows the record of channel `recorded[name]`, and
        reads `wrong[name]`."""
        gram, right, rest = np.diag(self.precision), np.zeros(len(self.precision)), 0.0
        for s in self.numbers:
            pieces = self._pieces(s, recorded, wrong or {})
            if not pieces:
                continue
            at = pieces[0].at  # of one test: the same places for all its channels
            among = np.ix_(at, at)
            gram_there, right_there = gram[among], right[at]
            for piece in pieces:
                gram_there += piece.gram
                right_there += piece.right
                rest += piece.square + piece.log_r
            gram[among], right[at] = gram_there, right_there
        lower = cholesky(gram, lower=True)
        fitted = solve_triangular(lower, right, lower=True)
        volume = 2 * np.log(np.diag(lower)).sum() - np.log(self.precision).sum()
        return -float(rest + volume - fitted @ fitted) / 2

    def is_nearer(self, name: str, wrong: _Misreading) -> bool:
        """Whether all that a channel recorded is nearer to the simulation in this reading than as it is. Where it is
        not, the evidence is of something else, as of a clock that is late by half a minute."""
        ours = [(self.simulated[s, one].series.y, kept) for (s, one), kept in self.records.items() if one == name]
        simulated = np.concatenate([-y[kept.there] for y, kept in ours])
        shown = np.concatenate([kept.means for _, kept in ours])
        off = np.abs(shown - wrong.factor * simulated - wrong.offset)
        return bool(off.sum() < np.abs(shown - simulated).sum())

    def _pieces(self, s: int, recorded: Mapping[str, str], wrong: Mapping[str, _Misreading]) -> list[_Piece]:
        """Every channel of a test, as its record is read."""
        pieces = []
        for name, record in recorded.items():
            if (s, record) in self.records:
                misread = wrong.get(name, RIGHT)
                same = name == record and misread is RIGHT
                pieces.append(self._own[s, name] if same else self._piece(s, name, record, misread))
        return pieces

    def _piece(self, s: int, name: str, record: str, wrong: _Misreading) -> _Piece:
        simulated, kept, sensor = self.simulated[s, name], self.records[s, record], self.sheet[name].sensor
        y = kept.means - wrong.factor * -simulated.series.y[kept.there] - wrong.offset
        samples = np.ones_like(y)  # one a block: beside kelvins a sensor's own noise is nothing
        series = Series(s, name, kept.t_s, y, samples, sensor.noise, sensor.resolution)
        e = whiten(series, COARSE, y[:, None])[:, 0]
        like = self._own.get((s, name))
        if like is not None and wrong.factor == 1.0 and np.array_equal(kept.t_s, self.records[s, name].t_s):
            white, gram = like.white, like.gram
        else:
            white = whiten(series, COARSE, wrong.factor * simulated.columns[kept.there])
            gram = white.T @ white
        return _Piece(simulated.at, white, gram, white.T @ e, float(e @ e), log_det(series, COARSE))
