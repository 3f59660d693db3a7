"""Healthy differences in plain words: each of them, its family, how large it is, where it is held, and what would make
it sharper."""

from __future__ import annotations

import math
from collections.abc import Mapping

from twin.diagnosis.pooling import family, kinds, regions
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.motor import sensor_laws
from twin.motor.causes import place_words, product_words
from twin.motor.features import placed_terms, product
from twin.motor.network import NOBODY, Network

KINDS_OF_GROUP = {  # kind of a healthy difference that is in no family -> what all of its kind are called
    "loss": "heat at standstill",
    "sensor": "places of readings",
    "clock": "clocks",
    "input": "readings of inputs",
    "boundary": "readings of boundaries",
    "heat": "the heat without a name",
}
MEASURED_LOSS = "a measured loss (power balance)"
LOSSES = ("a no-load speed ladder", "another current at one speed", MEASURED_LOSS)
COPPER = ("direct current at standstill with the resistance measured", MEASURED_LOSS)
PATHS = ("sensors at both ends", "a step of the coolant's flow or temperature")
LAGS = ("a step of load",)
SHARPER: Mapping[str, tuple[str, ...]] = {  # kind -> the tests that would tell more of it, each alone
    "capacity": LAGS,
    "conductance": PATHS,
    "sensor": ("a session at standstill at ambient temperature", "a second sensor there"),
    "meter": ("a second meter",),
    "clock": ("a step that every logger records",),
    "input": ("a second reading of it",),
    "boundary": ("a second sensor of it",),
    "start": ("a longer rest before the test",),
}


class Plain:
    """What is said of the healthy differences of a network."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._placed = list(placed_terms(network))
        self._kinds, self._regions = kinds(network), regions(network)

    def kind_and_place(self, parameter: Parameter) -> tuple[str, str]:
        """What it is of, as cause ids write it; the place of a sensor or meter is its channel."""
        kind, _, rest = parameter.name.partition(".")
        named = rest.rpartition(".")[0] or rest
        term = self._term(parameter)
        match parameter.action:
            case sensor_laws.SensorLaw(channel) | actions.Beside(channel):
                return kind, channel
            case actions.Scale((only,)):
                named = self._placed[only][0]
        return (kind if term is None else "loss" if self._kinds[term] == "losses" else "conductance"), named

    def _term(self, parameter: Parameter) -> int | None:
        """The first of the network's terms that it changes; None where it changes none."""
        match parameter.action:
            case actions.Scale(terms) | actions.Power(terms) | actions.Tent(terms):
                return terms[0]
            case actions.Tilt(_, terms):
                return terms[0][0]
        return None

    def says(self, parameter: Parameter) -> str:
        """ "the heat path between winding and teeth", "how the loss in yoke follows current near 12,000 rpm"."""
        place = self.kind_and_place(parameter)[1]
        match parameter.action:
            case actions.Scale(terms):
                sides = " on both sides" if len(terms) > 1 else ""
                return f"{self._subject(parameter)}{self._which(terms[0])}{sides}"
            case actions.Power(_, feature):
                return f"the exponent of {product_words({feature: 1.0})} in {self._subject(parameter)}"
            case actions.Tent(_, speeds, knot, current):
                rpm = speeds[knot] * self._network.scale["speed"]
                near = f"near {rpm:,.0f} rpm" if rpm else "at low speed"
                follows = f"how {self._subject(parameter)} follows current"
                return f"{follows if current else self._subject(parameter)} {near}"
            case actions.Tilt():
                return f"how {self._subject(parameter)} changes with temperature"
            case actions.Added(places):
                heat = f"heat by the current's ripple in {place_words(place)}"
                path = f"a heat path between {place_words(place)} that the file does not have"
                return heat if places[0].b == NOBODY else path
            case actions.Capacity():
                return f"the heat capacity of {place_words(place)}"
            case actions.Start():
                return f"the temperature of {place_words(place)} at the start"
            case sensor_laws.SensorLaw():
                return f"the {'offset' if parameter.action.law == 'bias' else parameter.action.law} of {place}"
            case actions.Beside(_, node):
                return f"the share of {place_words(self._network.names[node])} in what {place} reads"
            case actions.Late(drifts=drifts):
                return f"the {'drift' if drifts else 'offset'} of the clock of {place}"
        return f"the reading of {place_words(place)}"

    def _subject(self, parameter: Parameter) -> str:
        kind, place = self.kind_and_place(parameter)
        return f"{'the loss in' if kind == 'loss' else 'the heat path between'} {place_words(place)}"

    def _which(self, term: int) -> str:
        """Which part of its place a term is, where there are several."""
        place, law = self._placed[term]
        if sum(place == other for other, _ in self._placed) == 1:
            return ""
        follows = product_words(product(law).exponents)
        return f" (the part with {follows})" if follows else " (the constant part)"

    def group(self, parameter: Parameter) -> str:
        """What it and those of its kind are called together: its family where it has one."""
        own = family(parameter, self._kinds, self._regions)
        return own.name if own else KINDS_OF_GROUP[self.kind_and_place(parameter)[0]]

    def amount(self, parameter: Parameter, number: float) -> tuple[float, str]:
        """A number of it as people count it, and its unit: "1" for a share of what the file says, "" for an exponent,
        "sd" for the offset of a meter, whose unit is its own."""
        match parameter.action:
            case actions.Scale() | actions.Capacity() | actions.InputGain():
                return math.expm1(number), "1"
            case actions.Tent() | actions.Beside():
                return number, "1"
            case actions.Tilt():
                return number, "1/K"
            case actions.Added(places, _, rms):
                return (number, "W") if places[0].b == NOBODY else (number / rms, "W/K")
            case actions.Start() | actions.BoundaryBias():
                return number, "K"
            case sensor_laws.Bias() if parameter.name.startswith("meter."):
                return number / parameter.sd, "sd"
            case sensor_laws.SensorLaw() | actions.Late():
                return number, parameter.action.unit
        return number, ""

    def bound(self, parameter: Parameter) -> str:
        """What its bound is."""
        match parameter.action:
            case actions.Scale() | actions.Capacity():
                return f"a factor of {math.exp(parameter.high):.2g}"
            case actions.Tent():
                return "where next to nothing of the loss is left"
            case actions.Added():
                return "as far below nothing as calibration lets a path go"
            case sensor_laws.Lag():
                return "as no sensor is ahead of what it follows"
        return "as far as calibration lets it go"

    def sharper(self, *parameters: Parameter) -> str:
        """The tests that would tell more of them, any of which would do, each said once."""
        *others, last = dict.fromkeys(test for one in parameters for test in self._sharper(one))
        return ", ".join([*others, f"or {last}"]) if others else last

    def _sharper(self, parameter: Parameter) -> tuple[str, ...]:
        kind, term = self.kind_and_place(parameter)[0], self._term(parameter)
        if isinstance(parameter.action, sensor_laws.Lag):
            return LAGS
        if kind != "loss":
            return SHARPER[kind]
        return COPPER if term is not None and self._regions[term] == "copper" else LOSSES
