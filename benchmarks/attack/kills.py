"""Commands that are stopped (killed at a random moment or before each change of a disk, interrupted by Ctrl-C), or run
under a clock that jumps.

After each the store must verify with nothing of before changed, and the same command again must leave what one that
was not stopped leaves.
"""

from __future__ import annotations

import json
import random
import re
import signal
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from io import RawIOBase
from pathlib import Path
from typing import Any

from benchmarks.attack import children, subjects
from benchmarks.attack.children import Verb
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.facts.chain import Head

STORES = ("store", "copy", "new")


@dataclass(frozen=True)
class Whole:
    """A command that nothing stops: its words, the folder that it starts from (`ready`) and the head of its store, what
    that folder's stores say after it, how long it takes, how many changes of a disk it makes, and how often it opens a
    file or reads of one; `answer`: what it says, where it only reads."""

    verb: str
    words: Sequence[str]
    ready: Path
    head: Head
    means: dict[str, list[str]]
    seconds: float
    changes: int
    reads: int
    answer: str

    def fresh(self, folder: Path) -> Verb:
        """The same command in a new folder."""
        return Verb(self.words, subjects.copied(self.ready, folder / self.verb))

    def wrong(self, stopped: Verb, how: str, named: str = "") -> str:
        """What is wrong after the command was stopped, but for sealed files that it `named` itself, and after the same
        again; empty where nothing is."""
        for store in STORES:
            since = self.head if store == "store" else None
            for line in subjects.damages(stopped.folder / store, since):
                if not any(sha256 in named for sha256 in re.findall("[0-9a-f]{64}", line)):
                    return f"{how}: {store}: {line}"
        code, said = stopped.ended()
        if self.answer and said != self.answer:
            return f"{how}, then again (exit code {code}), says: {said[-300:]}"
        means = _means(stopped.folder)
        if means != self.means:
            other = {line for all_of in (means, self.means) for lines in all_of.values() for line in lines}
            other -= {line for store in STORES for line in {*means.get(store, [])} & {*self.means.get(store, [])}}
            return f"{how}, then again (exit code {code}), differs: {sorted(other)[:3]}: {said[-300:]}"
        return "Traceback" if "Traceback" in said else ""


def wholes(arena: Arena, of: Collection[str] = tuple(subjects.WRITING)) -> list[Whole]:
    """So many of these verbs as there are tries, drawn, or all. Raises RuntimeError where one fails."""
    verbs = arena.verbs or [*of]
    return [_whole(arena, verb) for verb in arena.chance.sample(verbs, min(arena.tries, len(verbs)))]


def _whole(arena: Arena, verb: str) -> Whole:
    """Done by whichever attack asks first."""
    ready, kept = (arena.bench.with_name(name) for name in (verb, f"{verb}.json"))
    if not kept.exists():
        kept.write_text(json.dumps(_once(arena, verb, ready)))
    return Whole(verb=verb, ready=ready, head=subjects.head(ready / "store"), **json.loads(kept.read_text()))


def _once(arena: Arena, verb: str, ready: Path) -> dict[str, Any]:
    words = subjects.VERBS[verb].prepared(subjects.copied(arena.bench, ready)).words
    once, calls = Verb(words, subjects.copied(ready, arena.folder / "once")), arena.folder / "calls.txt"
    with calls.open("wb", buffering=0) as file:

        def count() -> None:
            children.at_change(0, partial(_noted, file, b"c"), on=True)
            children.at_read(0, partial(_noted, file, b"r"), on=True)

        began = time.monotonic()
        code, said = once.ended(count)
        seconds = time.monotonic() - began
    if code:
        raise RuntimeError(f"{verb}: {code}: {said}")
    made = calls.read_bytes()
    counts = {"changes": made.count(b"c"), "reads": made.count(b"r")}
    answer = said if verb in subjects.READING else ""
    return {"words": words, "means": _means(once.folder), "seconds": seconds, "answer": answer, **counts}


def _noted(file: RawIOBase, letter: bytes, _: str) -> None:
    file.write(letter)


