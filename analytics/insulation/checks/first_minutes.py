"""The resistance from winding to iron without a sensor in the iron, from the minutes after a load is switched.

A winding lump (heat capacity C_w) on an iron lump (C_i) through the resistance R settles against it within a minute
or two, long before either feels its film: in C_w dT_w/dt = P - (T_w - T_i) / R, C_i dT_i/dt = (T_w - T_i) / R a step
of P gives

    T_w(t) = P t / C + P A (1 - exp(-t / tau)),    A = R (C_i / C)^2,    tau = R C_w C_i / C,    C = C_w + C_i.

A real winding has more lumps, so more such terms, and loses heat. Here the mean copper temperature of a stretch is

    y(t) = c0 + c1 x + c2 x^2 + sum_j A_j u_j(t),      tau_j du_j/dt = P(t) - P_before - u_j,      A_j >= 0,

x the time since the switch (before it c0 + c x, a slope of its own), tau_j on a fixed grid of `TAU_S`: a step
response as a discrete spectrum of time constants, as in the transient dual interface method (JESD51-14). The
parabola is what iron and film do over `LENGTH_S`, with coefficients of its own in each
stretch, so emissivity, film and ambient do not enter. The A_j are common to heating and cooling; the answer is
their sum. When exactly the load was switched is only known between two samples: six moments each are weighed by
likelihood.

The sum is R times a factor that ageing does not change, (C_i / C)^2 in two lumps, and holds all that lies between
thermocouple and iron, the way along the conductors too. The factor is not divided out: in a stator whose heads lose
heat, where some of the copper idles, it is not that of two lumps. The course over checks is the same with and
without.

The sd is that of refits to data made from the fit with the noise of its second differences, that over the moments
(large where the record begins under load: how warm the winding was then is not known), and `MODEL_SHARE` for what
film, ambient, draughts and start do from check to check, on a bare stator of 24 lumps at most 1 %. What the fit
leaves over of more lumps is the same in each check and not in it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from analytics.insulation.arrays import Floats
from analytics.insulation.checks.estimate import ResistanceEstimate

LENGTH_S = 1200.0  # after the switch
BEFORE_S = 120.0
TAU_S = np.geomspace(8.0, 250.0, 9)
MOST_STEP_S = 60.0  # between two samples: half the time constant of a large winding
MOMENTS = np.linspace(0.0, 1.0, 6)  # of the switch, between two samples
CORRELATED = 10.0  # so many samples count as one where moments are weighed: their errors go together
MODEL_SHARE = 0.01
REFITS, SEED = 40, 0


@dataclass(frozen=True)
class SwitchSamples:
    """Samples around one switch of the load: `t_s` (n,) [s], `copper` (n,) mean [degC], `power` (n,) [W]. The switch
    was after `from_s` and not after `to_s`; `before_W` is the power until then."""

    t_s: Floats
    copper: Floats
    power: Floats
    from_s: float
    to_s: float
    before_W: float


def stretch(t_s: Floats, copper: Floats, power: Floats, switched: int) -> SwitchSamples | None:
    """The stretch around the switch at sample `switched`, the first of the new load; arrays (N,) as in `SwitchSamples`,
    without NaN. None where fewer than 20 min are recorded after it or the samples are more than 60 s apart."""
    step = float(np.median(np.diff(t_s))) if t_s.size > 1 else np.inf
    from_s = float(t_s[switched - 1]) if switched else float(t_s[0]) - step
    wanted = (t_s >= from_s - BEFORE_S) & (t_s <= from_s + LENGTH_S)
    after = t_s[wanted & (t_s > from_s)]
    if t_s[-1] < from_s + LENGTH_S - step or np.max(np.diff(after), initial=0.0) > MOST_STEP_S or step > MOST_STEP_S:
        return None
    before = power[(t_s >= from_s - BEFORE_S / 2.0) & (t_s <= from_s)]
    before_W = float(before.mean()) if before.size else 0.0
    return SwitchSamples(t_s[wanted], copper[wanted], power[wanted], from_s, float(t_s[switched]), before_W)


def fit(stretches: Sequence[SwitchSamples]) -> ResistanceEstimate:
    """The sum of the A_j that all `stretches` share. Raises ValueError where there are none."""
    if not stretches:
        raise ValueError("no stretch of heating or cooling: a fit needs one at least")
    designs = [[_design(part, part.from_s + m * (part.to_s - part.from_s)) for m in MOMENTS] for part in stretches]
    fast = [np.concatenate([design.fast for design in choice]) for choice in itertools.product(*designs)]
    freedom = sum(part.t_s.size for part in stretches) - 5 * len(stretches) - 2
    measured = [part.copper for part in stretches]
    best = _solve(designs, fast, measured, freedom)
    random = np.random.default_rng(SEED)
    noise = [float(np.std(np.diff(part.copper, n=2)) / np.sqrt(6.0)) for part in stretches]
    fitted = [part.copper - residual for part, residual in zip(stretches, best.residual, strict=True)]
    refits = []
    for _ in range(REFITS):
        drawn = [y + sd * random.standard_normal(y.size) for y, sd in zip(fitted, noise, strict=True)]
        refits.append(_solve(designs, fast, drawn, freedom).spectrum.sum())
    value = float(best.spectrum.sum())
    sd = np.linalg.norm([float(np.std(refits)), best.spread, MODEL_SHARE * value])
    return ResistanceEstimate(value, float(sd))


@dataclass(frozen=True)
class _Design:
    """What is fitted to a stretch of n samples: `slow` (n, q) orthonormal columns of line and parabola; `fast` (n,
    taus) what these leave over of the responses u_j."""

    slow: Floats
    fast: Floats

    def left(self, y: Floats) -> Floats:
        """What the slow columns leave over of `y` (n,)."""
        return _beside(self.slow, y)


@dataclass(frozen=True)
class _Solution:
    """`spectrum` (taus,): the A_j [K/W]; `spread`: sd of their sum over the moments of switching [K/W]; `residual`: of
    each stretch with the likeliest moments, (n,) [K]."""

    spectrum: Floats
    spread: float
    residual: list[Floats]


def _design(part: SwitchSamples, switch_s: float) -> _Design:
    x = part.t_s - switch_s
    after = np.maximum(x, 0.0) / LENGTH_S
    columns = [np.ones_like(x), after, after**2]
    if np.count_nonzero(x < 0.0) > 2:
        columns.append(np.minimum(x, 0.0) / LENGTH_S)
    slow, _ = np.linalg.qr(np.stack(columns, axis=1))
    return _Design(slow, _beside(slow, _responses(x, part.power - part.before_W)))


def _beside(slow: Floats, y: Floats) -> Floats:
    """What orthonormal columns `slow` (n, q) leave over of `y` (n, ...)."""
    return np.asarray(y - slow @ (slow.T @ y))


def _responses(x: Floats, step_W: Floats) -> Floats:
    """u_j (n, taus) [W] at times x (n,) [s] after a switch, of a power that is 0 until x = 0, from there on that of the
    first sample after it, and linear between samples."""
    u, after = np.zeros((x.size, TAU_S.size)), x > 0.0
    times, watts = x[after, None], step_W[after, None]
    h, power = np.diff(times, axis=0, prepend=0.0), np.concatenate([watts[:1], watts[:-1]])
    fades = np.exp(-h / TAU_S)
    flat, ramp = power * (1.0 - fades), (watts - power) / h * (h - TAU_S * (1.0 - fades))
    now = np.zeros(TAU_S.size)
    for k, fading, level, slope in zip(np.flatnonzero(after), fades, flat, ramp, strict=True):
        u[k] = now = fading * now + level + slope
    return u


def _solve(
    designs: Sequence[Sequence[_Design]], fast: Sequence[Floats], measured: Sequence[Floats], freedom: int
) -> _Solution:
    """The spectrum by non-negative least squares for every choice of the moments of switching, weighed by
    likelihood. `fast`: for each choice (n, taus) over all stretches, which stays the same from refit to refit."""
    choices = list(itertools.product(*designs))
    lefts = list(itertools.product(*([one.left(y) for one in own] for own, y in zip(designs, measured, strict=True))))
    spectra, squares = [], []
    for columns, left in zip(fast, lefts, strict=True):
        amplitude, norm = nnls(columns, np.concatenate(left))
        spectra.append(amplitude)
        squares.append(norm**2)
    least = min(squares)
    weight = np.exp(-(np.array(squares) - least) / max(least / freedom, 1e-300) / (2.0 * CORRELATED))
    weight /= weight.sum()
    sums = np.sum(spectra, axis=1)
    spread = float(np.sqrt(weight @ (sums - weight @ sums) ** 2))
    spectrum = weight @ np.array(spectra)
    best = int(np.argmin(squares))
    residual = [left - one.fast @ spectra[best] for one, left in zip(choices[best], lefts[best], strict=True)]
    return _Solution(np.asarray(spectrum), spread, residual)
