"""Questions that want more than they may, formulas in a log, and a network that must not be asked for."""

from __future__ import annotations

import os
import subprocess
import sys

import duckdb
import numpy as np

from benchmarks.attack import subjects
from benchmarks.attack.children import Verb
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.formats._mdf_conversions import conversion
from made.escapes import ESCAPES, SECRET
from made.places import ROOT

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
OFFLINE = """
import sys
NETWORK = ("socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.bind", "socket.sendto")
def refuse(event, args):
    if event in NETWORK:
        raise RuntimeError(f"the network was asked for: {event} {args[1:]}")
sys.addaudithook(refuse)
"""  # run in each process that is started, as its `sitecustomize`


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
    """T24: verbs in a process in which whatever touches a network ends it, and in all processes that it starts."""
    outcome, started = Outcome(), arena.folder / "started"
    folder = subjects.copied(arena.bench, arena.folder / "bench")
    started.mkdir()
    (started / "sitecustomize.py").write_text(OFFLINE, encoding="utf-8")

    def offline() -> None:
        os.environ["PYTHONPATH"] = os.pathsep.join([str(started), str(ROOT)])
        exec(OFFLINE, {})  # noqa: S102 -- our own text

    asks = [sys.executable, "-c", "import socket; socket.create_connection(('192.0.2.1', 9))"]
    child = subprocess.run(asks, env={"PYTHONPATH": str(started)}, capture_output=True, text=True, check=False)
    if "the network was asked for" not in child.stderr:
        outcome.failed.append("a process that is started may reach a network")
    for words in ASKED[: max(arena.tries, 4)]:
        code, said = Verb(words, folder).ended(offline)
        outcome.count(
            *[f"{' '.join(words)}: exit code {code}: {said[-300:]}"] * (code not in (0, 1) or "network" in said)
        )
    outcome.note = "verbs, with the processes that they start; sockets of Python"
    return outcome


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
