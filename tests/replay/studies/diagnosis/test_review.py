"""`whyhot review`: what a diagnosis changes, as a page to sign, each number as the ledger has it."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from made.browser import faults
from made.fleet import Fleet
from replay.cli import main

ERRORS = re.compile(r'<td class="n">([\d.]+) K</td><td class="n">([\d.]+) K</td><td class="n">([+-]?[\d.]+) K</td>')
Capture = pytest.CaptureFixture[str]


def test_a_change_is_a_page_with_every_number_down_to_its_records(
    fleet: Fleet, tmp_path: Path, capsys: Capture
) -> None:
    shutil.copytree(fleet.store, tmp_path / "store")
    store, page, target = ["--store", str(tmp_path / "store")], tmp_path / "review.html", tmp_path / "review.json"
    words = ["review", fleet.diagnosis, *store, "--out", str(page), "--json", str(target)]
    assert main(words) == 0
    offered = json.loads(target.read_text(encoding="utf-8"))
    assert (offered["schema"], offered["accepted"]) == ("whyhot.review/1", None)
    assert f"whyhot accept {store[0]} {store[1]} d-{fleet.diagnosis[:8]}" in capsys.readouterr().out
    assert main(["accept", fleet.diagnosis, *store]) == 0
    assert main(["replay", "c_1", *store]) == 0
    assert main(words) == 0
    found = json.loads(target.read_text(encoding="utf-8"))
    assert found["accepted"] > 0
    assert found["causes"] == ["loss.magnet.scale"]
    assert found["readings"] == offered["readings"]
    assert found["replaced"][0]["what"] == "motor file"
    assert offered["built_on"] == []
    assert found["built_on"] == ["1 replay of other sessions"], "those of its own sessions a review makes itself"
    magnet = next(one for one in found["by_kind"] if one["node"] == "magnet")
    assert magnet["kind"] == "wltp"
    assert magnet["sessions"] == 2
    assert magnet["before_K"] > 10 * magnet["after_K"]

    assert faults(page) == []
    text = page.read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    for part in ("May this be what the motor is?", found["replaced"][0]["new"], "Looked at by", "whyhot retract"):
        assert part in text
    rows = ERRORS.findall(text.replace("−", "-"))
    told = [(float(before) - float(after), float(better)) for before, after, better in rows]
    assert told and all(abs(fell - better) < 0.05 for fell, better in told), "figures of a row add up"
    one = next(one for one in found["readings"] if one["channel"] == "TC_magnet")
    lineage = f"{one['runs'][0]}/TC_magnet"
    assert f"whyhot lineage --store {store[1]} {lineage}" in text
    assert main(["lineage", lineage, *store, "--json", str(target)]) == 0
    (point,) = json.loads(target.read_text(encoding="utf-8"))["points"]
    assert point["residual_K"] == pytest.approx(one["before_K"], abs=1e-9)
    assert (point["steps"], point["first"], point["last"]) == (one["steps"], one["first"], one["last"])

    assert main(["retract", fleet.diagnosis, "--reason", "the sensor had moved", *store, "--json", str(target)]) == 0
    gone = json.loads(target.read_text(encoding="utf-8"))
    assert {one["name"] for one in gone["stale"]} == {f"replay of {name}" for name in ("b_1", "b_2", "c_1")}
    said = capsys.readouterr().out
    assert "Reason            the sensor had moved" in said
    assert f"Stale             {gone['stale'][0]['name']}: {gone['stale'][0]['why']}" in said


def test_a_diagnosis_that_changes_nothing_has_nothing_to_sign(fleet: Fleet, tmp_path: Path, capsys: Capture) -> None:
    shutil.copytree(fleet.store, tmp_path / "store")
    store = ["--store", str(tmp_path / "store")]
    assert main(["diagnose", "--on", "c_1", "c_2", *store, "--json", str(tmp_path / "why.json")]) == 0
    answer = json.loads((tmp_path / "why.json").read_text(encoding="utf-8"))
    assert main(["review", answer["diagnosis"], *store, "--out", str(tmp_path / "review.html")]) == 2
    refused = capsys.readouterr().err
    assert "there is nothing to accept: it named no cause" in refused
    (export,) = re.findall("whyhot (motor export [0-9a-f]+) -o", refused)
    assert answer["recalibrated_model"].startswith(export.split()[-1])
    assert main([*export.split(), "-o", str(tmp_path / "motor.toml"), *store]) == 0, "what it says can be typed"
    assert not (tmp_path / "review.html").exists()
