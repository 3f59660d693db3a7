"""A free loss map at a node: a heat that depends on speed and load in any way, where no law does that a motor file has.

Braking heats another part than driving does, a part resonates at one speed: the features that laws are made of are
magnitudes, and powers of them, so none can say so. A heat that is free in time cannot follow either: within a tent of
300 s a vehicle brakes ten times. A map has one height a knot of speed and load (the torque, negative while it brakes),
as alike as knots are near, in all sessions alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky

from twin.arithmetic.hats import hats, surface
from twin.fitting.actions import HeatMap
from twin.fitting.model import Floats, Test

SPEEDS, LOADS = 9, 5  # knots, to the highest speed and load, from 0 or from braking as hard as the motor ever drives
BRAKES = 0.1  # of the highest load: a motor that brakes less does not
ALIKE = 2.0  # knots over which heights are alike: a quarter of all speeds, half of all loads
MOST = 0.5  # of how a heat varies: what explains as much is what it goes with


@dataclass(frozen=True)
class Knots:
    """Where the heights of a map stand: `speeds` and `loads`, dimensionless, each rising; `load`: of which feature, the
    torque or the current. Heights are counted load by load within speed: of 9 and 5 the second has the lowest speed and
    the second lowest load."""

    speeds: tuple[float, ...]
    loads: tuple[float, ...]
    load: str

    @classmethod
    def of(cls, tests: Sequence[Test]) -> Knots | None:
        """The knots that hold all steps of the tests; None where one of them has no speed or load, or another load than
        the rest, or none ever turns."""
        if not all("speed" in test.inputs and test.load.size for test in tests):
            return None
        if len({test.load_is_torque for test in tests}) > 1:
            return None
        fastest = max(float(test.inputs["speed"].max()) for test in tests)
        hardest = max(float(np.abs(test.load).max()) for test in tests)
        if not (fastest > 0.0 and hardest > 0.0):
            return None
        brakes = min(float(test.load.min()) for test in tests) < -BRAKES * hardest
        speeds, loads = np.linspace(0.0, fastest, SPEEDS), np.linspace(-hardest if brakes else 0.0, hardest, LOADS)
        return cls(tuple(speeds.tolist()), tuple(loads.tolist()), "torque" if tests[0].load_is_torque else "current")

    @property
    def sayable(self) -> bool:
        """Whether a motor file can say a map over them."""
        return HeatMap(0, self.speeds, self.loads, self.load, ()).sayable

    @property
    def correlation(self) -> Floats:
        """How alike two heights are, (q, q)."""
        at = np.indices((len(self.speeds), len(self.loads))).reshape(2, -1).T.astype(np.float64)
        found: Floats = np.exp(-np.abs(at[:, None] - at).sum(axis=-1) / ALIKE)
        return found

    @property
    def alike(self) -> Floats:
        """Maps (q, q), a column each, that heights which are as alike as `correlation` says are a sum of, each with an
        independent weight of the same size."""
        found: Floats = cholesky(self.correlation, lower=True)
        return found

    def parts(self, node: int, maps: Floats) -> list[HeatMap]:
        """What `maps` (q, k), a column each, do at a node."""
        return [HeatMap(node, self.speeds, self.loads, self.load, tuple(column)) for column in maps.T.tolist()]

    def course(self, watts: Floats, test: Test) -> Floats:
        """The heat (N,) [W] of a map (q,) [W] in the steps of a test."""
        table = watts.reshape(len(self.speeds), -1)
        return surface(test.inputs["speed"], test.load, self.speeds, self.loads, table)

    def seconds(self, tests: Sequence[Test]) -> Floats:
        """How long the motor was near each knot (s, l) [s]."""
        found: Floats = np.zeros((len(self.speeds), len(self.loads)))
        for test in tests:
            found += test.frame.step_s * hats(test.inputs["speed"], self.speeds).T @ hats(test.load, self.loads)
        return found

    def followed(self, course: Floats, tests: Sequence[Test]) -> tuple[str, ...]:
        """What explains most of how a `course` (N,) varies over all steps of the tests, strongest first: "braking" or
        "driving", else "speed" and the load."""
        speed = np.concatenate([test.inputs["speed"] for test in tests])
        loads = np.concatenate([test.load for test in tests])
        brakes = loads < 0.0
        if _share(course, np.column_stack([brakes, ~brakes])) > MOST:
            return ("braking" if brakes.mean() < 0.5 else "driving",)
        by = {"speed": _share(course, hats(speed, self.speeds)), self.load: _share(course, hats(loads, self.loads))}
        return tuple(name for name in sorted(by, key=lambda name: -by[name]) if by[name] > MOST)


@dataclass(frozen=True)
class LossMap:
    """A free loss map as told: `watts` (s, l) at `speeds` and `loads`, dimensionless, beside what it is most of the
    time; `load`, the feature that these are; and how long the motor was near, `seconds` (s, l)."""

    speeds: tuple[float, ...]
    loads: tuple[float, ...]
    load: str
    watts: Floats
    seconds: Floats


def _share(course: Floats, design: Floats) -> float:
    """How much of a course's variance a sum of the columns of `design` explains; columns add up to 1."""
    left = course - design @ np.linalg.lstsq(design.astype(np.float64), course, rcond=None)[0]
    spread = float(np.var(course))
    return 1.0 - float(np.var(left)) / spread if spread > 0.0 else 0.0
