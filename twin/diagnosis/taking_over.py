"""Where a candidate's refit starts: at the amplitude that does what healthy differences had to do in its place.

Before the cause is named, calibration bends every law at its place to stand in for it: coefficients, exponents, the map
of a loss, a sensor's lag. The way back from there is long and curved, and a search that is cut short would find a
candidate of a similar form better than the right one.
"""

from __future__ import annotations

import numpy as np

from twin.differences.candidates import Candidate
from twin.differences.proposals import Proposals, courses
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Floats, Model
from twin.motor.paths import terms_at

WORTH_TAKING = 0.1  # of the candidate's prior sd: below, a refit starts where all else is


def taken_over(current: Fit, candidate: Candidate, parameter: Parameter) -> tuple[Floats, float]:
    """The vector (p,) and the amplitude that a refit starts at. With them a heat or conductance has the mean over the
    tests that it had, and anything else the prediction."""
    match parameter.action:
        case actions.Added(places, feature, rms):
            proposals = Proposals(current.model, current.beta)
            own = {i for place in candidate.places for i in terms_at(current.model.network, place)}
            beta = _straightened(current, own, form=True)
            change = _mean(current.model, current.beta, own) - _mean(current.model, beta, own)
            amplitude = change / len(places) * rms / proposals.mean(feature)
        case actions.Scale(terms):
            beta = _straightened(current, set(terms), form=False)
            bent, straight = (_mean(current.model, vector, set(terms)) for vector in (current.beta, beta))
            amplitude = float(np.log(bent / straight)) if bent > 0 and straight > 0 else 0.0
        case _:
            beta, amplitude = _same_done(current, parameter)
    if abs(amplitude) < WORTH_TAKING * parameter.sd or not parameter.low < amplitude < parameter.high:
        return current.beta, 0.0
    return beta, amplitude


def _straightened(current: Fit, terms: set[int], form: bool) -> Floats:
    """The vector with the factors of the terms as in the file, and with `form` their exponents and maps too. What acts
    on other terms as well stays."""
    beta = current.beta.copy()
    for p, other in enumerate(current.model.parameters):
        match other.action:
            case actions.Scale(own) if set(own) <= terms:
                beta[p] = 0.0
            case actions.Power(own) | actions.Tent(own) if form and set(own) <= terms:
                beta[p] = 0.0
    return beta


def _mean(model: Model, beta: Floats, terms: set[int]) -> float:
    """Mean of the terms together over the tests [W or W/K]."""
    if not terms:
        return 0.0
    return float(courses(model, beta)[1][:, sorted(terms)].sum(axis=1).mean())


def _same_done(current: Fit, candidate: Parameter) -> tuple[Floats, float]:
    """The vector without the healthy differences of the same action (those of single tests: without their mean), and
    what was taken away. What acts in one test alone takes over what was healthy there."""
    beta, parameters = current.beta.copy(), current.model.parameters
    same = [p for p, other in enumerate(parameters) if other.action == candidate.action]
    if candidate.test is not None:
        own = [p for p in same if parameters[p].test == candidate.test]
        moved = float(beta[own].sum())
        beta[own] = 0.0
        return beta, moved
    amplitude = 0.0
    for of_tests in (False, True):
        own = [p for p in same if (parameters[p].test is not None) == of_tests]
        if own:
            moved = float(beta[own].sum()) / (len(own) if of_tests else 1)
            beta[own] = beta[own] - moved if of_tests else 0.0
            amplitude += moved
    return beta, amplitude
