"""What was said wrongly of a log, said anew by a person, with a reason; its sealed bytes are read again if need be."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ingest.bench.bench_file import Bench
from ingest.errors import CorrectionError, DamageError
from ingest.facts import facts as ledger_facts
from ingest.facts import sessions
from ingest.facts.events import DecodeCompleted, LogCorrected
from ingest.facts.facts import Facts
from ingest.facts.named import NamedFact, find
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.attachments import in_words
from ingest.intake.grouping import benches_of, group_files
from ingest.intake.intake import take_in
from ingest.intake.retractions import REASON, Batch, PutRight
from ingest.intake.setup import MotorFile, Setup, prepare, sealed_setup

FILES = {"bench", "motor", "databases"}  # what makes a log read otherwise


@dataclass(frozen=True)
class LogPlan:
    """What is to become of one log. `said`: all that flags said of it, then and now; `changes` as in `LogCorrected`."""

    raw: str
    decode: DecodeCompleted  # the one that its sessions use
    setup: Setup
    said: Override
    changes: dict[str, list[Any]]


def correct(
    store: Store,
    texts: Sequence[str],
    said: Override,
    files: tuple[Path | None, Sequence[Path]],
    why: str,
    motor_file: Callable[[Path], MotorFile],
    tell: Callable[[str], None] = lambda _: None,
) -> PutRight:
    """Say anew what logs are of (`said`) or what they are read with (`files`: bench file and signal databases, None and
    empty where these stay); a session stands for all its logs, and a bench file is that of a session. The sealed bytes
    are read again where that is needed.

    Raises CorrectionError where a log is not there or everything is so already, and what `prepare` and `take_in` raise.
    """
    why, before = in_words(why, "--reason", REASON), ledger_facts.at(store.ledger)
    logs = _logs(before, texts)
    if files[0] is not None:  # a session has one bench file
        logs = _beside(before, logs)
    plans = [plan_of(store, before, raw, said, files, motor_file) for raw in logs]
    plans = [one for one in plans if one.changes]
    if not plans:
        raise CorrectionError(f"{', '.join(texts)}: is so already: there is nothing to correct")
    left: list[str] = []
    for same in alike(plans):
        batch: Batch = [(f"file-{one.raw}", LogCorrected(raw=one.raw, said=one.changes, why=why)) for one in same]
        if FILES & {what for one in same for what in one.changes}:
            left += read_again(store, before, same, tell, batch)
        else:
            left += group_files(store, (), {one.raw: one.said for one in same}, batch).left
    named = [NamedFact(f"file-{one.raw}", before.files[one.raw].name) for one in plans]
    changes = {one.raw: one.changes for one in plans}
    return PutRight(named, before, ledger_facts.at(store.ledger), changes, left)


def _logs(facts: Facts, texts: Sequence[str]) -> list[str]:
    """SHA-256 of the logs that these names stand for."""
    logs: list[str] = []
    for text in texts:
        one = find(facts, text)
        if one.kind not in ("log", "session"):
            back = f"`whyhot retract {shlex.quote(text)} --reason TEXT`"
            raise CorrectionError(f"{text}: is no log or session: {back} takes it back")
        logs += [one.key] if one.kind == "log" else [file["raw"] for file in facts.session(one.key).files]
    return list(dict.fromkeys(logs))


def _beside(facts: Facts, logs: Sequence[str]) -> list[str]:
    """These logs and those that are of one session with them."""
    held = [[file["raw"] for file in session.files] for session in facts.sessions]
    return list(dict.fromkeys([*logs, *(raw for raws in held if set(raws) & set(logs) for raw in raws)]))


def plan_of(
    store: Store,
    facts: Facts,
    raw: str,
    said: Override,
    files: tuple[Path | None, Sequence[Path]],
    motor_file: Callable[[Path], MotorFile],
) -> LogPlan:
    its = [one for one in facts.sessions if any(file["raw"] == raw for file in one.files)]
    used = {file["decode"] for one in its for file in one.files if file["raw"] == raw}
    decodes = [one for one in facts.decodes.values() if one.raw == raw]
    decode = next((one for one in decodes if one.decode in used), decodes[-1])
    setup = _setup(store, facts, decode, files, motor_file)
    _one_for_all(facts.files[raw].name, decode, setup.bench, said)
    changes: dict[str, list[Any]] = {}
    for what, old, new in (
        ("bench", decode.bench, setup.bench.sha256 if setup.bench else None),
        ("motor", decode.model, setup.model),
        ("databases", decode.databases, [one.sha256 for one in setup.databases]),
    ):
        if old != new:
            changes[what] = [old, new]
    for what, value in vars(said).items():
        old = next((getattr(one, what) for one in its if getattr(one, what) != value), value)
        if value is not None and (old != value or not its):
            changes[what] = [old if its else None, value]
    before = sessions.overrides_of(its, benches_of(store, facts), facts.decodes).get(raw, Override())
    given = {what: value for what, value in vars(said).items() if value is not None}
    return LogPlan(raw, decode, setup, replace(before, **given), changes)


def _one_for_all(name: str, decode: DecodeCompleted, bench: Bench | None, said: Override) -> None:
    """Refuse one name for all specimens of a table that says which rows are whose."""
    for what, column in (("specimen", "specimen_column"), ("batch", "batch_column")):
        held = list(dict.fromkeys(part[what] for part in decode.parts))
        if getattr(said, what) is not None and bench and getattr(bench, column) and len(held) > 1:
            raise CorrectionError(
                f"{name}: --{what} would give one {what} to all rows, and they are of {len(held)} "
                f"({', '.join(map(str, held[:3]))}{' ...' if held[3:] else ''}). Correct the names in the table, take "
                f"this log back (`whyhot retract {shlex.quote(name)} --reason TEXT`), and ingest the table again."
            )


def _setup(
    store: Store,
    facts: Facts,
    decode: DecodeCompleted,
    files: tuple[Path | None, Sequence[Path]],
    motor_file: Callable[[Path], MotorFile],
) -> Setup:
    """What the log is to be read with: the files given, and those that it was read with where none are."""
    bench, databases = files
    kept = sealed_setup(store, facts, decode)
    given = prepare([], bench, databases, motor_file)
    setup = kept if bench is None else replace(given, databases=kept.databases)
    return replace(setup, databases=given.databases) if databases else setup


def alike(plans: Sequence[LogPlan]) -> list[list[LogPlan]]:
    """The plans that one intake carries out."""
    found: dict[Any, list[LogPlan]] = {}
    for one in plans:
        bench = one.setup.bench.sha256 if one.setup.bench else None
        version = bench, one.setup.model, tuple(database.sha256 for database in one.setup.databases)
        found.setdefault((one.said, version), []).append(one)
    return [*found.values()]


def read_again(
    store: Store, facts: Facts, plans: Sequence[LogPlan], tell: Callable[[str], None], batch: Batch
) -> list[str]:
    """Take in the sealed bytes of logs again, under their names."""
    work = store.work()
    try:
        paths = []
        for one in plans:
            sealed = facts.files[one.raw]
            folder = work / one.raw
            folder.mkdir()
            paths.append(folder / sealed.name)
            try:
                store.archive.lend(one.raw, paths[-1])
            except DamageError as error:
                raise DamageError(f"{sealed.name}: {error}: it cannot be read again") from None
        return take_in(store, paths, plans[0].setup, plans[0].said, tell, batch).refusals
    finally:
        shutil.rmtree(work, ignore_errors=True)
