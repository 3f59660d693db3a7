"""Every kind of column against central differences of the run itself, and what a pass costs."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from twin.codegen_columns import TILE
from twin.errors import FrameError
from twin.features import evaluate, monomials, terms
from twin.kernel import Compiled, compile_network
from twin.network import Boundary, Link, Network, Node, Source, TemperatureFactor, Term
from twin.outputs import Output, blocks, reading
from twin.sensitivities import (
    BoundaryBias,
    ColumnKernel,
    Conductance,
    Heat,
    InitialTemperature,
    LogCapacity,
    LogCoefficient,
    Modulation,
    Parameter,
    compile_columns,
    own_parameters,
    sensitivities,
)
from twin.simulate import Frame, simulate
from twin.structure import parameters

Floats = NDArray[np.float64]
MakeNetwork = Callable[..., Network]
MakeFrame = Callable[..., Frame]
Load = Callable[[str], Callable[..., None]]

STEPS = 60
H = 1e-4


def _outputs(network: Network, seed: int) -> list[Output]:
    """Plain, lagged, weighted; some steps without samples."""
    rng = np.random.default_rng(seed)
    names = [node.name for node in network.nodes]
    some, place = (rng.random(STEPS) < 0.8).astype(np.float64), rng.random(STEPS)
    return [
        Output({names[0]: 1.0}, 0.0, some, place),
        Output({names[-1]: 1.0}, 3.0, np.ones(STEPS), place),
        Output({names[1]: 0.7, names[2]: 0.3}, 1.0, some, np.full(STEPS, 0.5)),
    ]


def _read(network: Network, outputs: Sequence[Output], frame: Frame, temperatures: Floats) -> Floats:
    names = [node.name for node in network.nodes]
    step_s = frame.step_s
    return np.concatenate([blocks(o, step_s).means(reading(o, temperatures, names, step_s)) for o in outputs])


def _difference(at: Callable[[float], Floats], h: float = H) -> Floats:
    result: Floats = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
    return result


def _agree(columns: Floats, wanted: Sequence[Parameter], at: Callable[[Parameter, float], Floats]) -> None:
    for column, parameter in zip(columns.T, wanted, strict=True):
        expected = _difference(lambda d, p=parameter: at(p, d))  # type: ignore[misc]
        scale = np.abs(expected).max()  # below 5e-9 the differences are rounding
        np.testing.assert_allclose(column, expected, rtol=0, atol=max(1e-6 * scale, 5e-9), err_msg=str(parameter))


@pytest.mark.parametrize("seed", range(4))
def test_the_columns_of_a_network_are_the_derivative_of_its_run(
    seed: int, make_network: MakeNetwork, make_frame: MakeFrame, plain: Load
) -> None:
    network = make_network(seed, n=5)
    frame = make_frame(network, seed, steps=STEPS)
    names = [node.name for node in network.nodes]
    start = np.linspace(25, 60, len(names))
    outputs = _outputs(network, seed)
    wanted = (*own_parameters(network), *map(InitialTemperature, names), *map(BoundaryBias, ("coolant", "ambient")))
    compiled = compile_network(network, load=plain)
    found = sensitivities(compile_columns(network, load=plain), frame, start, wanted, outputs)

    def at(parameter: Parameter, by: float) -> Floats:
        values, first, around = parameters(network), start.copy(), frame.boundaries.copy()
        match parameter:
            case LogCoefficient(term):
                values.coefficients[term] *= np.exp(by)
            case LogCapacity(node):
                values.capacities[names.index(node)] *= np.exp(by)
            case InitialTemperature(node):
                first[names.index(node)] += by
            case BoundaryBias(boundary):
                around[:, ("coolant", "ambient").index(boundary)] += by
        run = replace(compiled, parameters=values)
        return _read(network, outputs, frame, simulate(run, replace(frame, boundaries=around), first))

    np.testing.assert_array_equal(found.temperatures, simulate(compiled, frame, start))
    _agree(np.concatenate(found.columns), wanted, at)


FACTOR = TemperatureFactor("yoke", 0.004, 30.0)


def _motor(*, extra: Sequence[tuple[str, str, Term]] = (), exponent: float = 1.5) -> Network:
    """Three nodes; `extra`: terms at (node, "") or (node, other end)."""
    links = {("winding", "yoke"): [Term(12.0)], ("yoke", "coolant"): [Term(25.0)]}
    sources = {
        "winding": [
            Term(240.0, {"current": 2.0}, copper=True),
            Term(50.0, {"current": 2.0, "speed": 2.0}, resistance=-1),
        ],
        "yoke": [Term(90.0, {"speed": exponent})],
    }
    for a, b, term in extra:
        if b:
            links.setdefault((a, b), []).append(term)
        else:
            sources.setdefault(a, []).append(term)
    return Network(
        name="servo",
        nodes=(Node("winding", 90.0, "copper"), Node("yoke", 350.0, "iron"), Node("magnet", 120.0, "magnet")),
        boundaries=(Boundary("coolant"), Boundary("ambient")),
        links=(
            Link("yoke", "magnet", (Term(1.0), Term(2.0, {"speed": 0.8}))),
            *(Link(a, b, tuple(group)) for (a, b), group in links.items()),
        ),
        sources=tuple(Source(node, tuple(group)) for node, group in sources.items()),
        scale={"speed": 6000.0, "current": 20.0},
    )


def _drive(steps: int = STEPS) -> dict[str, Floats]:
    rng = np.random.default_rng(5)
    return {name: np.repeat(rng.uniform(0.2, 1.0, steps // 4), 4) for name in ("speed", "current")}


def _frame_of(network: Network, u: dict[str, Floats]) -> Frame:
    steps = len(u["speed"])
    return Frame(0.5, evaluate(monomials(network), u, steps), np.full((steps, 2), [30.0, 22.0]))


CANDIDATES = [
    (Heat("magnet"), ("magnet", "", Term(1.0))),
    (Heat("magnet", "speed2_current2"), ("magnet", "", Term(1.0, {"speed": 2.0, "current": 2.0}))),
    (Heat("yoke", "speed1.5", FACTOR), ("yoke", "", Term(1.0, {"speed": 1.5}, temperature=FACTOR))),
    (Heat("winding", "speed1.5", resistance=True), ("winding", "", Term(1.0, {"speed": 1.5}, resistance=-1))),
    (Conductance("winding", "magnet"), ("winding", "magnet", Term(1.0))),
    (Conductance("magnet", "coolant", "speed0.8"), ("magnet", "coolant", Term(1.0, {"speed": 0.8}))),
    (Conductance("ambient", "winding"), ("winding", "ambient", Term(1.0))),
]


@pytest.mark.parametrize(("candidate", "term"), CANDIDATES, ids=lambda value: str(value))
def test_the_column_of_a_term_that_is_not_there_is_the_slope_at_zero(
    candidate: Parameter, term: tuple[str, str, Term], plain: Load
) -> None:
    network, u, start = _motor(), _drive(), np.array([40.0, 35.0, 30.0])
    frame, outputs = _frame_of(network, u), _outputs(_motor(), 1)
    extra = {"speed2_current2": (u["speed"] * u["current"]) ** 2}
    kernel = compile_columns(network, load=plain)
    (column,) = np.concatenate(sensitivities(kernel, frame, start, [candidate], outputs, extra=extra).columns).T
    a, b, law = term

    def at(amount: float) -> Floats:
        own = _motor(extra=[(a, b, replace(law, coefficient=amount))])
        return _read(own, outputs, frame, simulate(_compiled(own, plain), _frame_of(own, u), start))

    expected = (at(1e-3) - at(-1e-3)) / 2e-3 if not b else (4 * at(5e-4) - at(1e-3) - 3 * at(1e-12)) / 1e-3
    np.testing.assert_allclose(column, expected, rtol=0, atol=2e-6 * np.abs(expected).max())


def _compiled(network: Network, load: Load) -> Compiled:
    return compile_network(network, load=load)


def test_an_exponent_is_a_modulation_by_its_logarithm(plain: Load) -> None:
    u, start = _drive(), np.array([40.0, 35.0, 30.0])
    network = _motor()
    frame, outputs = _frame_of(network, u), _outputs(network, 2)
    term = [t.exponents for t in terms(network)].index({"speed": 1.5})
    slope = {"slope": u["speed"] ** 1.5 * np.log(u["speed"])}
    kernel = compile_columns(network, load=plain)
    found = sensitivities(kernel, frame, start, [Modulation(term, "slope")], outputs, extra=slope)

    def at(by: float) -> Floats:
        own = _motor(exponent=1.5 + by)
        return _read(own, outputs, frame, simulate(_compiled(own, plain), _frame_of(own, u), start))

    expected = _difference(at)
    np.testing.assert_allclose(
        np.concatenate(found.columns)[:, 0], expected, rtol=0, atol=1e-6 * np.abs(expected).max()
    )


def test_a_parameter_of_what_is_not_there_is_refused(plain: Load) -> None:
    network = _motor()
    frame = _frame_of(network, _drive())
    kernel = compile_columns(network, load=plain)
    for wanted, says in (
        (Heat("gearbox"), 'network "servo" has no node or boundary "gearbox": name one that it has'),
        (Heat("yoke", "speed3"), 'feature "speed3" is neither of the network nor given'),
        (Heat("magnet", resistance=True), 'node "magnet" has no loss in copper: its resistance is not known'),
        (LogCoefficient(99), 'network "servo" has no term 99: count from 0, links first'),
    ):
        with pytest.raises(FrameError, match=re.escape(says)):
            sensitivities(kernel, frame, np.full(3, 30.0), [wanted], [])


@pytest.fixture(scope="module")
def compiled_columns() -> ColumnKernel:
    return compile_columns(_motor())


def test_compiled_columns_are_those_of_the_plain_text(compiled_columns: ColumnKernel, plain: Load) -> None:
    network, u = _motor(), _drive()
    frame, outputs, start = _frame_of(network, u), _outputs(network, 3), np.full(3, 30.0)
    wanted = own_parameters(network) * 4  # more than one tile
    assert len(wanted) > TILE
    compiled = sensitivities(compiled_columns, frame, start, wanted, outputs)
    interpreted = sensitivities(compile_columns(network, load=plain), frame, start, wanted, outputs)
    for a, b in zip(compiled.columns, interpreted.columns, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-12)


def test_the_run_beside_the_columns_has_the_bits_of_the_run_alone(compiled_columns: ColumnKernel) -> None:
    network = _motor()
    frame, start = _frame_of(network, _drive()), np.full(3, 30.0)
    found = sensitivities(compiled_columns, frame, start, own_parameters(network), _outputs(network, 4))
    alone = simulate(compile_network(network), frame, start)
    np.testing.assert_array_equal(found.temperatures, alone)


def test_the_inner_loops_use_vector_instructions(compiled_columns: ColumnKernel) -> None:
    network = _motor()
    sensitivities(compiled_columns, _frame_of(network, _drive()), np.full(3, 30.0), own_parameters(network), [])
    (text,) = compiled_columns.run.inspect_llvm().values()  # type: ignore[attr-defined]
    assert len(re.findall(r"fmul (?:contract )?<\d+ x double>", text)) >= 10
