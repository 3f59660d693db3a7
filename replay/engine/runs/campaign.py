"""Many sessions replayed: in this process, in several or on a cluster, one writer of facts, the same digests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ingest.catalogue.decoded import refuse_forgotten
from ingest.errors import DamageError, IngestError
from ingest.facts import facts as ledger_facts
from ingest.facts.events import ReplayCompleted, ReplayDiverged, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.ledger import settled
from ingest.facts.store import Store
from ingest.units.each import Lost, Workers, each, told
from ingest.units.shared import InProcess, Shared, share
from replay.engine.files.models import model_of
from replay.engine.runs.runs import Completed, replay
from replay.errors import ReplayDataError, ReplayError
from twin.compiled.integrators import DEFAULT
from twin.errors import TwinError
from twin.filters.by_filterpy import Apart


@dataclass(frozen=True)
class Outcome:
    """One session's replay: a run, a divergence, or the one line that says why there is none; how far filterpy's filter
    is from the run's own (`apart`), where that was asked for and a filter ran."""

    session: SessionRecorded
    run: ReplayCompleted | None
    refusal: str | None
    apart: Apart | None = None


@dataclass(frozen=True)
class Job:
    """What a worker needs: names and hashes, never arrays, and the facts as they were when the campaign began."""

    store: Path
    facts: Shared[Facts] | InProcess[Facts]
    session: str
    model: str
    level: str
    integrator: str
    work: Path
    unknown: tuple[str, ...]
    check_filter: bool


def replay_sessions(
    store: Store,
    sessions: Sequence[SessionRecorded],
    model: str | None,
    level: str,
    workers: Workers | None = None,
    tell: Callable[[str], None] = lambda _: None,
    integrator: str = DEFAULT.name,
    unknown: Sequence[str] = (),
    check_filter: bool = False,
) -> list[Outcome]:
    """Replay each session with `model` (None: the one its bench file names) and append the runs that are new, each as
    soon as it is there. One that cannot be replayed does not stop the others. `workers`: where they run (None: in this
    process); `unknown`: ids of the causes that the filter is to find, none for its own choice; `check_filter`: whether
    filterpy's filter runs beside each. Returns the outcomes in the order of `sessions`."""
    facts = ledger_facts.at(store.ledger)
    work = store.work()
    outcomes: list[Outcome] = []
    jobs: list[Job] = []
    folder = store.folder.absolute()
    shared = InProcess(facts) if workers is None else share(facts.whole(), work)
    for session in sessions:
        try:
            for file in session.files:
                refuse_forgotten(store, file["decode"])  # a worker has no ledger
            named = model or model_of(facts, session)
            asked = (named, level, integrator, work.absolute(), tuple(unknown), check_filter)
            jobs.append(Job(folder, shared, session.session, *asked))
        except (ReplayDataError, DamageError) as error:
            outcomes.append(Outcome(session, None, str(error)))
    order = {session.session: i for i, session in enumerate(sessions)}
    names = [sessions[order[job.session]].name for job in jobs]
    for job, done in told(each(_work, jobs, workers), "replaying", names, tell):
        session = sessions[order[job.session]]
        said = f"session {session.name}: {done.why}" if isinstance(done, Lost) else done
        outcomes.append(_append(store, facts, session, said, work))
    return sorted(outcomes, key=lambda outcome: order[outcome.session.session])


def _work(job: Job) -> Completed | str:
    """One session, in whatever process: everything is read from the store's files, and only facts travel back."""
    facts = job.facts.value()
    try:
        session = facts.session(job.session)
        asked = (job.model, job.level, job.integrator, job.work, job.unknown, job.check_filter)
        return replay(Store.files_of(job.store), facts, session, *asked)
    except (ReplayError, IngestError, TwinError) as error:
        return str(error)


def _append(store: Store, facts: Facts, session: SessionRecorded, done: Completed | str, work: Path) -> Outcome:
    if isinstance(done, str):
        return Outcome(session, None, done)
    if isinstance(done.event, ReplayCompleted):
        for sha256 in done.event.artefacts.values():
            if (work / sha256).is_file():  # of a run that is known too: what was damaged or lost of it is mended
                store.archive.seal(work / sha256)
    if not done.known:
        settled(partial(_record, store, facts, done.event))
    if isinstance(done.event, ReplayDiverged):
        place = f"first at {done.event.t_s} s in {done.event.field}" if done.event.field else "in no stored field"
        why = (
            f"session {session.name}: replayed with the same key on the same machine and came out different, {place}: "
            "run whyhot verify --read, then report this with whyhot doctor."
        )
        return Outcome(session, None, why)
    return Outcome(session, done.event, None, done.apart)


def _record(store: Store, known: Facts, event: ReplayCompleted | ReplayDiverged) -> None:
    """Append what a run gave, unless another program has recorded the same run meanwhile."""
    if isinstance(event, ReplayDiverged) or event.run not in ledger_facts.now(store.ledger, known).runs:
        store.ledger.append(f"run-{event.run}", event)
