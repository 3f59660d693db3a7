"""Names that would steer a terminal, or hide other text, are written out wherever they are shown."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from ingest.texts.plain import STEERING, plain, plain_line
from made import can_bench
from made.browser import faults
from made.places import ROOT
from made.runs import made_run
from made.seen import network, seen_channels, seen_session
from replay.cli import main
from replay.show.viewer import blueprint
from replay.show.viewer.layers import write_layers
from replay.show.viewer.seen import SessionSeen

Capture = pytest.CaptureFixture[str]
NASTY = "\x1b[2J\x9b31m\u202egnp\u2028\x07<img src=x onerror=alert(1)>[a](b)"
LONG = NASTY + "m" * (200 - len(NASTY))
BROAD = {"TC_winding": "W" * 190, "TC_yoke": "\u6e29" * 190}  # letters that are broader than others
SIGNALS = ("MotorSpeed", "PhaseCurrent", "TC_winding", "TC_yoke", "TC_magnet", "TC_coolant")


def test_json_stays_the_same_json() -> None:
    value = {NASTY: [NASTY, "\t\n", "Ω − \N{NO-BREAK SPACE}°"]}
    text = plain(json.dumps(value, ensure_ascii=False))
    assert not STEERING.search(text)
    assert json.loads(text) == value
    assert plain("Ω − \N{NO-BREAK SPACE}°\n\t") == "Ω − \N{NO-BREAK SPACE}°\n\t"
    assert plain_line("a\nb\tc\x1b") == "a\\nb\\tc\\u001b"


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A table, a bench file and a specimen, all of whose names are nasty."""
    monkeypatch.chdir(tmp_path)
    can_bench.write_files(tmp_path)
    text = can_bench.BENCH.replace("servo-01", json.dumps(NASTY)[1:-1])
    text = text.replace('[[channel]]\nsignal = "MotorTorque"\nquantity = "torque"\nunit = "Nm"\n', "")
    for name in SIGNALS:
        text = text.replace(f'signal = "{name}"', f"signal = {json.dumps(name + BROAD.get(name, LONG))}")
    attributes = f"attributes = {{inverter = {json.dumps(NASTY)}}}\n"
    Path(f"b{NASTY}.toml").write_text(text.replace("[[channel]]", attributes + "[[channel]]", 1), encoding="utf-8")
    speed, current = can_bench.drive(120, 1)
    temperatures = can_bench.truth(speed, current, 30.0)
    rows = [f"{k},{speed[10 * k]},{current[10 * k]},{','.join(map(str, temperatures[k]))},30" for k in range(120)]
    head = ",".join(["time", *(f"{name}{BROAD.get(name, LONG)}" for name in SIGNALS)])
    with Path(f"1{NASTY}.csv").open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join([head, *rows]) + "\n")
    return tmp_path


def test_names_are_shown_escaped_on_the_terminal_and_in_the_report(
    bench: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log, name = f"1{NASTY}.csv", f"1{NASTY}"
    said = ""
    for code, words in (
        (0, ["inspect", log]),
        (0, ["ingest", log, "--bench", f"b{NASTY}.toml"]),
        (0, ["sessions"]),
        (0, ["sessions", "--json"]),
        (0, ["show", name]),
        (0, ["show", name, "--json"]),
        (0, ["attach", "motor.toml", "--specimen", NASTY, "--finding", NASTY]),
        (0, ["replay", name]),
        (0, ["report", name]),
        (0, ["morning", log, "--bench", f"b{NASTY}.toml", "--report", "morning.html"]),
        (0, ["export", name, "--to", "csv", "--out", "samples.csv"]),
        (0, ["index", "--out", "site"]),
        (0, ["index", "--out", "site"]),
        (0, ["sql", "SELECT * FROM channels"]),
        (0, ["sql", "SELECT * FROM channels", "--csv"]),
        (2, ["show", f"nothing{NASTY}"]),
        (2, ["sql", f"FROM nothing{NASTY}"]),
        (2, ["ingest", f"nothing{NASTY}.csv"]),
    ):
        assert main(words) == code, words
        out, err = capfd.readouterr()
        assert not STEERING.search(out + err), (words, STEERING.search(out + err))
        said += out + err
    assert "\\u001b[2J" in said
    assert "0 files written, 3 unchanged" in said
    links = re.findall(
        r'<td class="name"><a href="(.*?)">', (bench / "site" / "index.html").read_text(encoding="utf-8")
    )
    assert len(links) == 1
    for path in ("report.html", "morning.html", "site/index.html", f"site/{links[0]}"):
        page = (bench / path).read_text(encoding="utf-8")
        assert not STEERING.search(page) and "<img" not in page
        assert "\\u001b[2J" in page
    head = (bench / "samples.csv").read_text(encoding="utf-8").splitlines()[0]
    assert not STEERING.search(head) and head.count("\\u001b[2J") == len(SIGNALS) - len(BROAD)
    for path in ("morning.html", "site/index.html"):
        assert faults(bench / path) == [], path


def test_names_are_shown_escaped_in_the_viewer(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    run = made_run(NASTY)
    observed = tuple(replace(one, channel=one.channel + LONG) for one in run.observed)
    errors = [replace(one, node=one.node + LONG) for one in run.summary.channels]
    run = replace(run, observed=observed, summary=replace(run.summary, channels=errors))
    channels = [replace(one, spec=replace(one.spec, name=one.spec.name + LONG)) for one in seen_channels()]
    named = SessionSeen(replace(seen_session(), name=NASTY), channels, {"published": run}, network())
    layers = write_layers(named, tmp_path)
    told = [one for file in layers for one in _told(file)]
    assert sum("\\u001b[2J" in text for _, text in told) > 10
    assert not [text for _, text in told if STEERING.search(text)]
    answers = [text for column, text in told if column == "TextDocument:text"]
    assert len(answers) == len(layers) == 3
    assert all("&lt;img src" in text and "[a] (b)" in text for text in answers)
    assert not [text for text in answers if "<img" in text or "](" in text], "no tag, no link"
    assert not STEERING.search(str(blueprint.series(NASTY, []).name))


def _told(layer: Path) -> Iterator[tuple[str, str]]:
    """Every text that a file for the viewer shows, with its column, and the paths of its tree."""
    for chunk in pytest.importorskip("rerun.chunk").RrdReader(layer).stream():
        batch = chunk.to_record_batch()
        yield "path", batch.schema.metadata[b"rerun:entity_path"].decode()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if str(column.type).startswith("list") and str(column.flatten().type) == "string":
                yield from ((name, text) for text in column.flatten().to_pylist())


def test_what_the_command_line_and_a_motor_file_hold_is_escaped_in_their_refusals(
    bench: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    Path("m.toml").write_text(can_bench.MOTOR.replace('"magnet"', json.dumps(f"m{NASTY}")), encoding="utf-8")
    assert main(["motor", "check", "m.toml"]) == 2
    assert main([f"verb{NASTY}"]) == 2
    out, err = capfd.readouterr()
    assert not STEERING.search(out + err)
    assert len(err.splitlines()) == 2


def test_there_is_one_door_to_the_terminal() -> None:
    """And one for a notebook that runs as a script, which no verb is in."""
    doors = set()
    for path in sorted((ROOT / "replay").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print":
                doors.add(path.name)
    assert doors == {"encoding.py", "progress.py", "cells.py"}
