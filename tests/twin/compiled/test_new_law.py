"""A new law of a link is one row of `twin.motor.heat_laws.LINKS`: a copy of that module with one row more, put in its
place before anything else is imported, is all that every program needs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from made.places import ROOT

LINES = ("gap = far - own", "drop = gap * math.sqrt(1.0 + 0.02 * gap * gap) * (1.0 + 0.004 * far)")
ROW = f"""    "thermosiphon": {LINES},
"""

CODE = """
import sys, types
from pathlib import Path

root = Path(sys.argv[1])
text = (root / "twin/motor/heat_laws.py").read_text()
before = '    "radiation": ('
assert text.count(before) == 1
module = types.ModuleType("twin.motor.heat_laws")
sys.modules["twin.motor.heat_laws"] = module
exec(compile(text.replace(before, sys.argv[2] + before), "<with a row more>", "exec"), module.__dict__)

import numpy as np
from scipy.integrate import solve_ivp
from twin.compiled.heat import heat
from twin.compiled.kernel import compile_indexed, compile_network
from twin.compiled.laid_out import laid_out
from twin.compiled.laws import psi
from twin.filters.ekf import filter_unknowns
from twin.filters.inputs import FilterStart
from twin.filters.unknowns import UnknownHeat
from twin.motor.network import Boundary, Link, Network, Node, Source, TemperatureFactor, Term
from twin.run.gradients import gradient
from twin.run.losses import heat_flows
from twin.run.simulate import Frame, simulate
from twin.run.sparse_march import run

def drop(own, far):
    gap = far - own
    return gap * (1 + 0.02 * gap**2) ** 0.5 * (1 + 0.004 * far)

# the function that index program, filters and march call
number = module.NUMBER["thermosiphon"]
assert number == 1 and "thermosiphon" in module.NAMED
for own, far in ((30.0, 90.0), (80.0, 25.0), (40.0, 40.0)):
    value, by_own, by_far, by_other = heat(number, 2.0, own, far, 50.0, 0.0, 20.0, 0.01, 40.0, 1.0, 0.0)
    h = 1e-5
    np.testing.assert_allclose(value, 2 * 1.1 * drop(own, far), rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(by_own, 2.2 * (drop(own + h, far) - drop(own - h, far)) / (2 * h), rtol=1e-7)
    np.testing.assert_allclose(by_far, 2.2 * (drop(own, far + h) - drop(own, far - h)) / (2 * h), rtol=1e-7)
    np.testing.assert_allclose(by_other, 2 * 0.01 * drop(own, far), rtol=1e-14, atol=1e-14)

# a network of such links, with and without a temperature factor, between nodes and to a boundary
network = Network(
    "siphon",
    (Node("a", 300.0, "other"), Node("b", 500.0, "other"), Node("c", 400.0, "other")),
    (Boundary("ambient"),),
    (
        Link("a", "b", (Term(0.4, law="thermosiphon", temperature=TemperatureFactor("c", 0.003, 40.0)),)),
        Link("b", "c", (Term(2.0),)),
        Link("c", "ambient", (Term(0.3, law="thermosiphon"),)),
    ),
    (Source("a", (Term(200.0),)),),
)
nodes, h, steps = len(network.nodes), 0.5, 240
frame, start = Frame(h, np.empty((steps, 0)), np.full((steps, 1), 25.0)), np.array([90.0, 40.0, 60.0])

def rate(_, T):
    a, b, c = T
    ab, cx = 0.4 * (1 + 0.003 * (c - 40)) * drop(a, b), 0.3 * drop(c, 25.0)
    # of two nodes, or of a node and a boundary, the first in the order of all of them is the one that takes the heat
    return [(200 + ab) / 300, (-ab + 2 * (c - b)) / 500, (2 * (b - c) + cx) / 400]

truth = solve_ivp(rate, (0, steps * h), start, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
compiled = compile_network(network)
straight = simulate(compiled, frame, start)
np.testing.assert_allclose(straight[-1], truth, rtol=0, atol=1e-3)
assert compiled.form == "straight-line"
np.testing.assert_allclose(simulate(compile_indexed(network), frame, start), straight, rtol=0, atol=1e-10)
unknown = [UnknownHeat("a", 1.0, 1.0)]
filtered = filter_unknowns(network, frame, FilterStart(start, np.ones(nodes)), unknown, [])
np.testing.assert_allclose(filtered.temperatures, straight, rtol=0, atol=1e-10)

# the march
_, values, program, laws, table = laid_out(network)
names = [node.name for node in network.nodes]
ran = run(program, False, values, h, frame.features, frame.boundaries, start, names)
np.testing.assert_allclose(ran.edges[-1], truth, rtol=0, atol=1e-3)
of_step = psi(table, ran.means, frame.boundaries)[0]
for law, found in zip(laws, of_step, strict=True):
    if law.law == "thermosiphon":
        every = np.column_stack([ran.means, frame.boundaries])
        factor = 1 + 0.003 * (ran.means[:, 2] - 40) if law.other >= 0 else 1.0
        np.testing.assert_allclose(found, factor * drop(every[:, law.a], every[:, law.b]), rtol=1e-12)

# the account of its heat closes, and the gradient kernel has its second slopes
flows = heat_flows(network, frame, straight)
stored = values.capacities @ (straight[-1] - start)
np.testing.assert_allclose((flows.made.sum() - flows.boundaries.sum()) * h, stored, rtol=1e-11)
weights = np.zeros_like(straight)
weights[-1, 1] = 1.0
by_start = gradient(compiled, frame, straight, weights).initial
for i in range(nodes):
    moved = [simulate(compiled, frame, start + sign * 1e-3 * np.eye(nodes)[i])[-1, 1] for sign in (1, -1)]
    np.testing.assert_allclose(by_start[i], (moved[0] - moved[1]) / 2e-3, rtol=1e-6)
print("every program has it")
"""


def test_a_new_law_of_a_link_is_one_row_and_every_program_has_it(tmp_path: Path) -> None:
    """In a process of its own, for which numba has kept nothing; to optimise what runs once would only take longer."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_OPT": "0"}
    command = [sys.executable, "-c", CODE, str(ROOT), ROW]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "every program has it"
