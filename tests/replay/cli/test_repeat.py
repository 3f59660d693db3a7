"""`whyhot repeat`: two runs of a store, what differs, since when, and what the ledger says changed between them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ingest.morning.differences import CellDifference, ChannelDifference
from ingest.morning.repeat import Comparison
from made.browser import faults
from made.places import ROOT
from made.repeated import BENCH, write_table
from replay.cli import main
from replay.show.verbs.repeat import answer, channel_row, floor_kept

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four evenings of one test; before the third the winding's sensor was changed, and it reads 3 K too much."""
    folder = tmp_path_factory.mktemp("repeat")
    (folder / "old.toml").write_text(BENCH, encoding="utf-8")
    (folder / "new.toml").write_text(BENCH.replace("TC-1", "TC-7"), encoding="utf-8")
    for day in range(4):
        write_table(folder / f"evening_{day}.csv", day, winding_K=3.0 * (day > 1))
    for name, days in (("old", (0, 1)), ("new", (2, 3))):
        logs = [str(folder / f"evening_{day}.csv") for day in days]
        assert main(["ingest", *logs, "--bench", str(folder / f"{name}.toml"), "--store", str(folder / "s")]) == 0
    return folder / "s"


def test_it_says_what_differs_since_which_run_and_what_changed_as_the_page_shows(
    store: Path, capsys: Capture, tmp_path: Path
) -> None:
    target = tmp_path / "repeat.json"
    assert main(["repeat", "evening_0", "evening_3", "--store", str(store), "--json", str(target)]) == 0
    printed = re.sub(r"20\d\d-\d\d-\d\d \d\d:\d\d:", "2025-10-08 06:12:", capsys.readouterr().out)
    printed = printed.replace(f"whyhot show --store {store} ", "whyhot show ")
    page = (ROOT / "docs" / "morning.md").read_text(encoding="utf-8")
    assert f"```console\n$ whyhot repeat evening_0 evening_3\n{printed}```" in page
    said = " ".join(printed.split())
    assert "In evening_3, against evening_0: T_winding reads 3" in said
    assert ", since evening_2." in said
    assert "bench file new.toml: T_winding: sensor TC-7 (was TC-1)" in said
    data = json.loads(target.read_text(encoding="utf-8"))
    assert data["schema"] == "whyhot.repeat/1"
    assert [one["channel"] for one in data["channels"] if one["verdict"] == "exceeds"] == ["T_winding"]
    assert data["since"] == {"T_winding": "evening_2"}
    assert [one["event"] for one in data["changes"]] == ["BenchRegistered"]
    assert data["provenance"]["store_head"]


def test_runs_that_repeat_say_so_in_the_report_too(store: Path, tmp_path: Path, capsys: Capture) -> None:
    report = tmp_path / "repeat.html"
    assert main(["repeat", "evening_1", "evening_0", "--store", str(store), "--report", str(report)]) == 0
    page = report.read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert page.count("<svg") == 1 and faults(report) == []
    lineage = f"whyhot lineage --store {store}"
    assert f"<code>{lineage} evening_1</code>, <code>{lineage} evening_0</code>" in page
    assert "evening_0 reads as evening_1 where both were driven alike" in page
    assert "the store knows of nothing that changed" in page
    said = capsys.readouterr().out
    assert said.startswith("Answer            evening_0 reads as evening_1 where both were driven alike")
    assert "the store knows of nothing that changed" in said


def test_runs_without_a_channel_of_one_name_are_not_said_to_agree() -> None:
    beside = Comparison(("speed",), 60.0, (1.0, 1.0), (1.0, 1.0), 1, (), (), (("n",), ("Drehzahl",)))
    first, second = (SimpleNamespace(name=name) for name in "ab")
    found: Any = SimpleNamespace(first=first, second=second, beside=beside)
    assert answer(found).startswith("nothing of b can be compared with a: no channel is called alike in both.")


def test_what_start_and_drive_explain_is_not_said_to_stay_within_its_floor() -> None:
    place = CellDifference({"speed": (5000.0, 7000.0)}, 5.0, 121.0, 129.0, (-1e-14, 6.8))
    magnet = ChannelDifference(
        channel="MAG",
        quantity="temperature",
        unit="degC",
        place=None,
        first=121.0,
        second=129.0,
        difference=8.0,
        worst=place,
        floor=1.4,
        repeats=0,
        verdict="explained",
        around=False,
        constant=False,
    )
    beside = Comparison(("speed",), 60.0, (1.0, 1.0), (1.0, 1.0), 1, (magnet,), (), ((), ()))
    assert floor_kept(beside) == (
        ", but for what start and drive may explain: MAG reads 8.0 K more at about 6,000 rpm (start and drive explain "
        "0.0 to 6.8 K, floor 1.4 K)"
    )
    assert (channel_row(magnet)[1], channel_row(magnet)[5]) == ("°C", "0.0 to 6.8")
    equal = replace(magnet, worst=replace(place, second=121.0 - 1e-13, explained=(-1e-14, 0.0)), verdict="within")
    assert channel_row(equal)[4:6] == ("0.0", "")
    assert floor_kept(replace(beside, channels=(equal,))) == ": nothing exceeds its floor"


def test_a_session_is_not_compared_with_itself(store: Path, capsys: Capture) -> None:
    assert main(["repeat", "evening_2", "evening_2", "--store", str(store)]) == 2
    assert capsys.readouterr().err == "evening_2: is given twice: compare it with another run of the same test.\n"


def test_earlier_runs_are_a_floor(store: Path, capsys: Capture) -> None:
    assert main(["repeat", "evening_2", "evening_3", "--store", str(store), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["earlier"] == ["evening_1", "evening_0"]
    assert {one["verdict"] for one in data["channels"]} == {"within"}
