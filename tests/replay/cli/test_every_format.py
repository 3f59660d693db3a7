"""A folder with a log of every format, as a bench of many loggers leaves it, on its way through the verbs."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from ingest.formats import FORMATS
from made import can_bench
from made.every_format import NAME, WRITERS, can_be_read
from replay.cli import main

Capture = pytest.CaptureFixture[str]

LOGGERS = ("can0:Temps", "can1:Temps", "rows")  # buses are counted from 0 in some formats, from 1 in others
BENCH = 'schema = "whyhot.bench/1"\nspecimen = "servo-01"\n' + "".join(
    f'[[channel]]\nsignal = "{one}.{NAME}"\nquantity = "temperature"\nunit = "degC"\nnode = "winding"\n'
    for one in LOGGERS
)
DAY_S = 86_400.0
VALUES = [20 + i / 100 for i in range(120)]


def answer(capsys: Capture, *words: str) -> dict[str, Any]:
    """What a verb says in JSON; it refuses and skips nothing."""
    capsys.readouterr()
    assert main([*words, "--json"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    found: dict[str, Any] = json.loads(printed.out)
    assert not found.get("refused") and not found.get("skipped")
    return found


def test_a_log_of_every_format_goes_through_every_verb(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    assert {one.name for one in FORMATS} <= WRITERS.keys(), "a new format brings a writer"
    monkeypatch.chdir(tmp_path)
    names, night = can_be_read(), Path("night")
    night.mkdir()
    for day, name in enumerate(names):
        WRITERS[name](night / name, [(day * DAY_S + i / 2, value) for i, value in enumerate(VALUES)])
    Path("bench.toml").write_text(BENCH, encoding="utf-8")
    (night / "bench.dbc").write_text(can_bench.DBC, encoding="utf-8")
    words = ("night", "--bench", "bench.toml", "--dbc", "night")
    looked = answer(capsys, "inspect", *words)["files"]
    assert {one["name"]: one["found"] for one in looked} == dict.fromkeys(names, len(VALUES))
    assert {one["name"] for one in answer(capsys, "morning", *words)["sessions"]} == set(names)
    answer(capsys, "ingest", *words)
    assert [one["name"] for one in answer(capsys, "sessions")["sessions"]] == names
    for name in names:
        shown = answer(capsys, "show", name)
        assert [one["samples"] for one in shown["channels"] if one["node"] == "winding"] == [len(VALUES)], name
        answer(capsys, "export", name, "--to", "csv")
        with Path(f"{name}.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert [float(row["t_s"]) for row in rows] == pytest.approx([i / 2 for i in range(len(VALUES))], abs=1e-3)
        assert [float([*row.values()][-1]) for row in rows] == pytest.approx(VALUES), name
