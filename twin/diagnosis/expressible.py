"""A fit as motor and bench files can say it: some of its numbers are set to 0, and the others take over what those did.

A number is set to 0 where no file can say it (a path that takes heat uphill), or where it is too small to be worth a
line. An error of the bench must be known, too: a thermal model has no reference for a gain of 1 %, so what it says of
one is mostly its own error, and a reading that is moved by that is worse than the one recorded. Where the form of the
file is wrong, none of a reading is known, unless it is named: a lump that is no point looks like a gain. And what a
session of its own is off by, its coolant for one, is what the form lacks there, and no other session has it: left free
while the rest is fitted again, it would keep the rest from what all sessions have in common. A loss that falls with
current so fast that it would cool is held where something is left of it (`Shape.least_slope`), and an exponent at 0,
as below it a film would be infinite at standstill.

A hundred small differences just left out would add up to kelvins, so the others take their part by the fit's own
curvature H (Laplace's approximation): with d the entries set to 0 and f the others,

    beta_f = mode_f + H_ff^-1 H_fd mode_d,

the mean of a Gaussian given some of its entries (Rasmussen and Williams 2006, A.6). From there f is fitted again.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twin.diagnosis.posterior_mode import is_wrong_in_form
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, Fit, Floats, fit
from twin.motor.features import terms
from twin.motor.network import NOBODY, Shape, Term
from twin.motor.sensor_laws import Bias, Gain, Lag, Misreading

Bools = NDArray[np.bool_]

WORTH_A_LINE = 0.1  # of its prior sd: a healthy difference below is not written
SURE = 3.0  # standard deviations, by the posterior and over tests, from which on an error of the bench is known
MOST_BESIDE = 0.9  # of what a sensor follows may be other nodes than its own
COMMON_FROM = 3  # tests: from two nobody sees whether they agree
WORTH_A_CORRECTION = 0.3  # of its prior sd: a smaller common error is not written


def expressible(found: Fit, named: Collection[int], driving: Collection[str]) -> Fit:
    """The fit again, its vector in the same places, with what files cannot say at 0: a path or a share of a sensor
    below 0, the clock of a bus that drives the model, a heat over the current of a motor that brakes, healthy
    differences below `WORTH_A_LINE`, and errors of the bench that are less than `SURE`; where the form of the file is
    wrong, also what readings, and the bench in one test, are off by. No exponent falls below 0.

    `named`: places in the vector that stay as they are; what is healthy of the same action is never too small;
    `driving`: channels on a bus that stamps inputs too. What else belongs to one test is no part of a file and stays
    free.
    """
    parameters, mode = found.model.parameters, found.beta
    causes = {parameters[p].action for p in named if parameters[p].test is None}
    unnamed = np.array([p not in named for p in range(len(parameters))])
    open_ = unnamed & np.array([one.test is None for one in parameters])
    unsayable = open_ & np.array([_is_common_drive(one, driving) or _is_no_map(one) for one in parameters])
    if is_wrong_in_form(found.model):
        unsayable |= unnamed & np.array([_is_of_these_tests(one) for one in parameters])
    positive = open_ & np.array([_is_share(one) for one in parameters])
    own = list(terms(found.model.network))
    floor = np.where(open_, [_least(one, own) for one in parameters], -np.inf)
    optional = open_ & np.array([_is_optional(one) and one.action not in causes for one in parameters])
    of_bench = np.array([isinstance(one.action, actions.OnBench) for one in parameters])
    sd = np.sqrt(found.covariance_diagonal)
    least = np.maximum(WORTH_A_LINE * found.model.sd, np.where(of_bench, SURE * sd, 0.0))
    held = (mode <= found.model.low) | (mode >= found.model.high) | np.isin(np.arange(mode.size), list(named))
    left_out, beta = unsayable, _given(found, unsayable, held)
    for smallest in (np.zeros_like(least), least):
        while True:
            more = ~left_out & ((positive & (beta < smallest)) | (optional & (np.abs(beta) < smallest)))
            if not more.any():
                break
            left_out = left_out | more
            beta = _given(found, left_out, held)
    if not left_out.any() and not (mode < floor).any() and not _turning(found):
        return found
    pinned = [
        replace(one, low=beta[p], high=beta[p])
        if left_out[p] or p in named
        else replace(one, low=max(one.low, floor[p]))
        for p, one in enumerate(parameters)
    ]
    said = fit(found.model.with_priors(pinned), np.maximum(beta, np.where(left_out, -np.inf, floor)), NEAR_ENOUGH)
    while turning := _turning(said):
        pinned = [
            replace(one, low=turning[p], high=turning[p]) if p in turning else one for p, one in enumerate(pinned)
        ]
        model = found.model.with_priors(pinned)
        said = fit(model, np.clip(said.beta, model.low, model.high), NEAR_ENOUGH)
    return said


def _turning(found: Fit) -> dict[int, float]:
    """Where a law would fall below 0 at a current that a motor may see: the place of its slope over current -> the
    least that a file can say, and the place of what it is without current -> that number."""
    at = {
        replace(one.action, current=False): (p, float(found.beta[p]))
        for p, one in enumerate(found.model.parameters)
        if isinstance(one.action, actions.Tent) and not one.action.current
    }
    turning: dict[int, float] = {}
    for p, one in enumerate(found.model.parameters):
        if isinstance(one.action, actions.Tent) and one.action.current:
            beside, factor = at.get(replace(one.action, current=False), (p, 0.0))
            least = Shape.least_slope(factor)
            if found.beta[p] < least:
                turning |= {beside: factor, p: least}
    return turning


def _given(found: Fit, left_out: Bools, held: Bools) -> Floats:
    """The mode given that the entries `left_out` are 0 and those `held` stay where they are."""
    if not left_out.any():
        return found.beta
    model, mode, h = found.model, found.beta, found.hessian
    free = ~left_out & ~held
    beta = np.where(left_out, 0.0, mode)
    beta[free] += np.linalg.solve(h[np.ix_(free, free)], h[np.ix_(free, left_out)] @ mode[left_out])
    return np.clip(beta, model.low, model.high)


def _is_common_drive(one: Parameter, driving: Collection[str]) -> bool:
    return isinstance(one.action, actions.Late) and not set(one.action.channels).isdisjoint(driving)


def _is_of_these_tests(one: Parameter) -> bool:
    """Whether it is an error of a reading, or of anything on the bench in one test."""
    return isinstance(one.action, Misreading) or (one.test is not None and isinstance(one.action, actions.OnBench))


def _is_no_map(one: Parameter) -> bool:
    """Whether it is a heat over speed and load that no motor file says."""
    return isinstance(one.action, actions.HeatMap) and not one.action.sayable


def _is_share(one: Parameter) -> bool:
    """Whether it is a path, or a node's share in what a sensor follows: no file has such a number below 0."""
    match one.action:
        case actions.Added(places):
            return places[0].b != NOBODY
        case actions.Beside():
            return True
    return False


