"""Candidates as parameters of a model: what their actions leave open, and their prior sizes, on these tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.differences.candidates import Candidate
from twin.differences.everyday import mean_conductances, mean_loss_W
from twin.differences.sizes import Scales
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.model import Floats, Model, Test
from twin.motor.network import NOBODY, Network
from twin.motor.paths import Place, terms_at
from twin.motor.sensor_laws import Exchange


class Proposals:
    """Turns candidates into parameters of `model`, sized by what its tests do about the vector `beta`."""

    def __init__(self, model: Model, beta: Floats) -> None:
        self.model, self.network, self.tests = model, model.network, model.tests
        self.scales = scales(self.network, self.tests)
        self._temperatures, self._values = courses(model, beta)

    def parameter(self, candidate: Candidate) -> Parameter:
        """The candidate as a parameter that is 0, with the sd of its prior. It is held to its sign where it has one; a
        heat or path of either sign takes away at most the mean of what is there."""
        assert not isinstance(candidate.action, Exchange), "channels are exchanged or not: no number says it"
        action, per = self._on_tests(candidate.action)
        sd = candidate.sigma.value(self.scales) * per
        low = 0.0 if candidate.sign > 0 else -np.inf
        high = 0.0 if candidate.sign < 0 else np.inf
        if isinstance(action, actions.Added) and low < 0.0:
            low = -min(map(self._mean_of, candidate.places)) * action.rms / self.mean(action.feature)
        return Parameter(str(candidate.cause), action, sd, candidate.test, low, high)

    def _on_tests(self, action: actions.Action) -> tuple[actions.Action, float]:
        """The action with what it needs to know of the tests, and the parameter for a unit of the amplitude."""
        match action:
            case actions.Added(_, feature):
                return replace(action, rms=self.rms(feature)), 1.0
            case actions.Tilt():
                return self._tilt(action)
            case actions.Late(channels) | actions.Slowed(channels):
                there = dict.fromkeys(c.name for t in self.tests for c in t.channels)
                return replace(action, channels=tuple(name for name in there if name in channels)), 1.0
        return action, 1.0

    def rms(self, feature: str) -> float:
        """Root mean square of a product of features over the tests."""
        return max(1e-12, float(np.sqrt(np.mean(self._product(feature) ** 2))))

    def mean(self, feature: str) -> float:
        """Mean of a product of features over the tests."""
        return max(1e-12, float(np.mean(self._product(feature))))

    def _product(self, feature: str) -> Floats:
        if feature == "constant":
            return np.ones(1)
        return np.concatenate([t.features[feature] for t in self.tests])

    def _mean_of(self, names: Place) -> float:
        """Mean of a source [W] or link [W/K] over the tests about the vector."""
        return float(self._values[:, list(terms_at(self.network, names))].sum(axis=1).mean())

    def _tilt(self, tilt: actions.Tilt) -> tuple[actions.Action, float]:
        """A change with temperature about the mean temperature of its places; its amplitude is the root mean square of
        what it adds [W or W/K], its parameter the change per kelvin."""
        references, sizes = [], []
        for place, own in zip(tilt.places, tilt.terms, strict=True):
            at = between(self._temperatures, place)
            references.append(float(at.mean()))
            sizes.append(float(np.sqrt(np.mean((self._values[:, list(own)].sum(axis=1) * (at - at.mean())) ** 2))))
        return replace(tilt, references=tuple(references)), 1.0 / max(float(np.mean(sizes)), 1e-12)


def at_one(parameter: Parameter) -> float:
    """What a parameter is for a unit of its amplitude at features of 1: a heat or path that is added counts at its root
    mean square over the tests, which no other tests share."""
    return parameter.action.rms if isinstance(parameter.action, actions.Added) else 1.0


def courses(model: Model, beta: Floats) -> tuple[Floats, Floats]:
    """Over the steps of all tests: the temperature of every node and boundary (N, n + b) [degC], and what every term
    carries (N, terms) [W or W/K]."""
    runs = [model.course(s, beta) for s in range(len(model.tests))]
    outside = np.concatenate([test.frame.boundaries for test in model.tests])
    means, values = (np.concatenate([run[i] for run in runs]) for i in (1, 2))
    return np.hstack([means, outside]), values


def between(t: Floats, place: actions.Place) -> Floats:
    """Temperature (N,) of a node, or the mean of a link's ends, from those of all nodes and boundaries (N, n + b)."""
    return t[:, place.a] if place.b == NOBODY else (t[:, place.a] + t[:, place.b]) / 2


def scales(network: Network, tests: Sequence[Test]) -> Scales:
    """Sizes of this motor on these tests."""
    mean = mean_conductances(network, tests)
    return Scales(mean_loss_W(network, tests), {f"{a}-{b}": g for (a, b), g in mean.items()})
