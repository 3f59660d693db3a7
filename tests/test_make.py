"""The targets of the Makefile name what is there."""

from __future__ import annotations

import re
import subprocess

import pytest

from made.places import ROOT

MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")


def _words(variable: str) -> list[str]:
    found = re.search(rf"^{variable} := (.*)$", MAKEFILE, re.MULTILINE)
    assert found
    return found[1].split()


@pytest.mark.parametrize("variable", ["QUICK", "SLOW"])
def test_what_make_quick_runs_and_leaves_out_is_there(variable: str) -> None:
    assert _words(variable)
    assert [name for name in _words(variable) if not (ROOT / "tests" / name).exists()] == []


def test_make_runs_every_benchmark() -> None:
    said = subprocess.run(
        ["make", "-n", "bench", "trials"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    every = {f"benchmarks/{path.name}" for path in (ROOT / "benchmarks").glob("*.py")}
    assert set(re.findall(r"benchmarks/\w+\.py", said)) == every - {"benchmarks/asked.py", "benchmarks/shared.py"}
