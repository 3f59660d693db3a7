"""A free heat at every node of a fitted motor: where the data want heat that no cause names, and what it goes with."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.evidence import TOLD_APART, Projector
from twin.diagnosis.free_maps import Knots, LossMap
from twin.diagnosis.posterior_mode import slowest_mode_s, stacked
from twin.diagnosis.unknown import (
    SPACING_S,
    FreeHeat,
    Response,
    SumsOverTests,
    active_ranges,
    associations,
    correlation_in_time,
    free_heat,
    tent_times,
    tents,
)
from twin.differences.everyday import mean_loss_W
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit
from twin.fitting.model import Floats, Model
from twin.fitting.one_test import alone

REPEATED = ("current_d", "current_q")  # by the current that they are components of
LEAST_RUNS = 5  # of tents that the bootstrap draws: with fewer its bands are too narrow


@dataclass(frozen=True)
class Unknown:
    """A heat that no candidate explains, while it is active: 10 to 90 % range of `watts` [W] (cooling negative), 5 to
    95 % ranges of `inputs` (dimensionless features) and of the node's own `temperature_degC`. `goes_with`: features, or
    the node whose temperature it follows, that it clearly goes with, strongest first; a map may go with "braking" or
    "driving"."""

    node: str
    log_bayes_factor: float
    watts: tuple[float, float]
    inputs: Mapping[str, tuple[float, float]]
    temperature_degC: tuple[float, float]
    goes_with: tuple[str, ...]
    map: LossMap | None = None


def free_heats(current: Fit, maps: bool = False) -> tuple[FreeHeat, ...]:
    """The free heat of every node about a fit, highest ln BF first (`twin.diagnosis.unknown`), and with `maps` the free
    loss map of every node among them."""
    projector, _, e0 = stacked(current, current.linearised())
    names = [node.name for node in current.model.network.nodes]
    total_W = mean_loss_W(current.model.network, current.model.tests)
    found = [free_heat(name, own, e0, projector, total_W) for name, own in zip(names, _in_time(current), strict=True)]
    found += _maps(current, projector, e0) if maps else []
    return _best_first(found)


def free_maps(current: Fit) -> tuple[FreeHeat, ...]:
    """The free loss map of every node about a fit, highest ln BF first; none where nobody knows speed and load."""
    projector, _, e0 = stacked(current, current.linearised())
    return _best_first(_maps(current, projector, e0))


def _best_first(found: Sequence[FreeHeat]) -> tuple[FreeHeat, ...]:
    return tuple(sorted(found, key=lambda heat: -heat.log_bayes_factor))


def as_parameters(current: Fit, heat: FreeHeat) -> list[Parameter]:
    """A free heat as parameters of a model, each as wide as the heat is large: its tents in every test, or its map."""
    node = current.model.network.names.index(heat.node)
    sd = float(np.sqrt(np.mean(heat.watts**2 + heat.sd**2)))
    if heat.is_map:
        knots = knots_of(current.model)
        return [Parameter(f"heat.{heat.node}.{i}", one, sd) for i, one in enumerate(knots.parts(node, knots.alike))]
    return [
        Parameter(f"heat.{heat.node}.{one.time_s:g}", one, sd, number)
        for number in range(len(current.model.tests))
        for one in _tents(current.model, number, node)
    ]


def as_fitted(found: Fit, heat: FreeHeat) -> FreeHeat:
    """A heat as a fit has it that it stands among the parameters of (`as_parameters`)."""
    own = places_of_heat(found.model)
    maps = knots_of(found.model).alike if heat.is_map else np.eye(len(own))
    covariance = np.linalg.inv(found.hessian)[np.ix_(own, own)]
    return replace(heat, watts=maps @ found.beta[own], sd=np.sqrt(np.einsum("ik,kl,il->i", maps, covariance, maps)))


def places_of_heat(model: Model) -> list[int]:
    """Where a free heat stands among the parameters."""
    return [p for p, one in enumerate(model.parameters) if isinstance(one.action, actions.PartOfHeat)]


def _in_time(current: Fit) -> list[list[Response]]:
    """Node by node its responses in every test to heat in time."""
    model = current.model
    found: list[list[Response]] = [[] for _ in model.network.nodes]
    for number, (rows, by_node) in enumerate(_responding(current, lambda test, node: _tents(model, test, node))):
        alike = correlation_in_time(_times(model, number))
        for responses, columns in zip(found, by_node, strict=True):
            responses.append(Response(rows, alike, columns))
    return found


def _maps(current: Fit, projector: Projector, e0: Floats) -> list[FreeHeat]:
    """The free loss map of every node, its responses added up over the tests; none where nobody knows speed and
    load."""
    if not (knots := Knots.of(current.model.tests)):
        return []
    each = np.eye(len(knots.correlation))
    found = {node.name: SumsOverTests(len(each), e0, projector) for node in current.model.network.nodes}
    for rows, by_node in _responding(current, lambda _, node: knots.parts(node, each)):
        for sums, columns in zip(found.values(), by_node, strict=True):
            sums.add(rows, columns)
    total_W = mean_loss_W(current.model.network, current.model.tests)
    return [sums.heat(name, knots.correlation, total_W) for name, sums in found.items()]


def _responding(
    current: Fit, parts: Callable[[int, int], Sequence[actions.PartOfHeat]]
) -> Iterator[tuple[slice, list[Floats]]]:
    """Test after test its rows, in the order of `Fit.series`, and node by node how these respond to 1 W of each of its
    `parts` (by the numbers of test and node), whitened (n, q)."""
    nodes, start = range(len(current.model.network.nodes)), 0
    for number, test in enumerate(current.model.tests):
        model, at = alone(current.model, number, test)
        heats = [Parameter("heat", part, 1.0) for node in nodes for part in parts(number, node)]
        found = model.linearise(current.beta[at], heats)
        columns = np.concatenate([model.whitened(part.series, part.extra) for part in found])
        rows = slice(start, start + len(columns))
        start = rows.stop
        yield rows, np.split(columns, len(nodes), axis=1)


def _tents(model: Model, number: int, node: int) -> list[actions.HeatTent]:
    return [actions.HeatTent(node, float(time_s), SPACING_S) for time_s in _times(model, number)]


def knots_of(model: Model) -> Knots:
    """The knots of a model that has a map."""
    found = Knots.of(model.tests)
    assert found is not None, "a map was found over them"
    return found


def _times(model: Model, number: int) -> Floats:
    frame = model.tests[number].frame
    return tent_times(frame.step_s * len(frame.features))


def describe(current: Fit, heat: FreeHeat) -> Unknown:
    """How large a free heat is, when it is there and what it goes with (`twin.diagnosis.unknown`)."""
    if heat.is_map:
        return _of_map(current, heat)
    inputs = _over_tents(current.model, [test.inputs for test in current.model.tests])
    inputs = {name: values for name, values in inputs.items() if name not in REPEATED or "current" not in inputs}
    names = [node.name for node in current.model.network.nodes]
    means = [current.model.course(s, current.beta)[1] for s in range(len(current.model.tests))]
    temperatures = _over_tents(current.model, [dict(zip(names, x.T, strict=True)) for x in means])
    watts, own, ranges = active_ranges(heat.watts, temperatures[heat.node], inputs)
    runs = math.ceil(2 * slowest_mode_s(current) / SPACING_S)
    block = max(1, min(runs, len(heat.watts) // LEAST_RUNS))
    follows = _followed(heat, inputs, temperatures, block)
    found = associations(heat.watts, {**inputs, follows: temperatures[follows]}, block)
    return Unknown(heat.node, heat.log_bayes_factor, watts, ranges, own, tuple(a.feature for a in found if a.clear))


def _of_map(current: Fit, heat: FreeHeat) -> Unknown:
    """A map as the motor ran through it, step by step, beside what it is most of the time: a heat that is always there
    is taken for more of the node's own losses."""
    model, knots = current.model, knots_of(current.model)
    inputs = {
        name: np.concatenate([test.inputs[name] for test in model.tests])
        for name in model.tests[0].inputs
        if name not in REPEATED and all(name in test.inputs for test in model.tests)
    }
    node = model.network.names.index(heat.node)
    own = np.concatenate([model.course(s, current.beta)[1][:, node] for s in range(len(model.tests))])
    watts = np.concatenate([knots.course(heat.watts, test) for test in model.tests])
    usual = float(np.median(watts))
    among, temperature, ranges = active_ranges(watts - usual, own, inputs)
    goes_with = knots.followed(watts, model.tests)
    over = heat.watts.reshape(len(knots.speeds), -1) - usual
    told = LossMap(knots.speeds, knots.loads, knots.load, over, knots.seconds(model.tests))
    return Unknown(heat.node, heat.log_bayes_factor, among, ranges, temperature, goes_with, told)


