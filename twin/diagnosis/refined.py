"""Noise and priors learnt from the data themselves: restricted maximum likelihood and empirical Bayes about a fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.diagnosis.evidence import score
from twin.diagnosis.pooling import pooled_scales
from twin.diagnosis.posterior_mode import channel_rises, linearised, rises, slowest_mode_s, stacked
from twin.diagnosis.reml import ObservedSeries, as_fast_as_slow, reml
from twin.differences.candidates import Candidate
from twin.fitting.actions import Parameter
from twin.fitting.fit import LINEARISATIONS, NEAR_ENOUGH, ON_THE_WAY, Fit, fit, fit_from_file
from twin.fitting.model import Columns, Floats, Model
from twin.fitting.noise import ChannelNoise
from twin.fitting.supposed import supposing

Tell = Callable[[str], None]

IN_DESIGN = 10  # leading candidates beside the parameters when the noise is fitted


def calibrated(model: Model, candidates: Sequence[Candidate], tell: Tell) -> Fit:
    """The fit of a healthy motor as every diagnosis begins, what is supposed of nodes without a sensor among its
    readings (`twin.fitting.supposed`). Raises `DivergedError` where the file's own run leaves the finite numbers."""
    model = supposing(model)
    return refined(fit_from_file(model), candidates, model.parameters, tell)


def refined(current: Fit, candidates: Sequence[Candidate], stated: Sequence[Parameter], tell: Tell) -> Fit:
    """The fit under learnt noise, then under learnt priors of families, then under noise that is learnt again.
    `stated`: the healthy differences, first among the model's parameters, with the priors that the learnt ones are
    multiples of."""
    tell("recalibrating, fit 1 of 3: noise")
    current = under_its_noise(current, candidates, ON_THE_WAY)
    tell("recalibrating, fit 2 of 3: priors of families")
    current = under_its_priors(current, candidates, stated, ON_THE_WAY)
    tell("recalibrating, fit 3 of 3: noise")
    return under_its_noise(current, candidates)


def under_its_noise(current: Fit, candidates: Sequence[Candidate], linearisations: int = LINEARISATIONS) -> Fit:
    """The fit under noise that is learnt with the parameters and the leading candidates integrated out."""
    noise = _fitted_noise(_design(current, candidates))
    return fit(current.model.with_noise(noise), current.beta, NEAR_ENOUGH, linearisations)


def under_its_priors(
    current: Fit, candidates: Sequence[Candidate], stated: Sequence[Parameter], linearisations: int = LINEARISATIONS
) -> Fit:
    """The fit under priors of families that are learnt with the parameters and the leading candidates integrated
    out; `stated` as in `refined`."""
    model = _with_pooled_priors(_design(current, candidates), stated)
    return fit(model, current.beta, NEAR_ENOUGH, linearisations)


@dataclass(frozen=True)
class _Design:
    """A fit with its l leading candidates beside it: which parameters are `free` (not at a bound); whitened columns `a`
    (N, f) of these and `v` (N, l) of the candidates, whose prior sd is `sigma` (l,); the whitened residual `e0` (N,)
    referred back to the prior mean; and `parts`, the series with the columns of both, not whitened."""

    current: Fit
    free: NDArray[np.bool_]
    a: Floats
    v: Floats
    sigma: Floats
    e0: Floats
    parts: Sequence[Columns]


def _design(current: Fit, candidates: Sequence[Candidate]) -> _Design:
    _, parameters, parts, _ = linearised(current, candidates)
    projector, v, e0 = stacked(current, parts)
    sigma = np.array([p.sd for p in parameters])
    scores = score(v, e0, projector, sigma, np.zeros(len(sigma)))
    leading = np.argsort(-scores.log_bayes_factor, kind="stable")[:IN_DESIGN]
    kept = [Columns(p.series, p.at, p.columns, p.extra[:, leading]) for p in parts]
    return _Design(current, current.free, projector.columns, v[:, leading], sigma[leading], e0, kept)


def _fitted_noise(design: _Design) -> Mapping[str, ChannelNoise]:
    current, free = design.current, design.free
    observed = []
    for part in design.parts:
        if not part.series.measured:
            continue
        columns = np.zeros((part.series.y.size, current.beta.size))
        columns[:, part.at] = part.columns
        own = np.column_stack([columns[:, free], part.extra])
        observed.append(ObservedSeries(part.series, part.series.y + columns[:, free] @ current.beta[free], own))
    precision = 1 / np.concatenate([current.model.sd[free], design.sigma]) ** 2
    found = reml(observed, precision, slowest_mode_s(current), rises(current.model))
    return as_fast_as_slow(found, channel_rises(current.model))


def _with_pooled_priors(design: _Design, stated: Sequence[Parameter]) -> Model:
    """The model with healthy differences as wide as the data ask for; terms that were let in keep their priors."""
    model, healthy = design.current.model, len(stated)
    columns = np.hstack([design.a, design.v])
    gram, right = columns.T @ columns, columns.T @ design.e0
    let_in = model.parameters[healthy:]
    more = np.append(model.sd[healthy:][design.free[healthy:]], design.sigma)
    scales = pooled_scales(stated, design.free[:healthy], model.network, gram, right, more)
    return model.with_priors([*(replace(p, sd=p.sd * s) for p, s in zip(stated, scales, strict=True)), *let_in])
