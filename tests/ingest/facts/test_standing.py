"""What was taken back does not count, nothing else changes, and bringing it back is as if it had never been."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from ingest.errors import CorrectionError, UnknownSessionError
from ingest.facts.events import (
    AgeingAssessed,
    CauseAccepted,
    DiagnosisCompleted,
    Event,
    FactReinstated,
    FactRetracted,
    HeldOutOpened,
    ModelPublished,
    SessionRecorded,
)
from ingest.facts.facts import Facts, fold
from ingest.facts.ledger_row import Recorded
from ingest.facts.named import NamedFact, find, find_retracted
from ingest.facts.standing import whole
from made.events import decode, raw, session

A, B = raw("1_s1.blf"), raw("2_s2.blf")


def folded(*events: tuple[str, Event]) -> Facts:
    return fold(
        Recorded(n, stream, n, event, None, f"2026-01-{n:02}T00:00:00.000000Z", "whyhot 0", None, None, "")
        for n, (stream, event) in enumerate(events, 1)
    )


def of(number: str, name: str, *raws: str, **more: Any) -> tuple[str, SessionRecorded]:
    files = [{"raw": one, "decode": f"d{one[:4]}", "first_record": 0, "last_record": 9} for one in raws]
    return f"session-{number}", replace(session(number, name), files=files, **more)


def log(sealed: Any) -> list[tuple[str, Event]]:
    stream = f"file-{sealed.sha256}"
    return [(stream, sealed), (stream, decode(f"d{sealed.sha256[:4]}", sealed.sha256))]


def back(stream: str, name: str, **more: Any) -> tuple[str, Event]:
    return stream, FactRetracted(fact=stream, name=name, why="a mistake", **more)


def undone(stream: str) -> tuple[str, Event]:
    return stream, FactReinstated(fact=stream, why="it was none")


LOGS = [*log(A), *log(B), of("aaaa1", "1_s1", A.sha256), of("bbbb2", "2_s2", B.sha256)]
LOG_BACK = back(f"file-{B.sha256}", B.name, rows=[whole(B.sha256)])
ROWS = [{"raw": B.sha256, "first_record": 0, "last_record": 9}]


def test_a_log_that_was_taken_back_leaves_with_its_decodes_and_sessions() -> None:
    facts = folded(*LOGS, LOG_BACK)
    assert list(facts.files) == [A.sha256]
    assert [one.raw for one in facts.decodes.values()] == [A.sha256]
    assert [one.name for one in facts.sessions] == ["1_s1"]
    line = r"log 2_s2.blf was taken back on 2026-01-07 \(a mistake\): `whyhot retract 2_s2.blf --undo --reason TEXT`"
    for text in ("2_s2", "bbbb2", "bbbb"):
        with pytest.raises(UnknownSessionError, match=line):
            facts.session(text)


def test_a_session_that_was_taken_back_leaves_and_its_logs_stay() -> None:
    facts = folded(*LOGS, back("session-bbbb2", "2_s2", rows=ROWS))
    assert list(facts.files) == [A.sha256, B.sha256]
    assert [one.name for one in facts.sessions] == ["1_s1"]
    assert [one for one in facts.gone if one.hold(B.sha256, 0, 9)]
    assert not [one for one in facts.gone if one.hold(B.sha256, 0, 10)]


@pytest.mark.parametrize("taken", [LOG_BACK, back("session-bbbb2", "2_s2", rows=ROWS)])
def test_what_is_brought_back_is_as_it_was(taken: tuple[str, Event]) -> None:
    assert folded(*LOGS, taken, undone(taken[0])) == folded(*LOGS)


def test_a_session_of_another_log_too_leaves_and_what_is_left_stands() -> None:
    both, alone = of("cccc3", "1_s1", A.sha256, B.sha256), of("aaaa1", "1_s1", A.sha256)
    facts = folded(*log(A), *log(B), both, LOG_BACK, alone)
    assert [one.session for one in facts.sessions] == ["aaaa1"]


def diagnosed() -> list[tuple[str, Event]]:
    made = [
        ModelPublished(model=m, motor="servo", file="motor.toml", parent=p) for m, p in (("m0", None), ("m1", "m0"))
    ]
    accepted = CauseAccepted(diagnosis="dddd4", causes=[], parent="m0", model="m1", parent_bench=None, bench=None)
    done = DiagnosisCompleted(diagnosis="dddd4", key={"train": ["aaaa1"]}, artefact="a", summary={})
    opened = HeldOutOpened(diagnosis="dddd4", sessions=["bbbb2"])
    name = "diagnosis-dddd4"
    return [*(("motor-servo", one) for one in made), (name, opened), (name, done), (name, accepted)]


def test_a_diagnosis_that_was_taken_back_is_accepted_no_more_and_its_model_is_not_the_latest() -> None:
    before = folded(*LOGS, *diagnosed())
    assert (before.current("m0"), list(before.models)[-1]) == ("m1", "m1")
    facts = folded(*LOGS, *diagnosed(), back("diagnosis-dddd4", "d-dddd4", models=["m1"]))
    assert (facts.current("m0"), list(facts.models)[-1], dict(facts.diagnoses)) == ("m0", "m0", {})
    assert facts.opened == {"bbbb2": ["dddd4"]}, "who has seen a kept session has seen it"


def assessment(of_session: str) -> tuple[str, Event]:
    event = AgeingAssessed(assessment="eeee5", key={}, answer="", artefacts={}, sessions=[of_session], digest="")
    return "ageing-eeee5", event


def test_an_assessment_leaves_with_any_session_of_a_specimen_that_it_counted() -> None:
    heated = [*log(A), *log(B), of("aaaa1", "oven", A.sha256, specimen="S1"), of("bbbb2", "dc", B.sha256)]
    gone = back(f"file-{A.sha256}", A.name, rows=[whole(A.sha256)])
    assert folded(*heated, assessment("bbbb2")).assessments
    assert not folded(*heated, assessment("bbbb2"), gone).assessments
    assert folded(*heated, gone, assessment("bbbb2")).assessments, "made without it"


@pytest.mark.parametrize(
    ("text", "stream"),
    [
        ("2_s2.blf", f"file-{B.sha256}"),
        (B.sha256[:6].upper(), f"file-{B.sha256}"),
        ("2_s2", "session-bbbb2"),
        ("bbbb", "session-bbbb2"),
        ("d-dddd", "diagnosis-dddd4"),
    ],
)
def test_what_a_person_names_is_found_by_name_and_by_id(text: str, stream: str) -> None:
    assert find(folded(*LOGS, *diagnosed()), text).stream == stream


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("1_s2.blf", "1_s2.blf: is not in this store. Nearest: "),
        ("qqqqq", "qqqqq: is not in this store. `whyhot sessions` lists sessions, "),
        ("2_s2.blf", "log 2_s2.blf was taken back on 2026-01-07 .a mistake.: "),
        ("2_s2", "log 2_s2.blf was taken back on 2026-01-07 .a mistake.: "),
        ("aaaa", "aaaa: is more than one: session aaaa1, session aaaa9: give its id"),
        ("motor.toml", "motor.toml: is a motor file: "),
    ],
)
def test_what_is_not_there_twice_there_or_needed_by_others_is_told_in_a_line(text: str, line: str) -> None:
    more = of("aaaa9", "3_s1", A.sha256), ("motor-servo", diagnosed()[0][1])
    with pytest.raises(CorrectionError, match=line):
        find(folded(*LOGS, LOG_BACK, *more), text)


def test_only_what_was_taken_back_is_brought_back() -> None:
    facts = folded(*LOGS, LOG_BACK)
    assert find_retracted(facts, "2_s2.blf") == NamedFact(f"file-{B.sha256}", "2_s2.blf")
    with pytest.raises(CorrectionError, match=r"log 1_s1\.blf stands: there is nothing to undo\. Taken back: log 2_s2"):
        find_retracted(facts, "1_s1.blf")
