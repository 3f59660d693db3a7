"""`whyhot bisect`: since when a channel reads otherwise than the model, and what changed there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from made.fleet import Fleet
from replay.cli import main

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
    assert abs(published[0]) < 0.5
    assert published[1] > 5.0
    assert text.rstrip().splitlines()[-1] == f"next: whyhot replay --store {fleet.store} a_1 a_2"


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
