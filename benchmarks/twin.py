"""How fast the twin is, as ratios of what is timed in one run, each beside what it shall be and whether it is.

    python benchmarks/twin.py [--rounds N] [--quick] [--json FILE]

The reference motor (21 nodes) over a drive like the WLTP, steps of 0.5 s, unless said:

| figure | what |
|---|---|
| vs_c | our default run over the same generated statements in C (gcc -O3, nothing fused): the same bits |
| vs_lsoda | scipy's LSODA over our run |
| ekf_vs_filterpy, ekf46_... | filterpy over our filters, of 25 and of 43 numbers (`filter_speed.py` too) |
| ..._difference_K | the largest difference between the two |
| columns_in_simulations | a run with the derivatives of every node by every coefficient and capacity, in blocks of |
| | 10 s as characterising takes them (`twin.run.block_columns`), over the run |
| adjoint_in_simulations | the run and the derivatives of one number by everything, over the run |
| batch_vs_loop | 64 sessions of 10,800 steps one after the other over the same side by side, temperatures the same |
| | to the bit, checks and the memory for them included |
| batch_vs_loop_2_cores | the same with half of them in each of two threads; where others use the cores it says little |
| compile_s, cached_start_s | a fresh process, imports done, to the end of its first run: without and with what an |
| | earlier one kept |
| index_vs_c | a network of 97 nodes (the reference motor in slices), for which nothing is compiled: the index |
| | program, sessions side by side, over C of its statements (gcc -O1, half a minute), one after the other |

Without gcc the ratios to C are null. Times are processor times of one thread, for two cores those on the clock: the
best of all rounds, the ways taken in turn.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # else ingest.py beside this file hides the package
sys.path[:0] = [str(HERE.parent)]

import numpy as np
from numpy.typing import NDArray

from benchmarks import asked
from benchmarks.integrator import best_of, frame, initial_of, lsoda, motor, wltp_like
from replay.engine.results.kernel_cache import load, load_kernel
from twin.arithmetic.vectors import LANES
from twin.compiled.kernel import Compiled, compile_indexed, generate
from twin.motor.features import monomials
from twin.motor.network import Network
from twin.motor.slicing import sliced
from twin.run.block_columns import block_columns, of_every_node, of_motor
from twin.run.gradients import gradient
from twin.run.side_by_side import simulate_all
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

TARGETS = {  # name -> (what it shall be, whether at least)
    "vs_c": (1.2, False),
    "vs_lsoda": (200.0, True),
    "ekf_vs_filterpy": (50.0, True),
    "ekf_difference_K": (1e-9, False),
    "ekf46_vs_filterpy": (20.0, True),
    "ekf46_difference_K": (1e-9, False),
    "columns_in_simulations": (25.0, False),
    "adjoint_in_simulations": (2.5, False),
    "batch_vs_loop": (3.0, True),
    "batch_vs_loop_2_cores": (4.5, True),
    "compile_s": (2.5, False),
    "cached_start_s": (0.4, False),
    "index_vs_c": (1.3, False),
}
SLICED = ("jacket", "yoke", "teeth", "winding_a", "winding_b", "rotor_core", "rotor_surface", "magnet")


# --- The same statements in C -----------------------------------------------------------------------------------------


def c_source(network: Network) -> str:
    """`run` of the network's kernel as C: its lines are assignments, and those of the shipped motors know no
    function."""
    hoisted, steps = generate(network).split("factors, out):\n")[1].split("    for k in range(features.shape[0]):\n")
    wide = {
        "features": len(monomials(network)),
        "boundaries": len(network.boundaries),
        "factors": 2,
        "out": len(network.nodes),
    }
    declared: set[str] = set()

    def statement(line: str) -> str:
        text = re.sub(
            r"(features|boundaries|factors|out)\[([^,\]]+), (\d+)\]",
            lambda found: f"{found[1]}[({found[2]}) * {wide[found[1]]} + {found[3]}]",
            line.strip(),
        )
        name = text.split(" = ")[0]
        new = name.isidentifier() and name not in declared
        declared.add(name)
        return f"{'double ' if new else ''}{text};\n"

    arrays = ("features", "boundaries", "coefficients", "capacities", "copper", "factors")
    given = ", ".join(f"const double *restrict {name}" for name in arrays)
    before, within = ("".join(map(statement, part.splitlines())) for part in (hoisted, steps))
    return (
        f"void run(long steps, double step_s, {given}, double *restrict out) {{\n{before}"
        f"for (long k = 0; k < steps; k++) {{\n{within}}}\n}}\n"
    )


def in_c(network: Network, folder: Path, optimise: str) -> Callable[[Compiled, Frame, Floats], None] | None:
    """The compiled C, which fills `out[1:]` from `out[0]` as `Compiled.run` does; None without a compiler."""
    compiler = shutil.which("gcc")
    if compiler is None:
        return None
    source, library = folder / f"{network.name}.c", folder / f"{network.name}.so"
    source.write_text(c_source(network), encoding="utf-8")
    subprocess.run(
        [compiler, optimise, "-ffp-contract=off", "-shared", "-fPIC", str(source), "-o", str(library)], check=True
    )
    run = ctypes.CDLL(str(library)).run

    def filled(compiled: Compiled, inputs: Frame, out: Floats) -> None:
        p = compiled.parameters
        arrays = (inputs.features, inputs.boundaries, p.coefficients, p.capacities, p.copper, p.factors, out)
        places = [ctypes.c_void_p(array.ctypes.data) for array in arrays]
        run(ctypes.c_long(len(inputs.features)), ctypes.c_double(inputs.step_s), *places)

    return filled


# --- The ratios -------------------------------------------------------------------------------------------------------


def one_session(rounds: int, folder: Path) -> dict[str, float | None]:
    """What is asked of one session of the reference motor, a WLTP-like drive at 0.5 s."""
    network = motor("reference_motor")
    compiled, inputs, start = load_kernel(network), frame(network, wltp_like(), 0.5), initial_of(network)
    temperatures = simulate(compiled, inputs, start)
    everywhere, (everything, _) = of_every_node(network, inputs), of_motor(network)
    at_the_end = np.zeros_like(temperatures)
    at_the_end[-1, 0] = 1.0
    ours, theirs = temperatures.copy(), temperatures.copy()
    runs: dict[str, Callable[[], object]] = {
        "simulation": lambda: simulate(compiled, inputs, start),
        "kernel": lambda: compiled.run(compiled.parameters, inputs.features, inputs.boundaries, inputs.step_s, ours),
        "columns": lambda: deque(block_columns(network, inputs, start, everywhere, everything), maxlen=0),
        "gradient": lambda: gradient(compiled, inputs, temperatures, at_the_end),
    }
    c = in_c(network, folder, "-O3")
    if c is not None:
        runs["c"] = lambda: c(compiled, inputs, theirs)
    for run in runs.values():
        run()
    if c is not None and not np.array_equal(ours, theirs):
        sys.exit("the statements in C gave other bits")
    best = best_of(rounds, runs, time.thread_time)
    slow = best_of(1, {"lsoda": lambda: lsoda(network, inputs, start)}, time.thread_time)["lsoda"]
    return {
        "us_per_step": best["kernel"] / len(inputs.features) * 1e6,
        "vs_c": best["kernel"] / best["c"] if c is not None else None,
        "vs_lsoda": slow / best["simulation"],
        "columns_in_simulations": best["columns"] / best["simulation"],
        "adjoint_in_simulations": 1 + best["gradient"] / best["simulation"],
    }


def sessions_of(network: Network, count: int, steps: int) -> tuple[list[Frame], list[Floats]]:
    """Different ones of equal length, the drive again and again, and where each starts."""
    whole, rng = frame(network, wltp_like(), 0.5), np.random.default_rng(1)
    phi, around = (np.resize(array, (steps, array.shape[1])) for array in (whole.features, whole.boundaries))
    drawn = rng.uniform(0.5, 1.0, count)
    frames = [Frame(0.5, share * phi, around + share) for share in drawn]
    return frames, [initial_of(network) + share for share in drawn]


def many_sessions(rounds: int, sessions: int, steps: int) -> dict[str, float]:
    """Of the reference motor."""
    network = motor("reference_motor")
    compiled, (frames, starts) = load_kernel(network), sessions_of(network, sessions, steps)

    def loop() -> list[Floats]:
        return [simulate(compiled, *given) for given in zip(frames, starts, strict=True)]

    def together(first: int = 0, stop: int = sessions) -> list[Floats]:
        return simulate_all(compiled, frames[first:stop], starts[first:stop])

    if not all(map(np.array_equal, loop(), together())):
        sys.exit("sessions side by side have other bits than alone")
    half = sessions // 2
    with ThreadPoolExecutor(2) as pool:

        def halves() -> object:
            return list(pool.map(together, (0, half), (half, sessions)))

        both = best_of(rounds, {"loop": loop, "halves": halves})
    alone = best_of(rounds, {"loop": loop, "together": together}, time.thread_time)
    return {
        "batch_vs_loop": alone["loop"] / alone["together"],
        "batch_vs_loop_2_cores": both["loop"] / both["halves"],
    }


def many_nodes(rounds: int, folder: Path, slices: int) -> dict[str, float | None]:
    """Of a network that is too large to be compiled for itself."""
    network = replace(sliced(motor("reference_motor"), SLICED, slices, 0.13), name="slices")
    compiled, (frames, starts) = compile_indexed(network, load=load), sessions_of(network, LANES, 200)
    c = in_c(network, folder, "-O1")
    if c is None:
        return {"index_vs_c": None}
    ours = simulate_all(compiled, frames, starts)
    theirs = [np.concatenate([start[None], np.empty((200, len(start)))]) for start in starts]

    def in_turn() -> None:
        for inputs, out in zip(frames, theirs, strict=True):
            c(compiled, inputs, out)

    best = best_of(rounds, {"ours": lambda: simulate_all(compiled, frames, starts), "c": in_turn}, time.thread_time)
    if max(float(np.abs(own - out).max()) for own, out in zip(ours, theirs, strict=True)) > 1e-9:
        sys.exit("the index program is off by more than 1e-9 K")
    return {"index_vs_c": best["ours"] / best["c"]}


START = """
import time
from benchmarks.integrator import frame, initial_of, motor, wltp_like
from replay.engine.results.kernel_cache import load, load_kernel
from twin.arithmetic.vectors import LANES
from twin.run.simulate import simulate
network = motor("reference_motor")
inputs = frame(network, wltp_like(), 0.5)
began = time.process_time()
simulate(load_kernel(network), inputs, initial_of(network))
print(time.process_time() - began)
"""


def starts(folder: Path) -> dict[str, float]:
    """A first and a later start, in processes of their own; the best of two later ones."""
    environment = {**os.environ, "WHYHOT_CACHE": str(folder / "cache")}

    def seconds() -> float:
        done = subprocess.run(
            [sys.executable, "-c", START], cwd=HERE.parent, env=environment, capture_output=True, text=True, check=True
        )
        return float(done.stdout)

    first = seconds()
    return {"compile_s": first, "cached_start_s": min(seconds(), seconds())}


def measured(rounds: int, quick: bool) -> dict[str, float | None]:
    """Every ratio by its name."""
    from benchmarks.filter_speed import ratios  # it takes tests/ in, for a model that they share

    sessions, steps, slices, peers_steps = (8, 600, 4, 60) if quick else (64, 10_800, 12, 600)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found: dict[str, float | None] = {
            **one_session(rounds, folder),
            **many_sessions(rounds, sessions, steps),
            **starts(folder),
        }
        found |= {**many_nodes(rounds, folder, slices), **ratios(rounds, peers_steps)}
    return found


def main() -> None:
    said = asked.parser(__doc__, rounds=(25, 1)).parse_args()
    found = measured(said.rounds, said.quick)
    for line in table(found):
        print(line)
    asked.keep(found, said.json)


def table(found: Mapping[str, float | None]) -> list[str]:
    """What has a target, then the rest."""
    lines = [f"{'':<34}{'measured':>10}   shall be"]
    for name, (target, at_least) in TARGETS.items():
        value = found.get(name)
        wanted = f"at {'least' if at_least else 'most'} {target:g}"
        if value is None:
            lines.append(f"{name:<34}{'-':>10}   {wanted:<16} no gcc here")
        else:
            met = value >= target if at_least else value <= target
            lines.append(f"{name:<34}{value:>10.3g}   {wanted:<16} {'met' if met else 'NOT MET'}")
    return [*lines, *(f"{name:<34}{value:>10.3g}" for name, value in found.items() if name not in TARGETS and value)]


if __name__ == "__main__":
    main()
