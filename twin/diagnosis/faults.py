"""Masked data faults as causes: the evidence of masked rows under "the channel was held" minus "it was live".

If the channel was live, the block means y (B,) of a masked stretch are normal about the fitted model's prediction, with
the covariance R of the channel's residuals (`twin.fitting.noise`) plus A H^-1 A', which the fit leaves open: A the
columns there, H the fit's Hessian. If it was held, they are the stretch's value, to within the white noise w (B,) of a
block. With e, A whitened and u = A'e,

    ln BF = (e'e - u'(H + A'A)^-1 u + ln|H + A'A| - ln|H| + ln|R|) / 2 - sum ((y - value)^2 / w + ln w) / 2.

Evidence is counted by blocks, not by samples: what a bus repeats, or what follows faster than the noise forgets, brings
none of its own. For the same reason the scatter within a block is left out. A live sensor of coarse steps q stands
still as long as what it measures stays within one: so y may be off by q / 2, and a block of many samples says no more
than to a step, w >= q^2 / 2 pi (where the density is 1 / q).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln, xlog1py, xlogy

from twin.errors import EvidenceError
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Floats, Model, Test
from twin.fitting.noise import Series, log_det
from twin.fitting.one_test import alone
from twin.fitting.recorded import RecordedChannel
from twin.motor.causes import Cause

LAW = {"held": "hold", "stuck": "stuck", "saturated": "saturation"}  # kind of a stretch -> law of its cause
EVERYDAY_LOST = 0.02  # share of frames that a healthy bus or radio may lose
EVERYDAY_HELD_S = 30.0  # for which a healthy radio repeats its last value when it is silent: shorter ones are no fault


@dataclass(frozen=True)
class Stretch:
    """A masked part of a channel: `kind` held, stuck or saturated, both ends [s] since the test's start and included,
    and the `value` [degC] that it shows."""

    kind: str
    start_s: float
    end_s: float
    value: float


def cause_of(place: str, kind: str) -> Cause:
    """The cause that a kind of stretch (or `dropout`) at a sensor's place is."""
    return Cause("sensor", place, LAW.get(kind, kind))


def fault_evidence(
    current: Fit, test: int, channel: str, stretches: Sequence[Stretch], t_s: Floats, values: Floats
) -> float:
    """ln evidence of "held" minus "live" for the stretches of one kind of a channel in one test. Stretches under 30 s
    are a healthy radio's and do not count; 0 where no other fills a block.

    `t_s` (R,) [s] since the test's start and `values` (R,) [degC] are the channel's raw samples, masked ones included.
    Raises `EvidenceError` where no test of the fit has the channel, or times and values differ in number.
    """
    if len(t_s) != len(values):
        raise EvidenceError(f'channel "{channel}": {len(t_s)} times for {len(values)} values: give one each')
    stated = _stated(current.model, test, channel)
    own = current.model.tests[test]
    lasting = [s for s in stretches if s.end_s - s.start_s >= EVERYDAY_HELD_S]
    inside = [(t_s >= s.start_s) & (t_s <= s.end_s) for s in lasting]
    masked = np.any(inside, axis=0) if inside else np.zeros(len(t_s), dtype=np.bool_)
    if not masked.any():
        return 0.0
    shown = np.select(inside, [s.value for s in lasting], 0.0)[masked]
    steps, step_s = len(own.frame.features), own.frame.step_s
    recorded = _recorded(stated, t_s[masked], values[masked], steps, step_s)
    cut = recorded.blocks(step_s)
    if not cut.there.any():
        return 0.0
    standing = replace(own, channels=(*(c for c in own.channels if c.name != channel), recorded))
    held = cut.measured(_recorded(stated, t_s[masked], shown, steps, step_s).measured)
    return _live_and_held(current, test, standing, channel, cut.measured(recorded.measured) - held)


def _stated(model: Model, test: int, channel: str) -> RecordedChannel:
    """The channel as this test has it, or as another does where nothing of it was usable in this one."""
    for one in (model.tests[test], *model.tests):
        for c in one.channels:
            if c.name == channel:
                return c
    known = ", ".join(dict.fromkeys(c.name for one in model.tests for c in one.channels))
    raise EvidenceError(f'channel "{channel}": no test of the fit has it: give one of {known}')


def _recorded(stated: RecordedChannel, t_s: Floats, values: Floats, steps: int, step_s: float) -> RecordedChannel:
    """The channel with these samples alone."""
    at = np.floor(t_s / step_s).astype(np.intp)
    kept = (at >= 0) & (at < steps)
    at, t_s, values = at[kept], t_s[kept], values[kept]
    samples = np.bincount(at, minlength=steps).astype(np.float64)
    each = np.maximum(samples, 1.0)
    measured = np.bincount(at, values, minlength=steps) / each
    place = np.bincount(at, t_s / step_s - at, minlength=steps) / each
    return RecordedChannel(stated.sensor, measured, samples, place)


def _live_and_held(current: Fit, number: int, test: Test, channel: str, off: Floats) -> float:
    """ln evidence of "held" minus "live"; `off` (B,) [K]: the block means less what is held there."""
    model, at = alone(current.model, number, test)
    part = next(p for p in model.linearise(current.beta[at]) if p.series.channel == channel)
    part = replace(part, series=_to_a_step(part.series))
    white = part.series.white_variance
    held = float(np.sum(off**2 / white + np.log(white))) / 2
    return _minus_log_live(current, model, part, at[part.at]) - held


def _to_a_step(series: Series) -> Series:
    """What a sensor says that shows whole steps alone."""
    if not series.resolution:
        return series
    most = 2 * np.pi * ((series.white_sd / series.resolution) ** 2 + 1 / 12)
    beyond = np.maximum(np.abs(series.y) - series.resolution / 2, 0.0)
    return replace(series, samples=np.minimum(series.samples, most), y=np.copysign(beyond, series.y))


def _minus_log_live(current: Fit, model: Model, part: Columns, at: NDArray[np.intp]) -> float:
    """- ln density of the block means given the fit, without B ln(2 pi) / 2."""
    white = model.whitened(part.series, np.column_stack([part.series.y, part.columns]))
    e, a = white[:, 0], white[:, 1:]
    both = current.hessian.copy()
    both[np.ix_(at, at)] += a.T @ a
    u = np.zeros(len(both))
    u[at] = a.T @ e
    volume = np.linalg.slogdet(both)[1] - np.linalg.slogdet(current.hessian)[1]
    log_r = log_det(part.series, model.noise_of(part.series.channel))
    return float(e @ e - u @ np.linalg.solve(both, u) + volume + log_r) / 2


def dropout_evidence(received: int, gaps: int) -> float:
    """ln evidence of a channel that loses frames at any share, against one that loses at most 2 %.

    `received` frames of a test with `gaps` among them: after each frame the next is lost or not, and a run of lost ones
    counts once. A faulty channel may lose any share, uniformly: B(gaps + 1, received - gaps + 1). A healthy one is
    given the likeliest share up to 2 %, which is the benefit of the doubt. Raises `EvidenceError` where there are more
    gaps than frames.
    """
    if not 0 <= gaps <= received:
        raise EvidenceError(
            f"{gaps} gaps among {received} frames: count the gaps between frames, one at most after each"
        )
    share = min(gaps / max(received, 1), EVERYDAY_LOST)
    everyday = xlogy(gaps, share) + xlog1py(received - gaps, -share)
    return float(betaln(gaps + 1, received - gaps + 1) - everyday)
