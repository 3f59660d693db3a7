"""What other programs here try, called from the same table: readers beside ours, and stores of earlier versions."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.attack.outcome import Arena, Attack, Outcome
from made.places import ROOT

COUNTED = re.compile(r"(\d+) (passed|failed|error)")
LISTED = {
    "can_db": 1
}  # format -> records that differ, and why that is right: python-can takes CAN FD for classic there


def second_reader(arena: Arena) -> Outcome:
    """T12: `benchmarks/conformance.py` on the files that it makes. A file is one try."""
    if not arena.tries:
        return Outcome()
    answer = arena.folder / "answer.json"
    command = [sys.executable, str(ROOT / "benchmarks" / "conformance.py"), "--quick", "--json", str(answer)]
    done = subprocess.run(command, cwd=arena.folder, capture_output=True, text=True, check=False)
    if done.returncode:
        return Outcome(1, [done.stderr[-500:]])
    rows = json.loads(answer.read_text())
    failed = [
        f"{row['format']}: {first}"
        for row in rows
        for first in row["first"]
        if row["differ"] > LISTED.get(row["format"], 0)
    ]
    equal = sum(row["equal"] for row in rows)
    return Outcome(
        sum(row["files"] for row in rows), failed, f"{equal:,} records and messages equal, {len(rows)} formats"
    )


def tests_of(*paths: str) -> Callable[[Arena], Outcome]:
    """An attack that is these tests."""

    def run(arena: Arena) -> Outcome:
        if not arena.tries:
            return Outcome()
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"--basetemp={arena.folder / 'own'}"]
        done = subprocess.run([*command, *paths], cwd=ROOT, capture_output=True, text=True, check=False)
        counts = {what: int(count) for count, what in COUNTED.findall(done.stdout[-500:])}
        bad = counts.get("failed", 0) + counts.get("error", 0)
        failed = [f"{paths[0]}: {done.stdout[-400:]}"] * max(bad, int(done.returncode != 0))
        return Outcome(counts.get("passed", 0) + bad, failed, ", ".join(Path(path).name for path in paths))

    return run


ATTACKS = (
    Attack("T12", "a second reader", "the same values, or named", 26, 0, second_reader),
    Attack("T22", "old stores", "opened, verified, read as they were written", 10, 0, tests_of("tests/test_stores.py")),
)
