"""Commands in an order that nobody thought of, against a model of what a store is to say after each."""

from __future__ import annotations

import io
import json
import os
import random
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from benchmarks.attack import subjects
from benchmarks.attack.children import Verb, killed_within
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.facts import facts
from ingest.facts.durable import sha256_of
from ingest.facts.store import Store
from replay.cli import main

STEPS = 40  # of a sequence at most
ROWS = 8
WHY = ("--reason", "drawn")
STANDS, BACK, FORGOTTEN = "stands", "taken back", "forgotten"
WRONG = 2  # exit code of what cannot be done


@dataclass(frozen=True)
class Logged:
    """What the model knows of a log."""

    name: str
    specimen: str
    state: str = STANDS


@dataclass
class Bench:
    """A folder with a store, and the model of it: logs by their SHA-256; `then`: some numbers of events, and what the
    model said there."""

    folder: Path
    chance: random.Random
    logs: dict[str, Logged] = field(default_factory=dict)
    then: list[tuple[int, set[tuple[str, str]]]] = field(default_factory=list)
    made: int = 0
    did: list[str] = field(default_factory=list)

    def run(self, *words: str) -> tuple[int, str]:
        """Exit code and standard output of a command."""
        out = io.StringIO()
        self.did.append(" ".join(words))
        with redirect_stdout(out), redirect_stderr(io.StringIO()):
            code = main(list(words))
        return code, out.getvalue()

    def wants(self, code: int, *words: str) -> None:
        """Raises AssertionError where a command ends otherwise."""
        found, _ = self.run(*words)
        assert found == code, f"exit code {found}, not {code}"

    def drawn(self) -> str:
        """A log that the store has seen; a new one where there is none."""
        if not self.logs:
            new(self)
        return self.chance.choice(sorted(self.logs))

    def put(self, sha256: str, **changed: Any) -> None:
        self.logs[sha256] = replace(self.logs[sha256], **changed)

    @property
    def says(self) -> set[tuple[str, str]]:
        """Name and specimen of each session, by the model."""
        return {(one.name, one.specimen) for one in self.logs.values() if one.state == STANDS}

    @property
    def found(self) -> set[tuple[str, str | None]]:
        """The same by the store."""
        with Store.open(self.folder / "store") as store:
            known = facts.at(store.ledger)
            return {(known.files[one.files[0]["raw"]].name, one.specimen) for one in known.sessions}

    def told(self, *more: str) -> set[tuple[str, str]]:
        """The same by `whyhot sessions`."""
        code, said = self.run("sessions", "--json", *more)
        assert code == 0, f"exit code {code}"
        return {(one["sources"][0], one["specimen"]) for one in json.loads(said)["sessions"]}


def new(bench: Bench) -> None:
    bench.wants(0, *_drawn_log(bench))


def _drawn_log(bench: Bench) -> tuple[str, ...]:
    """The command that ingests a log which the model knows from here on."""
    bench.made += 1
    path = bench.folder / f"log{bench.made}.csv"
    subjects.write_table(path, ROWS, seed=bench.made)
    specimen = bench.chance.choice("ABC")
    bench.logs[sha256_of(path)] = Logged(path.name, specimen)
    return ("ingest", path.name, "--specimen", specimen)


def again(bench: Bench) -> None:
    """The same bytes, under their own name or another."""
    log = bench.logs[bench.drawn()]
    name = bench.chance.choice([log.name, f"other-{log.name}"])
    shutil.copy(bench.folder / log.name, bench.folder / "given.csv")
    (bench.folder / "given.csv").replace(bench.folder / name)
    bench.wants(0 if log.state == STANDS else 1, "ingest", name)


def corrected(bench: Bench) -> None:
    sha256, specimen = bench.drawn(), bench.chance.choice("ABC")
    log = bench.logs[sha256]
    right = log.state == STANDS and log.specimen != specimen
    bench.wants(0 if right else WRONG, "correct", sha256[:16], "--specimen", specimen, *WHY)
    bench.put(sha256, specimen=specimen if right else log.specimen)


def taken_back(bench: Bench) -> None:
    sha256 = bench.drawn()
    stands = bench.logs[sha256].state == STANDS
    bench.wants(0 if stands else WRONG, "retract", sha256[:16], *WHY)
    bench.put(sha256, state=BACK if stands else bench.logs[sha256].state)


def brought_back(bench: Bench) -> None:
    sha256 = bench.drawn()
    back = bench.logs[sha256].state == BACK
    bench.wants(0 if back else WRONG, "retract", sha256[:16], "--undo", *WHY)
    bench.put(sha256, state=STANDS if back else bench.logs[sha256].state)


