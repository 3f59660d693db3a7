"""How large each candidate cause must be before tests show it, what it then costs, and what else it looks like.

With J = v'P v of a candidate (`twin.planning.gathered`) an amplitude a stands d = a sqrt(J) above what noise and
everything healthy leave of it. At d = 5 another candidate with the correlation rho in the same readings is expected to
fall (25 / 2) (1 - rho^2) behind in ln BF (`twin.diagnosis.evidence.separation`): below ln 20 both are not told apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.evidence import TOLD_APART, separation
from twin.diagnosis.posterior_mode import linearised, stacked
from twin.diagnosis.told_apart import STANDS_OUT
from twin.differences.candidates import Candidate
from twin.differences.proposals import courses, scales
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Floats, Model
from twin.motor.causes import OF_THE_MOTOR
from twin.planning.gathered import Ground
from twin.planning.limits import NodeLimits, watched

ALIKE = 5  # that many others are named


@dataclass(frozen=True)
class Detectable:
    """A candidate and the `smallest` amplitude that stands out, in `unit`: of a heat in W, of a path in W/K; `times`
    its prior size. `hot_spot_K`: by how much that changes the hottest limited node at its hottest, None where the cause
    is none of the motor; `alike`: ids of candidates that it is not told from, the nearest first. `smallest` is None
    where no reading moves."""

    candidate: Candidate
    smallest: float | None
    unit: str
    times: float
    hot_spot_K: float | None
    alike: tuple[str, ...]

    @property
    def usual_shows(self) -> bool:
        """Whether its prior size stands out."""
        return self.times <= 1.0


@dataclass(frozen=True)
class Prospect:
    """What tests could show: the `ground` that more are added to, its `candidates` (m,), and what is `detectable`."""

    ground: Ground
    candidates: tuple[Candidate, ...]
    limits: NodeLimits
    detectable: tuple[Detectable, ...]


def prospect(fit: Fit, candidates: Sequence[Candidate]) -> Prospect:
    """What the tests of a fit could show, those first that show at the smallest share of their prior size."""
    model = fit.model
    chosen, parameters, parts, _ = linearised(fit, candidates)
    ground = Ground.of(fit, parameters, parts)
    projector, v, _ = stacked(fit, parts)
    gram = projector.inner(v, v)
    limits = NodeLimits.of(model.network, model, fit.beta)
    smallest = np.full(len(chosen), np.inf)
    np.divide(STANDS_OUT, np.sqrt(np.diag(gram)), out=smallest, where=np.diag(gram) > 0)
    apart = separation(np.where(np.isfinite(smallest), smallest, 0.0), gram)
    costs = np.abs(_at_the_hottest(fit, parameters, limits))
    per = _units(fit, chosen, parameters)
    found = []
    for i, candidate in enumerate(chosen):
        near = [int(j) for j in np.argsort(apart[i], kind="stable") if apart[i, j] < TOLD_APART and j != i]
        size, unit = per[i]
        of_motor = candidate.cause.kind in OF_THE_MOTOR
        found.append(
            Detectable(
                candidate=candidate,
                smallest=float(smallest[i] * size) if np.isfinite(smallest[i]) else None,
                unit=unit,
                times=float(smallest[i] / parameters[i].sd),
                hot_spot_K=float(smallest[i] * costs[i]) if of_motor and np.isfinite(smallest[i]) else None,
                alike=tuple(str(chosen[j].cause) for j in near[:ALIKE]),
            )
        )
    return Prospect(ground, tuple(chosen), limits, tuple(sorted(found, key=lambda one: one.times)))


def _at_the_hottest(fit: Fit, parameters: Sequence[Parameter], limits: NodeLimits) -> Floats:
    """What a unit of each parameter (m,) adds to the limited node that is nearest to its limit, in that moment [K]."""
    base = fit.model
    inside = [watched(limits.nodes, len(test.frame.features)) for test in base.tests]
    limit_of = dict(zip((one.name for one in inside[0]), limits.degC.tolist(), strict=True))
    tests = [replace(t, channels=(*t.channels, *more)) for t, more in zip(base.tests, inside, strict=True)]
    model = Model(base.network, tests, base.parameters, base.noise)
    best, found = -np.inf, np.zeros(len(parameters))
    for part in model.linearise(fit.beta, parameters):
        if part.series.channel not in limit_of:
            continue
        room = -part.series.y - limit_of[part.series.channel]
        at = int(room.argmax())
        if room[at] > best:
            best, found = float(room[at]), part.extra[at]
    return found


def _units(fit: Fit, candidates: Sequence[Candidate], parameters: Sequence[Parameter]) -> list[tuple[float, str]]:
    """What a unit of each parameter is in the candidate's unit, and that unit: a factor of a heat or path is told as
    its mean over the tests."""
    model = fit.model
    sizes, carried = scales(model.network, model.tests), np.abs(courses(model, fit.beta)[1]).mean(axis=0)
    found = []
    for candidate, parameter in zip(candidates, parameters, strict=True):
        action = parameter.action
        if isinstance(action, actions.Scale):
            unit = "W" if candidate.cause.kind == "loss" else "W/K"
            found.append((float(carried[list(action.terms)].sum()), unit))
        else:
            found.append((candidate.sigma.value(sizes) / parameter.sd, candidate.unit))
    return found
