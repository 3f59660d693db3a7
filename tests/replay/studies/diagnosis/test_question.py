"""What a diagnosis is asked, as the key that tells one question from another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ingest.facts.facts import fold
from ingest.facts.ledger_row import Recorded
from ingest.facts.store import Store
from made.events import decode, raw, session
from replay.studies.diagnosis.question import Question, key_of

LOGS = {name: raw(name) for name in ("1.blf", "2.blf")}


def test_which_log_is_read_with_which_files_is_part_of_the_question(tmp_path: Path) -> None:
    """Two bench files exchanged between two sessions are the same two bench files."""

    def key(*benches: str) -> dict[str, object]:
        events: list[Recorded] = []
        for (name, log), bench in zip(LOGS.items(), benches, strict=True):
            made = decode(f"{log.sha256} {bench}", log.sha256, bench)
            files = [{"raw": log.sha256, "decode": made.decode, "first_record": 0, "last_record": 9}]
            for event in (log, made, replace(session(name, name, bench=bench), files=files)):
                events.append(Recorded(len(events), name, 0, event, None, "", "", None, None, ""))
        facts = fold(events)
        with Store.open(tmp_path, create=True) as store:
            return key_of(Question(store, facts, facts.sessions, [], "m", "testing"), "code")

    assert key("b0", "b1") == key("b0", "b1")
    assert key("b0", "b1") != key("b1", "b0")