def _means(folder: Path) -> dict[str, list[str]]:
    return {name: subjects.meaning(folder / name) for name in STORES if (folder / name / "store.json").exists()}


def at_random(arena: Arena) -> Outcome:
    """T1."""
    chance, outcome, died = arena.chance, Outcome(), 0
    subject = wholes(arena)
    for number in range(arena.tries):
        whole = subject[number % len(subject)]
        delay = chance.uniform(0.0, 1.1 * whole.seconds)
        verb = whole.fresh(arena.folder)
        died += children.killed_within(verb.start(), delay) == children.KILLED
        outcome.count(*filter(None, [whole.wrong(verb, f"{whole.verb} killed after {delay:.3f} s")]))
    outcome.note = f"{len(subject)} verbs; {died} were still running"
    return outcome


def at_each_change(arena: Arena) -> Outcome:
    """T2: all of them where `tries` allows."""
    subject = wholes(arena)
    points = [(whole, number) for whole in subject for number in range(whole.changes)]
    outcome = Outcome(whole=len(points) * len(subjects.WRITING) // len(subject))
    for whole, number in arena.chance.sample(points, min(arena.tries, len(points))):
        verb = whole.fresh(arena.folder)
        code, said = verb.ended(_dies_at(number))
        how = f"{whole.verb} killed before change {number}"
        lost = [] if code == children.KILLED else [f"{how}: it ended with {code}: {said[-200:]}"]
        outcome.count(*lost, *filter(None, [whole.wrong(verb, how)]))
    outcome.note = f"changes of a disk: {', '.join(f'{whole.verb} {whole.changes}' for whole in subject)}"
    return outcome


def at_wrong_times(arena: Arena) -> Outcome:
    """T25."""
    outcome, subject = Outcome(), wholes(arena)
    for number in range(arena.tries):
        whole = subject[number % len(subject)]
        verb, draw = whole.fresh(arena.folder), f"{arena.seed}, {number}"
        code, said = verb.ended(partial(children.at_wrong_times, random.Random(draw)))
        how = f"{whole.verb} under a clock that jumps ({draw})"
        refused = [f"{how}: exit code {code}: {said[-200:]}"] * (code != 0)
        outcome.count(*refused, *filter(None, [whole.wrong(verb, how)]))
    outcome.note = f"{len(subject)} verbs; by up to ten years, otherwise at each look at the clock"
    return outcome


def _dies_at(number: int) -> Callable[[], None]:
    return lambda: children.at_change(number, children.die)


def interrupted(arena: Arena) -> Outcome:
    """T18: Ctrl-C ends with exit code 130 and without a traceback, where it came in time."""
    chance, outcome, came = arena.chance, Outcome(), 0
    subject = wholes(arena)
    for number in range(arena.tries):
        whole = subject[number % len(subject)]
        delay = chance.uniform(0.0, whole.seconds)
        verb = whole.fresh(arena.folder)
        code = children.killed_within(verb.start(), delay, signal.SIGINT)
        said, how = verb.said.read_text(errors="replace"), f"{whole.verb} interrupted after {delay:.3f} s"
        came += code == 130
        trace = said.find("Traceback")
        bad = [f"{how}: exit code {code}: {said[max(trace - 300, 0) :][:1200]}"] * (code not in (0, 130) or trace >= 0)
        outcome.count(*bad, *filter(None, [whole.wrong(verb, how)]))
    outcome.note = f"{came} came before the end"
    return outcome


ATTACKS = (
    Attack("T1", "kill -9 at a random time", "nothing lost; the same command finishes it", 2000, 1, at_random),
    Attack("T2", "kill -9 before a change of a disk", "as T1", 600, 1, at_each_change),
    Attack("T18", "Ctrl-C", "exit code 130, no traceback, the same command finishes it", 200, 1, interrupted),
    Attack(
        "T25",
        "a clock that jumps",
        "nothing else than under a right one; events keep their order",
        160,
        1,
        at_wrong_times,
    ),
)
