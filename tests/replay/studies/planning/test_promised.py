"""`whyhot diagnose --planned P`: what a plan promised of each cause stands beside what came, and a plan that is of
something else is refused in a line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from made import diagnoses
from replay.cli import main
from replay.show.verbs import planned
from replay.studies.diagnosis.answer import Diagnosis, Stands
from replay.studies.planning.promised import came, read_plan

SESSIONS = ("--on", "1_point", "2_drive")


@pytest.fixture
def plan_file(tmp_path: Path) -> Path:
    """A plan of one session: a unit of each of two candidates stands 2 above noise before the day, 10 after."""
    one = {"usual_amplitude": 0.5, "usual_d": 1.0, "usual_d_after": 5.0}
    candidates = [{"id": diagnoses.EDDY.id, **one}, {"id": "loss.nowhere.speed", **one}]
    said = {"schema": "whyhot.plan/1", "motor": "servo", "model": "m" * 64, "sessions": [diagnoses.session_id("1_s1")]}
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({**said, "candidates": candidates}), encoding="utf-8")
    return path


def _named(*, amplitude: float, d: float) -> Diagnosis:
    stands = Stands(amplitude=amplitude, d=d)
    rival = replace(diagnoses.NAMED.rivals[0], stands=replace(stands, amplitude=1.0))
    return replace(diagnoses.NAMED, causes=[replace(diagnoses.EDDY, stands=stands)], rivals=[rival])


def test_what_was_promised_is_of_the_size_that_was_found(plan_file: Path) -> None:
    found = _named(amplitude=-0.75, d=6.0)
    cause, rival = came(read_plan(plan_file), found)
    assert (cause.id, cause.named, cause.came_d) == (diagnoses.EDDY.id, True, 6.0)
    assert (cause.promised_d_before, cause.promised_d) == (1.5, 7.5)
    assert (rival.named, rival.promised_d) == (False, None)
    lines = list(planned.paragraphs(read_plan(plan_file), found))
    assert f"{diagnoses.EDDY.id}: promised 1.5, with the day 7.5; came 6.0 (named" in lines[1]
    assert "no candidate of the plan; came 6.0 (rival" in lines[2]
    assert len(lines) == 3, "sessions of the plan and more: nothing is unlike it"


def test_a_diagnosis_without_the_day_or_without_planned_sessions_says_so(plan_file: Path) -> None:
    plan, found = read_plan(plan_file), _named(amplitude=1.0, d=6.0)
    same = replace(found, train=list(plan.sessions))
    assert "no session came after the plan" in str(planned.document(plan, same)["note"])
    assert "1 of the 1 sessions" in str(planned.document(plan, replace(found, train=["other"]))["note"])
    assert planned.document(plan, found)["note"] is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "No such file"),
        ("time_s,speed_rpm\n0,0\n", "no JSON, so no plan"),
        ("[]", "no plan"),
        ('{"schema": "whyhot.diagnosis/1"}', "no plan"),
        ('{"schema": "whyhot.plan/2"}', "another version of whyhot"),
        ('{"schema": "whyhot.plan/1", "candidates": [{"id": "loss.magnet.speed2"}]}', "another version of whyhot"),
    ],
)
def test_what_is_no_plan_is_refused_before_anything_is_computed(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str | None, says: str
) -> None:
    file = tmp_path / "p.json"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    assert main(["diagnose", *SESSIONS, "--planned", str(file), "--store", str(bench / "store")]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert "whyhot plan --json plan.json" in error


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [("motor", "washer", "a plan for washer, and the sessions are of"), ("model", "0" * 64, "made with version 0000")],
)
def test_a_plan_of_another_motor_or_version_of_it_is_refused(
    bench: Path,
    answer: Mapping[str, Any],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    key: str,
    value: str,
    says: str,
) -> None:
    other = tmp_path / "other.json"
    other.write_text(json.dumps({**answer, key: value}), encoding="utf-8")
    assert main(["diagnose", *SESSIONS, "--planned", str(other), "--store", str(bench / "store")]) == 2
    assert says in capsys.readouterr().err


def test_a_diagnosis_holds_its_answer_against_the_plan(
    bench: Path, answer: Mapping[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the plan's own sessions: what came is near what it promised before any day, as both know the same readings."""
    words = ["diagnose", *SESSIONS, "--store", str(bench / "store"), "--json", str(bench / "why.json")]
    assert main(words) == 0
    alone = json.loads((bench / "why.json").read_text(encoding="utf-8"))
    capsys.readouterr()
    assert main([*words, "--planned", str(bench / "plan.json")]) == 0
    found = json.loads((bench / "why.json").read_text(encoding="utf-8"))
    assert "planned" not in alone
    assert found["diagnosis"] == alone["diagnosis"], "the sealed answer is the same, with a plan and without"
    promised = found["planned"]["causes"]
    assert promised
    assert {one["id"] for one in promised} <= {one["id"] for one in answer["candidates"]}
    for one in promised:
        assert one["promised_d_before"] <= one["promised_d"] * (1 + 1e-6)
        assert one["came_d"] == pytest.approx(one["promised_d_before"], rel=0.5)
