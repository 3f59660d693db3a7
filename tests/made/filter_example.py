"""The motor, unknowns and readings that `twin.filters.plan` shows its rows of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.filters.inputs import FilterStart, HeatReading, Inputs, Reading, inputs_of
from twin.filters.unknowns import Unknown, UnknownBias, UnknownFactor, UnknownHeat
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.motor.sensor import Sensor
from twin.run.simulate import Frame

STEPS = 2


def example() -> Inputs:
    """Two steps of the example: W is read at their ends, the second thermometer at a quarter, and all losses."""
    network = Network(
        "example",
        nodes=(Node("winding", 1000.0, "stator"), Node("stator", 4000.0, "stator"), Node("rotor", 2000.0, "rotor")),
        boundaries=(Boundary("coolant"),),
        links=(
            Link("winding", "stator", (Term(20.0, {"speed": 1.0}),)),
            Link("stator", "rotor", (Term(5.0),)),
            Link("stator", "coolant", (Term(30.0, {"flow": 1.0}),)),
        ),
        sources=(
            Source("winding", (Term(300.0, {"current": 2.0}, copper=True),)),
            Source("rotor", (Term(50.0, {"speed": 2.0}),)),
        ),
        scale={"speed": 1.0, "current": 1.0, "flow": 1.0},
    )
    every = np.ones(STEPS)
    w = Reading(Sensor("W", {"winding": 1.0}), 50.0 * every, every, 0.01 * every)
    second = replace(w, sensor=Sensor("second", {"stator": 0.5, "rotor": 0.5}, time_constant_s=5.0), place=0.25 * every)
    losses = HeatReading("losses", 300.0 * every, 100.0 * every)
    factor = UnknownFactor("conductance.winding-stator.scale", 0.1, 1e-4)
    unknowns: list[Unknown] = [UnknownHeat("rotor", 50.0, 3.0), factor, UnknownBias("W", 1.0)]
    frame = Frame(1.0, np.ones((STEPS, 4)), np.full((STEPS, 1), 40.0))
    return inputs_of(network, frame, FilterStart(np.full(3, 45.0), np.ones(3)), unknowns, [w, second, losses])
