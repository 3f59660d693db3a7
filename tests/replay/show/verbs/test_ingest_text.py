"""What `whyhot ingest` says in text: the balance that holds, and one line for what is one fault."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ingest.facts.events import QualityFlagged
from ingest.intake.intake import Intake, Taken
from made.events import decode, session, sha
from replay.show.verbs.intake import intake_json, intake_text

BALANCE = {"found": 16, "decoded": 13, "unknown_id": 2, "wrong_length": 1, "rejected": 0}
LINE = "  decoded 13 · unknown id 2 · wrong length 1 · rejected 0 = 16 "
Span = tuple[float, float]  # s


def taken(name: str, **more: Any) -> Taken:
    event = decode(sha(name), sha(name), **({"balance": BALANCE} | more))
    return Taken(name, 1234, "frames", sha(name), event, known=False, refusal=None)


def channel(name: str, bus: str | None) -> dict[str, Any]:
    return {"name": name, "signal": {"name": name, "bus": bus} if bus else None}


def gap(name: str, *spans: Span) -> QualityFlagged:
    ends = [{"start_ns": round(a * 1e9), "end_ns": round(b * 1e9)} for a, b in spans]
    return QualityFlagged(flag="gap", says=f"{name} has no samples", detail={"channel": name, "spans": ends})


def intake(flags: Sequence[QualityFlagged], **buses: str | None) -> Intake:
    """One log `a.blf` of the session `a`, with these channels."""
    file = taken("a.blf", channels=[channel(name, bus) for name, bus in buses.items()])
    of = replace(session("5", "a"), files=[{"raw": file.raw}])
    return Intake((file,), (of,), tuple(("a", flag) for flag in flags))


def said(flags: Sequence[QualityFlagged], **buses: str | None) -> list[str]:
    lines = intake_text(intake(flags, **buses)).splitlines()
    return [line for line in lines if line.startswith("  a: ")]


def test_a_whole_log_says_what_became_of_every_record_in_the_file() -> None:
    assert LINE + "in the file: the balance holds" in intake_text(Intake((taken("a.blf"),), (), ()))


def test_one_more_session_of_a_log_is_one() -> None:
    file = taken("a.blf")
    of = [replace(session(number, "a"), files=[{"raw": file.raw}]) for number in "567"]
    assert " and 1 more session\n" in intake_text(Intake((file,), tuple(of[:2]), ()))
    assert " and 2 more sessions\n" in intake_text(Intake((file,), tuple(of), ()))


def test_of_a_log_that_is_cut_only_what_was_read_is_known() -> None:
    text = intake_text(Intake((taken("a.blf", outcome="salvaged"),), (), ()))
    assert LINE + "read: the balance holds" in text


def test_a_log_in_which_nothing_can_be_read_has_no_balance() -> None:
    nothing = dict.fromkeys(BALANCE, 0)
    text = intake_text(Intake((taken("a.blf", outcome="quarantined", balance=nothing),), (), ()))
    assert text == f"a.blf   1.2 kB   quarantined   sealed {sha('a.blf')[:12]}"


def test_a_session_that_keeps_another_bench_or_motor_file_says_so() -> None:
    file = taken("a.blf", bench="b", model="m2")
    of = replace(session("5", "a", bench="b"), files=[{"raw": file.raw}], model="m1")
    kept = "  a: most of its files came with another bench or motor file, which it keeps: to change that, ingest all"
    assert kept in intake_text(Intake((file,), (of,), ()))
    assert kept not in intake_text(Intake((file,), (replace(of, model="m2"),), ()))


def test_a_bus_that_is_silent_once_is_one_line_and_stays_one_fact_a_channel() -> None:
    flags = [gap("T1", (100, 103.2)), gap("T2", (100.1, 103.1)), gap("sum", (100, 103.3))]
    assert said(flags, T1="can2", T2="can2", sum=None) == ["  a: gaps: 3 channels of can2 silent for 3.0 s, 1 time"]
    assert len(intake_json(intake(flags, T1="can2", T2="can2", sum=None))["flags"]) == 3


def test_a_logger_that_pauses_is_silent_on_all_buses() -> None:
    flags = [gap("T1", (10, 12), (50, 54)), gap("n", (10, 12), (50, 54))]
    assert said(flags, T1="can2", n="can1") == ["  a: gaps: 2 channels of a.blf silent for up to 4.0 s, 2 times"]


def test_gaps_at_different_times_or_of_unknown_files_stay_apart() -> None:
    flags = [gap("T1", (10, 12)), gap("T2", (30, 32)), gap("T3", (10, 12), (30, 32)), gap("other", (10, 12))]
    flags.append(replace(gap("T1", (10, 12)), flag="held", says="T1 holds its last value"))
    assert said(flags, T1="can2", T2="can2", T3="can2") == [f"  a: {flag.says}" for flag in flags]


def test_what_a_sensor_repeats_in_several_sessions_is_one_line() -> None:
    stuck = replace(gap("T1", (10, 12)), flag="held", says="T1 holds its last value for 2.0 s: masked")
    other = replace(gap("T2", (10, 12)), flag="held", says="T2 holds its last value for 2.0 s: masked")
    found = Intake((), (), (("a", stuck), ("a", other), ("b", stuck), ("c", stuck), ("c", gap("T1", (30, 32)))))
    assert intake_text(found).splitlines() == [
        "  a: T1 holds its last value for 2.0 s: masked; the like in b and c",
        "  a: T2 holds its last value for 2.0 s: masked",
        "  c: T1 has no samples",
    ]
