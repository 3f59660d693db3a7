"""Which files are one test, whatever the order in which they come."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ingest.bench.bench_file import Bench
from ingest.facts.events import DecodeCompleted, SessionRecorded, SessionRegrouped
from ingest.facts.sessions import BY_BENCH, BY_FLAG, Override, group, natural, overrides_of, parts, regroup, session_id
from ingest.facts.standing import RowsOfLog
from made.events import decode

S = 1_000_000_000
T0 = 1_700_000_000 * S
BENCH = Bench(sha256="b1", name="bench.toml", join_gap_s=60.0)
BENCHES = {"b1": BENCH}


def log(raw: str, start_s: float, end_s: float, bench: str | None = "b1", **more: Any) -> DecodeCompleted:
    start, end = T0 + round(start_s * S), T0 + round(end_s * S)
    return decode(f"{raw}-{bench}", raw, bench, **({"start_ns": start, "end_ns": end} | more))


def grouped(*decodes: DecodeCompleted, benches: dict[str, Bench] | None = None, **more: Any) -> list[SessionRecorded]:
    names = {one.raw: f"{one.raw}.part.blf" for one in decodes}
    return group(decodes, BENCHES if benches is None else benches, names, **more)


def raws(sessions: list[SessionRecorded]) -> list[list[str]]:
    return [[file["raw"] for file in session.files] for session in sessions]


def test_files_that_overlap_or_follow_within_the_gap_are_one_session() -> None:
    sessions = grouped(log("a", 0, 100), log("b", 50, 200), log("c", 259, 300), log("d", 360, 400))
    assert raws(sessions) == [["a", "b", "c"], ["d"]]  # 59 s joins, 60 s does not
    assert (sessions[0].start_ns, sessions[0].end_ns) == (T0, T0 + 300 * S)


def test_a_short_file_inside_a_long_one_does_not_end_it() -> None:
    assert raws(grouped(log("long", 0, 1000), log("short", 10, 20), log("next", 1010, 1100))) == [
        ["long", "short", "next"]
    ]


def test_files_without_absolute_time_are_each_a_session() -> None:
    sessions = grouped(log("a", 0, 100, absolute=False), log("b", 0, 100, absolute=False), log("c", 0, 100))
    assert raws(sessions) == [["c"], ["a"], ["b"]]  # the one with a start first
    assert [session.absolute for session in sessions] == [True, False, False]


def test_a_file_without_a_record_is_of_no_time_though_it_says_its_own() -> None:
    [session] = grouped(log("a", 0, 100, start_ns=None, end_ns=None))
    assert not session.absolute, "else it is a session of 1970"


def test_files_without_a_bench_file_are_each_a_session() -> None:
    assert raws(grouped(log("a", 0, 100, None), log("b", 50, 100, None))) == [["a"], ["b"]]


def test_another_bench_file_or_another_specimen_is_another_session() -> None:
    benches = {"b1": BENCH, "b2": replace(BENCH, sha256="b2")}
    assert raws(grouped(log("a", 0, 9), log("b", 0, 9, "b2"), benches=benches)) == [["a"], ["b"]]
    said = {"b": Override(specimen="stator-07")}
    sessions = grouped(log("a", 0, 9), log("b", 0, 9), overrides=said)
    assert [session.specimen for session in sessions] == [None, "stator-07"]


def test_a_file_quarantined_whole_belongs_to_no_session() -> None:
    assert raws(grouped(log("a", 0, 9), log("b", 0, 9, outcome="quarantined"))) == [["a"]]


def test_a_salvaged_file_belongs_to_a_session() -> None:
    assert raws(grouped(log("a", 0, 9, outcome="salvaged"))) == [["a"]]


def test_the_name_is_that_of_the_first_file_up_to_its_first_dot() -> None:
    (session,) = group([log("x", 50, 60), log("y", 0, 40)], BENCHES, {"x": "2_s2.blf", "y": "1_s1.part2.blf"})
    assert session.name == "1_s1"


def test_numbers_in_names_are_compared_as_numbers() -> None:
    assert sorted(["10_s1", "", "2_s2", "a10", "1_s1", "a9"], key=natural) == ["", "1_s1", "2_s2", "10_s1", "a9", "a10"]


def test_a_new_bench_version_is_the_same_session_pointing_to_it() -> None:
    benches = {"b1": BENCH, "b2": replace(BENCH, sha256="b2", join_gap_s=1.0, attributes={"inverter": "sw 5"})}
    first = [log("a", 0, 100), log("b", 130, 200)]
    (old,) = grouped(*first, benches=benches)
    (half,) = grouped(*first, log("a", 0, 100, "b2"), benches=benches)
    (new,) = grouped(*first, log("a", 0, 100, "b2"), log("b", 130, 200, "b2"), benches=benches)
    assert old.session == half.session == new.session
    assert (old.bench, half.bench, new.bench) == ("b1", "b1", "b2")  # a version counts once most files are decoded so
    assert [file["decode"] for file in new.files] == ["a-b2", "b-b2"]
    assert new.attributes == {"inverter": "sw 5"}
    assert regroup([old], [new]) == [new]


def test_a_session_goes_by_the_motor_file_that_most_of_its_files_came_with_and_of_equals_the_last() -> None:
    a, b = log("a", 0, 100), log("b", 130, 200)
    (old,) = grouped(replace(a, model="m1"), replace(b, model="m1"))
    (half,) = grouped(replace(a, model="m1"), replace(b, model="m1"), replace(a, model="m2", decode="a-m2"))
    (last,) = grouped(replace(a, model="m1"), replace(b, model="m2"))
    assert old.session == half.session == last.session
    assert (old.model, half.model, last.model) == ("m1", "m1", "m2")
    assert [file["decode"] for file in half.files] == ["a-b1", "b-b1"]


def test_a_bench_file_given_later_beats_none() -> None:
    (session,) = grouped(log("a", 0, 9), log("a", 0, 9, None))
    assert (session.bench, session.files[0]["decode"]) == ("b1", "a-b1")
    assert session.session == grouped(log("a", 0, 9, None))[0].session


def test_kind_comes_from_the_flag_before_the_bench_file_and_else_stays_open() -> None:
    benches = {"b1": replace(BENCH, kind="s1")}
    (by_flag,) = grouped(log("a", 0, 9), benches=benches, overrides={"a": Override(kind="s2")})
    (by_bench,) = grouped(log("a", 0, 9), benches=benches)
    (open_,) = grouped(log("a", 0, 9))
    assert (by_flag.kind, by_flag.kind_why) == ("s2", BY_FLAG)
    assert (by_bench.kind, by_bench.kind_why) == ("s1", BY_BENCH)
    assert (open_.kind, open_.kind_why) == ("", "")


def test_what_was_said_on_the_command_line_is_read_back_from_the_sessions() -> None:
    benches = {"b1": replace(BENCH, specimen="from-bench")}
    said = {"a": Override(specimen="stator-07", kind="s2"), "b": Override(batch="B3")}
    sessions = grouped(log("a", 0, 9), log("b", 500, 509), log("c", 900, 909), benches=benches, overrides=said)
    assert overrides_of(sessions, benches, {}) == said
    assert grouped(log("a", 0, 9), benches=benches, overrides=said)[0].specimen == "stator-07"


def test_a_table_of_many_specimens_holds_a_session_for_each_run_of_rows() -> None:
    rows = parts(np.arange(5), np.arange(5) * S, np.array([0, 0, 1, 1, 0]), [("s1", None), ("s2", None)])
    assert [(row["specimen"], row["first_record"], row["last_record"]) for row in rows] == [
        ("s1", 0, 1),
        ("s2", 2, 3),
        ("s1", 4, 4),
    ]
    sessions = grouped(log("a", 0, 4, absolute=False, parts=rows))
    assert [(s.specimen, s.files[0]["first_record"], s.files[0]["last_record"]) for s in sessions] == [
        ("s1", 0, 1),
        ("s2", 2, 3),
        ("s1", 4, 4),
    ]
    assert len({session.session for session in sessions}) == 3


def checks_of(raw: str, *specimens: str) -> DecodeCompleted:
    """A table with a row a check."""
    labels = list(dict.fromkeys(specimens))
    which = np.array([labels.index(name) for name in specimens])
    t_ns = T0 + np.arange(len(which)) * 9_000 * S
    rows = parts(np.arange(len(which)), t_ns, which, [(name, None) for name in labels], of_checks=True)
    return log(raw, 0, 9, parts=rows, balance={"found": len(which)})


def test_checks_of_a_table_are_a_session_a_specimen_wherever_their_rows_stand() -> None:
    sessions = grouped(checks_of("a", "s1", "s2", "s1", "s1", "s2"), checks_of("b", "s1", "s1"))
    rows = {(one.files[0]["raw"], one.specimen): one.files[0].get("rows") for one in sessions}
    assert rows == {("a", "s1"): [0, 2, 3], ("a", "s2"): [1, 4], ("b", "s1"): [0, 1]}
    (first,) = [one for one in sessions if rows[one.files[0]["raw"], one.specimen] == [0, 2, 3]]
    assert first.session == session_id(["a"], "s1", [("a", 0, 0), ("a", 2, 3)])
    assert (first.start_ns, first.end_ns) == (T0, T0 + 3 * 9_000 * S)
    left = grouped(checks_of("a", "s1", "s2", "s1"), gone=[RowsOfLog("a", 2, 2)])
    assert [one.specimen for one in left] == ["s2"]


def test_what_was_a_session_a_row_leads_to_the_session_of_its_specimen() -> None:
    names = ["s1", "s2", "s1", "s2"]
    single = parts(np.arange(4), np.arange(4), np.array([0, 1, 0, 1]), [("s1", None), ("s2", None)])
    old = grouped(log("a", 0, 9, absolute=False, parts=single))
    new = grouped(checks_of("a", *names))
    of = {one.session: one.specimen for one in new}
    moved = [one for one in regroup(old, new) if isinstance(one, SessionRegrouped)]
    assert [of[one.into] for one in moved] == names
    assert {one.why for one in moved} == {"its files were put together anew"}


def test_what_was_said_for_a_table_of_checks_is_read_back() -> None:
    benches = {"b1": replace(BENCH, specimen_column="serial")}
    many = checks_of("a", "s1", "s2", "s1")
    for said in ({"a": Override(specimen="s9")}, {"a": Override(kind="other")}, {}):
        assert overrides_of(grouped(many, benches=benches, overrides=said), benches, {many.decode: many}) == said


def test_a_specimen_given_for_a_table_of_many_is_read_back_and_its_columns_are_not() -> None:
    rows = parts(np.arange(4), np.arange(4) * S, np.array([0, 0, 1, 1]), [("s1", None), ("s2", None)])
    many = log("a", 0, 4, absolute=False, parts=rows, balance={"found": 4})
    benches = {"b1": replace(BENCH, specimen_column="serial")}
    for said in ({"a": Override(specimen="s9")}, {"a": Override(specimen="s1")}, {}):
        sessions = grouped(many, benches=benches, overrides=said)
        assert overrides_of(sessions, benches, {many.decode: many}) == said
        assert len(sessions) == (1 if said else 2)


def test_a_table_of_one_specimen_has_the_identity_of_the_whole_file() -> None:
    rows = parts(np.arange(2), np.arange(2), np.array([0, 0]), [("s1", "B3")])
    (session,) = grouped(log("a", 0, 9, parts=rows))
    assert session.session == session_id(["a"], "s1")
    assert (session.specimen, session.batch) == ("s1", "B3")


def test_the_id_is_of_files_and_specimen_and_not_of_their_order() -> None:
    assert session_id(["a", "b"], None) == session_id(["b", "a"], None) != session_id(["a"], None)
    assert session_id(["a"], None) != session_id(["a"], "s") != session_id(["a"], "s", [("a", 0, 4)])
    assert len(session_id(["a"], None)) == 16


def test_a_late_file_regroups_and_the_old_ids_point_to_the_new_one() -> None:
    old = grouped(log("a", 0, 100), log("c", 200, 300))
    (new,) = grouped(log("a", 0, 100), log("b", 100, 200), log("c", 200, 300))
    events = regroup(old, [new])
    assert events[0] == new
    assert [(e.session, e.into) for e in events if isinstance(e, SessionRegrouped)] == [
        (old[0].session, new.session),
        (old[1].session, new.session),
    ]
    assert {e.why for e in events if isinstance(e, SessionRegrouped)} == {"2 more files of the same test came"}


def test_nothing_new_means_no_event_and_keeps_the_recognised_kind() -> None:
    (found,) = grouped(log("a", 0, 100))
    known = replace(found, kind="s1", kind_why="2,000 rpm held")
    assert regroup([known], [found]) == []
    (again,) = grouped(log("a", 0, 100, products={"x": "y"}, decoder="2"), log("a", 0, 100, "b1"))
    assert regroup([known], [again]) == []


def test_a_changed_specimen_regroups_with_the_reason() -> None:
    old = grouped(log("a", 0, 100))
    new = grouped(log("a", 0, 100), overrides={"a": Override(specimen="stator-07")})
    (_, gone) = regroup(old, new)
    assert isinstance(gone, SessionRegrouped)
    assert gone.why == "specimen is now stator-07 (was not given)"


LOGS = st.lists(
    st.tuples(st.integers(0, 400), st.integers(0, 100), st.sampled_from(["b1", "b2"]), st.booleans()), max_size=9
)


@settings(max_examples=60, deadline=None)
@given(LOGS, st.randoms(use_true_random=False), st.integers(0, 9))
def test_any_order_and_any_split_into_calls_give_the_same_sessions(
    entries: list[tuple[int, int, str, bool]], random: Any, cut: int
) -> None:
    benches = {"b1": BENCH, "b2": replace(BENCH, sha256="b2", join_gap_s=10.0)}
    logs = [log(f"r{i}", at, at + length, bench, absolute=sure) for i, (at, length, bench, sure) in enumerate(entries)]
    whole = grouped(*logs, benches=benches)
    shuffled = random.sample(logs, len(logs))
    assert grouped(*shuffled, benches=benches) == whole
    first = grouped(*shuffled[:cut], benches=benches)
    current = {session.session: session for session in first}
    joined = {}
    for event in regroup(first, grouped(*shuffled, benches=benches)):
        if isinstance(event, SessionRecorded):
            current[event.session] = event
        elif isinstance(event, SessionRegrouped):
            del current[event.session]
            joined[event.session] = event.into
    assert current == {session.session: session for session in whole}
    assert set(joined.values()) <= set(current)
    assert {session.session for session in first} <= set(joined) | set(current)
