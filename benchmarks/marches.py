"""Two marches through a run, each at the work of both: what every parameter does to what thermometers read.

    python benchmarks/marches.py [--rounds N] [--quick] [--json FILE]

`twin.fitting.march` has dense matrices and goes backwards through each block, from a few thermometers to all
parameters; the diagnosis and every fit take it. `twin.run.sparse_march` eliminates sparsely and goes forwards, from
each parameter to all nodes; the influence of parameters on every node takes it. Both are asked for the same columns,
and must give the same:

| work | what |
|---|---|
| diagnosis_21_nodes | the reference motor read at 7 nodes, with 126 terms more that candidates may be and every start |
| influence_21_nodes | the reference motor read at every node |
| influence_293_nodes | the same in 40 slices, read at every node |

Printed: processor times of the best of all rounds, the two taken in turn, and the sparse march's over the dense one's.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray

from benchmarks import asked
from benchmarks.integrator import best_of, frame, initial_of, shipped, wltp_like
from twin.calibration.calibrate import freedom
from twin.fitting.model import Model, Test
from twin.fitting.recorded import RecordedChannel
from twin.motor.network import Network, Source, Term
from twin.motor.outputs import blocks
from twin.motor.sensor import Sensor
from twin.run.block_columns import Thermometer, block_columns, of_motor
from twin.run.simulate import Frame

Floats = NDArray[np.float64]

STEP_S = 1.0
SMALL_W = 1e-3  # a term that may be a candidate: so little that it changes no temperature


@dataclass(frozen=True)
class Work:
    """A network over the drive, read at some nodes, with or without `starts` among the parameters."""

    network: Network
    frame: Frame
    nodes: Sequence[str]
    starts: bool


def with_candidates(network: Network) -> Network:
    """Heats at every node that go with speed and current in six ways."""
    ways = [{}, {"speed": 1.0}, {"speed": 2.0}, {"current": 1.0}, {"current": 2.0}, {"speed": 1.0, "current": 1.0}]
    terms = tuple(Term(SMALL_W, way) for way in ways)
    return replace(network, sources=(*network.sources, *(Source(node.name, terms) for node in network.nodes)))


def works(steps: int, few_steps: int) -> Iterator[tuple[str, Work]]:
    """What is measured, by its name: so many steps of the drive, of the large network few."""
    motors = shipped()
    small, large = motors["reference_motor"], motors["sliced"]
    asked = with_candidates(small)
    yield "diagnosis_21_nodes", Work(asked, _cut(asked, steps), small.names[: len(small.nodes) : 3], True)
    yield "influence_21_nodes", Work(small, _cut(small, steps), small.names[: len(small.nodes)], False)
    yield "influence_293_nodes", Work(large, _cut(large, few_steps), large.names[: len(large.nodes)], False)


def _cut(network: Network, steps: int) -> Frame:
    whole = frame(network, wltp_like(), STEP_S)
    return replace(whole, features=whole.features[:steps], boundaries=whole.boundaries[:steps])


def by_dense(work: Work) -> Callable[[], Floats]:
    """A linearisation as a fit makes it: (m, B, P) by the logarithm of each coefficient and capacity, then by
    starts."""
    network, n = work.network, len(work.network.nodes)
    steps = len(work.frame.features)
    there = np.ones(steps)
    channels = tuple(RecordedChannel(one, np.zeros(steps), there, there / 2) for one in _sensors(work))
    test = Test("", "", work.frame, {}, {}, initial_of(network), np.ones(n), channels)
    model = Model(network, [test], freedom(network, [test] if work.starts else ()))
    beta = np.zeros(len(model.parameters))

    def linearised() -> Floats:
        beta[0] += 1e-12  # else the model knows its columns already
        return np.stack([part.columns for part in model.linearise(beta)])

    return linearised


def by_sparse(work: Work) -> Callable[[], Floats]:
    """The same, block by block."""
    places, values = of_motor(work.network)
    starts = [places[-1] + 1 + i for i in range(len(work.network.nodes))] if work.starts else []
    scale = np.concatenate([values, np.ones(len(starts))])
    there, names = np.ones(len(work.frame.features)), [node.name for node in work.network.nodes]
    cut = blocks(there, there / 2, STEP_S)
    read = [Thermometer(one.over(names), 0.0, cut) for one in _sensors(work)]
    begin = initial_of(work.network)

    def columns() -> Floats:
        parts = block_columns(work.network, work.frame, begin, read, [*places, *starts])
        return np.concatenate([part * scale for part in parts]).transpose(1, 0, 2)

    return columns


def _sensors(work: Work) -> list[Sensor]:
    return [Sensor(name, {name: 1.0}, noise=0.1) for name in work.nodes]


def measured(rounds: int, steps: int, few_steps: int) -> dict[str, float]:
    """Times [s] and ratios by their names. Exits where the two do not agree."""
    found: dict[str, float] = {}
    for name, work in works(steps, few_steps):
        ways = {"dense": by_dense(work), "sparse": by_sparse(work)}
        dense, sparse = (way() for way in ways.values())
        if np.abs(dense - sparse).max() > 1e-6 * np.abs(dense).max():
            sys.exit(f"{name}: the two marches give other columns")
        best = best_of(rounds, ways, time.process_time)
        found |= {f"{name}_{way}_s": best[way] for way in ways} | {f"{name}_ratio": best["sparse"] / best["dense"]}
    return found


def main() -> None:
    line = asked.parser(__doc__, rounds=(10, 1))
    said = line.parse_args()
    found = measured(said.rounds, *((60, 20) if said.quick else (1800, 60)))
    for name, value in found.items():
        print(f"{name:<32}{value:>10.3g}")
    asked.keep(found, said.json)


if __name__ == "__main__":
    main()
