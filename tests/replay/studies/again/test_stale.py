"""What is stale is said by name and why, and asked again once."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ingest.facts import facts as ledger_facts
from ingest.facts.events import (
    BenchRegistered,
    CalibrationCompleted,
    CauseAccepted,
    DiagnosisCompleted,
    Event,
    FactRetracted,
    ModelExtended,
    ReplayCompleted,
)
from ingest.facts.ledger_row import Recorded
from ingest.facts.standing import whole
from ingest.facts.store import Store
from made import can_bench
from made.events import decode, raw, session
from replay.cli import main
from replay.studies.again.stale import StaleAnswers, became_stale, stale

LOGS = {name: raw(f"{name}.blf") for name in ("1_s1", "2_s2", "3_wltp")}
BENCH = BenchRegistered(sha256="b0", name="bench.toml", motor="servo", model="m0")


def look(*more: tuple[str, Event]) -> StaleAnswers:
    """What is stale of three sessions, each of one log, and `more`."""
    rows = ledger(*more)
    return stale(rows, ledger_facts.fold(rows))


def ledger(*more: tuple[str, Event]) -> list[Recorded]:
    """Three sessions, each of one log, and `more`."""
    events: list[tuple[str, Event]] = [("bench-b0", BENCH)]
    for name, log in LOGS.items():
        files = [{"raw": log.sha256, "decode": f"d{name}", "first_record": 0, "last_record": 9}]
        recorded = replace(session(f"id_{name}", name, bench="b0"), files=files)
        stream = f"file-{log.sha256}"
        events += [(stream, log), (stream, decode(f"d{name}", log.sha256, "b0")), (f"session-id_{name}", recorded)]
    return [
        Recorded(n, stream, n, event, None, f"2026-01-01T00:00:{n:02}.000000Z", "whyhot 0", None, None, "")
        for n, (stream, event) in enumerate([*events, *more], 1)
    ]


def key(*names: str, **more: Any) -> dict[str, Any]:
    raws = sorted(LOGS[name].sha256 for name in names)
    return {"raw": raws, "databases": [], "benches": ["b0"], "decoder": ["1"], "level": "testing", **more}


def run(name: str, model: str = "m0", **more: Any) -> tuple[str, ReplayCompleted]:
    of_run = {what: value for what, value in key(name).items() if what != "benches"} | {"bench": "b0", **more}
    event = ReplayCompleted(
        run=f"r{name}{model}{more}",
        session=f"id_{name}",
        model=model,
        motor="servo",
        digest="",
        level="testing",
        bench="b0",
        key=of_run,
        environment={},
        artefacts={},
        summary={},
    )
    return f"run-{event.run}", event


def diagnosis(
    number: str, *names: str, kept: tuple[str, ...] = (), model: str = "m0", more: dict[str, Any] | None = None
) -> list[tuple[str, Event]]:
    """A diagnosis whose model is called as it is; `more` of its key."""
    its = {"train": [f"id_{one}" for one in names], "kept": [f"id_{one}" for one in kept], "model": model}
    sessions = its | (more or {})
    made = ModelExtended(diagnosis=number, parent=model, model=f"m{number}", parent_bench=None, bench=None)
    asked = key(*names, *kept, **sessions)
    done = DiagnosisCompleted(diagnosis=number, key=asked, artefact="", summary={"causes": []})
    return [(f"diagnosis-{number}", made), (f"diagnosis-{number}", done)]


def gone(name: str) -> tuple[str, Event]:
    log = LOGS[name]
    stream = f"file-{log.sha256}"
    return stream, FactRetracted(fact=stream, name=log.name, why="a mistake", rows=[whole(log.sha256)])


def told(found: StaleAnswers) -> list[tuple[str, str]]:
    return [(one.name, one.why) for one in found.answers]


def test_what_is_of_the_facts_as_they_stand_is_not_stale() -> None:
    assert look(run("1_s1"), *diagnosis("7", "1_s1", "2_s2", kept=("3_wltp",)), run("1_s1", "m7")).answers == []


def test_what_learnt_from_a_log_that_was_taken_back_is_stale_and_so_is_all_that_follows() -> None:
    accepted = CauseAccepted(diagnosis="7", causes=[], parent="m0", model="m7", parent_bench=None, bench=None)
    later = [*diagnosis("8", "1_s1", "3_wltp", model="m7"), run("1_s1", "m8"), run("3_wltp")]
    found = look(*diagnosis("7", "1_s1", "2_s2"), ("diagnosis-7", accepted), *later, gone("2_s2"))
    assert told(found) == [
        ("diagnosis d-7", "2_s2 was taken back"),
        ("diagnosis d-8", "diagnosis d-7 is stale"),
        ("replay of 1_s1", "diagnosis d-8 is stale"),
    ]
    assert found.in_use == ["model m7, accepted from d-7: 2_s2 was taken back"]
    assert [(one.sessions, one.model) for one in found.answers] == [
        (("id_1_s1",), "m0"),
        (("id_1_s1", "id_3_wltp"), "m0"),
        (("id_1_s1",), "m0"),
    ], "from the last model that is not stale"


def test_of_two_logs_that_were_taken_back_the_second_is_told_with_what_it_made_stale() -> None:
    asked = [*diagnosis("7", "2_s2", "3_wltp"), *diagnosis("8", "1_s1", kept=("3_wltp",))]
    rows = ledger(*asked, gone("2_s2"), gone("1_s1"))
    found = became_stale(rows, ledger_facts.fold(rows[:-1]), ledger_facts.fold(rows))
    assert told(found) == [("diagnosis d-8", "1_s1 was taken back")]
    assert [name for name, _ in told(stale(rows, ledger_facts.fold(rows)))] == ["diagnosis d-7", "diagnosis d-8"]


def test_what_was_accepted_stays_named_until_another_is() -> None:
    accepted = CauseAccepted(diagnosis="7", causes=[], parent="m0", model="m7", parent_bench=None, bench=None)
    again = [*diagnosis("7", "1_s1", "2_s2"), ("diagnosis-7", accepted), gone("2_s2"), *diagnosis("8", "1_s1")]
    found = look(*again)
    assert (found.answers, len(found.in_use)) == ([], 1)
    better = replace(accepted, diagnosis="8", model="m8")
    assert look(*again, ("diagnosis-8", better)) == StaleAnswers([], [], [])


def test_a_kept_session_that_was_taken_back_makes_a_diagnosis_stale() -> None:
    (found,) = look(*diagnosis("7", "1_s1", kept=("3_wltp",)), gone("3_wltp")).answers
    assert (found.why, found.sessions, found.kept) == ("3_wltp was taken back", ("id_1_s1",), ())


def test_what_began_from_a_diagnosis_that_was_taken_back_is_stale_and_that_itself_is_gone() -> None:
    back = FactRetracted(fact="diagnosis-7", name="d-7", why="a mistake", models=["m7"])
    found = look(*diagnosis("7", "1_s1"), run("1_s1", "m7"), ("diagnosis-7", back))
    assert told(found) == [("replay of 1_s1", "model m7 was taken back")]
    before = [run("1_s1"), *diagnosis("7", "1_s1"), run("1_s1", "m7", bench="b7"), ("diagnosis-7", back)]
    assert told(look(*before)) == [], "asked again it is the replay that is there already"
    assert [one.name for one in look(*before).answered] == ["replay of 1_s1"]
    assert told(look(*before[1:])) == [("replay of 1_s1", "model m7 was taken back")], "which says more than its bench"


def test_a_replay_of_what_is_gone_is_gone_and_asked_again_nothing_is_stale() -> None:
    assert look(run("2_s2"), gone("2_s2")).answers == []
    old, new = diagnosis("7", "1_s1", "2_s2"), diagnosis("8", "1_s1")
    assert look(*old, gone("2_s2"), *new).answers == []


@pytest.mark.parametrize(
    ("other", "why"),
    [
        ({"bench": "b9"}, "1_s1 is read with another bench file now"),
        ({"databases": ["d"]}, "1_s1 is read with other signal databases now"),
        ({"decoder": ["0"]}, "1_s1 was decoded by another version now"),
        ({"raw": ["x", "y"]}, "1_s1 holds other logs now"),
    ],
)
def test_a_replay_says_what_is_other_now(other: dict[str, Any], why: str) -> None:
    assert told(look(run("1_s1", **other))) == [("replay of 1_s1", why)]
    assert look(run("1_s1", **other), run("1_s1")).answers == []


def test_a_version_of_the_bench_file_that_a_diagnosis_made_is_no_other_bench_file() -> None:
    (stream, made), (_, done) = diagnosis("7", "1_s1")
    assert isinstance(done, DiagnosisCompleted)
    versions = {"causes": [], "benches": {"of_model": {"m7": {"b0": "b7"}}}}
    with_bench = [(stream, made), (stream, replace(done, summary=versions)), run("1_s1", "m7", bench="b7")]
    assert look(*with_bench).answers == []
    assert told(look(*with_bench[2:])) == [("replay of 1_s1", "1_s1 is read with another bench file now")]


def test_of_several_sessions_those_are_named_that_are_read_otherwise() -> None:
    other = {"decoder": ["0", "1"]}
    assert told(look(*diagnosis("7", "1_s1", "2_s2", more=other))) == [
        ("diagnosis d-7", "1_s1 and 2_s2 were decoded by another version now")
    ], "nobody knows which by such a key"
    log = LOGS["2_s2"].sha256
    files = [{"raw": log, "decode": "new", "first_record": 0, "last_record": 9}]
    again = [
        (f"file-{log}", decode("new", log, "b9")),
        ("session-id_2_s2", replace(session("id_2_s2", "2_s2", bench="b9"), files=files)),
    ]
    (found,) = look(*diagnosis("7", "1_s1", "2_s2"), *again).answers
    assert found.why == "2_s2 is read with another bench file now"


def test_what_is_read_with_a_file_that_another_session_had_already_is_stale() -> None:
    asked = diagnosis("7", "1_s1", "2_s2", more={"decodes": ["d1_s1", "dother"]})
    assert told(look(*asked)) == [("diagnosis d-7", "2_s2 is read with other files now")]
    assert look(*diagnosis("7", "1_s1", "2_s2", more={"decodes": ["d1_s1", "d2_s2"]})).answers == []


@pytest.mark.parametrize("asked", [[run("1_s1")], diagnosis("7", "1_s1", "2_s2"), [run("1_s1", "m7")]])
def test_what_began_from_the_motor_file_that_a_correction_replaced_is_stale(asked: list[tuple[str, Event]]) -> None:
    """Bench file and signal databases are the same: only the motor file beside it is another."""
    log = LOGS["1_s1"].sha256
    before = ("file-" + log, replace(decode("before", log, "b0"), model="m0"))
    accepted = CauseAccepted(diagnosis="9", causes=[], parent="m0", model="m7", parent_bench=None, bench=None)
    files = [{"raw": log, "decode": "d1_s1", "first_record": 0, "last_record": 9}]
    other = ("bench-b0", replace(BENCH, model="m9"))
    now = ("session-id_1_s1", replace(session("id_1_s1", "1_s1", bench="b0"), files=files, model="m9"))
    (found,) = look(before, *asked, ("diagnosis-9", accepted), other, now).answers
    assert (found.why, found.model) == ("1_s1 is read with another motor file now", None)
    assert look(before, *asked, ("diagnosis-9", accepted)).answers == [], "what is accepted is no other"
    assert look(before, run("1_s1", "m8"), other, now).answers == [], "it was asked for by --model"


def test_a_calibration_is_stale_by_its_sessions() -> None:
    empty: dict[str, Any] = {"environment": {}, "parameters": [], "errors": [], "converged": True, "iterations": 1}
    made = CalibrationCompleted(
        calibration="c",
        sessions=["id_1_s1", "id_2_s2"],
        parent="m5",
        model="m6",
        motor="servo",
        **{"level": "testing", "key": key("1_s1", "2_s2"), "log_posterior": 0.0, **empty},
    )
    (found,) = look(("calibration-c", made), gone("2_s2")).answers
    assert (found.name, found.sessions, found.model) == ("calibration c", ("id_1_s1",), "m5")


def test_one_command_replays_what_a_correction_made_stale(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    can_bench.write_files(tmp_path)
    can_bench.write_log(tmp_path / "1_s1.blf", seconds=60, seed=1)
    (tmp_path / "other.toml").write_text(can_bench.BENCH.replace("[[channel]]", "[[channel]]\nbias_sd = 1.0", 1))
    monkeypatch.setenv("WHYHOT_STORE", "store")
    assert main(["ingest", "1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc"]) == 0
    assert main(["replay", "1_s1"]) == 0
    assert main(["correct", "1_s1", "--bench", "other.toml", "--reason", "the bias was wrong"]) == 0
    said = capsys.readouterr().out
    assert "Stale             replay of 1_s1: 1_s1 is read with another bench file now" in said
    assert said.endswith("Next              whyhot stale --store store --redo\n")
    assert main(["stale", "--redo", "--json", "redone.json"]) == 0
    assert (
        "Again             replay of 1_s1 (1_s1 is read with another bench file now): replay "
        in capsys.readouterr().out
    )
    redone = json.loads((tmp_path / "redone.json").read_text())
    with Store.open(tmp_path / "store") as store:
        runs = list(ledger_facts.at(store.ledger).runs)
    assert ([one["new"] for one in redone["redone"]], redone["stale"]) == (runs[1:], [])
    assert main(["stale"]) == 0
    said = capsys.readouterr().out
    with Store.open(tmp_path / "store") as store:
        before, first = store.ledger.head(), ledger_facts.at(store.ledger).runs[runs[0]]
        then = next(one.position for one in store.ledger.events(ReplayCompleted)) - 1
    assert main(["replay", "1_s1", "--as-of", str(then), "--json", "then.json"]) == 0
    asked = json.loads((tmp_path / "then.json").read_text())
    assert (asked["runs"][0]["run"], asked["runs"][0]["digest"]) == (first.run, first.digest), "as it came out then"
    assert capsys.readouterr().err == f"as of {then}: what was computed is not kept: without --as-of it is\n"
    assert main(["diagnose", "--on", "1_s1", "--as-of", "1"]) == 2
    assert "is not in this store" in capsys.readouterr().err
    with Store.open(tmp_path / "store") as store:
        assert store.ledger.head() == before
    assert said == "Nothing is stale: every answer uses the current sessions, files and version.\n"
