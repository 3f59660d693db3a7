"""What is unusual in a calibrated motor, before any cause: families of numbers that are further from the file than
usual, single ones that had to go far, those that ended at a bound, and nodes without a sensor that are far from what
the file says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from twin.diagnosis.pooling import Family, family, kinds, regions
from twin.diagnosis.posterior_mode import stacked
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Floats

FAR = 2.0  # stated sd: a number within them is as the file says, in 19 of 20 motors
HELD = 0.01  # of its standard deviation: a number that near its bound is at it


@dataclass(frozen=True)
class Wide:
    """A family whose `members` (places in the vector) are `times` as far from the file as usual. `log_evidence`: ln of
    how many times more likely the data are with that width than with the usual one."""

    members: tuple[int, ...]
    times: float
    log_evidence: float


@dataclass(frozen=True)
class Moved:
    """The number at `place` of the vector went `usual` times its stated sd; `sd` is its own after the fit. `held`: it
    ended at a bound."""

    place: int
    usual: float
    sd: float
    held: bool


@dataclass(frozen=True)
class Elsewhere:
    """A `node` that no sensor follows, at the hottest moment that the file has of it, in test `test`: `hotter_K` than
    there, known to `sd` [K], which is `usual` times what the file is known to (`twin.fitting.supposed`)."""

    node: str
    test: int
    hotter_K: float
    sd: float
    usual: float


@dataclass(frozen=True)
class Findings:
    """What is unusual in a fit, the strongest first."""

    fit: Fit
    wide: tuple[Wide, ...]
    moved: tuple[Moved, ...]
    elsewhere: tuple[Elsewhere, ...]


def findings(current: Fit, stated: Sequence[Parameter], threshold: float) -> Findings:
    """What is unusual in a fit. `stated`: the healthy differences, first in its vector, with the widths that are usual;
    `threshold`: the ln evidence that a family must exceed, the same that a cause must, as it is a hypothesis like one.

    Temperatures at the start are no findings: they are the test's, not the motor's.
    """
    parts = current.linearised()
    wide = _wide(current, parts, stated, threshold)
    return Findings(current, wide, _moved(current, stated), _elsewhere(current, parts))


def _wide(current: Fit, parts: Sequence[Columns], stated: Sequence[Parameter], threshold: float) -> tuple[Wide, ...]:
    network, learnt, free = current.model.network, current.model.sd, current.free
    kind, region = kinds(network), regions(network)
    families: dict[Family, list[int]] = {}
    for i, parameter in enumerate(stated):
        own = family(parameter, kind, region)
        if own is not None and learnt[i] > parameter.sd and not isinstance(parameter.action, actions.Start):
            families.setdefault(own, []).append(i)
    projector, _, e0 = stacked(current, parts)
    gram, right = projector.columns.T @ projector.columns, projector.columns.T @ e0
    with_all = log_evidence(gram, right, learnt[free])
    found = []
    for members in families.values():
        usual = learnt.copy()
        usual[members] = [stated[i].sd for i in members]
        gain = with_all - log_evidence(gram, right, usual[free])
        if gain > threshold:
            found.append(Wide(tuple(members), float(learnt[members[0]] / stated[members[0]].sd), gain))
    return tuple(sorted(found, key=lambda one: -one.log_evidence))


def log_evidence(gram: Floats, right: Floats, sd: Floats) -> float:
    """ln evidence of a linear model with prior `sd` (p,), up to what does not depend on it; `gram` (p, p) = A'A and
    `right` (p,) = A'e0, whitened (`twin.diagnosis.evidence`)."""
    factor = cho_factor(gram + np.diag(1 / sd**2), lower=True)
    volume = np.log(np.diag(factor[0])).sum() + np.log(sd).sum()
    return float(right @ cho_solve(factor, right) / 2 - volume)


def _moved(current: Fit, stated: Sequence[Parameter]) -> tuple[Moved, ...]:
    sd = np.sqrt(current.covariance_diagonal)
    found = []
    for i, parameter in enumerate(stated):
        value, near = float(current.beta[i]), HELD * float(sd[i])
        inside = parameter.low + near < value < parameter.high - near
        held = not inside and abs(value) > near  # a lag that is held at 0 is as the file says
        far = abs(value) > FAR * max(parameter.sd, float(sd[i]))  # and its own band leaves out what the file says
        if (far or held) and not isinstance(parameter.action, actions.Start):
            found.append(Moved(i, float(value / parameter.sd), float(sd[i]), held))
    return tuple(sorted(found, key=lambda one: -abs(one.usual)))


def _elsewhere(current: Fit, parts: Sequence[Columns]) -> tuple[Elsewhere, ...]:
    supposed = {(s, one.name): one for s, test in enumerate(current.model.tests) for one in test.supposed}
    found = []
    for part in (part for part in parts if not part.series.measured):
        test, own = part.series.session, supposed[part.series.session, part.series.channel]
        hotter_K, column = -float(part.series.y[0]), np.zeros(current.beta.size)
        if abs(hotter_K) <= FAR * own.sensor.noise:
            continue
        column[part.at] = part.columns[0]
        sd = float(np.sqrt(column @ np.linalg.solve(current.hessian, column)))
        if abs(hotter_K) > FAR * sd:
            found.append(Elsewhere(own.sensor.node, test, hotter_K, sd, hotter_K / own.sensor.noise))
    return tuple(sorted(found, key=lambda one: -abs(one.usual)))
