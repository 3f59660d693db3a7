from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from ingest.errors import UnknownSessionError
from ingest.facts import facts as facts_module
from ingest.facts.events import (
    AgeingAssessed,
    BenchRegistered,
    CauseAccepted,
    DiagnosisCompleted,
    Event,
    HeldOutOpened,
    ModelPublished,
    QualityFlagged,
    ReplayCompleted,
    SessionRegrouped,
    SignalDatabaseRegistered,
)
from ingest.facts.facts import Facts
from ingest.facts.ledger import Ledger
from ingest.facts.ledger_row import Recorded
from made.events import raw, session

SECOND = 1_000_000_000


def fold(*events: Event | tuple[str, Event]) -> Facts:
    return facts_module.fold(_recorded(events))


def _recorded(events: Sequence[Event | tuple[str, Event]]) -> list[Recorded]:
    pairs = [one if isinstance(one, tuple) else ("x-1", one) for one in events]
    return [
        Recorded(n, stream, n, event, None, f"2026-01-01T00:00:{n:02}.000000Z", "whyhot 0", None, None, "")
        for n, (stream, event) in enumerate(pairs, 1)
    ]


def regrouped(old: str, into: str) -> SessionRegrouped:
    return SessionRegrouped(session=old, into=into, why="a late file joined")


def run(number: str) -> ReplayCompleted:
    return ReplayCompleted(
        run=number,
        session="1",
        model="m",
        motor="reference",
        level="testing",
        bench=None,
        key={},
        digest="d",
        environment={},
        artefacts={},
        summary={},
    )


def test_an_empty_ledger_has_no_facts() -> None:
    facts = fold()
    assert (list(facts.sessions), dict(facts.files), dict(facts.runs), dict(facts.flags)) == ([], {}, {}, {})
    with pytest.raises(UnknownSessionError, match=r"session '1_s1': is not in this store. It holds none yet: `whyhot"):
        facts.session("1_s1")


def test_files_databases_benches_models_and_runs_are_found_by_their_id() -> None:
    bench = BenchRegistered(sha256="b", name="bench.toml", motor="motor.toml", model="m")
    model = ModelPublished(model="m", motor="reference", file="motor.toml", parent=None)
    dbc = SignalDatabaseRegistered(sha256="d", name="bench.dbc")
    log = raw("1_s1.blf")
    facts = fold(log, dbc, bench, model, run("r1"))
    assert facts.files[log.sha256] == log
    assert facts.databases["d"] == dbc
    assert facts.benches["b"] == bench
    assert facts.models["m"] == model
    assert facts.runs["r1"] == run("r1")


def test_the_bench_of_a_session_is_the_latest_of_its_bytes() -> None:
    old = BenchRegistered(sha256="b", name="bench.toml", motor="motor.toml", model="m1")
    new = BenchRegistered(sha256="b", name="bench.toml", motor="motor.toml", model="m2")
    models = [ModelPublished(model=m, motor="reference", file="motor.toml", parent=None) for m in ("m1", "m2")]
    facts = fold(old, *models, session("1", "1_s1", bench="a"), session("1", "1_s1", bench="b"), new)
    bench = facts.bench_of(facts.session("1"))
    assert bench == new


def test_a_session_without_bench_file_has_none() -> None:
    facts = fold(session("1", "1_s1"))
    assert facts.bench_of(facts.session("1")) is None


def test_flags_are_kept_by_stream_in_order() -> None:
    held, gap = (QualityFlagged(flag=flag, says=f"a {flag}") for flag in ("held", "gap"))
    facts = fold(("session-1", held), ("file-a", held), ("session-1", gap))
    assert list(facts.flags["session-1"]) == [held, gap]
    assert list(facts.flags["file-a"]) == [held]


def test_sessions_are_ordered_by_start_then_by_name_with_numbers_as_numbers() -> None:
    facts = fold(
        session("a", "10_s1", start_ns=None),
        session("b", "9_s1", start_ns=None),
        session("c", "late", start_ns=5 * SECOND),
        session("d", "10_wltp", start_ns=3 * SECOND),
        session("e", "2_wltp", start_ns=3 * SECOND),
    )
    assert [one.name for one in facts.sessions] == ["2_wltp", "10_wltp", "late", "9_s1", "10_s1"]


def test_a_session_recorded_again_is_one_session_as_it_was_last_said() -> None:
    facts = fold(session("1", "1_s1"), session("1", "1_s1", bench="b"))
    assert [one.bench for one in facts.sessions] == ["b"]


def test_a_session_is_found_by_id_by_the_start_of_an_id_and_by_name() -> None:
    facts = fold(session("ab12", "1_s1"), session("cd34", "2_s2"))
    for text in ("ab12", "ab", "AB", "1_s1"):
        assert facts.session(text).session == "ab12"


def test_a_name_beats_the_start_of_an_id_and_an_id_beats_a_name() -> None:
    facts = fold(session("12ab", "a"), session("ffff", "12"), session("eeee", "ffff"))
    assert facts.session("12").session == "ffff"
    assert facts.session("ffff").session == "ffff"


def test_an_old_id_leads_to_what_it_became_part_of() -> None:
    facts = fold(
        session("aa", "1"), session("bb", "1"), regrouped("aa", "bb"), session("cc", "1"), regrouped("bb", "cc")
    )
    assert [one.session for one in facts.sessions] == ["cc"]
    for text in ("aa", "a", "bb", "cc", "1"):
        assert facts.session(text).session == "cc"


def test_a_session_that_is_recorded_again_after_it_was_joined_stands_by_itself() -> None:
    facts = fold(
        session("aa", "1"), session("bb", "2"), regrouped("aa", "bb"), session("aa", "1"), regrouped("bb", "aa")
    )
    assert [one.session for one in facts.sessions] == ["aa"]
    assert facts.session("bb").session == "aa"


