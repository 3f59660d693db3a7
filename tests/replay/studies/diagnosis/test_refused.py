"""What `whyhot diagnose` refuses, before anything is computed and where nothing can be."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.studies.diagnosis.question import LEAST_S

LONG_S = round(LEAST_S) + 100
SHORT_S = 60


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sessions of one motor, one of another motor, and one whose bench file observes no node."""
    folder = tmp_path_factory.mktemp("refusals")
    blind = can_bench.BENCH
    for node in ("winding", "yoke", "magnet"):
        blind = blind.replace(f'node = "{node}"', 'role = "ignored"')
    benches = {"1_long": can_bench.BENCH, "2_short": can_bench.BENCH, "3_other": can_bench.BENCH, "4_blind": blind}
    for number, (name, bench) in enumerate(benches.items()):
        own = folder / name
        own.mkdir()
        can_bench.write_files(own)
        (own / "bench.toml").write_text(bench, encoding="utf-8")
        if name == "3_other":
            (own / "bench.toml").write_text(bench.replace("servo-01", "servo-02"), encoding="utf-8")
            motor = can_bench.MOTOR.replace("servo-5kW", "servo-9kW")
            (own / "motor.toml").write_text(motor, encoding="utf-8")
        seconds = LONG_S if name in ("1_long", "4_blind") else SHORT_S
        can_bench.write_log(own / f"{name}.blf", seconds, number, can_bench.START + 86_400 * number)
        words = ["ingest", str(own / f"{name}.blf"), "--bench", str(own / "bench.toml")]
        assert main([*words, "--dbc", str(own / "bench.dbc"), "--store", str(folder / "store")]) == 0
    return folder / "store"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ["--on", "1_long", "2_short", "--hold-out", "2_short"],
            "2_short: learnt from and kept at once: a kept session must be one that --on does not name.",
        ),
        (
            ["--on", "1_lon"],
            "session '1_lon': is not in this store. Nearest: 1_long. `whyhot sessions --store STORE` lists them",
        ),
        (
            ["--on", "2_short"],
            (
                "the sessions of --on last 0 min 59 s together, too short to find a cause: at least "
                f"{LEAST_S / 60:.0f} min are needed. Add an S1 or S2 point or a drive cycle with --on."
            ),
        ),
        (
            ["--on", "1_long", "--hold-out", "3_other"],
            "the sessions' bench files name different motor files (1_long names MODEL, 3_other names MODEL): "
            + "say which one with --model.",
        ),
        (
            ["--on", "4_blind"],
            "session 4_blind: no usable channel of level testing observes a node of servo-5kW: "
            "there is nothing to learn from. " + "Say node = ... in the bench file, or leave the session out.",
        ),
        (
            ["--on", "1_long", "--level", "production"],
            "session 1_long: no usable channel of level production observes a node of servo-5kW: there is nothing to "
            + 'learn from. Say node = ... and level = "production" in the bench file, or leave the session out.',
        ),
    ],
)
def test_a_question_that_cannot_be_answered_is_refused_in_one_line(
    small: Path, capsys: pytest.CaptureFixture[str], words: list[str], line: str
) -> None:
    before = _position(small)
    capsys.readouterr()
    assert main(["diagnose", *words, "--store", str(small)]) == 2
    (told,) = capsys.readouterr().err.splitlines()
    assert re.sub(r"\b[0-9a-f]{12}\b", "MODEL", told.replace(str(small), "STORE")) == line
    assert _position(small) == before


def _position(store: Path) -> int:
    with Store.open(store) as opened:
        return opened.ledger.head().position


def test_of_a_file_with_which_nothing_converges_the_node_is_said_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    can_bench.write_files(tmp_path)
    crude = can_bench.MOTOR.replace("coefficient = 30.0, speed", "coefficient = 100000.0, speed")
    (tmp_path / "motor.toml").write_text(crude, encoding="utf-8")
    can_bench.write_log(tmp_path / "1.blf", LONG_S, 1)
    words = ["--bench", str(tmp_path / "bench.toml"), "--dbc", str(tmp_path / "bench.dbc")]
    assert main(["ingest", str(tmp_path / "1.blf"), *words, "--store", str(tmp_path / "store")]) == 0
    capsys.readouterr()
    assert main(["diagnose", "--on", "1", "--store", str(tmp_path / "store")]) == 2
    *_, told = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r'diagnosis with model \w+: node "magnet" runs away: more heat comes in than .*', told)