def _least(one: Parameter, own: Sequence[Term]) -> float:
    """The least that files can say of a number: 0 of a share, and of an exponent's change what takes it to 0."""
    match one.action:
        case actions.Power(members, feature):
            return -min(own[i].exponents.get(feature, 0.0) for i in members)
    return 0.0 if _is_share(one) else -np.inf


def _is_optional(one: Parameter) -> bool:
    """Whether it is a term or table of its own in a file, which may be left out."""
    return isinstance(one.action, actions.Added | actions.Tilt | actions.OnReading)


# --- What a bench file says of it -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SensorChanges:
    """What a bench file says of the sensors. `weights`: channel -> node -> share of what it follows, sum 1, of channels
    that follow other nodes than the file says; `errors`: those that all tests have in common, in the action's unit."""

    weights: Mapping[str, Mapping[str, float]]
    errors: Mapping[actions.OnBench, float]


def readings(found: Fit, said: Fit, named: Collection[int]) -> SensorChanges:
    """What a fit, `said` as files can say it, says of sensors, clocks, inputs and boundaries. `named`: places in the
    vector of causes; the caller writes them, together with the healthy differences of the same action, so these are
    left out."""
    parameters = list(enumerate(said.model.parameters))
    taken = {one.action for p, one in parameters if p in named and one.test is None}
    meters = {meter.name for test in said.model.tests for meter in test.meters}
    ours = [
        (p, one)
        for p, one in parameters
        if p not in named and one.action not in taken and getattr(one.action, "channel", None) not in meters
    ]
    errors: dict[actions.OnBench, float] = {
        one.action: float(said.beta[p])
        for p, one in ours
        if one.test is None and isinstance(one.action, Gain | Lag | actions.Late) and said.beta[p]
    }
    return SensorChanges(_weights(said), errors | _common(found, said, [p for p, _ in ours]))


def _common(found: Fit, said: Fit, ours: Sequence[int]) -> dict[actions.OnBench, float]:
    """Errors that the tests agree on well enough to be one error of the bench, and that the whole fit knows: an offset
    that only takes over what a gain did is not known. The mean over the tests. `ours`: places in the vector."""
    if is_wrong_in_form(found.model):
        return {}
    kinds = (actions.BoundaryBias, actions.InputGain, Bias)
    by_action: dict[actions.OnBench, list[int]] = {}
    for p in ours:
        one = found.model.parameters[p]
        if one.test is not None and isinstance(one.action, kinds):
            by_action.setdefault(one.action, []).append(p)
    covariance = np.linalg.inv(found.hessian)
    common = {}
    for action, places in by_action.items():
        each = found.beta[places]
        if each.size >= COMMON_FROM:
            mean, error = float(each.mean()), float(each.std(ddof=1)) / each.size**0.5
            sd = float(np.sqrt(covariance[np.ix_(places, places)].mean()))
            if abs(mean) > max(SURE * error, SURE * sd, WORTH_A_CORRECTION * found.model.sd[places[0]]):
                common[action] = float(said.beta[places].mean())
    return common


def _weights(found: Fit) -> dict[str, dict[str, float]]:
    """Channel -> node -> share of what it follows, with four digits; the largest takes what rounding leaves."""
    names = found.model.network.names
    result = {}
    for name, channel in {c.name: c for test in found.model.tests for c in test.channels}.items():
        beside: dict[str, float] = {}
        for one, value in zip(found.model.parameters, found.beta.tolist(), strict=True):
            if isinstance(one.action, actions.Beside) and one.action.channel == name and value:
                beside[names[one.action.node]] = value
        if beside:
            part = min(1.0, MOST_BESIDE / sum(beside.values()))
            own = 1.0 - part * sum(beside.values())
            shares = {node: own * share for node, share in channel.sensor.weights.items()}
            for node, share in beside.items():
                shares[node] = shares.get(node, 0.0) + part * share
            rounded = {node: round(share, 4) for node, share in shares.items() if round(share, 4) > 0}
            largest = max(rounded, key=lambda node: rounded[node])
            rounded[largest] = round(1.0 - sum(v for node, v in rounded.items() if node != largest), 4)
            result[name] = rounded
    return result
