"""`whyhot` alone: what is in the store and what to type next."""

from __future__ import annotations

from pathlib import Path

from ingest.facts.events import DiagnosisCompleted, ModelPublished
from ingest.facts.store import Store
from made.events import session
from replay.cli.status import status


def test_without_a_store_there_is_nothing_to_say(tmp_path: Path) -> None:
    assert status(tmp_path) is None


def test_an_empty_store_asks_for_logs(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store", create=True):
        pass
    first, second, last = (status(tmp_path / "store") or "").splitlines()
    assert "0 sessions, 0 motors" in first and second == "0 sessions replayed, 0 not yet"
    assert last.startswith("next: whyhot ingest FILE... --bench bench.toml")


def test_one_is_singular_and_the_last_diagnosis_is_named(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store", create=True, write=True) as store:
        model = ModelPublished(model="m", motor="servo", file="motor.toml", parent=None)
        store.ledger.append("motor-servo", model)
        store.ledger.append("session-5", session("5", "1_s1"))
        for number, causes in (("aaaaaaaaaa", []), ("bbbbbbbbbb", ["loss.magnet.speed2", "input.flow.gain"])):
            summary = {"motor": "servo", "causes": causes}
            made = DiagnosisCompleted(diagnosis=number, key={"train": [], "kept": []}, artefact="c", summary=summary)
            store.ledger.append(f"diagnosis-{number}", made)
    first, second, found, last = (status(tmp_path / "store") or "").splitlines()
    assert "1 session, 1 motor, " in first and second == "0 sessions replayed, 1 not yet"
    assert found == "last diagnosis: d-bbbbbbbb of servo: loss.magnet.speed2, input.flow.gain"
    assert last.startswith("next: whyhot replay 1_s1")
