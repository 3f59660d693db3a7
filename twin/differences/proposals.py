"""Candidates as parameters of a model: the action that each is, and its prior size on these tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.differences.candidates import Candidate
from twin.differences.columns import (
    AddedTerms,
    AttachedMass,
    CapacityFactor,
    ClockError,
    EntryFactor,
    InputError,
    Reading,
)
from twin.differences.everyday import mean_conductances, mean_loss_W, terms_of
from twin.differences.sizes import Scales
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.model import Model, Test
from twin.motor import features, sensor_laws
from twin.motor.network import NOBODY, Network
from twin.motor.paths import Place as Names

Floats = NDArray[np.float64]


class Proposals:
    """Turns candidates into parameters of `model`; scales are those of its tests about a vector."""

    def __init__(self, model: Model, beta: Floats) -> None:
        self.model, self.network, self.tests = model, model.network, model.tests
        self.links, self.sources = terms_of(self.network)
        self.names = self.network.names
        self.scales = scales(self.network, self.tests)
        runs = [model.course(s, beta) for s in range(len(self.tests))]
        self._means = np.concatenate([means for _, means, _ in runs])
        self._values = np.concatenate([values for _, _, values in runs])
        self._boundaries = np.concatenate([t.frame.boundaries for t in self.tests])

    def parameter(self, candidate: Candidate) -> Parameter:
        """The candidate at amplitude 0, with the sd of its prior; held to its sign where it has one, and where it adds to a law,
        to what leaves that law above 0 in the mean."""
        action, per = self._action(candidate)
        sd = candidate.sigma.value(self.scales) * per
        low = 0.0 if candidate.sign > 0 else -np.inf
        high = 0.0 if candidate.sign < 0 else np.inf
        match action, candidate.column:
            case sensor_laws.Lag(), _:
                low = 0.0
            case actions.Added(_, feature, rms), AddedTerms(terms) if low < 0.0:
                low = -min(self._mean_of(place) for place, _ in terms) * rms / self.mean(feature)
        return Parameter(str(candidate.cause), action, sd, low=low, high=high)

    def _action(self, candidate: Candidate) -> tuple[actions.Action, float]:
        """The action, and what a unit of the candidate's amplitude is of its number."""
        match candidate.column:
            case AddedTerms(terms):
                places = tuple(self.place(place) for place, _ in terms)
                term = terms[0][1]
                feature = features.product(term).name
                return actions.Added(places, feature, self.rms(feature), 1 if term.copper else term.resistance), 1.0
            case EntryFactor(places, "one"):
                return actions.Scale(tuple(i for place in places for i in self.terms(place))), 1.0
            case EntryFactor(places, "temperature"):
                return self._tilt(places)
            case EntryFactor(places, by):
                return actions.Course(tuple(i for place in places for i in self.terms(place)), by), 1.0
            case AttachedMass(nodes, lag_s):
                return actions.Attached(tuple(map(self.names.index, nodes)), lag_s), 1.0
            case CapacityFactor(nodes):
                return actions.Capacity(tuple(map(self.names.index, nodes))), 1.0
            case Reading(channel, law):
                return self._reading(channel, law), 1.0
            case ClockError(bus, law):
                return self._clock(bus, law), 1.0
            case InputError(name, law):
                return self._input(name, law), 1.0

    def place(self, names: Names) -> actions.Place:
        """Indices of a node or of a link's ends, boundaries last."""
        found = sorted(self.names.index(name) for name in names)
        return actions.Place(found[0], found[1] if len(found) > 1 else NOBODY)

    def terms(self, names: Names) -> tuple[int, ...]:
        """The terms of a source or link, whichever way round it is written."""
        if len(names) == 1:
            return self.sources.get(names[0], ())
        return self.links.get((names[0], names[1])) or self.links.get((names[1], names[0]), ())

    def rms(self, feature: str) -> float:
        """Root mean square of a product of features over the tests."""
        if feature == "constant":
            return 1.0
        return max(1e-12, float(np.sqrt(np.mean(np.concatenate([t.features[feature] for t in self.tests]) ** 2))))

    def mean(self, feature: str) -> float:
        """Mean of a product of features over the tests."""
        if feature == "constant":
            return 1.0
        return max(1e-12, float(np.mean(np.concatenate([t.features[feature] for t in self.tests]))))

    def _mean_of(self, names: Names) -> float:
        """Mean of a source [W] or link [W/K] over the tests about the vector."""
        return float(self._values[:, list(self.terms(names))].sum(axis=1).mean())

    def _tilt(self, places: Sequence[Names]) -> tuple[actions.Action, float]:
        found, references, sizes = [], [], []
        terms = tuple(self.terms(place) for place in places)
        for names, own in zip(places, terms, strict=True):
            place = self.place(names)
            at = (
                self._temperature(place.a)
                if place.b == NOBODY
                else (self._temperature(place.a) + self._temperature(place.b)) / 2
            )
            references.append(float(at.mean()))
            sizes.append(float(np.sqrt(np.mean((self._values[:, list(own)].sum(axis=1) * (at - at.mean())) ** 2))))
            found.append(place)
        return actions.Tilt(tuple(found), terms, tuple(references)), 1.0 / max(float(np.mean(sizes)), 1e-12)

    def _temperature(self, i: int) -> Floats:
        n = len(self.network.nodes)
        return self._means[:, i] if i < n else self._boundaries[:, i - n]

    def _reading(self, channel: str, law: str) -> actions.Action:
        return next(one for one in sensor_laws.SENSOR_LAWS if one.law == law)(channel)

    def _clock(self, bus: str, law: str) -> actions.Action:
        channels = {c.name: c.bus for t in self.tests for c in t.channels}
        own = tuple(name for name, of in channels.items() if of == bus)
        if own:
            return actions.Late(own, law == "drift")
        return actions.Late(tuple(channels), law == "drift", -1.0)

    def _input(self, name: str, law: str) -> actions.Action:
        around = [b.name for b in self.network.boundaries]
        if name in around:
            return actions.BoundaryBias(around.index(name))
        if law == "gain":
            return actions.InputGain(name)
        return actions.InputBias(name, self.network.scale[str(features.quantity(name))])


def scales(network: Network, tests: Sequence[Test]) -> Scales:
    """Sizes of this motor on these tests."""
    mean = mean_conductances(network, tests)
    return Scales(mean_loss_W(network, tests), {f"{a}-{b}": g for (a, b), g in mean.items()})
