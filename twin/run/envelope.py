"""How much load a motor bears at a speed, for ever or for some seconds, until a node is at its limit; and how sure
that is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from twin.compiled.kernel import Compiled
from twin.errors import DivergedError
from twin.motor.features import terms
from twin.run.gradients import gradient
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

STEP_S = 0.5
STEADY_S, STEADY_STEPS = 1e7, 12  # an L-stable step that long is a Newton step towards the steady state
SETTLED_K, MELTED_DEGC = 1e-3, 1e3
LOG_STEP = 1e-3  # of a parameter's logarithm, for derivatives
TOLERANCE = 1e-3  # of the most load
SLOPE_STEP, LEAST_SLOPE = 0.2, 1e-6  # of the load; K a unit of it

Drive = Callable[[float], Floats]  # load -> features (m,)


@dataclass(frozen=True)
class Border:
    """What a motor bears at a speed. `load` in the unit of the drive; `low` and `high` of a 95 % band by what is not
    known of its coefficients; `node` that is at its limit there, None where the largest recorded load is borne;
    `headroom_K` to the nearest limit at `load`, 0 where a node is at it."""

    load: float
    low: float
    high: float
    node: str | None
    headroom_K: float


@dataclass(frozen=True)
class Motor:
    """A compiled network with `limits` (n,) [degC], NaN without one, its boundaries (b,) [degC], and `covariance` (P,
    P) of ln coefficients and ln capacities, in this order."""

    compiled: Compiled
    limits: Floats
    boundaries: Floats
    covariance: Floats


def temperatures(motor: Motor, features: Floats, start: Floats, seconds: float) -> Floats:
    """Temperature of every node (n,) [degC] after some seconds of constant features (m,), or in the steady state
    after infinitely many; infinite where it runs away."""
    steady = math.isinf(seconds)
    try:
        course = simulate(motor.compiled, _frame(motor, features, seconds), start)
    except DivergedError:
        return np.full(len(start), np.inf)
    end = course[-1]
    settled = not steady or float(np.abs(end - course[-2]).max()) < SETTLED_K
    ran_away = not settled or end.max() > MELTED_DEGC or end.min() < motor.boundaries.min() - 1.0
    return np.full(len(start), np.inf) if ran_away else end


def _frame(motor: Motor, features: Floats, seconds: float) -> Frame:
    steps, step_s = (STEADY_STEPS, STEADY_S) if math.isinf(seconds) else (max(1, round(seconds / STEP_S)), STEP_S)
    return Frame(step_s, np.tile(features, (steps, 1)), np.tile(motor.boundaries, (steps, 1)))


def border(motor: Motor, drive: Drive, start: Floats, seconds: float, most: float) -> Border:
    """What the motor bears: the load up to `most` at which the first node reaches its limit, from `start` (n,) [degC]
    on for some seconds."""

    def over(load: float) -> Floats:
        """(n,) [K] over each limit."""
        return temperatures(motor, drive(load), start, seconds) - motor.limits

    def worst(load: float) -> float:
        return min(float(np.nanmax(over(load))), MELTED_DEGC)

    headroom = -worst(most)
    if headroom >= 0:
        at, node, load = over(most), None, most
    elif worst(0.0) >= 0:
        return Border(0.0, 0.0, 0.0, _name(motor, over(0.0)), 0.0)
    else:
        load = float(brentq(worst, 0.0, most, xtol=TOLERANCE * most))
        at = over(load)
        node, headroom = _name(motor, at), 0.0
    place = int(np.nanargmax(at))
    spread = 1.96 * _sd_K(motor, drive, start, seconds, load, place) / _slope(worst, load)
    if node is None:  # it bears more than was recorded, unless what is not known eats the headroom up
        low = max(0.0, most - max(0.0, spread - headroom / _slope(worst, load)))
        return Border(most, min(low, most), most, None, headroom)
    return Border(load, max(0.0, load - spread), min(most, load + spread), node, 0.0)


def _name(motor: Motor, over: Floats) -> str:
    return motor.compiled.network.nodes[int(np.nanargmax(over))].name


def _slope(worst: Callable[[float], float], load: float) -> float:
    """How much hotter the worst node becomes for each unit of load, as by a heat that grows with the load's square;
    from below, as above the motor may run away."""
    less = (1 - SLOPE_STEP) * load
    return max(2 * load * (worst(load) - worst(less)) / (load**2 - less**2), LEAST_SLOPE)


def _sd_K(motor: Motor, drive: Drive, start: Floats, seconds: float, load: float, node: int) -> float:
    """Standard deviation [K] of a node's temperature that comes from the parameters."""
    features = drive(load)
    values = motor.compiled.parameters
    size = sum(1 for _ in terms(motor.compiled.network))  # streams of fluids are behind them, and known
    if motor.compiled.gradient is not None:
        frame = _frame(motor, features, seconds)
        course = simulate(motor.compiled, frame, start)
        at_the_end = np.zeros_like(course)
        at_the_end[-1, node] = 1.0
        by = gradient(motor.compiled, frame, course, at_the_end)
        own = by.coefficients[:size] * values.coefficients[:size], by.capacities * values.capacities
        slopes = np.concatenate(own)
        return float(np.sqrt(slopes @ motor.covariance @ slopes))
    slopes = np.zeros(len(motor.covariance))
    for p in range(len(slopes)):  # a large network has no gradient
        ends = []
        for sign in (1, -1):
            factor = math.exp(sign * LOG_STEP)
            coefficients, capacities = values.coefficients.copy(), values.capacities.copy()
            if p < size:
                coefficients[p] *= factor
            else:
                capacities[p - size] *= factor
            changed = replace(values, coefficients=coefficients, capacities=capacities)
            other = replace(motor, compiled=replace(motor.compiled, parameters=changed))
            ends.append(float(temperatures(other, features, start, seconds)[node]))
        slopes[p] = (ends[0] - ends[1]) / (2 * LOG_STEP) if np.isfinite(ends).all() else 0.0
    return float(np.sqrt(slopes @ motor.covariance @ slopes))
