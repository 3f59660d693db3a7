"""What the named terms are worth on kept sessions: log score, excess error, mean error by node against two
baselines."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from replay.studies.diagnosis.answer import KeptGain
from twin.diagnosis.gain import OPENING, held_out_gain, removes_excess
from twin.diagnosis.kept_tests import KeptTests, Prediction, kept_tests
from twin.diagnosis.posterior_mode import slowest_mode_s
from twin.errors import DivergedError
from twin.fitting.fit import Fit
from twin.fitting.model import Floats, Test
from twin.fitting.noise import floor_variance
from twin.fitting.recorded import RecordedChannel

CELLS = 10  # of speed and of current, each to its largest value in training
BOOTSTRAP_DRAWS = 1000
BLOCK_MODES = 2.0  # slowest modes to a block
WORSE = 2.0  # times the mean square error: a term that does this to kept sessions is form error
LOST = 10.0  # of log score: a term that loses so much is form error too
OVER_SESSIONS = 5  # kept sessions from which on they are resampled themselves

Trio = tuple[Prediction, Prediction, Prediction]  # recalibrated, with the terms, as published


@dataclass(frozen=True)
class Measured:
    """What kept sessions say of the terms. `improved`: the log score is better and half of the excess error went; `why`
    not, where it is not. `worse`: the terms make the mean square error twice as large, lose 10 of log score, or let the
    temperatures run away. `masked_better`: channel with masked samples -> its error is smaller without them."""

    gain: tuple[KeptGain, ...]
    log_score_gain: float | None
    log_score_gain_lower: float | None
    few: bool
    improved: bool
    why: str | None
    worse: bool
    masked_better: Mapping[str, bool]


def measured(
    base: Fit,
    final: Fit,
    train: Sequence[Test],
    kept: Sequence[Test],
    named: bool,
    kept_after: Sequence[Test] | None = None,
) -> Measured:
    """Kept sessions under the recalibrated motor, with the named terms, and under the file as published. `kept_after`:
    the sessions with exchanged channels put right, for the motor with the terms."""
    kept, kept_after = of_the_same_steps(kept, kept_after) if kept_after else (kept, kept)
    before = kept_tests(base, final.model, kept)
    try:
        after = kept_tests(final, final.model, kept_after)
    except DivergedError:
        if not named:
            raise
        return Measured((), None, None, False, False, "with it the kept sessions run away", True, {})
    block_s = BLOCK_MODES * slowest_mode_s(final)
    gain = _gain((before, after, kept_tests(None, final.model, kept)), train, kept, block_s)
    if not named:
        return Measured(gain, None, None, False, False, None, False, _masked_better(final, kept))
    rows = zip(before.scored, after.scored, strict=True)  # of an exchanged channel, with the other's stamps
    score = held_out_gain(before.scored, [replace(other, t_s=one.t_s) for one, other in rows], block_s)
    floors = {s.channel: floor_variance(s, final.model.noise_of(s.channel)) for s in final.model.residuals(final.beta)}
    halves = removes_excess(_by_channel(before), _by_channel(after), floors)
    why = None
    if len(score.blocks) == 1 and score.total > 0:
        stretches = f"two stretches of {block_s / 60:.0f} min are needed behind its first {OPENING:.0%}"
        why = f"the kept session is too short to judge by: {stretches}"
    elif not score.positive:
        why = f"the kept sessions are not predicted better: log score {score.total:+.1f}, at least {score.lower:+.1f}"
    elif not halves:
        why = "less than half of the excess error of the kept sessions went: recalibration had absorbed the rest"
    square = [sum(float(p.residual @ p.residual) for p in found.predictions) for found in (before, after)]
    worse = square[1] > WORSE * square[0] or score.total < -LOST
    return Measured(gain, score.total, score.lower, score.few, why is None, why, worse, _masked_better(final, kept))


def of_the_same_steps(kept: Sequence[Test], after: Sequence[Test]) -> tuple[list[Test], list[Test]]:
    """Sessions as they are and with exchanged channels put right, each channel with the samples of those steps that
    have some in both: one of two exchanged channels may have been open for a while, or be logged less often."""
    pairs = [_of_the_same_steps(one, other) for one, other in zip(kept, after, strict=True)]
    return [one for one, _ in pairs], [other for _, other in pairs]


def _of_the_same_steps(one: Test, other: Test) -> tuple[Test, Test]:
    channels = zip(one.channels, other.channels, strict=True)
    there = [(a, b, (a.samples > 0) & (b.samples > 0)) for a, b in channels]
    both = [(_where(steps, a), _where(steps, b)) for a, b, steps in there if steps.any()]
    return replace(one, channels=tuple(a for a, _ in both)), replace(other, channels=tuple(b for _, b in both))


def _where(steps: NDArray[np.bool_], channel: RecordedChannel) -> RecordedChannel:
    """The channel with the samples of these steps alone."""
    return replace(channel, samples=np.where(steps, channel.samples, 0.0))


def _masked_better(final: Fit, kept: Sequence[Test]) -> dict[str, bool]:
    """Channels of the kept sessions with masked samples: whether the prediction is nearer to the unmasked ones."""
    found: defaultdict[str, tuple[list[Floats], list[Floats]]] = defaultdict(lambda: ([], []))
    whole = [replace(t, channels=tuple(_unmasked(c) for c in t.channels)) for t in kept]
    masked, live = (kept_tests(final, final.model, tests).predictions for tests in (kept, whole))
    for one, every in zip(masked, live, strict=True):
        if every.residual.size > one.residual.size:
            with_mask, without = found[one.channel]
            with_mask.append(np.abs(one.residual))
            without.append(np.abs(every.residual))
    return {c: float(np.concatenate(a).mean()) < float(np.concatenate(b).mean()) for c, (a, b) in found.items()}


def _unmasked(channel: RecordedChannel) -> RecordedChannel:
    """The channel as if every sample that was recorded were live."""
    samples = np.where(np.isfinite(channel.measured), np.maximum(channel.samples, 1.0), 0.0)
    return replace(channel, samples=samples)


def _by_channel(found: KeptTests) -> dict[str, Floats]:
    residuals: defaultdict[str, list[Floats]] = defaultdict(list)
    for one in found.predictions:
        residuals[one.channel].append(one.residual)
    return {channel: np.concatenate(parts) for channel, parts in residuals.items()}


def _gain(
    found: tuple[KeptTests, KeptTests, KeptTests], train: Sequence[Test], kept: Sequence[Test], block_s: float
) -> tuple[KeptGain, ...]:
    """The gain at every node; `found`: kept tests recalibrated, with the terms, as published."""
    nodes: defaultdict[str, list[Trio]] = defaultdict(list)
    for trio in zip(*(one.predictions for one in found), strict=True):
        channel = next((c for c in kept[trio[0].test].channels if c.name == trio[0].channel), None)
        if channel is not None:  # no meter, whose rows are no temperatures
            nodes[node_of(channel)].append(trio)
    outside = outside_trained(train, kept)
    over = len(kept) >= OVER_SESSIONS
    gains = []
    for node, trios in nodes.items():
        mae = [float(np.abs(np.concatenate([t[i].residual for t in trios])).mean()) for i in range(3)]
        low, high = _interval(trios, block_s, over)
        gains.append(
            KeptGain(
                node=node,
                mae_before_K=mae[0],
                mae_after_K=mae[1],
                ci95_K=[low, high],
                interval="over sessions" if over else "within these sessions",
                published_mae_K=mae[2],
                outside_trained_share=float(np.concatenate(outside).mean()),
                rms_inside_K=_rms_where(trios, kept, [~steps for steps in outside]),
                rms_outside_K=_rms_where(trios, kept, outside),
            )
        )
    return tuple(gains)


def node_of(channel: RecordedChannel) -> str:
    """The node that a channel follows by more than half, else all that it follows."""
    return channel.sensor.followed or " + ".join(channel.sensor.weights)


def _interval(trios: Sequence[Trio], block_s: float, over: bool) -> tuple[float, float]:
    """95 % of the mean difference of absolute errors, blocks (or whole sessions) resampled."""
    sums: defaultdict[tuple[int, int], list[float]] = defaultdict(lambda: [0.0, 0.0])
    for before, after, _ in trios:
        better = np.abs(before.residual) - np.abs(after.residual)
        block = np.zeros(better.size, dtype=np.int64) if over else (before.t_s // block_s).astype(np.int64)
        for b in np.unique(block):
            unit = sums[before.test, int(b)]
            unit[0] += float(better[block == b].sum())
            unit[1] += int((block == b).sum())
    table = np.array(list(sums.values()))
    draws = np.random.default_rng(0).integers(len(table), size=(BOOTSTRAP_DRAWS, len(table)))
    drawn = table[draws].sum(axis=1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], (0.025, 0.975))
    return float(low), float(high)


def _rms_where(trios: Sequence[Trio], kept: Sequence[Test], wanted: Sequence[NDArray[np.bool_]]) -> list[float]:
    """Root mean square error before and after [K] of the blocks whose mean time is in a `wanted` step; [] without
    any."""
    step = [np.minimum(t[0].t_s // kept[t[0].test].frame.step_s, wanted[t[0].test].size - 1) for t in trios]
    there = [wanted[t[0].test][s.astype(np.int64)] for t, s in zip(trios, step, strict=True)]
    if not any(rows.any() for rows in there):
        return []
    left = [np.concatenate([t[i].residual[rows] for t, rows in zip(trios, there, strict=True)]) for i in range(2)]
    return [float(np.sqrt(np.mean(residual**2))) for residual in left]


def outside_trained(train: Sequence[Test], kept: Sequence[Test]) -> list[NDArray[np.bool_]]:
    """Which steps of each kept test are in cells of speed and current that training never visited."""
    names = [name for name in ("speed", "current", "torque") if all(name in t.inputs for t in (*train, *kept))][:2]
    if not names:
        return [np.zeros(len(t.frame.boundaries), dtype=np.bool_) for t in kept]
    largest = {name: max(float(t.inputs[name].max()) for t in train) or 1.0 for name in names}

    def cells(test: Test) -> NDArray[np.int64]:
        at = [np.floor(CELLS * test.inputs[name] / (1.001 * largest[name])).astype(np.int64) for name in names]
        cell: NDArray[np.int64] = np.sum([a * 1000**i for i, a in enumerate(at)], axis=0)
        return cell

    visited = np.unique(np.concatenate([cells(t) for t in train]))
    return [~np.isin(cells(t), visited) for t in kept]
