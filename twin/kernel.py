"""From a network to a compiled run: straight-line code for small ones, the index program above."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from twin import codegen, codegen_columns, codegen_gradient, codegen_lanes, drops, indexed, indexed_lanes
from twin.check import check
from twin.integrators import DEFAULT, Tableau
from twin.network import Network
from twin.structure import Parameters, parameters, structure

Kernel = Callable[..., None]
Load = Callable[[str], Kernel]
Run = Callable[[Parameters, NDArray[np.float64], NDArray[np.float64], float, NDArray[np.float64]], None]
Together = Callable[[Parameters, NDArray[np.float64], float, NDArray[np.float64], NDArray[np.float64]], None]

INDEX_HEAD = """from __future__ import annotations

import numba
import numpy as np


"""

# Above this many statements a step, compiling takes longer than straight-line code saves (docs/integrator.md).
STATEMENTS = 1000


@dataclass(frozen=True)
class Compiled:
    """A network ready to run. `run(parameters, features, boundaries, step_s, out)` fills `out[1:]` from `out[0]`.

    What more it can do is compiled at its first call, and None where it cannot: `together` for `twin.side_by_side` (not where the
    method looks back), `gradient` for `twin.gradients` and `columns` for `twin.sensitivities` (the straight-line form of
    the default method).
    """

    network: Network
    parameters: Parameters
    run: Run
    form: str  # "straight-line" | "indexed"
    monomials: int
    together: Callable[[], Together] | None
    gradient: Callable[[], Kernel] | None
    columns: Callable[[tuple[int, ...]], Kernel] | None


def generate(network: Network, tableau: Tableau = DEFAULT) -> str:
    """The straight-line source of a checked network, whatever its size; the same text for the same topology."""
    return codegen.generate(structure(network), tableau)


def statements(source: str) -> int:
    """Lines of a straight-line source that a step executes."""
    return sum(line.startswith("        ") for line in source.splitlines())


def load_in_memory(source: str) -> Callable[..., None]:
    """Compile a kernel's source and forget it with the process. The text asks for `cache=CACHE`: here without."""
    namespace: dict[str, Any] = {"__name__": "whyhot_kernel"}
    exec(compile(source.replace("cache=CACHE", "cache=False"), "<whyhot kernel>", "exec"), namespace)  # noqa: S102 -- our own text
    return cast(Callable[..., None], namespace["run"])


def compile_network(network: Network, tableau: Tableau = DEFAULT, load: Load = load_in_memory) -> Compiled:
    """Check and compile a network; the straight-line form up to `STATEMENTS`, the index program above.

    `load` turns a source text into its compiled `run`; a caller may keep it for a later start. Raises `NetworkError`
    where the network cannot be a motor.
    """
    check(network)
    shape = structure(network)
    source = codegen.generate(shape, tableau)
    if statements(source) > STATEMENTS:
        return compile_indexed(network, tableau, load)
    kernel = load(source)

    def run(
        p: Parameters,
        phi: NDArray[np.float64],
        boundaries: NDArray[np.float64],
        step_s: float,
        out: NDArray[np.float64],
    ) -> None:
        kernel(phi, boundaries, step_s, p.coefficients, p.capacities, p.copper, p.factors, out)

    @cache
    def together() -> Together:
        lanes = load(codegen_lanes.generate_side_by_side(shape, tableau))

        def run(
            p: Parameters,
            inputs: NDArray[np.float64],
            step_s: float,
            state: NDArray[np.float64],
            out: NDArray[np.float64],
        ) -> None:
            lanes(inputs, step_s, p.coefficients, p.capacities, p.copper, p.factors, state, out)

        return run

    @cache
    def gradient() -> Kernel:
        return load(codegen_gradient.generate_gradient(shape, DEFAULT))

    @cache
    def columns(wanted: tuple[int, ...]) -> Kernel:
        return load(codegen_columns.generate_columns(shape, DEFAULT, wanted))

    several = None if tableau.back else together
    derived = (gradient, columns) if tableau is DEFAULT else (None, None)
    return Compiled(network, parameters(network), run, "straight-line", shape.monomials, several, *derived)


def compile_indexed(network: Network, tableau: Tableau = DEFAULT, load: Load = load_in_memory) -> Compiled:
    """Check a network of any size and prepare it for the index program, which is compiled once for all."""
    check(network)
    shape = structure(network)
    program = indexed.program(shape, tableau)
    kernel = index_program(load)

    def run(
        p: Parameters,
        phi: NDArray[np.float64],
        boundaries: NDArray[np.float64],
        step_s: float,
        out: NDArray[np.float64],
    ) -> None:
        stage = np.empty((len(program.weights), program.n))
        kernel(program, phi, boundaries, step_s, p.coefficients, p.capacities, p.copper, p.factors, out, stage)

    @cache
    def together() -> Together:
        lanes = index_program_of_lanes(load)

        def run(
            p: Parameters,
            inputs: NDArray[np.float64],
            step_s: float,
            state: NDArray[np.float64],
            out: NDArray[np.float64],
        ) -> None:
            lanes(program, inputs, step_s, p.coefficients, p.capacities, p.copper, p.factors, state, out)

        return run

    several = None if tableau.back else together
    return Compiled(network, parameters(network), run, "indexed", shape.monomials, several, None, None)


@cache
def index_program(load: Load = load_in_memory) -> Kernel:
    """The compiled `indexed.run`, with all that it calls in one text: a cache then never holds parts of different versions."""
    return load(_text(drops.drop, drops.between, indexed.assemble, indexed.run))


@cache
def index_program_of_lanes(load: Load = load_in_memory) -> Kernel:
    """The compiled `indexed_lanes.run`, likewise."""
    return load(_text(drops.drop, drops.between, indexed_lanes.assemble_lanes, indexed_lanes.run))


def _text(*functions: Any) -> str:
    parts = (inspect.getsource(function.py_func) for function in functions)
    return INDEX_HEAD + "\n\n".join(parts).replace("cache=True", "cache=CACHE")
