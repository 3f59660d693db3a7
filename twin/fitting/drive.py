"""What drives one test: the terms of the network and products of features, as a vector of parameters changes them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.hats import hat, surface
from twin.fitting import actions
from twin.fitting.recorded import Test
from twin.fitting.rows import Product, Products, delayed
from twin.motor import features
from twin.motor.network import NOBODY, Network

Floats = NDArray[np.float64]

LEAST_INPUT = 0.02  # of its scale: where an input is smaller, a bias of it moves nothing
LEAST_TENT = 0.05
PROBE_S = 0.25  # of time, for the slope of a reading by its stamps: past the kinks at whole steps


class RowsByName:
    """Rows (R, N) that are asked for by a name, each made once; row 0 is 1."""

    def __init__(self, length: int) -> None:
        self._places: dict[Hashable, int] = {}
        self.values = np.ones((1, length))

    def added(self, name: Hashable, row: Callable[[], Floats]) -> int:
        """The place of a row, made where it is not there yet."""
        if name not in self._places:
            self._places[name] = len(self.values)
            self.values = np.vstack([self.values, row()])
        return self._places[name]


class Drive:
    """The drive of a test under the parameters that are active in it."""

    def __init__(self, network: Network, test: Test, active: Sequence[tuple[int, actions.Action]]) -> None:
        self.test, self.step_s = test, test.frame.step_s
        terms = [*features.terms(network), *features.streams(network)]  # what fluid carries is driven like any term
        self.exponents = [features.monomial(term).exponents for term in terms]
        own = {m.name: test.frame.features[:, j] for j, m in enumerate(features.monomials(network))}
        ones = np.ones(len(test.frame.features))
        self.base = np.array([term.coefficient * own.get(features.monomial(term).name, ones) for term in terms])
        self.shapes, self.features, self.one = RowsByName(ones.size), RowsByName(ones.size), ones[None]
        self._effects: dict[actions.OnTerms, list[tuple[int, int, float]]] = {}
        self._late = [(p, one.sign) for p, one in active if isinstance(one, actions.Late) and test.is_common(one)]
        logs: list[Product] = []
        tents: list[Product] = []
        for p, action in active:
            if isinstance(action, actions.OnTerms):
                into = tents if isinstance(action, actions.Tent) else logs
                into += [Product(term, factor, shape, parameter=p) for term, shape, factor in self.effect(action)]
        self._logs, self._tents = Products.of(logs), Products.of(tents)

    def effect(self, action: actions.OnTerms) -> list[tuple[int, int, float]]:
        """(term, row of `shapes`, factor): the change of ln term (in a tent of the term) per p is factor times row."""
        if action not in self._effects:
            self._effects[action] = self._effect(action)
        return self._effects[action]

    def _effect(self, action: actions.OnTerms) -> list[tuple[int, int, float]]:
        match action:
            case actions.Scale(terms):
                return [(i, 0, 1.0) for i in terms]
            case actions.Course(terms, by):
                return [(i, 0, self.test.course.get(by, 0.0)) for i in terms]
            case actions.InputGain(name):
                return [(i, 0, -e[name]) for i, e in enumerate(self.exponents) if name in e]
            case actions.Power(terms, _):
                return [(i, self._shape(action), 1.0) for i in terms]
            case actions.Tent(terms):
                return [(i, self._shape(action), 1.0) for i in terms]
            case actions.InputBias(name, _):
                return [(i, self._shape(action), -e[name]) for i, e in enumerate(self.exponents) if name in e]
            case _:
                assert_never(action)

    def _shape(self, action: actions.Power | actions.Tent | actions.InputBias) -> int:
        """The row of `shapes` that an action multiplies with; the same for all terms."""
        match action:
            case actions.Power(_, feature):
                return self.shapes.added(("ln", feature), lambda: self._logarithm(feature))
            case actions.Tent(_, speeds, knot, current):
                return self.shapes.added(("tent", speeds, knot, current), lambda: self._tent(speeds, knot, current))
            case actions.InputBias(feature, scale):
                return self.shapes.added(("bias", feature, scale), lambda: self._share_of_bias(feature, scale))
            case _:
                assert_never(action)

    def _logarithm(self, feature: str) -> Floats:
        return np.log(np.maximum(self.test.inputs[feature], LEAST_INPUT))

    def _tent(self, speeds: tuple[float, ...], knot: int, current: bool) -> Floats:
        tent = hat(self.test.inputs["speed"], speeds, knot)
        return tent * self.test.inputs["current"] if current else tent

    def _share_of_bias(self, feature: str, scale: float) -> Floats:
        """The share of an input that a bias of 1 stored unit is; 0 where the input is too small to be told from 0."""
        u = self.test.inputs[feature]
        return np.where(u > LEAST_INPUT, 1 / (scale * np.maximum(u, LEAST_INPUT)), 0.0)

    def feature(self, name: str, rms: float) -> tuple[int, float]:
        """The row of `features` with a product of features, and 1 / rms;
        0 for what is nowhere in the tests that gave its rms."""
        factor = 1 / rms if rms else 0.0
        if name == "constant":
            return 0, factor
        return self.features.added(name, lambda: self.test.features[name]), factor

    def free_heat(self, part: actions.PartOfHeat) -> int:
        """The row of `features` that a part of a free heat follows: what 1 W of it is over time."""
        return self.features.added(replace(part, node=NOBODY), lambda: self._tent_of(part)[None])

    def _tent_of(self, part: actions.PartOfHeat) -> Floats:
        match part:
            case actions.HeatTent(_, time_s, spacing_s):
                middle = self.step_s * (np.arange(len(self.test.frame.features)) + 0.5)
                tent: Floats = np.maximum(0.0, 1 - np.abs(middle - time_s) / spacing_s)
                return tent
            case actions.HeatMap(_, speeds, loads, _, heights):
                if not ("speed" in self.test.inputs and self.test.load.size):
                    return np.zeros(len(self.test.frame.features))  # nobody knows where on it the test is
                table = np.reshape(heights, (len(speeds), len(loads)))
                return surface(self.test.inputs["speed"], self.test.load, speeds, loads, table)
            case _:
                assert_never(part)

    def terms(self, beta: Floats) -> tuple[Floats, Floats]:
        """Every term (T, N) [W or W/K], and the factor of its tents (T, N), before any delay."""
        log, tents, shapes = np.zeros_like(self.base), np.ones_like(self.base), self.shapes.values
        self._logs.add(log, shapes, self.one, beta)
        self._tents.add(tents, shapes, self.one, beta)
        np.maximum(tents, LEAST_TENT, out=tents)
        np.exp(log, out=log)
        log *= self.base
        log *= tents
        return log, tents

    def late_s(self, beta: Floats) -> float:
        """How late the stamps of all channels are together at a vector [s]."""
        return sum(sign * float(beta[p]) for p, sign in self._late)

    def delayed(self, x: Floats, late_s: float) -> Floats:
        """Step means (R, N) of what happened `late_s` before."""
        return delayed(x, late_s / self.step_s)

    def delayed_slope(self, x: Floats, late_s: float) -> Floats:
        """d `delayed` / d late_s, at whole steps the mean of both sides."""
        slope: Floats = (self.delayed(x, late_s + PROBE_S) - self.delayed(x, late_s - PROBE_S)) / (2 * PROBE_S)
        return slope
