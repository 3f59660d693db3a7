"""`whyhot bisect`: since when a channel reads otherwise than the model, and what changed there."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from made.fleet import Fleet
from replay.cli import main
from replay.show.reports.bisect import bisect_text
from replay.studies.since.acting import Since
from replay.studies.since.bisect import Began, Bisected

Capture = pytest.CaptureFixture[str]


def test_the_session_where_it_began_is_found_with_what_changed(fleet: Fleet, tmp_path: Path, capsys: Capture) -> None:
    target = tmp_path / "bisect.json"
    words = ["TC_magnet", "--specimen", "servo-01", "--store", str(fleet.store)]
    assert main(["bisect", *words, "--json", str(target)]) == 0
    found, text = json.loads(target.read_text(encoding="utf-8")), capsys.readouterr().out
    assert found["schema"] == "whyhot.bisect/1"
    assert found["nothing_began"] < 0.01
    assert found["since"][0]["says"][:2] == ["since a_2", "inverter = sw 4.2"]
    assert found["since"][0]["probability"] > 0.5
    assert found["causes"][0]["id"].startswith("loss.magnet.")
    total = found["nothing_began"] + sum(one["probability"] for one in found["since"])
    assert total == pytest.approx(1.0)
    assert "inverter = sw 4.2 (was sw 4.1)" in [one["says"] for one in found["changes"]]
    published = [one["published_K"] for one in found["sessions"]]
    assert found["crudeness"] > 1.0 and "In doubt" not in text, "it began later: no file does that"
    assert abs(published[0]) < 0.5
    assert published[1] > 5.0
    assert text.rstrip().splitlines()[-1] == f"next: whyhot replay --store {fleet.store} a_1 a_2"


def test_what_a_crude_file_may_lack_is_in_doubt_as_a_cause() -> None:
    always = ("in all sessions",)
    causes = (Began("capacity.winding.attached", always, 0.98, 900.0, 90.0),)
    found = Bisected("T_W", None, "m", "0" * 64, (), 0.02, (Since(always, 0.98),), causes, None, None, (), (), 2.13)
    told = " ".join(bisect_text(found).split())
    assert "In doubt The file's numbers had to move 2.1 times as far as usual, as they do beside a large cause" in told
    assert "In doubt" not in bisect_text(replace(found, none=0.7)) + bisect_text(replace(found, crudeness=0.9))


def test_where_nothing_began_it_says_so(fleet: Fleet, capsys: Capture) -> None:
    assert main(["bisect", "TC_magnet", "--specimen", "servo-03", "--store", str(fleet.store)]) == 0
    assert "Nothing that moves TC_magnet need have begun" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["TC_magnet"], "sessions of 3 specimens (servo-01, servo-02, servo-03): say --specimen"),
        (["TC_magnet", "--sessions", "a_1", "b_1"], "sessions of 2 specimens (servo-01, servo-02): say --specimen"),
        (
            ["TC_magnet", "--sessions", "a_1", "b_1", "--specimen", "servo-01"],
            "1 session of specimen servo-01 to look in: where something began needs two at least.",
        ),
        (["TC_magnt", "--specimen", "servo-01"], "TC_magnt: observes no node in these sessions. Nearest: TC_magnet"),
        (["TC_magnet", "--specimen", "servo-09"], "--specimen servo-09: no session here is of it. Nearest: servo-0"),
    ],
)
def test_what_cannot_be_looked_for_is_refused_in_a_line(
    fleet: Fleet, words: list[str], says: str, capsys: Capture
) -> None:
    assert main(["bisect", *words, "--store", str(fleet.store)]) == 2
    assert says in capsys.readouterr().err