def _over_tents(model: Model, series: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Series that every test has, name -> (N,) by steps, as means over each tent, tests one after the other."""
    shared = [name for name in series[0] if all(name in own for own in series)]
    found: dict[str, list[Floats]] = {name: [] for name in shared}
    for number, own in enumerate(series):
        frame = model.tests[number].frame
        middle = frame.step_s * (np.arange(len(frame.features), dtype=np.float64) + 0.5)
        weight = tents(middle, _times(model, number))
        share = weight / np.maximum(weight.sum(axis=0), 1e-12)
        for name in shared:
            found[name].append(own[name] @ share)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _followed(heat: FreeHeat, inputs: Mapping[str, Floats], temperatures: Mapping[str, Floats], block: int) -> str:
    """The node whose temperature, beside the inputs, explains most of the heat; the heat's own node unless another is
    ahead by ln 20 in ln likelihood, where a run of tents counts as one observation."""
    unexplained = {
        node: _unexplained(heat.watts, [*inputs.values(), temperature]) for node, temperature in temperatures.items()
    }
    best = min(unexplained, key=lambda node: unexplained[node])
    ahead = len(heat.watts) / block / 2 * np.log(unexplained[heat.node] / unexplained[best])
    return best if ahead > TOLD_APART else heat.node


def _unexplained(watts: Floats, features: Sequence[Floats]) -> float:
    """Mean square [W^2] that a regression on the features leaves, at least a millionth of all."""
    design = np.column_stack([np.ones(len(watts)), *(x / max(float(np.abs(x).max()), 1e-12) for x in features)])
    left = watts - design @ np.linalg.lstsq(design, watts, rcond=None)[0]
    return max(float(np.mean(left**2)), 1e-6 * float(np.mean(watts**2)), 1e-30)
