"""The numbers between a log and a run's digest have the same bits on every processor, or a run would not verify on
another one."""

from __future__ import annotations

import ast
import os
import subprocess
import sys

import numpy as np
import pytest

from made.places import ROOT

FEED = (  # what a run's features and coefficients go through, in the order of a sample's way
    *(
        "ingest/log/bits.py",
        "ingest/log/held.py",
        "ingest/texts/units.py",
        "ingest/bench/corrections.py",
        "ingest/bench/laws.py",
        "ingest/log/decode.py",
    ),
    *("ingest/texts/powers.py", "ingest/texts/expressions.py", "ingest/log/samples.py"),
    *(
        "replay/engine/frame/inputs.py",
        "replay/engine/frame/frame.py",
        "replay/engine/frame/frame_of.py",
        "replay/engine/specimen/aged.py",
    ),
    *("twin/arithmetic/powers.py", "twin/motor/features.py", "twin/motor/heat_laws.py", "twin/motor/outputs.py"),
    *(
        "twin/run/initial.py",
        "twin/insulation/ageing_state.py",
        "twin/compiled/indexed.py",
        "twin/run/simulate.py",
        "twin/compiled/integrators.py",
        "twin/run/losses.py",
    ),
)
EXACT = {"sqrt", "fabs", "floor", "ceil", "fmod", "trunc", "isfinite", "isnan", "factorial", "inf", "nan", "pi"}
CHANGING = {  # of numpy: with the processor's vectors or the system's library
    *{"exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "power", "pow", "float_power", "hypot", "cbrt"},
    *{"sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "logaddexp"},
}


def changing(tree: ast.AST) -> list[str]:
    """What of a module may differ from processor to processor, with its line."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            library = node.value.id
            if (library == "np" and node.attr in CHANGING) or (library == "math" and node.attr not in EXACT):
                found.append(f"{library}.{node.attr}, line {node.lineno}")
        if isinstance(node, ast.ImportFrom) and node.module in ("math", "cmath", "numpy", "scipy.special"):
            found.append(f"from {node.module} import, line {node.lineno}")
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Pow) and not _exact(node):
            found.append(f"{ast.unparse(node)}, line {node.lineno}")
    return found


def _exact(node: ast.BinOp | ast.AugAssign) -> bool:
    """A square, which numpy and Python multiply; or powers of whole numbers and of two, of which every one is a
    number."""
    exponent = node.right if isinstance(node, ast.BinOp) else node.value
    if isinstance(exponent, ast.Constant) and exponent.value == 2:
        return True
    base = node.left if isinstance(node, ast.BinOp) else node.target
    return isinstance(base, ast.Constant) and base.value in (2, 2.0)


@pytest.mark.parametrize("module", FEED)
def test_what_feeds_a_run_calls_nothing_that_changes_with_the_processor(module: str) -> None:
    assert changing(ast.parse((ROOT / module).read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    "line",
    ["np.hypot(a, b)", "np.float_power(a, b)", "a**0.5", "a**n", "a **= 1.6", "np.exp(a)", "math.exp(a)", "np.log(a)"],
)
def test_a_return_of_such_a_call_is_seen(line: str) -> None:
    assert changing(ast.parse(line))


def test_squares_and_roots_may_stay() -> None:
    assert not changing(ast.parse("x = a**2 + np.sqrt(b) * 2**53 + math.sqrt(c)"))


CODE = """
import hashlib
import numba
import numpy as np
from ingest.texts.expressions import parse
from twin.insulation.ageing_state import State
from twin.motor.features import Monomial, evaluate
from twin.motor.observables import lagged_means
from twin.arithmetic.powers import exp_of_number

@numba.njit(error_model="numpy")
def compiled(x):
    total = 0.0
    for value in x:
        total += exp_of_number(value)
    return total

random = np.random.default_rng(3)
a, b = random.normal(0.0, 300.0, 20_000), random.normal(0.0, 300.0, 20_000)
derived = parse("hypot(a, b) / sqrt(2) + abs(a)**1.3 + abs(b)**(a / 300)").evaluate({"a": a, "b": b})
products = Monomial((("speed", 1.6),)), Monomial((("current", 0.8), ("speed", 2.0)))
laws = evaluate(products, {"speed": a, "current": b}, a.size)
factors = [State(1.0, x / 1000, 0.0, 0.0, 0.0, 0.0).factor for x in a[:200]]
rest = [*factors, compiled(a / 100.0), *lagged_means(b, 3.0, 0.5)]
print(hashlib.sha256(np.concatenate([derived, laws.ravel(), rest]).tobytes()).hexdigest())
"""


def _digest(**processor: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **processor}
    done = subprocess.run([sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_processor_without_wide_vectors_or_fused_products_gives_the_same_bits() -> None:
    """The libraries are told of an older processor than there is, as far as they can be."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    older = _digest(
        GLIBC_TUNABLES="glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F",
        NPY_DISABLE_CPU_FEATURES=" ".join(found),
        NUMBA_CPU_NAME="generic",
        NUMBA_CPU_FEATURES="",
        OPENBLAS_NUM_THREADS="1",
    )
    assert older == _digest(OPENBLAS_NUM_THREADS="1")