@pytest.mark.parametrize("pairs", [[("aa", "aa")], [("aa", "bb"), ("bb", "aa")], [("aa", "zz")]])
def test_an_old_id_that_leads_nowhere_is_unknown(pairs: list[tuple[str, str]]) -> None:
    facts = fold(session("aa", "1"), session("bb", "2"), *[regrouped(*pair) for pair in pairs], session("cc", "3"))
    with pytest.raises(UnknownSessionError, match="session 'aa': is not in this store"):
        facts.session("aa")


def test_a_name_that_two_sessions_have_is_refused_with_their_ids() -> None:
    facts = fold(session("ab12", "1_s1"), session("cd34", "1_s1"))
    with pytest.raises(UnknownSessionError) as caught:
        facts.session("1_s1")
    assert str(caught.value) == "session '1_s1': 2 are called so: give the id: ab12, cd34"


def test_of_many_sessions_of_one_name_the_first_are_named_with_their_specimens() -> None:
    facts = fold(*(replace(session(f"ab{k}", "dc"), specimen=f"S{k}") for k in range(10)))
    with pytest.raises(UnknownSessionError) as caught:
        facts.session("dc")
    assert "10 are called so: give the id: ab0 (S0), ab1 (S1), " in str(caught.value)
    assert str(caught.value).endswith("ab7 (S7) and 2 more")


def test_the_start_of_two_ids_is_refused_with_both() -> None:
    facts = fold(session("ab12", "1"), session("ab34", "2"))
    with pytest.raises(UnknownSessionError, match="give the id: ab12, ab34"):
        facts.session("ab")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1_s", "session '1_s': is not in this store. Nearest: 1_s1. `whyhot sessions` lists them"),
        ("qqqqq", "session 'qqqqq': is not in this store. `whyhot sessions` lists them"),
        ("", "session '': is not in this store. `whyhot sessions` lists them"),
        ("d-6d10", "session 'd-6d10': is not in this store. It is a diagnosis: `whyhot report d-6d10`"),
    ],
)
def test_an_unknown_session_is_refused_with_the_nearest_names(text: str, says: str) -> None:
    with pytest.raises(UnknownSessionError) as caught:
        diagnosed = DiagnosisCompleted(diagnosis="6d10b535", key={}, artefact="a", summary={})
        fold(session("ab", "1_s1"), session("cd", "wltp_hot"), diagnosed).session(text)
    assert str(caught.value) == says


def test_facts_are_as_of_an_event_or_a_time(tmp_path: Path) -> None:
    with closing(Ledger(tmp_path, write=True, create=True)) as ledger:
        first = ledger.append("session-1", session("1", "1_s1"))
        ledger.append("session-2", session("2", "2_s2"))
        assert len(facts_module.at(ledger).sessions) == 2
        assert len(facts_module.at(ledger, "1").sessions) == 1
        assert len(facts_module.at(ledger, first.recorded).sessions) == 1


def accepted(**pairs: str | None) -> CauseAccepted:
    given: dict[str, str | None] = {"parent": None, "model": None, "parent_bench": None, "bench": None}
    return CauseAccepted(diagnosis="d", causes=[], **(given | pairs))


def test_accepted_versions_are_followed_to_the_last_one() -> None:
    facts = fold(accepted(parent="m1", model="m2", parent_bench="b1", bench="b2"), accepted(parent="m2", model="m3"))
    assert [facts.current(one) for one in ("m1", "m2", "m3", "b1", "b2", "other")] == [
        *("m3", "m3", "m3", "b2", "b2", "other")
    ]


def test_the_last_acceptance_counts_and_what_it_takes_is_replaced_by_nothing() -> None:
    facts = fold(*(accepted(parent=a, model=b) for a, b in (("m1", "m2"), ("m2", "m3"), ("m3", "m1"))))
    assert [facts.current(one) for one in ("m1", "m2", "m3")] == ["m1", "m1", "m1"]
    assert fold(accepted(parent="m1", model="m1")).current("m1") == "m1"


def test_a_session_points_to_the_bench_file_that_was_accepted_in_place_of_its_own() -> None:
    benches = [BenchRegistered(sha256=sha, name="bench.toml", motor=None, model=None) for sha in ("b1", "b2")]
    facts = fold(*benches, session("1", "1_s1", bench="b1"), accepted(parent_bench="b1", bench="b2"))
    assert facts.bench_of(facts.session("1")) == benches[1]
    assert facts.session("1").bench == "b1"


def test_diagnoses_are_found_by_id_and_kept_sessions_know_who_opened_them() -> None:
    done = DiagnosisCompleted(diagnosis="d1", key={}, artefact="a", summary={})
    facts = fold(
        session("aa", "1"),
        *(HeldOutOpened(diagnosis=number, sessions=["aa", "cc"]) for number in ("d1", "d1", "d2")),
        done,
        session("bb", "1"),
        regrouped("aa", "bb"),
        HeldOutOpened(diagnosis="d3", sessions=["bb"]),
    )
    assert facts.diagnoses == {"d1": done}
    assert facts.opened == {"bb": ["d1", "d2", "d3"], "cc": ["d1", "d2"]}


def test_of_assessments_the_last_one_asked_for_is_the_latest() -> None:
    first, second = (
        AgeingAssessed(assessment=number, key={}, answer="a", artefacts={}, sessions=[], digest="d") for number in "12"
    )
    assert list(fold(first, second).assessments.values()) == [first, second]
    assert list(fold(first, second, first).assessments.values()) == [second, first]
