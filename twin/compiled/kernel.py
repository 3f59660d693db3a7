"""From a network to a compiled run: straight-line code for small ones, the index program above."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.vectors import MARK
from twin.compiled import codegen, codegen_gradient, codegen_lanes, heat, indexed
from twin.compiled.integrators import DEFAULT, Tableau
from twin.compiled.structure import Parameters, described, structure
from twin.motor.check import check
from twin.motor.network import Network

Floats = NDArray[np.float64]
Kernel = Callable[..., None]
Load = Callable[[str], Kernel]
Run = Callable[[Parameters, Floats, Floats, float, Floats], None]

INDEX_HEAD = f"""{MARK}from __future__ import annotations

from typing import Any

import numba
import numpy as np

from twin.arithmetic.vectors import vectors


"""

# Above this many statements a step, compiling takes longer than straight-line code saves (docs/integrator.md).
STATEMENTS = 1000


@dataclass(frozen=True)
class Compiled:
    """A network ready to run. `run(parameters, features, boundaries, step_s, out)` fills `out[1:]` from `out[0]`.

    What more it can do is compiled at its first call, and None where it cannot: `together` for
    `twin.run.side_by_side` (not where the method looks back) and `gradient` for `twin.run.gradients` (the
    straight-line form of the default method).
    """

    network: Network
    parameters: Parameters
    run: Run
    form: str  # "straight-line" | "indexed"
    monomials: int
    together: Callable[[], Run] | None
    gradient: Callable[[], Kernel] | None


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
    shape, values = described(network)
    source = codegen.generate(shape, tableau)
    if statements(source) > STATEMENTS:
        return compile_indexed(network, tableau, load)

    @cache
    def together() -> Run:
        return _given(load(codegen_lanes.generate_side_by_side(shape, tableau)))

    @cache
    def gradient() -> Kernel:
        return load(codegen_gradient.generate_gradient(shape, DEFAULT))

    several = None if tableau.back else together
    derived = gradient if tableau is DEFAULT else None
    run = _given(load(source))
    return Compiled(network, values, run, "straight-line", shape.monomials, several, derived)


def _given(kernel: Kernel) -> Run:
    """The kernel of one text as `Compiled.run`."""
    return lambda p, phi, boundaries, step_s, out: kernel(
        phi, boundaries, step_s, p.coefficients, p.capacities, p.copper, p.factors, out
    )


def compile_indexed(network: Network, tableau: Tableau = DEFAULT, load: Load = load_in_memory) -> Compiled:
    """Check a network of any size and prepare it for the index program, which is compiled once for all."""
    check(network)
    shape, values = described(network)
    program, kernel = indexed.program(shape, tableau), index_program(load)

    def run(p: Parameters, phi: Floats, boundaries: Floats, step_s: float, out: Floats) -> None:
        stage = np.empty((len(program.weights), *out.shape[1:]))
        kernel(program, phi, boundaries, step_s, p.coefficients, p.capacities, p.copper, p.factors, out, stage)

    several = None if tableau.back else lambda: run
    return Compiled(network, values, run, "indexed", shape.monomials, several, None)


@cache
def index_program(load: Load = load_in_memory) -> Kernel:
    """The compiled `indexed.run`, with all that it calls in one text: a cache then never holds parts of different
    versions."""
    functions = (indexed.assemble, indexed.run)
    parts = (heat.TEXT_OF_VECTORS, *(inspect.getsource(function.py_func) for function in functions))
    return load(INDEX_HEAD + "\n\n".join(parts).replace("cache=True", "cache=CACHE"))
