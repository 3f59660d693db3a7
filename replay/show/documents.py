"""Report and layers of what a store holds: which runs, read back from their seals, to which files."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from ingest.catalogue.channels import load
from ingest.events import ReplayCompleted, SessionRecorded
from ingest.facts import Facts
from ingest.store import Store
from replay.engine.run import Run
from replay.engine.sealed import load_run
from replay.errors import ReplayDataError
from replay.show.layers import write_measured, write_open_loop
from replay.show.report import ReportContext, write_report

NAMED = ("whyhot", "numpy", "scipy", "numba", "pyarrow", "matplotlib")


def write_replay_report(store: Store, facts: Facts, sessions: Sequence[str], target: Path, command: str) -> list[Run]:
    """The report of the latest run of each session (all replayed ones where none is named); returns these runs.

    Raises ReplayDataError where a session was never replayed.
    """
    chosen = [facts.session(text) for text in sessions] or [s for s in facts.sessions if latest_run(facts, s)]
    if not chosen:
        raise ReplayDataError("no session of this store was replayed yet: whyhot replay, then report.")
    runs = [load_run(store, facts, _run_of(facts, session)) for session in chosen]
    head = store.ledger.head()
    context = ReportContext(
        command=command.strip(),
        store_head=f"{head.position} {head.root[:16]}",
        versions={name: version(name) for name in NAMED},
    )
    target.parent.mkdir(parents=True, exist_ok=True)
    write_report(runs, target, context)
    return runs


def write_layers(store: Store, facts: Facts, sessions: Sequence[str], folder: Path) -> list[Path]:
    """One .rrd a layer and session: `<session>.measured.rrd` and, where it was replayed, `<session>.open_loop.rrd`.

    Raises ViewerError where rerun is not installed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for session in (facts.session(text) for text in sessions):
        event = latest_run(facts, session)
        run = load_run(store, facts, event) if event else None
        paths.append(folder / f"{session.name}.measured.rrd")
        write_measured(session, load(store, facts, session), paths[-1], run)
        if run:
            paths.append(folder / f"{session.name}.open_loop.rrd")
            write_open_loop(run, paths[-1])
    return paths


def latest_run(facts: Facts, session: SessionRecorded) -> ReplayCompleted | None:
    """The run of a session that was recorded last, or None."""
    return next((event for event in reversed(list(facts.runs.values())) if event.session == session.session), None)


def _run_of(facts: Facts, session: SessionRecorded) -> ReplayCompleted:
    event = latest_run(facts, session)
    if event is None:
        raise ReplayDataError(f"session {session.name} was not replayed yet: whyhot replay {session.name}")
    return event