def forgotten(bench: Bench) -> None:
    sha256 = bench.drawn()
    bench.wants(0, "forget", sha256[:16], *WHY)
    bench.put(sha256, state=FORGOTTEN)


def remembered(bench: Bench) -> None:
    """As of now, and of the moments before: asked for again later."""
    with Store.open(bench.folder / "store") as store:
        bench.then.append((store.ledger.head().position, bench.says))
    position, said = bench.chance.choice(bench.then)
    assert bench.told("--as-of", str(position)) == said, f"as of {position} other sessions"


def backed_up(bench: Bench) -> None:
    """A backup, and at times a store made of it, which must say the same."""
    bench.wants(0, "backup", "copy")
    if bench.chance.random() < 0.3:
        bench.wants(0, "restore", "copy", "--store", "new")
        assert bench.told("--store", "new") == bench.says, "restored, other sessions"
        shutil.rmtree(bench.folder / "new")


def rebuilt(bench: Bench) -> None:
    bench.wants(0, "rebuild", "--verify")


def killed(bench: Bench) -> None:
    """A new log, killed on its way in; then the same command."""
    words = _drawn_log(bench)
    killed_within(Verb(words, bench.folder).start(), bench.chance.uniform(0, 0.3))
    bench.wants(0, *words)


def exported(bench: Bench) -> None:
    log = bench.logs[bench.drawn()]
    bench.wants(
        0 if log.state == STANDS else WRONG, "export", log.name.removesuffix(".csv"), "--to", "csv", "-o", "out"
    )
    if log.state == STANDS:
        rows = (bench.folder / "out").read_text().splitlines()[1:]
        (bench.folder / "out").unlink()
        assert len(rows) == ROWS, f"{len(rows)} rows exported"


def verified(bench: Bench) -> None:
    bench.wants(0, "verify", "--read")


Rule = Callable[[Bench], None]
Step = tuple[Rule, int]  # and what it draws from
RULES: tuple[tuple[int, Rule], ...] = (
    *((5, new), (3, again), (3, corrected), (3, taken_back), (3, brought_back), (1, forgotten), (3, remembered)),
    *((1, backed_up), (1, rebuilt), (2, killed), (2, exported), (1, verified)),
)


def sequences(arena: Arena) -> Outcome:
    """T13: each step is a try; where one fails its sequence ends, and is made as short as it still fails."""
    outcome, chance = Outcome(), arena.chance
    rules, weights = [rule for _, rule in RULES], [weight for weight, _ in RULES]
    for number, first in enumerate(range(0, arena.tries, STEPS)):
        count = min(STEPS, arena.tries - first)
        steps = [(rule, chance.randrange(2**32)) for rule in chance.choices(rules, weights, k=count)]
        done, says = _run(steps, arena.folder / "run")
        outcome.tried += done
        if says:
            outcome.count(f"run {number}: {_run(_shortest(steps, arena.folder / 'run'), arena.folder / 'run')[1]}")
    outcome.note = f"sequences of {STEPS} steps, of {len(RULES)} kinds"
    return outcome


def _shortest(steps: Sequence[Step], folder: Path) -> Sequence[Step]:
    """Steps that still fail, though not without any one of them."""
    left = 0
    while left < len(steps):
        fewer = [*steps[:left], *steps[left + 1 :]]
        if _run(fewer, folder)[1]:
            steps = fewer
        else:
            left += 1
    return steps


def _run(steps: Sequence[Step], folder: Path) -> tuple[int, str]:
    """How many of them were done as they must, and what was wrong with the next, with all commands of it."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    os.chdir(folder)
    os.environ["WHYHOT_STORE"] = "store"
    bench, done = Bench(folder, random.Random(0)), 0
    try:
        for _ in _each(bench, steps):
            done += 1
    except AssertionError as error:
        return done, f"{'; '.join(bench.did)}: {error}"
    finally:
        os.chdir(folder.parent)
    return done, ""


def _each(bench: Bench, steps: Sequence[Step]) -> Iterator[Rule]:
    """A sequence; after each step the store is asked for its sessions, and at the end for every byte. Each draws from
    its own seed, so that it does the same where others are left out."""
    new(bench)
    for rule, seed in steps:
        bench.chance = random.Random(seed)
        rule(bench)
        assert bench.found == bench.says, f"{rule.__name__}: {bench.found} in place of {bench.says}"
        yield rule
    assert not (wrong := subjects.damages(bench.folder / "store")), wrong[0]
    with Store.open(bench.folder / "store") as store:
        kept = {sha256 for sha256, log in bench.logs.items() if log.state != FORGOTTEN}
        assert {*store.archive} & bench.logs.keys() == kept, "bytes of a forgotten log are there, or others are gone"


ATTACKS = (Attack("T13", "commands in random order", "as a model of the store says", 500 * STEPS, 15, sequences),)
