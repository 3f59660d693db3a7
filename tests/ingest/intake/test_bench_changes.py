"""Logs from before and after a sensor was moved and a signal renamed, under one bench file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from replay.cli import main

Capture = pytest.CaptureFixture[str]

BENCH = """\
schema = "whyhot.bench/1"
specimen = "m1"
[time]
column = "epoch_s"
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "T3"
quantity = "temperature"
unit = "degC"
node = "winding"
[[channel]]
signal = "Tmag"
quantity = "temperature"
unit = "degC"
node = "magnet"
"""
CHANGES = """\
[[change]]
from = 2025-10-10
channel = "T3"
node = "yoke"
reason = "came loose, glued to the yoke"
[[change]]
from = 2025-10-10
channel = "Tmag"
signal = "Rotor_Magnet"
"""
DAY_S = 86_400
START = 1_760_000_000  # 2025-10-09 08:53:20 UTC


class Bench:
    """A folder with two logs, a bench file and a store."""

    def __init__(self, folder: Path, capsys: Capture) -> None:
        self.folder, self.capsys = folder, capsys
        self.write("1_old", START, "Tmag")
        self.write("2_new", START + DAY_S, "Rotor_Magnet")

    def write(self, name: str, start: float, magnet: str, seconds: int = 120) -> str:
        rows = "".join(f"{start + i},1000,{40 + i / 10},{60 + i / 10}\n" for i in range(seconds))
        (self.folder / f"{name}.csv").write_text(f"epoch_s,n,T3,{magnet}\n{rows}", encoding="utf-8")
        return name

    def ingest(self, *names: str, bench: str = BENCH + CHANGES) -> tuple[int, str]:
        (self.folder / "bench.toml").write_text(bench, encoding="utf-8")
        logs = [str(self.folder / f"{name}.csv") for name in names]
        return self.run("ingest", *logs, "--bench", str(self.folder / "bench.toml"))

    def run(self, *words: str) -> tuple[int, str]:
        code = main([*words, "--store", str(self.folder / "store")])
        printed = self.capsys.readouterr()
        return code, printed.out + printed.err

    def rows(self, query: str) -> list[dict[str, Any]]:
        code, printed = self.run("sql", query, "--json")
        assert code == 0, printed
        return list(json.loads(printed)["rows"])


@pytest.fixture
def bench(tmp_path: Path, capsys: Capture) -> Bench:
    return Bench(tmp_path, capsys)


PLACES = "SELECT session_name, channel, node FROM channels WHERE node IS NOT NULL ORDER BY ALL"
MEANT = [
    {"session_name": "1_old", "channel": "T3", "node": "winding"},
    {"session_name": "1_old", "channel": "Tmag", "node": "magnet"},
    {"session_name": "2_new", "channel": "T3", "node": "yoke"},
    {"session_name": "2_new", "channel": "Tmag", "node": "magnet"},
]


@pytest.mark.parametrize("together", [True, False])
def test_each_session_has_its_sensors_where_they_were_then(bench: Bench, together: bool) -> None:
    for names in [("1_old", "2_new")] if together else [("1_old",), ("2_new",)]:
        code, printed = bench.ingest(*names)
        assert code == 0, printed
    assert bench.rows(PLACES) == MEANT
    counted = "SELECT channel, count(*) AS n FROM samples WHERE channel = 'Tmag' GROUP BY ALL"
    assert bench.rows(counted) == [{"channel": "Tmag", "n": 240}]


def test_show_lineage_and_repeat_say_since_when(bench: Bench) -> None:
    bench.ingest("1_old", "2_new")
    moved = "since 2025-10-10: T3: node yoke (was winding) (came loose, glued to the yoke)"
    assert moved in bench.run("show", "2_new")[1] and "since 2025" not in bench.run("show", "1_old")[1]
    assert json.loads(bench.run("show", "2_new", "--json")[1])["changes"] == [
        moved.removeprefix("since "),
        "2025-10-10: Tmag: signal Rotor_Magnet (was Tmag)",
    ]
    assert "T3: node yoke (was winding)" in " ".join(bench.run("lineage", "2_new")[1].split())
    assert "T3: node yoke (was winding)" in " ".join(bench.run("repeat", "1_old", "2_new")[1].split())


def test_a_bench_file_that_learns_of_the_change_later_gives_the_same(bench: Bench) -> None:
    bench.ingest("1_old", bench=BENCH)
    code, printed = bench.ingest("1_old", "2_new")
    assert code == 0, printed
    assert bench.rows(PLACES) == MEANT


def test_what_was_made_is_made_again_alike(bench: Bench) -> None:
    bench.ingest("1_old", "2_new")
    code, printed = bench.run("rebuild", "--verify")
    assert code == 0, printed
    assert bench.rows(PLACES) == MEANT


def test_a_change_between_two_logs_makes_two_sessions_of_them(bench: Bench) -> None:
    midnight = START - START % DAY_S + DAY_S  # 2025-10-10 00:00 UTC
    names = bench.write("3_eve", midnight - 120, "Tmag"), bench.write("4_day", midnight + 1, "Rotor_Magnet")
    assert bench.ingest(*names)[0] == 0
    assert [row["name"] for row in bench.rows("SELECT name FROM sessions ORDER BY name")] == list(names)


def test_a_change_within_a_log_is_refused_in_one_line(bench: Bench) -> None:
    midnight = START - START % DAY_S + DAY_S
    code, printed = bench.ingest(bench.write("5_night", midnight - 60, "Tmag"))
    assert code == 2 and len(printed.splitlines()) == 1
    assert "the change of 2025-10-10 falls within 5_night.csv (2025-10-09 23:59:00 UTC to 2025-10-10 00:00:59 UTC)" in (
        printed
    )


def test_a_log_without_a_date_is_refused_where_dates_tell_what_it_means(bench: Bench) -> None:
    code, printed = bench.ingest(bench.write("6_undated", 0.0, "Tmag"))
    assert code == 2 and len(printed.splitlines()) == 1
    assert "6_undated.csv has no date, so nothing tells whether it is from before 2025-10-10: say its start" in printed


def test_a_motor_file_is_asked_for_the_places_of_all_times(bench: Bench) -> None:
    (bench.folder / "motor.toml").write_text(
        'name = "m"\n[scale]\nspeed_rpm = 1000\n[[node]]\nname = "winding"\ncapacity = 100\n[[node]]\nname = "magnet"\n'
        'capacity = 100\n[[boundary]]\nname = "coolant"\n'
        '[[link]]\nbetween = ["winding", "coolant"]\nterms = [{coefficient = 1.0}]\n'
        '[[link]]\nbetween = ["magnet", "winding"]\nterms = [{coefficient = 1.0}]\n',
        encoding="utf-8",
    )
    code, printed = bench.ingest("1_old", bench=BENCH.replace("specimen", 'motor = "motor.toml"\nspecimen') + CHANGES)
    assert code == 2 and 'node "yoke" of signal "T3" is not in the motor file.' in printed
