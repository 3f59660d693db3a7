"""What is stale, asked again of what stands now."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ingest.errors import IngestError
from ingest.facts import facts as ledger_facts
from ingest.facts.events import AgeingAssessed, CalibrationCompleted, DiagnosisCompleted, ReplayCompleted
from ingest.facts.sessions import order
from ingest.facts.store import Store
from replay.engine.runs.campaign import replay_sessions
from replay.errors import ReplayDataError, ReplayError
from replay.studies.again.stale import Stale, stale
from replay.studies.ageing.assess import assess
from replay.studies.characterise.calibrate import calibrate_sessions
from replay.studies.diagnosis.diagnose import diagnose
from twin.compiled.integrators import DEFAULT
from twin.errors import TwinError


@dataclass(frozen=True)
class Redone:
    """One stale answer: the id of the new one, or the one line that says why there is none."""

    old: Stale
    new: str | None
    refusal: str | None


def redo(store: Store, tell: Callable[[str], None] = lambda _: None) -> list[Redone]:
    """Ask again all that is stale, in the order in which it was asked: what begins from an older answer comes after it.
    One that is refused does not stop the others. Each new answer is a fact of its own, so a redo that was stopped goes
    on where it was."""
    done: list[Redone] = []
    for old in stale(store.ledger.events(), ledger_facts.at(store.ledger)).answers:
        tell(f"again: {old.name}")
        try:
            done.append(Redone(old, _again(store, old, tell), None))
        except (ReplayError, IngestError, TwinError) as error:
            done.append(Redone(old, None, f"{old.name}: {error}"))
    return done


def _again(store: Store, old: Stale, tell: Callable[[str], None]) -> str:
    facts, event = ledger_facts.at(store.ledger), old.event
    sessions, kept = (sorted(map(facts.session, ids), key=order) for ids in (old.sessions, old.kept))
    if not sessions and isinstance(event, DiagnosisCompleted):
        raise ReplayDataError(f"all that it learnt from is gone: `whyhot retract {old.name.split()[-1]} --reason TEXT`")
    match event:
        case ReplayCompleted():
            method = event.key.get("settings", {}).get("integrator", DEFAULT.name)
            unknown: Sequence[str] = event.key.get("unknown", ())
            (done,) = replay_sessions(store, sessions, old.model, event.level, None, tell, method, unknown)
            if done.run is None:
                raise ReplayDataError(str(done.refusal))
            return done.run.run
        case CalibrationCompleted():
            only = event.key.get("settings", {}).get("only")
            return calibrate_sessions(store, facts, sessions, old.model, event.level, only).event.calibration
        case DiagnosisCompleted():
            level = event.key.get("level", "testing")
            return diagnose(store, facts, sessions, kept, old.model, level, tell).diagnosis
        case AgeingAssessed():
            return assess(store, facts, old.model, None, tell).assessment
