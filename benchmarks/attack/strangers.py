"""Questions that want more than they may, formulas in a log, and a network that must not be asked for."""

from __future__ import annotations

import sys
from typing import Any

import duckdb
import numpy as np

from benchmarks.attack import subjects
from benchmarks.attack.children import Verb
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.formats._mdf_conversions import conversion
from made.escapes import ESCAPES, SECRET

FORMULAS = (
    "__import__('os').system('touch stolen')",
    "(lambda: X)()",
    "X.__class__.__mro__",
    "eval('X')",
    "open('/etc/passwd').read()",
    "[X for X in (1,)]",
    "X if X else 1",
    "X; import os",
    "Y + 1",
    "X" + "(" * 5000,
)
ALGEBRAIC = 3  # kind of an MDF conversion
ASKED = (
    ("ingest", "--bench", "bench.toml", "--dbc", "bench.dbc", "3_s2.csv"),
    *(
        ("sessions",),
        ("show", "1_s1"),
        ("inspect", "1_s1.blf"),
        ("replay", "2_drive"),
        ("report", "1_s1"),
        ("sql", "FROM runs"),
    ),
    *(("export", "1_s1", "--to", "csv"), ("morning", "."), ("lineage", "1_s1"), ("stale",), ("head",)),
    *(("rebuild",), ("verify", "--read"), ("backup", "other"), ("doctor",), ("motor", "check", "motor.toml")),
)
NETWORK = ("socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.bind", "socket.sendto")


def questions(arena: Arena) -> Outcome:
    """T21."""
    outcome = Outcome()
    folder = subjects.copied(arena.bench, arena.folder / "bench")
    outside, other = folder / "outside.csv", folder / "other.duckdb"
    outside.write_text(f"secret\n{SECRET}\n")
    with duckdb.connect(str(other)) as database:
        database.execute(f"CREATE TABLE s AS SELECT '{SECRET}' AS secret")
    raw = next((folder / "store" / "decoded").glob("*/*.parquet"))
    words = {"outside": outside, "inside": raw.parent, "raw": raw, "db": other}
    Verb(["sql", "FROM sessions"], folder).ended()
    before = sorted(path for path in folder.rglob("*") if path.name != "said.txt")
    chosen = arena.chance.sample(ESCAPES, min(arena.tries, len(ESCAPES)))
    for text in chosen:
        sql = text.format(**{word: str(path) for word, path in words.items()})
        code, said = Verb(["sql", sql], folder).ended()
        after = sorted(path for path in folder.rglob("*") if path.name != "said.txt")
        right = code == 2 and SECRET not in said and len(said.splitlines()) == 1 and after == before
        outcome.count(*[f"{sql}: exit code {code}: {said[-200:]}"] * (not right))
    for formula in FORMULAS:
        refused = conversion(ALGEBRAIC, np.zeros(0), [], formula).refused is not None
        outcome.count(*[f"the formula {formula} was taken"] * (not refused))
    outcome.note = f"{len(chosen)} questions, {len(FORMULAS)} formulas of MDF"
    return outcome


def network(arena: Arena) -> Outcome:
    """T24: verbs in a process in which whatever touches a network ends it."""
    outcome = Outcome()
    folder = subjects.copied(arena.bench, arena.folder / "bench")
    for words in ASKED[: max(arena.tries, 4)]:
        code, said = Verb(words, folder).ended(lambda: sys.addaudithook(_refuse))
        outcome.count(
            *[f"{' '.join(words)}: exit code {code}: {said[-300:]}"] * (code not in (0, 1) or "network" in said)
        )
    outcome.note = "verbs; not their child that reads logs, nor the tests"
    return outcome


def _refuse(event: str, args: tuple[Any, ...]) -> None:
    if event in NETWORK:
        raise RuntimeError(f"the network was asked for: {event} {args[1:]}")


ATTACKS = (
    Attack(
        "T21",
        "questions and formulas that want more",
        "refused in one line, nothing read or written",
        len(ESCAPES) + len(FORMULAS),
        4,
        questions,
    ),
    Attack("T24", "no network", "no verb asks for it", len(ASKED), 4, network),
)
